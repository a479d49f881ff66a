/* SPDX-License-Identifier: MIT
 * axes.h - the axes of a platform in the order every array of them has, and the pose type.
 * Left-handed frame, +X forward, +Y right, +Z up; R = Rz(yaw) Ry(pitch) Rx(roll). Rotations in degrees, translations in mm.
 */
#ifndef HEAVE_AXES_H
#define HEAVE_AXES_H

#include "heave/fx.h"

/** Indices of a pose's axes: the order of the values in an A6 frame and of the columns of a trace. */
enum { AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_X, AXIS_Y, AXIS_Z, POSE_AXES };

/** The rotation motor, where one is present, follows the pose's axes in arrays of AXES_MAX. */
enum { AXIS_ANGLE = POSE_AXES, AXES_MAX };

/** Most cylinders a platform has. Arrays of cylinders start with cylinder 1 at index 0. */
#define CYLINDERS_MAX 6u

/** A pose of the plate: roll, pitch, yaw in degrees, then x, y, z in mm, all Q32. Pose zero is level at zero_height. */
typedef struct {
    q32_t axis_q32[POSE_AXES];
} pose_t;

#endif

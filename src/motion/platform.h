/* SPDX-License-Identifier: MIT
 * platform.h - the platform that is moved: its mechanism, the limits of its axes and cylinders, where its set-points are. Private
 * to src/motion.
 */
#ifndef PLATFORM_H
#define PLATFORM_H

#include "heave/motion.h"

/** Prepares a platform; everything rests at the settled extension.
 *  @return HV_OK; HV_ERR_RANGE: a setting is outside its range, or the neutral or settled position cannot be reached */
hv_status_t platform_init(platform_t *self, const settings_t *settings) HV_MUST_CHECK;

/** Sets the set-points to actual positions, at rest. */
void platform_place(platform_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], q32_t angle_deg_q32);

/** At the two places every ride comes back to the pose is known exactly, however the platform got there: forward kinematics from
 *  another start may end an LSB away, and a recording would not replay to the same bytes. */
void platform_note_known_pose(platform_t *self, const q32_t *extension_mm_q32);

/** The limiter of a cylinder, from 0, or of the rotation motor (AXIS_ANGLE). */
static inline const ramp_t *platform_limiter(const platform_t *self, unsigned axis)
{
    return axis == AXIS_ANGLE ? &self->axis[AXIS_ANGLE] : &self->cylinder[axis];
}

/** True if any cylinder moves. */
bool platform_are_cylinders_moving(const platform_t *self);

/** True if every set-point rests. */
bool platform_is_at_rest(const platform_t *self);

/** The pose of the cylinders' set-points.
 *  @return false: none belongs to them */
bool platform_find_pose(const platform_t *self, pose_t *pose);

/** Gives the pose axes the position, velocity and acceleration that the cylinders have.
 *  @return false: no pose belongs to the cylinders, and the axes stay as they are */
bool platform_adopt_pose(platform_t *self);

#endif

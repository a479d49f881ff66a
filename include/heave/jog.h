/* SPDX-License-Identifier: MIT
 * jog.h - motion led by hand: one cylinder, the rotation motor or one pose axis, towards the end of its way, until it is stopped
 * (motion_stop()) or there. While a motion serves, nothing else moves: an axis that no jog leads stays where it is exactly, also
 * outside of its stroke, where a drive that has not found its zero may seem to be. The limiter of a jog is slower than that of a
 * ride. The functions are those of a motion_t (motion.h).
 */
#ifndef HEAVE_JOG_H
#define HEAVE_JOG_H

#include "heave/axes.h"
#include "heave/ramp.h"

/** What is led, one at a time; members are private to src/motion. */
typedef struct {
    bool is_serving;
    bool is_posed;         /**< along a pose axis */
    uint32_t led;          /**< bit i: this cylinder (AXIS_ANGLE: the rotation motor) is led, or has not come to rest since */
    ramp_t ramp[AXES_MAX]; /**< limiter of each that is led, bounds as wide as where it began */
} jog_t;

/** Fastest and gentlest that a jog may be. */
typedef struct {
    ramp_limits_t cylinder; /**< of every one; the bounds are each cylinder's own */
    q32_t deg_per_cycle_q32;
} jog_limits_t;

struct motion;

/** Serves from now on, at rest: nothing moves by itself. Ends with motion_place(). Only where the motion rests. */
void motion_serve(struct motion *self);

/** Puts one axis where it actually is, at rest: its drive has no torque, or moves by itself. While serving.
 *  @param axis a cylinder, from 0, or AXIS_ANGLE */
void motion_place_axis(struct motion *self, unsigned axis, q32_t position_q32);

/** Leads a cylinder, or the rotation motor, towards one end of its way. While serving and at rest.
 *  @param axis a cylinder, from 0, or AXIS_ANGLE
 *  @param speed_q16 mm/s (deg/s), the sign says where to; more than the limits of a jog counts as these
 *  @return HV_OK; HV_ERR_RANGE: it is at that end already, or cannot be that slow; HV_ERR_STATE: not serving, or not at rest */
hv_status_t motion_jog_axis(struct motion *self, unsigned axis, q16_t speed_q16) HV_MUST_CHECK;

/** Leads the pose along one of its axes, as far as the cylinders reach. While serving and at rest.
 *  @param axis of the pose
 *  @param speed_q16 mm/s or deg/s; less where a cylinder would be faster than a jog may be
 *  @return as above; HV_ERR_NOSUP: this platform does not move that axis; HV_ERR_ARG: no pose belongs to the extensions */
hv_status_t motion_jog_pose(struct motion *self, unsigned axis, q16_t speed_q16) HV_MUST_CHECK;

#endif

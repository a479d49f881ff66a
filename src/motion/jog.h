/* SPDX-License-Identifier: MIT
 * jog.h - motion led by hand, as the cycle sees it; see heave/jog.h. Private to src/motion.
 */
#ifndef JOG_H
#define JOG_H

#include "heave/motion.h"

/** The limiter of an axis where nothing leads it: a cylinder, or AXIS_ANGLE. */
ramp_t *jog_own_ramp(motion_t *self, unsigned axis);

/** True where a jog may begin. */
bool jog_is_ready(const motion_t *self);

/** Where the platform is, exactly.
 *  @return false: no pose belongs to the extensions */
bool jog_find_here(const motion_t *self, q32_t from_q32[POSE_AXES]);

/** True where every cylinder is within its stroke, or at least no further out than now, and the cylinders hold the plate. */
bool jog_is_reached(const motion_t *self, const pose_t *pose);

/** Leads axes along plan.straight. @param led bit i: this axis */
void jog_begin(motion_t *self, uint32_t led, bool is_posed, const path_limits_t *limits);

/** References of MOTION_JOGGED. */
void jog_refer(motion_t *self, ramp_ref_t ref[AXES_MAX]);

/** The last word while serving, on the cylinders and on the rotation motor.
 *  @return the flags of the ramps */
unsigned jog_limit(motion_t *self, const ramp_ref_t ref[AXES_MAX], q32_t extension_mm_q32[CYLINDERS_MAX]);
q32_t jog_limit_angle(motion_t *self, const ramp_ref_t *ref);

/** True where the jog has to stop: extensions led one by one come to where the cylinders would not hold the plate. */
bool jog_is_beyond_stroke(const motion_t *self);

/** True where the jog has come to the end of its way. */
bool jog_is_done(const motion_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * jog.h - motion led by hand, as the cycle sees it; see heave/jog.h. Private to src/motion.
 */
#ifndef JOG_H
#define JOG_H

#include "heave/motion.h"

/** References of MOTION_JOGGED. */
void jog_refer(motion_t *self, ramp_ref_t ref[AXES_MAX]);

/** The last word while serving, on the cylinders and on the rotation motor.
 *  @return the flags of the ramps */
unsigned jog_limit(motion_t *self, const ramp_ref_t ref[AXES_MAX], q32_t extension_mm_q32[CYLINDERS_MAX]);
q32_t jog_limit_angle(motion_t *self, const ramp_ref_t *ref);

/** True where the jog has to stop: extensions led one by one come to where the cylinders would not hold the plate. */
bool jog_is_astray(const motion_t *self);

/** True where the jog has come to the end of its way. */
bool jog_is_done(const motion_t *self);

/** True for one that may be used; see heave/sane.h. */
bool jog_is_sane(const motion_t *saved, const motion_t *prepared);

#endif

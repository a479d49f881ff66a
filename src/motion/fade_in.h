/* SPDX-License-Identifier: MIT
 * fade_in.h - a sender that begins, or comes back, is faded in from where the platform is. Private to src/motion.
 */
#ifndef FADE_IN_H
#define FADE_IN_H

#include "heave/motion.h"

void fade_in_init(fade_in_t *self, const settings_t *settings, const ramp_limits_t *engage);

/** Fading begins, with the first target. */
void fade_in_begin(fade_in_t *self, const platform_t *platform, motion_space_t space);

/** Sets where the sender leads from now on.
 *  @param goal_q32 the end of a planned path; NULL: wherever a stream leads */
void fade_in_aim(fade_in_t *self, const platform_t *platform, motion_space_t space, const q32_t *goal_q32);

/** True as long as nobody sees where the sender leads. */
bool fade_in_is_hidden(const fade_in_t *self, follow_phase_t phase);

/** True where references that are faded in are far beyond the limits. They have not passed a ramp, and a plan that started from
 * there would take hours to come back. A little more than the limits is only rounding. */
bool fade_in_is_beyond_limits(const platform_t *platform, const followed_t *followed);

/** Fades the references of a cycle. The fading adds at most engage speed to the sender's own motion.
 *  @return false when it has ended */
bool fade_in_step(fade_in_t *self, const platform_t *platform, motion_space_t space, ramp_ref_t ref[AXES_MAX]);

#endif

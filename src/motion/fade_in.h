/* SPDX-License-Identifier: MIT
 * fade_in.h - a sender that begins, or comes back, is faded in from where the platform is. Private to src/motion.
 */
#ifndef FADE_IN_H
#define FADE_IN_H

#include "heave/motion.h"

/** Fading begins, with the first target. */
void fade_in_begin(motion_t *self);

/** What the sender leads to from now on: the end of a plan, which begins where the platform is, or wherever a stream leads. */
void fade_in_aim(motion_t *self, bool is_planned);

/** Stops if moving, and takes over from there, with the pending target. */
void fade_in_again(motion_t *self);

/** True as long as nobody sees where the sender leads. */
bool fade_in_is_hidden(const motion_t *self);

/** True where references that are faded in are far beyond the limits. They have not passed a ramp, and a plan that started from
 * there would take hours to come back. A little more than the limits is only rounding. */
bool fade_in_is_led_beyond(const motion_t *self);

/** Fades the references of a cycle. The fading adds at most engage speed to the sender's own motion. */
void fade_in_step(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out);

#endif

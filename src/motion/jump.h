/* SPDX-License-Identifier: MIT
 * jump.h - a jump of a stream as a move of its own: the stream goes on at the new place as if it had always been there, and an
 * offset leads from the old place. A ramp takes the offset of each axis to 0, all of them along a straight line, as quickly as
 * the limits allow. Private to src/motion.
 */
#ifndef JUMP_H
#define JUMP_H

#include "heave/motion.h"

/** Takes the jump to the newest slots out of the stream. Without effect where it is not far larger than the steps around it: the
 * stream makes these.
 *  @param step_q32 how far the sender has gone since the sample that jumped first */
void jump_accept(motion_t *self, const q32_t step_q32[POSE_AXES]);

/** One cycle: adds the offset to a stream's references. */
void jump_step(motion_t *self, ramp_ref_t ref[AXES_MAX]);

#endif

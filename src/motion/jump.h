/* SPDX-License-Identifier: MIT
 * jump.h - a jump of a stream as a move of its own: the stream goes on at the new place as if it had always been there, and an
 * offset leads from the old place. A ramp takes the offset of each axis to 0, all of them along a straight line, as quickly as
 * the limits allow. Private to src/motion.
 */
#ifndef JUMP_H
#define JUMP_H

#include "axis_targets.h"

/** The sample that comes next, of a stream that has jumped. */
typedef struct {
    const axis_scale_t *scale;
    const followed_t *followed;
    const q32_t *value_q32; /**< the sample as values of the axes (axis_targets.h) */
    const q32_t *step_q32;  /**< of POSE_AXES: how far the sender has gone since the sample that jumped first */
} jump_in_t;

/** Takes the jump to the sample out of the stream. Without effect where it is not far larger than the steps around it: the stream
 *  makes these.
 *  @param is_jumping an earlier jump is not yet made up
 *  @return true while jump_step() has to be called */
bool jump_accept(jump_t *self, bool is_jumping, const jump_in_t *in, stream_t *stream);

/** One cycle: adds the offset to a stream's references.
 *  @return false when it is made up */
bool jump_step(jump_t *self, ramp_ref_t ref[AXES_MAX]);

#endif

/* SPDX-License-Identifier: MIT
 * stream_shift.h - a stream at another place. Private to src/motion.
 */
#ifndef STREAM_SHIFT_H
#define STREAM_SHIFT_H

#include "heave/stream.h"

/** Finds how far a stream has jumped, beside the motion that went on.
 *  @param newest_q32 the sample that comes next
 *  @param step_q32 how far the sender has gone since the sample that jumped first
 *  @param by_q32 out
 *  @return false: that is no jump, as it is not far larger than the steps around it */
bool stream_find_jump(const stream_t *self, const q32_t newest_q32[POSE_AXES], const q32_t step_q32[POSE_AXES],
                      q32_t by_q32[POSE_AXES]);

/** Moves all that a stream that runs remembers, as if its samples had always been there. Times, rates and steps stay.
 *  @param by_q32 how far, on each pose axis */
void stream_shift(stream_t *self, const kin_t *kin, const q32_t by_q32[POSE_AXES]);

#endif

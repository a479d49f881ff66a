/* SPDX-License-Identifier: MIT
 * stream_shift.h - a stream at another place. Private to src/motion.
 */
#ifndef STREAM_SHIFT_H
#define STREAM_SHIFT_H

#include "heave/stream.h"

/** Moves all that a stream that runs remembers, as if its samples had always been there. Times, rates and steps stay.
 *  @param by_q32 how far, on each pose axis */
void stream_shift(stream_t *self, const kin_t *kin, const q32_t by_q32[POSE_AXES]);

#endif

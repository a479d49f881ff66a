/* SPDX-License-Identifier: MIT
 * stream_sane.h - whether a stream that was loaded from a file may go on; see sane.h. Pure; private to src/motion.
 * Every index, count, bool, enum and divisor has to be one that the stream itself could have; positions and their differences
 * have to be small enough to be added and multiplied. What follows from settings or from other members is worked out once more.
 */
#ifndef STREAM_SANE_H
#define STREAM_SANE_H

#include "heave/stream.h"

#define STREAM_SANE_POINT_Q32 ((q32_t)1 << 49) /**< points are guessed at, and led ahead, beyond what a sender may ask for */

/** A stream. @param prepared after stream_init() with the same settings */
bool stream_is_sane(const stream_t *saved, const stream_t *prepared);

/** Its curve; see stream_is_sane(). */
bool stream_curve_is_sane(const stream_curve_t *saved, const stream_curve_t *prepared, stream_style_t style, bool is_running);

static inline bool stream_sane_within(int64_t value, int64_t low, int64_t high)
{
    return value >= low && value <= high;
}

/** Each of them lies within +-most. */
static inline bool stream_sane_all(const q32_t *value_q32, unsigned count, q32_t most_q32)
{
    bool is_sane = true;
    for (unsigned i = 0; i < count; i++) {
        is_sane = is_sane && stream_sane_within(value_q32[i], -most_q32, most_q32);
    }
    return is_sane;
}

#endif

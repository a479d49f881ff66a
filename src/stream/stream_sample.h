/* SPDX-License-Identifier: MIT
 * stream_sample.h - what a frame of a stream is: the next sample, or none. One table of rules, in src/stream/DESIGN.md, "What a
 * sample is". Private to src/stream.
 */
#ifndef STREAM_SAMPLE_H
#define STREAM_SAMPLE_H

#include "heave/stream.h"

/** What a frame is. */
typedef enum {
    STREAM_SAMPLE_NEXT,      /**< the next sample */
    STREAM_SAMPLE_NONE,      /**< no sample: a repetition, or an old one */
    STREAM_SAMPLE_DOUBTFUL,  /**< looks like an old one, but came when the next one was due: what follows will tell */
    STREAM_SAMPLE_INSTEAD,   /**< the next sample; the one before it was doubtful, and is an old one */
    STREAM_SAMPLE_OTHER_RATE /**< the next sample of a sender that is twice as fast from now on */
} stream_sample_kind_t;

/** A stream begins. @param is_known of the sender as before: whether its values freeze stays known */
void stream_sample_reset(stream_sample_t *self, bool is_known);

/** Decides what a frame is that arrives now. Call it once for each frame. */
stream_sample_kind_t stream_sample_kind(stream_t *stream, uint64_t now_us, const q32_t *sample_q32);

/** Periods from the newest sample to this one. A loss and a late sample look alike to the clock. Where the motion so far leads to
 *  the sample in another number of periods than the time tells, and well beside it in that, the value counts; but where the time
 *  is clear.
 *  @param shift_q32 out: where value and time agree on a time between two points of the line, how far it is after the one */
unsigned stream_sample_periods(stream_t *stream, uint64_t now_us, const q32_t *sample_q32, q32_t *shift_q32);

#endif

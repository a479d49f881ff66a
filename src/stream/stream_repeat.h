/* SPDX-License-Identifier: MIT
 * stream_repeat.h - senders that send each value several times: a loop of 100 Hz beside a game of 50. Private to src/stream.
 */
#ifndef STREAM_REPEAT_H
#define STREAM_REPEAT_H

#include "heave/stream.h"

enum {
    STREAM_REPEAT_RUN_MAX = 8,   /**< a value that comes more often stands */
    STREAM_REPEAT_RUNS_MOST = 16 /**< runs that count; what is older counts half */
};

/** Forgets what was seen of a sender. */
void stream_repeat_reset(stream_repeat_t *self, uint64_t now_us);

/** Looks at the next sample. The stream runs.
 *  @param is_caught_up its values froze before it: that was no repetition
 *  @return true if it only repeats the newest one, as this sender does; a sample that stands for longer is none of these */
bool stream_repeat_watch(stream_t *stream, uint64_t now_us, bool is_caught_up, const q32_t *sample_q32);

/** The period of the values, where it is just found that the sender repeats them, or how often; else 0. */
uint32_t stream_repeat_period_us(stream_t *stream);

#endif

/* SPDX-License-Identifier: MIT
 * stream_clock.h - the time line of a sender, found from the arrivals of its samples: period, losses, lateness.
 * Mean interval at first, then a second-order phase-locked loop. Reads no clock; private to src/motion.
 */
#ifndef STREAM_CLOCK_H
#define STREAM_CLOCK_H

#include "heave/stream.h"

#define STREAM_US_Q16 65536 /**< one us in the clock's Q16 */

/** Forgets everything but what the sender states; the first sample came at now_us. */
void stream_clock_start(stream_clock_t *self, uint64_t now_us);

/** What the sender states as its period now, 0 = nothing.
 *  @return true if the time line is slower than one without a statement may be */
bool stream_clock_hint(stream_clock_t *self, uint32_t hint_us);

/** True while samples come regularly: the newest is 150 ms or 3.5 periods old at most. */
bool stream_clock_is_live(const stream_clock_t *self, uint64_t now_us);

/** True if a sample at now_us still belongs to the stream of the last one: one that is known may be away for a second. */
bool stream_clock_is_near(const stream_clock_t *self, uint64_t now_us);

/** True if a sample at now_us comes too soon to be of the next period, whatever the jitter. */
bool stream_clock_is_soon(const stream_clock_t *self, uint64_t now_us);

/** Periods that so long an interval between two samples is, seen alone: at least 1. The period is known. */
unsigned stream_clock_periods_in(const stream_clock_t *self, uint32_t interval_us);

/** us since the newest sample, at most UINT32_MAX; 0 if now_us is before it. */
uint32_t stream_clock_elapsed_us(const stream_clock_t *self, uint64_t now_us);

/** Another share of a sender's samples is taken from now on: they are so far apart, and those so far count as if they had been.
 *  @return false where the rate was not known for long: nothing is changed */
bool stream_clock_set_period(stream_clock_t *self, uint32_t period_us);

/** Periods from the newest sample to one that arrives now, judged by time alone, and that time in periods. */
unsigned stream_clock_expect(const stream_clock_t *self, uint64_t now_us, q32_t *ahead_q32);

/** Takes the arrival of a sample that is so many periods after the newest.
 *  @return true where the sender has another rate now: its time line begins anew with this sample */
bool stream_clock_take(stream_clock_t *self, uint64_t now_us, unsigned periods);

/** Periods from the time of the newest sample to now_us, less the margin. Q32. Period known. */
q32_t stream_clock_periods(const stream_clock_t *self, uint64_t now_us);

/** Periods in a span. Q32. Period known. */
q32_t stream_clock_span(const stream_clock_t *self, uint32_t span_us);

#endif

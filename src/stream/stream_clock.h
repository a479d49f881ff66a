/* SPDX-License-Identifier: MIT
 * stream_clock.h - the time line of a sender, found from the arrivals of its samples: period, lateness, losses, and how long a
 * sample has to be waited for. Reads no clock; private to src/stream.
 */
#ifndef STREAM_CLOCK_H
#define STREAM_CLOCK_H

#include "heave/stream.h"

#define STREAM_US_Q16 ((int64_t)Q16_ONE) /* 1 us */

enum {
    STREAM_CLOCK_MEMORY = 48,       /**< samples that the line is found from */
    STREAM_CLOCK_MEMORY_MAX = 1024, /**< ... of a fast sender */
    STREAM_CLOCK_STALLED = 2,       /**< samples at the usual pace that tell that a sender stood still */
    STREAM_CLOCK_LOST_MEMORY = 256  /**< samples that losses are counted in */
};

/** Forgets everything but what the sender states; the first sample came at now_us. */
void stream_clock_start(stream_clock_t *self, uint64_t now_us);

/** What the sender states as its period now, 0 = nothing. */
void stream_clock_hint(stream_clock_t *self, uint32_t hint_us);

/** True while samples come regularly: the newest is 150 ms or 3.5 periods old at most. */
bool stream_clock_is_live(const stream_clock_t *self, uint64_t now_us);

/** True if a sample at now_us still belongs to the stream of the last one: one that is known may be away for a second. */
bool stream_clock_is_near(const stream_clock_t *self, uint64_t now_us);

/** Periods that so long an interval between two samples is, seen alone: at least 1. The period is known. */
unsigned stream_clock_periods_in(const stream_clock_t *self, uint32_t interval_us);

/** us since the newest sample, at most UINT32_MAX; 0 if now_us is before it. */
uint32_t stream_clock_elapsed_us(const stream_clock_t *self, uint64_t now_us);

/** The sender has another period from now on: its time line begins anew with the newest sample. */
void stream_clock_set_period(stream_clock_t *self, uint32_t period_us);

/** Periods from the newest sample to one that arrives now, judged by time alone: as few as its lateness may explain.
 *  @param ahead_q32 out: from the newest sample's time on the line to now, in periods
 *  @param late_q32  out: how late samples may be, in periods */
unsigned stream_clock_expect(const stream_clock_t *self, uint64_t now_us, q32_t *ahead_q32, q32_t *late_q32);

/** Takes the arrival of a sample that is so many periods after the newest.
 *  @return true where the sender has another rate now: its time line begins anew with this sample */
bool stream_clock_accept(stream_clock_t *self, uint64_t now_us, unsigned periods);

/** Takes a sample whose time tells nothing of the line. */
void stream_clock_put(stream_clock_t *self, uint64_t now_us, unsigned periods);

/** How late the latest samples of the last seconds were, in periods. Period known. */
q32_t stream_clock_jitter(const stream_clock_t *self);

/** True where samples often come two or more at a time. */
bool stream_clock_is_bursty(const stream_clock_t *self);

/** True where samples come in time but for a quarter of a period. */
bool stream_clock_is_even(const stream_clock_t *self);

/** True where more than one of 32 samples is lost. */
bool stream_clock_is_lossy(const stream_clock_t *self);

/** Share of the sender's samples that are lost, over the last 256 or so. */
uint32_t stream_clock_lost_permille(const stream_clock_t *self);

/** True where more than one of 16 is lost, of a sender that has a sample for each period. */
bool stream_clock_is_gappy(const stream_clock_t *self);

/** How late the newest sample was against the line, in periods; negative: early. Period known. */
q32_t stream_clock_lateness(const stream_clock_t *self);

/** Periods from the time of the newest sample to now_us, less the margin. Q32. Period known. */
q32_t stream_clock_periods(const stream_clock_t *self, uint64_t now_us);

/** Periods in a span. Q32. Period known. */
q32_t stream_clock_span(const stream_clock_t *self, uint32_t span_us);

#endif

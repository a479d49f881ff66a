/* SPDX-License-Identifier: MIT
 * stream_repeat.c - which samples only say the last one again.
 * The values of such a sender are a stream of their own rate, and its frames a staircase that no platform is to follow. How often
 * a value comes is the mean length of a run of equal samples. A motion that is rounded makes such runs where it is slow, but its
 * steps are then of one quantum, or two: they say nothing of the sender. Nor does a run that is long: the sender stands.
 */
#include "stream_repeat.h"

#include "stream_clock.h"
#include "stream_evidence.h"
#include "stream_quantum.h"

enum {
    RUN_MAX = STREAM_REPEAT_RUN_MAX,
    RUNS_LEAST = 8, /* that tell */
    RUNS_MOST = STREAM_REPEAT_RUNS_MOST
};

#define NEXT_DUE_Q32 (Q32_ONE * 7 / 8) /* of a period after the newest sample, one that stands is the next */

void stream_repeat_reset(stream_repeat_t *self, uint64_t now_us)
{
    *self = (stream_repeat_t){.began_us = now_us, .run = 1, .each = 1};
}

/* A run is over. Of a sender that is known to repeat, a longer one is two that happen to be of one value. */
HV_WRAPS static void count_run(stream_repeat_t *self, uint64_t now_us, bool is_significant)
{
    const uint32_t run = self->each > 1 && self->run > self->each ? self->each + 1 : self->run;
    const uint32_t took_us = (uint32_t)(now_us - self->began_us);
    if (self->run > RUN_MAX) {
        return;
    }
    self->longest = run > self->longest ? run : self->longest;
    self->frames += run;
    self->span_us += took_us / self->run * run;
    self->significant += is_significant ? 1u : 0u;
    self->runs++;
    if (self->runs == RUNS_MOST) {
        self->frames /= 2;
        self->span_us /= 2;
        self->significant /= 2;
        self->runs /= 2;
        self->longest = 0;
    }
}

bool stream_repeat_watch(stream_t *stream, uint64_t now_us, bool is_caught_up, const q32_t *sample_q32)
{
    stream_repeat_t *const self = &stream->repeat;
    q32_t ahead_q32;
    q32_t late_q32;
    if (!stream_evidence_is_newest(&stream->evidence, stream->curve.axes, sample_q32)) {
        if (!is_caught_up) {
            count_run(self, now_us, stream_quantum_is_significant(&stream->curve, stream->curve.newest_q32, sample_q32));
        }
        self->run = 1;
        self->began_us = now_us;
        return false;
    }
    self->run += self->run <= RUN_MAX ? 1u : 0u;
    (void)stream_clock_expect(&stream->clock, now_us, &ahead_q32, &late_q32);
    return self->each > 1 && (self->run <= self->each || ahead_q32 < NEXT_DUE_Q32);
}

/* How often the sender sends each value at most; as it was where that cannot be told, or is a little less: losses make it
 * so. */
static unsigned find_each(const stream_repeat_t *self)
{
    const bool is_known = self->runs >= RUNS_LEAST && self->significant * 2 >= self->runs;
    const bool is_even = self->longest * self->runs <= 2 * self->frames;
    const bool is_alone = self->frames * 3 <= self->runs * 4; /* a shake has two equal samples at each of its turns */
    const unsigned each = is_alone ? 1 : (self->frames * 4 + self->runs * 3) / (self->runs * 4 + 1);
    const bool is_less = each == 1 || self->frames * 2 + 3 * self->runs < 2 * self->each * self->runs;
    return is_known && (each > self->each ? is_even : is_less) ? each : self->each;
}

uint32_t stream_repeat_period_us(stream_t *stream)
{
    stream_repeat_t *const self = &stream->repeat;
    const unsigned each = find_each(self);
    const uint32_t period_us = self->runs > 0 ? self->span_us / self->runs : 0;
    if (self->run != 1 || each == self->each || period_us > STREAM_QUIET_US || stream->clock.hint_us > 0 ||
        stream->clock.settled < STREAM_GAPS) {
        return 0;
    }
    self->each = each;
    const int64_t is_us_q16 = stream->clock.period_us_q16;
    const int64_t off_us_q16 = fx_abs((int64_t)period_us * STREAM_US_Q16 - is_us_q16);
    return off_us_q16 * 8 > is_us_q16 ? period_us : 0; /* else the stream is at that rate already */
}

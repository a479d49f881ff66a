/* SPDX-License-Identifier: MIT
 * stream_clock.c - the time line of a sender, found from the arrivals of its samples.
 * The line is the straight line through the arrivals: by least squares over all of them at first (a growing-memory filter of
 * second order), with gains that then stay as they are after 48 of them. The margin is the lateness of the latest samples lately.
 */
#include "stream_clock.h"

enum {
    ALIKE = 6,  /* intervals alike that tell a new rate */
    KNOWN = 12, /* samples after which a stream is one */
    MEMORY = STREAM_CLOCK_MEMORY,
    MEMORY_LEAST = 8, /* ... while the sender's rate changes */
    MEMORY_FALL = 4,  /* of these in a sample, until the line follows */
    DRIFT = 8,        /* samples that the mean lateness is taken of */
    DRIFTS = 2,       /* a rate changes where that is so many times what lateness changes by at most in a period */
    SECOND = 2,       /* intervals that tell that a stated period is wrong */
    STATED = 4,       /* a stated period counts as much as so many samples */
    BURSTS = 2,       /* short intervals, of the newest 24, that tell a sender that sends in bursts */
    STALLED = STREAM_CLOCK_STALLED,
    NEW_RATE = 3, /* and so does one that the kept intervals told */
    LOST_MEMORY = STREAM_CLOCK_LOST_MEMORY,
    LOST_FIRST = 64 /* samples that losses are counted in at first */
};

#define PERIOD_MIN_Q16  ((int64_t)STREAM_PERIOD_MIN_US * STREAM_US_Q16)
#define PERIOD_MAX_Q16  ((int64_t)STREAM_PERIOD_MAX_US * STREAM_US_Q16 / 3 * 4) /* of one that runs: no flipping at the edge */
#define OPEN_Q16        ((int64_t)100000 * STREAM_US_Q16) /* at first, any sample may be late, but of a slower sender */
#define SLOW_Q16        ((int64_t)40000 * STREAM_US_Q16)
#define MARGIN_MIN_Q16  ((int64_t)500 * STREAM_US_Q16)
#define MARGIN_FREE_Q16 ((int64_t)200 * STREAM_US_Q16)
#define MARGIN_FALL_Q16 ((int64_t)5000000 * STREAM_US_Q16) /* the time in which a margin that is not needed falls to 1/e */
#define FAST_US         16000                              /* the line of a sender that is faster is found from more samples */
#define AWAY_US         1000000u
#define ELAPSED_MAX_US  4000000u /* far beyond the end of any curve */

/* Slow senders, and those that state their period, are programs that wait that long and wake late by a share of it. A guess at so
 * slow a stream is poor, and an eighth of a period more is little beside its delay. */
static int64_t margin_min_q16(const stream_clock_t *self)
{
    const bool is_slow = self->period_us_q16 >= SLOW_Q16 || self->hint_us > 0;
    const int64_t share = is_slow ? self->period_us_q16 / 8 : 0;
    return share > MARGIN_MIN_Q16 ? share : MARGIN_MIN_Q16;
}

/* What is left of the longest delay beside the curve's own; half a period there always is. */
static int64_t margin_max_q16(const stream_clock_t *self)
{
    const int64_t left = (int64_t)self->delay_max_us * STREAM_US_Q16 - 2 * self->period_us_q16;
    return left > self->period_us_q16 / 2 ? left : self->period_us_q16 / 2;
}

static void set_period(stream_clock_t *self, int64_t period_us_q16)
{
    self->period_us_q16 = fx_clamp(period_us_q16, PERIOD_MIN_Q16, PERIOD_MAX_Q16);
    self->per_us_q46 = Q62_ONE / self->period_us_q16;
}

void stream_clock_start(stream_clock_t *self, uint64_t now_us)
{
    const uint32_t hint_us = self->hint_us;
    *self = (stream_clock_t){.last_us = now_us, .delay_max_us = self->delay_max_us, .memory = MEMORY, .each = 1};
    stream_clock_hint(self, hint_us);
}

void stream_clock_hint(stream_clock_t *self, uint32_t hint_us)
{
    self->hint_us = hint_us;
    if (self->settled == 0) {
        self->period_us_q16 = 0;
        self->margin_us_q16 = MARGIN_MIN_Q16;
    }
    if (self->settled == 0 && hint_us > 0) {
        set_period(self, (int64_t)hint_us * STREAM_US_Q16);
        self->margin_us_q16 = margin_min_q16(self);
    }
}

uint32_t stream_clock_elapsed_us(const stream_clock_t *self, uint64_t now_us)
{
    const uint64_t elapsed_us = now_us > self->last_us ? now_us - self->last_us : 0;
    return elapsed_us < UINT32_MAX ? (uint32_t)elapsed_us : UINT32_MAX;
}

/* True up to so long after the newest sample, or three losses of a slow stream. */
static bool is_within(const stream_clock_t *self, uint64_t now_us, uint32_t least_us)
{
    const int64_t slow_us = self->period_us_q16 * 7 / 2 / STREAM_US_Q16;
    return stream_clock_elapsed_us(self, now_us) <= (slow_us > least_us ? slow_us : least_us);
}

bool stream_clock_is_live(const stream_clock_t *self, uint64_t now_us)
{
    return is_within(self, now_us, STREAM_QUIET_US);
}

bool stream_clock_is_near(const stream_clock_t *self, uint64_t now_us)
{
    const bool is_slow = self->settled < SECOND && self->hint_us == 0; /* perhaps */
    return is_within(self, now_us, self->settled >= KNOWN ? AWAY_US : is_slow ? STREAM_PERIOD_MAX_US : STREAM_QUIET_US);
}

q32_t stream_clock_span(const stream_clock_t *self, uint32_t span_us)
{
    return fx_mul_shift_fit((int64_t)span_us * STREAM_US_Q16, self->per_us_q46, 30);
}

q32_t stream_clock_lateness(const stream_clock_t *self)
{
    return fx_mul_shift(self->late_us_q16, self->per_us_q46, 30);
}

q32_t stream_clock_periods(const stream_clock_t *self, uint64_t now_us)
{
    const uint32_t elapsed_us = stream_clock_elapsed_us(self, now_us);
    const int64_t since_us_q16 = (int64_t)(elapsed_us < ELAPSED_MAX_US ? elapsed_us : ELAPSED_MAX_US) * STREAM_US_Q16;
    return fx_mul_shift_fit(since_us_q16 + self->late_us_q16 - self->margin_us_q16, self->per_us_q46, 30);
}

unsigned stream_clock_periods_in(const stream_clock_t *self, uint32_t interval_us)
{
    const int64_t interval_us_q16 = (int64_t)interval_us * STREAM_US_Q16;
    return (unsigned)fx_clamp((interval_us_q16 + self->period_us_q16 / 2) / self->period_us_q16, 1, INT32_MAX);
}

static uint16_t add_periods(uint32_t a, unsigned b)
{
    return (uint16_t)(b < UINT16_MAX - a ? a + b : UINT16_MAX);
}

static void record_gap(stream_clock_t *self, uint32_t gap_us, unsigned periods)
{
    self->gap_us[self->gap_next] = gap_us;
    self->gap_periods[self->gap_next] = add_periods(0, periods);
    self->gap_next = self->gap_next + 1 < STREAM_GAPS ? self->gap_next + 1 : 0;
    self->gaps += self->gaps < STREAM_GAPS ? 1u : 0u;
}

/* What comes in a burst after a stall belongs to its interval. */
static void lengthen_gap(stream_clock_t *self, uint32_t gap_us, unsigned periods)
{
    const unsigned at = (self->gap_next + STREAM_GAPS - 1) % STREAM_GAPS;
    self->gap_us[at] += gap_us;
    self->gap_periods[at] = add_periods(self->gap_periods[at], periods);
}

/* The newest intervals together. */
typedef struct {
    int64_t sum_us_q16;
    unsigned periods;   /* that they were taken for */
    unsigned long_ones; /* that were taken for more than two */
    unsigned fewest;    /* periods that one of them was taken for */
    unsigned lost;
    int64_t least_q16, most_q16; /* of one period */
} span_t;

bool stream_clock_is_even(const stream_clock_t *self)
{
    return self->settled >= KNOWN && self->jitter_us_q16 * 4 < self->period_us_q16;
}

static int64_t gap_q16(const stream_clock_t *self, unsigned at)
{
    return (int64_t)self->gap_us[at] * STREAM_US_Q16;
}

static span_t newest_gaps(const stream_clock_t *self, unsigned gaps)
{
    span_t span = {.least_q16 = INT64_MAX, .fewest = UINT16_MAX};
    for (unsigned i = 0; i < gaps; i++) {
        const unsigned at = (self->gap_next + STREAM_GAPS - 1 - i) % STREAM_GAPS;
        const int64_t each_q16 = gap_q16(self, at) / (self->gap_periods[at] > 0 ? self->gap_periods[at] : 1);
        span.least_q16 = each_q16 < span.least_q16 ? each_q16 : span.least_q16;
        span.most_q16 = each_q16 > span.most_q16 ? each_q16 : span.most_q16;
        span.sum_us_q16 += gap_q16(self, at);
        span.periods += self->gap_periods[at];
        span.long_ones += self->gap_periods[at] > 2 ? 1u : 0u;
        span.fewest = self->gap_periods[at] < span.fewest ? self->gap_periods[at] : span.fewest;
        span.lost += self->gap_periods[at] > 1 ? self->gap_periods[at] - 1u : 0u;
    }
    return span;
}

q32_t stream_clock_jitter(const stream_clock_t *self)
{
    return fx_mul_shift(self->jitter_us_q16, self->per_us_q46, 30);
}

bool stream_clock_is_bursty(const stream_clock_t *self)
{
    const int64_t quarter_us = (self->period_us_q16 + 4 * STREAM_US_Q16 - 1) / (4 * STREAM_US_Q16);
    unsigned short_ones = 0;
    for (unsigned i = 0; i < self->gaps; i++) {
        short_ones += self->gap_us[i] < quarter_us;
    }
    return short_ones >= BURSTS;
}

static bool is_other_rate(const stream_clock_t *self, int64_t mean)
{
    return fx_abs(mean - self->period_us_q16) * 5 > self->period_us_q16;
}

/* The mean period of many intervals where it is another one, with the longest of them and without: a pause tells no rate, and
 * what comes in a burst after it none either. Else 0. */
static int64_t rate_on_average(const stream_clock_t *self)
{
    const span_t all = newest_gaps(self, STREAM_GAPS);
    unsigned longest = 0;
    for (unsigned i = 1; i < STREAM_GAPS; i++) {
        longest = self->gap_us[i] > self->gap_us[longest] ? i : longest;
    }
    const unsigned periods = all.periods - self->gap_periods[longest];
    const int64_t without = (all.sum_us_q16 - gap_q16(self, longest)) / (int64_t)(periods > 0 ? periods : 1u);
    const int64_t with = all.sum_us_q16 / (int64_t)(all.periods > 0 ? all.periods : 1u);
    return is_other_rate(self, with) && is_other_rate(self, without) ? without : 0;
}

/* A start with losses in it: the intervals so far are about one, two, or more times the short ones, and some were taken for fewer
 * periods. The period then, else 0. */
static int64_t rate_at_start(const stream_clock_t *self)
{
    const span_t all = newest_gaps(self, self->gaps);
    int64_t shortest_q16 = INT64_MAX;
    int64_t short_sum_q16 = 0;
    int64_t short_ones = 0;
    unsigned periods = 0;
    for (unsigned i = 0; i < self->gaps; i++) {
        shortest_q16 = gap_q16(self, i) < shortest_q16 ? gap_q16(self, i) : shortest_q16;
    }
    for (unsigned i = 0; i < self->gaps; i++) {
        const bool is_short = gap_q16(self, i) * 2 < shortest_q16 * 3;
        short_sum_q16 += is_short ? gap_q16(self, i) : 0;
        short_ones += is_short ? 1 : 0;
    }
    const int64_t period_q16 = short_ones > 0 ? short_sum_q16 / short_ones : 0;
    for (unsigned i = 0; i < self->gaps; i++) {
        const int64_t n = period_q16 >= PERIOD_MIN_Q16 ? (gap_q16(self, i) + period_q16 / 2) / period_q16 : 0;
        if (n < 1 || fx_abs(gap_q16(self, i) - n * period_q16) * 3 > period_q16) {
            return 0;
        }
        periods += (unsigned)n;
    }
    return periods > all.periods ? all.sum_us_q16 / (int64_t)periods : 0;
}

/* The period where a few intervals that are alike tell that the rate is another one, or many on average; else 0. */
static int64_t new_rate(const stream_clock_t *self)
{
    if (self->gaps < ALIKE) {
        return 0;
    }
    const span_t few = newest_gaps(self, ALIKE);
    if (few.long_ones == ALIKE) {
        return few.sum_us_q16 / ALIKE;
    }
    const int64_t off = fx_abs(few.sum_us_q16 - few.periods * self->period_us_q16);
    const bool is_other = few.most_q16 * 2 < few.least_q16 * 3 && off * 10 > self->period_us_q16 * 11 &&
                          off * 2 > self->jitter_us_q16 * 5 && !stream_clock_is_bursty(self);
    if (is_other) {
        return few.sum_us_q16 / (int64_t)few.periods;
    }
    return self->gaps == STREAM_GAPS ? rate_on_average(self) : 0;
}

uint32_t stream_clock_lost_permille(const stream_clock_t *self)
{
    const int64_t lost_q16 = fx_clamp(self->lost_q16 - (int64_t)(self->each - 1) * Q16_ONE, 0, INT32_MAX);
    return (uint32_t)(lost_q16 * 1000 / self->each / Q16_ONE);
}

unsigned stream_clock_expect(const stream_clock_t *self, uint64_t now_us, q32_t *ahead_q32, q32_t *late_q32)
{
    const int64_t ahead_us_q16 = self->late_us_q16 + (int64_t)stream_clock_elapsed_us(self, now_us) * STREAM_US_Q16;
    *ahead_q32 = Q32_ONE;
    *late_q32 = Q32_ONE;
    if (self->period_us_q16 == 0) {
        return 1;
    }
    const q32_t late = stream_clock_jitter(self) + (stream_clock_is_bursty(self) ? Q32_ONE : Q32_ONE / 4);
    *ahead_q32 = fx_mul_shift(ahead_us_q16, self->per_us_q46, 30);
    const bool is_open = self->settled < KNOWN && self->period_us_q16 < OPEN_Q16;
    *late_q32 = fx_clamp(late, is_open ? Q32_ONE * 5 / 2 : Q32_ONE * 3 / 5, INT64_MAX);
    const bool is_next = *ahead_q32 <= Q32_ONE + *late_q32 ||
                         (int64_t)stream_clock_elapsed_us(self, now_us) * STREAM_US_Q16 * 2 < self->period_us_q16 * 3;
    return is_next ? 1u : (unsigned)((*ahead_q32 + Q32_ONE / 2) / Q32_ONE);
}

/* The largest lately: more at once, less slowly. */
static void hold_largest(const stream_clock_t *self, int64_t *largest_us_q16, int64_t now_us_q16)
{
    const int64_t fall = fx_mul_div(*largest_us_q16, self->period_us_q16, MARGIN_FALL_Q16);
    *largest_us_q16 = now_us_q16 > *largest_us_q16 ? now_us_q16 : *largest_us_q16 - fall;
}

/* Waits as long as the latest samples need, and where many are lost a period more, for that which a missing one is told from. */
static void adapt_margin(stream_clock_t *self)
{
    const int64_t most = margin_max_q16(self);
    const int64_t least = margin_min_q16(self);
    const int64_t late = self->late_us_q16 + MARGIN_FREE_Q16;
    self->is_sparse = self->lost_q16 > (self->is_sparse ? Q16_ONE / 24 : Q16_ONE / 12);
    const int64_t waited = late + (self->is_sparse ? self->period_us_q16 : 0);
    hold_largest(self, &self->jitter_us_q16, late <= most ? late : 0); /* what is later still cannot be waited for */
    hold_largest(self, &self->margin_us_q16, waited <= most ? waited : 0);
    self->margin_us_q16 = fx_clamp(self->margin_us_q16, least, most > least ? most : least);
}

bool stream_clock_is_lossy(const stream_clock_t *self)
{
    return self->lost_q16 > Q16_ONE / 32;
}

bool stream_clock_is_gappy(const stream_clock_t *self)
{
    return self->lost_q16 > Q16_ONE / 16 && self->each == 1;
}

void stream_clock_set_period(stream_clock_t *self, uint32_t period_us)
{
    self->gaps = 0;
    self->gap_next = 0;
    self->each = 1;
    self->settled = NEW_RATE;
    self->late_us_q16 = 0;
    set_period(self, (int64_t)period_us * STREAM_US_Q16);
}

/* Most samples that the line is found from. Of a fast sender lateness is a larger part of a period: what is left of it stays the
 * same part where the number of samples rises with the square of the rate. Where lateness makes the count of periods doubtful, a
 * long memory would keep its errors. */
static unsigned most_memory(const stream_clock_t *self)
{
    const int64_t period_us = self->period_us_q16 / STREAM_US_Q16;
    const int64_t samples = (int64_t)MEMORY * 4 / 3 * FAST_US * FAST_US / (period_us * period_us);
    return period_us < FAST_US && stream_clock_is_even(self) ? (unsigned)fx_clamp(samples, MEMORY, STREAM_CLOCK_MEMORY_MAX)
                                                             : MEMORY;
}

/* A line that lateness leaves slowly but far is that of another pace: a game whose frames take ever longer. Jitter, bursts and
 * stalls change the lateness from sample to sample. */
static void adapt_memory(stream_clock_t *self, int64_t was_us_q16)
{
    hold_largest(self, &self->rough_us_q16, fx_abs(self->late_us_q16 - was_us_q16));
    self->drift_us_q16 += (self->late_us_q16 - self->drift_us_q16) / DRIFT;
    if (fx_abs(self->drift_us_q16) > DRIFTS * self->rough_us_q16) {
        self->memory = self->memory > MEMORY_LEAST + MEMORY_FALL ? self->memory - MEMORY_FALL : MEMORY_LEAST;
    } else {
        const unsigned most = most_memory(self);
        self->memory = self->memory < most ? self->memory + 1 : most;
    }
}

/* The line and its pace after one more arrival that was off by so much. Once the line is known, by how much more than two periods
 * says nothing of them. */
static void correct(stream_clock_t *self, int64_t off_us_q16, unsigned periods)
{
    const int64_t m = self->settled < self->memory ? self->settled : self->memory;
    const int64_t gain_div = (m + 1) * (m + 2);
    const int64_t most_us_q16 = self->settled < KNOWN ? INT64_MAX : 2 * self->period_us_q16;
    const int64_t clamped_us_q16 = fx_clamp(off_us_q16, -most_us_q16, most_us_q16);
    self->late_us_q16 = off_us_q16 - clamped_us_q16 * 2 * (2 * m + 1) / gain_div;
    set_period(self, self->period_us_q16 + clamped_us_q16 * 6 / gain_div / (int64_t)periods);
}

/* A sender that has a sample for every second period only, or the third, is at that rate for a while: nothing is lost. */
static void count_losses(stream_clock_t *self, unsigned periods)
{
    const int32_t lost_q16 = (int32_t)(periods < 8 ? (periods - 1) * (unsigned)Q16_ONE : 0);
    self->counted += self->counted < LOST_MEMORY ? 1u : 0u;
    self->lost_q16 += (lost_q16 - self->lost_q16) / (int32_t)(self->counted > LOST_FIRST ? self->counted : LOST_FIRST);
    if (self->gaps < ALIKE) {
        return;
    }
    const span_t few = newest_gaps(self, ALIKE);
    if (few.fewest > 1) {
        self->each = few.fewest;
    } else if (self->each > 1 && few.lost == 0) {
        self->each = 1;
        self->lost_q16 = 0;
    }
}

/* The first two intervals are both longer than stated, or both shorter: one alone may be that of a late frame. */
static bool is_other_than_stated(const stream_clock_t *self)
{
    const span_t two = newest_gaps(self, SECOND);
    return two.least_q16 * 4 > self->period_us_q16 * 5 || two.most_q16 * 4 < self->period_us_q16 * 3;
}

/* What is later than can be waited for is of a stall, and so is what follows it in a burst: it says nothing of the line. Where a
 * sample comes at the usual pace and is as late, the sender itself has stood still, and the line goes on from there. So it does
 * where samples come at their pace and too early: one before them was taken for a later one. */
static bool is_of_stall(stream_clock_t *self, int64_t gap_us_q16)
{
    const bool is_paced = gap_us_q16 * 2 > self->period_us_q16;
    const bool is_next = gap_us_q16 * 4 > self->period_us_q16 * 3;
    const bool is_early = is_next && -self->late_us_q16 > self->jitter_us_q16 + self->period_us_q16 / 2;
    const bool is_late = self->late_us_q16 > margin_max_q16(self);
    const bool is_stall = (self->settled >= MEMORY && (is_late || is_early)) || (self->stalled > 0 && !is_paced);
    self->stalled = !is_stall ? 0 : self->stalled + (is_paced ? 1u : 0u);
    if (self->stalled < STALLED) {
        return is_stall;
    }
    self->stalled = 0;
    self->late_us_q16 = 0;
    return true;
}

/* The first samples of a sender that states its period.
 * @return true where that is all there is to take */
static bool is_taken_as_stated(stream_clock_t *self, int64_t gap_us_q16)
{
    if (self->hint_us == 0) {
        return false;
    }
    if (self->settled < STATED) { /* the period is known, and no sample is early: the first or this is late */
        self->settled = STATED;
        self->late_us_q16 = fx_clamp(gap_us_q16 - self->period_us_q16, 0, self->period_us_q16);
        adapt_margin(self);
        return true;
    }
    if (self->gaps == SECOND && is_other_than_stated(self)) {
        self->settled = SECOND;
        self->late_us_q16 = 0;
        set_period(self, newest_gaps(self, SECOND).sum_us_q16 / SECOND);
        return true;
    }
    return false;
}

void stream_clock_put(stream_clock_t *self, uint64_t now_us, unsigned periods)
{
    self->late_us_q16 += (int64_t)stream_clock_elapsed_us(self, now_us) * STREAM_US_Q16 - (int64_t)periods * self->period_us_q16;
    self->last_us = now_us;
}

bool stream_clock_accept(stream_clock_t *self, uint64_t now_us, unsigned periods)
{
    const uint32_t gap_us = stream_clock_elapsed_us(self, now_us);
    const int64_t gap_us_q16 = (int64_t)gap_us * STREAM_US_Q16;
    const bool is_paced = gap_us_q16 * 2 > self->period_us_q16;
    self->last_us = now_us;
    if (self->stalled > 0 && !is_paced) {
        lengthen_gap(self, gap_us, periods);
    } else {
        record_gap(self, gap_us, periods);
        count_losses(self, periods);
    }
    self->settled += self->settled < STREAM_CLOCK_MEMORY_MAX ? 1u : 0u;
    if (self->period_us_q16 == 0) {
        set_period(self, gap_us_q16);
        return false;
    }
    if (is_taken_as_stated(self, gap_us_q16)) {
        return false;
    }
    const int64_t was_us_q16 = self->late_us_q16;
    self->late_us_q16 += gap_us_q16 - (int64_t)periods * self->period_us_q16;
    if (is_of_stall(self, gap_us_q16)) {
        return false;
    }
    correct(self, self->late_us_q16, periods);
    const bool is_known = self->settled == KNOWN && self->gaps == KNOWN;
    const int64_t rate = is_known ? rate_at_start(self) : self->settled >= KNOWN ? new_rate(self) : 0;
    if (rate > 0) {
        stream_clock_set_period(self, (uint32_t)(rate / STREAM_US_Q16));
        return true;
    }
    adapt_memory(self, was_us_q16);
    adapt_margin(self);
    return false;
}

/* SPDX-License-Identifier: MIT
 * stream_clock.c - the time line of a sender, found from the arrivals of its samples.
 * Loss and jitter look alike in one interval, so the first intervals are taken together: losses count only from intervals well
 * above the middle ones, and the period is the mean. Then each arrival moves the time line by 8 % and the period by 0.4 % of its
 * deviation (damping 0.63). The last 8 intervals are watched for a new rate, which would take the loop too long to find.
 */
#include "stream_clock.h"

enum {
    WATCHED = 8,      /* intervals that tell a new rate: even, and enough that two losses among them do not */
    WATCHED_LOST = 6, /* of these longer than a period: the rate is a fraction of what it was */
    KNOWN = 12,       /* samples after which a stream is one */
    SETTLED_AGAIN = 4 /* after a new rate the time line is trusted as much as after this many samples */
};

#define PERIOD_MIN_Q16 ((int64_t)STREAM_PERIOD_MIN_US * STREAM_US_Q16)
#define NETWORK_Q16    ((int64_t)15000 * STREAM_US_Q16) /* jitter at both ends of a span */
#define MARGIN_MIN_Q16 ((int64_t)2000 * STREAM_US_Q16)
#define AWAY_US        1000000u
#define ELAPSED_MAX_US 4000000u /* far beyond the end of any curve */

/* A running stream may be slower than what it may begin with: no flipping at the edge. */
static int64_t period_max_q16(const stream_clock_t *self)
{
    const uint32_t slowest_us = self->hint_us > STREAM_PERIOD_MAX_US ? self->hint_us : STREAM_PERIOD_MAX_US;
    return (int64_t)slowest_us * STREAM_US_Q16 / 3 * 4;
}

/* Senders that state their period are programs that wait that long, and wake late by a share of it. */
static int64_t margin_min_q16(const stream_clock_t *self)
{
    const int64_t share = self->hint_us > 0 ? self->period_us_q16 / 8 : 0;
    return share > MARGIN_MIN_Q16 ? share : MARGIN_MIN_Q16;
}

static void set_period(stream_clock_t *self, int64_t period_us_q16)
{
    self->period_us_q16 = fx_clamp(period_us_q16, PERIOD_MIN_Q16, period_max_q16(self));
    self->per_us_q46 = Q62_ONE / self->period_us_q16;
}

void stream_clock_start(stream_clock_t *self, uint64_t now_us)
{
    const uint32_t hint_us = self->hint_us;
    *self = (stream_clock_t){.last_us = now_us};
    (void)stream_clock_hint(self, hint_us);
}

bool stream_clock_hint(stream_clock_t *self, uint32_t hint_us)
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
    return self->period_us_q16 > period_max_q16(self);
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
    return is_within(self, now_us, STREAM_PERIOD_MAX_US);
}

bool stream_clock_is_near(const stream_clock_t *self, uint64_t now_us)
{
    return is_within(self, now_us, self->settled >= KNOWN ? AWAY_US : STREAM_PERIOD_MAX_US);
}

bool stream_clock_is_soon(const stream_clock_t *self, uint64_t now_us)
{
    return stream_clock_elapsed_us(self, now_us) * (int64_t)STREAM_US_Q16 * 4 < self->period_us_q16;
}

q32_t stream_clock_span(const stream_clock_t *self, uint32_t span_us)
{
    return fx_mul_shift_fit((int64_t)span_us * STREAM_US_Q16, self->per_us_q46, 30);
}

q32_t stream_clock_periods(const stream_clock_t *self, uint64_t now_us)
{
    const uint32_t elapsed_us = stream_clock_elapsed_us(self, now_us);
    const int64_t since_us_q16 = (int64_t)(elapsed_us < ELAPSED_MAX_US ? elapsed_us : ELAPSED_MAX_US) * STREAM_US_Q16;
    return fx_mul_shift_fit(since_us_q16 + self->late_us_q16 - self->margin_us_q16, self->per_us_q46, 30);
}

/* Where the ring has the i-th newest interval, 0 the newest. */
static unsigned gap_at(const stream_clock_t *self, unsigned i)
{
    const unsigned at = self->gap_next + STREAM_GAPS - 1 - i;
    return at < STREAM_GAPS ? at : at - STREAM_GAPS;
}

static int64_t gap_q16(const stream_clock_t *self, unsigned i)
{
    return (int64_t)self->gap_us[gap_at(self, i)] * STREAM_US_Q16;
}

static void record_gap(stream_clock_t *self, uint32_t gap_us, unsigned periods)
{
    self->gap_us[self->gap_next] = gap_us;
    self->gap_periods[self->gap_next] = (uint8_t)(periods < UINT8_MAX ? periods : UINT8_MAX);
    self->gap_next = self->gap_next + 1 < STREAM_GAPS ? self->gap_next + 1 : 0;
    self->gaps += self->gaps < STREAM_GAPS ? 1u : 0u;
}

/* Periods in one interval seen alone. A short one may be jitter down to a quarter, a long one up to 1.6. */
static unsigned periods_in_gap(int64_t gap_us_q16, int64_t period_us_q16)
{
    if (gap_us_q16 * 4 < period_us_q16) {
        return 0;
    }
    return gap_us_q16 * 5 < period_us_q16 * 8 ? 1u : (unsigned)((gap_us_q16 + period_us_q16 / 2) / period_us_q16);
}

unsigned stream_clock_periods_in(const stream_clock_t *self, uint32_t interval_us)
{
    return (unsigned)fx_clamp(periods_in_gap((int64_t)interval_us * STREAM_US_Q16, self->period_us_q16), 1, INT32_MAX);
}

/* Mean period over the newest intervals if losses are counted with the given one. An interval too short to be a period belongs to
 * the one before it, which was so much too long. */
static int64_t mean_period(const stream_clock_t *self, unsigned gaps, int64_t period_us_q16)
{
    int64_t sum = 0;
    int64_t gap = 0;
    unsigned periods = 0;
    for (unsigned i = 0; i < gaps; i++) {
        gap += gap_q16(self, i);
        const unsigned in_gap = periods_in_gap(gap, period_us_q16);
        if (in_gap > 0) {
            periods += in_gap;
            sum += gap;
            gap = 0;
        }
    }
    return periods > 0 ? sum / periods : period_us_q16;
}

/* Mean of the middle half of the newest intervals: neither losses nor bursts reach it. An even number of them, as in a burst
 * short and long ones alternate.
 * @param gaps at least 2 */
static int64_t middle_gap(const stream_clock_t *self, unsigned gaps)
{
    int64_t sorted[STREAM_GAPS];
    const unsigned count = gaps - gaps % 2;
    for (unsigned i = 0; i < count; i++) {
        const int64_t gap = gap_q16(self, i);
        unsigned at = i;
        for (; at > 0 && sorted[at - 1] > gap; at--) {
            sorted[at] = sorted[at - 1];
        }
        sorted[at] = gap;
    }
    const unsigned cut = count / 4;
    int64_t sum = 0;
    for (unsigned i = cut; i < count - cut; i++) {
        sum += sorted[i];
    }
    return fx_clamp(sum / (int64_t)(count - 2 * cut), PERIOD_MIN_Q16, period_max_q16(self));
}

/* True where a mean over so many intervals is off by more than an eighth, and their sum by more than a network makes it. */
static bool is_rate_off(const stream_clock_t *self, int64_t mean_us_q16, unsigned gaps)
{
    const int64_t off = fx_abs(mean_us_q16 - self->period_us_q16);
    return off * 8 > self->period_us_q16 && off * gaps > NETWORK_Q16;
}

/* Of the newest intervals, those longer than the given period. */
static unsigned lost_gaps(const stream_clock_t *self, unsigned gaps, int64_t period_us_q16)
{
    unsigned lost = 0;
    for (unsigned i = 0; i < gaps; i++) {
        lost += periods_in_gap(gap_q16(self, i), period_us_q16) > 1 ? 1u : 0u;
    }
    return lost;
}

/* Mean interval, whatever was lost. */
static int64_t mean_gap(const stream_clock_t *self, unsigned gaps)
{
    int64_t sum = 0;
    for (unsigned i = 0; i < gaps; i++) {
        sum += gap_q16(self, i);
    }
    return sum / (int64_t)gaps;
}

/* Mean period over the newest intervals, with the periods that each was taken for. */
static int64_t taken_period(const stream_clock_t *self, unsigned gaps)
{
    int64_t sum = 0;
    unsigned periods = 0;
    for (unsigned i = 0; i < gaps; i++) {
        sum += gap_q16(self, i);
        periods += self->gap_periods[gap_at(self, i)];
    }
    return periods > 0 ? sum / periods : self->period_us_q16;
}

/* The sum of the intervals tells too, as losses only make it longer: of a slower rate it has grown, of a faster one it is less.
 * Else late arrivals were taken for losses, or two at once for one. Late arrivals beside losses still look like a slower rate for
 * a while: where the samples' values tell otherwise, it has to last. */
static bool is_slower(const stream_clock_t *self)
{
    const unsigned longer = self->gaps < 2 * WATCHED ? self->gaps : 2 * WATCHED;
    return mean_gap(self, WATCHED) * 16 > self->period_us_q16 * 17 &&
           (is_rate_off(self, taken_period(self, WATCHED), WATCHED) ||
            is_rate_off(self, mean_period(self, longer, self->period_us_q16), longer));
}

static bool is_faster(const stream_clock_t *self)
{
    return mean_gap(self, WATCHED) * 16 < self->period_us_q16 * 15;
}

static bool has_new_rate(const stream_clock_t *self)
{
    const int64_t mean = mean_period(self, WATCHED, self->period_us_q16);
    return lost_gaps(self, WATCHED, self->period_us_q16) >= WATCHED_LOST ||
           (is_rate_off(self, mean, WATCHED) && (mean > self->period_us_q16 ? is_slower(self) : is_faster(self)));
}

/* Periods from the newest sample's time to an arrival that is ahead_us after it. */
static unsigned periods_ahead(const stream_clock_t *self, int64_t ahead_us_q16, int64_t gap_us_q16)
{
    if (ahead_us_q16 * 4 < self->period_us_q16) {
        return 0;
    }
    if (self->settled < STREAM_GAPS) {
        return gap_us_q16 * 5 < self->period_us_q16 * 8 ? 1u : periods_in_gap(gap_us_q16, self->period_us_q16);
    }
    const unsigned periods = (unsigned)((ahead_us_q16 * 4 + self->period_us_q16) / (self->period_us_q16 * 4));
    return periods > 1 ? periods : 1u; /* late by more than 0.75: a loss */
}

/* Waits longer if samples come late, up to half a period, and slowly less if they do not: 1 of 64 may come too late. */
static void adapt_margin(stream_clock_t *self)
{
    const int64_t step = self->period_us_q16 / 64;
    const int64_t free = self->hint_us > 0 ? 4 * step : 0; /* guesses at slow streams are poor: rather wait */
    const int64_t wished = self->margin_us_q16 + (self->late_us_q16 + free > self->margin_us_q16 ? step : -step / 128);
    const int64_t half = self->period_us_q16 / 2;
    const int64_t least = margin_min_q16(self);
    self->margin_us_q16 = fx_clamp(wished, least, half > least ? half : least);
}

/* A program's first frame is often late: the interval after it is left out where the others agree better with what the sender
 * states. */
static void leave_out_first(stream_clock_t *self)
{
    const int64_t stated = (int64_t)self->hint_us * STREAM_US_Q16;
    if (stated == 0 || self->gaps < 3) {
        return;
    }
    const int64_t all = mean_period(self, self->gaps, stated);
    const int64_t others = mean_period(self, self->gaps - 1, stated);
    const bool is_odd = fx_abs(gap_q16(self, self->gaps - 1) - others) > NETWORK_Q16 / 2;
    self->gaps -= is_odd && fx_abs(others - stated) < fx_abs(all - stated) ? 1u : 0u;
}

/* Period over the intervals so far, two or more. What the sender states tells losses from late arrivals better than the first
 * intervals do, if it is what they are about; against it speak two alike, not two unlike ones. */
static int64_t first_period(const stream_clock_t *self)
{
    const int64_t stated = (int64_t)self->hint_us * STREAM_US_Q16;
    if (stated > 0 && self->gaps < 3) {
        const int64_t newest = gap_q16(self, 0);
        const int64_t oldest = gap_q16(self, self->gaps - 1);
        return fx_abs(newest - oldest) * 8 <= oldest ? (newest + oldest) / 2 : stated;
    }
    const int64_t mean = stated > 0 ? mean_period(self, self->gaps, stated) : 0;
    if (stated > 0 && fx_abs(mean - stated) * 4 <= stated && lost_gaps(self, self->gaps, stated) * 2 <= self->gaps) {
        return mean;
    }
    return mean_period(self, self->gaps, middle_gap(self, self->gaps));
}

/* At a new rate the intervals were so many other periods. */
static void retake_gaps(stream_clock_t *self)
{
    for (unsigned i = 0; i < self->gaps; i++) {
        const unsigned periods = periods_in_gap(gap_q16(self, i), self->period_us_q16);
        self->gap_periods[gap_at(self, i)] = (uint8_t)periods;
    }
}

/* Returns true where the sender's rate is found to be another one. */
static bool find_period(stream_clock_t *self, int64_t off_us_q16)
{
    const int64_t before = self->period_us_q16;
    const bool is_new = self->gaps >= WATCHED && has_new_rate(self);
    if (is_new) {
        self->gaps = WATCHED;
        self->settled = SETTLED_AGAIN;
    }
    const int64_t taken = taken_period(self, self->gaps);
    if (self->settled < STREAM_GAPS) {
        leave_out_first(self);
        set_period(self, first_period(self));
        if (is_new) {
            retake_gaps(self);
        }
    } else if (is_rate_off(self, taken, self->gaps)) {
        set_period(self, taken);
    } else {
        set_period(self, self->period_us_q16 + off_us_q16 / 250);
    }
    return is_new && fx_abs(self->period_us_q16 - before) * 8 > before;
}

bool stream_clock_set_period(stream_clock_t *self, uint32_t period_us)
{
    const int64_t period_us_q16 = (int64_t)period_us * STREAM_US_Q16;
    if (self->settled < STREAM_GAPS) {
        return false;
    }
    for (unsigned i = 0; i < STREAM_GAPS; i++) {
        const int64_t gap_us = fx_mul_div(self->gap_us[i], period_us_q16, self->period_us_q16);
        self->gap_us[i] = (uint32_t)fx_clamp(gap_us, 0, ELAPSED_MAX_US);
    }
    set_period(self, period_us_q16);
    self->settled = SETTLED_AGAIN;
    return true;
}

unsigned stream_clock_expect(const stream_clock_t *self, uint64_t now_us, q32_t *ahead_q32)
{
    const int64_t gap_us_q16 = (int64_t)stream_clock_elapsed_us(self, now_us) * STREAM_US_Q16;
    const int64_t ahead_us_q16 = self->late_us_q16 + gap_us_q16;
    *ahead_q32 = self->period_us_q16 > 0 ? fx_mul_shift(ahead_us_q16, self->per_us_q46, 30) : Q32_ONE;
    return self->period_us_q16 > 0 ? periods_ahead(self, ahead_us_q16, gap_us_q16) : 1;
}

bool stream_clock_take(stream_clock_t *self, uint64_t now_us, unsigned periods)
{
    const uint32_t gap_us = stream_clock_elapsed_us(self, now_us);
    const int64_t gap_us_q16 = (int64_t)gap_us * STREAM_US_Q16;
    record_gap(self, gap_us, periods);
    self->last_us = now_us;
    if (self->period_us_q16 == 0) {
        set_period(self, gap_us_q16);
        self->settled = 1;
        return false;
    }
    const int64_t ahead = self->late_us_q16 + gap_us_q16;
    const int64_t off = fx_clamp(ahead - (int64_t)periods * self->period_us_q16, -self->period_us_q16, self->period_us_q16);
    self->settled += self->settled < STREAM_GAPS ? 1u : 0u;
    self->late_us_q16 = off - (self->settled < 12 ? off / (int64_t)(self->settled + 1) : off * 2 / 25);
    const bool is_new_rate = self->settled > 1 && find_period(self, off); /* one interval says less than a hint */
    if (is_new_rate) {
        self->late_us_q16 = 0;
    }
    adapt_margin(self);
    return is_new_rate;
}

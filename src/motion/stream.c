/* SPDX-License-Identifier: MIT
 * stream.c - rebuilds a sender's motion: renders the curve through its samples at the pace of its clock.
 * The render phase advances by one cycle's share of the period, up to 6 % faster or slower so that it meets its time. That rate
 * passes two low-pass filters: behind one, a jump of the wished rate would still be a jump of the reference's acceleration.
 */
#include "heave/stream.h"
#include "stream_clock.h"
#include "stream_curve.h"
#include "stream_repeat.h"

#define PACE_GAIN_DIV        8                   /* a rate correction of 1/8 per period of error ... */
#define PACE_GAIN_DIV_HINTED 2                   /* ... 1/2 where the period is stated, and often a long one */
#define PACE_MAX_Q32         (Q32_ONE * 6 / 100) /* ... but at most this */
#define PACE_FILTER_MAX      (Q32_ONE / 2)       /* keeps the filters stable where a cycle is longer than a period */
#define BEHIND_MAX_Q32       (Q32_ONE * 3 / 2)   /* further behind its time, a sample is skipped */
#define BEFORE_MAX_Q32       (Q32_ONE / 2)       /* further before it, where it has no samples, a point is filled in */
#define AMBIGUOUS_Q32        (Q32_ONE * 13 / 20) /* a sample may belong to a period this far from its time, or ... */
#define AMBIGUOUS_MAX_Q32    (Q32_ONE * 9 / 10)  /* ... this far, where that is no more than ... */
#define AMBIGUOUS_US         15000u              /* ... networks make it */
#define STEP_GAP_MIN_US      2000u /* two samples nearer than this do not begin a stream: the second replaces the first */

/* Thinning out. Counted, not timed: every so manyth sample of an even stream is an even stream. */
#define THIN_GAP_FIRST_US 10000u /* a few short intervals at a start, or in a burst, say nothing */
#define THIN_GAP_MAX_US   20000u
#define THIN_GAPS         16 /* intervals that the mean is taken over */
#define THIN_BELOW_US     (STREAM_PERIOD_MIN_US * 39 / 40)
#define THIN_ABOVE_US     (STREAM_PERIOD_MIN_US * 11 / 10)
#define THIN_WAIT_US      (STREAM_PERIOD_MIN_US * 2) /* then a sample passed by was the last */

void stream_init(stream_t *self, uint32_t cycle_us, unsigned axes, stream_style_t style)
{
    HV_ASSERT(axes >= 1 && axes <= AXES_MAX && cycle_us >= 500 && cycle_us <= 10000);
    *self = (stream_t){.cycle_us = cycle_us,
                       .style = style,
                       .thin = {.gaps_us = THIN_GAP_FIRST_US * THIN_GAPS, .each = 1, .each_taken = 1},
                       .curve = {.axes = axes}};
}

void stream_set_stop(stream_t *self, unsigned axis, stream_stop_t stop)
{
    HV_ASSERT(axis < self->curve.axes);
    self->curve.stop[axis] = stop;
}

void stream_reset(stream_t *self)
{
    self->phase = STREAM_EMPTY; /* everything else begins with the next sample */
    self->thin.has_spare = false;
}

void stream_hint_period(stream_t *self, uint32_t period_us)
{
    HV_ASSERT(period_us <= STREAM_HINT_MAX_US);
    if (stream_clock_hint(&self->clock, period_us > STREAM_HINT_MIN_US ? period_us : 0)) {
        self->phase = STREAM_EMPTY;
    }
}

static void start_lone(stream_t *self, uint64_t now_us, const q32_t *sample_q32)
{
    stream_curve_start(&self->curve, self->curve.axes, sample_q32);
    stream_repeat_reset(&self->repeat, now_us);
    self->phase = STREAM_LONE;
    self->is_fresh = true;
}

static q32_t error_at(const stream_t *self, uint64_t now_us)
{
    return self->curve.ahead * Q32_ONE + stream_clock_periods(&self->clock, now_us) - self->between_q32;
}

static void start_running(stream_t *self, uint64_t now_us)
{
    self->phase = STREAM_RUNNING;
    self->between_q32 = 0;
    self->rate_q32[0] = self->rate_q32[1] = stream_clock_span(&self->clock, self->cycle_us);
    self->between_q32 = fx_clamp(error_at(self, now_us), 0, Q32_ONE - 1);
}

/* Faster streams are thinned out, not taken for jitter. */
static bool is_fastest(const stream_t *self)
{
    return self->clock.period_us_q16 * 10 < (int64_t)STREAM_PERIOD_MIN_US * STREAM_US_Q16 * 11;
}

/* What speaks against a sample that is so many periods after the newest: how far it is off the motion so far, and off its time.
 */
typedef struct {
    q32_t cost_q32;
    bool is_telling; /* it is where that motion would be, and about in time */
} guess_t;

static q32_t ambiguous(const stream_t *self)
{
    return fx_clamp(stream_clock_span(&self->clock, AMBIGUOUS_US), AMBIGUOUS_Q32, AMBIGUOUS_MAX_Q32);
}

static guess_t guess_of(const stream_t *self, const q32_t *sample_q32, unsigned periods, q32_t ahead_q32)
{
    q32_t step_q32;
    const q32_t misfit_q32 = stream_curve_misfit(&self->curve, sample_q32, periods, &step_q32);
    const q32_t untimely_q32 = fx_abs(ahead_q32 - periods * Q32_ONE);
    return (guess_t){.cost_q32 = misfit_q32 + fx_mul_shift(step_q32, untimely_q32 / 2, 32),
                     .is_telling = untimely_q32 < ambiguous(self) && misfit_q32 * 4 < step_q32};
}

/* Periods from the newest sample to this one. A loss, a late and an early arrival look alike to the clock; where the signal
 * moves, the value tells them apart: if the motion so far goes on to within a quarter of its step. Where it hardly moves, or
 * bends, the time tells. */
static unsigned judge_periods(const stream_t *self, uint64_t now_us, const q32_t *sample_q32)
{
    q32_t ahead_q32;
    const unsigned expected = stream_clock_expect(&self->clock, now_us, &ahead_q32);
    if (expected > 3 || (expected == 0 && is_fastest(self))) {
        return expected;
    }
    if (fx_abs(ahead_q32 - expected * Q32_ONE) <= Q32_ONE - ambiguous(self)) {
        return expected; /* so well in time that no other period comes into question */
    }
    unsigned best = expected;
    q32_t least_q32 = guess_of(self, sample_q32, expected, ahead_q32).cost_q32;
    for (unsigned periods = expected > 1 ? expected - 1 : expected + 1; periods <= expected + 1; periods += 2) {
        const guess_t guess = guess_of(self, sample_q32, periods, ahead_q32);
        if (guess.is_telling && guess.cost_q32 < least_q32) {
            least_q32 = guess.cost_q32;
            best = periods;
        }
    }
    return best;
}

/* Which of the samples are taken, from the mean interval of all of them. */
HV_WRAPS static void find_thinning(stream_thin_t *thin, uint64_t now_us)
{
    const uint64_t gap_us = now_us - thin->last_us < THIN_GAP_MAX_US ? now_us - thin->last_us : THIN_GAP_MAX_US;
    thin->last_us = now_us;
    thin->gaps_us = thin->gaps_us - thin->gaps_us / THIN_GAPS + (uint32_t)gap_us;
    const uint32_t mean_us = thin->gaps_us / THIN_GAPS + 1;
    if (thin->each * mean_us < THIN_BELOW_US || (thin->each - 1) * mean_us > THIN_ABOVE_US) {
        thin->each = (THIN_BELOW_US + mean_us - 1) / mean_us;
    }
}

/* True if the sample is passed by; it is kept, as it may be the last one. */
static bool is_passed_by(stream_t *self, uint64_t now_us, const q32_t *sample_q32)
{
    stream_thin_t *const thin = &self->thin;
    find_thinning(thin, now_us);
    thin->passed++;
    thin->has_spare = self->phase == STREAM_RUNNING && thin->passed < thin->each;
    for (unsigned axis = 0; axis < self->curve.axes && thin->has_spare; axis++) {
        thin->spare_q32[axis] = sample_q32[axis];
    }
    return thin->has_spare;
}

/* True where the samples of a running stream are further apart from now on, or nearer, as another share of them is taken. */
static bool is_thinned_anew(stream_t *self, uint64_t now_us)
{
    stream_thin_t *const thin = &self->thin;
    const bool is_other = thin->each != thin->each_taken;
    thin->each_taken = thin->each;
    if (self->phase != STREAM_RUNNING) {
        return false;
    }
    if (is_other) {
        stream_repeat_reset(&self->repeat, now_us);
    }
    const uint32_t period_us = is_other ? thin->each * (thin->gaps_us / THIN_GAPS) : stream_repeat_period_us(self);
    return period_us > 0 && stream_clock_set_period(&self->clock, period_us);
}

static void take_sample(stream_t *self, uint64_t now_us, const q32_t *sample_q32)
{
    self->thin.passed = 0;
    if (self->phase == STREAM_EMPTY || !stream_clock_is_near(&self->clock, now_us)) {
        stream_clock_start(&self->clock, now_us);
        start_lone(self, now_us, sample_q32);
        return;
    }
    if (self->phase == STREAM_LONE && stream_clock_elapsed_us(&self->clock, now_us) < STEP_GAP_MIN_US) {
        start_lone(self, now_us, sample_q32);
        return;
    }
    if (stream_clock_is_soon(&self->clock, now_us) && stream_curve_is_newest(&self->curve, sample_q32)) {
        return; /* the same datagram twice */
    }
    if (self->phase == STREAM_RUNNING && stream_repeat_watch(self, now_us, sample_q32)) {
        return;
    }
    const uint32_t interval_us = stream_clock_elapsed_us(&self->clock, now_us);
    const bool is_thinned = is_thinned_anew(self, now_us);
    const unsigned periods = judge_periods(self, now_us, sample_q32);
    const bool is_new_rate = stream_clock_take(&self->clock, now_us, periods) || is_thinned;
    stream_curve_pace(&self->curve, self->style, (uint32_t)(self->clock.period_us_q16 / STREAM_US_Q16), self->cycle_us);
    if (is_new_rate) {
        stream_curve_regrid(&self->curve, self->style, self->previous, stream_clock_periods_in(&self->clock, interval_us),
                            sample_q32);
        self->between_q32 = 0;
        self->rate_q32[0] = self->rate_q32[1] = stream_clock_span(&self->clock, self->cycle_us);
        return;
    }
    stream_curve_append(&self->curve, periods, sample_q32);
    if (self->phase == STREAM_LONE) {
        start_running(self, now_us);
    } else if (error_at(self, now_us) > BEHIND_MAX_Q32) {
        stream_curve_skip(&self->curve);
    } else if (error_at(self, now_us) < -BEFORE_MAX_Q32) {
        stream_curve_stretch(&self->curve);
    }
}

void stream_push(stream_t *self, uint64_t now_us, const q32_t *sample_q32)
{
    if (!is_passed_by(self, now_us, sample_q32)) {
        take_sample(self, now_us, sample_q32);
    }
}

/* One cycle of the render phase; commits the points it comes to. */
static void advance(stream_t *self, uint64_t now_us)
{
    self->between_q32 += self->rate_q32[1];
    while (self->between_q32 >= Q32_ONE) {
        self->between_q32 -= Q32_ONE;
        stream_curve_commit(&self->curve);
    }
    self->error_q32 = error_at(self, now_us);
    const q32_t nominal = stream_clock_span(&self->clock, self->cycle_us);
    const q32_t wanted = self->clock.hint_us > 0 ? self->error_q32 / PACE_GAIN_DIV_HINTED : self->error_q32 / PACE_GAIN_DIV;
    const q32_t pace = fx_clamp(wanted, -PACE_MAX_Q32, PACE_MAX_Q32);
    const q32_t faster = nominal > self->rate_q32[1] ? nominal : self->rate_q32[1];
    const q32_t filter = fx_clamp(faster * 2 / 3, 0, PACE_FILTER_MAX);
    const q32_t wished = nominal + fx_mul_shift_fit(nominal, pace, 32);
    self->rate_q32[0] += fx_mul_shift_fit(wished - self->rate_q32[0], filter, 32);
    self->rate_q32[1] += fx_mul_shift_fit(self->rate_q32[0] - self->rate_q32[1], filter, 32);
}

bool stream_step(stream_t *self, uint64_t now_us, ramp_ref_t *ref)
{
    if (self->phase == STREAM_EMPTY) {
        return false;
    }
    if (self->thin.has_spare && now_us - self->thin.last_us >= THIN_WAIT_US) {
        self->thin.has_spare = false;
        take_sample(self, now_us, self->thin.spare_q32);
    }
    if (self->phase == STREAM_RUNNING) {
        advance(self, now_us);
    }
    const unsigned axes = self->curve.axes;
    const bool is_fresh = self->is_fresh;
    int64_t weight_q60[3];
    stream_curve_weigh(self->style, self->between_q32, weight_q60);
    for (unsigned axis = 0; axis < axes; axis++) {
        const q32_t pos_q32 = stream_curve_at(&self->curve, axis, weight_q60);
        if (is_fresh) {
            self->previous[axis] = (history_t){.pos_q32 = pos_q32};
        }
        ref[axis] = history_advance(&self->previous[axis], pos_q32);
    }
    self->is_fresh = false;
    if (self->phase == STREAM_RUNNING && stream_curve_is_at_rest(&self->curve) && !stream_clock_is_near(&self->clock, now_us)) {
        self->phase = STREAM_LONE;
    }
    return true;
}

bool stream_goes_on(const stream_t *self, uint64_t now_us)
{
    return self->phase == STREAM_RUNNING && stream_clock_is_near(&self->clock, now_us);
}

bool stream_is_live(const stream_t *self, uint64_t now_us)
{
    return self->phase == STREAM_RUNNING && stream_clock_is_live(&self->clock, now_us);
}

uint32_t stream_period_us(const stream_t *self)
{
    return self->phase == STREAM_RUNNING ? (uint32_t)(self->clock.period_us_q16 / STREAM_US_Q16) : 0;
}

uint32_t stream_delay_us(const stream_t *self)
{
    if (self->phase != STREAM_RUNNING) {
        return 0;
    }
    const int64_t period = self->clock.period_us_q16;
    const int64_t spline =
        self->style == STREAM_FAST ? period * 3 / 2 - fx_mul_shift(period, STREAM_FAST_LEAD_Q32, 32) : period * 2;
    const int64_t mean = (self->curve.window - 1) * period * 3 / 2;
    const int64_t behind = fx_mul_shift(period, self->error_q32, 32);
    return (uint32_t)(fx_clamp(spline + mean + self->clock.margin_us_q16 + behind, 0, INT64_MAX) / STREAM_US_Q16);
}

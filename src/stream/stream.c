/* SPDX-License-Identifier: MIT
 * stream.c - rebuilds a sender's motion: renders the curve through its samples at the pace of its clock.
 * The render phase advances by one cycle's share of the period, up to 10 % faster or slower so that it meets its time. That rate
 * passes two low-pass filters: behind one, a jump of the wished rate would still be a jump of the reference's acceleration.
 */
#include "heave/stream.h"
#include "stream_clock.h"
#include "stream_control.h"
#include "stream_curve.h"
#include "stream_evidence.h"
#include "stream_predictor.h"
#include "stream_repeat.h"
#include "stream_sample.h"

#define PACE_GAIN_DIV        8                          /* a rate correction of 1/8 per period of error ... */
#define PACE_GAIN_DIV_HINTED 3                          /* ... 1/3 where the period is stated, and often a long one */
#define PACE_MAX_Q32         (Q32_ONE / 10)             /* ... but at most this */
#define PACE_SLOW_Q32        (Q32_ONE * 2 / 5)          /* ... and so much slower where it is ... */
#define FAR_BEFORE_Q32       (Q32_ONE / 2)              /* ... so far before its time: what comes next is a guess */
#define PACE_FILTER_MAX      (Q32_ONE / 2)              /* keeps the filters stable where a cycle is longer than a period */
#define BEHIND_MAX_Q32       (Q32_ONE * 6)              /* further behind its time, a sample is skipped */
#define FEW                  16                         /* quanta in a step that tells too little */
#define PAIR                 2u                         /* samples that are steps; with the next one they are a stream, ... */
#define UNEVEN_PARTS         6                          /* slow steps that differ by more than such a part are uneven */
#define ON_LEAST_Q32         (Q32_ONE / 3)              /* ... and one that is not such a part of the one before it ... */
#define ON_MOST_Q32          (Q32_ONE * 3)              /* ... to so many times it does not lead on */
#define LEAP_HALVES          3                          /* so many halves of the largest step beside the way it is a leap */
#define BEGIN_US             (3 * STREAM_PERIOD_MIN_US) /* ... but of a flood, with those of so long */

#define RETURN_US 100000u /* what a sender sends in this time tells where it returns */
#define AGE_LEAST 10      /* fewer samples are poses, and moves of their own */

/* Thinning out. Counted, not timed: every so manyth sample of an even stream is an even stream. */
#define THIN_GAP_FIRST_US 10000u /* a few short intervals at a start, or in a burst, say nothing */
#define THIN_GAP_MAX_US   20000u
#define THIN_GAPS         64 /* intervals that the mean is taken over */
#define THIN_BELOW_US     (STREAM_PERIOD_MIN_US * 39 / 40)
#define THIN_ABOVE_US     (STREAM_PERIOD_MIN_US * 11 / 10)
#define THIN_WAIT_US      (STREAM_PERIOD_MIN_US * 2) /* then a sample passed by was the last */

void stream_init(stream_t *self, uint32_t cycle_us, unsigned axes, stream_style_t style)
{
    HV_ASSERT(axes >= 1 && axes <= AXES_MAX && cycle_us >= 500 && cycle_us <= 10000);
    *self = (stream_t){.cycle_us = cycle_us,
                       .style = style,
                       .thin = {.gaps_us = THIN_GAP_FIRST_US * THIN_GAPS, .each = 1, .each_taken = 1},
                       .curve = {.axes = axes, .scale_q16 = Q16_ONE}};
}

void stream_set_limits(stream_t *self, unsigned axis, const governor_limits_t *limits)
{
    HV_ASSERT(axis < self->curve.axes);
    self->curve.limits[axis] = *limits;
    if (axis < POSE_AXES) {
        governor_set_limits(&self->curve.governor, axis, limits);
    }
}

void stream_set_cylinder_limits(stream_t *self, unsigned cylinder, const governor_limits_t *limits)
{
    governor_set_limits(&self->curve.governor, POSE_AXES + cylinder, limits);
}

void stream_set_delay_max(stream_t *self, uint32_t delay_max_us)
{
    self->clock.delay_max_us = delay_max_us;
}

void stream_set_scale(stream_t *self, int32_t scale_q16)
{
    self->curve.scale_q16 = scale_q16;
}

void stream_hide_start(stream_t *self, bool is_hidden)
{
    self->is_hidden = is_hidden;
}

void stream_place(stream_t *self, const history_t *now)
{
    for (unsigned axis = 0; axis < self->curve.axes; axis++) {
        self->previous[axis] = now[axis];
    }
}

void stream_reset(stream_t *self)
{
    self->back_us = 0;
    self->phase = STREAM_EMPTY; /* everything else begins with the next sample */
    self->thin.has_spare = false;
}

void stream_hint_period(stream_t *self, uint32_t period_us)
{
    HV_ASSERT(period_us <= STREAM_HINT_MAX_US);
    stream_clock_hint(&self->clock, period_us > STREAM_HINT_MIN_US ? period_us : 0);
}

/* True where steps are a few quanta: then values tell no time. */
static bool is_coarse(const stream_t *self)
{
    const stream_curve_t *curve = &self->curve;
    bool is_found = false;
    for (unsigned axis = 0; axis < POSE_AXES && axis < curve->axes; axis++) {
        is_found |= fx_abs(curve->quantum[axis].step_q32) < FEW * curve->quantum[axis].quantum_q32;
    }
    return is_found || curve->window > 1;
}

static void note_sample(stream_t *self, unsigned periods, q32_t shift_q32, const q32_t *sample_q32)
{
    const q32_t late_q32 = stream_clock_lateness(&self->clock); /* 0 while no period is known */
    stream_evidence_add(&self->evidence, &self->curve.governor, self->curve.axes, periods, late_q32, shift_q32, is_coarse(self),
                        sample_q32);
}

static void start_lone(stream_t *self, uint64_t now_us, const kin_t *kin, const q32_t *sample_q32)
{
    stream_curve_start(&self->curve, kin, sample_q32);
    stream_repeat_reset(&self->repeat, now_us);
    stream_evidence_reset(&self->evidence, self->phase != STREAM_EMPTY);
    note_sample(self, 0, 0, sample_q32);
    stream_sample_reset(&self->sample, self->phase != STREAM_EMPTY);
    self->phase = STREAM_LONE;
    self->pair = 1;
    self->pair_gap_us = 0;
    self->began_us = now_us;
    self->is_fresh = true;
}

static q32_t error_at(const stream_t *self, uint64_t now_us)
{
    return self->curve.ahead * Q32_ONE + stream_clock_periods(&self->clock, now_us) - self->between_q32;
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
    if (period_us > 0) {
        stream_clock_set_period(&self->clock, period_us);
    }
    return period_us > 0;
}

static void pace_curve(stream_t *self)
{
    const uint32_t period_us = (uint32_t)(self->clock.period_us_q16 / STREAM_US_Q16);
    stream_curve_pace(&self->curve, self->style, period_us, self->cycle_us, stream_clock_is_lossy(&self->clock));
    if (period_us > STREAM_QUIET_US && self->clock.hint_us == 0) { /* no other sample may follow: it stops on this one */
        self->curve.reach_min_q16 = self->curve.reach_max_q16 = 0;
    }
}

/* A curve from where the axes are, through the samples from now on. */
static void start_curve(stream_t *self, const kin_t *kin, uint32_t interval_us, const q32_t *sample_q32)
{
    const unsigned periods = stream_clock_periods_in(&self->clock, interval_us);
    const bool is_hidden = self->is_hidden && self->phase == STREAM_LONE;
    const q32_t before_q32 = fx_clamp(stream_clock_periods(&self->clock, self->clock.last_us), -PACE_SLOW_Q32, 0);
    const q32_t *const first_q32 = self->evidence.value_q32[self->evidence.count > 2 ? 2 : 1];
    stream_curve_regrid(&self->curve, kin, is_hidden ? NULL : self->previous, self->phase == STREAM_RUNNING ? NULL : first_q32,
                        periods, sample_q32);
    self->between_q32 = 0;
    self->rate_q32[0] = self->rate_q32[1] = stream_clock_span(&self->clock, self->cycle_us);
    if (self->phase == STREAM_LONE) { /* at rest: the first period takes a margin longer */
        self->rate_q32[0] = self->rate_q32[1] = fx_mul_shift(self->rate_q32[1], Q32_ONE + before_q32, 32);
    }
    self->phase = STREAM_RUNNING;
}

/* Whether the samples so far make a stream: three of them, four of a slow one, or two where the sender states its period. */
static bool is_begun(const stream_t *self, uint64_t now_us)
{
    const unsigned steps = self->pair_gap_us > STREAM_QUIET_US ? PAIR + 1 : PAIR;
    return self->clock.hint_us > 0 || (self->pair > steps && now_us - self->began_us >= BEGIN_US);
}

/* Steps that are far apart are those of a stream where they come evenly and the newer one leads on where the older one did. Poses
 * to and fro, and one that is repeated, are moves of their own: the curve would make a third of them, and late. */
static bool is_slow_move(const stream_t *self, uint64_t now_us, const q32_t *sample_q32)
{
    const uint32_t gap_us = stream_clock_elapsed_us(&self->clock, now_us);
    const uint32_t longer_us = gap_us > self->pair_gap_us ? gap_us : self->pair_gap_us;
    const uint32_t shorter_us = gap_us < self->pair_gap_us ? gap_us : self->pair_gap_us;
    if (self->phase != STREAM_LONE || self->pair < PAIR || self->clock.hint_us > 0 || longer_us <= STREAM_QUIET_US) {
        return false;
    }
    const q32_t advance_q32 = stream_evidence_advance(&self->evidence, &self->curve.governor, sample_q32);
    return longer_us - shorter_us > longer_us / UNEVEN_PARTS || advance_q32 < ON_LEAST_Q32 || advance_q32 > ON_MOST_Q32;
}

/* A sample of a slow stream that is far from where the newest step leads, against the steps so far: no motion that is sampled so
 * rarely goes on like that, and the curve would make little of it. It is a move of its own, and no stream goes on. */
static bool is_leap(const stream_t *self, const q32_t *sample_q32)
{
    const stream_evidence_t *seen = &self->evidence;
    const governor_t *scale = &self->curve.governor;
    const stream_predictor_t even = {.by_newest_q32 = Q32_ONE};
    if (self->phase != STREAM_RUNNING || self->clock.hint_us > 0 || seen->count < 3 ||
        self->clock.period_us_q16 <= (int64_t)STREAM_QUIET_US * STREAM_US_Q16) {
        return false;
    }
    q32_t largest_q32 = 0;
    for (unsigned i = 0; i < seen->count; i++) {
        const q32_t *const after_q32 = i == 0 ? sample_q32 : seen->value_q32[i - 1];
        q32_t step_q32 = 0;
        for (unsigned axis = 0; axis < self->curve.axes && axis < POSE_AXES; axis++) {
            step_q32 += stream_evidence_in_speed_limits(scale, axis, after_q32[axis] - seen->value_q32[i][axis]);
        }
        largest_q32 = step_q32 > largest_q32 ? step_q32 : largest_q32;
    }
    return stream_evidence_misfit(seen, scale, &even, 1, sample_q32) * 2 > largest_q32 * LEAP_HALVES;
}

/* The newer two of three such steps may be the first ones of a stream. */
static void start_at_second(stream_t *self, const kin_t *kin)
{
    const uint64_t second_us = self->clock.last_us;
    q32_t second_q32[AXES_MAX];
    for (unsigned axis = 0; axis < self->curve.axes; axis++) {
        second_q32[axis] = self->evidence.value_q32[0][axis];
    }
    stream_clock_start(&self->clock, second_us);
    start_lone(self, second_us, kin, second_q32);
}

/* A stream that begins as a flood is thinned out from its beginning. */
static void thin_from_start(stream_t *self, uint64_t now_us)
{
    stream_thin_t *const thin = &self->thin;
    const uint32_t mean_us = (uint32_t)(now_us - self->began_us) / (self->pair - 1);
    if (mean_us == 0 || mean_us >= THIN_BELOW_US || self->pair_gap_us >= STREAM_PERIOD_MIN_US) {
        return;
    }
    thin->gaps_us = mean_us * THIN_GAPS;
    thin->each = thin->each_taken = (THIN_BELOW_US + mean_us - 1) / mean_us;
    stream_clock_set_period(&self->clock, thin->each * mean_us);
    pace_curve(self);
}

static void accept_sample(stream_t *self, uint64_t now_us, const kin_t *kin, bool is_twice_as_fast, const q32_t *sample_q32)
{
    const uint32_t interval_us = stream_clock_elapsed_us(&self->clock, now_us);
    if (is_twice_as_fast) {
        stream_clock_set_period(&self->clock, (uint32_t)(self->clock.period_us_q16 / STREAM_US_Q16 / 2));
    }
    const bool is_thinned = is_thinned_anew(self, now_us) || is_twice_as_fast;
    q32_t shift_q32 = 0;
    const unsigned periods =
        self->phase == STREAM_LONE && self->pair == 1 ? 1 : stream_sample_periods(self, now_us, sample_q32, &shift_q32);
    const bool is_new_rate = (stream_clock_accept(&self->clock, now_us, periods) && self->phase == STREAM_RUNNING) || is_thinned;
    pace_curve(self);
    if (is_new_rate) {
        stream_evidence_reset(&self->evidence, true);
    }
    note_sample(self, periods, shift_q32, sample_q32);
    if (is_new_rate) {
        start_curve(self, kin, interval_us, sample_q32);
        return;
    }
    stream_control_lead(&self->curve, self->evidence.weight_q32, stream_clock_is_gappy(&self->clock),
                        (uint32_t)(self->clock.period_us_q16 / STREAM_US_Q16));
    if (self->phase == STREAM_LONE) {
        self->pair++;
        self->pair_gap_us = interval_us > self->pair_gap_us ? interval_us : self->pair_gap_us;
        if (!is_begun(self, now_us)) {
            stream_curve_start(&self->curve, kin, sample_q32);
            self->is_fresh = true;
            return;
        }
        thin_from_start(self, now_us);
        start_curve(self, kin, interval_us, sample_q32);
        return;
    }
    q32_t point_q32[AXES_MAX];
    for (unsigned axis = 0; axis < self->curve.axes; axis++) { /* a rounded value tells no time as fine as that */
        point_q32[axis] = self->curve.window > 1 ? sample_q32[axis] : stream_evidence_on_line(&self->evidence, axis);
    }
    stream_curve_append(&self->curve, periods, self->clock.stalled > 0, sample_q32, point_q32);
    if (error_at(self, now_us) > BEHIND_MAX_Q32) {
        stream_curve_skip(&self->curve);
    }
}

/* A sample that looks like an old one, or one that comes in the place of such a one: its time tells nothing of the line, and its
 * value nothing of the sender. */
static void accept_doubtful(stream_t *self, uint64_t now_us, unsigned periods, const q32_t *sample_q32)
{
    stream_clock_put(&self->clock, now_us, periods);
    stream_evidence_add(&self->evidence, &self->curve.governor, self->curve.axes, periods, stream_clock_lateness(&self->clock), 0,
                        true, sample_q32);
    stream_curve_append(&self->curve, periods, false, sample_q32, sample_q32);
}

static void accept_frame(stream_t *self, uint64_t now_us, const kin_t *kin, const q32_t *sample_q32)
{
    self->thin.passed = 0;
    if (self->phase == STREAM_EMPTY || !stream_clock_is_near(&self->clock, now_us) || is_leap(self, sample_q32)) {
        stream_clock_start(&self->clock, now_us);
        start_lone(self, now_us, kin, sample_q32);
        return;
    }
    q32_t ahead_q32;
    q32_t late_q32;
    const stream_sample_kind_t kind = stream_sample_kind(self, now_us, sample_q32);
    if (kind == STREAM_SAMPLE_DOUBTFUL) {
        accept_doubtful(self, now_us, stream_clock_expect(&self->clock, now_us, &ahead_q32, &late_q32), sample_q32);
    } else if (kind == STREAM_SAMPLE_INSTEAD) {
        accept_doubtful(self, now_us, 0, sample_q32);
    } else if (kind != STREAM_SAMPLE_NONE) {
        if (is_slow_move(self, now_us, sample_q32)) {
            start_at_second(self, kin);
        }
        accept_sample(self, now_us, kin, kind == STREAM_SAMPLE_OTHER_RATE, sample_q32);
    }
}

void stream_push(stream_t *self, uint64_t now_us, const kin_t *kin, const q32_t *sample_q32)
{
    if (!is_passed_by(self, now_us, sample_q32)) {
        accept_frame(self, now_us, kin, sample_q32);
    }
}

/* One cycle of the render phase; commits the points it comes to. */
static void advance(stream_t *self, uint64_t now_us, const kin_t *kin)
{
    self->between_q32 += self->rate_q32[1];
    while (self->between_q32 >= Q32_ONE) {
        self->between_q32 -= Q32_ONE;
        stream_curve_commit(&self->curve, kin);
    }
    self->error_q32 = error_at(self, now_us);
    const q32_t nominal = stream_clock_span(&self->clock, self->cycle_us);
    const q32_t before_q32 = self->error_q32 < -FAR_BEFORE_Q32 ? (self->error_q32 + FAR_BEFORE_Q32) / 2 : 0;
    const q32_t arrived_q32 = fx_mul_shift(self->error_q32 / PACE_GAIN_DIV, self->evidence.weight_q32, 32);
    const q32_t wanted = self->clock.hint_us > 0 ? self->error_q32 / PACE_GAIN_DIV_HINTED
                                                 : self->error_q32 / PACE_GAIN_DIV + arrived_q32 + before_q32;
    const q32_t slowest_q32 = self->error_q32 < -FAR_BEFORE_Q32 ? PACE_SLOW_Q32 : PACE_MAX_Q32;
    const q32_t pace = fx_clamp(wanted, -slowest_q32, PACE_MAX_Q32);
    const q32_t faster = nominal > self->rate_q32[1] ? nominal : self->rate_q32[1];
    const q32_t filter = fx_clamp(faster, 0, PACE_FILTER_MAX);
    const q32_t wished = nominal + fx_mul_shift_fit(nominal, pace, 32);
    self->rate_q32[0] += fx_mul_shift_fit(wished - self->rate_q32[0], filter, 32);
    self->rate_q32[1] += fx_mul_shift_fit(self->rate_q32[0] - self->rate_q32[1], filter, 32);
}

/* Of what is not negative: four instructions instead of ten. */
static int64_t sixth(int64_t value)
{
    return (int64_t)((uint64_t)value / 6);
}

/* Cumulative weights of the cubic B-spline. Q60: sums up to 5 occur. */
static void weigh(q32_t between_q32, int64_t weight_q60[3])
{
    const int64_t one = Q62_ONE / 4;
    const int64_t u = between_q32 * (one / Q32_ONE);
    const int64_t u2 = (int64_t)(((uint64_t)between_q32 * (uint64_t)between_q32 + 8) / 16); /* Q64, rounded to Q60 */
    const int64_t u3 = fx_mul_shift_fit(u2, u, 60);
    weight_q60[0] = sixth(5 * one + 3 * (u - u2) + u3);
    weight_q60[1] = sixth(one + 3 * (u + u2) - 2 * u3);
    weight_q60[2] = sixth(u3);
}

bool stream_step(stream_t *self, uint64_t now_us, const kin_t *kin, ramp_ref_t *ref)
{
    if (self->phase == STREAM_EMPTY) {
        return false;
    }
    if (self->thin.has_spare && now_us - self->thin.last_us >= THIN_WAIT_US) {
        self->thin.has_spare = false;
        accept_frame(self, now_us, kin, self->thin.spare_q32);
    }
    if (self->phase == STREAM_RUNNING) {
        advance(self, now_us, kin);
    }
    const unsigned axes = self->curve.axes;
    const bool is_fresh = self->is_fresh;
    int64_t weight_q60[3];
    weigh(self->between_q32, weight_q60);
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

/* A stream that was silent until its motion ended. A slow one has no silence: its next sample is a move of its own. */
static bool is_over(const stream_t *self)
{
    return self->phase != STREAM_EMPTY && self->clock.period_us_q16 <= (int64_t)STREAM_QUIET_US * STREAM_US_Q16 &&
           self->curve.age >= AGE_LEAST && -self->curve.ahead > self->curve.patience;
}

bool stream_returns_elsewhere(stream_t *self, uint64_t now_us, const q32_t *sample_q32)
{
    stream_curve_t *const curve = &self->curve;
    if (is_over(self)) {
        self->back_us = now_us;
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            self->left_q32[axis] = curve->newest_q32[axis];
        }
    }
    if (self->back_us == 0 || now_us - self->back_us > RETURN_US) {
        return false;
    }
    const int64_t cycles = fx_shift_down(curve->period_cycles_q16, 16) + (uint32_t)(now_us - self->back_us) / self->cycle_us + 1;
    bool is_far = false;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const q32_t most_q32 = curve->limits[axis].vel_per_cycle_q32 * cycles;
        is_far |= most_q32 > 0 && fx_abs(sample_q32[axis] - self->left_q32[axis]) > most_q32;
    }
    return is_far;
}

bool stream_is_live(const stream_t *self, uint64_t now_us)
{
    return self->phase == STREAM_RUNNING && stream_clock_is_live(&self->clock, now_us);
}

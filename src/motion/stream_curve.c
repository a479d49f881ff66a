/* SPDX-License-Identifier: MIT
 * stream_curve.c - the curve through the samples of a stream.
 * Evaluated as oldest control point + differences x cumulative weights: equal points give exactly that point, and the curve stays
 * within its control points. Those are the points, or (fast) led ahead of them so that the curve is less late. Where a sample is
 * missing and a later one is here, the point is interpolated; else it is guessed: the motion of the last samples goes on for a
 * while, fades, and waits. When samples come back, or do not, the curve is off the points that are known now. What it is off is
 * kept and taken back by a triple-pole filter, so that position and velocity of the control points go on as they were.
 */
#include "stream_curve.h"

#include "stream_grain.h"

enum {
    AHEAD_MAX = 8,     /* samples kept that are not committed */
    SHIFT_GUESSES = 4, /* a shifted time line is come over to as softly as after so many guesses */
    BEHIND_MAX = 4,    /* points before head that corrections and guesses look back at */
    GONE = 2,          /* guesses after which a sample is not just late */
    COARSE_ACC = 4,    /* of the accelerations that coarse steps can make, half is to be left to the motion ... */
    COARSE_JERK = 6,   /* ... and the ramps follow poorly where the jerk is often used up */
    COARSE_FAST = 2,   /* control points that are led swing so many times further */
};

#define REACH_MIN_US 36000  /* a motion is kept up for that long; longer only as far as the axis takes to stop ... */
#define REACH_MAX_US 100000 /* ... and not longer than this */
#define OFF_US       80000  /* time constant with which the curve comes back to the samples */
#define PATIENCE_US  150000
#define WAY_SHIFT    4                /* from Q32 to Q36 */
#define OFF_NOTHING  (Q32_ONE / 2000) /* 0.5 um: what is less is given up */

/* Where the ring has an index; indices wrap. */
static unsigned slot(uint32_t index)
{
    return index % STREAM_POINTS;
}

/* Index of the newest sample. */
HV_WRAPS static uint32_t newest(const stream_curve_t *self)
{
    return self->head + (uint32_t)self->ahead;
}

static void copy_point(const stream_curve_t *self, q32_t *to_q32, const q32_t *from_q32)
{
    for (unsigned axis = 0; axis < self->axes; axis++) {
        to_q32[axis] = from_q32[axis];
    }
}

void stream_curve_start(stream_curve_t *self, unsigned axes, const q32_t *sample_q32)
{
    stream_stop_t stop[AXES_MAX];
    for (unsigned axis = 0; axis < axes; axis++) {
        stop[axis] = self->stop[axis];
    }
    *self = (stream_curve_t){.axes = axes, .window = 1};
    for (unsigned axis = 0; axis < axes; axis++) {
        self->stop[axis] = stop[axis];
    }
    copy_point(self, self->last_q32, sample_q32);
    for (unsigned i = 0; i < STREAM_POINTS; i++) {
        copy_point(self, self->point_q32[i], sample_q32);
    }
    copy_point(self, self->control_q32, sample_q32);
}

/* Periods that a motion may be kept up so that it does not go further than the axis takes to stop: of v = step / period, the time
 * is sqrt(v / J), or half of v / A + A / J where the acceleration binds. Also the share of such a stop in which A builds up. */
static void find_reach(const stream_curve_t *self, unsigned axis, q32_t step_q32, stream_lead_t *on)
{
    const stream_stop_t *stop = &self->stop[axis];
    const q32_t vel_q32 = fx_mul_div(step_q32, Q16_ONE, self->period_cycles_q16);
    int64_t cycles_q16;
    on->reach_q16 = self->reach_min_q16;
    on->rise_q32 = (uint32_t)(Q32_ONE / 2);
    if (stop->jerk_per_cycle3_q32 <= 0 || vel_q32 == 0) {
        return;
    }
    const int64_t rise_q16 = fx_mul_div(stop->acc_per_cycle2_q32, Q16_ONE, stop->jerk_per_cycle3_q32); /* A / J */
    if (fx_mul_shift(stop->acc_per_cycle2_q32, rise_q16, 16) > vel_q32) {
        cycles_q16 =
            (int64_t)fx_sqrt_u64((uint64_t)fx_clamp(fx_mul_div(vel_q32, Q32_ONE, stop->jerk_per_cycle3_q32), 0, INT64_MAX));
    } else {
        cycles_q16 = (fx_mul_div(vel_q32, Q16_ONE, stop->acc_per_cycle2_q32) + rise_q16) / 2;
    }
    cycles_q16 -= cycles_q16 / 16; /* what follows the curve is a little behind it */
    const int64_t periods_q16 = fx_mul_div(cycles_q16, Q16_ONE, self->period_cycles_q16) - self->lead_q32 / (Q32_ONE / Q16_ONE);
    on->reach_q16 = (int32_t)fx_clamp(periods_q16, self->reach_min_q16, self->reach_max_q16);
    const int64_t rise_periods_q16 = fx_mul_div(rise_q16, Q16_ONE, self->period_cycles_q16);
    on->rise_q32 = (uint32_t)fx_clamp(fx_mul_div(rise_periods_q16, Q32_ONE, 2 * (int64_t)on->reach_q16), 0, Q32_ONE / 2);
}

/* The point of that index; of coarse values, a mean of the points up to it. */
HV_WRAPS static q32_t mean_point(const stream_curve_t *self, unsigned axis, uint32_t index)
{
    const int32_t window = self->window;
    int64_t sum_q32 = 0;
    if (window == 1) {
        return self->point_q32[slot(index)][axis];
    }
    for (int32_t back = 0; back < 3 * window - 2; back++) {
        sum_q32 += self->weight[back] * self->point_q32[slot(index - (uint32_t)back)][axis];
    }
    return sum_q32 / (window * window * window);
}

/* Where a control point for the point of that index belongs: on the point, or led ahead of it. Forward in time by L periods is
 * 1 + L D + ..., D the backward difference; the share of D^2 also undoes some of what the quadratic spline smooths away. */
HV_WRAPS static q32_t led_point(const stream_curve_t *self, unsigned axis, uint32_t index)
{
    const q32_t here_q32 = mean_point(self, axis, index);
    if (self->lead_q32 == 0) {
        return here_q32;
    }
    const q32_t before_q32 = mean_point(self, axis, index - 1);
    const q32_t step_q32 = here_q32 - before_q32;
    const q32_t bend_q32 = step_q32 - (before_q32 - mean_point(self, axis, index - 2));
    return here_q32 + fx_mul_shift(step_q32, self->lead_q32, 32) + fx_mul_shift(bend_q32, self->bend_q32, 32);
}

/* Where the last three control points belong, newest first. */
HV_WRAPS static void points_at_head(const stream_curve_t *self, q32_t point_q32[3][AXES_MAX])
{
    for (uint32_t back = 0; back < 3; back++) {
        for (unsigned axis = 0; axis < self->axes; axis++) {
            point_q32[back][axis] = led_point(self, axis, self->head - back);
        }
    }
}

/* The more was guessed, the more softly the curve comes back; what is still off from before keeps its softer way.
 * Returns the share of a velocity that may be added: the same velocity swings further out in a softer way. */
static q32_t soften(stream_curve_t *self, int32_t guessed)
{
    const int64_t wished_q32 = fx_clamp(Q32_ONE / (guessed + 2), self->softest_q32, Q32_ONE / 2);
    self->grip_q32 = self->is_off && self->grip_q32 < wished_q32 ? self->grip_q32 : wished_q32;
    self->is_off = true;
    return fx_mul_div(self->grip_q32, Q32_ONE, wished_q32);
}

/* The points at head are others now: what the curve is off them, and how that changes, so that it goes on as it was. The change
 * is taken over two periods, as the first of them may be the error of a single guess. */
static void keep_going(stream_curve_t *self, q32_t was_q32[3][AXES_MAX], int32_t guessed)
{
    q32_t is_q32[3][AXES_MAX];
    const q32_t share_q32 = soften(self, guessed);
    points_at_head(self, is_q32);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t here_q32 = was_q32[0][axis] - is_q32[0][axis];
        const q32_t most_q32 = 4 * fx_abs(self->lead[axis].first_q32) + fx_abs(here_q32) / 16;
        const q32_t change_q32 = fx_clamp((here_q32 - (was_q32[2][axis] - is_q32[2][axis])) / 2, -most_q32, most_q32);
        self->off_q32[axis][0] += here_q32;
        self->off_q32[axis][1] += fx_mul_shift(change_q32, share_q32, 32);
    }
}

/* How many points a control point is to be the mean of, thrice. Values in steps of q are off by up to q / 2. Of that a mean of m
 * points makes second differences of up to 2 q / m^2 and third ones of up to 4 q / m^3, to be held against what the axis can do.
 */
static int32_t window_of_axis(const stream_curve_t *self, unsigned axis)
{
    const stream_stop_t *stop = &self->stop[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t grain_q32 = self->grain[axis].grain_q32;
    if (grain_q32 == 0 || stop->jerk_per_cycle3_q32 <= 0) {
        return 1;
    }
    const q32_t acc_q32 = fx_mul_shift(fx_mul_shift(stop->acc_per_cycle2_q32, n_q16, 16), n_q16, 16);
    const q32_t jerk_q32 = fx_mul_shift(fx_mul_shift(fx_mul_shift(stop->jerk_per_cycle3_q32, n_q16, 16), n_q16, 16), n_q16, 16);
    const int64_t one_q16 = self->lead_q32 == 0 ? Q16_ONE : COARSE_FAST * Q16_ONE;
    const int64_t by_acc_q16 = fx_mul_div(grain_q32, COARSE_ACC * one_q16, acc_q32);
    const int64_t by_jerk_q16 = fx_mul_div(grain_q32, COARSE_JERK * one_q16, jerk_q32);
    int64_t m = 1;
    while (m <= STREAM_WINDOW_MAX && (m * m * Q16_ONE < by_acc_q16 || m * m * m * Q16_ONE < by_jerk_q16)) {
        m++;
    }
    return m <= STREAM_WINDOW_MAX ? (int32_t)m : 1; /* half a mean is worse than none */
}

/* The same for all axes, so that they are late together. */
static int32_t find_window(const stream_curve_t *self)
{
    int32_t window = 1;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const int32_t of_axis = window_of_axis(self, axis);
        window = of_axis > window ? of_axis : window;
    }
    return window;
}

static int32_t pairs(int32_t n)
{
    return n > 1 ? n * (n - 1) / 2 : 0;
}

/* Other control points belong to the same samples: the curve comes over to them softly. A window is kept where one less would do:
 * no to and fro with the period. */
static void set_window(stream_curve_t *self, int32_t window)
{
    q32_t was_q32[3][AXES_MAX];
    if (window == self->window || (window > 1 && window + 1 == self->window)) {
        return;
    }
    points_at_head(self, was_q32);
    self->window = window;
    for (int32_t k = 0; k < 3 * window - 2; k++) { /* ways to write k as a sum of three numbers below the window */
        self->weight[k] = (uint8_t)(pairs(k + 2) - 3 * pairs(k + 2 - window) + 3 * pairs(k + 2 - 2 * window));
    }
    keep_going(self, was_q32, SHIFT_GUESSES);
}

void stream_curve_pace(stream_curve_t *self, stream_style_t style, uint32_t period_us, uint32_t cycle_us)
{
    self->lead_q32 = style == STREAM_FAST ? STREAM_FAST_LEAD_Q32 : 0;
    self->bend_q32 = style == STREAM_FAST ? STREAM_FAST_BEND_Q32 : 0;
    self->period_cycles_q16 = (int64_t)period_us * Q16_ONE / cycle_us;
    self->reach_min_q16 = (int32_t)((int64_t)REACH_MIN_US * Q16_ONE / period_us);
    self->reach_max_q16 = (int32_t)((int64_t)REACH_MAX_US * Q16_ONE / period_us);
    self->softest_q32 = fx_clamp((int64_t)period_us * Q32_ONE / OFF_US, Q32_ONE / 32, Q32_ONE / 2);
    self->patience = (int32_t)(PATIENCE_US / period_us) + 3;
    set_window(self, find_window(self));
}

/* Where the motion of the last samples goes in one period. A jump is not taken for a motion: one just made would go on (hence at
 * most 4 x the larger of the two steps before), one made before would be undone (hence the bend, where it turned, at most the
 * step). */
HV_WRAPS static q32_t lead(const stream_curve_t *self, unsigned axis)
{
    const uint32_t last = newest(self);
    q32_t step[3];
    for (uint32_t i = 0; i < 3; i++) {
        step[i] = self->point_q32[slot(last - i)][axis] - self->point_q32[slot(last - i - 1)][axis];
    }
    const q32_t bend = step[0] - step[1];
    const bool has_turned = (bend > 0) != (step[1] - step[2] > 0);
    const q32_t bend_max = has_turned ? fx_abs(step[0]) : fx_abs(bend);
    const q32_t before = fx_abs(step[1]) > fx_abs(step[2]) ? fx_abs(step[1]) : fx_abs(step[2]);
    return fx_clamp(step[0] + fx_clamp(bend, -bend_max, bend_max), -4 * before, 4 * before);
}

HV_WRAPS static void begin_guessing(stream_curve_t *self)
{
    for (unsigned axis = 0; axis < self->axes; axis++) {
        stream_lead_t *on = &self->lead[axis];
        const q32_t step_q32 = fx_abs(self->last_q32[axis] - self->point_q32[slot(newest(self) - 1)][axis]);
        on->first_q32 = lead(self, axis);
        on->go_q32 = fx_clamp(on->first_q32, -step_q32, step_q32);
        find_reach(self, axis, fx_abs(on->go_q32), on);
    }
}

/* What a stop has lost so far against a motion that goes on, up to the middle of it: the acceleration rises, then stays. Time and
 * way are in stops, of which each goes half as far as that motion. */
static q32_t lost_q32(q32_t time_q32, q32_t rise_q32)
{
    const q32_t square_q32 = fx_mul_shift(time_q32, time_q32, 32);
    const q32_t lost = time_q32 < rise_q32
                           ? fx_mul_div(square_q32, time_q32, 6 * rise_q32)
                           : square_q32 / 2 - fx_mul_shift(rise_q32, time_q32, 33) + fx_mul_shift(rise_q32, rise_q32, 32) / 6;
    return fx_mul_div(lost, Q32_ONE, Q32_ONE - rise_q32);
}

/* Steps that so many periods go: the way of the quickest stop, whose second half is its first reversed. In its first period that
 * loses next to nothing, but `fast` would leave its curve for it: it goes a full step first. */
static int64_t way_q16(const stream_lead_t *on, int64_t full_q16, int64_t periods)
{
    const int64_t stop_q16 = 2 * (on->reach_q16 - full_q16);
    const int64_t time_q16 = periods * Q16_ONE - full_q16;
    if (time_q16 <= 0 || time_q16 >= stop_q16) {
        return time_q16 <= 0 ? periods * Q16_ONE : on->reach_q16;
    }
    const q32_t time_q32 = fx_mul_div(time_q16, Q32_ONE, stop_q16);
    const q32_t way_q32 = time_q32 <= Q32_ONE / 2 ? time_q32 - lost_q32(time_q32, on->rise_q32)
                                                  : Q32_ONE / 2 - lost_q32(Q32_ONE - time_q32, on->rise_q32);
    return full_q16 + fx_mul_shift(way_q32, stop_q16, 32);
}

/* The point so many periods beyond the newest sample: the motion goes on, ever more slowly. */
HV_WRAPS static void guess(stream_curve_t *self, int32_t periods)
{
    q32_t *const point_q32 = self->point_q32[slot(newest(self) + (uint32_t)periods)];
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const stream_lead_t *on = &self->lead[axis];
        const int64_t full_q16 = self->lead_q32 == 0 ? 0 : on->reach_q16 < Q16_ONE ? on->reach_q16 : Q16_ONE;
        const int64_t first_q16 = way_q16(on, full_q16, 1);
        point_q32[axis] = self->last_q32[axis] + fx_mul_shift(on->first_q32, first_q16, 16) +
                          fx_mul_shift(on->go_q32, way_q16(on, full_q16, periods) - first_q16, 16);
    }
}

/* Guesses again what is committed beyond the newest sample. */
static void guess_again(stream_curve_t *self)
{
    begin_guessing(self);
    for (int32_t periods = 1; periods <= -self->ahead; periods++) {
        guess(self, periods);
    }
}

/* The point after last: of one that is missing on the parabola through before, last, and next; of more on the straight line, as
 * a parabola could swing out. */
static q32_t point_between(q32_t before_q32, q32_t last_q32, q32_t next_q32, int32_t periods)
{
    return periods == 2 ? last_q32 + (next_q32 - before_q32) / 3 : last_q32 + (next_q32 - last_q32) / periods;
}

/* Points between the sample before, so many periods ago, and the newest, as far as they are committed: now they can be
 * interpolated. */
HV_WRAPS static void fill_gap(stream_curve_t *self, int32_t periods, const q32_t *before_q32)
{
    const q32_t *const two_before_q32 = self->point_q32[slot(newest(self) - 3)];
    for (int32_t back = self->ahead > 1 ? self->ahead : 1; back < periods && back < self->ahead + BEHIND_MAX; back++) {
        q32_t *const point_q32 = self->point_q32[slot(newest(self) - (uint32_t)back)];
        for (unsigned axis = 0; axis < self->axes; axis++) {
            const q32_t way = self->last_q32[axis] - before_q32[axis];
            point_q32[axis] = periods == 2 ? point_between(two_before_q32[axis], before_q32[axis], self->last_q32[axis], 2)
                                           : self->last_q32[axis] - fx_mul_div(way, back, periods);
        }
    }
}

HV_WRAPS void stream_curve_append(stream_curve_t *self, unsigned periods, const q32_t *sample_q32)
{
    q32_t was_q32[3][AXES_MAX];
    q32_t before_q32[AXES_MAX];
    const int32_t guessed = -self->ahead;
    if (guessed > 0) {
        points_at_head(self, was_q32);
    }
    copy_point(self, before_q32, self->last_q32);
    stream_grain_watch(self, periods, sample_q32);
    copy_point(self, self->last_q32, sample_q32);
    const int32_t ahead = self->ahead + (int32_t)periods;
    const int32_t kept = (int32_t)fx_clamp(ahead, -BEHIND_MAX, AHEAD_MAX);
    for (int32_t i = self->ahead > 0 ? self->ahead + 1 : 1; i < kept; i++) {
        self->is_sample[slot(self->head + (uint32_t)i)] = false;
    }
    self->ahead = kept;
    copy_point(self, self->point_q32[slot(newest(self))], self->last_q32);
    self->is_sample[slot(newest(self))] = true;
    fill_gap(self, (int32_t)periods, before_q32);
    if (self->ahead < 0) {
        guess_again(self);
    }
    if (guessed == 1) { /* an error of one point, and of no velocity: half of it is taken back at once */
        for (unsigned axis = 0; axis < self->axes; axis++) {
            self->off_q32[axis][0] += (was_q32[0][axis] - led_point(self, axis, self->head)) / 2;
        }
        (void)soften(self, 0);
    } else if (guessed > 1) {
        keep_going(self, was_q32, guessed);
    }
}

HV_WRAPS q32_t stream_curve_misfit(const stream_curve_t *self, const q32_t *sample_q32, unsigned periods, q32_t *step_q32)
{
    const int64_t n = periods;
    q32_t misfit_q32 = 0;
    *step_q32 = 0;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t before_q32 = self->point_q32[slot(newest(self) - 1)][axis];
        const q32_t step = self->last_q32[axis] - before_q32;
        const q32_t bend = step - (before_q32 - self->point_q32[slot(newest(self) - 2)][axis]);
        misfit_q32 += fx_abs(sample_q32[axis] - self->last_q32[axis] - n * step - n * (n + 1) / 2 * bend);
        misfit_q32 += 2 * self->grain[axis].grain_q32; /* what rounding may make of it */
        *step_q32 += fx_abs(step);
    }
    return misfit_q32;
}

bool stream_curve_is_newest(const stream_curve_t *self, const q32_t *sample_q32)
{
    unsigned axis = 0;
    while (axis < self->axes && self->last_q32[axis] == sample_q32[axis]) {
        axis++;
    }
    return axis == self->axes;
}

/* Between the last point committed and the next sample. */
HV_WRAPS static void interpolate(stream_curve_t *self, q32_t *point_q32)
{
    int32_t periods = 2;
    while (!self->is_sample[slot(self->head + (uint32_t)periods)]) {
        periods++;
    }
    const q32_t *const next = self->point_q32[slot(self->head + (uint32_t)periods)];
    const q32_t *const last = self->point_q32[slot(self->head)];
    const q32_t *const before = self->point_q32[slot(self->head - 1)];
    for (unsigned axis = 0; axis < self->axes; axis++) {
        point_q32[axis] = point_between(before[axis], last[axis], next[axis], periods);
    }
}

/* No sample has come for so long that none is expected: as if the last one had come again and again, the curve goes back to it.
 */
HV_WRAPS static void give_up(stream_curve_t *self)
{
    q32_t was_q32[3][AXES_MAX];
    points_at_head(self, was_q32);
    for (int32_t back = 0; back < self->patience; back++) { /* 40 at most: the ring is longer */
        copy_point(self, self->point_q32[slot(self->head - (uint32_t)back)], self->last_q32);
    }
    for (unsigned axis = 0; axis < self->axes; axis++) {
        self->lead[axis] = (stream_lead_t){.rise_q32 = 0};
    }
    keep_going(self, was_q32, self->patience);
}

/* Settles the point after head. */
HV_WRAPS static void find_next(stream_curve_t *self)
{
    if (self->ahead > 0) {
        if (!self->is_sample[slot(self->head + 1)]) {
            interpolate(self, self->point_q32[slot(self->head + 1)]);
        }
        return;
    }
    if (self->ahead == 0) {
        begin_guessing(self);
    } else if (-self->ahead == self->patience) {
        give_up(self);
    }
    guess(self, 1 - self->ahead);
}

void stream_curve_skip(stream_curve_t *self)
{
    q32_t was_q32[3][AXES_MAX];
    if (self->ahead < 2) {
        return;
    }
    points_at_head(self, was_q32);
    find_next(self);
    self->head++;
    self->ahead--;
    keep_going(self, was_q32, SHIFT_GUESSES);
}

HV_WRAPS void stream_curve_stretch(stream_curve_t *self)
{
    q32_t was_q32[3][AXES_MAX];
    if (self->ahead >= AHEAD_MAX || self->ahead <= -BEHIND_MAX) {
        return;
    }
    points_at_head(self, was_q32);
    self->is_sample[slot(self->head)] = true; /* as it stands, whatever it was made from */
    self->head--;
    self->ahead++;
    if (self->ahead < 0) {
        guess_again(self);
    }
    keep_going(self, was_q32, SHIFT_GUESSES);
}

/* One period of the filter that takes back what the curve is off: q^3 with q = 1 - grip, see the ramp in DESIGN.md. */
static void take_back(const stream_curve_t *self, q32_t off_q32[3])
{
    if (((uint64_t)off_q32[0] | (uint64_t)off_q32[1] | (uint64_t)off_q32[2]) == 0) {
        return;
    }
    const int64_t g = self->grip_q32;
    const int64_t g2 = fx_mul_shift(g, g, 32);
    const int64_t g3 = fx_mul_shift(g2, g, 32);
    off_q32[2] -= fx_mul_shift(off_q32[0], g3, 32) + fx_mul_shift(off_q32[1], 3 * g2 - 2 * g3, 32) +
                  fx_mul_shift(off_q32[2], 3 * g - 3 * g2 + g3, 32);
    off_q32[1] += off_q32[2];
    off_q32[0] += off_q32[1];
    if (fx_abs(off_q32[0]) < OFF_NOTHING && fx_abs(off_q32[1]) < OFF_NOTHING && fx_abs(off_q32[2]) < OFF_NOTHING) {
        off_q32[0] = off_q32[1] = off_q32[2] = 0;
    }
}

/* The way between two control points, which are far below 2^58. */
static int64_t way_between(q32_t from_q32, q32_t to_q32)
{
    return (to_q32 - from_q32) * ((int64_t)1 << WAY_SHIFT);
}

/* The point at head becomes the last control point, with what the curve is still off it. */
static void put_control(stream_curve_t *self)
{
    self->is_off = false;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t before_q32 =
            self->control_q32[axis] + fx_shift_down(self->way_q36[0][axis] + self->way_q36[1][axis], WAY_SHIFT);
        take_back(self, self->off_q32[axis]);
        self->way_q36[2][axis] = way_between(before_q32, led_point(self, axis, self->head) + self->off_q32[axis][0]);
        self->is_off |= self->off_q32[axis][0] != 0 || self->off_q32[axis][1] != 0;
    }
}

HV_WRAPS void stream_curve_commit(stream_curve_t *self)
{
    find_next(self);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        self->control_q32[axis] += fx_shift_down(self->way_q36[0][axis], WAY_SHIFT);
        self->way_q36[0][axis] = self->way_q36[1][axis];
        self->way_q36[1][axis] = self->way_q36[2][axis];
    }
    self->head++;
    self->ahead--;
    put_control(self);
}

/* Control points of a curve that is here, moving so, at the beginning of a segment: of the cubic three count, of the quadratic
 * two. p = (c0 + 4 c1 + c2) / 6, p' = (c2 - c0) / 2, p'' = c0 - 2 c1 + c2, or p = (c1 + c2) / 2, p' = c2 - c1. */
static void control_from(stream_style_t style, q32_t pos_q32, q32_t vel_q32, q32_t acc_q32, q32_t control_q32[3])
{
    const q32_t acc = style == STREAM_FAST ? 0 : acc_q32;
    const q32_t middle_q32 = style == STREAM_FAST ? pos_q32 - vel_q32 / 2 : pos_q32 - acc / 6;
    control_q32[0] = middle_q32 - vel_q32 + acc / 2;
    control_q32[1] = middle_q32;
    control_q32[2] = middle_q32 + vel_q32 + acc / 2;
}

/* How fast the curve may leave a way that may have been a jump: the softer it comes back, the further it swings out by that. At
 * 60 Hz a sixteenth of the way in a period. */
static q32_t jump_speed(const stream_curve_t *self, q32_t off_q32)
{
    return fx_mul_shift(fx_abs(off_q32), fx_clamp(self->grip_q32 * 5 / 16, 0, Q32_ONE / 16), 32);
}

HV_WRAPS void stream_curve_regrid(stream_curve_t *self, stream_style_t style, const history_t *now, unsigned periods,
                                  const q32_t *sample_q32)
{
    const int64_t n_q16 = self->period_cycles_q16;
    self->ahead = 0;
    self->is_off = false; /* what it was off was per period of the old grid, and so was the grip */
    (void)soften(self, self->patience);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t way_q32 = sample_q32[axis] - self->last_q32[axis];
        const q32_t step_q32 = (int32_t)periods > self->patience ? 0 : way_q32 / (int32_t)periods;
        for (int32_t back = 0; back < STREAM_POINTS - AHEAD_MAX; back++) {
            self->point_q32[slot(self->head - (uint32_t)back)][axis] = sample_q32[axis] - back * step_q32;
        }
        const q32_t acc_q32 = fx_mul_shift(fx_mul_shift(now[axis].acc_per_cycle2_q32, n_q16, 16), n_q16, 16);
        const q32_t vel_q32 = fx_mul_shift(now[axis].vel_per_cycle_q32 + now[axis].acc_per_cycle2_q32 / 2, n_q16, 16);
        q32_t control_q32[3];
        control_from(style, now[axis].pos_q32, vel_q32, acc_q32, control_q32);
        q32_t *const off_q32 = self->off_q32[axis];
        off_q32[0] = control_q32[2] - led_point(self, axis, self->head - 1);
        const q32_t most_q32 = fx_abs(vel_q32) + jump_speed(self, off_q32[0]);
        off_q32[1] = fx_clamp(control_q32[2] - control_q32[1] - step_q32, -most_q32, most_q32);
        off_q32[2] = 0;
        self->control_q32[axis] = control_q32[0];
        self->way_q36[0][axis] = way_between(control_q32[0], control_q32[1]);
        self->way_q36[1][axis] = way_between(control_q32[1], control_q32[2]);
    }
    copy_point(self, self->last_q32, sample_q32);
    put_control(self);
}

bool stream_curve_is_standing(const stream_curve_t *self)
{
    bool is_standing = true;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        is_standing &= self->point_q32[slot(newest(self))][axis] == self->point_q32[slot(newest(self) - 1)][axis];
    }
    return is_standing || self->ahead <= -GONE;
}

bool stream_curve_is_at_rest(const stream_curve_t *self)
{
    bool is_resting = -self->ahead > self->patience;
    for (unsigned axis = 0; axis < self->axes && is_resting; axis++) {
        is_resting = self->control_q32[axis] == self->last_q32[axis];
        for (unsigned i = 0; i < 3; i++) {
            is_resting &= self->way_q36[i][axis] == 0;
        }
    }
    return is_resting;
}

/* Of what is not negative: four instructions instead of ten. */
static int64_t sixth(int64_t value)
{
    return (int64_t)((uint64_t)value / 6);
}

/* Q60: sums up to 5 occur. The quadratic begins at the second of the points: its first weight is 1, which is exact. */
void stream_curve_weigh(stream_style_t style, q32_t between_q32, int64_t weight_q60[3])
{
    const int64_t one = Q62_ONE / 4;
    const int64_t u = between_q32 * (one / Q32_ONE);
    const int64_t u2 = (int64_t)(((uint64_t)between_q32 * (uint64_t)between_q32 + 8) / 16); /* Q64, rounded to Q60 */
    if (style == STREAM_FAST) {
        weight_q60[0] = one;
        weight_q60[1] = (one + 2 * u - u2) / 2;
        weight_q60[2] = u2 / 2;
        return;
    }
    const int64_t u3 = fx_mul_shift_fit(u2, u, 60);
    weight_q60[0] = sixth(5 * one + 3 * (u - u2) + u3);
    weight_q60[1] = sixth(one + 3 * (u + u2) - 2 * u3);
    weight_q60[2] = sixth(u3);
}

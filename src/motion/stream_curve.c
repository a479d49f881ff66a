/* SPDX-License-Identifier: MIT
 * stream_curve.c - the curve through the samples of a stream.
 * Evaluated as oldest control point + differences x cumulative weights: equal points give exactly that point, and the curve stays
 * within its control points. Those are the points, or (balanced) led ahead of them so that the curve is less late. Where a sample
 * is missing and a later one is here, the point is interpolated; else it is guessed: the motion of the last samples goes on for a
 * while, fades, and waits. When samples come back, or do not, the curve is off the points that are known now. What it is off is
 * kept and taken back by a triple-pole filter, so that position and velocity of the control points go on as they were.
 */
#include "stream_curve.h"

#include "stream_quantum.h"

enum {
    AGE_MAX = STREAM_CURVE_AGE_MAX,
    AHEAD_MAX = STREAM_CURVE_AHEAD_MAX,
    MEAN_MAX = STREAM_CURVE_MEAN_MAX,
    LED_POINTS = 7,    /* that a control point is led by, beside its own */
    SHIFT_GUESSES = 4, /* a shifted time line is come over to as softly as after so many guesses */
    STALL_GUESSES = 8, /* what a stall left behind is come over to more softly still */
    BEHIND_MAX = 4,    /* points before head that corrections and guesses look back at */
    COARSE_ACC = 4,    /* of the accelerations that coarse steps can make, half is to be left to the motion ... */
    COARSE_JERK = 6,   /* ... and of the jerk most */
    COARSE_LED = 2     /* control points that are led swing so many times further */
};

#define REACH_MIN_US   50000          /* a motion is kept up for that long, ... */
#define REACH_FEW_US   62000          /* ... or for that long where ... */
#define FEW_PERIODS    3              /* ... as much is needed to find it moving still after such a pause; ... */
#define LOSSY_PERIODS  4              /* ... where samples are often lost, after that many; ... */
#define REACH_MAX_US   100000         /* ... and longer only as far as the axis takes to stop: so long at most */
#define MEAN_US        29000u         /* of arrivals, about so long */
#define LED_CHANGE_Q32 (Q32_ONE / 64) /* of what is led, in a period */
#define OFF_US         80000
#define PATIENCE_US    300000
#define WAY_SHIFT      4                /* from Q32 to Q36 */
#define OFF_NOTHING    (Q32_ONE / 2000) /* 0.5 um: what is less is given up */

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

/* The channels of the governor: the axes, and the cylinders they lead to where there is a mechanism and such a pose. */
static bool find_channels(const stream_curve_t *self, const kin_t *kin, const q32_t axis_q32[AXES_MAX],
                          q32_t channel_q32[GOVERNOR_CHANNELS])
{
    pose_t pose = {{0}};
    for (unsigned i = 0; i < GOVERNOR_CHANNELS; i++) {
        channel_q32[i] = i < POSE_AXES && i < self->axes ? axis_q32[i] : 0;
    }
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        pose.axis_q32[axis] = channel_q32[axis];
    }
    return kin == NULL || kin_inverse(kin, &pose, &channel_q32[POSE_AXES]) == HV_OK;
}

/* The governor begins with these control points, the newest last.
 * @param is_steady they have been moving like that for long; else the motion has just begun */
static void place_governor(stream_curve_t *self, const kin_t *kin, bool is_steady, q32_t control_q32[3][AXES_MAX])
{
    q32_t channel_q32[3][GOVERNOR_CHANNELS];
    for (unsigned i = 0; i < 3; i++) {
        (void)find_channels(self, kin, control_q32[i], channel_q32[i]);
    }
    governor_start(&self->governor);
    for (unsigned i = 0; i < GOVERNOR_CHANNELS; i++) {
        const q32_t value_q32[3] = {channel_q32[0][i], channel_q32[1][i], channel_q32[2][i]};
        governor_place(&self->governor, i, is_steady, value_q32);
    }
}

/* What was asked last was here. */
static void shift_governor(stream_curve_t *self, const kin_t *kin, const q32_t asked_q32[AXES_MAX])
{
    q32_t channel_q32[GOVERNOR_CHANNELS];
    if (find_channels(self, kin, asked_q32, channel_q32)) {
        for (unsigned i = 0; i < self->governor.channels; i++) {
            governor_shift(&self->governor, i, channel_q32[i]);
        }
    }
}

void stream_curve_start(stream_curve_t *self, const kin_t *kin, const q32_t *sample_q32)
{
    q32_t rest_q32[3][AXES_MAX];
    for (unsigned axis = 0; axis < self->axes; axis++) {
        self->way_q36[0][axis] = self->way_q36[1][axis] = self->way_q36[2][axis] = 0;
        self->off_q32[axis][0] = self->off_q32[axis][1] = self->off_q32[axis][2] = 0;
        self->lead[axis] = (stream_lead_t){0};
        self->grain[axis] = (stream_quantum_t){0};
    }
    self->watched = 0;
    self->change = 0;
    self->is_off = false;
    self->window = 1;
    self->mean_points = 0;
    self->led_q32 = Q32_ONE;
    self->head = 0;
    self->ahead = 0;
    copy_point(self, self->last_q32, sample_q32);
    copy_point(self, self->newest_q32, sample_q32);
    for (unsigned i = 0; i < STREAM_POINTS; i++) {
        copy_point(self, self->point_q32[i], sample_q32);
        self->is_sample[i] = false;
    }
    copy_point(self, self->control_q32, sample_q32);
    for (unsigned i = 0; i < 3; i++) {
        copy_point(self, rest_q32[i], sample_q32);
    }
    place_governor(self, kin, true, rest_q32);
}

/* Periods that a motion may be kept up so that it does not go further than the axis takes to stop: of v = step / period, the time
 * is sqrt(v / J), or half of v / A + A / J where the acceleration binds. Also the share of such a stop in which A builds up. */
static void find_reach(const stream_curve_t *self, unsigned axis, q32_t step_q32, stream_lead_t *on)
{
    const governor_limits_t *stop = &self->limits[axis];
    const q32_t vel_q32 = fx_mul_div(step_q32, Q16_ONE, self->period_cycles_q16);
    int64_t cycles_q16;
    on->reach_q16 = self->reach_min_q16;
    on->full_q16 = 0;
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
    const int64_t stop_q16 = fx_mul_div(cycles_q16, Q16_ONE, self->period_cycles_q16);
    on->reach_q16 = (int32_t)fx_clamp(stop_q16 - self->lead_q32 / (Q32_ONE / Q16_ONE), self->reach_min_q16, self->reach_max_q16);
    if (on->reach_q16 > stop_q16) { /* there is room for a softer one */
        on->full_q16 = (int32_t)((on->reach_q16 - stop_q16) / 2);
        return;
    }
    const int64_t rise_periods_q16 = fx_mul_div(rise_q16, Q16_ONE, self->period_cycles_q16);
    on->rise_q32 = (uint32_t)fx_clamp(fx_mul_div(rise_periods_q16, Q32_ONE, 2 * stop_q16 + 1), 0, Q32_ONE / 2);
}

/* The point of that index; of coarse values, a mean of the points up to it. Where samples belong to their arrivals their times
 * are off by what the network adds, which is noise on the points: the mean of two of them has a third of its jerk. */
HV_WRAPS static q32_t mean_point(const stream_curve_t *self, unsigned axis, uint32_t index)
{
    const int32_t window = self->window;
    int64_t sum_q32 = 0;
    if (window == 1) {
        const q32_t here_q32 = self->point_q32[slot(index)][axis];
        if (self->mean_q32 == 0) {
            return here_q32;
        }
        for (uint32_t back = 1; back < self->mean_points; back++) {
            sum_q32 += self->point_q32[slot(index - back)][axis] - here_q32;
        }
        return here_q32 + fx_mul_shift(sum_q32 / (int64_t)self->mean_points, self->mean_q32, 32);
    }
    for (int32_t back = 0; back < 3 * window - 2; back++) {
        sum_q32 += self->weight[back] * self->point_q32[slot(index - (uint32_t)back)][axis];
    }
    return sum_q32 / (window * window * window);
}

/* A linear predictor of 0.68 periods: what each point before weighs, beside the newest, in Q32. Found by least squares over 0 to
 * 6 Hz at 60 Hz under the condition that no frequency comes out more than 1.05 times as large, behind the cubic: the short
 * predictor 1 + L D - L (1 - L) / 2 D^2 makes 1.14 times as much at 5 Hz and 1.27 at 10. Where samples belong to their arrivals,
 * their noise would be led as well, and where many are lost, what is guessed for them: then it is not done. */
static const int64_t k_led_q32[LED_POINTS] = {-5397123704, 3086786968, -1806239287, 979893574, -563808519, 245446526, -100343650};

/* Where a control point for the point of that index belongs: on the point, or led ahead of it. */
HV_WRAPS static q32_t led_point(const stream_curve_t *self, unsigned axis, uint32_t index)
{
    const q32_t here_q32 = mean_point(self, axis, index);
    int64_t ahead_q32 = 0;
    for (uint32_t back = 1; self->lead_q32 != 0 && self->led_q32 != 0 && back <= LED_POINTS; back++) {
        ahead_q32 += fx_mul_shift(mean_point(self, axis, index - back) - here_q32, k_led_q32[back - 1], 32);
    }
    return here_q32 + (self->led_q32 == Q32_ONE ? ahead_q32 : fx_mul_shift(ahead_q32, self->led_q32, 32));
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

/* What a control point may be moved by at once: a jump j makes third differences of up to 2 j; for a quarter of the limit. */
static q32_t bearable_jump(const stream_curve_t *self, unsigned axis)
{
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t jerk_q32 = self->limits[axis].jerk_per_cycle3_q32;
    return jerk_q32 > 0 ? fx_mul_shift(fx_mul_shift(fx_mul_shift(jerk_q32, n_q16, 16), n_q16, 16), n_q16, 16) / 8 : INT64_MAX;
}

/* Whether what is off comes back with less than half of what an axis can do: with three poles at 1 - g a distance d needs g^2 d
 * of acceleration and g^3 d of jerk at most, a speed e 3 g e and 3 g^2 e. */
static bool is_bearable(const stream_curve_t *self, unsigned axis, int64_t grip_q32)
{
    const governor_limits_t *limits = &self->limits[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    if (limits->jerk_per_cycle3_q32 <= 0) {
        return true;
    }
    const q32_t acc_q32 = fx_mul_shift(fx_mul_shift(limits->acc_per_cycle2_q32, n_q16, 16), n_q16, 16);
    const q32_t jerk_q32 = fx_mul_shift(fx_mul_shift(fx_mul_shift(limits->jerk_per_cycle3_q32, n_q16, 16), n_q16, 16), n_q16, 16);
    const q32_t by_way_q32 = fx_mul_shift(fx_abs(self->off_q32[axis][0]), grip_q32, 32);
    const q32_t by_speed_q32 = 3 * fx_abs(self->off_q32[axis][1]);
    const q32_t needs_acc_q32 = fx_mul_shift(by_way_q32 + by_speed_q32, grip_q32, 32);
    const q32_t needs_jerk_q32 = fx_mul_shift(needs_acc_q32, grip_q32, 32);
    return 2 * needs_acc_q32 <= acc_q32 && 2 * needs_jerk_q32 <= jerk_q32;
}

/* The softest grip that any axis needs. */
static void soften_to_limits(stream_curve_t *self)
{
    for (unsigned axis = 0; axis < self->axes && axis < POSE_AXES; axis++) {
        while (self->grip_q32 > self->softest_q32 && !is_bearable(self, axis, self->grip_q32)) {
            self->grip_q32 -= self->grip_q32 / 8;
        }
    }
}

/* The more was guessed, the more softly the curve comes back; what is still off from before keeps its softer way.
 * Returns the share of a velocity that may be added: the same velocity swings further out in a softer way. */
static q32_t soften(stream_curve_t *self, int32_t guessed)
{
    const int64_t softest_q32 = guessed >= STALL_GUESSES ? self->softest_q32 / 5 * 4 : self->softest_q32;
    const int64_t wished_q32 = fx_clamp(Q32_ONE / (guessed + 2), softest_q32, Q32_ONE / 2);
    self->grip_q32 = self->is_off && self->grip_q32 < wished_q32 ? self->grip_q32 : wished_q32;
    self->is_off = true;
    return fx_mul_div(self->grip_q32, Q32_ONE, wished_q32);
}

/* As far in a period as the axis moves at most, and since the stream began at rest can move so far: what was asked may have been
 * faster, but nothing has gone there. */
static q32_t within_speed(const stream_curve_t *self, unsigned axis, q32_t step_q32)
{
    const governor_limits_t *limits = &self->limits[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t most_q32 = fx_mul_shift(limits->vel_per_cycle_q32, n_q16, 16);
    const q32_t gained_q32 = fx_mul_shift(fx_mul_shift(limits->acc_per_cycle2_q32, n_q16, 16), n_q16, 16) * self->age;
    const q32_t least_q32 = most_q32 < gained_q32 ? most_q32 : gained_q32;
    return limits->jerk_per_cycle3_q32 > 0 ? fx_clamp(step_q32, -least_q32, least_q32) : step_q32;
}

/* The points at head are about to become others. However many changes follow, as in a burst, they are made up for once. */
static void note_change(stream_curve_t *self, int32_t guessed)
{
    if (self->change == 0) {
        points_at_head(self, self->was_q32);
    }
    self->change = guessed > self->change ? guessed : self->change;
}

/* Half of the error of a single guess, which is of one point and of no velocity, is taken back at once, as far as is bearable. */
static void take_back_half(stream_curve_t *self)
{
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t error_q32 = self->was_q32[0][axis] - led_point(self, axis, self->head);
        const q32_t most_q32 = bearable_jump(self, axis);
        self->off_q32[axis][0] += error_q32 - fx_clamp(error_q32 / 2, -most_q32, most_q32);
    }
    (void)soften(self, 0);
}

/* What the curve is off its new points, and how that changes, so that it goes on as it was. The change is taken over two periods,
 * as the first of them may be the error of a single guess. */
static void keep_going(stream_curve_t *self)
{
    q32_t is_q32[3][AXES_MAX];
    const q32_t share_q32 = soften(self, self->change);
    points_at_head(self, is_q32);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t here_q32 = self->was_q32[0][axis] - is_q32[0][axis];
        const q32_t most_q32 = 4 * fx_abs(self->lead[axis].first_q32) + fx_abs(here_q32) / 16;
        const q32_t change_q32 = fx_clamp((here_q32 - (self->was_q32[2][axis] - is_q32[2][axis])) / 2, -most_q32, most_q32);
        self->off_q32[axis][0] += here_q32;
        self->off_q32[axis][1] = within_speed(self, axis, self->off_q32[axis][1] + fx_mul_shift(change_q32, share_q32, 32));
    }
}

/* How many points a control point is to be the mean of, thrice. Values in steps of q are off by up to q / 2. Of that a mean of m
 * points makes second differences of up to 2 q / m^2 and third ones of up to 4 q / m^3, to be held against what the axis can do.
 */
static int32_t window_of_axis(const stream_curve_t *self, unsigned axis)
{
    const governor_limits_t *stop = &self->limits[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t quantum_q32 = self->grain[axis].quantum_q32;
    if (quantum_q32 == 0 || stop->jerk_per_cycle3_q32 <= 0) {
        return 1;
    }
    const q32_t acc_q32 = fx_mul_shift(fx_mul_shift(stop->acc_per_cycle2_q32, n_q16, 16), n_q16, 16);
    const q32_t jerk_q32 = fx_mul_shift(fx_mul_shift(fx_mul_shift(stop->jerk_per_cycle3_q32, n_q16, 16), n_q16, 16), n_q16, 16);
    const int64_t one_q16 = self->lead_q32 == 0 ? Q16_ONE : COARSE_LED * Q16_ONE;
    const int64_t by_acc_q16 = fx_mul_div(quantum_q32, COARSE_ACC * one_q16, acc_q32);
    const int64_t by_jerk_q16 = fx_mul_div(quantum_q32, COARSE_JERK * one_q16, jerk_q32);
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
    if (window == self->window || (window > 1 && window + 1 == self->window)) {
        return;
    }
    note_change(self, SHIFT_GUESSES);
    self->window = window;
    for (int32_t k = 0; k < 3 * window - 2; k++) { /* ways to write k as a sum of three numbers below the window */
        self->weight[k] = (uint8_t)(pairs(k + 2) - 3 * pairs(k + 2 - window) + 3 * pairs(k + 2 - 2 * window));
    }
}

void stream_curve_average(stream_curve_t *self, q32_t arrived_q32, bool is_lossy)
{
    const q32_t wished_q32 = is_lossy ? 0 : Q32_ONE - arrived_q32;
    self->mean_q32 = arrived_q32;
    self->led_q32 = fx_clamp(wished_q32, self->led_q32 - LED_CHANGE_Q32, self->led_q32 + LED_CHANGE_Q32);
}

/* As many points as arrivals take that long; no to and fro with the period. */
static void find_mean(stream_curve_t *self, uint32_t period_us)
{
    const uint32_t now_us = self->mean_points > 0 ? (self->mean_points - 1) * period_us : 0;
    const uint32_t off_us = now_us > MEAN_US ? now_us - MEAN_US : MEAN_US - now_us;
    if (self->mean_points == 0 || off_us * 4 > period_us * 3) {
        self->mean_points = 1 + (uint32_t)fx_clamp((MEAN_US + period_us / 2) / period_us, 1, MEAN_MAX - 1);
    }
}

void stream_curve_pace(stream_curve_t *self, stream_style_t style, uint32_t period_us, uint32_t cycle_us, bool is_lossy)
{
    const int64_t led_us = style == STREAM_BALANCED ? fx_mul_shift(period_us, STREAM_CURVE_LED_Q32, 32) : 0;
    const int64_t few_us = fx_clamp(FEW_PERIODS * period_us + led_us, REACH_MIN_US, REACH_FEW_US);
    const int64_t reach_us = is_lossy ? fx_clamp(LOSSY_PERIODS * period_us, few_us, REACH_MAX_US) : few_us;
    self->lead_q32 = style == STREAM_BALANCED ? STREAM_CURVE_LED_Q32 : 0;
    self->period_cycles_q16 = (int64_t)period_us * Q16_ONE / cycle_us;
    self->reach_min_q16 = (int32_t)(reach_us * Q16_ONE / period_us);
    self->reach_max_q16 = (int32_t)((int64_t)REACH_MAX_US * Q16_ONE / period_us);
    self->softest_q32 = fx_clamp((int64_t)period_us * Q32_ONE / OFF_US, Q32_ONE / 32, Q32_ONE / 2);
    self->patience = (int32_t)(PATIENCE_US / period_us) + 3;
    find_mean(self, period_us);
    governor_pace(&self->governor, period_us, cycle_us);
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
        on->first_q32 = within_speed(self, axis, lead(self, axis));
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

/* Steps that so many periods go: full steps, then the way of the quickest stop, whose second half is its first reversed. */
static int64_t way_q16(const stream_lead_t *on, int64_t periods)
{
    const int64_t full_q16 = on->full_q16;
    const int64_t stop_q16 = 2 * (on->reach_q16 - full_q16);
    const int64_t time_q16 = periods * Q16_ONE - full_q16;
    if (time_q16 <= 0 || time_q16 >= stop_q16) {
        return time_q16 <= 0 ? periods * Q16_ONE : on->reach_q16;
    }
    const q32_t time_q32 = fx_mul_div(time_q16, Q32_ONE, stop_q16);
    const q32_t travel_q32 = time_q32 <= Q32_ONE / 2 ? time_q32 - lost_q32(time_q32, on->rise_q32)
                                                     : Q32_ONE / 2 - lost_q32(Q32_ONE - time_q32, on->rise_q32);
    return full_q16 + fx_mul_shift(travel_q32, stop_q16, 32);
}

/* The point so many periods beyond the newest sample: the motion goes on, ever more slowly. */
HV_WRAPS static void guess(stream_curve_t *self, int32_t periods)
{
    q32_t *const point_q32 = self->point_q32[slot(newest(self) + (uint32_t)periods)];
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const stream_lead_t *on = &self->lead[axis];
        const int64_t first_q16 = way_q16(on, 1);
        point_q32[axis] = self->last_q32[axis] + fx_mul_shift(on->first_q32, first_q16, 16) +
                          fx_mul_shift(on->go_q32, way_q16(on, periods) - first_q16, 16);
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

/* The newest sample gets the index that is so far ahead of head, and so do those before it. */
HV_WRAPS static void relabel(stream_curve_t *self, int32_t ahead)
{
    const uint32_t was = newest(self);
    self->ahead = ahead;
    for (uint32_t back = 0; back < STREAM_POINTS - AHEAD_MAX; back++) {
        copy_point(self, self->point_q32[slot(newest(self) - back)], self->point_q32[slot(was - back)]);
    }
}

/* Makes up for what has changed since the last control point. A sample that is far behind head still is no late one of a burst:
 * its sender is so much later now. */
static void make_up(stream_curve_t *self)
{
    if (self->change == 0) {
        return;
    }
    if (self->ahead < -BEHIND_MAX) {
        relabel(self, -BEHIND_MAX);
    }
    if (self->ahead < 0) {
        guess_again(self);
    }
    if (self->change == 1) {
        take_back_half(self);
    } else {
        keep_going(self);
    }
    self->change = 0;
    soften_to_limits(self);
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

HV_WRAPS void stream_curve_append(stream_curve_t *self, unsigned periods, bool is_of_stall, const q32_t *sample_q32,
                                  const q32_t *point_q32)
{
    q32_t before_q32[AXES_MAX];
    if (self->ahead < 0) {
        note_change(self, -self->ahead);
    }
    const int32_t furthest = is_of_stall ? -AHEAD_MAX : -BEHIND_MAX - (int32_t)periods;
    if (self->ahead < furthest) {
        relabel(self, furthest);
    }
    copy_point(self, before_q32, self->last_q32);
    stream_quantum_watch(self, periods, sample_q32);
    copy_point(self, self->last_q32, point_q32);
    copy_point(self, self->newest_q32, sample_q32);
    const int32_t ahead = self->ahead + (int32_t)periods;
    const int32_t kept = ahead < AHEAD_MAX ? ahead : AHEAD_MAX;
    for (int32_t i = self->ahead > 0 ? self->ahead + 1 : 1; i < kept; i++) {
        self->is_sample[slot(self->head + (uint32_t)i)] = false;
    }
    self->ahead = kept;
    self->age += self->age < AGE_MAX ? 1 : 0;
    copy_point(self, self->point_q32[slot(newest(self))], self->last_q32);
    self->is_sample[slot(newest(self))] = true;
    fill_gap(self, (int32_t)periods, before_q32);
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
    points_at_head(self, self->was_q32);
    self->change = STALL_GUESSES - 1;
    copy_point(self, self->last_q32, self->newest_q32);
    for (int32_t back = 0; back < self->patience && back < STREAM_POINTS; back++) {
        copy_point(self, self->point_q32[slot(self->head - (uint32_t)back)], self->last_q32);
    }
    for (unsigned axis = 0; axis < self->axes; axis++) {
        self->lead[axis] = (stream_lead_t){.rise_q32 = 0};
    }
    keep_going(self);
    soften_to_limits(self);
    self->change = 0;
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
    if (self->ahead < 2) {
        return;
    }
    note_change(self, SHIFT_GUESSES);
    find_next(self);
    self->head++;
    self->ahead--;
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

/* What a curve through these axes would need, and less of it where that is more than there is. */
static void govern(stream_curve_t *self, const kin_t *kin, q32_t asked_q32[AXES_MAX])
{
    q32_t channel_q32[GOVERNOR_CHANNELS];
    if (!find_channels(self, kin, asked_q32, channel_q32)) {
        for (unsigned i = POSE_AXES; i < GOVERNOR_CHANNELS; i++) {
            channel_q32[i] = self->governor.level_q32[0][i]; /* there is no such pose: the axes alone tell */
        }
    }
    governor_step(&self->governor, channel_q32, self->scale_q16, channel_q32);
    for (unsigned axis = 0; axis < POSE_AXES && axis < self->governor.channels; axis++) {
        asked_q32[axis] = channel_q32[axis];
    }
}

/* The point at head becomes the last control point, with what the curve is still off it. */
static void put_control(stream_curve_t *self, const kin_t *kin)
{
    q32_t control_q32[AXES_MAX];
    self->is_off = false;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        take_back(self, self->off_q32[axis]);
        control_q32[axis] = led_point(self, axis, self->head) + self->off_q32[axis][0];
        self->is_off |= self->off_q32[axis][0] != 0 || self->off_q32[axis][1] != 0;
    }
    govern(self, kin, control_q32);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t before_q32 =
            self->control_q32[axis] + fx_shift_down(self->way_q36[0][axis] + self->way_q36[1][axis], WAY_SHIFT);
        self->way_q36[2][axis] = way_between(before_q32, control_q32[axis]);
    }
}

HV_WRAPS void stream_curve_commit(stream_curve_t *self, const kin_t *kin)
{
    make_up(self);
    find_next(self);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        self->control_q32[axis] += fx_shift_down(self->way_q36[0][axis], WAY_SHIFT);
        self->way_q36[0][axis] = self->way_q36[1][axis];
        self->way_q36[1][axis] = self->way_q36[2][axis];
    }
    self->head++;
    self->ahead--;
    put_control(self, kin);
}

/* Control points of a curve that is here, moving so, at the beginning of a segment, where three count:
 * p = (c0 + 4 c1 + c2) / 6, p' = (c2 - c0) / 2, p'' = c0 - 2 c1 + c2. */
static void control_from(q32_t pos_q32, q32_t vel_q32, q32_t acc_q32, q32_t control_q32[3])
{
    const q32_t middle_q32 = pos_q32 - acc_q32 / 6;
    control_q32[0] = middle_q32 - vel_q32 + acc_q32 / 2;
    control_q32[1] = middle_q32;
    control_q32[2] = middle_q32 + vel_q32 + acc_q32 / 2;
}

/* How fast the curve may leave a way that may have been a jump: the softer it comes back, the further it swings out by that. At
 * 60 Hz a sixteenth of the way in a period. */
static q32_t jump_speed(const stream_curve_t *self, q32_t off_q32)
{
    return fx_mul_shift(fx_abs(off_q32), fx_clamp(self->grip_q32 * 5 / 16, 0, Q32_ONE / 16), 32);
}

/* Points up to a sample, as many periods after the last one, at even steps. Before that one they go on so, or, where a stream
 * begins, they are where it began. */
HV_WRAPS static void place_points(stream_curve_t *self, const q32_t *first_q32, unsigned periods, const q32_t *sample_q32)
{
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t travel_q32 = sample_q32[axis] - self->last_q32[axis];
        const q32_t step_q32 = (int32_t)periods > self->patience ? 0 : travel_q32 / (int32_t)periods;
        for (int32_t back = 0; back < STREAM_POINTS - AHEAD_MAX; back++) {
            const bool is_before = first_q32 != NULL && back > (int32_t)periods;
            self->point_q32[slot(self->head - (uint32_t)back)][axis] =
                is_before ? first_q32[axis] : sample_q32[axis] - back * step_q32;
        }
    }
}

/* The curve goes on as it is: from where it was asked to be, and how quickly that moved. */
HV_WRAPS static void place_off(stream_curve_t *self, unsigned axis, q32_t asked_q32, q32_t step_q32)
{
    q32_t *const off_q32 = self->off_q32[axis];
    const q32_t point_step_q32 = led_point(self, axis, self->head) - led_point(self, axis, self->head - 1);
    off_q32[0] = asked_q32 - led_point(self, axis, self->head - 1);
    const q32_t most_q32 = fx_abs(step_q32) + jump_speed(self, off_q32[0]);
    off_q32[1] = within_speed(self, axis, fx_clamp(step_q32 - point_step_q32, -most_q32, most_q32));
    off_q32[2] = 0;
}

HV_WRAPS void stream_curve_regrid(stream_curve_t *self, const kin_t *kin, const history_t *now, const q32_t *first_q32,
                                  unsigned periods, const q32_t *sample_q32)
{
    const bool goes_on = first_q32 == NULL;
    const int64_t n_q16 = self->period_cycles_q16;
    q32_t placed_q32[3][AXES_MAX];
    q32_t asked_q32[AXES_MAX];
    self->ahead = 0;
    self->age = goes_on ? self->age : now == NULL ? AGE_MAX : 1;
    self->change = 0;
    self->is_off = false; /* what it was off was per period of the old grid, and so was the grip */
    (void)soften(self, SHIFT_GUESSES);
    place_points(self, now != NULL ? first_q32 : NULL, periods, sample_q32);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        q32_t control_q32[3];
        for (uint32_t i = 0; i < 3; i++) {
            control_q32[i] = led_point(self, axis, self->head - 3 + i);
        }
        if (now != NULL) {
            const q32_t acc_q32 = fx_mul_shift(fx_mul_shift(now[axis].acc_per_cycle2_q32, n_q16, 16), n_q16, 16);
            const q32_t vel_q32 = fx_mul_shift(now[axis].vel_per_cycle_q32 + now[axis].acc_per_cycle2_q32 / 2, n_q16, 16);
            control_from(now[axis].pos_q32, vel_q32, acc_q32, control_q32);
        }
        const bool is_governed = goes_on && axis < POSE_AXES && axis < self->governor.channels;
        asked_q32[axis] = control_q32[2] + (is_governed ? governor_lag(&self->governor, axis) : 0);
        place_off(self, axis, asked_q32[axis], (control_q32[2] - control_q32[0]) / 2);
        self->control_q32[axis] = control_q32[0];
        self->way_q36[0][axis] = way_between(control_q32[0], control_q32[1]);
        self->way_q36[1][axis] = way_between(control_q32[1], control_q32[2]);
        for (unsigned i = 0; i < 3; i++) {
            placed_q32[i][axis] = control_q32[i];
        }
    }
    soften_to_limits(self);
    copy_point(self, self->last_q32, sample_q32);
    copy_point(self, self->newest_q32, sample_q32);
    if (goes_on) {
        shift_governor(self, kin, asked_q32);
    } else {
        place_governor(self, kin, now == NULL, placed_q32);
    }
    put_control(self, kin);
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

/* Q60: sums up to 5 occur. */
void stream_curve_weigh(q32_t between_q32, int64_t weight_q60[3])
{
    const int64_t one = Q62_ONE / 4;
    const int64_t u = between_q32 * (one / Q32_ONE);
    const int64_t u2 = (int64_t)(((uint64_t)between_q32 * (uint64_t)between_q32 + 8) / 16); /* Q64, rounded to Q60 */
    const int64_t u3 = fx_mul_shift_fit(u2, u, 60);
    weight_q60[0] = sixth(5 * one + 3 * (u - u2) + u3);
    weight_q60[1] = sixth(one + 3 * (u + u2) - 2 * u3);
    weight_q60[2] = sixth(u3);
}

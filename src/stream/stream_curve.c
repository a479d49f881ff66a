/* SPDX-License-Identifier: MIT
 * stream_curve.c - the curve through the samples of a stream.
 * It is evaluated as oldest control point + differences x cumulative weights: equal points give exactly that point, and the
 * curve stays within its control points. These are the points themselves, or (balanced) points led ahead of them, so that the
 * curve is less late. If a sample is missing and a later one has arrived, its point is interpolated. Otherwise it is guessed:
 * the motion of the last samples continues for a while, fades out, and waits. When the missing samples arrive, or others do,
 * the curve has an offset from the points that are then known. A triple-pole filter takes this offset back, so that position
 * and velocity of the control points stay continuous.
 */
#include "stream_curve.h"

#include "stream_control.h"
#include "stream_extrapolation.h"
#include "stream_offset.h"
#include "stream_points.h"
#include "stream_quantum.h"

enum {
    AGE_MAX = STREAM_CURVE_AGE_MAX,
    AHEAD_MAX = STREAM_CURVE_AHEAD_MAX,
    SHIFT_GUESSES = 4, /* after a shift of the time line, the offset is taken back as softly as after this many guesses */
    BEHIND_MAX = 4     /* points before head that corrections and guesses use */

};

#define REACH_MIN_US  50000  /* a motion is kept up for that long, ... */
#define REACH_FEW_US  62000  /* ... or for that long where ... */
#define FEW_PERIODS   3      /* ... as much is needed to find it moving still after such a pause; ... */
#define LOSSY_PERIODS 4      /* ... where samples are often lost, after that many; ... */
#define REACH_LED_US  12000  /* ... and so much longer for control points that are led, which turn to the stop earlier; ... */
#define REACH_MAX_US  100000 /* ... and longer only as far as the axis takes to stop: so long at most */
#define OFF_US        80000
#define PATIENCE_US   300000
#define WAY_SHIFT     4 /* from Q32 to Q36 */

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

/* Tells the governor that the last set of axes asked for was this one. */
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
        self->extrapolation[axis] = (stream_extrapolation_t){0};
        self->quantum[axis] = (stream_quantum_t){0};
        self->low_q32[axis] = self->high_q32[axis] = sample_q32[axis];
    }
    self->watched = 0;
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

/* Call it before points at head change. Several changes, as in a burst, are corrected together, once. */
static void note_change(stream_curve_t *self, int32_t guessed)
{
    if (self->change == 0) {
        stream_control_at_head(self, self->was_q32);
    }
    self->change = guessed > self->change ? guessed : self->change;
}

/* Takes back half of the error of a single guess at once, as far as the limits allow. Such an error is one of position only. */
static void remove_half(stream_curve_t *self)
{
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t error_q32 = self->was_q32[0][axis] - stream_control_point(self, axis, self->head);
        const q32_t most_q32 = stream_offset_jump(self, axis);
        self->off_q32[axis][0] += error_q32 - fx_clamp(error_q32 / 2, -most_q32, most_q32);
    }
    (void)stream_offset_soften(self, 0);
}

/* Sets the offset of the curve from its new points, and the change of the offset, so that the curve continues as it was. The
 * change is measured over two periods, because the first of them may hold the error of a single guess. */
static void keep_going(stream_curve_t *self)
{
    q32_t is_q32[3][AXES_MAX];
    const q32_t share_q32 = stream_offset_soften(self, self->change);
    stream_control_at_head(self, is_q32);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t here_q32 = self->was_q32[0][axis] - is_q32[0][axis];
        const q32_t most_q32 = 4 * fx_abs(self->extrapolation[axis].first_q32) + fx_abs(here_q32) / 16;
        const q32_t change_q32 = fx_clamp((here_q32 - (self->was_q32[2][axis] - is_q32[2][axis])) / 2, -most_q32, most_q32);
        self->off_q32[axis][0] += here_q32;
        self->off_q32[axis][1] =
            stream_extrapolation_within_speed(self, axis, self->off_q32[axis][1] + fx_mul_shift(change_q32, share_q32, 32));
    }
}

/* Changes the length of the running mean. The same samples then have other control points, and the curve moves to them softly.
 * A window that is one too long is kept, so that the length does not change to and fro with the period. */
static void set_window(stream_curve_t *self, int32_t window)
{
    if (window == self->window || (window > 1 && window + 1 == self->window)) {
        return;
    }
    note_change(self, SHIFT_GUESSES);
    stream_control_set_window(self, window);
}

void stream_curve_pace(stream_curve_t *self, stream_style_t style, uint32_t period_us, uint32_t cycle_us, bool is_lossy)
{
    const int64_t led_us = style == STREAM_BALANCED ? fx_mul_shift(period_us, STREAM_CURVE_LED_Q32, 32) : 0;
    const int64_t few_max_us = REACH_FEW_US + (led_us < REACH_LED_US ? led_us : REACH_LED_US);
    const int64_t few_us = fx_clamp(FEW_PERIODS * period_us + led_us, REACH_MIN_US, few_max_us);
    const int64_t reach_us = is_lossy ? fx_clamp(LOSSY_PERIODS * period_us, few_us, REACH_MAX_US) : few_us;
    self->lead_q32 = style == STREAM_BALANCED ? STREAM_CURVE_LED_Q32 : 0;
    self->period_cycles_q16 = (int64_t)period_us * Q16_ONE / cycle_us;
    self->reach_min_q16 = (int32_t)(reach_us * Q16_ONE / period_us);
    self->reach_max_q16 = (int32_t)((int64_t)REACH_MAX_US * Q16_ONE / period_us);
    self->softest_q32 = fx_clamp((int64_t)period_us * Q32_ONE / OFF_US, Q32_ONE / 32, Q32_ONE / 2);
    self->patience = (int32_t)(PATIENCE_US / period_us) + 3;
    stream_control_set_mean(self, period_us);
    governor_pace(&self->governor, period_us, cycle_us);
    set_window(self, stream_control_window(self));
}

/* Guesses the committed points after the newest sample again. */
static void guess_again(stream_curve_t *self)
{
    stream_extrapolation_begin(self);
    for (int32_t periods = 1; periods <= -self->ahead; periods++) {
        stream_extrapolation_point(self, periods);
    }
}

/* Moves the newest sample to the index `ahead` of head, and the samples before it by the same number. */
HV_WRAPS static void relabel(stream_curve_t *self, int32_t ahead)
{
    const uint32_t was = stream_points_newest(self);
    self->ahead = ahead;
    for (uint32_t back = 0; back < STREAM_POINTS - AHEAD_MAX; back++) {
        copy_point(self, self->point_q32[stream_points_place(stream_points_newest(self) - back)],
                   self->point_q32[stream_points_place(was - back)]);
    }
}

/* Corrects for the changes since the last control point. If the newest sample is still far behind head, it is not a late sample
 * of a burst: the sender itself has become later by this much. */
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
        remove_half(self);
    } else {
        keep_going(self);
    }
    self->change = 0;
    stream_offset_soften_to_limits(self);
}

/* The point after last. One missing point lies on the parabola through before, last and next. Several missing points lie on the
 * straight line, because a parabola could overshoot. */
static q32_t point_between(q32_t before_q32, q32_t last_q32, q32_t next_q32, int32_t periods)
{
    return periods == 2 ? last_q32 + (next_q32 - before_q32) / 3 : last_q32 + (next_q32 - last_q32) / periods;
}

/* Interpolates the points between the newest sample and the sample before it, which is `periods` older. What is found here for
 * those that are not committed yet is improved then. */
HV_WRAPS static void fill_gap(stream_curve_t *self, int32_t periods, const q32_t *before_q32)
{
    const q32_t *const two_before_q32 = self->point_q32[stream_points_place(stream_points_newest(self) - 3)];
    for (int32_t back = 1; back < periods && back < self->ahead + BEHIND_MAX; back++) {
        q32_t *const point_q32 = self->point_q32[stream_points_place(stream_points_newest(self) - (uint32_t)back)];
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
    if (self->ahead < 0 || (self->ahead == 0 && periods == 0)) {
        note_change(self, self->ahead < 0 ? -self->ahead : 1);
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
        self->is_sample[stream_points_place(self->head + (uint32_t)i)] = false;
    }
    self->ahead = kept;
    self->age += self->age < AGE_MAX ? 1 : 0;
    copy_point(self, self->point_q32[stream_points_place(stream_points_newest(self))], self->last_q32);
    self->is_sample[stream_points_place(stream_points_newest(self))] = true;
    fill_gap(self, (int32_t)periods, before_q32);
}

/* Points between the last committed point and the next sample. */
HV_WRAPS static void interpolate(stream_curve_t *self, q32_t *point_q32)
{
    int32_t periods = 2;
    while (!self->is_sample[stream_points_place(self->head + (uint32_t)periods)]) {
        periods++;
    }
    const q32_t *const next = self->point_q32[stream_points_place(self->head + (uint32_t)periods)];
    const q32_t *const last = self->point_q32[stream_points_place(self->head)];
    const q32_t *const before = self->point_q32[stream_points_place(self->head - 1)];
    for (unsigned axis = 0; axis < self->axes; axis++) {
        point_q32[axis] = point_between(before[axis], last[axis], next[axis], periods);
    }
}

/* No sample has come for so long that none is expected. The curve returns to the last sample, as if it had been repeated. */
HV_WRAPS static void give_up(stream_curve_t *self)
{
    stream_control_at_head(self, self->was_q32);
    self->change = STREAM_OFFSET_STALL - 1;
    copy_point(self, self->last_q32, self->newest_q32);
    for (int32_t back = 0; back < self->patience && back < STREAM_POINTS; back++) {
        copy_point(self, self->point_q32[stream_points_place(self->head - (uint32_t)back)], self->last_q32);
    }
    for (unsigned axis = 0; axis < self->axes; axis++) {
        self->extrapolation[axis] = (stream_extrapolation_t){0};
    }
    keep_going(self);
    stream_offset_soften_to_limits(self);
    self->change = 0;
}

/* Settles the point after head. */
HV_WRAPS static void find_next(stream_curve_t *self)
{
    if (self->ahead > 0) {
        if (!self->is_sample[stream_points_place(self->head + 1)]) {
            interpolate(self, self->point_q32[stream_points_place(self->head + 1)]);
        }
        return;
    }
    if (self->ahead == 0) {
        stream_extrapolation_begin(self);
    } else if (-self->ahead == self->patience) {
        give_up(self);
    }
    stream_extrapolation_point(self, 1 - self->ahead);
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

/* Distance between two control points, which are far below 2^58. */
static int64_t way_between(q32_t from_q32, q32_t to_q32)
{
    return (to_q32 - from_q32) * ((int64_t)1 << WAY_SHIFT);
}

/* Asks the governor for these axes. It reduces what exceeds the limits. */
static void govern(stream_curve_t *self, const kin_t *kin, q32_t asked_q32[AXES_MAX])
{
    q32_t channel_q32[GOVERNOR_CHANNELS];
    if (!find_channels(self, kin, asked_q32, channel_q32)) {
        for (unsigned i = POSE_AXES; i < GOVERNOR_CHANNELS; i++) {
            channel_q32[i] = self->governor.asked_q32[i]; /* there is no such pose: only the axes count */
        }
    }
    governor_step(&self->governor, channel_q32, self->scale_q16, channel_q32);
    for (unsigned axis = 0; axis < POSE_AXES && axis < self->governor.channels; axis++) {
        asked_q32[axis] = channel_q32[axis];
    }
}

/* Makes the point at head, plus the remaining offset of the curve, the last control point. */
static void put_control(stream_curve_t *self, const kin_t *kin)
{
    q32_t control_q32[AXES_MAX];
    self->is_off = false;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t point_q32 = stream_control_point(self, axis, self->head);
        stream_offset_decay(self, self->off_q32[axis]);
        stream_offset_bound(self, axis, point_q32);
        control_q32[axis] = point_q32 + self->off_q32[axis][0];
        stream_offset_widen(self, axis, point_q32);
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

/* Control points of a curve with this position, velocity and acceleration at the begin of a segment, where three count:
 * p = (c0 + 4 c1 + c2) / 6, p' = (c2 - c0) / 2, p'' = c0 - 2 c1 + c2. */
static void control_from(q32_t pos_q32, q32_t vel_q32, q32_t acc_q32, q32_t control_q32[3])
{
    const q32_t middle_q32 = pos_q32 - acc_q32 / 6;
    control_q32[0] = middle_q32 - vel_q32 + acc_q32 / 2;
    control_q32[1] = middle_q32;
    control_q32[2] = middle_q32 + vel_q32 + acc_q32 / 2;
}

/* Largest speed of an offset that may come from a jump. The softer the filter, the further this speed makes the curve
 * overshoot. At 60 Hz it is a sixteenth of the offset per period. */
static q32_t jump_speed(const stream_curve_t *self, q32_t off_q32)
{
    return fx_mul_shift(fx_abs(off_q32), fx_clamp(self->bandwidth_q32 * 5 / 16, 0, Q32_ONE / 16), 32);
}

/* Of two steps, the one that both tell of a motion: the smaller one, or none where they go to and fro. */
static q32_t common_step(q32_t a_q32, q32_t b_q32)
{
    const q32_t smaller_q32 = fx_abs(a_q32) < fx_abs(b_q32) ? a_q32 : b_q32;
    return (a_q32 < 0) == (b_q32 < 0) ? smaller_q32 : 0;
}

/* Places points in even steps up to a sample that is `periods` after the last one. Points before the last one continue these
 * steps; at the begin of a stream that is seen they lie where it began. One that is not seen yet may be moving already, but no
 * faster than the axis may, and as its first three samples agree on. */
HV_WRAPS static void place_points(stream_curve_t *self, const q32_t *first_q32, bool is_seen, unsigned periods,
                                  const q32_t *sample_q32)
{
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t travel_q32 = sample_q32[axis] - self->last_q32[axis];
        q32_t step_q32 = (int32_t)periods > self->patience ? 0 : travel_q32 / (int32_t)periods;
        if (!is_seen) {
            step_q32 =
                stream_extrapolation_within_speed(self, axis, common_step(step_q32, self->last_q32[axis] - first_q32[axis]));
        }
        for (int32_t back = 0; back < STREAM_POINTS - AHEAD_MAX; back++) {
            const bool is_before = first_q32 != NULL && is_seen && back > (int32_t)periods;
            self->point_q32[stream_points_place(self->head - (uint32_t)back)][axis] =
                is_before ? first_q32[axis] : sample_q32[axis] - back * step_q32;
        }
    }
}

/* The curve continues from the last requested position, at the velocity of the request. */
HV_WRAPS static void place_off(stream_curve_t *self, unsigned axis, q32_t asked_q32, q32_t step_q32)
{
    q32_t *const off_q32 = self->off_q32[axis];
    const q32_t point_step_q32 = stream_control_point(self, axis, self->head) - stream_control_point(self, axis, self->head - 1);
    off_q32[0] = asked_q32 - stream_control_point(self, axis, self->head - 1);
    const q32_t most_q32 = fx_abs(step_q32) + jump_speed(self, off_q32[0]);
    off_q32[1] = stream_extrapolation_within_speed(self, axis, fx_clamp(step_q32 - point_step_q32, -most_q32, most_q32));
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
    self->is_off = false; /* offset and bandwidth were per period of the old grid */
    (void)stream_offset_soften(self, SHIFT_GUESSES);
    place_points(self, first_q32, now != NULL, periods, sample_q32);
    for (unsigned axis = 0; axis < self->axes; axis++) {
        q32_t control_q32[3];
        for (uint32_t i = 0; i < 3; i++) {
            control_q32[i] = stream_control_point(self, axis, self->head - 3 + i);
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
        const q32_t room_q32 = 8 * fx_abs(control_q32[2] - control_q32[0]); /* until such a motion has stopped */
        self->low_q32[axis] = goes_on ? self->low_q32[axis] : asked_q32[axis] - room_q32;
        self->high_q32[axis] = goes_on ? self->high_q32[axis] : asked_q32[axis] + room_q32;
        for (unsigned i = 0; i < 3; i++) {
            placed_q32[i][axis] = control_q32[i];
        }
    }
    stream_offset_soften_to_limits(self);
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

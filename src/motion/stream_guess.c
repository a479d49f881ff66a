/* SPDX-License-Identifier: MIT
 * stream_guess.c - points of a stream's curve where samples are missing; see stream_guess.h.
 */
#include "stream_guess.h"

#include "stream_curve.h"
#include "stream_points.h"

#define FITTED_Q32 (Q32_ONE * 1024)  /* as far from the newest point, and no further, the sums are exact */
#define SWING_Q32  (Q32_ONE * 5 / 2) /* (2 pi f)^2 in the time of the points that are fitted: 2.5 Hz in 0.1 s */

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

q32_t stream_guess_within_speed(const stream_curve_t *self, unsigned axis, q32_t step_q32)
{
    const governor_limits_t *limits = &self->limits[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t most_q32 = fx_mul_shift(limits->vel_per_cycle_q32, n_q16, 16);
    const q32_t gained_q32 = fx_mul_shift(fx_mul_shift(limits->acc_per_cycle2_q32, n_q16, 16), n_q16, 16) * self->age;
    const q32_t least_q32 = most_q32 < gained_q32 ? most_q32 : gained_q32;
    return limits->jerk_per_cycle3_q32 > 0 ? fx_clamp(step_q32, -least_q32, least_q32) : step_q32;
}

/* Where the motion of the last samples goes in one period. A jump is not taken for a motion: one just made would go on (hence at
 * most 4 x the larger of the two steps before), one made before would be undone (hence the bend, where it turned, at most the
 * step). */
HV_WRAPS static q32_t lead(const stream_curve_t *self, unsigned axis)
{
    const uint32_t last = stream_points_newest(self);
    q32_t step[3];
    for (uint32_t i = 0; i < 3; i++) {
        step[i] = self->point_q32[stream_points_slot(last - i)][axis] - self->point_q32[stream_points_slot(last - i - 1)][axis];
    }
    const q32_t bend = step[0] - step[1];
    const bool has_turned = (bend > 0) != (step[1] - step[2] > 0);
    const q32_t bend_max = has_turned ? fx_abs(step[0]) : fx_abs(bend);
    const q32_t before = fx_abs(step[1]) > fx_abs(step[2]) ? fx_abs(step[1]) : fx_abs(step[2]);
    return fx_clamp(step[0] + fx_clamp(bend, -bend_max, bend_max), -4 * before, 4 * before);
}

/** Sums over points and their second differences, as far as a line through them takes. Products are Q32 as well. */
typedef struct {
    int64_t y, d, yy, yd, dd;
    int64_t up_q32, down_q32; /**< ways to either side */
} fit_sums_t;

HV_WRAPS static fit_sums_t sum_up(const stream_curve_t *self, unsigned axis)
{
    fit_sums_t sums = {0};
    const uint32_t last = stream_points_newest(self);
    const q32_t from_q32 = self->point_q32[stream_points_slot(last)][axis];
    for (uint32_t back = 1; back <= self->fitted; back++) {
        const q32_t here_q32 = self->point_q32[stream_points_slot(last - back)][axis];
        const q32_t after_q32 = self->point_q32[stream_points_slot(last - back + 1)][axis];
        const q32_t before_q32 = self->point_q32[stream_points_slot(last - back - 1)][axis];
        const q32_t y = fx_clamp(here_q32 - from_q32, -FITTED_Q32, FITTED_Q32);
        const q32_t d = fx_clamp((after_q32 - here_q32) - (here_q32 - before_q32), -FITTED_Q32, FITTED_Q32);
        const q32_t step_q32 = fx_clamp(here_q32 - before_q32, -FITTED_Q32, FITTED_Q32);
        sums.up_q32 += step_q32 > 0 ? step_q32 : 0;
        sums.down_q32 -= step_q32 < 0 ? step_q32 : 0;
        sums.y += y;
        sums.d += d;
        sums.yy += fx_mul_shift(y, y, 32);
        sums.yd += fx_mul_shift(y, d, 32);
        sums.dd += fx_mul_shift(d, d, 32);
    }
    const int64_t n = self->fitted;
    sums.yy -= fx_mul_shift(sums.y, sums.y, 32) / n;
    sums.yd -= fx_mul_shift(sums.y, sums.d, 32) / n;
    sums.dd -= fx_mul_shift(sums.d, sums.d, 32) / n;
    return sums;
}

/* A motion to and fro about a middle m turns back by k (m - x) in each period: the line through its second differences over its
 * values, by least squares. It counts where it tells most of what the differences do, and where the motion has turned. A motion
 * that goes on straight, or whose differences are the noise of arrivals, is none. */
static void find_swing(const stream_curve_t *self, unsigned axis, stream_lead_t *on)
{
    const fit_sums_t sums = sum_up(self, axis);
    const int64_t n = self->fitted;
    on->pull_q32 = 0;
    on->bend_q32 = 0;
    const int64_t less_q32 = sums.up_q32 < sums.down_q32 ? sums.up_q32 : sums.down_q32;
    const int64_t more_q32 = sums.up_q32 < sums.down_q32 ? sums.down_q32 : sums.up_q32;
    if (sums.yy <= 0 || sums.yd >= 0 || less_q32 < more_q32 / 2) {
        return;
    }
    const int64_t pull_q32 = fx_clamp(fx_mul_div(-sums.yd, Q32_ONE, sums.yy), 0, STREAM_CURVE_PULL_MAX_Q32);
    const bool is_quick =
        pull_q32 * n * n >= SWING_Q32; /* slower ones turn once in a while: their differences are mostly noise */
    if (is_quick && fx_mul_shift(-sums.yd, pull_q32, 32) >= sums.dd / 4 * 3) {
        on->pull_q32 = pull_q32;
        on->bend_q32 = sums.d / n + fx_mul_shift(sums.y / n, pull_q32, 32);
    }
}

HV_WRAPS void stream_guess_begin(stream_curve_t *self)
{
    for (unsigned axis = 0; axis < self->axes; axis++) {
        stream_lead_t *on = &self->lead[axis];
        const q32_t step_q32 =
            fx_abs(self->last_q32[axis] - self->point_q32[stream_points_slot(stream_points_newest(self) - 1)][axis]);
        on->first_q32 = stream_guess_within_speed(self, axis, lead(self, axis));
        on->go_q32 = fx_clamp(on->first_q32, -step_q32, step_q32);
        find_swing(self, axis, on);
        if (on->pull_q32 != 0) {
            const q32_t newest_step_q32 =
                self->last_q32[axis] - self->point_q32[stream_points_slot(stream_points_newest(self) - 1)][axis];
            on->go_q32 = stream_guess_within_speed(self, axis, newest_step_q32);
        }
        find_reach(self, axis, fx_abs(on->go_q32), on);
    }
}

/* How far a motion to and fro gets in that time, if it gets no faster. */
static q32_t swing_q32(const stream_lead_t *on, int64_t time_q16)
{
    const q32_t most_q32 = fx_abs(on->go_q32);
    q32_t way_q32 = 0;
    q32_t step_q32 = on->go_q32;
    for (; time_q16 > 0; time_q16 -= Q16_ONE) {
        step_q32 += on->bend_q32 - fx_mul_shift(way_q32, on->pull_q32, 32);
        step_q32 = fx_clamp(step_q32, -most_q32, most_q32);
        way_q32 += time_q16 >= Q16_ONE ? step_q32 : fx_mul_shift(step_q32, time_q16, 16);
    }
    return way_q32;
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
HV_WRAPS void stream_guess_point(stream_curve_t *self, int32_t periods)
{
    q32_t *const point_q32 = self->point_q32[stream_points_slot(stream_points_newest(self) + (uint32_t)periods)];
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const stream_lead_t *on = &self->lead[axis];
        const int64_t first_q16 = way_q16(on, 1);
        if (on->pull_q32 != 0) {
            point_q32[axis] = self->last_q32[axis] + swing_q32(on, way_q16(on, periods));
            continue;
        }
        point_q32[axis] = self->last_q32[axis] + fx_mul_shift(on->first_q32, first_q16, 16) +
                          fx_mul_shift(on->go_q32, way_q16(on, periods) - first_q16, 16);
    }
}

/* SPDX-License-Identifier: MIT
 * stream_extrapolation.c - points of a stream's curve where samples are missing; see stream_extrapolation.h.
 */
#include "stream_extrapolation.h"

#include "stream_curve.h"
#include "stream_points.h"
#include "stream_predictor.h"

enum {
    LARGEST_OF = 12, /* newest steps, which bound those that are guessed */
    FEW = 8          /* samples of a stream that tell no more of its motion than its newest two steps do */
};

/* Periods that a motion may be kept up so that it does not go further than the axis takes to stop: of v = step / period, the time
 * is sqrt(v / J), or half of v / A + A / J where the acceleration binds. Also the share of such a stop in which A builds up. */
static void find_reach(const stream_curve_t *self, unsigned axis, q32_t step_q32, stream_extrapolation_t *on)
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

q32_t stream_extrapolation_within_speed(const stream_curve_t *self, unsigned axis, q32_t step_q32)
{
    const governor_limits_t *limits = &self->limits[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t most_q32 = fx_mul_shift(limits->vel_per_cycle_q32, n_q16, 16);
    const q32_t gained_q32 = fx_mul_shift(fx_mul_shift(limits->acc_per_cycle2_q32, n_q16, 16), n_q16, 16) * self->age;
    const q32_t least_q32 = most_q32 < gained_q32 ? most_q32 : gained_q32;
    return limits->jerk_per_cycle3_q32 > 0 ? fx_clamp(step_q32, -least_q32, least_q32) : step_q32;
}

/* How large a step after the newest ones may be: twice the second largest of them. The largest may be a jump, which is no motion
 * that goes on. Of a stream that has just begun, not larger than the newest two, and none where these go to and fro. */
static q32_t largest_step(const stream_curve_t *self, unsigned axis, const q32_t step_q32[LARGEST_OF])
{
    if (self->age < FEW) {
        const bool is_one_way = (step_q32[0] < 0) == (step_q32[1] < 0);
        const q32_t smaller_q32 = fx_abs(step_q32[0]) < fx_abs(step_q32[1]) ? fx_abs(step_q32[0]) : fx_abs(step_q32[1]);
        return stream_extrapolation_within_speed(self, axis, is_one_way ? smaller_q32 : 0);
    }
    q32_t largest_q32 = 0;
    q32_t second_q32 = 0;
    for (unsigned i = 0; i < LARGEST_OF; i++) {
        const q32_t size_q32 = fx_abs(step_q32[i]);
        const q32_t smaller_q32 = size_q32 < largest_q32 ? size_q32 : largest_q32;
        second_q32 = smaller_q32 > second_q32 ? smaller_q32 : second_q32;
        largest_q32 = size_q32 > largest_q32 ? size_q32 : largest_q32;
    }
    return stream_extrapolation_within_speed(self, axis, 2 * second_q32);
}

/* The next step of the motion. */
static q32_t next_step(const stream_curve_t *self, const stream_extrapolation_t *on)
{
    return fx_clamp(stream_predictor_next(&self->predictor, on->step_q32, on->before_q32), -on->most_q32, on->most_q32);
}

HV_WRAPS void stream_extrapolation_begin(stream_curve_t *self)
{
    const uint32_t newest = stream_points_newest(self);
    self->predictor = stream_predictor_fit(self, (stream_predictor_t){.by_newest_q32 = Q32_ONE}); /* even */
    for (unsigned axis = 0; axis < self->axes; axis++) {
        stream_extrapolation_t *on = &self->extrapolation[axis];
        q32_t step_q32[LARGEST_OF];
        for (uint32_t i = 0; i < LARGEST_OF; i++) {
            step_q32[i] = self->point_q32[stream_points_place(newest - i)][axis] -
                          self->point_q32[stream_points_place(newest - i - 1)][axis];
        }
        on->step_q32 = step_q32[0];
        on->before_q32 = step_q32[1];
        on->most_q32 = largest_step(self, axis, step_q32);
        on->first_q32 = next_step(self, on);
        find_reach(self, axis, stream_extrapolation_within_speed(self, axis, fx_abs(step_q32[0])), on);
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
static int64_t way_q16(const stream_extrapolation_t *on, int64_t periods)
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

/* The motion goes on, ever more slowly. */
HV_WRAPS void stream_extrapolation_point(stream_curve_t *self, int32_t periods)
{
    const uint32_t index = stream_points_newest(self) + (uint32_t)periods;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        stream_extrapolation_t *on = &self->extrapolation[axis];
        const q32_t step_q32 = next_step(self, on);
        const int64_t share_q16 = way_q16(on, periods) - way_q16(on, periods - 1);
        self->point_q32[stream_points_place(index)][axis] =
            self->point_q32[stream_points_place(index - 1)][axis] + fx_mul_shift(step_q32, share_q16, 16);
        on->before_q32 = on->step_q32;
        on->step_q32 = step_q32;
    }
}

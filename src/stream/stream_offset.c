/* SPDX-License-Identifier: MIT */
#include "stream_offset.h"

#include "stream_points.h"

enum {
    ROOM_SHARE = 16, /* of the range: so much further may a correction lead */
    NARROW = 4       /* times as long as the curve's patience */
};

#define OFF_NOTHING (Q32_ONE / 2000) /* 0.5 um: what is less is given up */

q32_t stream_offset_jump(const stream_curve_t *self, unsigned axis)
{
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t jerk_q32 = self->limits[axis].jerk_per_cycle3_q32;
    return jerk_q32 > 0 ? fx_mul_shift(fx_mul_shift(fx_mul_shift(jerk_q32, n_q16, 16), n_q16, 16), n_q16, 16) / 8 : INT64_MAX;
}

/* Whether what is off comes back with less than half of what an axis can do: with three poles at 1 - g a distance d needs g^2 d
 * of acceleration and g^3 d of jerk at most, a speed e 3 g e and 3 g^2 e. */
static bool is_bearable(const stream_curve_t *self, unsigned axis, int64_t bandwidth_q32)
{
    const governor_limits_t *limits = &self->limits[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    if (limits->jerk_per_cycle3_q32 <= 0) {
        return true;
    }
    const q32_t acc_q32 = fx_mul_shift(fx_mul_shift(limits->acc_per_cycle2_q32, n_q16, 16), n_q16, 16);
    const q32_t jerk_q32 = fx_mul_shift(fx_mul_shift(fx_mul_shift(limits->jerk_per_cycle3_q32, n_q16, 16), n_q16, 16), n_q16, 16);
    const q32_t by_way_q32 = fx_mul_shift(fx_abs(self->off_q32[axis][0]), bandwidth_q32, 32);
    const q32_t by_speed_q32 = 3 * fx_abs(self->off_q32[axis][1]);
    const q32_t needs_acc_q32 = fx_mul_shift(by_way_q32 + by_speed_q32, bandwidth_q32, 32);
    const q32_t needs_jerk_q32 = fx_mul_shift(needs_acc_q32, bandwidth_q32, 32);
    return 2 * needs_acc_q32 <= acc_q32 && 2 * needs_jerk_q32 <= jerk_q32;
}

void stream_offset_soften_to_limits(stream_curve_t *self)
{
    for (unsigned axis = 0; axis < self->axes && axis < POSE_AXES; axis++) {
        while (self->bandwidth_q32 > self->softest_q32 && !is_bearable(self, axis, self->bandwidth_q32)) {
            self->bandwidth_q32 -= self->bandwidth_q32 / 8;
        }
    }
}

q32_t stream_offset_soften(stream_curve_t *self, int32_t guessed)
{
    const int64_t softest_q32 = guessed >= STREAM_OFFSET_STALL ? self->softest_q32 / 5 * 4 : self->softest_q32;
    const int64_t wished_q32 = fx_clamp(Q32_ONE / (guessed + 2), softest_q32, Q32_ONE / 2);
    self->bandwidth_q32 = self->is_off && self->bandwidth_q32 < wished_q32 ? self->bandwidth_q32 : wished_q32;
    self->is_off = true;
    return fx_mul_div(self->bandwidth_q32, Q32_ONE, wished_q32);
}

void stream_offset_decay(const stream_curve_t *self, q32_t off_q32[3])
{
    if (((uint64_t)off_q32[0] | (uint64_t)off_q32[1] | (uint64_t)off_q32[2]) == 0) {
        return;
    }
    const int64_t g = self->bandwidth_q32;
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

static void widen(stream_curve_t *self, unsigned axis, q32_t here_q32)
{
    self->low_q32[axis] = here_q32 < self->low_q32[axis] ? here_q32 : self->low_q32[axis];
    self->high_q32[axis] = here_q32 > self->high_q32[axis] ? here_q32 : self->high_q32[axis];
}

/* A share of the way, and all of it where little is left, so that it ends. */
static q32_t narrow(q32_t from_q32, q32_t to_q32, int32_t share)
{
    const q32_t way_q32 = to_q32 - from_q32;
    return fx_abs(way_q32) < OFF_NOTHING ? to_q32 : from_q32 + way_q32 / share;
}

void stream_offset_bound(stream_curve_t *self, unsigned axis, q32_t point_q32)
{
    q32_t *const off_q32 = self->off_q32[axis];
    const q32_t room_q32 = (self->high_q32[axis] - self->low_q32[axis]) / ROOM_SHARE;
    const q32_t most_q32 = room_q32 + (self->high_q32[axis] > point_q32 ? self->high_q32[axis] - point_q32 : 0);
    const q32_t least_q32 = -room_q32 + (self->low_q32[axis] < point_q32 ? self->low_q32[axis] - point_q32 : 0);
    if (off_q32[0] > most_q32 || off_q32[0] < least_q32) {
        off_q32[0] = fx_clamp(off_q32[0], least_q32, most_q32);
        off_q32[1] = (off_q32[1] > 0) == (off_q32[0] > 0) ? 0 : off_q32[1];
        off_q32[2] = 0;
    }
}

void stream_offset_widen(stream_curve_t *self, unsigned axis, q32_t point_q32)
{
    const q32_t head_q32 = self->point_q32[stream_points_place(self->head)][axis];
    self->low_q32[axis] = narrow(self->low_q32[axis], head_q32, self->patience * NARROW);
    self->high_q32[axis] = narrow(self->high_q32[axis], head_q32, self->patience * NARROW);
    widen(self, axis, head_q32);
    widen(self, axis, point_q32);
}

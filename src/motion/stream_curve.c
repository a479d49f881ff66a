/* SPDX-License-Identifier: MIT
 * stream_curve.c - the curve through the samples of a stream.
 * Evaluated as oldest control point + differences x cumulative weights: equal points give exactly that point, and the curve stays
 * within its control points. Where a sample is missing and a later one is here, the point is interpolated; else the motion is
 * extrapolated once, goes as far again, and returns to the last sample in a soft S: right for one loss, bounded for an end.
 */
#include "stream_curve.h"

enum {
    AHEAD_MAX = 8, /* samples kept that are not committed; their guesses look at most 3 further back */
    LEADS = 11     /* guesses until the curve is back on the last sample */
};

/* The guesses beyond the last sample, in 1/256 of the first: 1, 2, then 2 x a quintic S over 9 points. */
static const int16_t k_lead_256[LEADS] = {256, 512, 506, 473, 405, 309, 203, 107, 39, 6, 0};

/* Where the ring has an index; indices wrap. */
static unsigned slot(uint32_t index)
{
    return index % STREAM_POINTS;
}

/* Index of the newest sample. */
static uint32_t newest(const stream_curve_t *self)
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
    *self = (stream_curve_t){.axes = axes};
    copy_point(self, self->last_q32, sample_q32);
    for (unsigned i = 0; i < STREAM_POINTS; i++) {
        copy_point(self, self->point_q32[i], sample_q32);
    }
    for (unsigned i = 0; i < 4; i++) {
        copy_point(self, self->control_q32[i], sample_q32);
    }
}

/* Keeps the newest sample as the point of its index, unless a newer index has taken the place in the ring. */
static void put_newest(stream_curve_t *self)
{
    if (self->ahead > -LEADS) {
        copy_point(self, self->point_q32[slot(newest(self))], self->last_q32);
        self->is_sample[slot(newest(self))] = true;
    }
}

/* The point after last: of one that is missing on the parabola through before, last, and next; of more on the straight line, as
 * a parabola could swing out. */
static q32_t point_between(q32_t before_q32, q32_t last_q32, q32_t next_q32, int32_t periods)
{
    return periods == 2 ? last_q32 + (next_q32 - before_q32) / 3 : last_q32 + (next_q32 - last_q32) / periods;
}

/* Replaces what was guessed since the sample before, now that the newest is known: guesses made from guesses would swing up.
 * The curve keeps them. */
static void correct_guesses(stream_curve_t *self, int32_t periods, const q32_t *before_q32)
{
    const int32_t in_ring = self->ahead + LEADS;
    const q32_t *const two_before_q32 = self->point_q32[slot(newest(self) - 3)];
    for (int32_t back = self->ahead > 1 ? self->ahead : 1; back < periods && back < in_ring; back++) {
        q32_t *const point_q32 = self->point_q32[slot(newest(self) - (uint32_t)back)];
        for (unsigned axis = 0; axis < self->axes; axis++) {
            const q32_t way = self->last_q32[axis] - before_q32[axis];
            point_q32[axis] = periods == 2 ? point_between(two_before_q32[axis], before_q32[axis], self->last_q32[axis], 2)
                                           : self->last_q32[axis] - way / periods * back;
        }
    }
}

void stream_curve_append(stream_curve_t *self, unsigned periods, const q32_t *sample_q32)
{
    q32_t before_q32[AXES_MAX];
    copy_point(self, before_q32, self->last_q32);
    copy_point(self, self->last_q32, sample_q32);
    unsigned added = 0;
    for (; added < periods && self->ahead < AHEAD_MAX; added++) {
        self->ahead++;
        self->is_sample[slot(newest(self))] = false;
    }
    put_newest(self);
    correct_guesses(self, (int32_t)added, before_q32);
}

bool stream_curve_is_newest(const stream_curve_t *self, const q32_t *sample_q32)
{
    unsigned axis = 0;
    while (axis < self->axes && self->last_q32[axis] == sample_q32[axis]) {
        axis++;
    }
    return axis == self->axes;
}

void stream_curve_skip(stream_curve_t *self)
{
    if (self->ahead < 2) {
        return;
    }
    for (uint32_t index = self->head + 1; index != newest(self); index++) {
        copy_point(self, self->point_q32[slot(index)], self->point_q32[slot(index + 1)]);
        self->is_sample[slot(index)] = self->is_sample[slot(index + 1)];
    }
    self->ahead--;
}

void stream_curve_stretch(stream_curve_t *self)
{
    if (self->ahead < AHEAD_MAX) {
        self->is_sample[slot(newest(self))] = false;
        self->ahead++;
        put_newest(self);
    }
}

/* Where the motion of the last samples goes in one period. A jump is not taken for a motion: one just made would go on (hence at
 * most 4 x the larger of the two steps before), one made before would be undone (hence the bend, where it turned, at most the
 * step). */
static q32_t lead(const stream_curve_t *self, unsigned axis)
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

static void extrapolate(stream_curve_t *self, q32_t *point_q32)
{
    const int32_t periods = 1 - self->ahead;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t beyond = periods <= LEADS ? lead(self, axis) * k_lead_256[periods - 1] / 256 : 0;
        point_q32[axis] = self->last_q32[axis] + beyond;
    }
}

/* Between the last points committed and the next sample. */
static void interpolate(stream_curve_t *self, q32_t *point_q32)
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

void stream_curve_commit(stream_curve_t *self)
{
    q32_t *const point_q32 = self->point_q32[slot(self->head + 1)];
    if (self->ahead <= 0) {
        extrapolate(self, point_q32);
    } else if (!self->is_sample[slot(self->head + 1)]) {
        interpolate(self, point_q32);
    }
    for (unsigned i = 0; i < 3; i++) {
        copy_point(self, self->control_q32[i], self->control_q32[i + 1]);
    }
    copy_point(self, self->control_q32[3], point_q32);
    self->head++;
    self->ahead--;
}

bool stream_curve_is_at_rest(const stream_curve_t *self)
{
    return self->ahead <= -(LEADS + 3);
}

/* Weights of the differences between the last control points, each from 0 to 1 in time. Q60: sums up to 5 occur. */
static unsigned weigh(stream_style_t style, q32_t between_q32, int64_t *weight_q60)
{
    const int64_t one = Q62_ONE / 4;
    const int64_t u = between_q32 * (one / Q32_ONE);
    const int64_t u2 = fx_mul_shift(u, u, 60);
    if (style == STREAM_FAST) {
        weight_q60[0] = (one + 2 * u - u2) / 2;
        weight_q60[1] = u2 / 2;
        return 2;
    }
    const int64_t u3 = fx_mul_shift(u2, u, 60);
    weight_q60[0] = (5 * one + 3 * (u - u2) + u3) / 6;
    weight_q60[1] = (one + 3 * (u + u2) - 2 * u3) / 6;
    weight_q60[2] = u3 / 6;
    return 3;
}

void stream_curve_at(const stream_curve_t *self, stream_style_t style, q32_t between_q32, q32_t *pos_q32)
{
    int64_t weight_q60[3];
    const unsigned degree = weigh(style, between_q32, weight_q60);
    const q32_t(*const control)[AXES_MAX] = &self->control_q32[3 - degree];
    for (unsigned axis = 0; axis < self->axes; axis++) {
        pos_q32[axis] = control[0][axis];
        for (unsigned i = 0; i < degree; i++) {
            pos_q32[axis] += fx_mul_shift(control[i + 1][axis] - control[i][axis], weight_q60[i], 60);
        }
    }
}

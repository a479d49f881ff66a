/* SPDX-License-Identifier: MIT
 * stream_evidence.c - to which time a sender's samples belong; see stream_evidence.h.
 * A sample in the middle of five is told from its four neighbours, by the cubic through them: with even times it is off by r. If
 * the samples belong to their arrivals, r is p = speed x (its lateness less what its neighbours' latenesses tell). The share of
 * p in r over the last samples, sum(r p) / sum(p p), is near 0 or near 1 for nearly every sender. It counts where p explains r.
 */
#include "stream_evidence.h"

#include "stream_predictor.h"

#define MEMORY_SHIFT 5                /* 2^6 samples */
#define LEAST_Q32    (Q32_ONE / 4096) /* sum(p p) that tells anything: 1/64 of the way of a period at the speed limit */
#define EVEN_Q32     (Q32_ONE / 5)    /* below that share values are even, ... */
/* ... above that one they belong to their arrivals, between as before. The network's part of the lateness lowers the share. */
#define ARRIVED_Q32   (Q32_ONE * 2 / 5)
#define EXPLAINED_DIV 5              /* what arrivals explain less of than that share has other causes */
#define SHIFT_FADE    16             /* samples in which a shift of the line fades to 1/e, as the line follows */
#define CHANGE_Q32    (Q32_ONE / 32) /* of the weight in a sample */
#define LATE_MAX_Q32  Q32_ONE
#define SPEED_MAX_Q32 (16 * Q32_ONE) /* steps beyond so many speed limits count as that */
#define NEAR_Q32      (Q32_ONE / 4)  /* samples that came closer to each other tell no speed */

enum {
    MIDDLE = STREAM_EVIDENCE / 2,
    LED_MAX = 6 /* periods that a motion is led on: after more, a value does not tell how many */
};

void stream_evidence_reset(stream_evidence_t *self, bool keep_weight)
{
    self->count = 0;
    self->shift_q32[0] = 0;
    self->by_lateness_q32 = 0;
    self->moved_q32 = 0;
    self->off_q32 = 0;
    self->weight_q32 = keep_weight ? self->weight_q32 : 0;
}

/* The middle one of five less what the cubic through its neighbours makes of it. */
static q32_t off_neighbours(const q32_t value[STREAM_EVIDENCE])
{
    return value[2] - (4 * (value[1] + value[3]) - value[0] - value[4]) / 6;
}

static bool is_even_run(const stream_evidence_t *self)
{
    unsigned i = 1;
    while (i < STREAM_EVIDENCE && self->index[i] == (int32_t)i) {
        i++;
    }
    return self->count == STREAM_EVIDENCE && i == STREAM_EVIDENCE;
}

/* Speeds in shares of the speed limit, so that degrees and millimetres can be added. */
static void weigh(stream_evidence_t *self, const governor_t *governor, unsigned axes)
{
    const q32_t late_q32 = off_neighbours(self->late_q32);
    int64_t by_lateness_q32 = 0;
    int64_t moved_q32 = 0;
    int64_t all_off_q32 = 0;
    for (unsigned axis = 0; axis < axes && axis < POSE_AXES; axis++) {
        q32_t value_q32[STREAM_EVIDENCE];
        for (unsigned i = 0; i < STREAM_EVIDENCE; i++) {
            value_q32[i] = self->value_q32[i][axis];
        }
        const int64_t per_speed_q62 = governor->per_limit_q62[axis][0];
        const q32_t step_q32 = fx_mul_shift((value_q32[MIDDLE - 1] - value_q32[MIDDLE + 1]) / 2, per_speed_q62, 30);
        const q32_t off_q32 = fx_mul_shift(off_neighbours(value_q32), per_speed_q62, 30);
        const q32_t moved = fx_mul_shift(fx_clamp(step_q32, -SPEED_MAX_Q32, SPEED_MAX_Q32), late_q32, 32);
        const q32_t off = fx_clamp(off_q32, -SPEED_MAX_Q32, SPEED_MAX_Q32);
        by_lateness_q32 += fx_mul_shift(off, moved, 32);
        all_off_q32 += fx_mul_shift(off, off, 32);
        moved_q32 += fx_mul_shift(moved, moved, 32);
    }
    self->by_lateness_q32 += by_lateness_q32 - fx_shift_down(self->by_lateness_q32, MEMORY_SHIFT);
    self->moved_q32 += moved_q32 - fx_shift_down(self->moved_q32, MEMORY_SHIFT);
    self->off_q32 += all_off_q32 - fx_shift_down(self->off_q32, MEMORY_SHIFT);
}

static void change_weight(stream_evidence_t *self)
{
    if (self->moved_q32 < LEAST_Q32 / 64) {
        return;
    }
    const q32_t share_q32 = fx_mul_div(self->by_lateness_q32, Q32_ONE, self->moved_q32);
    const q32_t explained_q32 = fx_mul_div(self->by_lateness_q32, share_q32, Q32_ONE); /* of what the values are off */
    if (explained_q32 < self->off_q32 / EXPLAINED_DIV) {
        self->weight_q32 = fx_clamp(0, self->weight_q32 - CHANGE_Q32, self->weight_q32);
        return;
    }
    const q32_t wished_q32 = share_q32 > ARRIVED_Q32 ? Q32_ONE : share_q32 < EVEN_Q32 ? 0 : self->weight_q32;
    self->weight_q32 = fx_clamp(wished_q32, self->weight_q32 - CHANGE_Q32, self->weight_q32 + CHANGE_Q32);
}

void stream_evidence_add(stream_evidence_t *self, const governor_t *governor, unsigned axes, unsigned periods, q32_t late_q32,
                         q32_t shift_q32, bool is_coarse, const q32_t *sample_q32)
{
    for (unsigned i = STREAM_EVIDENCE - 1; i > 0 && (periods > 0 || self->count == 0); i--) {
        for (unsigned axis = 0; axis < axes; axis++) {
            self->value_q32[i][axis] = self->value_q32[i - 1][axis];
        }
        self->late_q32[i] = self->late_q32[i - 1];
        self->shift_q32[i] = self->shift_q32[i - 1];
        self->index[i] = self->index[i - 1] + (int32_t)periods;
    }
    for (unsigned axis = 0; axis < axes; axis++) {
        self->value_q32[0][axis] = sample_q32[axis];
    }
    self->late_q32[0] = fx_clamp(late_q32, -LATE_MAX_Q32, LATE_MAX_Q32);
    self->index[0] = 0;
    self->shift_q32[0] = fx_clamp(self->shift_q32[0] - self->shift_q32[0] / SHIFT_FADE + shift_q32, -LATE_MAX_Q32, LATE_MAX_Q32);
    self->axes = axes;
    self->count += self->count < STREAM_EVIDENCE && (periods > 0 || self->count == 0) ? 1u : 0u;
    if (is_even_run(self) && !is_coarse) {
        weigh(self, governor, axes);
        change_weight(self);
    }
}

/* Time of a sample, in periods after the place of the newest one on the line. */
static q32_t time_of(const stream_evidence_t *self, unsigned i)
{
    const q32_t by_line_q32 = self->shift_q32[i] - self->index[i] * Q32_ONE;
    const q32_t by_arrival_q32 = self->late_q32[i] - self->index[i] * Q32_ONE;
    return by_line_q32 + fx_mul_shift(by_arrival_q32 - by_line_q32, self->weight_q32, 32);
}

static q32_t at_least_near(q32_t span_q32)
{
    return span_q32 > NEAR_Q32 ? span_q32 : NEAR_Q32;
}

/* Newton's parabola through three samples at their times: the newest, the one before, and the one two before that, as what the
 * network adds to the times bends a longer parabola less. It moves a sample no further than they are apart: arrivals in a burst
 * tell no speed. */
q32_t stream_evidence_on_line(const stream_evidence_t *self, unsigned axis)
{
    const q32_t here_q32 = self->value_q32[0][axis];
    if (time_of(self, 0) == 0 || self->count < 4) {
        return here_q32;
    }
    const q32_t t0 = time_of(self, 0);
    const q32_t h1 = at_least_near(t0 - time_of(self, 1));
    const q32_t h2 = at_least_near(time_of(self, 1) - time_of(self, 3));
    const q32_t way1 = here_q32 - self->value_q32[1][axis];
    const q32_t way2 = self->value_q32[1][axis] - self->value_q32[3][axis];
    const q32_t slope1 = fx_mul_div(way1, Q32_ONE, h1);
    const q32_t slope2 = fx_mul_div(way2, Q32_ONE, h2);
    const q32_t bend = fx_mul_div(slope1 - slope2, Q32_ONE, h1 + h2);
    const q32_t most_q32 = fx_abs(way1) + fx_abs(way2);
    return here_q32 - fx_clamp(fx_mul_shift(t0, slope1 + fx_mul_shift(bend, h1 - t0, 32), 32), -most_q32, most_q32);
}

/* Where the motion of the newest three samples leads in so many periods, from the newest one. */
static q32_t way_in(const stream_evidence_t *self, const stream_predictor_t *predictor, unsigned axis, unsigned periods)
{
    const int32_t h1 = self->index[1] > 0 ? self->index[1] : 1;
    const int32_t h2 = self->index[2] > self->index[1] ? self->index[2] - self->index[1] : 1;
    q32_t step_q32 = (self->value_q32[0][axis] - self->value_q32[1][axis]) / h1;
    q32_t before_q32 = (self->value_q32[1][axis] - self->value_q32[2][axis]) / h2;
    q32_t way_q32 = 0;
    for (unsigned i = 0; i < periods && i < LED_MAX; i++) {
        const q32_t next_q32 = stream_predictor_next(predictor, step_q32, before_q32);
        before_q32 = step_q32;
        step_q32 = next_q32;
        way_q32 += next_q32;
    }
    return way_q32;
}

q32_t stream_evidence_in_speed_limits(const governor_t *governor, unsigned axis, q32_t travel_q32)
{
    return fx_clamp(fx_mul_shift(fx_abs(travel_q32), governor->per_limit_q62[axis][0], 30), 0, 256 * Q32_ONE);
}

q32_t stream_evidence_misfit(const stream_evidence_t *self, const governor_t *governor, const stream_predictor_t *predictor,
                             unsigned periods, const q32_t *sample_q32)
{
    q32_t sum_q32 = 0;
    for (unsigned axis = 0; axis < self->axes && axis < POSE_AXES; axis++) {
        const q32_t travel_q32 = sample_q32[axis] - self->value_q32[0][axis];
        sum_q32 += stream_evidence_in_speed_limits(governor, axis, travel_q32 - way_in(self, predictor, axis, periods));
    }
    return sum_q32;
}

q32_t stream_evidence_apart(const stream_evidence_t *self, const governor_t *governor, const stream_predictor_t *predictor,
                            unsigned a, unsigned b)
{
    q32_t sum_q32 = 0;
    for (unsigned axis = 0; axis < self->axes && axis < POSE_AXES; axis++) {
        sum_q32 +=
            stream_evidence_in_speed_limits(governor, axis, way_in(self, predictor, axis, a) - way_in(self, predictor, axis, b));
    }
    return sum_q32;
}

/* True if two of the samples, or one of them and another, are equal in all axes. */
static bool is_equal(const q32_t *a_q32, const q32_t *b_q32, unsigned axes)
{
    unsigned axis = 0;
    while (axis < axes && a_q32[axis] == b_q32[axis]) {
        axis++;
    }
    return axis == axes;
}

bool stream_evidence_is_newest(const stream_evidence_t *self, unsigned axes, const q32_t *sample_q32)
{
    return is_equal(self->value_q32[0], sample_q32, axes);
}

q32_t stream_evidence_advance(const stream_evidence_t *self, const governor_t *governor, const q32_t *sample_q32)
{
    int64_t along_q32 = 0;
    int64_t square_q32 = 0;
    unsigned at = 1; /* the newest sample before those that are equal to the newest */
    while (at < self->count && is_equal(self->value_q32[at], self->value_q32[0], self->axes)) {
        at++;
    }
    if (at >= self->count || self->index[at] <= self->index[at - 1]) {
        return 0;
    }
    for (unsigned axis = 0; axis < POSE_AXES && axis < self->axes; axis++) {
        const int64_t per_speed_q62 = governor->per_limit_q62[axis][0];
        const q32_t step_q32 = fx_mul_shift(
            (self->value_q32[0][axis] - self->value_q32[at][axis]) / (self->index[at] - self->index[at - 1]), per_speed_q62, 30);
        const q32_t travel_q32 = fx_mul_shift(sample_q32[axis] - self->value_q32[0][axis], per_speed_q62, 30);
        const q32_t by_lateness_q32 = fx_clamp(step_q32, -SPEED_MAX_Q32, SPEED_MAX_Q32);
        along_q32 += fx_mul_shift(by_lateness_q32, fx_clamp(travel_q32, -SPEED_MAX_Q32, SPEED_MAX_Q32), 32);
        square_q32 += fx_mul_shift(by_lateness_q32, by_lateness_q32, 32);
    }
    return square_q32 > 0 ? fx_mul_div(along_q32, Q32_ONE, square_q32) : 0;
}

q32_t stream_evidence_rounding(const stream_evidence_t *self, const stream_curve_t *curve)
{
    q32_t sum_q32 = 0;
    for (unsigned axis = 0; axis < self->axes && axis < POSE_AXES; axis++) {
        sum_q32 += stream_evidence_in_speed_limits(&curve->governor, axis, curve->quantum[axis].quantum_q32);
    }
    return sum_q32;
}

bool stream_evidence_is_beyond_noise(const stream_evidence_t *self, q32_t misfit_q32)
{
    return fx_mul_shift(misfit_q32, misfit_q32, 32) > fx_shift_down(self->off_q32, MEMORY_SHIFT);
}

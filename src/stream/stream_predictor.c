/* SPDX-License-Identifier: MIT
 * stream_predictor.c - see stream_predictor.h.
 * The normal equations are solved in integers: steps are scaled so that the largest has 28 bits, sums so that they have 30.
 */
#include "stream_predictor.h"

#include "stream_points.h"

enum {
    STEPS = 12,      /* newest steps that the coefficients are fitted to, ... */
    STEPS_MIN = 8,   /* ... if the stream has so many */
    STEP_BITS = 28,  /* of the largest step */
    SUM_BITS = 30,   /* of the largest sum: products of two of them fit into 64 bits */
    RIDGE_SHIFT = 15 /* such a share is added to the squares, towards an even motion: steps of one direction determine no more */
};

/** Sums of products of a step with the two before it. */
typedef struct {
    int64_t newest2, newest_before, before2; /* squares and product of the two */
    int64_t by_newest, by_before;            /* the step times each of them */
} sums_t;

/* Steps in shares of the speed limits, so that degrees and millimetres can be added; the newest first.
 * @return the bits of all sizes together: as many as the largest has */
HV_WRAPS static uint64_t find_steps(const stream_curve_t *curve, unsigned axes, q32_t step_q32[POSE_AXES][STEPS])
{
    const uint32_t newest = stream_points_newest(curve);
    uint64_t bits = 0;
    for (unsigned axis = 0; axis < axes; axis++) {
        const int64_t per_speed_q62 = curve->governor.per_limit_q62[axis][0];
        for (uint32_t i = 0; i < STEPS; i++) {
            const q32_t step = curve->point_q32[stream_points_place(newest - i)][axis] -
                               curve->point_q32[stream_points_place(newest - i - 1)][axis];
            step_q32[axis][i] = per_speed_q62 > 0 ? fx_mul_shift(step, per_speed_q62, 30) : step;
            bits |= (uint64_t)fx_abs(step_q32[axis][i]);
        }
    }
    return bits;
}

/* The number of bits beyond so many. */
static unsigned bits_beyond(uint64_t value, unsigned bits)
{
    unsigned beyond = 0;
    while ((value >> beyond) >> bits != 0) {
        beyond++;
    }
    return beyond;
}

static sums_t sum_up(q32_t step_q32[POSE_AXES][STEPS], unsigned axes, unsigned steps, uint64_t bits)
{
    sums_t sums = {0};
    const unsigned down = bits_beyond(bits, STEP_BITS);
    for (unsigned axis = 0; axis < axes; axis++) {
        for (unsigned i = 0; i + 2 < steps; i++) {
            const int64_t here = fx_shift_down(step_q32[axis][i], down);
            const int64_t newest = fx_shift_down(step_q32[axis][i + 1], down);
            const int64_t before = fx_shift_down(step_q32[axis][i + 2], down);
            sums.newest2 += newest * newest;
            sums.newest_before += newest * before;
            sums.before2 += before * before;
            sums.by_newest += here * newest;
            sums.by_before += here * before;
        }
    }
    return sums;
}

HV_OWN_FRAME stream_predictor_t stream_predictor_fit(const stream_curve_t *curve, stream_predictor_t when_few)
{
    q32_t step_q32[POSE_AXES][STEPS];
    const unsigned axes = curve->axes < POSE_AXES ? curve->axes : POSE_AXES;
    const uint64_t bits = find_steps(curve, axes, step_q32);
    const unsigned steps = curve->age < STEPS ? (unsigned)curve->age : STEPS;
    if (steps < STEPS_MIN) {
        return when_few;
    }
    const sums_t sums = sum_up(step_q32, axes, steps, bits);
    const uint64_t squares = (uint64_t)sums.newest2 | (uint64_t)sums.before2;
    const uint64_t products = (uint64_t)fx_abs(sums.by_newest) | (uint64_t)fx_abs(sums.by_before);
    const unsigned down = bits_beyond(squares | products, SUM_BITS - 1);
    const int64_t ridge = fx_shift_down(sums.newest2 + sums.before2, down + RIDGE_SHIFT) + 1;
    const int64_t newest2 = fx_shift_down(sums.newest2, down) + ridge;
    const int64_t before2 = fx_shift_down(sums.before2, down) + ridge;
    const int64_t both = fx_shift_down(sums.newest_before, down);
    const int64_t by_newest = fx_shift_down(sums.by_newest, down) + ridge;
    const int64_t by_before = fx_shift_down(sums.by_before, down);
    const int64_t determinant = newest2 * before2 - both * both;
    return (stream_predictor_t){
        .by_newest_q32 =
            fx_clamp(fx_mul_div(by_newest * before2 - by_before * both, Q32_ONE, determinant), -Q32_ONE, 2 * Q32_ONE),
        .by_before_q32 = fx_clamp(fx_mul_div(by_before * newest2 - by_newest * both, Q32_ONE, determinant), -Q32_ONE, Q32_ONE)};
}

/* SPDX-License-Identifier: MIT
 * kin_forward.c - the forward solution: from cylinder extensions to the pose, by Newton's method.
 *
 * There is no closed form. Each step solves J dp = error for the unknown axes p (six, or roll, pitch and z). The error is exact,
 * from the same arithmetic as the inverse solution; J only steers and is good to about 1e-7. With q the turned arm of a leg, u
 * its direction and w the axis that the plate turns about when an angle changes (roll: first column of R; pitch: Y turned by
 * yaw; yaw: Z), the row of a leg is w . (q x u) for an angle and a coordinate of u for a translation. These are the true rates
 * of roll, pitch and yaw, which is what makes convergence quadratic. On a 3-RPS roll and pitch also turn the yaw, by
 *     d yaw / d roll = sin(pitch) / (1 + cos p cos r),   d yaw / d pitch = sin(roll) / (1 + cos p cos r),
 * and slide the plate. Angles are solved as arc lengths at a radius of 2^reach_shift mm, so all elements are near 1.
 *
 * A step from an error below 0.5 um ends at rounding level, so it is the last and needs no check. No solution is found where
 * the cylinders cannot reach each other (no convergence) or do not hold the plate (singular).
 */
#include "kin_internal.h"

#define ERROR_LAST_STEP_Q32 INT64_C(2147484)   /* 0.5 um */
#define LENGTH_MIN_Q44      (INT64_C(1) << 44) /* a leg shorter than 1 mm has no direction to speak of */
#define LENGTH_MAX_Q32      (INT64_C(65536) * Q32_ONE)

/* The unknown axes, in the order of the columns of J. */
static const uint8_t k_free_axes[] = {AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_X, AXIS_Y, AXIS_Z};
static const uint8_t k_tripod_axes[] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z};

/* What a change of roll and of pitch does: the plate turns about an axis and slides (mm per rad, over 2^reach_shift). */
typedef struct {
    int64_t turn_q28[2][3];
    int64_t slide_q28[2][3];
} rates_t;

/* a . b in Q28, for |a| |b| < 64. */
static int64_t dot_q28(const int64_t a_q28[3], const int64_t b_q28[3])
{
    return fx_shift_down(a_q28[0] * b_q28[0] + a_q28[1] * b_q28[1] + a_q28[2] * b_q28[2], 28);
}

/* a x b in Q28, for |a| |b| < 64. */
static void cross_q28(const int64_t a[3], const int64_t b[3], int64_t result[3])
{
    result[0] = fx_shift_down(a[1] * b[2] - a[2] * b[1], 28);
    result[1] = fx_shift_down(a[2] * b[0] - a[0] * b[2], 28);
    result[2] = fx_shift_down(a[0] * b[1] - a[1] * b[0], 28);
}

/* A column of the rotation. */
static void rotation_column(const kin_placement_t *at, unsigned column, int64_t result_q28[3])
{
    for (unsigned row = 0; row < 3; row++) {
        result_q28[row] = fx_shift_down(at->rotation_q62[row][column], 34);
    }
}

/* The slide of a 3-RPS that goes with a turn: the rate of x = r (R11 - R22) / 2, y = -r R21 and of the turned offset. */
static void set_hinged_slide(const kin_t *self, const kin_placement_t *at, const int64_t turn_q28[3], int64_t slide_q28[3])
{
    int64_t first[3], second[3], offset[3] = {0, 0, 0}, first_rate[3], second_rate[3], offset_rate[3];
    rotation_column(at, 0, first);
    rotation_column(at, 1, second);
    for (unsigned axis = 0; axis < 3; axis++) {
        for (unsigned i = 0; i < 3; i++) {
            const int64_t turned_q44 = fx_mul_high(at->rotation_q62[axis][i], self->hinge_offset_mm_q46[i]);
            offset[axis] += fx_shift_down(turned_q44, 16u + self->reach_shift);
        }
    }
    cross_q28(turn_q28, first, first_rate);
    cross_q28(turn_q28, second, second_rate);
    cross_q28(turn_q28, offset, offset_rate);
    const int64_t radius_q28 = fx_shift_down(self->hinge_radius_mm_q46, 18u + self->reach_shift);
    slide_q28[0] = offset_rate[0] + fx_shift_down(radius_q28 * (first_rate[0] - second_rate[1]), 29);
    slide_q28[1] = offset_rate[1] - fx_shift_down(radius_q28 * first_rate[1], 28);
    slide_q28[2] = 0;
}

/* Adds to the turns of roll and pitch what the hinges make of them. */
static void add_hinged_rates(const kin_t *self, const kin_placement_t *at, rates_t *rates)
{
    const q62_t *sine = at->sine_q62, *cosine = at->cosine_q62;
    const int64_t divisor_q28 = (INT64_C(1) << 28) + fx_shift_down(fx_mul_high(cosine[AXIS_PITCH], cosine[AXIS_ROLL]), 32);
    rates->turn_q28[AXIS_ROLL][2] += fx_shift_down(sine[AXIS_PITCH], 6) / divisor_q28;
    rates->turn_q28[AXIS_PITCH][2] += fx_shift_down(sine[AXIS_ROLL], 6) / divisor_q28;
    set_hinged_slide(self, at, rates->turn_q28[AXIS_ROLL], rates->slide_q28[AXIS_ROLL]);
    set_hinged_slide(self, at, rates->turn_q28[AXIS_PITCH], rates->slide_q28[AXIS_PITCH]);
}

static void set_rates(const kin_t *self, const kin_placement_t *at, rates_t *rates)
{
    *rates = (rates_t){{{0}}, {{0}}};
    rotation_column(at, 0, rates->turn_q28[AXIS_ROLL]);
    rates->turn_q28[AXIS_PITCH][0] = -fx_shift_down(at->sine_q62[AXIS_YAW], 34);
    rates->turn_q28[AXIS_PITCH][1] = fx_shift_down(at->cosine_q62[AXIS_YAW], 34);
    if (self->kind == KIN_TRIPOD_3RPS) {
        add_hinged_rates(self, at, rates);
    }
}

/* The row of J of one leg, of at least LENGTH_MIN: the angles, then the translations. */
static void set_row(const kin_t *self, const rates_t *rates, const kin_leg_t *leg, int64_t row_q28[])
{
    const int64_t inverse_q48 = (INT64_C(1) << 62) / fx_shift_down(leg->length_mm_q44, 30);
    int64_t direction_q28[3], arm_q28[3], moment_q28[3];
    for (unsigned axis = 0; axis < 3; axis++) {
        direction_q28[axis] = fx_mul_high(leg->vector_mm_q44[axis], inverse_q48);
        arm_q28[axis] = fx_shift_down(leg->arm_mm_q44[axis], 16u + self->reach_shift);
    }
    cross_q28(arm_q28, direction_q28, moment_q28);
    row_q28[0] = dot_q28(rates->turn_q28[AXIS_ROLL], moment_q28);
    row_q28[1] = dot_q28(rates->turn_q28[AXIS_PITCH], moment_q28);
    switch (self->kind) {
    case KIN_HEXAPOD:
        row_q28[2] = moment_q28[2];
        row_q28[3] = direction_q28[0];
        row_q28[4] = direction_q28[1];
        row_q28[5] = direction_q28[2];
        break;
    case KIN_TRIPOD:
        row_q28[2] = direction_q28[2];
        break;
    case KIN_TRIPOD_3RPS:
        row_q28[0] += dot_q28(rates->slide_q28[AXIS_ROLL], direction_q28);
        row_q28[1] += dot_q28(rates->slide_q28[AXIS_PITCH], direction_q28);
        row_q28[2] = direction_q28[2];
        break;
    }
}

/* J and the errors of the lengths at a pose. */
static hv_status_t linearise(const kin_t *self, const q32_t length_q32[], const pose_t *pose, int64_t matrix_q28[][POSE_AXES],
                             q32_t error_q32[])
{
    kin_placement_t at;
    rates_t rates;
    const hv_status_t status = kin_place(self, pose, &at);
    if (status != HV_OK) {
        return status;
    }
    set_rates(self, &at, &rates);
    for (unsigned i = 0; i < self->cylinders; i++) {
        kin_leg_t leg;
        kin_leg(self, &at, i, &leg);
        if (leg.length_mm_q44 < LENGTH_MIN_Q44) {
            return HV_ERR_RANGE;
        }
        set_row(self, &rates, &leg, matrix_q28[i]);
        error_q32[i] = length_q32[i] - fx_shift_round(leg.length_mm_q44, KIN_GUARD_BITS);
    }
    return HV_OK;
}

static q32_t find_largest(unsigned count, const q32_t values_q32[])
{
    q32_t largest = 0;
    for (unsigned i = 0; i < count; i++) {
        largest = fx_abs(values_q32[i]) > largest ? fx_abs(values_q32[i]) : largest;
    }
    return largest;
}

/* Adds a solution to the unknown axes; arc lengths become degrees. */
static void take_step(const kin_t *self, const q32_t step_q32[], const uint8_t axes[], pose_t *pose)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t change_q32 =
            axes[i] >= AXIS_X ? step_q32[i] : fx_mul_shift_fit(step_q32[i], KIN_DEG_PER_RAD_Q56, 56u + self->reach_shift);
        pose->axis_q32[axes[i]] = fx_add_sat(pose->axis_q32[axes[i]], change_q32);
    }
}

/* Newton's method from *pose on. */
static hv_status_t iterate(const kin_t *self, const q32_t length_q32[], pose_t *pose, unsigned *iterations)
{
    const uint8_t *axes = self->kind == KIN_HEXAPOD ? k_free_axes : k_tripod_axes;
    while (*iterations < KIN_FORWARD_ITERATIONS_MAX) {
        int64_t matrix_q28[CYLINDERS_MAX][POSE_AXES];
        q32_t step_q32[CYLINDERS_MAX];
        const hv_status_t status = linearise(self, length_q32, pose, matrix_q28, step_q32);
        if (status != HV_OK) {
            return status;
        }
        const bool is_last = find_largest(self->cylinders, step_q32) < ERROR_LAST_STEP_Q32;
        if (!kin_solve(self->cylinders, matrix_q28, step_q32)) {
            return HV_ERR_RANGE;
        }
        take_step(self, step_q32, axes, pose);
        ++*iterations;
        if (is_last) {
            return HV_OK;
        }
    }
    return HV_ERR_RANGE;
}

hv_status_t kin_forward(const kin_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], const pose_t *guess, pose_t *pose,
                        unsigned *iterations)
{
    q32_t length_q32[CYLINDERS_MAX];
    unsigned steps = 0;
    hv_status_t status = HV_OK;
    for (unsigned i = 0; i < self->cylinders; i++) {
        length_q32[i] = fx_add_sat(extension_mm_q32[i], self->retracted_mm_q32[i]);
        if (length_q32[i] <= 0 || length_q32[i] > LENGTH_MAX_Q32) {
            status = HV_ERR_RANGE;
        }
    }
    pose_t solution = *guess;
    if (status == HV_OK) {
        status = iterate(self, length_q32, &solution, &steps);
    }
    if (status == HV_OK) {
        kin_constrain(self, &solution);
        *pose = solution;
    }
    if (iterations != NULL) {
        *iterations = steps;
    }
    return status;
}

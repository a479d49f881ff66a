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

#define ERROR_LAST_STEP_Q32 INT64_C(2147484) /* 0.5 um */
#define LENGTH_MAX_Q32      (INT64_C(65536) * Q32_ONE)

/* The unknown axes, in the order of the columns of J. */
static const uint8_t k_free_axes[] = {AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_X, AXIS_Y, AXIS_Z};
static const uint8_t k_tripod_axes[] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z};

/* The row of J of one leg: the angles, then the translations. */
HV_OWN_FRAME static void set_row(const kin_t *self, const kin_rates_t *rates, const kin_direction_t *leg, int64_t row_q28[])
{
    const int64_t *direction_q28 = leg->direction_q28;
    int64_t moment_q28[3];
    kin_cross_q28(leg->arm_q28, direction_q28, moment_q28);
    row_q28[0] = kin_dot_q28(rates->turn_q28[AXIS_ROLL], moment_q28);
    row_q28[1] = kin_dot_q28(rates->turn_q28[AXIS_PITCH], moment_q28);
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
        row_q28[0] += kin_dot_q28(rates->slide_q28[AXIS_ROLL], direction_q28);
        row_q28[1] += kin_dot_q28(rates->slide_q28[AXIS_PITCH], direction_q28);
        row_q28[2] = direction_q28[2];
        break;
    }
}

/* J and the errors of the lengths at a placed plate, for extensions whose lengths are in range. */
HV_OWN_FRAME static hv_status_t set_rows(const kin_t *self, const q32_t extension_mm_q32[], const kin_placement_t *at,
                                         int64_t matrix_q28[][POSE_AXES], q32_t error_q32[])
{
    kin_rates_t rates;
    kin_rates(self, at, &rates);
    for (unsigned i = 0; i < self->cylinders; i++) {
        kin_direction_t leg;
        if (!kin_leg_direction(self, at, i, &leg)) {
            return HV_ERR_RANGE;
        }
        set_row(self, &rates, &leg, matrix_q28[i]);
        error_q32[i] = extension_mm_q32[i] + self->retracted_mm_q32[i] - fx_shift_round(leg.length_mm_q44, KIN_GUARD_BITS);
    }
    return HV_OK;
}

/* J and the errors of the lengths at a pose. */
static hv_status_t linearise(const kin_t *self, const q32_t extension_mm_q32[], const pose_t *pose,
                             int64_t matrix_q28[][POSE_AXES], q32_t error_q32[])
{
    kin_placement_t at;
    const hv_status_t status = kin_place(self, pose, &at);
    return status == HV_OK ? set_rows(self, extension_mm_q32, &at, matrix_q28, error_q32) : status;
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
static void apply_step(const kin_t *self, const q32_t step_q32[], const uint8_t axes[], pose_t *pose)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t change_q32 =
            axes[i] >= AXIS_X ? step_q32[i] : fx_mul_shift_fit(step_q32[i], KIN_DEG_PER_RAD_Q56, 56u + self->reach_shift);
        pose->axis_q32[axes[i]] = fx_add_sat(pose->axis_q32[axes[i]], change_q32);
    }
}

/* Newton's method from *pose on. */
static hv_status_t iterate(const kin_t *self, const q32_t extension_mm_q32[], pose_t *pose, unsigned *iterations)
{
    const uint8_t *axes = self->kind == KIN_HEXAPOD ? k_free_axes : k_tripod_axes;
    while (*iterations < KIN_FORWARD_ITERATIONS_MAX) {
        int64_t matrix_q28[CYLINDERS_MAX][POSE_AXES];
        q32_t step_q32[CYLINDERS_MAX];
        const hv_status_t status = linearise(self, extension_mm_q32, pose, matrix_q28, step_q32);
        if (status != HV_OK) {
            return status;
        }
        const bool is_last = find_largest(self->cylinders, step_q32) < ERROR_LAST_STEP_Q32;
        if (!kin_solve(self->cylinders, matrix_q28, step_q32)) {
            return HV_ERR_RANGE;
        }
        apply_step(self, step_q32, axes, pose);
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
    unsigned steps = 0;
    hv_status_t status = HV_OK;
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t length_q32 = fx_add_sat(extension_mm_q32[i], self->retracted_mm_q32[i]);
        if (length_q32 <= 0 || length_q32 > LENGTH_MAX_Q32) {
            status = HV_ERR_RANGE;
        }
    }
    pose_t solution = *guess;
    if (status == HV_OK) {
        status = iterate(self, extension_mm_q32, &solution, &steps);
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

/* SPDX-License-Identifier: MIT
 * kin_margin.c - the singularity margin of a pose; see kin.h for what it means.
 *
 * With V_i the velocity of plate joint i per free motion (3 rows, one column per motion) and u_i the direction of its cylinder,
 * the margin is the largest t for which the sum over all cylinders of
 *     V_i' (u_i u_i' - t^2 I) V_i
 * has no negative eigenvalue: the cylinders' speeds are u_i' V_i x, those of the joints V_i x. By Sylvester's law of inertia it
 * has none as long as all pivots of its elimination are positive, so that one small elimination tells whether the margin is above
 * a value, without iteration and whatever the free motions are (any basis will do). The value itself is found by halving.
 */
#include "kin_internal.h"

#define BISECT_STEPS  16u
#define PIVOT_MIN_Q44 (INT64_C(1) << 14) /* 2^-30: below rounding */

/* Elements of the lower triangle of a symmetric matrix, row by row. */
#define TRIANGLE (POSE_AXES * (POSE_AXES + 1) / 2)

/* The sums over all cylinders of V' u u' V and of V' V. */
typedef struct {
    int64_t held_q44[TRIANGLE];
    int64_t all_q44[TRIANGLE];
} sums_t;

/* How a plate joint moves in one of the free motions, of which there are as many as cylinders. A hexapod's are turns about the
 * three axes and slides along them; the other plates have roll, pitch and a slide upwards.
 * @param rates of roll and pitch, of no use to a hexapod */
HV_OWN_FRAME static void joint_velocity(const kin_t *self, const kin_rates_t *rates, unsigned motion, const int64_t arm_q28[3],
                                        int64_t velocity_q28[3])
{
    const bool is_tilt = self->kind != KIN_HEXAPOD && motion < 2;
    int64_t unit_q28[3] = {0};
    unit_q28[motion % 3] = INT64_C(1) << 28;
    for (unsigned axis = 0; axis < 3; axis++) {
        velocity_q28[axis] = unit_q28[axis];
    }
    if (is_tilt || (self->kind == KIN_HEXAPOD && motion < 3)) {
        kin_cross_q28(is_tilt ? rates->turn_q28[motion] : unit_q28, arm_q28, velocity_q28);
    }
    for (unsigned axis = 0; is_tilt && axis < 3; axis++) {
        velocity_q28[axis] += rates->slide_q28[motion][axis];
    }
}

/* Where a matrix has an element; column <= row. */
static unsigned element(unsigned row, unsigned column)
{
    return row * (row + 1) / 2 + column;
}

/* Adds a cylinder's part to the sums. */
HV_OWN_FRAME static void add_leg(const kin_t *self, const kin_rates_t *rates, const kin_direction_t *leg, sums_t *sums)
{
    int64_t velocity_q28[POSE_AXES][3], speed_q28[POSE_AXES];
    for (unsigned i = 0; i < self->cylinders; i++) {
        joint_velocity(self, rates, i, leg->arm_q28, velocity_q28[i]);
        speed_q28[i] = kin_dot_q28(velocity_q28[i], leg->direction_q28);
        for (unsigned j = 0; j <= i; j++) {
            sums->held_q44[element(i, j)] += fx_shift_down(speed_q28[i] * speed_q28[j], 12);
            sums->all_q44[element(i, j)] += kin_dot_q28(velocity_q28[i], velocity_q28[j]) * (1 << 16);
        }
    }
}

static bool set_sums(const kin_t *self, const pose_t *pose, sums_t *sums)
{
    kin_placement_t at;
    kin_rates_t rates;
    *sums = (sums_t){{0}, {0}};
    if (kin_place(self, pose, &at) != HV_OK) {
        return false;
    }
    if (self->kind != KIN_HEXAPOD) {
        kin_rates(self, &at, &rates);
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        kin_direction_t leg;
        if (!kin_leg_direction(self, &at, i, &leg)) {
            return false;
        }
        add_leg(self, &rates, &leg, sums);
    }
    return true;
}

/* Whether all pivots of a symmetric matrix are positive. Uses it up. */
static bool is_positive(unsigned size, int64_t matrix_q44[TRIANGLE])
{
    for (unsigned column = 0; column < size; column++) {
        const int64_t pivot_q44 = matrix_q44[element(column, column)];
        if (pivot_q44 < PIVOT_MIN_Q44) {
            return false;
        }
        const int64_t inverse_q30 = fx_mul_div(Q62_ONE, 1 << 12, pivot_q44);
        for (unsigned row = size; row-- > column + 1;) {
            const int64_t factor_q30 = fx_mul_shift(matrix_q44[element(row, column)], inverse_q30, 44);
            for (unsigned i = column + 1; i <= row; i++) {
                const int64_t part_q44 = fx_mul_shift(factor_q30, matrix_q44[element(i, column)], 30);
                matrix_q44[element(row, i)] = fx_sub_sat(matrix_q44[element(row, i)], part_q44);
            }
        }
    }
    return true;
}

static bool is_above(unsigned size, const sums_t *sums, q32_t margin_q32)
{
    int64_t matrix_q44[TRIANGLE];
    const int64_t square_q62 = fx_mul_shift_fit(margin_q32, margin_q32, 2);
    for (unsigned i = 0; i < element(size, 0); i++) {
        matrix_q44[i] = sums->held_q44[i] - fx_mul_shift_fit(sums->all_q44[i], square_q62, 62);
    }
    return is_positive(size, matrix_q44);
}

bool kin_has_margin(const kin_t *self, const pose_t *pose, q32_t margin_q32)
{
    sums_t sums;
    return set_sums(self, pose, &sums) && is_above(self->cylinders, &sums, margin_q32);
}

q32_t kin_margin(const kin_t *self, const pose_t *pose)
{
    sums_t sums;
    q32_t margin_q32 = 0;
    if (!set_sums(self, pose, &sums)) {
        return 0;
    }
    for (unsigned i = 1; i <= BISECT_STEPS; i++) {
        const q32_t higher_q32 = margin_q32 + fx_shift_down(Q32_ONE, i);
        margin_q32 = is_above(self->cylinders, &sums, higher_q32) ? higher_q32 : margin_q32;
    }
    return margin_q32;
}

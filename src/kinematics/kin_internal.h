/* SPDX-License-Identifier: MIT
 * kin_internal.h - what the solutions share: a placed plate, a leg, rates of change, the linear solver.
 * Private to src/kinematics.
 */
#ifndef HEAVE_KIN_INTERNAL_H
#define HEAVE_KIN_INTERNAL_H

#include "heave/kin.h"

/** 180 / pi in Q56. */
#define KIN_DEG_PER_RAD_Q56 INT64_C(4128596020240314225)

/** Lengths carry 12 bits below Q32, so that only the last rounding of an extension counts. |value| < 2^17 mm. */
#define KIN_GUARD_BITS 12u

/** A leg shorter than 1 mm has no direction to speak of. */
#define KIN_LENGTH_MIN_Q44 (INT64_C(1) << 44)

/** A pose worked out: the attitude of the plate and where its motion reference point is, base frame. */
typedef struct {
    q62_t sine_q62[3]; /**< of roll, pitch, yaw */
    q62_t cosine_q62[3];
    int64_t rotation_q60[3][3];
    int64_t mrp_mm_q44[3];
} kin_placement_t;

/** One leg of a placed plate, base frame. */
typedef struct {
    int64_t arm_mm_q44[3];    /**< motion reference point to plate joint */
    int64_t vector_mm_q44[3]; /**< base joint to plate joint */
    int64_t length_mm_q44;
} kin_leg_t;

/** Works out a pose as the mechanism can take it.
 *  @return HV_OK; HV_ERR_RANGE if a value used is outside the range kin_inverse() states (*placement undefined). */
hv_status_t kin_place(const kin_t *self, const pose_t *pose, kin_placement_t *placement) HV_MUST_CHECK;

/** The leg of one cylinder. */
void kin_leg(const kin_t *self, const kin_placement_t *placement, unsigned cylinder, kin_leg_t *leg);

/** What a change of roll and of pitch does: the plate turns about an axis and its motion reference point slides (per rad, over
 *  2^reach_shift mm). */
typedef struct {
    int64_t turn_q28[2][3];
    int64_t slide_q28[2][3];
} kin_rates_t;

/** The true rates of roll and pitch at a placed plate; on a 3-RPS with what its hinges make of them. */
void kin_rates(const kin_t *self, const kin_placement_t *at, kin_rates_t *rates);

/** Where a leg points. */
typedef struct {
    int64_t direction_q28[3];
    int64_t arm_q28[3]; /**< turned, over 2^reach_shift mm */
    int64_t length_mm_q44;
} kin_direction_t;

/** Where the leg of one cylinder points.
 *  @return false for a leg shorter than KIN_LENGTH_MIN_Q44 */
bool kin_leg_direction(const kin_t *self, const kin_placement_t *placement, unsigned cylinder, kin_direction_t *direction);

/** a . b, for |a| |b| < 64. */
static inline int64_t kin_dot_q28(const int64_t a_q28[3], const int64_t b_q28[3])
{
    return fx_shift_down(a_q28[0] * b_q28[0] + a_q28[1] * b_q28[1] + a_q28[2] * b_q28[2], 28);
}

/** a x b, for |a| |b| < 64. */
static inline void kin_cross_q28(const int64_t a_q28[3], const int64_t b_q28[3], int64_t result_q28[3])
{
    result_q28[0] = fx_shift_down(a_q28[1] * b_q28[2] - a_q28[2] * b_q28[1], 28);
    result_q28[1] = fx_shift_down(a_q28[2] * b_q28[0] - a_q28[0] * b_q28[2], 28);
    result_q28[2] = fx_shift_down(a_q28[0] * b_q28[1] - a_q28[1] * b_q28[0], 28);
}

/** Solves matrix * x = rhs by elimination with partial pivoting; both are used up, x replaces rhs.
 *  @param matrix_q28 elements below 2 for six unknowns, below 2^3 for three
 *  @param rhs_q32    elements below 2^49
 *  @return false if a pivot or a solution shows the matrix as good as singular. */
bool kin_solve(unsigned size, int64_t matrix_q28[][POSE_AXES], q32_t rhs_q32[]);

#endif

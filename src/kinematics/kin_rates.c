/* SPDX-License-Identifier: MIT
 * kin_rates.c - the first derivatives of a placed mechanism: how the plate turns and slides when a free axis changes, and what a
 * leg sees of it. Shared by the forward solution and the singularity margin. Q28, lengths over 2^reach_shift mm.
 */
#include "kin_internal.h"

/* A column of the rotation. */
static void rotation_column(const kin_placement_t *at, unsigned column, int64_t result_q28[3])
{
    for (unsigned row = 0; row < 3; row++) {
        result_q28[row] = fx_shift_down(at->rotation_q60[row][column], 32);
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
            const int64_t turned_q44 = fx_mul_high(at->rotation_q60[axis][i], self->hinge_offset_mm_q48[i]);
            offset[axis] += fx_shift_down(turned_q44, 16u + self->reach_shift);
        }
    }
    kin_cross_q28(turn_q28, first, first_rate);
    kin_cross_q28(turn_q28, second, second_rate);
    kin_cross_q28(turn_q28, offset, offset_rate);
    const int64_t radius_q28 = fx_shift_down(self->hinge_half_radius_mm_q48, 19u + self->reach_shift);
    slide_q28[0] = offset_rate[0] + fx_shift_down(radius_q28 * (first_rate[0] - second_rate[1]), 29);
    slide_q28[1] = offset_rate[1] - fx_shift_down(radius_q28 * first_rate[1], 28);
    slide_q28[2] = 0;
}

/* Adds to the turns of roll and pitch what the hinges make of them. */
static void add_hinged_rates(const kin_t *self, const kin_placement_t *at, kin_rates_t *rates)
{
    const q62_t *sine = at->sine_q62, *cosine = at->cosine_q62;
    const int64_t divisor_q28 = (INT64_C(1) << 28) + fx_shift_down(fx_mul_high(cosine[AXIS_PITCH], cosine[AXIS_ROLL]), 32);
    rates->turn_q28[AXIS_ROLL][2] += fx_shift_down(sine[AXIS_PITCH], 6) / divisor_q28;
    rates->turn_q28[AXIS_PITCH][2] += fx_shift_down(sine[AXIS_ROLL], 6) / divisor_q28;
    set_hinged_slide(self, at, rates->turn_q28[AXIS_ROLL], rates->slide_q28[AXIS_ROLL]);
    set_hinged_slide(self, at, rates->turn_q28[AXIS_PITCH], rates->slide_q28[AXIS_PITCH]);
}

void kin_rates(const kin_t *self, const kin_placement_t *at, kin_rates_t *rates)
{
    *rates = (kin_rates_t){{{0}}, {{0}}};
    rotation_column(at, 0, rates->turn_q28[AXIS_ROLL]);
    rates->turn_q28[AXIS_PITCH][0] = -fx_shift_down(at->sine_q62[AXIS_YAW], 34);
    rates->turn_q28[AXIS_PITCH][1] = fx_shift_down(at->cosine_q62[AXIS_YAW], 34);
    if (self->kind == KIN_TRIPOD_3RPS) {
        add_hinged_rates(self, at, rates);
    }
}

bool kin_leg_direction(const kin_t *self, const kin_placement_t *placement, unsigned cylinder, kin_direction_t *direction)
{
    kin_leg_t leg;
    kin_leg(self, placement, cylinder, &leg);
    if (leg.length_mm_q44 < KIN_LENGTH_MIN_Q44) {
        return false;
    }
    const int64_t inverse_q48 = (INT64_C(1) << 62) / fx_shift_down(leg.length_mm_q44, 30);
    for (unsigned axis = 0; axis < 3; axis++) {
        direction->direction_q28[axis] = fx_mul_high(leg.vector_mm_q44[axis], inverse_q48);
        direction->arm_q28[axis] = fx_shift_down(leg.arm_mm_q44[axis], 16u + self->reach_shift);
    }
    direction->length_mm_q44 = leg.length_mm_q44;
    return true;
}

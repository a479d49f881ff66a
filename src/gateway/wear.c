/* SPDX-License-Identifier: MIT
 * wear.c - what an axis has done since the start; see heave/wear.h.
 */
#include "heave/wear.h"

#define STEP_Q32 (Q32_ONE / 10) /* encoders tremble by less */
#define TURN_Q32 Q32_ONE
#define JUMP_Q32 (50 * Q32_ONE) /* in a cycle: not a way, but another zero */

static void begin(wear_t *self, q32_t at_q32)
{
    self->is_known = true;
    self->mark_q32 = at_q32;
    self->extreme_q32 = at_q32;
}

static void note_turn(wear_t *self, q32_t at_q32)
{
    const q32_t onwards_q32 = self->is_upwards ? at_q32 - self->extreme_q32 : self->extreme_q32 - at_q32;
    if (onwards_q32 >= 0) {
        self->extreme_q32 = at_q32;
    } else if (-onwards_q32 >= TURN_Q32) {
        self->is_upwards = !self->is_upwards;
        self->extreme_q32 = at_q32;
        self->turns++;
    }
}

void wear_step(wear_t *self, const drive_feedback_t *feedback, uint32_t cycle_us)
{
    const bool is_known = feedback->state != DRIVE_OFFLINE && feedback->has_actual && feedback->is_homed;
    const q32_t at_q32 = feedback->actual_mm_q32;
    self->energized_us += feedback->is_energized ? cycle_us : 0;
    if (!is_known) {
        self->is_known = false;
        return;
    }
    const q32_t travel_q32 = self->is_known ? fx_abs(at_q32 - self->mark_q32) : JUMP_Q32;
    if (travel_q32 >= JUMP_Q32) {
        begin(self, at_q32);
    } else if (travel_q32 >= STEP_Q32) {
        self->travel_milli += (uint64_t)(travel_q32 / (Q32_ONE / 1000));
        self->mark_q32 = at_q32;
        note_turn(self, at_q32);
    }
}

/* SPDX-License-Identifier: MIT
 * jump.c - see jump.h.
 */
#include "jump.h"

#include "axis_targets.h"
#include "plan.h"
#include "stream_evidence.h"
#include "stream_shift.h"

#define LARGER           4                   /* times as large as three steps around it is a jump */
#define FAR_Q32          q32_from_int(65536) /* no axis goes so far */
#define JERK_MAX_Q32     (16 * Q32_ONE)      /* at an intensity of 0 nothing limits a line */
#define ACC_PER_JERK_MAX 8192                /* cycles */
#define LIMITS_PARTS     8                   /* one of so many parts of the limits is left to the motion that goes on meanwhile */

/* Finds how far the stream has jumped, beside the motion that went on: half of that between the sample before the jump and the
 * one that jumped went as before, half as since then. Returns false where that is no jump: it is not far larger than the steps
 * around. */
static bool find_jump(const motion_t *self, const q32_t step_q32[POSE_AXES], q32_t by_q32[POSE_AXES])
{
    const stream_evidence_t *seen = &self->stream.evidence;
    q32_t size_q32 = 0;
    q32_t around_q32 = 0;
    if (seen->count < 3) {
        return false;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q32_t newest_q32 = seen->value_q32[0][i] - seen->value_q32[1][i];
        const q32_t before_q32 = seen->value_q32[1][i] - seen->value_q32[2][i];
        by_q32[i] = self->slot_q32[i] - seen->value_q32[0][i] - step_q32[i] - (newest_q32 + step_q32[i]) / 2;
        size_q32 += stream_evidence_in_speed_limits(&self->stream.curve.governor, i, by_q32[i]);
        around_q32 += stream_evidence_in_speed_limits(&self->stream.curve.governor, i,
                                                      fx_abs(newest_q32) + fx_abs(before_q32) + fx_abs(step_q32[i]));
    }
    return size_q32 > around_q32 * LARGER;
}

static q32_t larger(q32_t a_q32, q32_t b_q32)
{
    return a_q32 > b_q32 ? a_q32 : b_q32;
}

/* The ramp of an axis of the offset gets the limits of the straight line to 0, in its share of that line. While it moves, it also
 * keeps those that it has. */
static void lead_back(ramp_t *ramp, const path_limits_t *path, q32_t off_q32)
{
    const ramp_state_t state = {off_q32, ramp->state.vel_per_cycle_q32, ramp->state.acc_per_cycle2_q32};
    const bool is_moving = state.vel_per_cycle_q32 != 0 || state.acc_per_cycle2_q32 != 0;
    const q32_t far_q32 = fx_abs(off_q32);
    ramp_limits_t limits = {.pos_min_q32 = -FAR_Q32, .pos_max_q32 = FAR_Q32};
    const q32_t jerk_q32 = fx_clamp(fx_mul_shift(path->jerk_q62, far_q32, 62), RAMP_JERK_MIN_Q32, JERK_MAX_Q32);
    limits.jerk_per_cycle3_q32 = jerk_q32;
    limits.acc_per_cycle2_q32 = fx_clamp(fx_mul_shift(path->acc_q62, far_q32, 62), jerk_q32, jerk_q32 * ACC_PER_JERK_MAX);
    limits.vel_per_cycle_q32 =
        fx_clamp(fx_mul_shift(path->vel_q62, far_q32, 62), limits.acc_per_cycle2_q32, jerk_q32 * (RAMP_SPEED_PER_JERK_MAX / 2));
    if (is_moving) {
        limits.jerk_per_cycle3_q32 = larger(limits.jerk_per_cycle3_q32, ramp->limits.jerk_per_cycle3_q32);
        limits.acc_per_cycle2_q32 = larger(limits.acc_per_cycle2_q32, ramp->limits.acc_per_cycle2_q32);
        limits.vel_per_cycle_q32 = larger(limits.vel_per_cycle_q32, ramp->limits.vel_per_cycle_q32);
    }
    if (ramp_init(ramp, &limits, off_q32) == HV_OK) {
        ramp_adopt(ramp, &state);
    }
}

void jump_accept(motion_t *self, const q32_t step_q32[POSE_AXES])
{
    q32_t by_q32[POSE_AXES];
    q32_t slot_q32[AXES_MAX] = {0};
    q32_t from_q32[AXES_MAX];
    q32_t to_q32[AXES_MAX];
    if (!find_jump(self, step_q32, by_q32)) {
        return;
    }
    if (!self->is_jumping) {
        self->plan.jump = (jump_t){.off = {{.flags = 0}}};
        self->is_jumping = true;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        slot_q32[i] = self->slot_q32[i] + self->plan.jump.off[i].state.pos_q32 - by_q32[i];
    }
    axis_targets_scale(self, self->space, slot_q32, from_q32);
    axis_targets_scale(self, self->space, self->slot_q32, to_q32);
    path_limits_t path = plan_limits_of_straight(self, POSE_AXES, from_q32, to_q32);
    path.vel_q62 -= path.vel_q62 / LIMITS_PARTS;
    path.acc_q62 -= path.acc_q62 / LIMITS_PARTS;
    path.jerk_q62 -= path.jerk_q62 / LIMITS_PARTS;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        lead_back(&self->plan.jump.off[i], &path, slot_q32[i] - self->slot_q32[i]);
    }
    stream_shift(&self->stream, &self->kin, by_q32);
}

void jump_step(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    const ramp_ref_t end = {.pos_q32 = 0};
    bool is_done = true;
    for (unsigned i = 0; i < POSE_AXES && self->is_jumping; i++) {
        ramp_t *ramp = &self->plan.jump.off[i];
        const ramp_state_t was = ramp->state;
        if (was.pos_q32 == 0 && ramp_is_at_rest(ramp)) {
            continue;
        }
        (void)ramp_step(ramp, &end, RAMP_FIRM);
        ref[i].pos_q32 += ramp->state.pos_q32;
        ref[i].vel_per_cycle_q32 += ramp->state.vel_per_cycle_q32;
        ref[i].acc_per_cycle2_q32 += ramp->state.acc_per_cycle2_q32;
        ref[i].jerk_per_cycle3_q32 += ramp->state.acc_per_cycle2_q32 - was.acc_per_cycle2_q32;
        is_done = false;
    }
    self->is_jumping = self->is_jumping && !is_done;
}

/* SPDX-License-Identifier: MIT
 * jump.c - see jump.h.
 */
#include "jump.h"

#include "plan.h"

#define FAR_Q32          q32_from_int(65536) /* no axis goes so far */
#define JERK_MAX_Q32     (16 * Q32_ONE)      /* at an intensity of 0 nothing limits a line */
#define ACC_PER_JERK_MAX 8192                /* cycles */
#define LIMITS_PARTS     8                   /* one of so many parts of the limits is left to the motion that goes on meanwhile */

static q32_t larger(q32_t a_q32, q32_t b_q32)
{
    return a_q32 > b_q32 ? a_q32 : b_q32;
}

/* The ramp of the offset of an axis gets the limits of the straight line to 0, in its share of that line. While it moves, it also
 * keeps those that it has. */
static void shape_ramp(ramp_t *ramp, const path_limits_t *path, q32_t off_q32)
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

bool jump_accept(jump_t *self, bool is_jumping, const jump_in_t *in, stream_t *stream)
{
    const q32_t *newest_q32 = in->value_q32;
    q32_t by_q32[POSE_AXES];
    q32_t old_q32[AXES_MAX] = {0};
    q32_t from_q32[AXES_MAX];
    q32_t to_q32[AXES_MAX];
    if (!stream_find_jump(stream, newest_q32, in->step_q32, by_q32)) {
        return is_jumping;
    }
    if (!is_jumping) {
        *self = (jump_t){.off = {{.flags = 0}}};
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        old_q32[i] = newest_q32[i] + self->off[i].state.pos_q32 - by_q32[i];
    }
    axis_targets_scale(in->scale, old_q32, from_q32);
    axis_targets_scale(in->scale, newest_q32, to_q32);
    path_limits_t path = plan_limits_of_straight(in->scale->platform, in->followed, POSE_AXES, from_q32, to_q32);
    path.vel_q62 -= path.vel_q62 / LIMITS_PARTS;
    path.acc_q62 -= path.acc_q62 / LIMITS_PARTS;
    path.jerk_q62 -= path.jerk_q62 / LIMITS_PARTS;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        shape_ramp(&self->off[i], &path, old_q32[i] - newest_q32[i]);
    }
    stream_shift(stream, &in->scale->platform->kin, by_q32);
    return true;
}

bool jump_step(jump_t *self, ramp_ref_t ref[AXES_MAX])
{
    const ramp_ref_t end = {.pos_q32 = 0};
    bool is_jumping = false;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        ramp_t *ramp = &self->off[i];
        const ramp_state_t was = ramp->state;
        if (was.pos_q32 == 0 && ramp_is_at_rest(ramp)) {
            continue;
        }
        (void)ramp_step(ramp, &end, RAMP_FIRM);
        ref[i].pos_q32 += ramp->state.pos_q32;
        ref[i].vel_per_cycle_q32 += ramp->state.vel_per_cycle_q32;
        ref[i].acc_per_cycle2_q32 += ramp->state.acc_per_cycle2_q32;
        ref[i].jerk_per_cycle3_q32 += ramp->state.acc_per_cycle2_q32 - was.acc_per_cycle2_q32;
        is_jumping = true;
    }
    return is_jumping;
}

/* SPDX-License-Identifier: MIT
 * fade_in.c - fading a sender in; see fade_in.h.
 */
#include "fade_in.h"

#include "active_axis.h"
#include "workspace.h"

#define HIDDEN_Q46  (FADE_FULL / 1024) /* a share that nobody sees */
#define PARTS_SHIFT 4                  /* a cylinder is even enough in each of 2^4 parts of a straight line of the pose */
#define PARTS       (1 << PARTS_SHIFT)
#define CYCLES_MAX  4096 /* seconds */

HV_OWN_FRAME void fade_in_begin(motion_t *self)
{
    q32_t from_q32[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        from_q32[i] = self->space == MOTION_POSE ? self->axis[i].state.pos_q32 : self->cylinder[i].state.pos_q32;
    }
    fade_begin(&self->fade, from_q32, self->is_return ? FADE_CYCLES_MIN : self->blend_cycles);
    self->is_fading = true;
}

void fade_in_again(motion_t *self)
{
    self->due = DUE_NOTHING;
    motion_follow(self);
    self->has_pending = true;
}

bool fade_in_is_hidden(const motion_t *self)
{
    return self->is_taking_over && (!self->is_fading || self->fade.share_q46[0] < HIDDEN_Q46);
}

bool fade_in_is_led_beyond(const motion_t *self)
{
    bool is_beyond = false;
    for (unsigned i = 0; self->is_fading && i < POSE_AXES; i++) {
        const ramp_limits_t *limits = active_axis_limits(self, i);
        is_beyond = is_beyond || fx_abs(self->led[i].vel_per_cycle_q32) > 2 * limits->vel_per_cycle_q32 ||
                    fx_abs(self->led[i].acc_per_cycle2_q32) > 2 * limits->acc_per_cycle2_q32;
    }
    return is_beyond;
}

/* Extensions at a pose of the fading, or given ones. */
HV_OWN_FRAME static void extensions_of(const motion_t *self, const q32_t at_q32[POSE_AXES], q32_t extension_mm_q32[CYLINDERS_MAX])
{
    pose_t pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = extension_mm_q32[i] = at_q32[i];
    }
    if (self->space == MOTION_POSE) {
        kin_constrain(&self->kin, &pose);
        (void)workspace_pull_in(self, &pose, extension_mm_q32, NULL);
    }
}

/* Largest travel of a cylinder for so many small steps like this one: on a straight line of the pose a cylinder is not even. */
HV_OWN_FRAME static q32_t travel_of(const motion_t *self, const q32_t at_q32[POSE_AXES], const q32_t step_q32[POSE_AXES],
                                    int32_t steps)
{
    q32_t there_q32[POSE_AXES];
    q32_t here_mm_q32[CYLINDERS_MAX];
    q32_t there_mm_q32[CYLINDERS_MAX];
    q32_t largest_q32 = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        there_q32[i] = at_q32[i] + step_q32[i];
    }
    extensions_of(self, at_q32, here_mm_q32);
    extensions_of(self, there_q32, there_mm_q32);
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t travel_q32 = fx_abs(there_mm_q32[i] - here_mm_q32[i]);
        largest_q32 = travel_q32 > largest_q32 ? travel_q32 : largest_q32;
    }
    return largest_q32 * steps;
}

void fade_in_aim(motion_t *self, bool is_planned)
{
    fade_t *const fade = &self->fade;
    q32_t at_q32[POSE_AXES];
    q32_t step_q32[POSE_AXES];
    fade->plan_travel_mm_q32 = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        at_q32[i] = fade->from_q32[i];
        step_q32[i] = fx_shift_down(self->goal_q32[i] - fade->from_q32[i], PARTS_SHIFT);
    }
    for (unsigned part = 0; part < PARTS && is_planned; part++) {
        const q32_t travel_q32 = travel_of(self, at_q32, step_q32, PARTS);
        fade->plan_travel_mm_q32 = travel_q32 > fade->plan_travel_mm_q32 ? travel_q32 : fade->plan_travel_mm_q32;
        for (unsigned i = 0; i < POSE_AXES; i++) {
            at_q32[i] += step_q32[i];
        }
    }
}

/* Largest travel of a cylinder to the references, as it moves at the present share. Where they are in motion, also what they
 * travel in a quarter of the time in which fading reaches its speed: a share that rises takes that motion up, which is an
 * acceleration. */
HV_OWN_FRAME static q32_t travel_to(const motion_t *self, const ramp_ref_t ref[AXES_MAX])
{
    const fade_t *const fade = &self->fade;
    q32_t at_q32[POSE_AXES];
    q32_t step_q32[POSE_AXES];
    q32_t vel_q32[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q32_t whole_q32 = ref[i].pos_q32 - fade->from_q32[i];
        at_q32[i] = fade->from_q32[i] + fx_mul_shift(whole_q32, fade->share_q46[0], FADE_SHIFT);
        step_q32[i] = fx_shift_down(whole_q32, PARTS_SHIFT);
        vel_q32[i] = ref[i].vel_per_cycle_q32;
    }
    const int32_t cycles = (int32_t)fx_clamp(self->fade_limits.vel_q32 / self->fade_limits.acc_q32 / 4, 0, CYCLES_MAX);
    const q32_t travel_q32 = travel_of(self, at_q32, step_q32, PARTS);
    return fade->plan_travel_mm_q32 > 0 ? travel_q32 : travel_q32 + travel_of(self, at_q32, vel_q32, cycles);
}

void fade_in_step(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    if (self->is_fading) {
        self->is_fading = fade_step(&self->fade, &self->fade_limits, travel_to(self, ref), ref);
        self->is_taking_over = self->is_fading;
        out->flags |= MOTION_TAKEOVER;
    }
}

/* SPDX-License-Identifier: MIT
 * fade_in.c - fading a sender in; see fade_in.h.
 */
#include "fade_in.h"

#include "followed.h"
#include "workspace.h"

#define HIDDEN_Q46  (FADE_FULL / 1024) /* a share that nobody sees */
#define PARTS_SHIFT 4                  /* a cylinder is even enough in each of 2^4 parts of a straight line of the pose */
#define PARTS       (1 << PARTS_SHIFT)
#define CYCLES_MAX  4096  /* seconds */
#define RISE_US     64000 /* in which fading reaches the acceleration of [engage]: nobody is to feel it begin */

void fade_in_init(fade_in_t *self, const settings_t *settings, const ramp_limits_t *engage)
{
    const q32_t acc_q32 = engage->acc_per_cycle2_q32;
    self->least_cycles = settings->blend_ms * 1000 / settings->cycle_us;
    self->limits = (fade_limits_t){engage->vel_per_cycle_q32, acc_q32, acc_q32 * settings->cycle_us / RISE_US};
}

HV_OWN_FRAME void fade_in_begin(fade_in_t *self, const platform_t *platform, motion_space_t space)
{
    q32_t from_q32[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        from_q32[i] = space == MOTION_POSE ? platform->axis[i].state.pos_q32 : platform->cylinder[i].state.pos_q32;
    }
    fade_begin(&self->fade, from_q32, self->is_return ? FADE_CYCLES_MIN : self->least_cycles);
}

bool fade_in_is_hidden(const fade_in_t *self, follow_phase_t phase)
{
    return phase == FOLLOW_AWAITED || (phase == FOLLOW_FADING_IN && self->fade.share_q46[0] < HIDDEN_Q46);
}

bool fade_in_is_beyond_limits(const platform_t *platform, const followed_t *followed)
{
    bool is_beyond = false;
    for (unsigned i = 0; followed->phase == FOLLOW_FADING_IN && i < POSE_AXES; i++) {
        const ramp_limits_t *limits = followed_limits(followed, platform, i);
        is_beyond = is_beyond || fx_abs(followed->past[i].vel_per_cycle_q32) > 2 * limits->vel_per_cycle_q32 ||
                    fx_abs(followed->past[i].acc_per_cycle2_q32) > 2 * limits->acc_per_cycle2_q32;
    }
    return is_beyond;
}

/* Extensions at a pose of the fading, or given ones. */
HV_OWN_FRAME static void extensions_of(const platform_t *platform, motion_space_t space, const q32_t at_q32[POSE_AXES],
                                       q32_t extension_mm_q32[CYLINDERS_MAX])
{
    pose_t pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = extension_mm_q32[i] = at_q32[i];
    }
    if (space == MOTION_POSE) {
        kin_constrain(&platform->kin, &pose);
        (void)workspace_pull_in(platform, &pose, extension_mm_q32, NULL);
    }
}

/* Largest travel of a cylinder for so many small steps like this one: on a straight line of the pose a cylinder is not even. */
HV_OWN_FRAME static q32_t travel_of(const platform_t *platform, motion_space_t space, const q32_t at_q32[POSE_AXES],
                                    const q32_t step_q32[POSE_AXES], int32_t steps)
{
    q32_t there_q32[POSE_AXES];
    q32_t here_mm_q32[CYLINDERS_MAX];
    q32_t there_mm_q32[CYLINDERS_MAX];
    q32_t largest_q32 = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        there_q32[i] = at_q32[i] + step_q32[i];
    }
    extensions_of(platform, space, at_q32, here_mm_q32);
    extensions_of(platform, space, there_q32, there_mm_q32);
    for (unsigned i = 0; i < platform->cylinders; i++) {
        const q32_t travel_q32 = fx_abs(there_mm_q32[i] - here_mm_q32[i]);
        largest_q32 = travel_q32 > largest_q32 ? travel_q32 : largest_q32;
    }
    return largest_q32 * steps;
}

void fade_in_aim(fade_in_t *self, const platform_t *platform, motion_space_t space, const q32_t *goal_q32)
{
    fade_t *const fade = &self->fade;
    q32_t at_q32[POSE_AXES];
    q32_t step_q32[POSE_AXES];
    fade->plan_travel_mm_q32 = 0;
    if (goal_q32 == NULL) {
        return;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        at_q32[i] = fade->from_q32[i];
        step_q32[i] = fx_shift_down(goal_q32[i] - fade->from_q32[i], PARTS_SHIFT);
    }
    for (unsigned part = 0; part < PARTS; part++) {
        const q32_t travel_q32 = travel_of(platform, space, at_q32, step_q32, PARTS);
        fade->plan_travel_mm_q32 = travel_q32 > fade->plan_travel_mm_q32 ? travel_q32 : fade->plan_travel_mm_q32;
        for (unsigned i = 0; i < POSE_AXES; i++) {
            at_q32[i] += step_q32[i];
        }
    }
}

/* Largest travel of a cylinder to the references, as it moves at the present share. Where they are in motion, also what they
 * travel in a quarter of the time in which fading reaches its speed: a share that rises takes that motion up, which is an
 * acceleration. */
HV_OWN_FRAME static q32_t travel_to(const fade_in_t *self, const platform_t *platform, motion_space_t space,
                                    const ramp_ref_t ref[AXES_MAX])
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
    const int32_t cycles = (int32_t)fx_clamp(self->limits.vel_q32 / self->limits.acc_q32 / 4, 0, CYCLES_MAX);
    const q32_t travel_q32 = travel_of(platform, space, at_q32, step_q32, PARTS);
    return fade->plan_travel_mm_q32 > 0 ? travel_q32 : travel_q32 + travel_of(platform, space, at_q32, vel_q32, cycles);
}

bool fade_in_step(fade_in_t *self, const platform_t *platform, motion_space_t space, ramp_ref_t ref[AXES_MAX])
{
    return fade_step(&self->fade, &self->limits, travel_to(self, platform, space, ref), ref);
}

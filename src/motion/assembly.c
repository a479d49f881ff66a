/* SPDX-License-Identifier: MIT
 * assembly.c - the plate that belongs to extensions given one by one; see assembly.h.
 */
#include "assembly.h"

#define AHEAD_Q32 q32_from_int(5)

/* Whether extensions have a pose near another one, with the margin. */
static bool is_held_near(const platform_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], const pose_t *guess)
{
    pose_t pose;
    return kin_forward(&self->kin, extension_mm_q32, guess, &pose, NULL) == HV_OK &&
           kin_has_margin(&self->kin, &pose, KIN_MARGIN_LEAST_Q32);
}

/* Whether extensions have a pose near where the platform is, with the margin or with more than there is here. */
static bool is_held_or_better(const platform_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX])
{
    pose_t pose;
    return kin_forward(&self->kin, extension_mm_q32, &self->pose, &pose, NULL) == HV_OK &&
           (kin_has_margin(&self->kin, &pose, KIN_MARGIN_LEAST_Q32) ||
            kin_margin(&self->kin, &pose) > kin_margin(&self->kin, &self->pose));
}

static q32_t longest_way(const platform_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX])
{
    q32_t longest_q32 = 1;
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t travel_q32 = fx_abs(extension_mm_q32[i] - self->cylinder[i].state.pos_q32);
        longest_q32 = travel_q32 > longest_q32 ? travel_q32 : longest_q32;
    }
    return longest_q32;
}

/* Straight from the set-points towards extensions, the share AHEAD_Q32 / of_q32 of the way there. */
static bool is_held_on_way(const platform_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], q32_t of_q32)
{
    q32_t ahead_mm_q32[CYLINDERS_MAX] = {0};
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t here_q32 = self->cylinder[i].state.pos_q32;
        ahead_mm_q32[i] = here_q32 + fx_mul_div(extension_mm_q32[i] - here_q32, AHEAD_Q32, of_q32);
    }
    return is_held_or_better(self, ahead_mm_q32);
}

/* Whether the first step there is possible. */
static bool is_held_ahead(const platform_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX])
{
    const q32_t longest_q32 = longest_way(self, extension_mm_q32);
    return is_held_on_way(self, extension_mm_q32, longest_q32 > AHEAD_Q32 ? longest_q32 : AHEAD_Q32);
}

/* Whether it is too near a singularity already, and on a way out. Margins have steps: where a short stop ends is no better than
 * here, so what is behind its end counts then. */
static bool is_leaving(const platform_t *self, const q32_t rest_q32[CYLINDERS_MAX])
{
    const q32_t longest_q32 = longest_way(self, rest_q32);
    return !kin_has_margin(&self->kin, &self->pose, KIN_MARGIN_LEAST_Q32) &&
           is_held_on_way(self, rest_q32, longest_q32 < AHEAD_Q32 ? longest_q32 : AHEAD_Q32);
}

bool assembly_is_held(const platform_t *self, bool is_beginning, const q32_t extension_mm_q32[CYLINDERS_MAX])
{
    if (is_beginning && !is_held_ahead(self, extension_mm_q32)) {
        return false;
    }
    return is_held_near(self, extension_mm_q32, &self->pose) || is_held_near(self, extension_mm_q32, &self->neutral);
}

bool assembly_can_stop(const platform_t *self, const ramp_t *const by[CYLINDERS_MAX])
{
    ramp_state_t start[CYLINDERS_MAX];
    const ramp_limits_t *limits[CYLINDERS_MAX];
    q32_t rest_q32[CYLINDERS_MAX];
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const ramp_t *ramp = by[i]; /* the coming cycle may still push on with all its jerk */
        const ramp_state_t *now = &ramp->state;
        const q32_t jerk_q32 = ramp->limits.jerk_per_cycle3_q32;
        const q32_t pushed_q32 = now->acc_per_cycle2_q32 + (now->vel_per_cycle_q32 < 0 ? -jerk_q32 : jerk_q32);
        const q32_t acc_q32 = fx_clamp(pushed_q32, -ramp->acc_safe_q32, ramp->acc_safe_q32);
        const q32_t vel_q32 = now->vel_per_cycle_q32 + acc_q32;
        start[i] = (ramp_state_t){now->pos_q32 + vel_q32, vel_q32, acc_q32};
        limits[i] = &ramp->limits;
    }
    sync_stop_rests(CYLINDERS_MAX, start, limits, rest_q32);
    return is_held_near(self, rest_q32, &self->pose) || is_leaving(self, rest_q32);
}

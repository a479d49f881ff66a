/* SPDX-License-Identifier: MIT
 * fade.c - fading in; see fade.h.
 */
#include "heave/fade.h"

#include "heave/profile.h"
#include "brake.h"
#include "ref_history.h"

#define TRAVEL_MIN_Q32 (Q32_ONE / 1024) /* nobody sees so little */

void fade_begin(fade_t *self, const q32_t *from_q32, uint32_t least_cycles)
{
    *self = (fade_t){.least_cycles = least_cycles < FADE_CYCLES_MIN   ? FADE_CYCLES_MIN
                                     : least_cycles > FADE_CYCLES_MAX ? FADE_CYCLES_MAX
                                                                      : least_cycles};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->from_q32[i] = from_q32[i];
    }
}

/* A limit of the share, from that of a cylinder and its travel. */
static int64_t share_of(q32_t limit_q32, q32_t travel_mm_q32, int64_t most_q46)
{
    const q32_t travel_q32 = travel_mm_q32 > TRAVEL_MIN_Q32 ? travel_mm_q32 : TRAVEL_MIN_Q32;
    return fx_clamp(fx_mul_div(limit_q32, FADE_FULL, travel_q32), 1, most_q46);
}

/* Limits of the share. From 0 to 1 in N cycles: speed 3 / 2 N, acceleration 6 / N^2, jerk 72 / N^3. */
static ramp_limits_t limits_of_share(const fade_t *self, const fade_limits_t *limits, q32_t travel_mm_q32)
{
    const int64_t n = self->least_cycles;
    ramp_limits_t share = {.pos_min_q32 = 0, .pos_max_q32 = FADE_FULL};
    share.vel_per_cycle_q32 = share_of(limits->vel_q32, travel_mm_q32, FADE_FULL * 3 / (2 * n));
    share.acc_per_cycle2_q32 = share_of(limits->acc_q32, travel_mm_q32, FADE_FULL * 6 / (n * n));
    const int64_t jerk_q46 = share_of(limits->jerk_q32, travel_mm_q32, FADE_FULL * 72 / (n * n * n));
    const int64_t least_q46 = share.vel_per_cycle_q32 / (RAMP_SPEED_PER_JERK_MAX / 2) + RAMP_JERK_MIN_Q32; /* as ramps need */
    share.jerk_per_cycle3_q32 = jerk_q46 > least_q46 ? jerk_q46 : least_q46;
    return share;
}

int64_t fade_cycles(const fade_t *self, const fade_limits_t *limits)
{
    const ramp_limits_t share = limits_of_share(self, limits, self->plan_travel_mm_q32);
    const int64_t unit = Q62_ONE / FADE_FULL;
    const path_limits_t path_limits = {share.vel_per_cycle_q32 * unit, share.acc_per_cycle2_q32 * unit,
                                       share.jerk_per_cycle3_q32 * unit};
    scurve_t path;
    scurve_plan(&path, &path_limits, self->least_cycles);
    return scurve_cycles(&path);
}

/* A ramp of the share, with so many times the acceleration and jerk; false where it would have to be too slow or too quick. */
static bool prepare(ramp_t *ramp, const ramp_limits_t *share, int64_t times, int64_t parts, const ramp_state_t *state)
{
    ramp_limits_t limits = *share;
    limits.acc_per_cycle2_q32 = fx_mul_div(limits.acc_per_cycle2_q32, times, parts);
    limits.jerk_per_cycle3_q32 = fx_mul_div(limits.jerk_per_cycle3_q32, times, parts);
    const bool is_ready = ramp_init(ramp, &limits, state->pos_q32) == HV_OK;
    if (is_ready) {
        ramp_adopt(ramp, state);
    }
    return is_ready;
}

/* The next share. A travel that grows makes the share slower at once, but a stop that has begun keeps what it needs. */
static int64_t next_share(const fade_t *self, const fade_limits_t *limits, q32_t travel_mm_q32)
{
    const int64_t *const at = self->share_q46;
    const ramp_state_t state = {at[0], at[0] - at[1], at[0] - 2 * at[1] + at[2]};
    const ramp_ref_t end = {.pos_q32 = FADE_FULL};
    const int64_t left_q46 = FADE_FULL - at[0];
    ramp_limits_t share = limits_of_share(self, limits, travel_mm_q32);
    const bool is_within = state.vel_per_cycle_q32 <= share.vel_per_cycle_q32;
    const int64_t braking_q46 = is_within ? -state.acc_per_cycle2_q32 : 0;
    const int64_t least_q46 = braking_q46 > share.acc_per_cycle2_q32 ? braking_q46 : share.acc_per_cycle2_q32;
    ramp_t ramp;
    if (left_q46 == 0 || !prepare(&ramp, &share, least_q46, share.acc_per_cycle2_q32, &state)) {
        return at[0];
    }
    const int64_t stop_q46 = brake_distance(&ramp, ramp.state.vel_per_cycle_q32, ramp.state.acc_per_cycle2_q32);
    if (stop_q46 > left_q46 && !prepare(&ramp, &ramp.limits, stop_q46, left_q46, &state)) {
        return at[0];
    }
    return fx_clamp(ramp_step(&ramp, &end, RAMP_FIRM), at[0], FADE_FULL);
}

bool fade_step(fade_t *self, const fade_limits_t *limits, q32_t travel_mm_q32, ramp_ref_t ref[POSE_AXES])
{
    const int64_t share_q46 =
        next_share(self, limits, travel_mm_q32 > self->plan_travel_mm_q32 ? travel_mm_q32 : self->plan_travel_mm_q32);
    for (unsigned age = REF_HISTORY - 1; age > 0; age--) {
        self->share_q46[age] = self->share_q46[age - 1];
    }
    self->share_q46[0] = share_q46;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        ref[i] = ref_history_scaled(&ref[i], self->from_q32[i], self->share_q46, FADE_SHIFT);
    }
    return self->share_q46[REF_HISTORY - 1] < FADE_FULL;
}

/* SPDX-License-Identifier: MIT
 * fade.c - fading in; see fade.h.
 */
#include "heave/fade.h"

#include "ref_history.h"

#define ONE_Q58 ((int64_t)1 << 58)
#define SHIFT   58

void fade_begin(fade_t *self, const q32_t *from_q32, const q32_t *from_mm_q32)
{
    *self = (fade_t){.progress_q58 = 0};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->from_q32[i] = from_q32[i];
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->from_mm_q32[i] = from_mm_q32[i];
    }
}

void fade_look(fade_t *self, const q32_t *extension_mm_q32)
{
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const q32_t travel_q32 = fx_abs(extension_mm_q32[i] - self->from_mm_q32[i]);
        self->farthest_mm_q32 = travel_q32 > self->farthest_mm_q32 ? travel_q32 : self->farthest_mm_q32;
    }
}

/* What u may rise by in a cycle: 1.875 du way <= speed, 6 du^2 way <= acceleration. */
static int64_t rise_q58(const fade_t *self, const fade_limits_t *limits)
{
    const int64_t by_time_q58 = ONE_Q58 / (limits->least_cycles > 0 ? limits->least_cycles : 1);
    if (self->farthest_mm_q32 == 0) {
        return by_time_q58;
    }
    const int64_t by_speed_q58 = fx_mul_div(8 * limits->vel_per_cycle_q32, ONE_Q58, 15 * self->farthest_mm_q32);
    const int64_t square_q62 = fx_mul_div(limits->acc_per_cycle2_q32, Q62_ONE, 6 * self->farthest_mm_q32);
    const int64_t by_acc_q58 = (int64_t)fx_sqrt_u64((uint64_t)square_q62) * ((int64_t)1 << (SHIFT - 31));
    const int64_t least_q58 = by_speed_q58 < by_acc_q58 ? by_speed_q58 : by_acc_q58;
    return fx_clamp(least_q58, 1, by_time_q58);
}

int64_t fade_cycles_left(const fade_t *self, const fade_limits_t *limits)
{
    return (ONE_Q58 - self->progress_q58) / rise_q58(self, limits) + 1;
}

static int64_t share_at(int64_t u_q58)
{
    const int64_t u2 = fx_mul_shift(u_q58, u_q58, SHIFT);
    const int64_t u3 = fx_mul_shift(u2, u_q58, SHIFT);
    return fx_mul_shift(u3, 10 * ONE_Q58 - 15 * u_q58 + 6 * u2, SHIFT);
}

bool fade_step(fade_t *self, const fade_limits_t *limits, ramp_ref_t ref[POSE_AXES])
{
    for (unsigned age = REF_HISTORY - 1; age > 0; age--) {
        self->share_q58[age] = self->share_q58[age - 1];
    }
    self->progress_q58 = fx_clamp(self->progress_q58 + rise_q58(self, limits), 0, ONE_Q58);
    self->share_q58[0] = share_at(self->progress_q58);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        q32_t at_q32[REF_HISTORY];
        ref_history_of(&ref[i], at_q32);
        for (unsigned age = 0; age < REF_HISTORY; age++) {
            at_q32[age] = self->from_q32[i] + fx_mul_shift(at_q32[age] - self->from_q32[i], self->share_q58[age], SHIFT);
        }
        ref[i] = ref_history_ref(at_q32);
    }
    return self->share_q58[REF_HISTORY - 1] < ONE_Q58;
}

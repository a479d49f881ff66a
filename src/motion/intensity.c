/* SPDX-License-Identifier: MIT
 * intensity.c - how much of a sender's motion the platform makes; see intensity.h.
 * From 0 to 100 % in N cycles with jerk +, -, -, + for N/4 cycles each: jerk 32 / N^3, acceleration 8 / N^2, speed 2 / N.
 */
#include "heave/intensity.h"

#include "ref_history.h"

static int64_t share_of(unsigned percent)
{
    return INTENSITY_FULL * (int64_t)percent / 100;
}

hv_status_t intensity_init(intensity_t *self, unsigned percent, unsigned max_percent, uint32_t ramp_ms, uint32_t cycle_us)
{
    if (max_percent < 1 || max_percent > 100 || percent > max_percent || ramp_ms < INTENSITY_RAMP_MIN_MS ||
        ramp_ms > INTENSITY_RAMP_MAX_MS || cycle_us < RAMP_CYCLE_MIN_US || cycle_us > RAMP_CYCLE_MAX_US) {
        return HV_ERR_RANGE;
    }
    const int64_t cycles = (int64_t)ramp_ms * 1000 / cycle_us;
    const ramp_limits_t limits = {.pos_min_q32 = 0,
                                  .pos_max_q32 = share_of(max_percent),
                                  .vel_per_cycle_q32 = INTENSITY_FULL / cycles * 2,
                                  .acc_per_cycle2_q32 = INTENSITY_FULL / (cycles * cycles) * 8,
                                  .jerk_per_cycle3_q32 = INTENSITY_FULL * 32 / (cycles * cycles * cycles)};
    *self = (intensity_t){.percent = percent, .max_percent = max_percent};
    const hv_status_t status = ramp_init(&self->ramp, &limits, share_of(percent));
    intensity_place(self);
    return status;
}

hv_status_t intensity_set(intensity_t *self, unsigned percent)
{
    if (percent > self->max_percent) {
        return HV_ERR_RANGE;
    }
    self->percent = percent;
    return HV_OK;
}

void intensity_place(intensity_t *self)
{
    self->ramp.state = (ramp_state_t){.pos_q32 = share_of(self->percent)};
    for (unsigned age = 0; age < REF_HISTORY; age++) {
        self->share_q46[age] = self->ramp.state.pos_q32;
    }
}

void intensity_step(intensity_t *self)
{
    const ramp_ref_t goal = {.pos_q32 = share_of(self->percent)};
    for (unsigned age = REF_HISTORY - 1; age > 0; age--) {
        self->share_q46[age] = self->share_q46[age - 1];
    }
    if (self->share_q46[0] != goal.pos_q32 || !ramp_is_at_rest(&self->ramp)) {
        self->share_q46[0] = ramp_step(&self->ramp, &goal, RAMP_FIRM);
    }
}

q32_t intensity_percent_q32(const intensity_t *self)
{
    return fx_mul_shift(self->share_q46[0], 100 * Q32_ONE, INTENSITY_SHIFT);
}

q16_t intensity_largest_q16(const intensity_t *self)
{
    const int64_t asked_q46 = share_of(self->percent);
    const int64_t largest_q46 = asked_q46 > self->share_q46[0] ? asked_q46 : self->share_q46[0];
    return (q16_t)(largest_q46 >> (INTENSITY_SHIFT - 16));
}

q32_t intensity_scaled(const intensity_t *self, q32_t neutral_q32, q32_t value_q32)
{
    return neutral_q32 + fx_mul_shift(value_q32 - neutral_q32, self->share_q46[0], INTENSITY_SHIFT);
}

q32_t intensity_unscaled(const intensity_t *self, q32_t neutral_q32, q32_t scaled_q32)
{
    const int64_t share_q46 = self->share_q46[0];
    return share_q46 == 0 ? neutral_q32 : neutral_q32 + fx_mul_div(scaled_q32 - neutral_q32, INTENSITY_FULL, share_q46);
}

ramp_ref_t intensity_scale(const intensity_t *self, q32_t neutral_q32, const ramp_ref_t *ref)
{
    return ref_history_scaled(ref, neutral_q32, self->share_q46, INTENSITY_SHIFT);
}

bool intensity_is_still(const intensity_t *self, int64_t planned_q46)
{
    unsigned age = 0;
    while (age < REF_HISTORY && self->share_q46[age] == planned_q46) {
        age++;
    }
    return age == REF_HISTORY;
}

ramp_ref_t intensity_shift(const intensity_t *self, int64_t planned_q46, q32_t travel_q32)
{
    q32_t at_q32[REF_HISTORY];
    for (unsigned age = 0; age < REF_HISTORY; age++) {
        at_q32[age] = fx_mul_shift(travel_q32, self->share_q46[age] - planned_q46, INTENSITY_SHIFT);
    }
    return ref_history_ref(at_q32);
}

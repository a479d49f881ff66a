/* SPDX-License-Identifier: MIT
 * ramp_limits.c - limits of a ramp: from units, what follows from them, and a ramp at rest within them; see heave/ramp.h.
 */
#include "heave/ramp.h"

/* cycle^k in seconds times a value in Q16, in Q32: value * 65536 * (cycle_us / 1e6)^power. */
static q32_t per_cycle(int64_t value_q16, uint32_t cycle_us, unsigned power)
{
    int64_t result = fx_mul_div(value_q16, (int64_t)65536 * cycle_us, 1000000);
    for (unsigned i = 1; i < power; i++) {
        result = fx_mul_div(result, cycle_us, 1000000);
    }
    return result;
}

hv_status_t ramp_limits_from_units(q16_t pos_min_q16, q16_t pos_max_q16, q16_t speed_q16, q16_t accel_q16, int32_t jerk,
                                   uint32_t cycle_us, ramp_limits_t *limits)
{
    if (cycle_us < RAMP_CYCLE_MIN_US || cycle_us > RAMP_CYCLE_MAX_US || pos_min_q16 >= pos_max_q16 || speed_q16 <= 0 ||
        accel_q16 <= 0 || jerk <= 0) {
        return HV_ERR_RANGE;
    }
    const ramp_limits_t converted = {
        .pos_min_q32 = q32_from_q16(pos_min_q16),
        .pos_max_q32 = q32_from_q16(pos_max_q16),
        .vel_per_cycle_q32 = per_cycle(speed_q16, cycle_us, 1),
        .acc_per_cycle2_q32 = per_cycle(accel_q16, cycle_us, 2),
        .jerk_per_cycle3_q32 = per_cycle((int64_t)jerk * Q16_ONE, cycle_us, 3),
    };
    ramp_t probe;
    if (ramp_init(&probe, &converted, converted.pos_min_q32) != HV_OK) {
        return HV_ERR_RANGE;
    }
    *limits = converted;
    return HV_OK;
}

/* acc^3 <= jerk^2 * range / 2: taking acc back from full brake, and what is gained meanwhile, fits into the range. */
static bool fits_in_range(q32_t acc_q32, q32_t jerk_q32, q32_t range_q32)
{
    const q32_t cycles_q16 = fx_mul_div(acc_q32, 65536, jerk_q32);
    const q32_t swing_q32 = fx_mul_shift(fx_mul_shift(acc_q32, cycles_q16, 16), cycles_q16, 16);
    return swing_q32 <= range_q32 / 2;
}

q32_t ramp_safe_acceleration(const ramp_limits_t *limits)
{
    const q32_t jerk_q32 = limits->jerk_per_cycle3_q32;
    const q32_t cycles_q16 = (q32_t)fx_sqrt_u64((uint64_t)fx_mul_div(limits->vel_per_cycle_q32, Q32_ONE, jerk_q32));
    q32_t acc_q32 = fx_clamp(fx_mul_shift(jerk_q32, cycles_q16, 16), 1, limits->acc_per_cycle2_q32);
    const q32_t range_q32 = fx_sub_sat(limits->pos_max_q32, limits->pos_min_q32);
    while (acc_q32 > 1 && !fits_in_range(acc_q32, jerk_q32, range_q32)) {
        acc_q32 -= acc_q32 / 16 + 1;
    }
    return acc_q32;
}

/* Makes the acceleration a whole number of jerks, by taking a little off the acceleration or some off the jerk: the stopping
 * distance is exact then, however few cycles the acceleration takes to rise. */
static void make_acceleration_whole(ramp_t *self)
{
    const int64_t cycles = self->acc_safe_q32 / self->limits.jerk_per_cycle3_q32;
    const q32_t whole_q32 = cycles * self->limits.jerk_per_cycle3_q32;
    if (self->acc_safe_q32 - whole_q32 <= self->acc_safe_q32 / 64) {
        self->acc_cycles = cycles;
        self->acc_safe_q32 = whole_q32;
        return;
    }
    self->acc_cycles = cycles + 1;
    self->limits.jerk_per_cycle3_q32 = self->acc_safe_q32 / self->acc_cycles;
    self->acc_safe_q32 = self->limits.jerk_per_cycle3_q32 * self->acc_cycles;
}

static bool are_limits_possible(const ramp_limits_t *limits)
{
    return limits->pos_min_q32 < limits->pos_max_q32 && limits->vel_per_cycle_q32 > 0 && limits->acc_per_cycle2_q32 > 0 &&
           limits->jerk_per_cycle3_q32 >= RAMP_JERK_MIN_Q32 &&
           limits->vel_per_cycle_q32 / limits->jerk_per_cycle3_q32 <= RAMP_SPEED_PER_JERK_MAX;
}

/* What follows from the limits and a whole acceleration. */
static void derive(ramp_t *self)
{
    const q32_t vel_q32 = self->limits.vel_per_cycle_q32;
    self->per_jerk_q62 = Q62_ONE / self->limits.jerk_per_cycle3_q32;
    self->per_acc_q62 = Q62_ONE / self->acc_safe_q32;
    const q32_t acc_cycles_q32 = fx_mul_shift(self->acc_safe_q32, self->per_jerk_q62, 30);
    const q32_t cycles_q32 = fx_add_sat(fx_mul_shift(vel_q32, self->per_acc_q62, 30), 2 * acc_cycles_q32);
    self->brake_reach_q32 = fx_add_sat(fx_mul_shift(vel_q32, cycles_q32, 32), 4 * vel_q32);
    const int64_t cycles = vel_q32 / self->acc_safe_q32 / 2 + 2 * self->acc_cycles + 8; /* 8 for roundings */
    self->brake_cycles = cycles <= UINT32_MAX && cycles <= INT64_MAX / vel_q32 ? (uint32_t)cycles : 0;
}

hv_status_t ramp_init(ramp_t *self, const ramp_limits_t *limits, q32_t pos_q32)
{
    if (!are_limits_possible(limits)) {
        return HV_ERR_RANGE;
    }
    *self = (ramp_t){.limits = *limits, .state = {.pos_q32 = pos_q32}, .acc_safe_q32 = ramp_safe_acceleration(limits)};
    make_acceleration_whole(self);
    derive(self);
    return HV_OK;
}

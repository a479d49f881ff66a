/* SPDX-License-Identifier: MIT
 * brake.c - stopping distances of a jerk-limited axis in closed form. Pure; no state of its own.
 */
#include "brake.h"

/* Velocity after k cycles of full jerk downwards, before acc reaches -acc_safe. */
static q32_t velocity_after(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32, int64_t k)
{
    return vel_q32 + k * acc_q32 - ramp->limits.jerk_per_cycle3_q32 * (k * (k + 1) / 2);
}

/* Distance covered in those k cycles. */
static q32_t distance_after(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32, int64_t k)
{
    const int64_t pairs = k * (k + 1) / 2;
    return k * vel_q32 + pairs * acc_q32 - ramp->limits.jerk_per_cycle3_q32 * (pairs * (k + 2) / 3);
}

/* The stop that holds -acc_safe for a while, summed cycle by cycle: down to -acc_safe, hold, back to 0. The sum is exact, as
 * whatever is missing in speed here counts with all the cycles of the hold. False where the stop does not get as far as
 * -acc_safe. */
static bool distance_with_hold(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32, q32_t *distance_q32)
{
    const q32_t jerk_q32 = ramp->limits.jerk_per_cycle3_q32;
    const q32_t acc_max_q32 = ramp->acc_safe_q32;
    const int64_t down =
        acc_q32 > -acc_max_q32 ? (acc_q32 + acc_max_q32 + jerk_q32 - 1) / jerk_q32 : 0; /* the last one may be partial */
    const int64_t back = ramp->acc_cycles;
    const q32_t reached_q32 = down > 0 ? velocity_after(ramp, vel_q32, acc_q32, down - 1) - acc_max_q32 : vel_q32;
    const q32_t held_q32 = reached_q32 - jerk_q32 * (back * (back - 1) / 2);
    if (held_q32 < 0) {
        return false;
    }
    const q32_t hold_cycles_q32 = fx_mul_shift(held_q32, ramp->per_acc_q62, 30);
    const q32_t down_way_q32 = down > 0 ? distance_after(ramp, vel_q32, acc_q32, down - 1) + reached_q32 : 0;
    const q32_t back_way_q32 = jerk_q32 * (back * (back - 1) * (back - 2) / 6);
    const q32_t hold_way_q32 = fx_mul_shift(hold_cycles_q32, reached_q32 - held_q32 / 2, 32);
    *distance_q32 = fx_add_sat(hold_way_q32, down_way_q32 + back_way_q32 - held_q32 / 2);
    return true;
}

/* Distance to rest, for states whose velocity is still positive once acc has been taken to 0. */
static q32_t distance_forward(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32)
{
    const q32_t n_q32 = fx_mul_shift(acc_q32, ramp->per_jerk_q62, 30);
    const q32_t gain_q32 = fx_mul_shift(acc_q32, n_q32 - Q32_ONE, 33);
    const q32_t cruise_q32 = vel_q32 + gain_q32;
    q32_t distance_q32;
    if (cruise_q32 <= 0) {
        return 0;
    }
    if (distance_with_hold(ramp, vel_q32, acc_q32, &distance_q32)) {
        return distance_q32;
    }
    const q32_t ratio_q32 = fx_mul_shift(cruise_q32, ramp->per_jerk_q62, 30);
    const q32_t cycles_q16 = (q32_t)fx_sqrt_u64((uint64_t)ratio_q32);
    return fx_mul_shift(cruise_q32, cycles_q16, 16) - cruise_q32 + fx_mul_shift(n_q32, cruise_q32, 32) -
           fx_mul_shift(gain_q32, n_q32 - 2 * Q32_ONE, 32) / 3;
}

/* Velocity left when acc has been taken to 0 with full jerk. */
static q32_t velocity_at_zero_acc(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32)
{
    const q32_t magnitude_q32 = fx_abs(acc_q32);
    const q32_t n_q32 = fx_mul_shift(magnitude_q32, ramp->per_jerk_q62, 30);
    const q32_t gain_q32 = fx_mul_shift(magnitude_q32, n_q32 - Q32_ONE, 33);
    return acc_q32 >= 0 ? vel_q32 + gain_q32 : vel_q32 - gain_q32;
}

q32_t brake_distance(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32)
{
    const q32_t left_q32 = velocity_at_zero_acc(ramp, vel_q32, acc_q32);
    const bool is_forward = left_q32 != 0 ? left_q32 > 0 : vel_q32 >= 0;
    return is_forward ? distance_forward(ramp, vel_q32, acc_q32) : -distance_forward(ramp, -vel_q32, -acc_q32);
}

/* Last of the first `most` cycles in which the velocity is positive: a root of the quadratic, then made exact. */
static int64_t last_rising_cycle(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32, int64_t most)
{
    const q32_t half_q16 = fx_mul_shift(acc_q32, ramp->per_jerk_q62, 46) - 32768;
    const q32_t ratio_q32 = fx_mul_shift(vel_q32, ramp->per_jerk_q62, 29);
    const q32_t square_q32 = fx_add_sat(half_q16 * half_q16, ratio_q32);
    if (square_q32 < 0) {
        return 0;
    }
    const q32_t root_q16 = (q32_t)fx_sqrt_u64((uint64_t)square_q32);
    int64_t k = fx_clamp((half_q16 + root_q16) / 65536 + 1, 0, most);
    for (int step = 0; step < 3 && k > 0; step++) {
        if (velocity_after(ramp, vel_q32, acc_q32, k) > 0) {
            return k;
        }
        k--;
    }
    return velocity_after(ramp, vel_q32, acc_q32, k) > 0 ? k : 0;
}

q32_t brake_peak(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32)
{
    if (vel_q32 <= 0 && acc_q32 <= 0) {
        return 0;
    }
    const q32_t acc_max_q32 = ramp->acc_safe_q32;
    const int64_t ramp_cycles = (acc_q32 + acc_max_q32) / ramp->limits.jerk_per_cycle3_q32;
    const int64_t k = last_rising_cycle(ramp, vel_q32, acc_q32, ramp_cycles);
    q32_t peak_q32 = distance_after(ramp, vel_q32, acc_q32, k);
    if (k == ramp_cycles) { /* still rising: of k = 0 too, as then acc < 0 */
        const q32_t left_q32 = velocity_after(ramp, vel_q32, acc_q32, k);
        const int64_t more = (left_q32 - 1) / acc_max_q32;
        peak_q32 += more * left_q32 - acc_max_q32 * (more * (more + 1) / 2);
    }
    return peak_q32 > 0 ? peak_q32 : 0;
}

q32_t brake_velocity_peak(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32)
{
    const int64_t n = acc_q32 / ramp->limits.jerk_per_cycle3_q32;
    return vel_q32 + n * acc_q32 - ramp->limits.jerk_per_cycle3_q32 * (n * (n + 1) / 2);
}

/* The gain is the largest of the straight lines k acc - J k (k + 1) / 2, so at most their chord from 0 to acc_safe. */
bool brake_keeps_velocity(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32, q32_t most_q32)
{
    const q32_t chord_q32 = fx_shift_down(acc_q32 * (ramp->acc_cycles - 1), 1);
    return vel_q32 + chord_q32 <= most_q32 || brake_velocity_peak(ramp, vel_q32, acc_q32) <= most_q32;
}

q32_t brake_acc_for_velocity_room(const ramp_t *ramp, q32_t room_q32)
{
    const q32_t jerk_q32 = ramp->limits.jerk_per_cycle3_q32;
    const q32_t ratio_q32 = fx_mul_shift(room_q32, ramp->per_jerk_q62, 27); /* 8 room / jerk */
    const int64_t root_q16 = (int64_t)fx_sqrt_u64((uint64_t)ratio_q32 + (uint64_t)Q32_ONE);
    int64_t n = (root_q16 - 65536) / 131072; /* whole cycles of full jerk that fit: exact after at most one step each way */
    while (n > 0 && jerk_q32 * (n * (n + 1) / 2) > room_q32) {
        n--;
    }
    while (jerk_q32 * ((n + 1) * (n + 2) / 2) <= room_q32) {
        n++;
    }
    return (room_q32 + jerk_q32 * (n * (n + 1) / 2)) / (n + 1);
}

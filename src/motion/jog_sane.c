/* SPDX-License-Identifier: MIT
 * jog_sane.c - whether a jog that was loaded may go on; see jog.h.
 */
#include "heave/sane.h"
#include "jog.h"

static bool are_limits_same(const ramp_limits_t *a, const ramp_limits_t *b)
{
    return a->vel_per_cycle_q32 == b->vel_per_cycle_q32 && a->acc_per_cycle2_q32 == b->acc_per_cycle2_q32 &&
           a->jerk_per_cycle3_q32 == b->jerk_per_cycle3_q32;
}

/* A limiter is what its limits make it; only its speed and its bounds are its own. */
static bool is_ramp_sane(const ramp_t *saved, const ramp_limits_t *own)
{
    ramp_limits_t limits = saved->limits;
    ramp_t made;
    limits.acc_per_cycle2_q32 = own->acc_per_cycle2_q32;
    limits.jerk_per_cycle3_q32 = own->jerk_per_cycle3_q32;
    return sane_q32(saved->state.pos_q32) && sane_q32(limits.pos_min_q32) && sane_q32(limits.pos_max_q32) &&
           limits.vel_per_cycle_q32 <= own->vel_per_cycle_q32 && ramp_init(&made, &limits, saved->state.pos_q32) == HV_OK &&
           are_limits_same(&saved->limits, &made.limits) && saved->acc_safe_q32 == made.acc_safe_q32 &&
           saved->acc_cycles == made.acc_cycles && saved->per_jerk_q62 == made.per_jerk_q62 &&
           saved->per_acc_q62 == made.per_acc_q62 && saved->brake_reach_q32 == made.brake_reach_q32 &&
           saved->brake_cycles == made.brake_cycles && fx_abs(saved->state.vel_per_cycle_q32) <= limits.vel_per_cycle_q32 &&
           fx_abs(saved->state.acc_per_cycle2_q32) <= saved->acc_safe_q32 && saved->ref_jerk_q32 >= 0 &&
           sane_q32(saved->ref_jerk_q32) && saved->ref_acc_q32 >= 0 && sane_q32(saved->ref_acc_q32);
}

bool jog_is_sane(const motion_t *saved, const motion_t *prepared)
{
    const jog_t *jog = &saved->jog;
    const uint32_t all = ((1u << saved->cylinders) - 1u) | 1u << AXIS_ANGLE;
    bool is_sane = are_limits_same(&saved->jog_limits.cylinder, &prepared->jog_limits.cylinder) &&
                   saved->jog_limits.deg_per_cycle_q32 == prepared->jog_limits.deg_per_cycle_q32 &&
                   saved->jog_limits.signal_mm_q32 == prepared->jog_limits.signal_mm_q32 &&
                   saved->jog_limits.signal_deg_q32 == prepared->jog_limits.signal_deg_q32 &&
                   saved->jog_limits.signal_mm_per_cycle_q32 == prepared->jog_limits.signal_mm_per_cycle_q32 &&
                   sane_bool(&jog->is_serving) && sane_bool(&jog->is_posed) && sane_bool(&jog->is_excited) &&
                   (!jog->is_excited || excitation_is_sane(&jog->signal)) && (jog->led & ~all) == 0 &&
                   (jog->is_serving || (jog->led == 0 && saved->source != MOTION_JOGGED));
    for (unsigned i = 0; is_sane && i < AXES_MAX; i++) {
        const ramp_limits_t *ride = i == AXIS_ANGLE ? &prepared->axis[AXIS_ANGLE].limits : &prepared->cylinder[i].limits;
        const ramp_limits_t *own = i == AXIS_ANGLE || jog->is_excited ? ride : &prepared->jog_limits.cylinder;
        is_sane = (jog->led >> i & 1u) == 0 || is_ramp_sane(&jog->ramp[i], own);
    }
    return is_sane;
}

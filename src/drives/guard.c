/* SPDX-License-Identifier: MIT
 * guard.c - the last look at a set-point; see guard.h.
 */
#include "heave/guard.h"

drive_guard_t guard_judge(q32_t setpoint_q32, const guard_limits_t *limits)
{
    const q32_t step_q32 = fx_abs(fx_sub_sat(setpoint_q32, limits->from_q32));
    const q32_t lag_q32 = fx_abs(fx_sub_sat(setpoint_q32, limits->actual_q32));
    if (step_q32 > limits->step_max_q32) {
        return (drive_guard_t){.jump_q32 = step_q32, .allowed_q32 = limits->step_max_q32};
    }
    if (limits->window_q32 != 0 && lag_q32 > limits->window_q32) {
        return (drive_guard_t){.lag_q32 = lag_q32, .allowed_q32 = limits->window_q32};
    }
    return (drive_guard_t){.jump_q32 = 0};
}

drive_guard_t guard_out_of_counts(q32_t setpoint_q32, const guard_limits_t *limits)
{
    const q32_t away_q32 = fx_abs(fx_sub_sat(setpoint_q32, limits->actual_q32));
    return (drive_guard_t){.jump_q32 = away_q32 > 0 ? away_q32 : 1, .allowed_q32 = limits->step_max_q32};
}

const char *guard_text(const drive_guard_t *guard)
{
    return guard->jump_q32 != 0 ? "heaved found its set-point to jump, and has not sent it"
                                : "heaved found its set-point too far from its position, and has not sent it";
}

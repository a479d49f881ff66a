/* SPDX-License-Identifier: MIT
 * fault_watch.c - see fault_watch.h.
 */
#include "fault_watch.h"

#include "faults.h"

#define FOLLOWING_TIME_US 20000u
#define OUTSIDE_STROKE_MM 5 /* what a stop gives way, and what a homing switch is off */

/* Keeps whether something is wrong.
 * Returns the fault where it begins. */
static fault_code_t begun(bool *is_wrong, bool is_now, fault_code_t code)
{
    const bool was = *is_wrong;
    *is_wrong = is_now;
    return is_now && !was ? code : FAULT_NONE;
}

fault_code_t fault_watch_bus(fault_watch_t *self, bool is_lost)
{
    return begun(&self->is_bus_lost, is_lost, FAULT_BUS);
}

fault_code_t fault_watch_bus_failing(fault_watch_t *self, bool is_failing)
{
    return begun(&self->is_bus_failing, is_failing, FAULT_BUS_FAILING);
}

fault_code_t fault_watch_channels(fault_watch_t *self, bool is_apart)
{
    return begun(&self->is_estop_apart, is_apart, FAULT_ESTOP_CHANNELS);
}

fault_code_t fault_watch_power(fault_watch_t *self, bool is_failing, uint32_t settle_ms, bool is_down, uint64_t now_us)
{
    if (!is_failing) {
        self->power_since_us = 0;
    } else if (self->power_since_us == 0) {
        self->power_since_us = now_us;
    }
    const bool is_overdue =
        is_failing && settle_ms != 0 && !is_down && now_us - self->power_since_us >= (uint64_t)settle_ms * 1000;
    return begun(&self->is_power_overdue, is_overdue, FAULT_POWER);
}

static bool is_torque_expected(const fault_watch_in_t *in, unsigned i)
{
    return (in->torque >> i & 1u) != 0;
}

/* True where a cylinder has been further from its set-point than allowed for too long. */
static bool has_following_error(fault_watch_t *self, const fault_watch_in_t *in, unsigned i)
{
    const q32_t window_q32 = q32_from_q16(in->settings->following_error_mm_q16);
    if (i >= in->cylinders || window_q32 == 0) {
        return false;
    }
    const bool is_far =
        is_torque_expected(in, i) && fx_abs(in->setpoint_mm_q32[i] - in->feedback.drive[i].actual_mm_q32) > window_q32;
    if (!is_far) {
        self->following_since_us[i] = 0;
    } else if (self->following_since_us[i] == 0) {
        self->following_since_us[i] = in->now_us;
    }
    return is_far && in->now_us - self->following_since_us[i] >= FOLLOWING_TIME_US;
}

/* How far a cylinder stands outside its stroke. */
static q32_t outside_stroke(const fault_watch_in_t *in, unsigned i)
{
    const q32_t actual_q32 = in->feedback.drive[i].actual_mm_q32;
    const q32_t beyond_q32 = fx_sub_sat(actual_q32, q32_from_q16(in->settings->stroke_mm_q16[i]));
    return actual_q32 < 0 ? -actual_q32 : beyond_q32 > 0 ? beyond_q32 : 0;
}

/* True where a drive that is to move for the first time knows its zero, and is where no cylinder can be: with such a scaling the
 * way to the settled extension would be a way into a stop. */
static bool is_outside_stroke(const fault_watch_in_t *in, unsigned i)
{
    const drive_feedback_t *f = &in->feedback.drive[i];
    return in->is_coming_up && i < in->cylinders && f->has_actual && f->is_homed && f->state != DRIVE_HOMING &&
           outside_stroke(in, i) > q32_from_int(OUTSIDE_STROKE_MM);
}

/* What is wrong with a drive, in any state in which it is meant to be up. */
static fault_code_t judge_drive(fault_watch_t *self, const fault_watch_in_t *in, unsigned i)
{
    const drive_state_t state = in->feedback.drive[i].state;
    const bool is_behind = has_following_error(self, in, i);
    if (state == DRIVE_FAULT) {
        const drive_guard_t *guard = &in->feedback.drive[i].guard;
        return !drive_guard_is_found(guard) ? FAULT_DRIVE : guard->jump_q32 != 0 ? FAULT_SETPOINT_JUMP : FAULT_FOLLOWING;
    }
    if (state == DRIVE_OFFLINE) {
        return FAULT_DRIVE_OFFLINE;
    }
    if (is_outside_stroke(in, i)) {
        return FAULT_OUTSIDE_STROKE;
    }
    if (state != DRIVE_ENABLED) {
        return is_torque_expected(in, i) ? FAULT_DRIVE_DROPPED : FAULT_NONE;
    }
    return is_behind ? FAULT_FOLLOWING : FAULT_NONE;
}

fault_t fault_watch_fault_of(const fault_watch_in_t *in, fault_code_t code, unsigned i)
{
    const drive_feedback_t *drive = &in->feedback.drive[i];
    fault_t fault = {.code = code, .axis = (uint8_t)(i + 1u), .at_us = in->now_us};
    if (code == FAULT_OUTSIDE_STROKE) {
        fault.off_q32 = outside_stroke(in, i);
        fault.allowed_q32 = q32_from_int(OUTSIDE_STROKE_MM);
    } else if (code != FAULT_FOLLOWING && code != FAULT_SETPOINT_JUMP) {
        /* one that is disabled again has no fault any more, but may know why */
        fault.device_code = drive->fault_code != 0 ? drive->fault_code : faults_report_of(in->drives, &fault).code;
    } else if (drive_guard_is_found(&drive->guard)) {
        fault.off_q32 = drive->guard.jump_q32 + drive->guard.lag_q32; /* one of them is 0 */
        fault.allowed_q32 = drive->guard.allowed_q32;
    } else if (i < in->cylinders) {
        fault.off_q32 = fx_abs(fx_sub_sat(in->setpoint_mm_q32[i], drive->actual_mm_q32));
        fault.allowed_q32 = q32_from_q16(in->settings->following_error_mm_q16);
    }
    return fault;
}

fault_code_t fault_watch_axis(fault_watch_t *self, const fault_watch_in_t *in, unsigned i)
{
    const fault_code_t was = self->axis_fault[i];
    self->axis_fault[i] = judge_drive(self, in, i);
    return self->axis_fault[i] != was ? self->axis_fault[i] : FAULT_NONE;
}

/* SPDX-License-Identifier: MIT
 * drive_control.c - see drive_control.h.
 */
#include "drive_control.h"

#define ENABLE_TIMEOUT_US    10000000u
#define HOMING_TIMEOUT_US    120000000u
#define UNSENT_MAX_US        100000u /* the drives' own watch is quicker: it knows the period of its bus */
#define AT_SETTLED_WINDOW_MM 1

bool drive_control_is_at_settled(const cycle_t *cycle)
{
    const q32_t *settled_q32 = motion_settled_extension(cycle->motion);
    for (unsigned i = 0; i < cycle->cylinders; i++) {
        if (fx_abs(cycle->feedback.drive[i].actual_mm_q32 - settled_q32[i]) > q32_from_int(AT_SETTLED_WINDOW_MM)) {
            return false;
        }
    }
    return true;
}

bool drive_control_has_fault(const cycle_t *cycle)
{
    return drives_is_failing(cycle->drives) || feedback_has_fault(cycle->feedback);
}

void drive_control_track(const cycle_t *cycle)
{
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    const drive_feedback_t *drive = cycle->feedback.drive;
    for (unsigned i = 0; i < cycle->cylinders; i++) {
        extension_mm_q32[i] = drive[i].actual_mm_q32;
    }
    motion_place(cycle->motion, extension_mm_q32, cycle->settings->has_angle ? drive[cycle->cylinders].actual_mm_q32 : 0);
}

void drive_control_begin(drive_control_t *self, uint64_t now_us)
{
    self->bring_up = BRING_UP_ENABLE;
    self->deadline_us = now_us + ENABLE_TIMEOUT_US;
    self->is_disable_due = false;
}

bool drive_control_is_coming_up(const drive_control_t *self)
{
    return self->bring_up == BRING_UP_ENABLE || self->bring_up == BRING_UP_HOME;
}

bool drive_control_is_leading(const drive_control_t *self)
{
    return !drive_control_is_coming_up(self) && !self->is_tracking;
}

void drive_control_drop(drive_control_t *self, const cycle_t *cycle)
{
    self->bring_up = BRING_UP_IDLE;
    self->is_tracking = true;
    self->is_disable_due = true;
    drive_control_track(cycle);
}

void drive_control_hold(drive_control_t *self, const cycle_t *cycle)
{
    if (drive_control_is_coming_up(self)) {
        drive_control_drop(self, cycle);
    } else {
        motion_stop(cycle->motion);
    }
    self->bring_up = BRING_UP_IDLE;
}

void drive_control_stop(drive_control_t *self, const cycle_t *cycle)
{
    self->bring_up = BRING_UP_IDLE;
    self->is_disable_due = true;
    if (!self->is_tracking) {
        motion_stop(cycle->motion);
    }
}

/* The drives have torque and know their zero: the set-points lead them from here on. */
static void lead(drive_control_t *self, const cycle_t *cycle)
{
    self->bring_up = BRING_UP_MOVE;
    if (self->is_tracking) { /* else it goes on from the motion it is in */
        self->is_tracking = false;
        drive_control_track(cycle);
    }
    motion_settle(cycle->motion);
}

fault_code_t drive_control_bring_up(drive_control_t *self, const cycle_t *cycle)
{
    if (!drive_control_is_coming_up(self)) {
        return FAULT_NONE;
    }
    if (cycle->now_us >= self->deadline_us) {
        return FAULT_DRIVE_TIMEOUT;
    }
    if (feedback_are_all(cycle->feedback, DRIVE_ENABLED, true)) {
        lead(self, cycle);
    } else if (self->bring_up == BRING_UP_ENABLE) {
        self->is_tracking = true;
        if (!feedback_are_all(cycle->feedback, DRIVE_ENABLED, false)) {
            (void)!drives_request(cycle->drives, DRIVES_ENABLE);
        } else if (drives_request(cycle->drives, DRIVES_HOME) == HV_OK) {
            self->bring_up = BRING_UP_HOME;
            self->deadline_us = cycle->now_us + HOMING_TIMEOUT_US;
        }
    }
    return FAULT_NONE;
}

bool drive_control_has_arrived(const drive_control_t *self, const cycle_t *cycle)
{
    return self->bring_up == BRING_UP_MOVE && motion_is_done(cycle->motion);
}

/* It stays due while the drives cannot be asked. */
static void disable(drive_control_t *self, drives_t drives, drives_request_t off)
{
    self->is_disable_due = drives_request(drives, off) == HV_ERR_AGAIN;
}

void drive_control_before_motion(drive_control_t *self, const cycle_t *cycle, drives_request_t off)
{
    if (self->is_tracking) {
        if (self->is_disable_due) { /* first: a drive that follows would take the set-points' way back to actual for a jump */
            disable(self, cycle->drives, off);
        }
        drive_control_track(cycle);
    }
}

void drive_control_after_motion(drive_control_t *self, const cycle_t *cycle, drives_request_t off)
{
    if (self->is_disable_due && motion_is_at_rest(cycle->motion)) {
        disable(self, cycle->drives, off);
        self->is_tracking |= !self->is_disable_due;
    }
}

bool drive_control_accepts_motion(const drive_control_t *self)
{
    return self->unsent_cycles == 0 || self->is_tracking;
}

HV_OWN_FRAME void drive_control_send(drive_control_t *self, const cycle_t *cycle, const motion_output_t *output)
{
    q32_t setpoint_q32[DRIVES_MAX] = {0};
    for (unsigned i = 0; i < cycle->cylinders; i++) {
        setpoint_q32[i] = output->extension_mm_q32[i];
    }
    setpoint_q32[cycle->cylinders] = output->angle_deg_q32;
    const hv_status_t status = drives_send(cycle->drives, cycle->now_us, setpoint_q32);
    self->unsent_cycles = status == HV_OK ? 0 : self->unsent_cycles + 1;
}

bool drive_control_is_bus_stalled(const drive_control_t *self, uint32_t cycle_us)
{
    return self->unsent_cycles * (uint64_t)cycle_us > UNSENT_MAX_US;
}

/* SPDX-License-Identifier: MIT
 * fault_watch.c - see fault_watch.h.
 */
#include "fault_watch.h"

#include "heave/text.h"
#include "actions.h"
#include "service.h"

#define FOLLOWING_TIME_US 20000u
#define OUTSIDE_STROKE_MM 5       /* what a stop gives way, and what a homing switch is off */
#define UNSENT_MAX_US     100000u /* the drives' own watch is quicker: it knows the period of its bus */

void fault_watch_give_up_reset(gateway_t *self)
{
    if (self->reset_until_us != 0) {
        self->reset_until_us = 0;
        hal_log_write(self->io.log, HAL_LOG_WARNING, "reset refused: a new fault or the e-stop came after it");
    }
}

/* Who found it is told where it might be either: what a drive says of itself, and what heaved sees of the same thing. */
static void log_fault(gateway_t *self, const fault_t *fault, const drive_report_t *report)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    const char *unit = fault->axis > kin_cylinders(motion_kin(&self->motion)) ? " deg" : " mm";
    text_put(&text, fault_text(fault->code));
    if (fault->axis != 0) {
        text_put(&text, ", axis ");
        text_put_u32(&text, fault->axis);
    }
    if (fault->device_code != 0) {
        text_put(&text, ", device code 0x");
        text_put_hex(&text, fault->device_code, 4);
    }
    if (fault->device_code != 0 && fault->device_code == report->code) {
        text_put(&text, " (");
        text_put(&text, report->trouble);
        text_put(&text, ")");
    }
    if (fault->allowed_q32 != 0) {
        text_put(&text, ": found by heaved, ");
        text_put_q32(&text, fault->off_q32, 2);
        text_put(&text, unit);
        text_put(&text, " off, allowed ");
        text_put_q32(&text, fault->allowed_q32, 2);
        text_put(&text, unit);
    }
    hal_log_write(self->io.log, HAL_LOG_ERROR, line);
}

/* What the drive of a fault is at; "" where none is concerned. */
drive_report_t fault_watch_report_of(const gateway_t *self, const fault_t *fault)
{
    drive_report_t report = {.phase = "", .trouble = "", .detail = ""};
    if (fault->axis != 0) {
        (void)drives_report(self->io.drives, (uint8_t)(fault->axis - 1u), &report);
    }
    return report;
}

/* A fault begins: all are counted, the first is kept, and the worst reaction wins, also over one that is under way. */
void fault_watch_raise(gateway_t *self, const fault_t *fault)
{
    snapshot_t *s = &self->snapshot;
    const fault_code_t code = fault->code;
    const fault_reaction_t reaction = fault_reaction(code);
    if (self->supervisor.state == STATE_ESTOP && code != FAULT_ESTOP_CHANNELS) { /* that one is of the e-stop itself */
        return;
    }
    s->begun[fault->axis] |= 1u << (unsigned)code;
    s->counters.faults++;
    s->counters.fault[code]++;
    s->fault_last_us[code] = fault->at_us;
    const drive_report_t report = fault_watch_report_of(self, fault);
    log_fault(self, fault, &report);
    if (s->fault.code == FAULT_NONE) {
        s->fault = *fault;
        s->fault_report = report;
    }
    const bool is_worse = reaction > s->reaction;
    s->reaction = is_worse ? reaction : s->reaction;
    if (supervisor_is_latched(&self->supervisor)) {
        if (is_worse && self->supervisor.state == STATE_FAULT) {
            actions_react(self);
        }
    } else {
        actions_event(self, EVENT_FAULT, fault->at_us);
    }
}

/* Nobody hears the set-points any more: a controlled stop would only make them jump when the bus is back. */
void fault_watch_bus(gateway_t *self, bool is_lost, uint64_t now_us)
{
    const bool is_new = is_lost && !self->is_bus_lost && self->supervisor.state != STATE_OFF;
    if (is_new) {
        fault_watch_give_up_reset(self);
        fault_watch_raise(self, &(fault_t){.code = FAULT_BUS, .at_us = now_us});
    }
    self->is_bus_lost = is_lost && self->supervisor.state != STATE_OFF;
    self->is_tracking_actual |= is_lost;
}

/* The set-points are still heard. */
void fault_watch_bus_failing(gateway_t *self, uint64_t now_us)
{
    const bool is_failing = drives_is_failing(self->io.drives) && self->supervisor.state != STATE_OFF;
    if (is_failing && !self->is_bus_failing) {
        fault_watch_give_up_reset(self);
        fault_watch_raise(self, &(fault_t){.code = FAULT_BUS_FAILING, .at_us = now_us});
    }
    self->is_bus_failing = is_failing;
}

bool fault_watch_is_bus_stalled(const gateway_t *self)
{
    return self->unsent_cycles * (uint64_t)self->settings->cycle_us > UNSENT_MAX_US;
}

/* Of a drive, in a state that is not OFF. */
static bool is_torque_expected(const gateway_t *self, unsigned i)
{
    const state_t state = self->supervisor.state;
    if (state == STATE_SERVICE) {
        return service_is_up(&self->service, i);
    }
    return state != STATE_FAULT && state != STATE_ESTOP && self->bring_up != BRING_UP_ENABLE && self->bring_up != BRING_UP_HOME &&
           !self->is_tracking_actual;
}

/* True where a cylinder has been further from its set-point than allowed for too long. */
static bool is_left_behind(gateway_t *self, unsigned i, uint64_t now_us)
{
    const q32_t window_q32 = q32_from_q16(self->settings->following_error_mm_q16);
    if (i >= kin_cylinders(motion_kin(&self->motion)) || window_q32 == 0) {
        return false;
    }
    const bool is_far = is_torque_expected(self, i) &&
                        fx_abs(self->output.extension_mm_q32[i] - self->snapshot.drive[i].actual_mm_q32) > window_q32;
    if (!is_far) {
        self->following_since_us[i] = 0;
    } else if (self->following_since_us[i] == 0) {
        self->following_since_us[i] = now_us;
    }
    return is_far && now_us - self->following_since_us[i] >= FOLLOWING_TIME_US;
}

/* How far a cylinder stands outside its stroke. */
static q32_t outside_stroke(const gateway_t *self, unsigned i)
{
    const q32_t actual_q32 = self->snapshot.drive[i].actual_mm_q32;
    const q32_t beyond_q32 = fx_sub_sat(actual_q32, q32_from_q16(self->settings->stroke_mm_q16[i]));
    return actual_q32 < 0 ? -actual_q32 : beyond_q32 > 0 ? beyond_q32 : 0;
}

/* True where a drive that is to move for the first time knows its zero, and is where no cylinder can be: with such a scaling the
 * way to the settled extension would be a way into a stop. */
static bool is_astray(const gateway_t *self, unsigned i)
{
    const drive_feedback_t *f = &self->snapshot.drive[i];
    return actions_is_coming_up(self) && i < kin_cylinders(motion_kin(&self->motion)) && f->has_actual && f->is_homed &&
           f->state != DRIVE_HOMING && outside_stroke(self, i) > q32_from_int(OUTSIDE_STROKE_MM);
}

/* What is wrong with a drive, in any state in which it is meant to be up. */
static fault_code_t judge_drive(gateway_t *self, unsigned i, uint64_t now_us)
{
    const drive_state_t state = self->snapshot.drive[i].state;
    const bool is_behind = is_left_behind(self, i, now_us);
    if (state == DRIVE_FAULT) {
        const drive_guard_t *guard = &self->snapshot.drive[i].guard;
        return !drive_guard_is_found(guard) ? FAULT_DRIVE : guard->jump_q32 != 0 ? FAULT_SETPOINT_JUMP : FAULT_FOLLOWING;
    }
    if (state == DRIVE_OFFLINE) {
        return FAULT_DRIVE_OFFLINE;
    }
    if (is_astray(self, i)) {
        return FAULT_OUTSIDE_STROKE;
    }
    if (state != DRIVE_ENABLED) {
        return is_torque_expected(self, i) ? FAULT_DRIVE_DROPPED : FAULT_NONE;
    }
    return is_behind ? FAULT_FOLLOWING : FAULT_NONE;
}

/* With how far off an axis is, where heaved has found that. */
static fault_t fault_of(const gateway_t *self, fault_code_t code, unsigned i, uint64_t now_us)
{
    const drive_feedback_t *drive = &self->snapshot.drive[i];
    fault_t fault = {.code = code, .axis = (uint8_t)(i + 1u), .at_us = now_us};
    if (code == FAULT_OUTSIDE_STROKE) {
        fault.off_q32 = outside_stroke(self, i);
        fault.allowed_q32 = q32_from_int(OUTSIDE_STROKE_MM);
    } else if (code != FAULT_FOLLOWING && code != FAULT_SETPOINT_JUMP) {
        /* one that is disabled again has no fault any more, but may know why */
        fault.device_code = drive->fault_code != 0 ? drive->fault_code : fault_watch_report_of(self, &fault).code;
    } else if (drive_guard_is_found(&drive->guard)) {
        fault.off_q32 = drive->guard.jump_q32 + drive->guard.lag_q32; /* one of them is 0 */
        fault.allowed_q32 = drive->guard.allowed_q32;
    } else if (i < kin_cylinders(motion_kin(&self->motion))) {
        fault.off_q32 = fx_abs(fx_sub_sat(self->output.extension_mm_q32[i], drive->actual_mm_q32));
        fault.allowed_q32 = q32_from_q16(self->settings->following_error_mm_q16);
    }
    return fault;
}

void fault_watch_drives(gateway_t *self, uint64_t now_us)
{
    for (unsigned i = 0; i < drives_count(self->io.drives); i++) {
        const fault_code_t code = self->supervisor.state == STATE_OFF ? FAULT_NONE : judge_drive(self, i, now_us);
        const bool is_new = code != FAULT_NONE && code != self->axis_fault[i];
        if (is_new && self->axis_fault[i] == FAULT_NONE) { /* else a drive on its way out of the fault that is reset */
            fault_watch_give_up_reset(self);
        }
        self->axis_fault[i] = code;
        if (is_new) {
            const fault_t fault = fault_of(self, code, i, now_us);
            fault_watch_raise(self, &fault);
        }
    }
}

static void raise_told(gateway_t *self, unsigned axis, uint32_t codes, uint64_t now_us)
{
    for (unsigned code = FAULT_NONE + 1u; codes >> code != 0; code++) {
        if ((codes >> code & 1u) != 0) {
            const fault_t fault = axis != 0 ? fault_of(self, (fault_code_t)code, axis - 1u, now_us)
                                            : (fault_t){.code = (fault_code_t)code, .at_us = now_us};
            fault_watch_give_up_reset(self);
            fault_watch_raise(self, &fault);
        }
    }
}

void fault_watch_told(gateway_t *self, uint64_t now_us)
{
    for (unsigned axis = 0; axis <= DRIVES_MAX; axis++) {
        if (self->told[axis] != 0 && self->supervisor.state != STATE_OFF) {
            raise_told(self, axis, self->told[axis] & ~self->snapshot.begun[axis], now_us);
        }
        self->told[axis] = 0;
    }
}

/* The e-stop is active as long as its channels disagree: they are no reason for another state, but one for another look. */
void fault_watch_channels(gateway_t *self, bool is_apart, uint64_t now_us)
{
    if (is_apart && !self->is_estop_apart) {
        fault_watch_raise(self, &(fault_t){.code = FAULT_ESTOP_CHANNELS, .at_us = now_us});
    }
    self->is_estop_apart = is_apart;
}

/* Who leads the platform down is the program around; here it is only watched that it gets there while there is power left. */
void fault_watch_power(gateway_t *self, bool is_failing, uint64_t now_us)
{
    const state_t state = self->supervisor.state;
    const bool is_down = state == STATE_OFF || state == STATE_SETTLED || supervisor_is_latched(&self->supervisor);
    self->snapshot.is_power_failing = is_failing;
    if (!is_failing) {
        self->power_since_us = 0;
        self->is_power_overdue = false;
    } else if (self->power_since_us == 0) {
        self->power_since_us = now_us;
    }
    const bool is_overdue = is_failing && self->settings->power_settle_ms != 0 && !is_down &&
                            now_us - self->power_since_us >= (uint64_t)self->settings->power_settle_ms * 1000;
    if (is_overdue && !self->is_power_overdue) {
        fault_watch_raise(self, &(fault_t){.code = FAULT_POWER, .at_us = now_us});
    }
    self->is_power_overdue = is_overdue;
}

/* SPDX-License-Identifier: MIT
 * sequencer.c - see sequencer.h. Bringing up: enable the drives (set-points on actual), home those that have no zero, then go to
 * the settled extension at engage speed.
 */
#include "sequencer.h"

#include "auto_engage.h"
#include "fault_watch.h"
#include "faults.h"
#include "actions.h"
#include "service.h"

#define HOMING_TIMEOUT_US  120000000u
#define RESET_TIMEOUT_US   2000000u
#define ABANDON_TIMEOUT_US 3000000u

/* Next step of bringing up, when the last one is complete. */
static void step_bring_up(gateway_t *self, uint64_t now_us)
{
    const bool is_late = actions_is_coming_up(self) && now_us >= self->bring_up_deadline_us;
    if (is_late) {
        actions_raise(self, &(fault_t){.code = FAULT_DRIVE_TIMEOUT, .at_us = now_us});
        return;
    }
    if (self->bring_up == BRING_UP_ENABLE && !feedback_are_all(actions_feedback(self), DRIVE_ENABLED, true)) {
        self->is_tracking_actual = true;
        if (!feedback_are_all(actions_feedback(self), DRIVE_ENABLED, false)) {
            (void)!drives_request(self->io.drives, DRIVES_ENABLE);
        } else if (drives_request(self->io.drives, DRIVES_HOME) == HV_OK) {
            self->bring_up = BRING_UP_HOME;
            self->bring_up_deadline_us = now_us + HOMING_TIMEOUT_US;
        }
    }
    if (actions_is_coming_up(self) && feedback_are_all(actions_feedback(self), DRIVE_ENABLED, true)) {
        self->bring_up = BRING_UP_MOVE;
        if (self->is_tracking_actual) { /* else it goes on from the motion it is in */
            self->is_tracking_actual = false;
            actions_track_actual(self);
        }
        motion_settle(&self->motion);
    }
}

/* The move of HOMING, RISING or SETTLING has arrived. */
static bool is_move_done(const gateway_t *self)
{
    switch (self->supervisor.state) {
    case STATE_HOMING:
        return self->bring_up == BRING_UP_MOVE && motion_is_done(&self->motion);
    case STATE_RISING:
    case STATE_SETTLING:
        return motion_is_done(&self->motion);
    case STATE_OFF:
    case STATE_SETTLED:
    case STATE_NEUTRAL:
    case STATE_ENGAGED:
    case STATE_HOLD:
    case STATE_SERVICE:
    case STATE_FAULT:
    case STATE_ESTOP:
    case STATES:
        break;
    }
    return false;
}

static void give_up_reset(gateway_t *self)
{
    if (self->reset_until_us != 0) {
        self->reset_until_us = 0;
        hal_log_write(self->io.log, HAL_LOG_WARNING, "reset refused: a new fault or the e-stop came after it");
    }
}

/* Drives of which torque is expected, in a state that is not OFF. */
static uint32_t torque_expected(const gateway_t *self)
{
    const state_t state = self->supervisor.state;
    if (state == STATE_SERVICE) {
        return service_up(&self->service);
    }
    const bool is_led = state != STATE_FAULT && state != STATE_ESTOP && !actions_is_coming_up(self) && !self->is_tracking_actual;
    return is_led ? ~0u : 0;
}

static fault_watch_in_t watch_in(const gateway_t *self, uint64_t now_us)
{
    return (fault_watch_in_t){.settings = self->settings,
                              .drives = self->io.drives,
                              .feedback = actions_feedback(self),
                              .setpoint_mm_q32 = self->output.extension_mm_q32,
                              .cylinders = self->snapshot.cylinders,
                              .torque = torque_expected(self),
                              .is_coming_up = actions_is_coming_up(self),
                              .now_us = now_us};
}

static bool is_bus_stalled(const gateway_t *self)
{
    return fault_watch_is_bus_stalled(self->unsent_cycles, self->settings->cycle_us);
}

/* Where nobody hears the set-points any more, a controlled stop would only make them jump when the bus is back. */
static void watch_bus(gateway_t *self, bool is_heard, uint64_t now_us)
{
    const bool is_off = self->supervisor.state == STATE_OFF;
    const bool is_lost = !is_heard || is_bus_stalled(self);
    if (fault_watch_bus(&self->fault_watch, is_lost && !is_off)) {
        give_up_reset(self);
        actions_raise(self, &(fault_t){.code = FAULT_BUS, .at_us = now_us});
    }
    self->is_tracking_actual |= is_lost;
    if (fault_watch_bus_failing(&self->fault_watch, drives_is_failing(self->io.drives) && self->supervisor.state != STATE_OFF)) {
        give_up_reset(self);
        actions_raise(self, &(fault_t){.code = FAULT_BUS_FAILING, .at_us = now_us});
    }
}

static void watch_drives(gateway_t *self, uint64_t now_us)
{
    fault_watch_in_t in = watch_in(self, now_us);
    for (unsigned i = 0; i < in.feedback.count; i++) {
        const bool was_well = self->fault_watch.axis_fault[i] == FAULT_NONE;
        if (self->supervisor.state == STATE_OFF) {
            self->fault_watch.axis_fault[i] = FAULT_NONE;
        } else if (fault_watch_axis(&self->fault_watch, &in, i)) {
            const fault_t fault = fault_watch_fault_of(&in, self->fault_watch.axis_fault[i], i);
            if (was_well) { /* else a drive on its way out of the fault that is reset */
                give_up_reset(self);
            }
            actions_raise(self, &fault);
            in = watch_in(self, now_us); /* it may have led to another state */
        }
    }
}

static void raise_told(gateway_t *self, unsigned axis, uint32_t codes, uint64_t now_us)
{
    const fault_watch_in_t in = watch_in(self, now_us);
    for (unsigned code = FAULT_NONE + 1u; codes >> code != 0; code++) {
        if ((codes >> code & 1u) != 0) {
            const fault_t fault = axis != 0 ? fault_watch_fault_of(&in, (fault_code_t)code, axis - 1u)
                                            : (fault_t){.code = (fault_code_t)code, .at_us = now_us};
            give_up_reset(self);
            actions_raise(self, &fault);
        }
    }
}

/* What gateway_tell_fault() was told and this cycle has not found by itself. */
static void watch_told(gateway_t *self, uint64_t now_us)
{
    for (unsigned axis = 0; axis <= DRIVES_MAX; axis++) {
        if (self->told[axis] != 0 && self->supervisor.state != STATE_OFF) {
            raise_told(self, axis, self->told[axis] & ~self->snapshot.begun[axis], now_us);
        }
        self->told[axis] = 0;
    }
}

/* Who leads the platform down is the program around; here it is only watched that it gets there while there is power left. */
static void watch_power(gateway_t *self, bool is_failing, uint64_t now_us)
{
    const state_t state = self->supervisor.state;
    const bool is_down = state == STATE_OFF || state == STATE_SETTLED || supervisor_is_latched(&self->supervisor);
    self->snapshot.is_power_failing = is_failing;
    if (fault_watch_power(&self->fault_watch, is_failing, self->settings->power_settle_ms, is_down, now_us)) {
        actions_raise(self, &(fault_t){.code = FAULT_POWER, .at_us = now_us});
    }
}

static void read_inputs(gateway_t *self, uint64_t now_us)
{
    uint32_t levels = 0;
    const bool is_read = hal_inputs_read(self->io.inputs, &levels) == HV_OK;
    self->snapshot.is_estop_active = !is_read || (levels & INPUT_ESTOP) != 0;
    if (self->snapshot.is_estop_active) {
        give_up_reset(self);
        actions_event(self, EVENT_ESTOP, now_us);
    }
    /* The e-stop is active as long as its channels disagree: they are no reason for another state, but one for another look. */
    if (is_read && fault_watch_channels(&self->fault_watch, (levels & INPUT_APART) != 0)) {
        actions_raise(self, &(fault_t){.code = FAULT_ESTOP_CHANNELS, .at_us = now_us});
    }
    watch_power(self, is_read ? (levels & INPUT_POWER) != 0 : self->snapshot.is_power_failing, now_us);
}

/* A reset first asks the drives; it takes effect when none of them is in fault any more. */
static void step_reset(gateway_t *self, uint64_t now_us)
{
    if (self->reset_until_us == 0) {
        return;
    }
    if (!actions_is_drive_fault_present(self)) {
        actions_event(self, EVENT_RESET, now_us);
    }
    if (!supervisor_is_latched(&self->supervisor)) {
        self->reset_until_us = 0;
        faults_clear(&self->snapshot);
    } else if (now_us >= self->reset_until_us) {
        self->reset_until_us = 0;
        hal_log_write(self->io.log, HAL_LOG_WARNING, "reset refused: the cause of the fault or the e-stop is still there");
    }
}

/* A shutdown that interrupted homing ends once the drives have stopped, or do not within a few seconds: their own watch has to.
 */
static void step_abandoned(gateway_t *self, uint64_t now_us)
{
    const bool is_abandoned = self->shutdown.is_asked && self->supervisor.state == STATE_HOLD && self->is_tracking_actual;
    if (!is_abandoned || self->is_disable_due) {
        return;
    }
    const feedback_t feedback = actions_feedback(self); /* of drives that answer: others would be a fault */
    if (feedback_count(feedback, DRIVE_DISABLED) == feedback.count || now_us - self->state_since_us >= ABANDON_TIMEOUT_US) {
        actions_event(self, EVENT_SHUTDOWN, now_us);
    }
}

/* Who ends the other master, or resets what it has led to, does not expect that this one raises the platform. */
static void void_auto(gateway_t *self)
{
    if (self->auto_engage.is_due && feedback_has_other_master(actions_feedback(self))) {
        auto_engage_end(&self->auto_engage);
        hal_log_write(self->io.log, HAL_LOG_WARNING,
                      "engage = auto is void: another master is on the bus; an operator has to engage");
    }
}

/* The auto policy, once: brings the platform up as an operator's engage would. */
static void step_auto(gateway_t *self, uint64_t now_us)
{
    void_auto(self);
    const state_t state = self->supervisor.state;
    const bool can_engage = (state == STATE_OFF && !actions_is_drive_fault_present(self)) || state == STATE_SETTLED;
    if (can_engage && auto_engage_is_ready(&self->auto_engage, now_us)) {
        auto_engage_end(&self->auto_engage);
        actions_event(self, EVENT_ENGAGE, now_us);
    } else if (supervisor_is_latched(&self->supervisor)) {
        auto_engage_end(&self->auto_engage); /* after a fault only an operator engages */
    }
}

/* What hands do, and drives that take too long about it. */
static void watch_service(gateway_t *self, uint64_t now_us)
{
    const service_in_t in = actions_service_in(self, now_us);
    const fault_code_t code = service_step(&self->service, &in);
    if (code != FAULT_NONE) {
        actions_raise(self, &(fault_t){.code = code, .at_us = now_us});
    }
}

void sequencer_before_frames(gateway_t *self, uint64_t now_us)
{
    for (unsigned i = 0; i <= DRIVES_MAX; i++) {
        self->snapshot.begun[i] = 0;
    }
    if (self->supervisor.state != self->supervisor.goal) { /* what a cycle changes leads to the goal */
        actions_event(self, EVENT_TICK, now_us);
    }
    const bool is_bus_heard = drives_poll(self->io.drives, now_us, self->snapshot.drive) == HV_OK;
    watch_bus(self, is_bus_heard, now_us);
    watch_drives(self, now_us);
    watch_told(self, now_us);
    read_inputs(self, now_us);
    step_reset(self, now_us);
    step_abandoned(self, now_us);
    step_auto(self, now_us);
    if (self->supervisor.state == STATE_OFF && feedback_are_all(actions_feedback(self), DRIVE_ENABLED, true) &&
        !self->is_disable_due) {
        actions_track_actual(self); /* they may have told where they are in this cycle only */
        actions_event(self, EVENT_DRIVES_READY, now_us);
        self->is_tracking_actual = self->supervisor.state == STATE_OFF;
    }
    step_bring_up(self, now_us);
    if (is_move_done(self)) {
        self->bring_up = BRING_UP_IDLE;
        actions_event(self, EVENT_MOVE_DONE, now_us);
    }
    if (self->supervisor.state == STATE_SERVICE) {
        watch_service(self, now_us);
    }
}

static bool has_passed(uint64_t now_us, uint64_t since_us, uint32_t limit_ms)
{
    return limit_ms != 0 && now_us >= since_us && now_us - since_us >= (uint64_t)limit_ms * 1000;
}

void sequencer_after_frames(gateway_t *self, uint64_t now_us)
{
    const uint64_t end_us = motion_timed_end_us(&self->motion);
    const uint64_t since_us = end_us > self->sender.start_us ? end_us : self->sender.start_us;
    if (has_passed(now_us, since_us, self->settings->silence_hold_ms)) {
        actions_event(self, EVENT_SILENCE_HOLD, now_us);
    }
    if (has_passed(now_us, since_us, self->settings->silence_neutral_ms)) {
        actions_event(self, EVENT_SILENCE_NEUTRAL, now_us);
    }
    if (has_passed(now_us, since_us, self->settings->silence_settle_ms)) {
        actions_event(self, EVENT_SILENCE_SETTLE, now_us);
    }
    if (self->is_tracking_actual) {
        /* torque off first: a drive that follows would take the set-points' way back to actual for a jump */
        if (self->is_disable_due) {
            actions_disable_drives(self);
        }
        actions_track_actual(self);
    }
}

hv_status_t sequencer_request(gateway_t *self, event_t request, uint64_t now_us)
{
    if (request == EVENT_RESET) {
        const bool is_latched = supervisor_is_latched(&self->supervisor);
        const bool is_for_drives = self->supervisor.state == STATE_OFF && actions_is_drive_fault_present(self);
        if (self->snapshot.is_estop_active || (!is_latched && !is_for_drives)) {
            return HV_ERR_STATE;
        }
        (void)!drives_request(self->io.drives, DRIVES_RESET_FAULT);
        self->reset_until_us = is_latched ? now_us + RESET_TIMEOUT_US : 0;
        return HV_OK;
    }
    auto_engage_end(&self->auto_engage);
    self->shutdown.is_asked |= request == EVENT_SHUTDOWN;
    const uint32_t ignored = self->supervisor.ignored[request];
    if (self->shutdown.is_asked && request != EVENT_SHUTDOWN && request != EVENT_HOLD) {
        return HV_ERR_STATE;
    }
    const bool is_going_off = self->is_disable_due || !motion_is_at_rest(&self->motion);
    if (request == EVENT_SERVICE && (is_going_off || actions_is_drive_fault_present(self))) {
        return HV_ERR_STATE; /* it would become a fault at once */
    }
    if (request == EVENT_HOLD && self->supervisor.state == STATE_SERVICE) {
        service_let_go(&self->service, &self->motion);
    }
    if (request == EVENT_SHUTDOWN && actions_is_coming_up(self)) {
        actions_event(self, EVENT_HOLD, now_us); /* homing may take minutes, and who ends heaved has less patience */
        return HV_OK;
    }
    actions_event(self, request, now_us);
    return self->supervisor.ignored[request] == ignored ? HV_OK : HV_ERR_STATE;
}

/* --- Health --- */

/* A person has asked for a reset and nothing moves: drives whose safe-torque-off is a fault to them can only come back where the
 * pulse comes first. */
static bool is_being_reset(const gateway_t *self)
{
    return self->reset_until_us != 0 && !self->snapshot.is_estop_active && feedback_energized(actions_feedback(self), false) == 0;
}

bool sequencer_is_well(const gateway_t *self)
{
    const bool is_state_well = !supervisor_is_latched(&self->supervisor) || is_being_reset(self);
    const bool is_bus_well = !self->fault_watch.is_bus_lost && !drives_is_failing(self->io.drives) && !is_bus_stalled(self);
    const bool is_fault_borne = self->supervisor.state == STATE_OFF || supervisor_is_latched(&self->supervisor);
    return is_state_well && is_bus_well && feedback_is_well(actions_feedback(self), is_fault_borne) && !self->is_late &&
           !self->shutdown.is_overdue;
}

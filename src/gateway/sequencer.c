/* SPDX-License-Identifier: MIT
 * sequencer.c - see sequencer.h. Bringing up: enable the drives (set-points on actual), home those that have no zero, then go to
 * the settled extension at engage speed.
 */
#include "sequencer.h"

#include "actions.h"
#include "auto_engage.h"
#include "drive_control.h"
#include "fault_watch.h"
#include "faults.h"
#include "sender.h"
#include "service.h"
#include "shutdown.h"

#define RESET_TIMEOUT_US   2000000u
#define ABANDON_TIMEOUT_US 3000000u

/* The move of HOMING, RISING or SETTLING has arrived. */
static bool is_move_done(state_t state, const drive_control_t *control, const cycle_t *cycle)
{
    switch (state) {
    case STATE_HOMING:
        return drive_control_has_arrived(control, cycle);
    case STATE_RISING:
    case STATE_SETTLING:
        return motion_is_done(cycle->motion);
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

static void give_up_reset(uint64_t *until_us, hal_log_t log)
{
    if (*until_us != 0) {
        *until_us = 0;
        hal_log_write(log, HAL_LOG_WARNING, "reset refused: a new fault or the e-stop came after it");
    }
}

/* --- Faults --- */

/* Drives of which torque is expected, in a state that is not OFF. */
static uint32_t torque_expected(state_t state, const service_t *service, const drive_control_t *control)
{
    if (state == STATE_SERVICE) {
        return service_up(service);
    }
    const bool is_led = state != STATE_FAULT && state != STATE_ESTOP && drive_control_is_leading(control);
    return is_led ? ~0u : 0;
}

static fault_watch_in_t watch_in(const sequencer_t *self, const cycle_t *cycle)
{
    return (fault_watch_in_t){.settings = cycle->settings,
                              .drives = cycle->drives,
                              .feedback = cycle->feedback,
                              .setpoint_mm_q32 = cycle->output->extension_mm_q32,
                              .cylinders = cycle->cylinders,
                              .torque = torque_expected(self->supervisor.state, &self->service, &self->drive_control),
                              .is_coming_up = drive_control_is_coming_up(&self->drive_control),
                              .now_us = cycle->now_us};
}

/* A fault of no axis, where one has begun. */
static void raise_begun(sequencer_t *self, fault_code_t code, const cycle_t *cycle)
{
    if (code != FAULT_NONE) {
        actions_raise(self, &(fault_t){.code = code, .at_us = cycle->now_us}, cycle);
    }
}

/* Where nobody hears the set-points any more, a controlled stop would only make them jump when the bus is back. */
static void watch_bus(sequencer_t *self, bool is_heard, const cycle_t *cycle)
{
    const bool is_off = self->supervisor.state == STATE_OFF;
    const bool is_lost = !is_heard || drive_control_is_bus_stalled(&self->drive_control, cycle->settings->cycle_us);
    const fault_code_t lost = fault_watch_bus(&self->fault_watch, is_lost && !is_off);
    const fault_code_t failing = fault_watch_bus_failing(&self->fault_watch, drives_is_failing(cycle->drives) && !is_off);
    if (lost != FAULT_NONE || failing != FAULT_NONE) {
        give_up_reset(&self->reset_until_us, cycle->log);
    }
    raise_begun(self, lost, cycle);
    raise_begun(self, failing, cycle);
    self->drive_control.is_tracking |= is_lost;
}

static void watch_drives(sequencer_t *self, const cycle_t *cycle)
{
    fault_watch_in_t in = watch_in(self, cycle);
    for (unsigned i = 0; i < in.feedback.count; i++) {
        const bool was_well = self->fault_watch.axis_fault[i] == FAULT_NONE;
        const bool is_off = self->supervisor.state == STATE_OFF;
        const fault_code_t code = is_off ? FAULT_NONE : fault_watch_axis(&self->fault_watch, &in, i);
        if (is_off) {
            self->fault_watch.axis_fault[i] = FAULT_NONE;
        }
        if (code != FAULT_NONE) {
            const fault_t fault = fault_watch_fault_of(&in, code, i);
            if (was_well) { /* else a drive on its way out of the fault that is reset */
                give_up_reset(&self->reset_until_us, cycle->log);
            }
            actions_raise(self, &fault, cycle);
            in = watch_in(self, cycle); /* it may have led to another state */
        }
    }
}

static void raise_injected(sequencer_t *self, unsigned axis, uint32_t codes, const cycle_t *cycle)
{
    const fault_watch_in_t in = watch_in(self, cycle);
    for (unsigned code = FAULT_NONE + 1u; codes >> code != 0; code++) {
        if ((codes >> code & 1u) != 0) {
            const fault_t fault = axis != 0 ? fault_watch_fault_of(&in, (fault_code_t)code, axis - 1u)
                                            : (fault_t){.code = (fault_code_t)code, .at_us = cycle->now_us};
            give_up_reset(&self->reset_until_us, cycle->log);
            actions_raise(self, &fault, cycle);
        }
    }
}

/* Faults of gateway_inject_fault() that this cycle has not found by itself. */
static void watch_injected(sequencer_t *self, const cycle_t *cycle)
{
    for (unsigned axis = 0; self->has_injected && axis <= DRIVES_MAX; axis++) {
        if (self->injected[axis] != 0 && self->supervisor.state != STATE_OFF) {
            raise_injected(self, axis, self->injected[axis] & ~self->faults.begun[axis], cycle);
        }
        self->injected[axis] = 0;
    }
    self->has_injected = false;
}

/* What cannot be read is an e-stop; of the others it is not known that they have changed. */
static input_levels_t read_inputs(input_levels_t was, hal_inputs_t inputs)
{
    uint32_t levels = 0;
    if (hal_inputs_read(inputs, &levels) != HV_OK) {
        return (input_levels_t){true, was.is_apart, was.is_power_failing};
    }
    return (input_levels_t){(levels & INPUT_ESTOP) != 0, (levels & INPUT_APART) != 0, (levels & INPUT_POWER) != 0};
}

/* Who leads the platform down where the supply fails is the program around; here it is only watched that it gets there while
 * there is power left. */
static void watch_inputs(sequencer_t *self, hal_inputs_t inputs, const cycle_t *cycle)
{
    self->inputs = read_inputs(self->inputs, inputs);
    if (self->inputs.is_estop_active) {
        give_up_reset(&self->reset_until_us, cycle->log);
        actions_event(self, EVENT_ESTOP, cycle);
    }
    /* The e-stop is active as long as its channels disagree: they are no reason for another state, but one for another look. */
    raise_begun(self, fault_watch_channels(&self->fault_watch, self->inputs.is_apart), cycle);
    const state_t state = self->supervisor.state;
    const bool is_down = state == STATE_OFF || state == STATE_SETTLED || supervisor_is_latched(&self->supervisor);
    raise_begun(self,
                fault_watch_power(&self->fault_watch, self->inputs.is_power_failing, cycle->settings->power_settle_ms, is_down,
                                  cycle->now_us),
                cycle);
}

/* --- What takes more than a cycle --- */

/* A reset first asks the drives; it takes effect when none of them is in fault any more. */
static void step_reset(sequencer_t *self, const cycle_t *cycle)
{
    if (self->reset_until_us == 0) {
        return;
    }
    if (!drive_control_has_fault(cycle)) {
        actions_event(self, EVENT_RESET, cycle);
    }
    if (!supervisor_is_latched(&self->supervisor)) {
        self->reset_until_us = 0;
        faults_clear(&self->faults);
    } else if (cycle->now_us >= self->reset_until_us) {
        self->reset_until_us = 0;
        hal_log_write(cycle->log, HAL_LOG_WARNING, "reset refused: the cause of the fault or the e-stop is still there");
    }
}

/* A shutdown that interrupted homing ends once the drives have stopped, or do not within a few seconds: their own watch has to.
 */
static void step_abandoned(sequencer_t *self, const cycle_t *cycle)
{
    const bool is_abandoned = self->shutdown.is_asked && self->supervisor.state == STATE_HOLD && self->drive_control.is_tracking;
    if (!is_abandoned || self->drive_control.is_disable_due) {
        return;
    }
    const feedback_t feedback = cycle->feedback; /* of drives that answer: others would be a fault */
    if (feedback_count(feedback, DRIVE_DISABLED) == feedback.count ||
        cycle->now_us - self->state_since_us >= ABANDON_TIMEOUT_US) {
        actions_event(self, EVENT_SHUTDOWN, cycle);
    }
}

/* Who ends the other master, or resets what it has led to, does not expect that this one raises the platform. */
static void void_auto(auto_engage_t *policy, feedback_t feedback, hal_log_t log)
{
    if (policy->is_due && feedback_has_other_master(feedback)) {
        auto_engage_end(policy);
        hal_log_write(log, HAL_LOG_WARNING, "engage = auto is void: another master is on the bus; an operator has to engage");
    }
}

/* The auto policy, once: brings the platform up as an operator's engage would. */
static void step_auto(sequencer_t *self, const cycle_t *cycle)
{
    void_auto(&self->auto_engage, cycle->feedback, cycle->log);
    const state_t state = self->supervisor.state;
    const bool can_engage = (state == STATE_OFF && !drive_control_has_fault(cycle)) || state == STATE_SETTLED;
    if (can_engage && auto_engage_is_ready(&self->auto_engage, cycle->now_us)) {
        auto_engage_end(&self->auto_engage);
        actions_event(self, EVENT_ENGAGE, cycle);
    } else if (supervisor_is_latched(&self->supervisor)) {
        auto_engage_end(&self->auto_engage); /* after a fault only an operator engages */
    }
}

void sequencer_init(sequencer_t *self, const settings_t *settings)
{
    *self = (sequencer_t){.drive_control = {.is_tracking = true}};
    supervisor_init(&self->supervisor);
    faults_init(&self->faults);
    sequencer_restart_auto(self, settings);
}

void sequencer_restart_auto(sequencer_t *self, const settings_t *settings)
{
    auto_engage_init(&self->auto_engage, settings->engage == ENGAGE_AUTO, settings->cycle_us, settings->auto_frames);
}

void sequencer_start_settled(sequencer_t *self)
{
    supervisor_init_settled(&self->supervisor);
    self->drive_control.is_tracking = false;
    if (auto_engage_is_ready(&self->auto_engage, 0)) {
        auto_engage_end(&self->auto_engage);
        self->supervisor.goal = STATE_ENGAGED;
    }
}

/* --- The cycle --- */

void sequencer_begin(sequencer_t *self, const cycle_t *cycle)
{
    for (unsigned i = 0; i <= DRIVES_MAX; i++) {
        self->faults.begun[i] = 0;
    }
    if (self->supervisor.state != self->supervisor.goal) { /* what a cycle changes leads to the goal */
        actions_event(self, EVENT_TICK, cycle);
    }
}

/* Drives that are up already, as those of a program that was started anew. */
static void watch_ready(sequencer_t *self, const cycle_t *cycle)
{
    if (self->supervisor.state == STATE_OFF && feedback_are_all(cycle->feedback, DRIVE_ENABLED, true) &&
        !self->drive_control.is_disable_due) {
        drive_control_track(cycle); /* they may have told where they are in this cycle only */
        actions_event(self, EVENT_DRIVES_READY, cycle);
        self->drive_control.is_tracking = self->supervisor.state == STATE_OFF;
    }
}

void sequencer_before_frames(sequencer_t *self, const cycle_t *cycle, hal_inputs_t inputs, bool is_bus_heard)
{
    watch_bus(self, is_bus_heard, cycle);
    watch_drives(self, cycle);
    watch_injected(self, cycle);
    watch_inputs(self, inputs, cycle);
    step_reset(self, cycle);
    step_abandoned(self, cycle);
    step_auto(self, cycle);
    watch_ready(self, cycle);
    raise_begun(self, drive_control_bring_up(&self->drive_control, cycle), cycle);
    if (is_move_done(self->supervisor.state, &self->drive_control, cycle)) {
        self->drive_control.bring_up = BRING_UP_IDLE;
        actions_event(self, EVENT_MOVE_DONE, cycle);
    }
    if (self->supervisor.state == STATE_SERVICE) {
        raise_begun(self, service_step(&self->service, cycle), cycle); /* a drive takes too long */
    }
}

/* How the torque goes off where it is due. */
static drives_request_t how_off(state_t state, fault_reaction_t reaction)
{
    const bool is_quick =
        state == STATE_ESTOP || state == STATE_HOLD || (state == STATE_FAULT && reaction >= FAULT_REACT_QUICK_STOP);
    return is_quick ? DRIVES_QUICK_STOP : DRIVES_DISABLE;
}

static bool has_passed(uint64_t now_us, uint64_t since_us, uint32_t limit_ms)
{
    return limit_ms != 0 && now_us >= since_us && now_us - since_us >= (uint64_t)limit_ms * 1000;
}

void sequencer_after_frames(sequencer_t *self, const cycle_t *cycle)
{
    const uint64_t end_us = motion_timed_end_us(cycle->motion);
    const uint64_t since_us = end_us > cycle->sender->start_us ? end_us : cycle->sender->start_us;
    if (has_passed(cycle->now_us, since_us, cycle->settings->silence_hold_ms)) {
        actions_event(self, EVENT_SILENCE_HOLD, cycle);
    }
    if (has_passed(cycle->now_us, since_us, cycle->settings->silence_neutral_ms)) {
        actions_event(self, EVENT_SILENCE_NEUTRAL, cycle);
    }
    if (has_passed(cycle->now_us, since_us, cycle->settings->silence_settle_ms)) {
        actions_event(self, EVENT_SILENCE_SETTLE, cycle);
    }
    drive_control_before_motion(&self->drive_control, cycle, how_off(self->supervisor.state, self->faults.reaction));
}

void sequencer_after_motion(sequencer_t *self, const cycle_t *cycle)
{
    drive_control_after_motion(&self->drive_control, cycle, how_off(self->supervisor.state, self->faults.reaction));
    const shutdown_in_t in = {.feedback = cycle->feedback,
                              .is_down = self->supervisor.state == STATE_OFF || supervisor_is_latched(&self->supervisor),
                              .is_disable_due = self->drive_control.is_disable_due,
                              .is_bus_lost = self->fault_watch.is_bus_lost ||
                                             drive_control_is_bus_stalled(&self->drive_control, cycle->settings->cycle_us)};
    shutdown_step(&self->shutdown, &in, cycle->log, cycle->now_us);
}

hv_status_t sequencer_request(sequencer_t *self, event_t request, const cycle_t *cycle)
{
    if (request == EVENT_RESET) {
        const bool is_latched = supervisor_is_latched(&self->supervisor);
        const bool is_for_drives = self->supervisor.state == STATE_OFF && drive_control_has_fault(cycle);
        if (self->inputs.is_estop_active || (!is_latched && !is_for_drives)) {
            return HV_ERR_STATE;
        }
        (void)!drives_request(cycle->drives, DRIVES_RESET_FAULT);
        self->reset_until_us = is_latched ? cycle->now_us + RESET_TIMEOUT_US : 0;
        return HV_OK;
    }
    auto_engage_end(&self->auto_engage);
    self->shutdown.is_asked |= request == EVENT_SHUTDOWN;
    const uint32_t ignored = self->supervisor.ignored[request];
    if (request == EVENT_HOLD && self->supervisor.state == STATE_SERVICE) {
        service_let_go(&self->service, cycle->motion);
    }
    actions_event(self, request, cycle);
    return self->supervisor.ignored[request] == ignored ? HV_OK : HV_ERR_STATE;
}

/* --- Health --- */

bool sequencer_is_well(const sequencer_t *self, const cycle_t *cycle)
{
    /* A person has asked for a reset and nothing moves: drives whose safe-torque-off is a fault to them can only come back where
     * the pulse comes first. */
    const bool is_being_reset =
        self->reset_until_us != 0 && !self->inputs.is_estop_active && feedback_energized(cycle->feedback, false) == 0;
    const bool is_state_well = !supervisor_is_latched(&self->supervisor) || is_being_reset;
    const bool is_bus_well = !self->fault_watch.is_bus_lost && !drives_is_failing(cycle->drives) &&
                             !drive_control_is_bus_stalled(&self->drive_control, cycle->settings->cycle_us);
    const bool is_fault_borne = self->supervisor.state == STATE_OFF || supervisor_is_latched(&self->supervisor);
    return is_state_well && is_bus_well && feedback_is_well(cycle->feedback, is_fault_borne) && !self->is_late &&
           !self->shutdown.is_overdue;
}

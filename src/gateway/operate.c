/* SPDX-License-Identifier: MIT
 * operate.c - states in deeds: what the gateway sees becomes events, what the supervisor answers becomes motion and requests to
 * drives. Bringing up: enable (set-points on actual), home what has no zero, then go to the settled extension at engage speed.
 */
#include "operate.h"

#include "auto_engage.h"
#include "heave/text.h"
#include "service.h"

#define ENABLE_TIMEOUT_US    10000000u
#define HOMING_TIMEOUT_US    120000000u
#define RESET_TIMEOUT_US     2000000u
#define ABANDON_TIMEOUT_US   3000000u
#define ENERGIZED_TIMEOUT_US 3000000u /* ramps, brakes, a line that has to try again */
#define LOST_TIMEOUT_US      1000000u /* in which a drive may come back and be told */
#define AT_SETTLED_WINDOW_MM 1
#define FOLLOWING_TIME_US    20000u
#define OUTSIDE_STROKE_MM    5       /* what a stop gives way, and what a homing switch is off */
#define UNSENT_MAX_US        100000u /* the drives' own watch is quicker: it knows the period of its bus */

static unsigned drive_count(const gateway_t *self)
{
    return drives_count(self->io.drives);
}

/* True if every drive is in the state and knows where it is. */
static bool are_all(const gateway_t *self, drive_state_t state, bool is_zero_needed)
{
    for (unsigned i = 0; i < drive_count(self); i++) {
        const drive_feedback_t *f = &self->snapshot.drive[i];
        if (f->state != state || !f->has_actual || (is_zero_needed && !f->is_homed)) {
            return false;
        }
    }
    return true;
}

static bool is_at_settled(const gateway_t *self)
{
    const q32_t *settled_q32 = motion_settled_extension(&self->motion);
    for (unsigned i = 0; i < kin_cylinders(motion_kin(&self->motion)); i++) {
        if (fx_abs(self->snapshot.drive[i].actual_mm_q32 - settled_q32[i]) > q32_from_int(AT_SETTLED_WINDOW_MM)) {
            return false;
        }
    }
    return true;
}

/* What a reset would come too early for. */
static bool is_drive_fault_present(const gateway_t *self)
{
    if (drives_is_failing(self->io.drives)) {
        return true;
    }
    for (unsigned i = 0; i < drive_count(self); i++) {
        if (self->snapshot.drive[i].state == DRIVE_FAULT || self->snapshot.drive[i].state == DRIVE_OFFLINE) {
            return true;
        }
    }
    return false;
}

static supervisor_view_t view_of(const gateway_t *self)
{
    return (supervisor_view_t){
        .is_at_settled = is_at_settled(self),
        .is_at_rest = motion_is_at_rest(&self->motion),
        .is_fault_present = is_drive_fault_present(self),
        .is_estop_active = self->snapshot.is_estop_active,
    };
}

static void log_change(gateway_t *self, state_t from, event_t event)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, state_name(from));
    text_put(&text, " -> ");
    text_put(&text, state_name(self->supervisor.state));
    text_put(&text, " (");
    text_put(&text, event_name(event));
    text_put(&text, ")");
    hal_log_write(self->io.log, supervisor_is_latched(&self->supervisor) ? HAL_LOG_ERROR : HAL_LOG_NOTICE, line);
}

/* Set-points on the actual positions. */
static void track_actual(gateway_t *self)
{
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    const unsigned cylinders = kin_cylinders(motion_kin(&self->motion));
    for (unsigned i = 0; i < cylinders; i++) {
        extension_mm_q32[i] = self->snapshot.drive[i].actual_mm_q32;
    }
    motion_place(&self->motion, extension_mm_q32, self->settings.has_angle ? self->snapshot.drive[cylinders].actual_mm_q32 : 0);
}

static void begin_bring_up(gateway_t *self, uint64_t now_us)
{
    self->bring_up = BRING_UP_ENABLE;
    self->bring_up_deadline_us = now_us + ENABLE_TIMEOUT_US;
    self->is_disable_due = false;
}

void operate_follow(gateway_t *self, uint64_t now_us)
{
    self->sender.start_us = now_us;
    self->sender.frame_mask = self->settings.relay_safe_mask;
    confirm_restart(&self->sender.confirm);
    motion_follow(&self->motion);
}

/* Asks the drives to go off; is_disable_due stays while they cannot be asked. */
static void disable_drives(gateway_t *self)
{
    const state_t state = self->supervisor.state;
    const bool is_quick = state == STATE_ESTOP || state == STATE_HOLD ||
                          (state == STATE_FAULT && self->snapshot.reaction >= FAULT_REACT_QUICK_STOP);
    self->is_disable_due = drives_request(self->io.drives, is_quick ? DRIVES_QUICK_STOP : DRIVES_DISABLE) == HV_ERR_AGAIN;
}

/* Set-points on actual, torque off at once. */
static void drop_drives(gateway_t *self)
{
    self->is_tracking_actual = true;
    self->is_disable_due = true;
    track_actual(self);
}

/* The drives are coming up, or home by themselves: no set-point leads them. */
static bool is_coming_up(const gateway_t *self)
{
    return self->bring_up == BRING_UP_ENABLE || self->bring_up == BRING_UP_HOME;
}

/* Stops where it is; drives that are coming up or homing by themselves are told so. */
static void hold(gateway_t *self)
{
    if (is_coming_up(self)) {
        drop_drives(self);
    } else {
        motion_stop(&self->motion);
    }
    self->bring_up = BRING_UP_IDLE;
}

static void stop_and_disable(gateway_t *self)
{
    self->bring_up = BRING_UP_IDLE;
    self->is_disable_due = true;
    if (!self->is_tracking_actual) {
        motion_stop(&self->motion);
    }
}

/* What the worst fault so far asks for. */
static void react(gateway_t *self)
{
    if (self->snapshot.reaction >= FAULT_REACT_QUICK_STOP) {
        self->bring_up = BRING_UP_IDLE;
        drop_drives(self);
    } else {
        stop_and_disable(self);
    }
}

static void carry_out(gateway_t *self, action_t action, uint64_t now_us)
{
    switch (action) {
    case ACTION_HOME:
        begin_bring_up(self, now_us);
        break;
    case ACTION_SETTLE:
        motion_settle(&self->motion);
        break;
    case ACTION_RISE:
        motion_rise(&self->motion);
        break;
    case ACTION_FOLLOW:
        operate_follow(self, now_us);
        break;
    case ACTION_STOP:
        hold(self);
        break;
    case ACTION_OFF:
        stop_and_disable(self);
        break;
    case ACTION_FAULT_STOP:
        react(self);
        break;
    case ACTION_SERVE:
        service_begin(self, !self->is_tracking_actual);
        break;
    case ACTION_ESTOP:
        self->bring_up = BRING_UP_IDLE;
        drop_drives(self);
        break;
    case ACTION_STAY:
    case ACTION_NONE:
        break;
    }
}

void operate_event(gateway_t *self, event_t event, uint64_t now_us)
{
    const state_t before = self->supervisor.state;
    const supervisor_view_t view = view_of(self);
    const action_t action = supervisor_event(&self->supervisor, event, &view);
    if (self->supervisor.state != before) {
        self->state_since_us = now_us;
        self->snapshot.rides += before == STATE_NEUTRAL && self->supervisor.state == STATE_ENGAGED;
        log_change(self, before, event);
    }
    carry_out(self, action, now_us);
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

/* A replay says that the fault was found in this cycle. */
static bool is_told(const gateway_t *self, fault_code_t code, unsigned axis)
{
    return self->supervisor.state != STATE_OFF && (self->told[axis] >> (unsigned)code & 1u) != 0;
}

/* Who asked for a reset did not know of what came after it. */
static void give_up_reset(gateway_t *self)
{
    if (self->reset_until_us != 0) {
        self->reset_until_us = 0;
        hal_log_write(self->io.log, HAL_LOG_WARNING, "reset refused: a new fault or the e-stop came after it");
    }
}

/* What the drive of a fault is at; "" where none is concerned. */
static drive_report_t report_of(const gateway_t *self, const fault_t *fault)
{
    drive_report_t report = {.phase = "", .trouble = "", .detail = ""};
    if (fault->axis != 0) {
        (void)drives_report(self->io.drives, (uint8_t)(fault->axis - 1u), &report);
    }
    return report;
}

/* A fault begins: all are counted, the first is kept, and the worst reaction wins, also over one that is under way. */
static void raise_fault(gateway_t *self, const fault_t *fault)
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
    const drive_report_t report = report_of(self, fault);
    log_fault(self, fault, &report);
    if (s->fault.code == FAULT_NONE) {
        s->fault = *fault;
        s->fault_report = report;
    }
    const bool is_worse = reaction > s->reaction;
    s->reaction = is_worse ? reaction : s->reaction;
    if (supervisor_is_latched(&self->supervisor)) {
        if (is_worse && self->supervisor.state == STATE_FAULT) {
            react(self);
        }
    } else {
        operate_event(self, EVENT_FAULT, fault->at_us);
    }
}

/* Nobody hears the set-points any more: a controlled stop would only make them jump when the bus is back. */
static void watch_bus(gateway_t *self, bool is_lost, uint64_t now_us)
{
    const bool is_new = is_lost && !self->is_bus_lost && self->supervisor.state != STATE_OFF;
    if (is_new || is_told(self, FAULT_BUS, 0)) {
        give_up_reset(self);
        raise_fault(self, &(fault_t){.code = FAULT_BUS, .at_us = now_us});
    }
    self->is_bus_lost = is_lost && self->supervisor.state != STATE_OFF;
    self->is_tracking_actual |= is_lost;
}

/* The set-points are still heard. */
static void watch_failing(gateway_t *self, uint64_t now_us)
{
    const bool is_failing = drives_is_failing(self->io.drives) && self->supervisor.state != STATE_OFF;
    if ((is_failing && !self->is_bus_failing) || is_told(self, FAULT_BUS_FAILING, 0)) {
        give_up_reset(self);
        raise_fault(self, &(fault_t){.code = FAULT_BUS_FAILING, .at_us = now_us});
    }
    self->is_bus_failing = is_failing;
}

bool operate_is_bus_stalled(const gateway_t *self)
{
    return self->unsent_cycles * (uint64_t)self->settings.cycle_us > UNSENT_MAX_US;
}

/* Of a drive, in a state that is not OFF. */
static bool is_torque_expected(const gateway_t *self, unsigned i)
{
    const state_t state = self->supervisor.state;
    if (state == STATE_SERVICE) {
        return service_is_up(self, i);
    }
    return state != STATE_FAULT && state != STATE_ESTOP && self->bring_up != BRING_UP_ENABLE && self->bring_up != BRING_UP_HOME &&
           !self->is_tracking_actual;
}

/* True where a cylinder has been further from its set-point than allowed for too long. */
static bool is_left_behind(gateway_t *self, unsigned i, uint64_t now_us)
{
    const q32_t window_q32 = q32_from_q16(self->settings.following_error_mm_q16);
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
    const q32_t beyond_q32 = fx_sub_sat(actual_q32, q32_from_q16(self->settings.stroke_mm_q16[i]));
    return actual_q32 < 0 ? -actual_q32 : beyond_q32 > 0 ? beyond_q32 : 0;
}

/* True where a drive that is to move for the first time knows its zero, and is where no cylinder can be: with such a scaling the
 * way to the settled extension would be a way into a stop. */
static bool is_astray(const gateway_t *self, unsigned i)
{
    const drive_feedback_t *f = &self->snapshot.drive[i];
    return is_coming_up(self) && i < kin_cylinders(motion_kin(&self->motion)) && f->has_actual && f->is_homed &&
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

/* What a replay says was wrong with a drive, or else what is. */
static fault_code_t find_fault(gateway_t *self, unsigned i, uint64_t now_us)
{
    const fault_code_t judged = judge_drive(self, i, now_us);
    for (unsigned code = FAULT_NONE + 1u; code < FAULT_CODES; code++) {
        if (fault_is_of_axis((fault_code_t)code) && is_told(self, (fault_code_t)code, i + 1)) {
            return (fault_code_t)code;
        }
    }
    return judged;
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
        fault.device_code = drive->fault_code != 0 ? drive->fault_code : report_of(self, &fault).code;
    } else if (drive_guard_is_found(&drive->guard)) {
        fault.off_q32 = drive->guard.jump_q32 + drive->guard.lag_q32; /* one of them is 0 */
        fault.allowed_q32 = drive->guard.allowed_q32;
    } else if (i < kin_cylinders(motion_kin(&self->motion))) {
        fault.off_q32 = fx_abs(fx_sub_sat(self->output.extension_mm_q32[i], drive->actual_mm_q32));
        fault.allowed_q32 = q32_from_q16(self->settings.following_error_mm_q16);
    }
    return fault;
}

static void watch_drives(gateway_t *self, uint64_t now_us)
{
    for (unsigned i = 0; i < drive_count(self); i++) {
        const fault_code_t code = self->supervisor.state == STATE_OFF ? FAULT_NONE : find_fault(self, i, now_us);
        const bool is_new = code != FAULT_NONE && code != self->axis_fault[i];
        if (is_new && self->axis_fault[i] == FAULT_NONE) { /* else a drive on its way out of the fault that is reset */
            give_up_reset(self);
        }
        self->axis_fault[i] = code;
        if (is_new) {
            const fault_t fault = fault_of(self, code, i, now_us);
            raise_fault(self, &fault);
        }
    }
}

/* Next step of bringing up, when the last one is complete. */
static void step_bring_up(gateway_t *self, uint64_t now_us)
{
    const bool is_late = is_coming_up(self) && now_us >= self->bring_up_deadline_us;
    if (is_late || is_told(self, FAULT_DRIVE_TIMEOUT, 0)) {
        raise_fault(self, &(fault_t){.code = FAULT_DRIVE_TIMEOUT, .at_us = now_us});
        return;
    }
    if (self->bring_up == BRING_UP_ENABLE && !are_all(self, DRIVE_ENABLED, true)) {
        self->is_tracking_actual = true;
        if (!are_all(self, DRIVE_ENABLED, false)) {
            (void)!drives_request(self->io.drives, DRIVES_ENABLE);
        } else if (drives_request(self->io.drives, DRIVES_HOME) == HV_OK) {
            self->bring_up = BRING_UP_HOME;
            self->bring_up_deadline_us = now_us + HOMING_TIMEOUT_US;
        }
    }
    if (is_coming_up(self) && are_all(self, DRIVE_ENABLED, true)) {
        self->bring_up = BRING_UP_MOVE;
        if (self->is_tracking_actual) { /* else it goes on from the motion it is in */
            self->is_tracking_actual = false;
            track_actual(self);
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

/* The e-stop is active as long as its channels disagree: they are no reason for another state, but one for another look. */
static void watch_channels(gateway_t *self, bool is_apart, uint64_t now_us)
{
    if ((is_apart && !self->is_estop_apart) || is_told(self, FAULT_ESTOP_CHANNELS, 0)) {
        raise_fault(self, &(fault_t){.code = FAULT_ESTOP_CHANNELS, .at_us = now_us});
    }
    self->is_estop_apart = is_apart;
}

/* Who leads the platform down is the program around; here it is only watched that it gets there while there is power left. */
static void watch_power(gateway_t *self, bool is_failing, uint64_t now_us)
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
    const bool is_overdue = is_failing && self->settings.power_settle_ms != 0 && !is_down &&
                            now_us - self->power_since_us >= (uint64_t)self->settings.power_settle_ms * 1000;
    if ((is_overdue && !self->is_power_overdue) || is_told(self, FAULT_POWER, 0)) {
        raise_fault(self, &(fault_t){.code = FAULT_POWER, .at_us = now_us});
    }
    self->is_power_overdue = is_overdue;
}

static void read_inputs(gateway_t *self, uint64_t now_us)
{
    uint32_t levels = 0;
    const bool is_read = hal_inputs_read(self->io.inputs, &levels) == HV_OK;
    self->snapshot.is_estop_active = !is_read || (levels & INPUT_ESTOP) != 0;
    if (self->snapshot.is_estop_active) {
        give_up_reset(self);
        operate_event(self, EVENT_ESTOP, now_us);
    }
    watch_channels(self, is_read ? (levels & INPUT_APART) != 0 : self->is_estop_apart, now_us);
    watch_power(self, is_read ? (levels & INPUT_POWER) != 0 : self->snapshot.is_power_failing, now_us);
}

/* A reset first asks the drives; it takes effect when none of them is in fault any more. */
static void step_reset(gateway_t *self, uint64_t now_us)
{
    if (self->reset_until_us == 0) {
        return;
    }
    if (!is_drive_fault_present(self)) {
        operate_event(self, EVENT_RESET, now_us);
    }
    if (!supervisor_is_latched(&self->supervisor)) {
        self->reset_until_us = 0;
        self->snapshot.fault = (fault_t){.code = FAULT_NONE};
        self->snapshot.fault_report = report_of(self, &self->snapshot.fault);
        self->snapshot.reaction = FAULT_REACT_NONE;
    } else if (now_us >= self->reset_until_us) {
        self->reset_until_us = 0;
        hal_log_write(self->io.log, HAL_LOG_WARNING, "reset refused: the cause of the fault or the e-stop is still there");
    }
}

/* A shutdown that interrupted homing ends once the drives have stopped, or do not within a few seconds: their own watch has to.
 */
static void step_abandoned(gateway_t *self, uint64_t now_us)
{
    const bool is_abandoned = self->is_shutdown_asked && self->supervisor.state == STATE_HOLD && self->is_tracking_actual;
    if (!is_abandoned || self->is_disable_due) {
        return;
    }
    unsigned down = 0;
    for (unsigned i = 0; i < drive_count(self); i++) {
        down += self->snapshot.drive[i].state == DRIVE_DISABLED; /* one that cannot tell would be a fault */
    }
    if (down == drive_count(self) || now_us - self->state_since_us >= ABANDON_TIMEOUT_US) {
        operate_event(self, EVENT_SHUTDOWN, now_us);
    }
}

/* The auto policy, once: brings the platform up as an operator's engage would. */
static void step_auto(gateway_t *self, uint64_t now_us)
{
    const state_t state = self->supervisor.state;
    const bool can_engage = (state == STATE_OFF && !is_drive_fault_present(self)) || state == STATE_SETTLED;
    if (can_engage && auto_engage_is_ready(&self->auto_engage, now_us)) {
        auto_engage_end(&self->auto_engage);
        operate_event(self, EVENT_ENGAGE, now_us);
    } else if (supervisor_is_latched(&self->supervisor)) {
        auto_engage_end(&self->auto_engage); /* after a fault only an operator engages */
    }
}

/* Those of a cycle. */
static void clear_faults(uint32_t by_axis[DRIVES_MAX + 1u])
{
    for (unsigned i = 0; i <= DRIVES_MAX; i++) {
        by_axis[i] = 0;
    }
}

/* What hands do, and drives that take too long about it. */
static void watch_service(gateway_t *self, uint64_t now_us)
{
    const fault_code_t code = service_step(self, now_us);
    if (code != FAULT_NONE) {
        raise_fault(self, &(fault_t){.code = code, .at_us = now_us});
    }
}

void operate_before_frames(gateway_t *self, uint64_t now_us)
{
    clear_faults(self->snapshot.begun);
    operate_event(self, EVENT_TICK, now_us);
    const bool is_bus_heard = drives_poll(self->io.drives, now_us, self->snapshot.drive) == HV_OK;
    watch_bus(self, !is_bus_heard || operate_is_bus_stalled(self), now_us);
    watch_failing(self, now_us);
    watch_drives(self, now_us);
    read_inputs(self, now_us);
    step_reset(self, now_us);
    step_abandoned(self, now_us);
    step_auto(self, now_us);
    if (self->supervisor.state == STATE_OFF && are_all(self, DRIVE_ENABLED, true) && !self->is_disable_due) {
        track_actual(self); /* they may have told where they are in this cycle only */
        operate_event(self, EVENT_DRIVES_READY, now_us);
        self->is_tracking_actual = self->supervisor.state == STATE_OFF;
    }
    step_bring_up(self, now_us);
    if (is_move_done(self)) {
        self->bring_up = BRING_UP_IDLE;
        operate_event(self, EVENT_MOVE_DONE, now_us);
    }
    if (self->supervisor.state == STATE_SERVICE) {
        watch_service(self, now_us);
    }
    clear_faults(self->told);
}

static bool has_passed(uint64_t now_us, uint64_t since_us, uint32_t limit_ms)
{
    return limit_ms != 0 && now_us >= since_us && now_us - since_us >= (uint64_t)limit_ms * 1000;
}

void operate_after_frames(gateway_t *self, uint64_t now_us)
{
    const uint64_t end_us = motion_timed_end_us(&self->motion);
    const uint64_t since_us = end_us > self->sender.start_us ? end_us : self->sender.start_us;
    if (has_passed(now_us, since_us, self->settings.silence_hold_ms)) {
        operate_event(self, EVENT_SILENCE_HOLD, now_us);
    }
    if (has_passed(now_us, since_us, self->settings.silence_neutral_ms)) {
        operate_event(self, EVENT_SILENCE_NEUTRAL, now_us);
    }
    if (has_passed(now_us, since_us, self->settings.silence_settle_ms)) {
        operate_event(self, EVENT_SILENCE_SETTLE, now_us);
    }
    if (self->is_tracking_actual) {
        /* torque off first: a drive that follows would take the set-points' way back to actual for a jump */
        if (self->is_disable_due) {
            disable_drives(self);
        }
        track_actual(self);
    }
}

hv_status_t operate_request(gateway_t *self, event_t request, uint64_t now_us)
{
    if (request == EVENT_RESET) {
        const bool is_latched = supervisor_is_latched(&self->supervisor);
        const bool is_for_drives = self->supervisor.state == STATE_OFF && is_drive_fault_present(self);
        if (self->snapshot.is_estop_active || (!is_latched && !is_for_drives)) {
            return HV_ERR_STATE;
        }
        (void)!drives_request(self->io.drives, DRIVES_RESET_FAULT);
        self->reset_until_us = is_latched ? now_us + RESET_TIMEOUT_US : 0;
        return HV_OK;
    }
    auto_engage_end(&self->auto_engage);
    self->is_shutdown_asked |= request == EVENT_SHUTDOWN;
    const uint32_t ignored = self->supervisor.ignored[request];
    if (self->is_shutdown_asked && request != EVENT_SHUTDOWN && request != EVENT_HOLD) {
        return HV_ERR_STATE;
    }
    const bool is_going_off = self->is_disable_due || !motion_is_at_rest(&self->motion);
    if (request == EVENT_SERVICE && (is_going_off || is_drive_fault_present(self))) {
        return HV_ERR_STATE; /* it would become a fault at once */
    }
    if (request == EVENT_HOLD && self->supervisor.state == STATE_SERVICE) {
        service_let_go(self);
    }
    if (request == EVENT_SHUTDOWN && is_coming_up(self)) {
        operate_event(self, EVENT_HOLD, now_us); /* homing may take minutes, and who ends heaved has less patience */
        return HV_OK;
    }
    operate_event(self, request, now_us);
    return self->supervisor.ignored[request] == ignored ? HV_OK : HV_ERR_STATE;
}

void operate_after_motion(gateway_t *self)
{
    if (self->is_disable_due && motion_is_at_rest(&self->motion)) {
        disable_drives(self);
        self->is_tracking_actual |= !self->is_disable_due;
    }
}

/* --- Health --- */

/* A person has asked for a reset and nothing moves: drives whose safe-torque-off is a fault to them can only come back where the
 * pulse comes first. */
static bool is_being_reset(const gateway_t *self)
{
    return self->reset_until_us != 0 && !self->snapshot.is_estop_active && operate_energized(self, false) == 0;
}

/* In OFF, and while they are reset, drives may be in fault: they have no torque. */
static bool are_drives_well(const gateway_t *self)
{
    const bool is_fault_borne = self->supervisor.state == STATE_OFF || supervisor_is_latched(&self->supervisor);
    for (unsigned i = 0; i < drive_count(self); i++) {
        const drive_state_t state = self->snapshot.drive[i].state;
        if (state == DRIVE_OFFLINE || (state == DRIVE_FAULT && !is_fault_borne)) {
            return false;
        }
    }
    return true;
}

bool operate_is_well(const gateway_t *self)
{
    const bool is_state_well = !supervisor_is_latched(&self->supervisor) || is_being_reset(self);
    const bool is_bus_well = !self->is_bus_lost && !drives_is_failing(self->io.drives) && !operate_is_bus_stalled(self);
    return is_state_well && is_bus_well && are_drives_well(self) && !self->is_late && !self->is_end_overdue;
}

/* --- The end --- */

uint32_t operate_energized(const gateway_t *self, bool is_answering)
{
    uint32_t axes = 0;
    for (unsigned i = 0; i < drive_count(self); i++) {
        const drive_feedback_t *f = &self->snapshot.drive[i];
        if (f->is_energized && (!is_answering || f->state != DRIVE_OFFLINE)) {
            axes |= 1u << i;
        }
    }
    return axes;
}

/* A lost bus tells drives nothing: their own watch has to. */
static bool are_drives_told(const gateway_t *self)
{
    return !self->is_disable_due || self->is_bus_lost || operate_is_bus_stalled(self);
}

static void log_energized(const gateway_t *self, uint32_t axes)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "not confirmed that the torque is off: axis");
    const char *before = " ";
    for (unsigned i = 0; i < drive_count(self); i++) {
        if ((axes >> i & 1u) != 0) {
            text_put(&text, before);
            text_put_u32(&text, i + 1u);
            before = ", ";
        }
    }
    hal_log_write(self->io.log, HAL_LOG_ERROR, line);
}

void operate_watch_end(gateway_t *self, uint64_t now_us)
{
    const bool is_down = self->supervisor.state == STATE_OFF || supervisor_is_latched(&self->supervisor);
    if (!self->is_shutdown_asked || !is_down || !are_drives_told(self)) {
        self->end_since_us = 0;
        return;
    }
    self->end_since_us = self->end_since_us != 0 ? self->end_since_us : now_us;
    const uint32_t axes = operate_energized(self, false);
    const bool can_confirm = !self->is_disable_due && operate_energized(self, true) != 0;
    const uint32_t most_us = can_confirm ? ENERGIZED_TIMEOUT_US : LOST_TIMEOUT_US;
    if (axes != 0 && !self->is_end_overdue && now_us - self->end_since_us >= most_us) {
        self->is_end_overdue = true;
        log_energized(self, axes);
    }
}

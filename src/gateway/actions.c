/* SPDX-License-Identifier: MIT
 * actions.c - offers events to the supervisor and carries out its actions: motion, and requests to the drives.
 */
#include "actions.h"

#include "heave/text.h"
#include "faults.h"
#include "sender.h"

#define ENABLE_TIMEOUT_US    10000000u
#define AT_SETTLED_WINDOW_MM 1

feedback_t actions_feedback(const gateway_t *self)
{
    return (feedback_t){self->snapshot.drive, self->snapshot.cylinders + (self->snapshot.has_angle ? 1u : 0u)};
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
bool actions_is_drive_fault_present(const gateway_t *self)
{
    return drives_is_failing(self->io.drives) || feedback_has_fault(actions_feedback(self));
}

static supervisor_view_t view_of(const gateway_t *self)
{
    return (supervisor_view_t){
        .is_at_settled = is_at_settled(self),
        .is_at_rest = motion_is_at_rest(&self->motion),
        .is_fault_present = actions_is_drive_fault_present(self),
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
void actions_track_actual(gateway_t *self)
{
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    const unsigned cylinders = kin_cylinders(motion_kin(&self->motion));
    for (unsigned i = 0; i < cylinders; i++) {
        extension_mm_q32[i] = self->snapshot.drive[i].actual_mm_q32;
    }
    motion_place(&self->motion, extension_mm_q32, self->settings->has_angle ? self->snapshot.drive[cylinders].actual_mm_q32 : 0);
}

static void begin_bring_up(gateway_t *self, uint64_t now_us)
{
    self->bring_up = BRING_UP_ENABLE;
    self->bring_up_deadline_us = now_us + ENABLE_TIMEOUT_US;
    self->is_disable_due = false;
}

void actions_follow(gateway_t *self, uint64_t now_us)
{
    sender_restart(&self->sender, self->settings->relay_safe_mask, now_us);
    motion_follow(&self->motion);
}

/* Asks the drives to go off; is_disable_due stays while they cannot be asked. */
void actions_disable_drives(gateway_t *self)
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
    actions_track_actual(self);
}

/* The drives are coming up, or home by themselves: no set-point leads them. */
bool actions_is_coming_up(const gateway_t *self)
{
    return self->bring_up == BRING_UP_ENABLE || self->bring_up == BRING_UP_HOME;
}

/* Stops where it is; drives that are coming up or homing by themselves are told so. */
static void hold(gateway_t *self)
{
    if (actions_is_coming_up(self)) {
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

service_in_t actions_service_in(gateway_t *self, uint64_t now_us)
{
    return (service_in_t){.settings = self->settings,
                          .drives = self->io.drives,
                          .motion = &self->motion,
                          .feedback = actions_feedback(self),
                          .cylinders = self->snapshot.cylinders,
                          .now_us = now_us};
}

static void serve(gateway_t *self, uint64_t now_us)
{
    const service_in_t in = actions_service_in(self, now_us);
    service_begin(&self->service, &in, !self->is_tracking_actual);
    self->is_tracking_actual = false;
}

void actions_raise(gateway_t *self, const fault_t *fault)
{
    const state_t state = self->supervisor.state;
    if (state == STATE_ESTOP && fault->code != FAULT_ESTOP_CHANNELS) { /* that one is of the e-stop itself */
        return;
    }
    const bool is_worse = faults_note(&self->snapshot, fault, self->io.drives, self->io.log);
    if (!supervisor_is_latched(&self->supervisor)) {
        actions_event(self, EVENT_FAULT, fault->at_us);
    } else if (is_worse && state == STATE_FAULT) {
        react(self);
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
        actions_follow(self, now_us);
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
        serve(self, now_us);
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

void actions_event(gateway_t *self, event_t event, uint64_t now_us)
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

void actions_after_motion(gateway_t *self)
{
    if (self->is_disable_due && motion_is_at_rest(&self->motion)) {
        actions_disable_drives(self);
        self->is_tracking_actual |= !self->is_disable_due;
    }
}

/* SPDX-License-Identifier: MIT
 * actions.c - offers events to the supervisor and carries out its actions: motion, and requests to the drives.
 */
#include "actions.h"

#include "heave/text.h"
#include "drive_control.h"
#include "faults.h"
#include "sender.h"
#include "service.h"

static void log_change(hal_log_t log, state_t from, state_t to, event_t event)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, state_name(from));
    text_put(&text, " -> ");
    text_put(&text, state_name(to));
    text_put(&text, " (");
    text_put(&text, event_name(event));
    text_put(&text, ")");
    hal_log_write(log, to == STATE_FAULT || to == STATE_ESTOP ? HAL_LOG_ERROR : HAL_LOG_NOTICE, line);
}

void actions_follow(const cycle_t *cycle)
{
    sender_restart(cycle->sender, cycle->settings->relay_safe_mask, cycle->now_us);
    motion_follow(cycle->motion);
}

/* What the worst fault so far asks for. */
static void react(drive_control_t *control, fault_reaction_t reaction, const cycle_t *cycle)
{
    if (reaction >= FAULT_REACT_QUICK_STOP) {
        drive_control_drop(control, cycle);
    } else {
        drive_control_stop(control, cycle);
    }
}

void actions_raise(sequencer_t *self, const fault_t *fault, const cycle_t *cycle)
{
    const state_t state = self->supervisor.state;
    if (state == STATE_ESTOP && fault->code != FAULT_ESTOP_CHANNELS) { /* that one is of the e-stop itself */
        return;
    }
    const bool is_worse = faults_note(&self->faults, fault, cycle->drives, cycle->cylinders, cycle->log);
    if (!supervisor_is_latched(&self->supervisor)) {
        actions_event(self, EVENT_FAULT, cycle);
    } else if (is_worse && state == STATE_FAULT) {
        react(&self->drive_control, self->faults.reaction, cycle);
    }
}

static void carry_out(sequencer_t *self, action_t action, const cycle_t *cycle)
{
    switch (action) {
    case ACTION_HOME:
        drive_control_begin(&self->drive_control, cycle->now_us);
        break;
    case ACTION_SETTLE:
        motion_settle(cycle->motion);
        break;
    case ACTION_RISE:
        motion_rise(cycle->motion);
        break;
    case ACTION_FOLLOW:
        actions_follow(cycle);
        break;
    case ACTION_STOP:
        drive_control_hold(&self->drive_control, cycle);
        break;
    case ACTION_OFF:
        drive_control_stop(&self->drive_control, cycle);
        break;
    case ACTION_FAULT_STOP:
        react(&self->drive_control, self->faults.reaction, cycle);
        break;
    case ACTION_SERVE:
        service_begin(&self->service, cycle, !self->drive_control.is_tracking);
        self->drive_control.is_tracking = false;
        break;
    case ACTION_ESTOP:
        drive_control_drop(&self->drive_control, cycle);
        break;
    case ACTION_STAY:
    case ACTION_NONE:
        break;
    }
}

supervisor_view_t actions_view(const sequencer_t *self, const cycle_t *cycle)
{
    return (supervisor_view_t){.is_at_settled = drive_control_is_at_settled(cycle),
                               .is_at_rest = motion_is_at_rest(cycle->motion),
                               .is_fault_present = drive_control_has_fault(cycle),
                               .is_estop_active = self->inputs.is_estop_active,
                               .is_going_off = self->drive_control.is_disable_due,
                               .is_coming_up = drive_control_is_coming_up(&self->drive_control),
                               .withheld = self->withheld | (self->shutdown.is_asked ? PERMIT_RUNNING : 0u)};
}

void actions_event(sequencer_t *self, event_t event, const cycle_t *cycle)
{
    const state_t before = self->supervisor.state;
    const supervisor_view_t view = actions_view(self, cycle);
    const action_t action = supervisor_event(&self->supervisor, event, &view);
    if (self->supervisor.state != before) {
        self->state_since_us = cycle->now_us;
        self->rides += before == STATE_NEUTRAL && self->supervisor.state == STATE_ENGAGED;
        log_change(cycle->log, before, self->supervisor.state, event);
    }
    carry_out(self, action, cycle);
}

/* SPDX-License-Identifier: MIT
 * cia402_loss.c - one drive is lost, or refused; see cia402_loss.h.
 */
#include "cia402_loss.h"

#include "cia402_node.h"

void cia402_axis_enter(cia402_drive_t drive, cia402_phase_t phase)
{
    drive.axis->phase = phase;
    drive.axis->phase_us = drive.now_us;
}

void cia402_axis_look_for(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    cia402_axis_enter(drive, CIA402_MISSING);
    self->setup.job = CIA402_JOB_NONE;
    self->has_heartbeat = false;
    self->has_actual = false;
    self->has_answered = false;
    self->answered = 0;
    self->goal = CIA402_GOAL_OFF;
    self->word = 0;
    sdo_cancel(&self->sdo);
    if (drive.own->channel == 0) {
        sdo_read(&self->sdo, 0x1000, 0, 1);
    }
}

/* An error that the drive told of and has not taken back may be why it does not become, or stay, operational. */
void cia402_axis_note_trouble(cia402_drive_t drive, cia402_trouble_t why)
{
    const drive_emergency_t *emergency = &drive.axis->emergency;
    const bool is_reason = !emergency->is_over && (why == CIA402_NO_START || why == CIA402_LEFT_OPERATIONAL);
    drive.axis->trouble = why;
    drive.axis->trouble_us = drive.now_us;
    drive.axis->trouble_object = 0;
    drive.axis->has_found = false;
    drive.axis->trouble_code = is_reason ? emergency->code : 0;
}

void cia402_axis_lose_alone(cia402_drive_t drive, cia402_trouble_t why)
{
    cia402_axis_t *self = drive.axis;
    const bool may_hear = self->phase == CIA402_UP && why != CIA402_REBOOTED && why != CIA402_LOST_BUS;
    cia402_axis_note_trouble(drive, why);
    self->is_answering = self->is_answering && (why == CIA402_REBOOTED || why == CIA402_LEFT_OPERATIONAL);
    self->mute_object = 0;
    self->is_in = false;
    self->is_homed = drive.own->homing_method == 0;
    self->homing = CIA402_HOMING_NO;
    self->own_fault = 0;
    self->guard = (drive_guard_t){.jump_q32 = 0};
    self->error_code = 0;
    self->reset_syncs = 0;
    self->reset_until_us = 0;
    self->is_reset_done = why == CIA402_REBOOTED;
    self->starts = 0;
    if (may_hear) {
        cia402_axis_enter(drive, CIA402_LEAVING);
        self->goal = CIA402_GOAL_STOP;
    } else {
        cia402_axis_look_for(drive);
    }
}

/* The others of its node; one that is refused stays so. What is wrong with this one alone those that are up see in their next
 * step, so that this one is the first to be named. */
static void lose_others(cia402_drive_t drive, cia402_trouble_t why)
{
    const cia402_phase_t last = why == CIA402_LOST_NODE ? CIA402_CONFIGURED : CIA402_UP;
    for (unsigned k = 0; k < drive.config->axes; k++) {
        const cia402_drive_t other = cia402_node_drive(drive, k);
        const bool is_up = other.axis->phase >= CIA402_CONFIGURING && other.axis->phase <= last;
        if (other.axis != drive.axis && other.own->node == drive.own->node && is_up) {
            cia402_axis_lose_alone(other, why);
        }
    }
}

/* What one axis has lost alone is not what is wrong with the others. */
void cia402_axis_lose(cia402_drive_t drive, cia402_trouble_t why)
{
    cia402_axis_lose_alone(drive, why);
    lose_others(drive, why == CIA402_LOST_TPDO || why == CIA402_NO_ANSWER ? CIA402_LOST_NODE : why);
}

/* Cannot be used until it boots or the operator resets. */
void cia402_axis_reject(cia402_drive_t drive, cia402_trouble_t why)
{
    drive.axis->setup.job = CIA402_JOB_NONE;
    sdo_cancel(&drive.axis->sdo);
    cia402_axis_note_trouble(drive, why);
    cia402_axis_enter(drive, CIA402_REFUSED);
}

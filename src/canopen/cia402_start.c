/* SPDX-License-Identifier: MIT
 * cia402_start.c - one drive from missing to up; see cia402_start.h.
 */
#include "cia402_start.h"

#include "cia402_loss.h"
#include "cia402_map.h"
#include "cia402_node.h"
#include "cia402_setup.h"
#include "cia402_watch.h"

#define OPERATIONAL_US 500000u   /* and three heartbeats: after NMT start, until the first TPDO */
#define RESET_ASKED_US 20000000u /* a reset counts for so long */
#define RESTARTS_MAX   2u
#define NMT_START      0x01u
#define NMT_PREOP      0x80u
#define NMT_RESET      0x82u

/* The drive answers again. It fell silent when it was asked for an object: once may have been the bus. */
static bool is_mute_again(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const uint32_t object = self->mute_object;
    self->mute_object = 0;
    if (object == 0) {
        return false;
    }
    self->trouble = CIA402_NO_ANSWER;
    self->trouble_object = object;
    self->mutes++;
    return self->mutes >= RESTARTS_MAX;
}

static void begin_setup(cia402_drive_t drive)
{
    const unsigned k = (unsigned)(drive.own - drive.config->axis);
    cia402_axis_enter(drive, CIA402_CONFIGURING);
    drive.axis->hides_mode = false;
    cia402_setup_begin(drive.axis, CIA402_JOB_SETUP, cia402_mode(drive.config, k), drive.now_us);
}

/* A channel beyond the first follows when the first, and with it the node, is set up. */
static void step_waiting(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const cia402_axis_t *first = cia402_node_first(drive);
    self->is_answering = first->is_answering;
    if (first->phase != CIA402_CONFIGURED) {
        return;
    }
    self->trouble = self->trouble == CIA402_SILENT ? CIA402_TROUBLE_NONE : self->trouble;
    begin_setup(drive);
}

/* The node answers again: those of its axes at which it fell silent.
 * Returns true where one of them is refused for it. */
static bool judge_mutes(cia402_drive_t drive)
{
    bool is_any = false;
    for (unsigned k = 0; k < drive.config->axes; k++) {
        const cia402_drive_t other = cia402_node_drive(drive, k);
        if (other.own->node == drive.own->node && other.axis->phase == CIA402_MISSING && is_mute_again(other)) {
            cia402_axis_enter(other, CIA402_REFUSED);
            is_any = true;
        }
    }
    return is_any;
}

void cia402_start_missing(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    if (drive.own->channel > 0) {
        step_waiting(drive);
        return;
    }
    if (self->sdo.state == SDO_SILENT) {
        self->is_answering = false;
        self->mute_object = 0;
        if (self->trouble == CIA402_TROUBLE_NONE || self->trouble == CIA402_NO_ANSWER) {
            cia402_axis_note_trouble(drive, CIA402_SILENT);
        }
        sdo_read(&self->sdo, 0x1000, 0, 1);
    } else if (self->sdo.state == SDO_DONE || self->sdo.state == SDO_ABORTED) {
        self->is_answering = true;
        if (judge_mutes(drive)) {
            self->is_reset_done = true; /* a boot-up would begin everything anew */
        }
        if (self->phase == CIA402_REFUSED) {
            return;
        }
        self->trouble = self->trouble == CIA402_SILENT ? CIA402_TROUBLE_NONE : self->trouble;
        if (drive.config->is_reset_wanted && !self->is_reset_done) {
            self->nmt_command = NMT_RESET;
            cia402_axis_enter(drive, CIA402_RESETTING);
        } else {
            self->nmt_command = NMT_PREOP;
            self->has_heartbeat = false;
            begin_setup(drive);
        }
    }
}

/* Whether it is the object or the drive, the next question tells. */
void cia402_start_lose_at_object(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const uint32_t object = cia402_setup_object(self, drive.config, drive.own);
    const bool is_same = self->trouble == CIA402_NO_ANSWER && self->trouble_object == object;
    cia402_axis_lose(drive, is_same ? CIA402_NO_ANSWER : CIA402_SILENT);
    self->trouble_object = is_same ? object : 0;
    self->is_answering = cia402_node_first(drive)->is_answering = true; /* the next question tells */
    self->mute_object = object;
}

/* The boot-up message leads on; a drive that sends none is asked all the same. */
void cia402_start_resetting(cia402_drive_t drive)
{
    if (drive.now_us - drive.axis->phase_us >= (uint64_t)drive.config->boot_timeout_ms * 1000u) {
        drive.axis->is_reset_done = true;
        cia402_axis_look_for(drive);
    }
}

/* All axes of a node start together: its last one has been set up. */
static void start_node(cia402_drive_t drive)
{
    if (!cia402_node_are_all(drive, CIA402_CONFIGURED)) {
        return;
    }
    for (unsigned k = 0; k < drive.config->axes; k++) {
        const cia402_drive_t other = cia402_node_drive(drive, k);
        if (other.own->node == drive.own->node) {
            other.axis->nmt_command = other.own->channel == 0 ? NMT_START : 0;
            other.axis->silent_syncs = 0;
            other.axis->awaited = 0;
            other.axis->surplus = 0;
            other.axis->changes = 0;
            other.axis->has_extra = false;
            other.axis->has_short_answer = false;
            cia402_axis_enter(other, CIA402_STARTING);
        }
    }
}

/* Who has reset it is still there. */
static bool is_reset_due(cia402_drive_t drive)
{
    const uint64_t asked_us = drive.axis->reset_asked_us;
    return asked_us != 0 && drive.now_us - asked_us < RESET_ASKED_US;
}

void cia402_start_configuring(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    switch (cia402_setup_step(self, drive.config, drive.own, drive.now_us)) {
    case CIA402_SETUP_BUSY:
        break;
    case CIA402_SETUP_DONE:
        if (is_reset_due(drive)) {
            self->reset_asked_us = 0;
            cia402_setup_begin(self, CIA402_JOB_RESET, (cia402_mode_t)self->setup.mode, drive.now_us);
            break;
        }
        cia402_axis_enter(drive, CIA402_CONFIGURED);
        start_node(drive);
        break;
    case CIA402_SETUP_REFUSED:
        self->trouble_us = drive.now_us;
        cia402_axis_enter(drive, CIA402_REFUSED);
        break;
    case CIA402_SETUP_SILENT:
        cia402_start_lose_at_object(drive);
        break;
    }
}

/* Where the answers do not tell the mode, it is the one that 6061h held when it was set. */
void cia402_start_show_mode(cia402_drive_t drive)
{
    if (!cia402_map_has_mode(drive.config)) {
        drive.axis->mode_shown = (int8_t)drive.axis->setup.mode;
    }
}

static void come_up(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    cia402_axis_enter(drive, CIA402_UP);
    self->trouble = CIA402_TROUBLE_NONE;
    self->trouble_object = 0;
    self->starts = 0;
    self->mutes = 0;
    self->heartbeat_us = drive.now_us;
    self->goal = CIA402_GOAL_OFF;
    self->word_syncs = 0;
    self->error_code = 0;
    self->is_error_read = false;
    cia402_start_show_mode(drive);
    cia402_watch_restart(self);
}

/* It does not become operational: an error that it has may be the reason. */
static void reject_start(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    if (self->has_short_answer) {
        cia402_axis_reject(drive, CIA402_SHORT_TPDO);
    } else if (self->is_error_read) {
        const uint32_t code = self->setup.value;
        cia402_axis_reject(drive, CIA402_NO_START);
        self->trouble_code = self->trouble_code != 0 ? self->trouble_code : code;
    } else {
        self->is_error_read = true;
        cia402_setup_begin(self, CIA402_JOB_ERROR, (cia402_mode_t)self->setup.mode, drive.now_us);
    }
}

void cia402_start_starting(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const uint64_t limit_us = OPERATIONAL_US + 3000u * (uint64_t)drive.config->heartbeat_ms +
                              (cia402_answer_every(drive.config) - 1u) * (uint64_t)drive.config->period_us;
    if (self->surplus >= CIA402_SURPLUS_MAX) {
        cia402_axis_reject(drive, CIA402_TWICE);
        return;
    }
    if (self->setup.job != CIA402_JOB_NONE) { /* reads why it does not become operational */
        if (cia402_setup_step(self, drive.config, drive.own, drive.now_us) != CIA402_SETUP_BUSY) {
            reject_start(drive);
        }
        return;
    }
    if (cia402_node_is_short(drive)) {
        cia402_axis_lose_alone(drive, CIA402_LOST_NODE);
        self->is_reset_done = cia402_node_is_refused(drive); /* a boot-up would begin everything anew */
        return;
    }
    const bool is_operational = !self->has_heartbeat || self->nmt == CIA402_NMT_OPERATION;
    if (cia402_node_is_answering(drive) && is_operational) {
        come_up(drive);
        return;
    }
    if (drive.now_us - self->phase_us < limit_us) {
        return;
    }
    if (self->has_actual && self->has_answered && is_operational && !cia402_node_is_answering(drive)) {
        return; /* it is another one of its node */
    }
    self->starts++;
    if (self->starts >= RESTARTS_MAX) {
        self->is_error_read = false;
        reject_start(drive);
    } else { /* once more from the beginning */
        self->is_reset_done = false;
        cia402_axis_look_for(drive);
    }
}

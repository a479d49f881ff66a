/* SPDX-License-Identifier: MIT
 * cia402_axis.c - one drive; see cia402_axis.h.
 */
#include "cia402_axis.h"

#include "cia402_loss.h"
#include "cia402_node.h"
#include "cia402_setup.h"
#include "cia402_start.h"
#include "cia402_watch.h"

#define SILENT_ANSWERS_MAX 3u
#define LEAVING_US         300000u  /* a lost drive is told to stop for so long, then set up again */
#define QUICK_STOP_US      5000000u /* a drive that stays in quick stop gets its voltage taken after this */
#define RESET_US           1000000u /* after a request, to see the drive in fault */
#define RESET_LOW_SYNCS    2u       /* bit 7 low, so that it has an edge, */
#define RESET_HIGH_SYNCS   2u       /* high for these at least, and until the drive has left its fault, */
#define RESET_HIGH_US      250000u  /* or so long: some drives need 100 ms */
#define CHANGES_MAX        8u       /* one drive does not change its state at so many SYNCs in a row */
#define FOLLOWS_US         500000u  /* a drive in its mode that does not set bit 12 is believed after this */
#define PLAIN_SYNCS        50u      /* after these, answers that nobody asked for are forgotten */
#define BOOTS_APART_US     10000u   /* no drive starts twice in so short a time */
#define LIVE_ANSWERS       3u /* to the SYNC before a set, to the one at which it acts, and to the next one, which shows it */
#define NMT_STATE_BOOT     0x00u
#define NMT_TOGGLE         0x80u

cia402_state_t cia402_axis_state(const cia402_axis_t *self)
{
    return cia402_state(self->statusword);
}

static uint8_t silent_syncs_max(cia402_drive_t drive)
{
    return (uint8_t)(SILENT_ANSWERS_MAX * cia402_answer_every(drive.config));
}

/* A controlword acts at the next SYNC and shows in the next answer. */
static uint8_t word_syncs_min(cia402_drive_t drive)
{
    return (uint8_t)(1u + cia402_answer_every(drive.config));
}

void cia402_axis_init(cia402_drive_t drive)
{
    *drive.axis = (cia402_axis_t){.is_homed = drive.own->homing_method == 0, .has_mates = cia402_node_has_mates(drive)};
    sdo_init(&drive.axis->sdo, drive.own->node, drive.config->sdo_timeout_ms * 1000u);
    cia402_axis_look_for(drive);
}

/* What an answer shows that nobody asked for is of another drive, whatever else seems to be wrong. */
void cia402_axis_fail(cia402_drive_t drive, uint32_t code)
{
    cia402_axis_t *self = drive.axis;
    const bool is_other = self->surplus > 0 && self->plain_syncs <= 1u;
    self->own_fault = is_other ? CIA402_TWICE : code;
    self->guard = (drive_guard_t){.jump_q32 = 0};
    self->is_in = false;
    self->goal = CIA402_GOAL_STOP;
    self->trouble_us = drive.now_us;
}

void cia402_axis_reset(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    self->own_fault = 0;
    self->surplus = 0;
    self->guard = (drive_guard_t){.jump_q32 = 0};
    self->warned_object = 0;
    if (self->phase == CIA402_REFUSED) {
        self->reset_asked_us = self->trouble == CIA402_NO_START ? drive.now_us : 0;
        self->is_reset_done = false;
        self->starts = 0;
        self->mutes = 0;
        cia402_axis_look_for(drive);
    }
    self->reset_until_us = drive.now_us + RESET_US;
}

bool cia402_axis_is_heard(const cia402_axis_t *self)
{
    return self->phase == CIA402_UP || self->phase == CIA402_LEAVING;
}

/* --- Received --- */

static int32_t i32_of(uint32_t bits)
{
    return bits <= INT32_MAX ? (int32_t)bits : (int32_t)(bits - INT32_MAX - 1u) + INT32_MIN;
}

/* The position goes on where the 32 bits of the drive wrap round. */
HV_WRAPS void cia402_axis_receive_position(cia402_drive_t drive, uint32_t bits)
{
    cia402_axis_t *self = drive.axis;
    const int32_t moved = i32_of(bits - (uint32_t)self->actual_counts);
    self->actual_counts = i32_of(bits);
    self->position_counts = self->has_actual ? fx_add_sat(self->position_counts, moved) : self->actual_counts;
    if (counts_to_units(&drive.own->scale, self->position_counts, &self->actual_q32) == HV_OK) {
        self->has_actual = true;
        self->was_heard = true;
        self->actual_us = drive.now_us;
    }
}

static void count_surplus(cia402_axis_t *self)
{
    self->surplus = self->surplus < CIA402_SURPLUS_MAX ? (uint8_t)(self->surplus + 1u) : self->surplus;
    self->plain_syncs = 0;
}

/* One answer per SYNC, or at every so manyth. Some drives send one more when their statusword changes, and the next awaited one
 * still shows the change. All others are those of another drive, which shows a statusword of its own every time. */
void cia402_axis_count_answer(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const uint8_t every = cia402_answer_every(drive.config);
    const bool is_change = self->statusword != self->plain_word;
    if (!cia402_axis_is_commanded(self)) {
        return;
    }
    if (self->awaited < every) {
        if (is_change && !self->has_extra && self->changes < CHANGES_MAX) {
            self->has_extra = true;
            self->changes++;
        } else {
            count_surplus(self);
        }
        return;
    }
    self->awaited = (uint8_t)(self->awaited - every);
    if (!self->has_extra) {
        self->changes = 0;
    } else if (!is_change) {
        count_surplus(self);
    }
    self->has_extra = false;
    self->plain_word = self->statusword;
}

bool cia402_axis_is_commanded(const cia402_axis_t *self)
{
    return self->phase == CIA402_UP || self->phase == CIA402_STARTING;
}

void cia402_axis_note_answer(cia402_drive_t drive, unsigned n, uint8_t all)
{
    cia402_axis_t *self = drive.axis;
    if (!cia402_axis_is_commanded(self)) {
        return;
    }
    if (n == 0 && self->phase == CIA402_STARTING && !self->has_answered) {
        self->awaited = cia402_answer_every(drive.config); /* SYNCs from before it was started get no answer */
    }
    self->answered = (uint8_t)(self->answered | 1u << n);
    if (self->answered == all) {
        self->answered = 0;
        self->silent_syncs = 0;
        self->has_short_answer = false;
        self->live_answers = self->live_answers > 0 ? (uint8_t)(self->live_answers - 1u) : 0;
        self->has_answer = true;
        self->has_answered = true;
    }
}

void cia402_axis_receive_emergency(cia402_drive_t drive, const can_frame_t *frame)
{
    const uint16_t code = (uint16_t)(frame->data[0] | frame->data[1] << 8);
    drive_emergency_t *emergency = &drive.axis->emergency;
    if (frame->length != 8) {
        return;
    }
    emergency->is_over = code == 0;
    if (code == 0) {
        return;
    }
    drive.axis->error_code = code;
    emergency->at_us = drive.now_us;
    emergency->count++;
    emergency->code = code;
    emergency->error_register = frame->data[2];
    for (unsigned i = 0; i < sizeof emergency->maker; i++) {
        emergency->maker[i] = frame->data[3u + i];
    }
}

static void receive_boot(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    if (self->boot_us != 0 && drive.now_us - self->boot_us < BOOTS_APART_US) {
        return; /* some say it twice; of two drives with one node id the answers tell */
    }
    self->boot_us = drive.now_us;
    if (self->phase >= CIA402_CONFIGURING && self->phase <= CIA402_LEAVING) {
        cia402_axis_lose(drive, CIA402_REBOOTED);
    }
    self->starts = self->phase == CIA402_REFUSED ? 0 : self->starts;
    self->mutes = self->phase == CIA402_REFUSED ? 0 : self->mutes;
    self->mute_object = 0;
    self->is_reset_done = true; /* it has just begun anew */
    self->statusword = 0;       /* without torque */
    self->live_answers = 0;
    self->emergency.is_over = true;
    cia402_axis_look_for(drive);
}

/* Answers to guarding take turns: one that is repeated is an old one. */
static bool is_next_answer(cia402_axis_t *self, uint8_t toggle)
{
    const bool is_next = !self->has_heartbeat || toggle != self->guard_toggle;
    self->guard_toggle = toggle;
    return is_next;
}

void cia402_axis_receive_heartbeat(cia402_drive_t drive, const can_frame_t *frame)
{
    cia402_axis_t *self = drive.axis;
    if (frame->length != 1) {
        return;
    }
    if (frame->data[0] == NMT_STATE_BOOT) {
        receive_boot(drive);
        return;
    }
    if (drive.config->is_guarded && !is_next_answer(self, frame->data[0] & NMT_TOGGLE)) {
        return;
    }
    self->nmt = frame->data[0] & (uint8_t)~NMT_TOGGLE;
    self->has_heartbeat = true;
    self->heartbeat_us = drive.now_us;
}

void cia402_axis_note_foreign_sync(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    self->awaited = self->awaited < silent_syncs_max(drive) ? (uint8_t)(self->awaited + 1u) : self->awaited;
}

void cia402_axis_note_sync(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    self->silent_syncs++;
    cia402_axis_note_foreign_sync(drive);
    self->plain_syncs = self->plain_syncs < PLAIN_SYNCS ? (uint8_t)(self->plain_syncs + 1u) : self->plain_syncs;
    self->surplus = self->plain_syncs < PLAIN_SYNCS ? self->surplus : 0;
}

/* --- Up --- */

static bool is_heartbeat_late(cia402_drive_t drive)
{
    const uint64_t timeout_us = (uint64_t)drive.config->heartbeat_timeout_ms * 1000u;
    return drive.axis->has_heartbeat && drive.now_us - drive.axis->heartbeat_us > timeout_us;
}

/* What says that the drive is lost. */
static cia402_trouble_t find_loss(cia402_drive_t drive)
{
    const cia402_axis_t *self = drive.axis;
    if (self->silent_syncs > silent_syncs_max(drive)) {
        return self->has_short_answer ? CIA402_SHORT_TPDO : CIA402_LOST_TPDO;
    }
    if (self->has_heartbeat && self->nmt != CIA402_NMT_OPERATION) {
        return CIA402_LEFT_OPERATIONAL;
    }
    if (is_heartbeat_late(drive)) {
        return CIA402_LOST_HEARTBEAT;
    }
    return CIA402_TROUBLE_NONE;
}

static uint64_t mark_while(bool is_true, uint64_t since_us, uint64_t now_us)
{
    return !is_true ? 0 : since_us != 0 ? since_us : now_us;
}

/* Where the drive is in fault, its code is found out and a reset begun that was asked for. */
static void step_fault(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    self->was_faulty = true;
    self->is_in = false;
    self->goal = CIA402_GOAL_OFF;
    if (self->reset_until_us > drive.now_us && self->reset_syncs == 0) {
        self->reset_until_us = drive.now_us + RESET_HIGH_US;
        self->reset_syncs = 1;
    }
    if (self->error_code == 0 && !self->is_error_read && self->setup.job == CIA402_JOB_NONE) {
        self->is_error_read = true;
        cia402_setup_begin(self, CIA402_JOB_ERROR, (cia402_mode_t)self->setup.mode, drive.now_us);
    }
}

/* Once the drive is out of its fault, the fault's code is history. */
static void step_no_fault(cia402_drive_t drive, cia402_state_t state)
{
    cia402_axis_t *self = drive.axis;
    if (self->was_faulty && self->reset_syncs == 0) {
        self->was_faulty = false;
        self->is_error_read = false;
        self->error_code = 0;
    }
    if (self->goal == CIA402_GOAL_STOP && !cia402_has_torque(state)) {
        self->goal = CIA402_GOAL_OFF;
    }
}

static void step_jobs(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const cia402_job_t job = self->setup.job;
    const cia402_setup_result_t result = cia402_setup_step(self, drive.config, drive.own, drive.now_us);
    if (job == CIA402_JOB_ERROR && result == CIA402_SETUP_DONE && self->error_code == 0) {
        self->error_code = (uint16_t)self->setup.value;
    } else if (job == CIA402_JOB_MODE && result == CIA402_SETUP_DONE) {
        cia402_start_show_mode(drive);
    } else if (job == CIA402_JOB_MODE && result == CIA402_SETUP_REFUSED) {
        cia402_axis_fail(drive, self->trouble);
    } else if (job == CIA402_JOB_MODE && result == CIA402_SETUP_SILENT) {
        cia402_start_lose_at_object(drive);
    }
}

static void step_up(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const cia402_trouble_t loss = drive.axis->has_mates && cia402_node_is_short(drive) ? CIA402_LOST_NODE : find_loss(drive);
    if (loss != CIA402_TROUBLE_NONE) {
        cia402_axis_lose(drive, loss);
        return;
    }
    if (self->surplus >= CIA402_SURPLUS_MAX && self->own_fault == 0) {
        cia402_axis_fail(drive, CIA402_TWICE);
    }
    cia402_watch_step(drive);
    const cia402_state_t state = cia402_axis_state(self);
    self->operating_us = mark_while(state == CIA402_OPERATION_ENABLED, self->operating_us, drive.now_us);
    self->stopping_us = mark_while(state == CIA402_QUICK_STOP_ACTIVE, self->stopping_us, drive.now_us);
    if (state == CIA402_FAULT || state == CIA402_FAULT_REACTION) {
        step_fault(drive);
    } else {
        step_no_fault(drive, state);
    }
    step_jobs(drive);
}

void cia402_axis_step(cia402_drive_t drive)
{
    switch (drive.axis->phase) {
    case CIA402_MISSING:
        cia402_start_missing(drive);
        break;
    case CIA402_RESETTING:
        cia402_start_resetting(drive);
        break;
    case CIA402_CONFIGURING:
        cia402_start_configuring(drive);
        break;
    case CIA402_CONFIGURED: /* until the others of its node are; what has gone meanwhile has forgotten what it was set to */
        if (is_heartbeat_late(drive)) {
            cia402_axis_lose(drive, CIA402_LOST_HEARTBEAT);
        }
        break;
    case CIA402_STARTING:
        cia402_start_starting(drive);
        break;
    case CIA402_UP:
        step_up(drive);
        break;
    case CIA402_LEAVING:
        if (drive.now_us - drive.axis->phase_us >= LEAVING_US) {
            cia402_axis_look_for(drive);
        }
        break;
    case CIA402_REFUSED:
        break;
    }
}

/* --- The controlword --- */

static bool is_stuck_in_quick_stop(cia402_drive_t drive)
{
    return drive.axis->stopping_us != 0 && drive.now_us - drive.axis->stopping_us >= QUICK_STOP_US;
}

static uint16_t wanted_word(cia402_drive_t drive, uint16_t mode_bits)
{
    const cia402_state_t state = cia402_axis_state(drive.axis);
    const uint16_t word = cia402_controlword(state, drive.axis->goal);
    if (is_stuck_in_quick_stop(drive)) {
        return 0;
    }
    return state == CIA402_OPERATION_ENABLED && drive.axis->goal == CIA402_GOAL_OPERATE ? word | mode_bits : word;
}

/* Bit 7 low, high, low. */
static bool next_reset_word(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    if (self->reset_syncs == 0) {
        return false;
    }
    const bool is_over = cia402_axis_state(self) != CIA402_FAULT || drive.now_us >= self->reset_until_us;
    const bool is_low = self->reset_syncs <= RESET_LOW_SYNCS;
    self->word_syncs = 0;
    if (self->reset_syncs > RESET_LOW_SYNCS + RESET_HIGH_SYNCS && is_over) {
        self->word = 0;
        self->reset_syncs = 0;
        self->reset_until_us = 0;
        return true;
    }
    self->word = is_low ? 0 : CIA402_WORD_RESET;
    self->reset_syncs = self->reset_syncs < UINT8_MAX ? (uint8_t)(self->reset_syncs + 1u) : self->reset_syncs;
    return true;
}

static void choose_word(cia402_drive_t drive, uint16_t mode_bits)
{
    const uint16_t bits = CIA402_CSP_CONTROL_BITS; /* of the mode */
    cia402_axis_t *self = drive.axis;
    if (next_reset_word(drive)) {
        return;
    }
    const uint16_t wanted = wanted_word(drive, mode_bits);
    const bool is_downward = self->goal == CIA402_GOAL_STOP || self->goal == CIA402_GOAL_OFF;
    const bool is_same_command = ((wanted ^ self->word) & (uint16_t)~bits) == 0;
    if (wanted != self->word && (is_downward || is_same_command || self->word_syncs >= word_syncs_min(drive))) {
        self->word = wanted;
        self->word_syncs = 0;
    } else if (self->word_syncs < UINT8_MAX) {
        self->word_syncs++;
    }
}

void cia402_axis_next_word(cia402_drive_t drive, uint16_t mode_bits)
{
    cia402_axis_t *self = drive.axis;
    choose_word(drive, mode_bits);
    if ((self->word & CIA402_WORD_SWITCH_ON) != 0) {
        self->live_answers = LIVE_ANSWERS;
    }
}

/* Until it shows what a command that leads up has done, the statusword is of what was before. Only answers that have come count.
 */
bool cia402_axis_is_energized(const cia402_axis_t *self)
{
    const cia402_state_t state = cia402_axis_state(self);
    return cia402_has_torque(state) || state == CIA402_SWITCHED_ON || self->live_answers > 0;
}

bool cia402_axis_is_operating(cia402_drive_t drive)
{
    const cia402_axis_t *self = drive.axis;
    const uint8_t mode = self->setup.mode;
    if (self->operating_us == 0 || self->mode_shown != (int8_t)mode) {
        return false;
    }
    switch ((cia402_mode_t)mode) {
    case CIA402_MODE_CSP:
        return (self->statusword & CIA402_STATUS_BIT12) != 0 || drive.now_us - self->operating_us >= FOLLOWS_US;
    case CIA402_MODE_IP:
        return (self->statusword & CIA402_STATUS_BIT12) != 0;
    case CIA402_MODE_HOMING:
    case CIA402_MODE_PP:
        break;
    }
    return true;
}

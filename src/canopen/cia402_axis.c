/* SPDX-License-Identifier: MIT
 * cia402_axis.c - one drive; see cia402_axis.h.
 */
#include "cia402_axis.h"

#include "cia402_setup.h"
#include "cia402_watch.h"

#define SILENT_SYNCS_MAX    3u
#define WORD_SYNCS_MIN      2u       /* a controlword acts at the next SYNC and shows at the one after */
#define LEAVING_US          300000u  /* a lost drive is told to stop for so long, then set up again */
#define QUICK_STOP_US       5000000u /* a drive that stays in quick stop gets its voltage taken after this */
#define RESET_US            1000000u /* after a request, to see the drive in fault */
#define FOLLOWS_US          500000u  /* a drive in its mode that does not set bit 12 is believed after this */
#define OPERATIONAL_US      500000u  /* and three heartbeats: after NMT start, until the first TPDO */
#define RESTARTS_MAX        2u
#define SURPLUS_MAX         2u     /* answers that nobody asked for; CAN itself may repeat one, */
#define PLAIN_SYNCS         50u    /* which is forgotten after this */
#define BOOTS_APART_US      10000u /* no drive starts twice in so short a time */
#define NMT_START           0x01u
#define NMT_PREOP           0x80u
#define NMT_RESET           0x82u
#define NMT_STATE_BOOT      0x00u
#define NMT_STATE_OPERATION 0x05u
#define NMT_TOGGLE          0x80u

/* Controlwords of the way through a fault reset, one per SYNC: bit 7 low, high, low. */
static const uint16_t k_reset_words[] = {0, 0, CIA402_WORD_RESET, CIA402_WORD_RESET, 0};

#define RESET_WORDS (sizeof k_reset_words / sizeof k_reset_words[0])

cia402_state_t cia402_axis_state(const cia402_axis_t *self)
{
    return cia402_state(self->statusword);
}

static void enter(cia402_drive_t drive, cia402_phase_t phase)
{
    drive.axis->phase = phase;
    drive.axis->phase_us = drive.now_us;
}

/* Waits for an answer to 1000h, the first thing every drive knows. */
static void look_for(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    enter(drive, CIA402_MISSING);
    self->setup.job = CIA402_JOB_NONE;
    self->has_heartbeat = false;
    self->has_actual = false;
    self->goal = CIA402_GOAL_OFF;
    self->word = 0;
    self->down_syncs = WORD_SYNCS_MIN;
    sdo_read(&self->sdo, 0x1000, 0, 1);
}

void cia402_axis_init(cia402_drive_t drive)
{
    *drive.axis = (cia402_axis_t){.is_homed = drive.own->homing_method == 0};
    sdo_init(&drive.axis->sdo, drive.own->node, drive.config->sdo_timeout_ms * 1000u);
    look_for(drive);
}

/* An error that the drive told of and has not taken back may be why it does not become, or stay, operational. */
static void note_trouble(cia402_drive_t drive, cia402_trouble_t why)
{
    const drive_emergency_t *emergency = &drive.axis->emergency;
    const bool is_reason = !emergency->is_over && (why == CIA402_NO_START || why == CIA402_LEFT_OPERATIONAL);
    drive.axis->trouble = why;
    drive.axis->trouble_us = drive.now_us;
    drive.axis->trouble_object = 0;
    drive.axis->has_found = false;
    drive.axis->trouble_code = is_reason ? emergency->code : 0;
}

void cia402_axis_lose(cia402_drive_t drive, cia402_trouble_t why)
{
    cia402_axis_t *self = drive.axis;
    const bool may_hear = self->phase == CIA402_UP && why != CIA402_REBOOTED && why != CIA402_LOST_BUS;
    note_trouble(drive, why);
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
        enter(drive, CIA402_LEAVING);
        self->goal = CIA402_GOAL_STOP;
    } else {
        look_for(drive);
    }
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
        self->is_reset_done = false;
        self->starts = 0;
        self->mutes = 0;
        look_for(drive);
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
HV_WRAPS static void take_position(cia402_drive_t drive, uint32_t bits)
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

/* One answer per SYNC; more are those of another drive. */
static void count_answer(cia402_axis_t *self)
{
    if (self->awaited > 0) {
        self->awaited--;
    } else {
        self->surplus = self->surplus < SURPLUS_MAX ? (uint8_t)(self->surplus + 1u) : self->surplus;
        self->plain_syncs = 0;
    }
}

void cia402_axis_take_tpdo(cia402_drive_t drive, const can_frame_t *frame)
{
    cia402_axis_t *self = drive.axis;
    const uint8_t *data = frame->data;
    if (frame->length != CIA402_TPDO_BYTES || (self->phase != CIA402_UP && self->phase != CIA402_STARTING)) {
        return;
    }
    count_answer(self);
    self->silent_syncs = 0;
    self->has_answer = true;
    self->statusword = (uint16_t)(data[0] | data[1] << 8);
    take_position(drive, (uint32_t)data[2] | (uint32_t)data[3] << 8 | (uint32_t)data[4] << 16 | (uint32_t)data[5] << 24);
    self->mode_shown = (int8_t)(data[6] < 0x80 ? data[6] : data[6] - 0x100);
}

void cia402_axis_take_emergency(cia402_drive_t drive, const can_frame_t *frame)
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

/* Cannot be used until it boots or the operator resets. */
static void refuse(cia402_drive_t drive, cia402_trouble_t why)
{
    drive.axis->setup.job = CIA402_JOB_NONE;
    sdo_cancel(&drive.axis->sdo);
    note_trouble(drive, why);
    enter(drive, CIA402_REFUSED);
}

static void take_boot(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const bool is_twice = self->boot_us != 0 && drive.now_us - self->boot_us < BOOTS_APART_US;
    self->boot_us = drive.now_us;
    if (self->phase == CIA402_UP || self->phase == CIA402_LEAVING || self->phase == CIA402_CONFIGURING ||
        self->phase == CIA402_STARTING) {
        cia402_axis_lose(drive, CIA402_REBOOTED);
    }
    self->starts = self->phase == CIA402_REFUSED ? 0 : self->starts;
    self->mutes = self->phase == CIA402_REFUSED ? 0 : self->mutes;
    self->mute_object = 0;
    self->is_reset_done = true; /* it has just begun anew */
    self->statusword = 0;       /* without torque */
    self->emergency.is_over = true;
    look_for(drive);
    if (is_twice) {
        refuse(drive, CIA402_TWICE);
    }
}

void cia402_axis_take_heartbeat(cia402_drive_t drive, const can_frame_t *frame)
{
    cia402_axis_t *self = drive.axis;
    if (frame->length != 1) {
        return;
    }
    if (frame->data[0] == NMT_STATE_BOOT) {
        take_boot(drive);
        return;
    }
    self->nmt = frame->data[0] & (uint8_t)~NMT_TOGGLE;
    self->has_heartbeat = true;
    self->heartbeat_us = drive.now_us;
}

void cia402_axis_note_sync(cia402_axis_t *self)
{
    self->silent_syncs++;
    self->awaited = self->awaited < SILENT_SYNCS_MAX ? (uint8_t)(self->awaited + 1u) : self->awaited;
    self->plain_syncs = self->plain_syncs < PLAIN_SYNCS ? (uint8_t)(self->plain_syncs + 1u) : self->plain_syncs;
    self->surplus = self->plain_syncs < PLAIN_SYNCS ? self->surplus : 0;
}

/* --- From missing to up --- */

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

static void step_missing(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    if (self->sdo.state == SDO_SILENT) {
        self->is_answering = false;
        self->mute_object = 0;
        if (self->trouble == CIA402_TROUBLE_NONE || self->trouble == CIA402_NO_ANSWER) {
            note_trouble(drive, CIA402_SILENT);
        }
        sdo_read(&self->sdo, 0x1000, 0, 1);
    } else if (self->sdo.state == SDO_DONE || self->sdo.state == SDO_ABORTED) {
        self->is_answering = true;
        if (is_mute_again(drive)) {
            enter(drive, CIA402_REFUSED);
            return;
        }
        self->trouble = self->trouble == CIA402_SILENT ? CIA402_TROUBLE_NONE : self->trouble;
        if (drive.config->is_reset_wanted && !self->is_reset_done) {
            self->nmt_command = NMT_RESET;
            enter(drive, CIA402_RESETTING);
        } else {
            self->nmt_command = NMT_PREOP;
            self->has_heartbeat = false;
            enter(drive, CIA402_CONFIGURING);
            cia402_setup_begin(self, CIA402_JOB_SETUP, drive.config->mode, drive.now_us);
        }
    }
}

/* Whether it is the object or the drive, the next question tells. */
static void lose_at_object(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const uint32_t object = cia402_setup_object(self, drive.own);
    const bool is_same = self->trouble == CIA402_NO_ANSWER && self->trouble_object == object;
    const bool was_answering = self->is_answering;
    cia402_axis_lose(drive, is_same ? CIA402_NO_ANSWER : CIA402_SILENT);
    self->trouble_object = is_same ? object : 0;
    self->is_answering = was_answering;
    self->mute_object = object;
}

/* The boot-up message leads on; a drive that sends none is asked all the same. */
static void step_resetting(cia402_drive_t drive)
{
    if (drive.now_us - drive.axis->phase_us >= (uint64_t)drive.config->boot_timeout_ms * 1000u) {
        drive.axis->is_reset_done = true;
        look_for(drive);
    }
}

static void step_configuring(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    switch (cia402_setup_step(self, drive.config, drive.own, drive.now_us)) {
    case CIA402_SETUP_BUSY:
        break;
    case CIA402_SETUP_DONE:
        self->nmt_command = NMT_START;
        self->silent_syncs = 0;
        self->awaited = 0;
        self->surplus = 0;
        enter(drive, CIA402_STARTING);
        break;
    case CIA402_SETUP_REFUSED:
        self->trouble_us = drive.now_us;
        enter(drive, CIA402_REFUSED);
        break;
    case CIA402_SETUP_SILENT:
        lose_at_object(drive);
        break;
    }
}

static void come_up(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    enter(drive, CIA402_UP);
    self->trouble = CIA402_TROUBLE_NONE;
    self->trouble_object = 0;
    self->starts = 0;
    self->mutes = 0;
    self->heartbeat_us = drive.now_us;
    self->goal = CIA402_GOAL_OFF;
    self->word_syncs = 0;
    self->error_code = 0;
    self->is_error_read = false;
    cia402_watch_restart(self);
}

static void step_starting(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const uint64_t limit_us = OPERATIONAL_US + 3000u * (uint64_t)drive.config->heartbeat_ms;
    if (self->surplus >= SURPLUS_MAX) {
        refuse(drive, CIA402_TWICE);
        return;
    }
    if (self->has_actual && (!self->has_heartbeat || self->nmt == NMT_STATE_OPERATION)) {
        come_up(drive);
        return;
    }
    if (drive.now_us - self->phase_us < limit_us) {
        return;
    }
    self->starts++;
    if (self->starts >= RESTARTS_MAX) {
        refuse(drive, CIA402_NO_START);
    } else { /* once more from the beginning */
        self->is_reset_done = false;
        look_for(drive);
    }
}

/* --- Up --- */

/* What says that the drive is lost. */
static cia402_trouble_t find_loss(cia402_drive_t drive)
{
    const cia402_axis_t *self = drive.axis;
    if (self->silent_syncs > SILENT_SYNCS_MAX) {
        return CIA402_LOST_TPDO;
    }
    if (self->has_heartbeat && self->nmt != NMT_STATE_OPERATION) {
        return CIA402_LEFT_OPERATIONAL;
    }
    if (self->has_heartbeat && drive.now_us - self->heartbeat_us > (uint64_t)drive.config->heartbeat_timeout_ms * 1000u) {
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
        self->reset_until_us = 0;
        self->reset_syncs = 1;
    }
    if (self->error_code == 0 && !self->is_error_read && self->setup.job == CIA402_JOB_NONE) {
        self->is_error_read = true;
        cia402_setup_begin(self, CIA402_JOB_ERROR, drive.config->mode, drive.now_us);
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
    } else if (job == CIA402_JOB_MODE && result == CIA402_SETUP_REFUSED) {
        cia402_axis_fail(drive, self->trouble);
    } else if (job == CIA402_JOB_MODE && result == CIA402_SETUP_SILENT) {
        lose_at_object(drive);
    }
}

static void step_up(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const cia402_trouble_t loss = find_loss(drive);
    if (loss != CIA402_TROUBLE_NONE) {
        cia402_axis_lose(drive, loss);
        return;
    }
    if (self->surplus >= SURPLUS_MAX && self->own_fault == 0) {
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
        step_missing(drive);
        break;
    case CIA402_RESETTING:
        step_resetting(drive);
        break;
    case CIA402_CONFIGURING:
        step_configuring(drive);
        break;
    case CIA402_STARTING:
        step_starting(drive);
        break;
    case CIA402_UP:
        step_up(drive);
        break;
    case CIA402_LEAVING:
        if (drive.now_us - drive.axis->phase_us >= LEAVING_US) {
            look_for(drive);
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

static bool next_reset_word(cia402_axis_t *self)
{
    if (self->reset_syncs == 0) {
        return false;
    }
    self->word = k_reset_words[self->reset_syncs - 1u];
    self->reset_syncs = self->reset_syncs < RESET_WORDS ? (uint8_t)(self->reset_syncs + 1u) : 0;
    self->word_syncs = 0;
    return true;
}

static void choose_word(cia402_drive_t drive, uint16_t mode_bits)
{
    const uint16_t bits = CIA402_WORD_BIT4 | CIA402_WORD_AT_ONCE;
    cia402_axis_t *self = drive.axis;
    if (next_reset_word(self)) {
        return;
    }
    const uint16_t wanted = wanted_word(drive, mode_bits);
    const bool is_downward = self->goal == CIA402_GOAL_STOP || self->goal == CIA402_GOAL_OFF;
    const bool is_same_command = ((wanted ^ self->word) & (uint16_t)~bits) == 0;
    if (wanted != self->word && (is_downward || is_same_command || self->word_syncs >= WORD_SYNCS_MIN)) {
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
        self->down_syncs = 0;
    } else if (self->down_syncs < WORD_SYNCS_MIN) {
        self->down_syncs++;
    }
}

/* What leads up acts at the next SYNC and shows at the one after: until then the statusword is of what was before. */
bool cia402_axis_is_energized(const cia402_axis_t *self)
{
    const cia402_state_t state = cia402_axis_state(self);
    return cia402_has_torque(state) || state == CIA402_SWITCHED_ON || self->down_syncs < WORD_SYNCS_MIN;
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

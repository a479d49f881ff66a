/* SPDX-License-Identifier: MIT
 * cia402_setup.c - leads one drive through the table of objects; see cia402_setup.h.
 */
#include "cia402_setup.h"

#include "cia402_map.h"
#include "cia402_objects.h"

#define SDO_TRIES       3u
#define STATE_TRIES     3u /* a drive that says "not in this state" is asked again */
#define STATE_PAUSE_US  100000u
#define LIST_MAX        254u
#define AWAIT_PAUSE_US  10000u
#define AWAIT_US        5000000u
#define LISTEN_US       1000000u
#define HIDDEN_US       500000u /* a drive that shows no mode for so long shows it with torque only */
#define RESET_US        150000u
#define PREOP_REPEAT_US 100000u
#define NMT_PREOP       0x80u
#define NMT_STATE_PREOP 0x7Fu
#define GUARD_TIME      0x100Cu
#define ABORT_READ_ONLY 0x06010002u
#define ABORT_ACCESS    0x06010000u
#define ABORT_LOCAL     0x08000021u
#define ABORT_STATE     0x08000022u

/* What a deed is made of, in order; STEP_END is the last of each. */
typedef enum { STEP_END, STEP_WRITE, STEP_COMPARE, STEP_KEEP, STEP_POLL, STEP_LISTEN, STEP_SEEK, STEP_PAUSE } step_t;

#define STEPS_MAX 4u

static const step_t k_steps[][STEPS_MAX] = {
    [CIA402_WRITE] = {STEP_WRITE},
    [CIA402_SET] = {STEP_WRITE, STEP_COMPARE},
    [CIA402_CHECK] = {STEP_COMPARE},
    [CIA402_HAS] = {STEP_COMPARE},
    [CIA402_LISTED] = {STEP_SEEK},
    [CIA402_AWAIT] = {STEP_POLL},
    [CIA402_PDO_OFF] = {STEP_KEEP, STEP_WRITE},
    [CIA402_PDO_ON] = {STEP_KEEP, STEP_WRITE, STEP_COMPARE},
    [CIA402_READ] = {STEP_KEEP},
    [CIA402_PREOPERATIONAL] = {STEP_LISTEN},
    [CIA402_PAUSE] = {STEP_PAUSE},
};

static uint8_t end_of(cia402_job_t job)
{
    if (job == CIA402_JOB_RESET) {
        return cia402_objects_end;
    }
    return job == CIA402_JOB_ERROR ? cia402_objects_reset_begin : cia402_objects_setup_end;
}

static uint8_t begin_of(cia402_job_t job)
{
    switch (job) {
    case CIA402_JOB_MODE:
        return cia402_objects_mode_begin;
    case CIA402_JOB_ERROR:
        return cia402_objects_error_begin;
    case CIA402_JOB_RESET:
        return cia402_objects_reset_begin;
    case CIA402_JOB_NONE:
    case CIA402_JOB_SETUP:
        break;
    }
    return 0;
}

void cia402_setup_begin(cia402_axis_t *self, cia402_job_t job, cia402_mode_t mode, uint64_t now_us)
{
    sdo_cancel(&self->sdo);
    self->setup = (cia402_setup_t){.job = job, .mode = (uint8_t)mode, .row = begin_of(job), .since_us = now_us};
}

/* A drive at a row, for the functions below. */
typedef struct {
    cia402_axis_t *axis;
    const cia402_config_t *config;
    const cia402_axis_config_t *own;
    cia402_object_t row;
    uint64_t now_us;
} visit_t;

static step_t step_of(const visit_t *self)
{
    return k_steps[self->row.deed][self->axis->setup.step];
}

static void next_row(const visit_t *self)
{
    cia402_setup_t *setup = &self->axis->setup;
    cia402_objects_next(self->config, self->own, setup);
    setup->step = 0;
    setup->tries = 0;
    setup->entry = 0;
    setup->is_asked = false;
    setup->since_us = self->now_us;
}

static void next_step(const visit_t *self)
{
    cia402_setup_t *setup = &self->axis->setup;
    setup->step++;
    setup->is_asked = false;
    if (step_of(self) == STEP_END) {
        next_row(self);
    }
}

static void repeat_later(const visit_t *self, uint32_t pause_us)
{
    self->axis->setup.is_asked = false;
    self->axis->setup.pause_us = self->now_us + pause_us;
}

static bool may_be_missing(const cia402_object_t *row)
{
    return row->need == CIA402_IF_THERE || row->need == CIA402_IF_ANSWERED;
}

static uint32_t object_of(const cia402_object_t *row)
{
    return (uint32_t)row->index << 8 | row->sub;
}

uint32_t cia402_setup_object(const cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    const cia402_object_t row = cia402_objects_at(config, axis, &self->setup);
    return object_of(&row);
}

static cia402_setup_result_t reject(const visit_t *self, uint32_t code)
{
    cia402_axis_t *axis = self->axis;
    axis->setup.job = CIA402_JOB_NONE;
    axis->trouble = self->row.trouble;
    axis->trouble_object = object_of(&self->row);
    axis->trouble_code = code;
    axis->has_found = false;
    return CIA402_SETUP_REFUSED;
}

/* The row cannot be had. */
static cia402_setup_result_t give_up(const visit_t *self, uint32_t code)
{
    const cia402_object_t *row = &self->row;
    const uint32_t object = row->index != 0 ? object_of(row) : 0x101700u; /* the heartbeat that is waited for */
    const bool is_accepted = row->need == CIA402_GUARD && cia402_accepts_without(self->config, (uint16_t)(object >> 8));
    if (row->need == CIA402_MUST || (row->need == CIA402_GUARD && !is_accepted)) {
        return reject(self, code);
    }
    if (row->need == CIA402_GUARD) {
        self->axis->warned_object = object;
    }
    next_row(self);
    return CIA402_SETUP_BUSY;
}

static void ask(const visit_t *self)
{
    const cia402_object_t *row = &self->row;
    sdo_t *sdo = &self->axis->sdo;
    self->axis->setup.is_asked = true;
    if (step_of(self) != STEP_WRITE) {
        sdo_read(sdo, row->index, (uint8_t)(row->sub + self->axis->setup.entry), SDO_TRIES);
        return;
    }
    const uint32_t value = cia402_object_value(row, self->config, self->own, &self->axis->setup);
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    sdo_write(sdo, row->index, row->sub, bytes, row->bytes, SDO_TRIES);
}

/* A refusal of this step alone: what the object holds decides. What is only written has nothing to decide it. */
static bool is_left_to_check(const visit_t *self)
{
    const cia402_object_t *row = &self->row;
    const bool is_unchecked = row->source == CIA402_ITEM && row->deed == CIA402_WRITE;
    const bool is_read_only = self->axis->sdo.abort_code == ABORT_READ_ONLY && !is_unchecked;
    return step_of(self) == STEP_WRITE && !may_be_missing(row) && (is_read_only || row->need == CIA402_GUARD);
}

static bool is_worth_another_try(const cia402_axis_t *self)
{
    const uint32_t code = self->sdo.abort_code;
    return (code == ABORT_STATE || code == ABORT_ACCESS || code == ABORT_LOCAL) && self->setup.tries < STATE_TRIES;
}

static cia402_setup_result_t judge_abort(const visit_t *self)
{
    cia402_axis_t *axis = self->axis;
    if (!may_be_missing(&self->row) && is_worth_another_try(axis)) {
        axis->setup.tries++;
        repeat_later(self, STATE_PAUSE_US);
        return CIA402_SETUP_BUSY;
    }
    if (is_left_to_check(self)) {
        axis->setup.refusal = axis->sdo.abort_code;
        axis->setup.refused = self->row.index;
        next_step(self);
        return CIA402_SETUP_BUSY;
    }
    return give_up(self, axis->sdo.abort_code);
}

/* Some drives have 6502h and leave it at 0: that tells nothing. */
static bool is_fitting(const cia402_object_t *row, uint32_t found, uint32_t wanted)
{
    if (row->deed == CIA402_HAS) {
        return found == 0 || (found & wanted) == wanted;
    }
    return ((found ^ wanted) & cia402_object_mask(row)) == 0;
}

static void note_found(cia402_axis_t *self, uint32_t found, uint32_t wanted)
{
    self->has_found = true;
    self->trouble_found = found;
    self->trouble_wanted = wanted;
}

static bool is_guarding(const visit_t *self, uint32_t found)
{
    return self->row.need == CIA402_GUARD && cia402_object_is_guarding(&self->row, self->config, &self->axis->setup, found);
}

static bool is_late(const visit_t *self, uint32_t found)
{
    return self->row.need == CIA402_GUARD && cia402_object_is_late(&self->row, self->config, &self->axis->setup, found);
}

/* Some drives show their mode (6061h) with torque only. Then it is the answers with torque that have to show it. */
static bool is_mode_hidden(const visit_t *self, uint32_t found)
{
    cia402_axis_t *axis = self->axis;
    const bool is_none = self->row.deed == CIA402_AWAIT && found == 0 && cia402_map_has_mode(self->config);
    axis->hides_mode |= is_none && self->now_us - axis->setup.since_us >= HIDDEN_US;
    return is_none && axis->hides_mode;
}

static cia402_setup_result_t compare(const visit_t *self)
{
    const cia402_object_t *row = &self->row;
    cia402_axis_t *axis = self->axis;
    const uint32_t found = sdo_value_u32(&axis->sdo);
    const uint32_t wanted = cia402_object_value(row, self->config, self->own, &axis->setup);
    axis->setup.guard_ms = row->index == GUARD_TIME ? (uint16_t)found : axis->setup.guard_ms;
    if (is_fitting(row, found, wanted) || is_guarding(self, found) || is_mode_hidden(self, found)) {
        next_step(self);
        return CIA402_SETUP_BUSY;
    }
    if (row->deed == CIA402_AWAIT && self->now_us - axis->setup.since_us < AWAIT_US) {
        repeat_later(self, AWAIT_PAUSE_US);
        return CIA402_SETUP_BUSY;
    }
    /* a write that was refused before says why; its object may have been another entry of the same record */
    const uint32_t refusal = axis->setup.refused == row->index ? axis->setup.refusal : 0;
    const cia402_setup_result_t result = row->need == CIA402_IF_ANSWERED ? reject(self, refusal) : give_up(self, refusal);
    if (result == CIA402_SETUP_REFUSED) {
        note_found(axis, found, wanted);
        axis->trouble = is_late(self, found) ? (uint32_t)CIA402_GUARDED_LATE : axis->trouble;
    }
    return result;
}

/* Entry 0 is the length of the list. The others may have one byte or two. */
static cia402_setup_result_t seek(const visit_t *self)
{
    cia402_setup_t *setup = &self->axis->setup;
    const uint32_t found = sdo_value_u32(&self->axis->sdo);
    const uint32_t wanted = cia402_object_value(&self->row, self->config, self->own, setup);
    setup->value = setup->entry == 0 ? found : setup->value;
    if (setup->value == 0 || (setup->entry > 0 && found == wanted)) { /* an empty list tells nothing */
        next_row(self);
        return CIA402_SETUP_BUSY;
    }
    if (setup->entry < setup->value && setup->entry < LIST_MAX) {
        setup->entry++;
        setup->is_asked = false;
        return CIA402_SETUP_BUSY;
    }
    const cia402_setup_result_t result = reject(self, 0);
    self->axis->trouble_object += setup->entry;
    note_found(self->axis, found, wanted);
    return result;
}

static cia402_setup_result_t judge_answer(const visit_t *self)
{
    const step_t step = step_of(self);
    if (step == STEP_COMPARE || step == STEP_POLL) {
        return compare(self);
    }
    if (step == STEP_SEEK) {
        return seek(self);
    }
    if (step == STEP_KEEP) {
        self->axis->setup.value = sdo_value_u32(&self->axis->sdo);
    }
    next_step(self);
    return CIA402_SETUP_BUSY;
}

/* Waits for a heartbeat that says pre-operational; a drive that went operational by itself is told again. */
static cia402_setup_result_t listen(const visit_t *self)
{
    cia402_axis_t *axis = self->axis;
    if (axis->has_heartbeat && axis->nmt == NMT_STATE_PREOP) {
        next_row(self);
        return CIA402_SETUP_BUSY;
    }
    if (self->now_us - axis->setup.since_us >= LISTEN_US + 3000u * (uint64_t)self->config->heartbeat_ms) {
        return give_up(self, 0);
    }
    if (axis->has_heartbeat) {
        axis->nmt_command = NMT_PREOP;
        axis->setup.pause_us = self->now_us + PREOP_REPEAT_US;
    }
    return CIA402_SETUP_BUSY;
}

/* What may be missing may be so without a word: some drives drop questions for objects that they do not have. */
static cia402_setup_result_t judge_silence(const visit_t *self)
{
    if (may_be_missing(&self->row)) {
        return give_up(self, 0);
    }
    self->axis->setup.job = CIA402_JOB_NONE;
    return CIA402_SETUP_SILENT;
}

static cia402_setup_result_t go_on(const visit_t *self)
{
    const sdo_t *sdo = &self->axis->sdo;
    if (step_of(self) == STEP_LISTEN) {
        return listen(self);
    }
    if (step_of(self) == STEP_PAUSE) {
        if (self->now_us - self->axis->setup.since_us >= RESET_US) {
            next_row(self);
        }
        return CIA402_SETUP_BUSY;
    }
    if (!self->axis->setup.is_asked) {
        ask(self);
        return CIA402_SETUP_BUSY;
    }
    if (sdo->state == SDO_DONE) {
        return judge_answer(self);
    }
    if (sdo->state == SDO_ABORTED) {
        return judge_abort(self);
    }
    return sdo->state == SDO_SILENT ? judge_silence(self) : CIA402_SETUP_BUSY;
}

/* Passes over rows that mean nothing here.
 * Returns false at the end. */
static bool find_row(visit_t *self)
{
    const cia402_setup_t *setup = &self->axis->setup;
    const uint8_t end = end_of(setup->job);
    while (setup->row < end) {
        self->row = cia402_objects_at(self->config, self->own, setup);
        if (cia402_object_applies(&self->row, self->config, self->own)) {
            return true;
        }
        next_row(self);
    }
    return false;
}

cia402_setup_result_t cia402_setup_step(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis,
                                        uint64_t now_us)
{
    visit_t visit = {.axis = self, .config = config, .own = axis, .now_us = now_us};
    /* an answer, the next row, its question: twice, then there is nothing left to do before the bus answers */
    for (unsigned i = 0; i < 4u && self->setup.job != CIA402_JOB_NONE && now_us >= self->setup.pause_us; i++) {
        if (!find_row(&visit)) {
            self->setup.job = CIA402_JOB_NONE;
            return CIA402_SETUP_DONE;
        }
        const cia402_setup_result_t result = go_on(&visit);
        if (result != CIA402_SETUP_BUSY) {
            return result;
        }
    }
    return self->setup.job == CIA402_JOB_NONE ? CIA402_SETUP_DONE : CIA402_SETUP_BUSY;
}

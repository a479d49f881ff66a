/* SPDX-License-Identifier: MIT
 * cia402_setup.c - leads one drive through the table of objects; see cia402_setup.h.
 */
#include "cia402_setup.h"

#include "cia402_objects.h"

#define SDO_TRIES       3u
#define STATE_TRIES     3u /* a drive that says "not in this state" is asked again */
#define STATE_PAUSE_US  100000u
#define AWAIT_PAUSE_US  10000u
#define AWAIT_US        5000000u
#define LISTEN_US       1000000u
#define PREOP_REPEAT_US 100000u
#define NMT_PREOP       0x80u
#define NMT_STATE_PREOP 0x7Fu
#define ABORT_READ_ONLY 0x06010002u
#define ABORT_ACCESS    0x06010000u
#define ABORT_LOCAL     0x08000021u
#define ABORT_STATE     0x08000022u

/* What a deed is made of, in order; STEP_END is the last of each. */
typedef enum { STEP_END, STEP_WRITE, STEP_COMPARE, STEP_KEEP, STEP_POLL, STEP_LISTEN } step_t;

#define STEPS_MAX 4u

static const step_t k_steps[][STEPS_MAX] = {
    [CIA402_WRITE] = {STEP_WRITE},
    [CIA402_SET] = {STEP_WRITE, STEP_COMPARE},
    [CIA402_CHECK] = {STEP_COMPARE},
    [CIA402_AWAIT] = {STEP_POLL},
    [CIA402_PDO_OFF] = {STEP_KEEP, STEP_WRITE},
    [CIA402_PDO_ON] = {STEP_KEEP, STEP_WRITE, STEP_COMPARE},
    [CIA402_READ] = {STEP_KEEP},
    [CIA402_PREOPERATIONAL] = {STEP_LISTEN},
};

static step_t step_of(const cia402_setup_t *self)
{
    return k_steps[cia402_objects[self->row].deed][self->step];
}

static uint8_t end_of(cia402_job_t job)
{
    return job == CIA402_JOB_ERROR ? cia402_objects_error_end : cia402_objects_setup_end;
}

static uint8_t begin_of(cia402_job_t job)
{
    if (job == CIA402_JOB_ERROR) {
        return cia402_objects_error_begin;
    }
    return job == CIA402_JOB_MODE ? cia402_objects_mode_begin : 0;
}

void cia402_setup_begin(cia402_axis_t *self, cia402_job_t job, cia402_mode_t mode, uint64_t now_us)
{
    sdo_cancel(&self->sdo);
    self->setup = (cia402_setup_t){.job = job, .mode = (uint8_t)mode, .row = begin_of(job), .since_us = now_us};
}

static void next_row(cia402_axis_t *self, uint64_t now_us)
{
    cia402_setup_t *setup = &self->setup;
    setup->row++;
    setup->step = 0;
    setup->tries = 0;
    setup->is_asked = false;
    setup->since_us = now_us;
}

static void next_step(cia402_axis_t *self, uint64_t now_us)
{
    cia402_setup_t *setup = &self->setup;
    setup->step++;
    setup->is_asked = false;
    if (step_of(setup) == STEP_END) {
        next_row(self, now_us);
    }
}

static void repeat_later(cia402_axis_t *self, uint64_t now_us, uint32_t pause_us)
{
    self->setup.is_asked = false;
    self->setup.pause_us = now_us + pause_us;
}

static uint32_t object_of(const cia402_object_t *row)
{
    return (uint32_t)row->index << 8 | row->sub;
}

uint32_t cia402_setup_object(const cia402_axis_t *self)
{
    return object_of(&cia402_objects[self->setup.row]);
}

static cia402_setup_result_t refuse(cia402_axis_t *self, const cia402_object_t *row, uint32_t code)
{
    self->setup.job = CIA402_JOB_NONE;
    self->trouble = row->trouble;
    self->trouble_object = object_of(row);
    self->trouble_code = code;
    self->has_found = false;
    return CIA402_SETUP_REFUSED;
}

/* The row cannot be had. */
static cia402_setup_result_t give_up(cia402_axis_t *self, const cia402_config_t *config, uint32_t code, uint64_t now_us)
{
    const cia402_object_t *row = &cia402_objects[self->setup.row];
    if (row->need == CIA402_MUST || (row->need == CIA402_GUARD && !config->is_unguarded_allowed)) {
        return refuse(self, row, code);
    }
    if (row->need == CIA402_GUARD) {
        self->warned_object = row->index != 0 ? object_of(row) : 0x101700u;
    }
    next_row(self, now_us);
    return CIA402_SETUP_BUSY;
}

static void ask(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    const cia402_object_t *row = &cia402_objects[self->setup.row];
    self->setup.is_asked = true;
    if (step_of(&self->setup) != STEP_WRITE) {
        sdo_read(&self->sdo, row->index, row->sub, SDO_TRIES);
        return;
    }
    const uint32_t value = cia402_object_value(row, config, axis, &self->setup);
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    sdo_write(&self->sdo, row->index, row->sub, bytes, row->bytes, SDO_TRIES);
}

/* A refusal of this step alone: what the object holds decides. */
static bool is_left_to_check(const cia402_axis_t *self, const cia402_object_t *row)
{
    const bool is_write = step_of(&self->setup) == STEP_WRITE;
    return is_write && row->need != CIA402_IF_THERE && (self->sdo.abort_code == ABORT_READ_ONLY || row->need == CIA402_GUARD);
}

static bool is_worth_another_try(const cia402_axis_t *self)
{
    const uint32_t code = self->sdo.abort_code;
    return (code == ABORT_STATE || code == ABORT_ACCESS || code == ABORT_LOCAL) && self->setup.tries < STATE_TRIES;
}

static cia402_setup_result_t take_abort(cia402_axis_t *self, const cia402_config_t *config, uint64_t now_us)
{
    const cia402_object_t *row = &cia402_objects[self->setup.row];
    if (row->need != CIA402_IF_THERE && is_worth_another_try(self)) {
        self->setup.tries++;
        repeat_later(self, now_us, STATE_PAUSE_US);
        return CIA402_SETUP_BUSY;
    }
    if (is_left_to_check(self, row)) {
        self->setup.refusal = self->sdo.abort_code;
        self->setup.refused = row->index;
        next_step(self, now_us);
        return CIA402_SETUP_BUSY;
    }
    return give_up(self, config, self->sdo.abort_code, now_us);
}

static cia402_setup_result_t compare(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis,
                                     uint64_t now_us)
{
    const cia402_object_t *row = &cia402_objects[self->setup.row];
    const uint32_t found = sdo_value_u32(&self->sdo);
    const uint32_t wanted = cia402_object_value(row, config, axis, &self->setup);
    const bool is_equal = ((found ^ wanted) & cia402_object_mask(row)) == 0;
    if (is_equal || (row->need == CIA402_GUARD && cia402_object_is_guarding(row, config, found))) {
        next_step(self, now_us);
        return CIA402_SETUP_BUSY;
    }
    if (row->deed == CIA402_AWAIT && now_us - self->setup.since_us < AWAIT_US) {
        repeat_later(self, now_us, AWAIT_PAUSE_US);
        return CIA402_SETUP_BUSY;
    }
    /* a write that was refused before says why; its object may have been another entry of the same record */
    const uint32_t refusal = self->setup.refused == row->index ? self->setup.refusal : 0;
    const cia402_setup_result_t result = give_up(self, config, refusal, now_us);
    if (result == CIA402_SETUP_REFUSED) {
        self->has_found = true;
        self->trouble_found = found;
        self->trouble_wanted = wanted;
    }
    return result;
}

static cia402_setup_result_t take_answer(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis,
                                         uint64_t now_us)
{
    const step_t step = step_of(&self->setup);
    if (step == STEP_COMPARE || step == STEP_POLL) {
        return compare(self, config, axis, now_us);
    }
    if (step == STEP_KEEP) {
        self->setup.value = sdo_value_u32(&self->sdo);
    }
    next_step(self, now_us);
    return CIA402_SETUP_BUSY;
}

/* Waits for a heartbeat that says pre-operational; a drive that went operational by itself is told again. */
static cia402_setup_result_t listen(cia402_axis_t *self, const cia402_config_t *config, uint64_t now_us)
{
    if (self->has_heartbeat && self->nmt == NMT_STATE_PREOP) {
        next_row(self, now_us);
        return CIA402_SETUP_BUSY;
    }
    if (now_us - self->setup.since_us >= LISTEN_US + 3000u * (uint64_t)config->heartbeat_ms) {
        return give_up(self, config, 0, now_us);
    }
    if (self->has_heartbeat) {
        self->nmt_command = NMT_PREOP;
        self->setup.pause_us = now_us + PREOP_REPEAT_US;
    }
    return CIA402_SETUP_BUSY;
}

/* What may be missing may be so without a word: some drives drop questions for objects that they do not have. */
static cia402_setup_result_t take_silence(cia402_axis_t *self, const cia402_config_t *config, uint64_t now_us)
{
    if (cia402_objects[self->setup.row].need == CIA402_IF_THERE) {
        return give_up(self, config, 0, now_us);
    }
    self->setup.job = CIA402_JOB_NONE;
    return CIA402_SETUP_SILENT;
}

static cia402_setup_result_t go_on(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis,
                                   uint64_t now_us)
{
    if (step_of(&self->setup) == STEP_LISTEN) {
        return listen(self, config, now_us);
    }
    if (!self->setup.is_asked) {
        ask(self, config, axis);
        return CIA402_SETUP_BUSY;
    }
    if (self->sdo.state == SDO_DONE) {
        return take_answer(self, config, axis, now_us);
    }
    if (self->sdo.state == SDO_ABORTED) {
        return take_abort(self, config, now_us);
    }
    return self->sdo.state == SDO_SILENT ? take_silence(self, config, now_us) : CIA402_SETUP_BUSY;
}

/* Passes over rows that mean nothing here.
 * Returns false at the end. */
static bool find_row(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis, uint64_t now_us)
{
    const uint8_t end = end_of(self->setup.job);
    while (self->setup.row < end && !cia402_object_applies(&cia402_objects[self->setup.row], config, axis)) {
        next_row(self, now_us);
    }
    return self->setup.row < end;
}

cia402_setup_result_t cia402_setup_step(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis,
                                        uint64_t now_us)
{
    /* an answer, the next row, its question: twice, then there is nothing left to do before the bus answers */
    for (unsigned i = 0; i < 4u && self->setup.job != CIA402_JOB_NONE && now_us >= self->setup.pause_us; i++) {
        if (!find_row(self, config, axis, now_us)) {
            self->setup.job = CIA402_JOB_NONE;
            return CIA402_SETUP_DONE;
        }
        const cia402_setup_result_t result = go_on(self, config, axis, now_us);
        if (result != CIA402_SETUP_BUSY) {
            return result;
        }
    }
    return self->setup.job == CIA402_JOB_NONE ? CIA402_SETUP_DONE : CIA402_SETUP_BUSY;
}

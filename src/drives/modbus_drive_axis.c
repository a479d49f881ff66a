/* SPDX-License-Identifier: MIT
 * modbus_drive_axis.c - one drive on Modbus; see modbus_drive_axis.h.
 */
#include "modbus_drive_axis.h"

#define PROBE_US        500000u  /* a drive that does not answer costs its line a timeout each time */
#define REFUSED_US      2000000u /* until a drive that is not as it has to be is looked at again */
#define RESET_US        1000000u /* after a reset, the drive has so long to take its fault back */
#define HOMING_BEGIN_US 500000u  /* "done" before "not done" is believed only after this: it may be that of the last homing */
#define SUMS_MAX        4096u    /* of the mean: more would leave 64 bits, in time */

static bool has(const modbus_drive_map_t *map, modbus_drive_command_t command)
{
    return map->command[command].count != 0;
}

static bool is_when(canraw_when_t when, uint32_t status)
{
    return when.mask != 0 && (status & when.mask) == when.value;
}

static void enter(modbus_drive_axis_t *self, modbus_drive_phase_t phase, uint64_t now_us)
{
    self->since_us = phase != self->phase ? now_us : self->since_us;
    self->phase = phase;
}

/* What is out belongs to something that is over. */
static void forget(modbus_drive_slot_t *slot)
{
    slot->first = slot->tag + 1u;
    slot->is_out = false;
}

/* The next thing to be written; what waits in the slot is replaced as soon as it is handed over. */
static void start_job(modbus_drive_axis_t *self, modbus_drive_job_t job)
{
    forget(&self->write);
    self->job = job;
    self->step = 0;
    self->is_checking = false;
    self->is_broadcast = false;
}

static void tell(modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_drive_command_t command)
{
    start_job(self, has(map, command) ? MODBUS_DRIVE_JOB_COMMAND : MODBUS_DRIVE_NO_JOB);
    self->command = command;
}

/* What stops a drive: its own blocks, else torque off, else hearing nothing more. */
static void tell_stop(modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    tell(self, map, has(map, MODBUS_DRIVE_STOP) ? MODBUS_DRIVE_STOP : MODBUS_DRIVE_DISABLE);
}

static void note_trouble(modbus_drive_axis_t *self, uint32_t trouble, uint16_t object, uint64_t now_us)
{
    self->trouble_us = trouble != self->trouble ? now_us : self->trouble_us;
    self->trouble = trouble;
    self->object = object;
}

void modbus_drive_axis_init(modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    *self = (modbus_drive_axis_t){
        .phase = MODBUS_DRIVE_WAITING, .is_homed = !has(map, MODBUS_DRIVE_HOME), .period_us = map->expected_us};
}

static void lose(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint32_t trouble, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_WAITING, now_us);
    note_trouble(self, trouble, self->object, now_us);
    start_job(self, MODBUS_DRIVE_NO_JOB);
    forget(&self->read);
    self->read_step = 0;
    self->read.failures = 0;
    self->write.failures = 0;
    self->is_homed = !has(map, MODBUS_DRIVE_HOME);
    self->period_us = map->expected_us;
    self->setpoint_us = 0;
    self->reset_until_us = 0;
    self->is_reset_due = false;
    self->next_read_us = now_us + PROBE_US;
}

static void fail(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint32_t code, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_FAULT, now_us);
    note_trouble(self, code, 0, now_us);
    self->guard = (drive_guard_t){.jump_q32 = 0};
    self->reset_until_us = 0;
    self->is_reset_due = false;
    tell_stop(self, map);
}

static guard_limits_t limits_of(const modbus_drive_axis_t *self, const modbus_drive_axis_map_t *axis)
{
    return (guard_limits_t){.from_q32 = self->has_sent ? self->asked_q32 : self->actual_q32,
                            .step_max_q32 = axis->step_max_q32,
                            .actual_q32 = self->actual_q32,
                            .window_q32 = axis->following_max_q32};
}

static void fail_of_guard(modbus_drive_axis_t *self, const modbus_drive_map_t *map, drive_guard_t guard, uint64_t now_us)
{
    fail(self, map, MODBUS_DRIVE_FOLLOWING, now_us);
    self->guard = guard;
}

static bool is_up(const modbus_drive_axis_t *self)
{
    return self->phase != MODBUS_DRIVE_WAITING && self->phase != MODBUS_DRIVE_STARTING && self->phase != MODBUS_DRIVE_REFUSED;
}

static bool is_faulty(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    return map->fault_when.mask != 0 ? is_when(map->fault_when, self->status) : self->alarm != 0;
}

/* --- What came in --- */

static modbus_drive_trouble_t trouble_of(hv_status_t status)
{
    if (status == HV_ERR_IO) {
        return MODBUS_DRIVE_NO_LINK;
    }
    if (status == HV_ERR_STATE) {
        return MODBUS_DRIVE_EXCEPTION;
    }
    return status == HV_ERR_TIMEOUT ? MODBUS_DRIVE_NO_ANSWER : MODBUS_DRIVE_DAMAGED;
}

/* A transaction of a slot has failed. What it was for is tried again, up to a limit; then the drive is gone. */
static void take_failure(modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_drive_slot_t *slot,
                         const modbus_result_t *result, uint16_t object, uint64_t now_us)
{
    const modbus_drive_trouble_t trouble = trouble_of(result->status);
    slot->failures++;
    if (slot->failures <= map->retries && self->phase != MODBUS_DRIVE_WAITING) {
        return;
    }
    self->exception = result->exception;
    self->object = trouble == MODBUS_DRIVE_EXCEPTION ? object : 0;
    lose(self, map, trouble, now_us);
}

/* True where a result is of what goes on now; the slot is free where nothing newer waits in it. */
HV_WRAPS static bool is_current(modbus_drive_slot_t *slot, const modbus_result_t *result)
{
    if ((int32_t)(result->tag - slot->first) < 0) {
        return false;
    }
    slot->is_out = result->tag != slot->tag;
    return true;
}

/* What the drive says of its fault; never 0. */
static uint32_t own_code(const modbus_drive_axis_t *self)
{
    const uint32_t code = self->alarm != 0 ? self->alarm : self->status;
    return code != 0 ? code : 1u;
}

/* What stops the drive is on its way: nothing replaces that. */
static bool is_stopping(const modbus_drive_axis_t *self)
{
    return self->job == MODBUS_DRIVE_JOB_COMMAND && (self->command == MODBUS_DRIVE_STOP || self->command == MODBUS_DRIVE_DISABLE);
}

static void take_fault(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    if (is_faulty(self, map)) {
        if (self->phase != MODBUS_DRIVE_FAULT) {
            enter(self, MODBUS_DRIVE_FAULT, now_us);
            note_trouble(self, own_code(self), 0, now_us);
            self->reset_until_us = 0;
            if (!is_stopping(self)) {
                start_job(self, MODBUS_DRIVE_NO_JOB);
            }
        }
    } else if (self->phase == MODBUS_DRIVE_FAULT && self->reset_until_us != 0 && self->job == MODBUS_DRIVE_NO_JOB &&
               self->read_us >= self->mark_us) {
        enter(self, MODBUS_DRIVE_READY, now_us);
        note_trouble(self, MODBUS_DRIVE_NO_TROUBLE, 0, now_us);
        self->reset_until_us = 0;
    }
}

/* Its target is set to where it is: before torque or right after it, and once more after homing. */
static void place(modbus_drive_axis_t *self, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_PLACING, now_us);
    self->mark_us = now_us;
    if (self->job != MODBUS_DRIVE_JOB_COMMAND) { /* a stop ends first */
        start_job(self, MODBUS_DRIVE_NO_JOB);
    }
}

static void take_homing(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    const bool is_done = !has(map, MODBUS_DRIVE_HOME) || is_when(map->homing_done, self->status);
    if (self->phase != MODBUS_DRIVE_HOMING) {
        self->is_homed = is_done;
        return;
    }
    if (self->job != MODBUS_DRIVE_NO_JOB || self->read_us < self->mark_us) {
        return;
    }
    if (is_when(map->homing_failed, self->status)) {
        fail(self, map, MODBUS_DRIVE_HOMING_FAILED, now_us);
    } else if (!is_done) {
        self->is_homing_seen = true;
    } else if (!has(map, MODBUS_DRIVE_HOME) || self->is_homing_seen || now_us - self->mark_us >= HOMING_BEGIN_US) {
        self->is_homed = true;
        self->is_after_homing = true;
        self->has_sent = false;
        place(self, now_us);
    }
}

/* Feedback that was asked for after the torque went on. */
static void take_enabling(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    const bool has_torque = map->enabled_when.mask == 0 || is_when(map->enabled_when, self->status);
    if (self->phase == MODBUS_DRIVE_CONFIRMING && self->read_us >= self->mark_us && has_torque) {
        if (self->is_placed) {
            enter(self, MODBUS_DRIVE_HOLDING, now_us);
        } else {
            place(self, now_us);
        }
    } else if ((self->phase == MODBUS_DRIVE_ENABLED || self->phase == MODBUS_DRIVE_HOLDING) && !has_torque) {
        enter(self, MODBUS_DRIVE_READY, now_us); /* it has left by itself */
        start_job(self, MODBUS_DRIVE_NO_JOB);
    }
}

static uint32_t field_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_drive_value_t value)
{
    unsigned block = 0;
    const modbus_drive_field_t *field = modbus_drive_find(&map->feedback, value, &block);
    return field != NULL ? (uint32_t)modbus_drive_extract(field, self->got[block]) : 0;
}

/* Torque off first, whatever came of it the last time. */
static void begin_startup(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_STARTING, now_us);
    tell(self, map, MODBUS_DRIVE_DISABLE);
    if (self->job == MODBUS_DRIVE_NO_JOB) {
        start_job(self, MODBUS_DRIVE_JOB_STARTUP);
    }
}

/* Torque that can be taken away. Where a drive says whether it has torque, off is what it says when it was asked after the last
 * command; else it was asked for, and is off once the drive has taken what stops it. */
static void note_torque(modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    const bool is_down = !is_up(self) || self->phase == MODBUS_DRIVE_READY || self->phase == MODBUS_DRIVE_FAULT;
    const bool is_newer = self->job != MODBUS_DRIVE_JOB_COMMAND && self->read_us >= self->mark_us;
    if (is_when(map->enabled_when, self->status)) {
        self->is_energized = has(map, MODBUS_DRIVE_DISABLE);
    } else if (map->enabled_when.mask != 0 && is_down && is_newer) {
        self->is_energized = false;
    }
}

/* All blocks of the feedback are there. */
static void take_feedback(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const counts_scale_t *scale, uint64_t now_us)
{
    unsigned block = 0;
    const modbus_drive_field_t *position = modbus_drive_find(&map->feedback, MODBUS_DRIVE_POSITION, &block);
    const int64_t counts = modbus_drive_extract(position, self->got[block]);
    if (counts_to_units(scale, counts, &self->actual_q32) != HV_OK) {
        return; /* as if it had not come */
    }
    self->actual_counts = counts;
    self->actual_us = now_us;
    self->has_actual = true;
    self->status = field_of(self, map, MODBUS_DRIVE_STATUS);
    self->alarm = field_of(self, map, MODBUS_DRIVE_ALARM);
    if (self->phase == MODBUS_DRIVE_WAITING) {
        begin_startup(self, map, now_us);
    }
    if (is_up(self)) {
        take_fault(self, map, now_us);
        take_homing(self, map, now_us);
        take_enabling(self, map, now_us);
    }
    note_torque(self, map);
}

void modbus_drive_axis_take_read(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const counts_scale_t *scale,
                                 const modbus_result_t *result, uint64_t now_us)
{
    const modbus_drive_block_t *block = &map->feedback.block[self->read_step];
    if (!is_current(&self->read, result)) {
        return;
    }
    if (result->status != HV_OK || result->count != block->count) {
        take_failure(self, map, &self->read, result, block->address, now_us);
        return;
    }
    self->read.failures = 0;
    for (unsigned i = 0; i < block->count; i++) {
        self->got[self->read_step][i] = result->value[i];
    }
    self->read_step++;
    if (self->read_step == map->feedback.count) {
        self->read_step = 0;
        take_feedback(self, map, scale, now_us);
    }
}

/* --- What was written --- */

/* Ready, unless it has said already that it is not. */
static void end_startup(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_READY, now_us);
    note_trouble(self, MODBUS_DRIVE_NO_TROUBLE, 0, now_us);
    start_job(self, MODBUS_DRIVE_NO_JOB);
    take_fault(self, map, now_us);
}

static void refuse(modbus_drive_axis_t *self, uint32_t trouble, uint16_t object, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_REFUSED, now_us);
    note_trouble(self, trouble, object, now_us);
    start_job(self, MODBUS_DRIVE_NO_JOB);
    self->write.failures = 0; /* the next start is judged by itself */
}

/* An item was written, or read back. */
static void take_item(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_result_t *result, uint64_t now_us)
{
    const modbus_drive_item_t *item = &map->item[self->step];
    const bool is_read = self->is_checking || !item->is_written;
    if (is_read && (result->count != 1 || result->value[0] != item->value)) {
        self->exception = 0;
        refuse(self, MODBUS_DRIVE_VALUE, item->address, now_us);
        return;
    }
    self->is_checking = !is_read && item->is_checked;
    self->step = (uint8_t)(self->step + (self->is_checking ? 0u : 1u));
}

static void end_command(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    self->is_energized = self->is_energized && !(is_stopping(self) && map->enabled_when.mask == 0);
    start_job(self, self->phase == MODBUS_DRIVE_STARTING ? MODBUS_DRIVE_JOB_STARTUP : MODBUS_DRIVE_NO_JOB);
    self->mark_us = now_us;
    if (self->phase == MODBUS_DRIVE_ENABLING) {
        enter(self, MODBUS_DRIVE_CONFIRMING, now_us);
    }
}

/* How long the line takes from one set-point of this drive to the next, smoothed. */
static void note_setpoint(modbus_drive_axis_t *self, uint64_t now_us)
{
    if (self->setpoint_us != 0) {
        const int64_t passed_us = (int64_t)fx_clamp((int64_t)(now_us - self->setpoint_us), 0, 10000000);
        self->period_us = (uint32_t)fx_clamp((int64_t)self->period_us + (passed_us - (int64_t)self->period_us) / 8, 1, 10000000);
    }
    self->setpoint_us = now_us;
    self->written_q32 = self->offered_q32;
}

static void begin_enabling(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_ENABLING, now_us);
    tell(self, map, MODBUS_DRIVE_ENABLE);
    self->is_energized = has(map, MODBUS_DRIVE_DISABLE);
    if (self->job == MODBUS_DRIVE_NO_JOB) {
        end_command(self, map, now_us);
    }
}

/* A whole set-point is in the drive. */
static void end_setpoint(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    self->step = 0;
    if (self->phase == MODBUS_DRIVE_ENABLED) {
        note_setpoint(self, now_us);
        self->sum_q32 = 0;
        self->sums = 0;
        return;
    }
    self->is_placed = true;
    if (self->is_after_homing || map->is_target_last) {
        enter(self, MODBUS_DRIVE_CONFIRMING, now_us);
        start_job(self, MODBUS_DRIVE_NO_JOB);
        self->mark_us = now_us;
    } else {
        begin_enabling(self, map, now_us);
    }
}

static const modbus_drive_blocks_t *blocks_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    return self->job == MODBUS_DRIVE_JOB_SETPOINT ? &map->setpoint : &map->command[self->command];
}

/* Register that the current step is about. */
static uint16_t address_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    if (self->job == MODBUS_DRIVE_JOB_STARTUP) {
        return map->item[self->step].address;
    }
    return blocks_of(self, map)->block[self->step].address;
}

static bool take_block(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    const bool is_setpoint = self->job == MODBUS_DRIVE_JOB_SETPOINT && self->phase == MODBUS_DRIVE_ENABLED;
    self->step++;
    if (self->step < blocks_of(self, map)->count) {
        forget(&self->write);
        return false;
    }
    if (self->job == MODBUS_DRIVE_JOB_SETPOINT) {
        end_setpoint(self, map, now_us);
        return is_setpoint;
    }
    end_command(self, map, now_us);
    return false;
}

void modbus_drive_axis_end_broadcast(modbus_drive_axis_t *self)
{
    if (self->is_broadcast) {
        self->is_broadcast = false;
        forget(&self->write);
    }
}

/* During start-up a drive that will not have a value is a case of its own: it is there, and not as it has to be. */
bool modbus_drive_axis_take_write(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_result_t *result,
                                  uint64_t now_us)
{
    if (!is_current(&self->write, result)) { /* nor is one where there is no job: its start has forgotten them all */
        return false;
    }
    if (result->status == HV_ERR_STATE && self->phase == MODBUS_DRIVE_STARTING && self->write.failures >= map->retries) {
        self->exception = result->exception;
        refuse(self, MODBUS_DRIVE_EXCEPTION, address_of(self, map), now_us);
        return false;
    }
    if (result->status != HV_OK) {
        take_failure(self, map, &self->write, result, address_of(self, map), now_us);
        return false;
    }
    self->write.failures = 0;
    if (self->job == MODBUS_DRIVE_JOB_STARTUP) {
        take_item(self, map, result, now_us);
        return false;
    }
    return take_block(self, map, now_us);
}

/* --- Time --- */

static void begin_reset(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    tell(self, map, MODBUS_DRIVE_RESET);
    self->mark_us = now_us;
    self->reset_until_us = now_us + RESET_US;
}

/* Where a drive was after it was asked to be enabled is where its target goes. */
static void step_placing(modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    if (self->job == MODBUS_DRIVE_NO_JOB && self->read_us >= self->mark_us && self->actual_us > self->read_us) {
        self->target_counts = self->actual_counts;
        self->target_speed = (int64_t)map->speed_least;
        start_job(self, MODBUS_DRIVE_JOB_SETPOINT);
    }
}

void modbus_drive_axis_step(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    if (self->phase != MODBUS_DRIVE_WAITING && now_us - self->actual_us > map->feedback_timeout_us) {
        self->object = 0;
        lose(self, map, MODBUS_DRIVE_OLD, now_us);
    }
    if (self->reset_until_us != 0 && now_us > self->reset_until_us) {
        self->reset_until_us = 0;
    }
    if (self->phase == MODBUS_DRIVE_REFUSED && now_us - self->since_us >= REFUSED_US) {
        begin_startup(self, map, now_us);
    }
    if (self->phase == MODBUS_DRIVE_STARTING && self->job == MODBUS_DRIVE_JOB_STARTUP && self->step >= map->items) {
        end_startup(self, map, now_us);
    }
    if (self->is_reset_due && !is_stopping(self)) {
        self->is_reset_due = false;
        begin_reset(self, map, now_us);
    }
    if (self->phase == MODBUS_DRIVE_PLACING) {
        step_placing(self, map);
    }
}

/* --- What goes out --- */

static void hand_over(modbus_drive_slot_t *slot, modbus_request_t *out)
{
    slot->tag++;
    slot->is_out = true;
    out->tag = slot->tag;
}

bool modbus_drive_axis_next_read(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint8_t unit, uint64_t now_us,
                                 modbus_request_t *out)
{
    const modbus_drive_block_t *block = &map->feedback.block[self->read_step];
    if (self->read.is_out || (self->read_step == 0 && now_us < self->next_read_us)) {
        return false;
    }
    if (self->read_step == 0) {
        self->read_us = now_us;
        self->next_read_us = now_us + map->period_us;
    }
    *out = (modbus_request_t){.function = map->is_input ? MODBUS_READ_INPUT : MODBUS_READ_HOLDING,
                              .unit = unit,
                              .address = block->address,
                              .count = block->count};
    hand_over(&self->read, out);
    return true;
}

static void write_one(const modbus_drive_map_t *map, modbus_request_t *out)
{
    out->function = map->is_single && out->count == 1 ? MODBUS_WRITE_REGISTER : MODBUS_WRITE_REGISTERS;
}

static void next_item(const modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_request_t *out)
{
    const modbus_drive_item_t *item = &map->item[self->step];
    out->address = item->address;
    out->count = 1;
    out->value[0] = item->value;
    out->function = MODBUS_READ_HOLDING;
    if (item->is_written && !self->is_checking) {
        write_one(map, out);
    }
}

/* False where the target does not fit its field, which is then a fault. */
static bool next_block(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us, modbus_request_t *out)
{
    const modbus_drive_block_t *block = &blocks_of(self, map)->block[self->step];
    const int64_t value[MODBUS_DRIVE_VALUES] = {
        [MODBUS_DRIVE_POSITION] = self->target_counts, [MODBUS_DRIVE_SPEED] = self->target_speed};
    if (modbus_drive_pack(block, value, out->value) != HV_OK) {
        fail(self, map, MODBUS_DRIVE_FOLLOWING, now_us);
        return false;
    }
    out->address = block->address;
    out->count = block->count;
    write_one(map, out);
    return true;
}

/* A set-point that still waits is replaced by the newest one, once the next one is due anyway. */
static bool is_due(const modbus_drive_axis_t *self, uint64_t now_us)
{
    const bool is_stream = self->job == MODBUS_DRIVE_JOB_SETPOINT && self->phase == MODBUS_DRIVE_ENABLED && self->step == 0;
    return is_stream ? self->is_fresh && now_us >= self->due_us : !self->write.is_out;
}

bool modbus_drive_axis_next_write(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint8_t unit, uint64_t now_us,
                                  modbus_request_t *out)
{
    if (self->job == MODBUS_DRIVE_NO_JOB || !is_due(self, now_us)) {
        return false;
    }
    *out = (modbus_request_t){.unit = self->is_broadcast ? HAL_MODBUS_BROADCAST : unit};
    if (self->job == MODBUS_DRIVE_JOB_STARTUP) {
        next_item(self, map, out);
    } else if (!next_block(self, map, now_us, out)) {
        return false;
    }
    if (!self->write.is_out) {
        self->due_us = now_us + map->period_us;
    }
    self->is_fresh = false;
    hand_over(&self->write, out);
    return true;
}

/* --- Requests --- */

static void begin_homing(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    enter(self, MODBUS_DRIVE_HOMING, now_us);
    tell(self, map, MODBUS_DRIVE_HOME);
    self->mark_us = now_us;
    self->is_homed = false;
    self->is_homing_seen = false;
}

static void begin_following(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    self->is_after_homing = false;
    self->is_placed = false;
    self->has_sent = false;
    if (map->is_target_last) {
        begin_enabling(self, map, now_us);
    } else {
        place(self, now_us);
    }
}

static void stop(modbus_drive_axis_t *self, const modbus_drive_map_t *map, bool is_quick, uint64_t now_us)
{
    if (is_quick) {
        tell_stop(self, map);
        self->is_broadcast = map->is_broadcast && self->job == MODBUS_DRIVE_JOB_COMMAND;
    } else {
        tell(self, map, MODBUS_DRIVE_DISABLE);
    }
    if (self->phase != MODBUS_DRIVE_FAULT) {
        enter(self, MODBUS_DRIVE_READY, now_us);
    }
    self->reset_until_us = 0;
    self->is_reset_due = false;
}

void modbus_drive_axis_request(modbus_drive_axis_t *self, const modbus_drive_map_t *map, drives_request_t request,
                               uint64_t now_us)
{
    if (!is_up(self)) {
        if (request == DRIVES_RESET_FAULT && self->phase == MODBUS_DRIVE_REFUSED) {
            begin_startup(self, map, now_us);
        }
        return;
    }
    switch (request) {
    case DRIVES_ENABLE:
        if (self->phase == MODBUS_DRIVE_READY) {
            begin_following(self, map, now_us);
        }
        break;
    case DRIVES_HOME:
        begin_homing(self, map, now_us);
        break;
    case DRIVES_DISABLE:
    case DRIVES_QUICK_STOP:
        stop(self, map, request == DRIVES_QUICK_STOP, now_us);
        break;
    case DRIVES_RESET_FAULT:
        self->is_reset_due = self->phase == MODBUS_DRIVE_FAULT; /* as soon as it has been told to stop */
        break;
    }
}

/* --- Set-points --- */

/* Nearest, halves away from zero. */
static q32_t mean_of(int64_t sum_q32, uint32_t count)
{
    const int64_t half = sum_q32 < 0 ? -(int64_t)(count / 2u) : (int64_t)(count / 2u);
    return fx_add_sat(sum_q32, half) / (int64_t)count;
}

void modbus_drive_axis_begin(modbus_drive_axis_t *self, const counts_scale_t *scale, uint64_t now_us)
{
    q32_t placed_q32 = self->actual_q32;
    (void)!counts_to_units(scale, self->target_counts, &placed_q32);
    enter(self, MODBUS_DRIVE_ENABLED, now_us);
    start_job(self, MODBUS_DRIVE_JOB_SETPOINT);
    self->paced_q32 = placed_q32;
    self->offered_q32 = placed_q32;
    self->written_q32 = placed_q32;
    self->sum_q32 = 0;
    self->sums = 0;
    self->setpoint_us = 0;
    self->due_us = 0;
    self->has_sent = false;
    self->is_fresh = false;
}

/* The speed field: the way since the last set-point in the period of the line and an eighth more; what does not fit at the
 * field's end. */
static int64_t speed_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                        q32_t travel_q32)
{
    const modbus_drive_field_t *field = modbus_drive_find(&map->setpoint, MODBUS_DRIVE_SPEED, NULL);
    int64_t speed = 0;
    if (field == NULL) {
        return 0;
    }
    const q32_t asked_q32 = fx_mul_div(fx_add_sat(travel_q32, travel_q32 / 8), 1000000, self->period_us);
    const q32_t per_s_q32 = fx_clamp(asked_q32, -axis->speed_max_q32, axis->speed_max_q32);
    if (counts_from_units(&axis->speed, per_s_q32, &speed) != HV_OK) {
        speed = (per_s_q32 < 0) == (axis->speed.num < 0) ? INT64_MAX : INT64_MIN;
    }
    const int64_t magnitude = fx_clamp(fx_abs(speed), map->speed_least, INT64_MAX);
    return fx_clamp(field->is_signed && speed < 0 ? -magnitude : magnitude, modbus_drive_field_min(field),
                    modbus_drive_field_max(field));
}

void modbus_drive_axis_offer(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                             uint64_t now_us)
{
    if (self->sums == SUMS_MAX) {
        self->sum_q32 /= 2;
        self->sums /= 2u;
    }
    self->sum_q32 = fx_add_sat(self->sum_q32, self->paced_q32);
    self->sums++;
    if (self->step != 0) {
        return; /* a set-point of several blocks goes out whole */
    }
    self->offered_q32 = mean_of(self->sum_q32, self->sums);
    self->target_speed = speed_of(self, map, axis, fx_sub_sat(self->offered_q32, self->written_q32));
    self->is_fresh = true;
    if (counts_from_units(&axis->scale, self->offered_q32, &self->target_counts) != HV_OK) {
        const guard_limits_t limits = limits_of(self, axis);
        fail_of_guard(self, map, guard_out_of_counts(self->offered_q32, &limits), now_us);
    }
}

void modbus_drive_axis_watch(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                             q32_t setpoint_q32, uint64_t now_us)
{
    const guard_limits_t limits = limits_of(self, axis);
    const drive_guard_t guard = guard_judge(setpoint_q32, &limits);
    if (drive_guard_is_found(&guard)) {
        fail_of_guard(self, map, guard, now_us);
        return;
    }
    self->asked_q32 = setpoint_q32;
    self->has_sent = self->phase == MODBUS_DRIVE_ENABLED;
}

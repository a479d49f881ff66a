/* SPDX-License-Identifier: MIT
 * modbus_drive_answers.c - what follows from the answers of one drive on Modbus: feedback, and what became of its writes.
 */
#include "modbus_drive_axis.h"
#include "modbus_drive_phase.h"

#define HOMING_BEGIN_US 500000u /* "done" before "not done" is believed only after this: it may be that of the last homing */

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
static void judge_failure(modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_drive_slot_t *slot,
                          const modbus_result_t *result, uint16_t object, uint64_t now_us)
{
    const modbus_drive_trouble_t trouble = trouble_of(result->status);
    slot->failures++;
    if (slot->failures <= map->retries && self->phase != MODBUS_DRIVE_WAITING) {
        return;
    }
    self->exception = result->exception;
    self->object = trouble == MODBUS_DRIVE_EXCEPTION ? object : 0;
    modbus_drive_phase_lose(self, map, trouble, now_us);
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

static void judge_homing(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    const bool is_done =
        !modbus_drive_phase_has(map, MODBUS_DRIVE_HOME) || modbus_drive_phase_is_when(map->homing_done, self->status);
    if (self->phase != MODBUS_DRIVE_HOMING) {
        self->is_homed = is_done;
        return;
    }
    if (self->job != MODBUS_DRIVE_NO_JOB || self->read_us < self->mark_us) {
        return;
    }
    if (modbus_drive_phase_is_when(map->homing_failed, self->status)) {
        modbus_drive_phase_fail(self, map, MODBUS_DRIVE_HOMING_FAILED, now_us);
    } else if (!is_done) {
        self->is_homing_seen = true;
    } else if (!modbus_drive_phase_has(map, MODBUS_DRIVE_HOME) || self->is_homing_seen ||
               now_us - self->mark_us >= HOMING_BEGIN_US) {
        self->is_homed = true;
        self->is_after_homing = true;
        self->has_sent = false;
        modbus_drive_phase_place(self, now_us);
    }
}

/* Feedback that was asked for after the torque went on. */
static void judge_enabling(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    const bool has_torque = map->enabled_when.mask == 0 || modbus_drive_phase_is_when(map->enabled_when, self->status);
    if (self->phase == MODBUS_DRIVE_CONFIRMING && self->read_us >= self->mark_us && has_torque) {
        if (self->is_placed) {
            modbus_drive_phase_enter(self, MODBUS_DRIVE_HOLDING, now_us);
        } else {
            modbus_drive_phase_place(self, now_us);
        }
    } else if ((self->phase == MODBUS_DRIVE_ENABLED || self->phase == MODBUS_DRIVE_HOLDING) && !has_torque) {
        modbus_drive_phase_enter(self, MODBUS_DRIVE_READY, now_us); /* it has left by itself */
        modbus_drive_phase_start_job(self, MODBUS_DRIVE_NO_JOB);
    }
}

static uint32_t field_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_drive_value_t value)
{
    unsigned block = 0;
    const modbus_drive_field_t *field = modbus_drive_find(&map->feedback, value, &block);
    return field != NULL ? (uint32_t)modbus_drive_extract(field, self->got[block]) : 0;
}

/* Torque that can be taken away. Where a drive says whether it has torque, off is what it says when it was asked after the last
 * command; else it was asked for, and is off once the drive has taken `disable`. A drive in a quick stop may say that it is not
 * enabled, and still brakes. */
static void note_torque(modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    const bool is_down =
        !modbus_drive_phase_is_up(self) || self->phase == MODBUS_DRIVE_READY || self->phase == MODBUS_DRIVE_FAULT;
    const bool is_newer = self->job != MODBUS_DRIVE_JOB_COMMAND && self->read_us >= self->mark_us;
    const bool is_over = is_newer && !quick_stop_is_active(&self->quick_stop);
    if (modbus_drive_phase_is_when(map->enabled_when, self->status)) {
        self->is_energized = modbus_drive_phase_has(map, MODBUS_DRIVE_DISABLE);
    } else if (map->enabled_when.mask != 0 && is_down && is_over) {
        self->is_energized = false;
    }
}

/* All blocks of the feedback are there. */
static void apply_feedback(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const counts_scale_t *scale, uint64_t now_us)
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
        modbus_drive_phase_begin_startup(self, map, now_us);
    }
    if (modbus_drive_phase_is_up(self)) {
        modbus_drive_phase_enter_fault(self, map, now_us);
        judge_homing(self, map, now_us);
        judge_enabling(self, map, now_us);
    }
    note_torque(self, map);
}

void modbus_drive_axis_receive_read(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const counts_scale_t *scale,
                                    const modbus_result_t *result, uint64_t now_us)
{
    const modbus_drive_block_t *block = &map->feedback.block[self->read_step];
    if (!is_current(&self->read, result)) {
        return;
    }
    if (result->status != HV_OK || result->count != block->count) {
        judge_failure(self, map, &self->read, result, block->address, now_us);
        return;
    }
    self->read.failures = 0;
    for (unsigned i = 0; i < block->count; i++) {
        self->got[self->read_step][i] = result->value[i];
    }
    self->read_step++;
    if (self->read_step == map->feedback.count) {
        self->read_step = 0;
        apply_feedback(self, map, scale, now_us);
    }
}

/* --- What was written --- */

static void reject(modbus_drive_axis_t *self, uint32_t trouble, uint16_t object, uint64_t now_us)
{
    modbus_drive_phase_enter(self, MODBUS_DRIVE_REFUSED, now_us);
    modbus_drive_phase_note_trouble(self, trouble, object, now_us);
    modbus_drive_phase_start_job(self, MODBUS_DRIVE_NO_JOB);
    self->write.failures = 0; /* the next start is judged by itself */
}

/* An item was written, or read back. */
static void receive_item(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_result_t *result, uint64_t now_us)
{
    const modbus_drive_item_t *item = &map->item[self->step];
    const bool is_read = self->is_checking || !item->is_written;
    if (is_read && (result->count != 1 || result->value[0] != item->value)) {
        self->exception = 0;
        reject(self, MODBUS_DRIVE_VALUE, item->address, now_us);
        return;
    }
    self->is_checking = !is_read && item->is_checked;
    self->step = (uint8_t)(self->step + (self->is_checking ? 0u : 1u));
}

/* How long the line takes from one set-point of this drive to the next, smoothed. */
static void note_setpoint(modbus_drive_axis_t *self, uint64_t now_us)
{
    if (self->setpoint_us != 0) {
        const int64_t passed_us = (int64_t)fx_clamp((int64_t)(now_us - self->setpoint_us), 0, 10000000);
        self->period_us = (uint32_t)fx_clamp((int64_t)self->period_us + (passed_us - (int64_t)self->period_us) / 8, 1, 10000000);
    }
    self->setpoint_us = now_us;
}

/* The position in a block that is in the drive now: a newer one may have been submitted since. */
static void note_position(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                          const modbus_result_t *result)
{
    unsigned block = 0;
    const modbus_drive_field_t *position = modbus_drive_find(&map->setpoint, MODBUS_DRIVE_POSITION, &block);
    if (position != NULL && block == self->step) {
        modbus_drive_axis_confirm(self, map, axis, modbus_drive_extract(position, result->value));
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
        modbus_drive_phase_enter(self, MODBUS_DRIVE_CONFIRMING, now_us);
        modbus_drive_phase_start_job(self, MODBUS_DRIVE_NO_JOB);
        self->mark_us = now_us;
    } else {
        modbus_drive_phase_begin_enabling(self, map, now_us);
    }
}

/* Register that the current step is about. */
static uint16_t address_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    if (self->job == MODBUS_DRIVE_JOB_STARTUP) {
        return map->item[self->step].address;
    }
    return modbus_drive_phase_blocks_of(self, map)->block[self->step].address;
}

static bool receive_block(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                          const modbus_result_t *result, uint64_t now_us)
{
    const bool is_setpoint = self->job == MODBUS_DRIVE_JOB_SETPOINT && self->phase == MODBUS_DRIVE_ENABLED;
    if (is_setpoint) {
        note_position(self, map, axis, result);
    }
    self->step++;
    if (self->step < modbus_drive_phase_blocks_of(self, map)->count) {
        modbus_drive_phase_forget(&self->write);
        return false;
    }
    if (self->job == MODBUS_DRIVE_JOB_SETPOINT) {
        end_setpoint(self, map, now_us);
        return is_setpoint;
    }
    modbus_drive_phase_end_command(self, map, now_us);
    return false;
}

void modbus_drive_axis_end_broadcast(modbus_drive_axis_t *self)
{
    if (self->is_broadcast) {
        self->is_broadcast = false;
        modbus_drive_phase_forget(&self->write);
    }
}

/* During start-up a drive that will not have a value is a case of its own: it is there, and not as it has to be. */
bool modbus_drive_axis_receive_write(modbus_drive_axis_t *self, const modbus_drive_map_t *map,
                                     const modbus_drive_axis_map_t *axis, const modbus_result_t *result, uint64_t now_us)
{
    if (!is_current(&self->write, result)) { /* nor is one where there is no job: its start has forgotten them all */
        return false;
    }
    if (result->status == HV_ERR_STATE && self->phase == MODBUS_DRIVE_STARTING && self->write.failures >= map->retries) {
        self->exception = result->exception;
        reject(self, MODBUS_DRIVE_EXCEPTION, address_of(self, map), now_us);
        return false;
    }
    if (result->status != HV_OK) {
        judge_failure(self, map, &self->write, result, address_of(self, map), now_us);
        return false;
    }
    self->write.failures = 0;
    if (self->job == MODBUS_DRIVE_JOB_STARTUP) {
        receive_item(self, map, result, now_us);
        return false;
    }
    return receive_block(self, map, axis, result, now_us);
}

/* SPDX-License-Identifier: MIT
 * modbus_drive_axis.c - one drive on Modbus: requests, what follows from the time, and what goes out; see modbus_drive_axis.h.
 */
#include "modbus_drive_axis.h"
#include "modbus_drive_phase.h"

#define REFUSED_US    2000000u /* until a drive that is not as it has to be is looked at again */
#define RESET_WAIT_US 2000000u /* it may wait so long for the end of a stop: nobody counts on an older one */
#define RESET_US      1000000u /* after a reset, the drive has so long to take its fault back */

void modbus_drive_axis_init(modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    *self = (modbus_drive_axis_t){.phase = MODBUS_DRIVE_WAITING,
                                  .is_homed = !modbus_drive_phase_has(map, MODBUS_DRIVE_HOME),
                                  .period_us = map->expected_us};
}

/* --- Time --- */

static void begin_reset(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    modbus_drive_phase_command(self, map, MODBUS_DRIVE_RESET);
    self->mark_us = now_us;
    self->reset_until_us = now_us + RESET_US;
}

/* Where a drive was after it was asked to be enabled is where its target goes. */
static void step_placing(modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    if (self->job == MODBUS_DRIVE_NO_JOB && self->read_us >= self->mark_us && self->actual_us > self->read_us) {
        self->target_counts = self->actual_counts;
        self->target_speed = (int64_t)map->speed_least;
        modbus_drive_phase_start_job(self, MODBUS_DRIVE_JOB_SETPOINT);
    }
}

/* Ready, unless it has said already that it is not. */
static void end_startup(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    modbus_drive_phase_enter(self, MODBUS_DRIVE_READY, now_us);
    modbus_drive_phase_note_trouble(self, MODBUS_DRIVE_NO_TROUBLE, 0, now_us);
    modbus_drive_phase_start_job(self, MODBUS_DRIVE_NO_JOB);
    modbus_drive_phase_enter_fault(self, map, now_us);
}

/* A reset that was asked for waits until the drive stands, and not for ever. */
static void step_reset(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    if (self->reset_asked_us != 0 && now_us - self->reset_asked_us > RESET_WAIT_US) {
        self->reset_asked_us = 0;
    }
    if (self->reset_asked_us != 0 && !modbus_drive_phase_is_stopping(self)) {
        self->reset_asked_us = 0;
        begin_reset(self, map, now_us);
    }
}

void modbus_drive_axis_step(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    if (self->phase != MODBUS_DRIVE_WAITING && now_us - self->actual_us > map->feedback_timeout_us) {
        self->object = 0;
        modbus_drive_phase_lose(self, map, MODBUS_DRIVE_OLD, now_us);
    }
    if (self->reset_until_us != 0 && now_us > self->reset_until_us) {
        self->reset_until_us = 0;
    }
    if (self->phase == MODBUS_DRIVE_REFUSED && now_us - self->since_us >= REFUSED_US) {
        modbus_drive_phase_begin_startup(self, map, now_us);
    }
    if (self->phase == MODBUS_DRIVE_STARTING && self->job == MODBUS_DRIVE_JOB_STARTUP && self->step >= map->items) {
        end_startup(self, map, now_us);
    }
    if (self->job == MODBUS_DRIVE_NO_JOB &&
        quick_stop_step(&self->quick_stop, self->actual_q32, self->actual_us, self->mark_us, now_us)) {
        modbus_drive_phase_command(self, map, MODBUS_DRIVE_DISABLE);
    }
    step_reset(self, map, now_us);
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
    const modbus_drive_block_t *block = &modbus_drive_phase_blocks_of(self, map)->block[self->step];
    const int64_t value[MODBUS_DRIVE_VALUES] = {
        [MODBUS_DRIVE_POSITION] = self->target_counts, [MODBUS_DRIVE_SPEED] = self->target_speed};
    if (modbus_drive_pack(block, value, out->value) != HV_OK) {
        modbus_drive_phase_fail(self, map, MODBUS_DRIVE_FOLLOWING, now_us);
        return false;
    }
    out->address = block->address;
    out->count = block->count;
    write_one(map, out);
    return true;
}

static bool is_next_setpoint(const modbus_drive_axis_t *self)
{
    return self->job == MODBUS_DRIVE_JOB_SETPOINT && self->phase == MODBUS_DRIVE_ENABLED && self->step == 0;
}

/* A set-point that still waits is replaced by the newest one, once the next one is due anyway. */
static bool is_due(const modbus_drive_axis_t *self, uint64_t now_us)
{
    return is_next_setpoint(self) ? self->is_fresh && now_us >= self->due_us : !self->write.is_out;
}

bool modbus_drive_axis_next_write(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                                  uint64_t now_us, modbus_request_t *out)
{
    if (self->job == MODBUS_DRIVE_NO_JOB || !is_due(self, now_us)) {
        return false;
    }
    if (is_next_setpoint(self)) {
        modbus_drive_axis_choose_speed(self, map, axis);
    }
    *out = (modbus_request_t){.unit = self->is_broadcast ? HAL_MODBUS_BROADCAST : axis->unit};
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
    modbus_drive_phase_enter(self, MODBUS_DRIVE_HOMING, now_us);
    modbus_drive_phase_command(self, map, MODBUS_DRIVE_HOME);
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
        modbus_drive_phase_begin_enabling(self, map, now_us);
    } else {
        modbus_drive_phase_place(self, now_us);
    }
}

/* What stops it already goes on to its end. */
static void stop(modbus_drive_axis_t *self, const modbus_drive_map_t *map, bool is_quick, uint64_t now_us)
{
    if (is_quick) {
        modbus_drive_phase_command_stop(self, map, now_us);
        self->is_broadcast = map->is_broadcast && self->job == MODBUS_DRIVE_JOB_COMMAND;
    } else if (!modbus_drive_phase_is_stopping(self)) {
        modbus_drive_phase_command(self, map, MODBUS_DRIVE_DISABLE);
    }
    if (self->phase != MODBUS_DRIVE_FAULT) {
        modbus_drive_phase_enter(self, MODBUS_DRIVE_READY, now_us);
    }
    self->reset_until_us = 0;
    self->reset_asked_us = 0;
}

void modbus_drive_axis_request(modbus_drive_axis_t *self, const modbus_drive_map_t *map, drives_request_t request,
                               uint64_t now_us)
{
    if (!modbus_drive_phase_is_up(self)) {
        if (request == DRIVES_RESET_FAULT && self->phase == MODBUS_DRIVE_REFUSED) {
            modbus_drive_phase_begin_startup(self, map, now_us);
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
        self->reset_asked_us = self->phase == MODBUS_DRIVE_FAULT ? now_us : 0; /* as soon as it has been stopped */
        break;
    }
}

/* SPDX-License-Identifier: MIT
 * register_drive.c - a simulated drive on Modbus; see register_drive.h.
 */
#include "twin/register_drive.h"

#include <math.h>
#include <string.h>

#include "twin/status_word.h"

#define BOOT_US       300000u
#define STOP_S        0.1 /* a stop from the usual speed */
#define HOMING_PART   5.0 /* it homes at such a part of the usual speed */
#define ALARM_SILENCE 0x84u
#define ALARM_ORDER   0x70u /* a set-point that it cannot follow now */
#define ALARM_ENCODER 0x42u

/* --- The map, read backwards --- */

static uint32_t mask_of(const modbus_drive_field_t *field)
{
    return field->registers == 2 ? UINT32_MAX : UINT16_MAX;
}

static uint16_t half_of(const modbus_drive_field_t *field, unsigned i, uint32_t bits)
{
    const bool is_low = field->registers == 1 || (i == 0) == field->is_low_first;
    return (uint16_t)(is_low ? bits : bits >> 16);
}

static double field_value(const modbus_drive_field_t *field, const uint16_t *registers)
{
    uint32_t bits = registers[field->at];
    if (field->registers == 2) {
        const uint32_t next = registers[field->at + 1u];
        bits = field->is_low_first ? bits | next << 16 : bits << 16 | next;
    }
    if (!field->is_signed) {
        return bits;
    }
    return field->registers == 2 ? (double)(int32_t)bits : (double)(int16_t)bits;
}

static bool is_of_field(const modbus_drive_block_t *block, unsigned at)
{
    for (unsigned i = 0; i < block->fields; i++) {
        if (at >= block->field[i].at && at < block->field[i].at + (unsigned)block->field[i].registers) {
            return true;
        }
    }
    return false;
}

/* The constants of a block are there, and nothing beside it. */
static bool is_block(const modbus_drive_block_t *block, uint16_t address, const uint16_t *value, unsigned count)
{
    if (address != block->address || count != block->count) {
        return false;
    }
    for (unsigned i = 0; i < count; i++) {
        if (!is_of_field(block, i) && value[i] != block->data[i]) {
            return false;
        }
    }
    return true;
}

static status_conditions_t conditions_of(const modbus_drive_map_t *map)
{
    return (status_conditions_t){map->homing_done, map->homing_failed, map->enabled_when, map->fault_when};
}

const char *register_drive_refusal(const modbus_drive_map_t *map)
{
    const status_conditions_t conditions = conditions_of(map);
    return status_word_is_distinct(&conditions)
               ? NULL
               : "[modbus] enabled_when, fault_when and homing_done_when: no status tells them apart, "
                 "so heave-twin can show none";
}

/* --- Registers --- */

register_cell_t *register_drive_find(register_drive_t *self, uint16_t address)
{
    for (unsigned i = 0; i < self->count; i++) {
        if (self->reg[i].address == address) {
            return &self->reg[i];
        }
    }
    return NULL;
}

static void add(register_drive_t *self, uint16_t address, uint16_t value)
{
    if (register_drive_find(self, address) == NULL && self->count < REGISTER_DRIVE_MAX) {
        self->reg[self->count++] = (register_cell_t){.address = address, .value = value};
    }
}

static void add_blocks(register_drive_t *self, const modbus_drive_blocks_t *blocks, bool is_shown)
{
    for (unsigned i = 0; i < blocks->count; i++) {
        for (unsigned k = 0; k < blocks->block[i].count; k++) {
            add(self, (uint16_t)(blocks->block[i].address + k), is_shown ? blocks->block[i].data[k] : 0);
        }
    }
}

void register_drive_init(register_drive_t *self, const modbus_drive_map_t *map, unsigned axis)
{
    *self = (register_drive_t){.map = map, .axis = &map->axis[axis]};
    add_blocks(self, &map->feedback, true);
    add_blocks(self, &map->setpoint, false);
    for (unsigned i = 0; i < MODBUS_DRIVE_COMMANDS; i++) {
        add_blocks(self, &map->command[i], false);
    }
    for (unsigned i = 0; i < map->items; i++) {
        add(self, map->item[i].address, map->item[i].is_written ? 0 : map->item[i].value);
    }
}

int32_t register_drive_count(const register_drive_t *self)
{
    return (int32_t)fmax(fmin(round(self->motor->actual - self->origin), INT32_MAX), INT32_MIN);
}

static uint32_t status_of(const register_drive_t *self)
{
    unsigned wanted = self->is_homed ? STATUS_DONE : 0;
    wanted |= self->has_homing_failed ? STATUS_FAILED : 0;
    wanted |= self->motor->has_torque ? STATUS_ENABLED : 0;
    wanted |= self->state == REGISTER_FAULT ? STATUS_FAULT : 0;
    const status_conditions_t conditions = conditions_of(self->map);
    return status_word(&conditions, wanted);
}

/* A field of its feedback, into its registers. */
static void show_field(register_drive_t *self, uint16_t address, const modbus_drive_field_t *field)
{
    const uint32_t bits = field->value == MODBUS_DRIVE_POSITION ? (uint32_t)register_drive_count(self)
                          : field->value == MODBUS_DRIVE_STATUS ? status_of(self)
                                                                : self->alarm;
    for (unsigned n = 0; n < field->registers; n++) {
        register_cell_t *cell = register_drive_find(self, (uint16_t)(address + field->at + n));
        if (cell != NULL && !cell->is_held) {
            cell->value = half_of(field, n, bits & mask_of(field));
        }
    }
}

static void show(register_drive_t *self)
{
    for (unsigned i = 0; i < self->map->feedback.count; i++) {
        const modbus_drive_block_t *block = &self->map->feedback.block[i];
        for (unsigned k = 0; k < block->fields; k++) {
            show_field(self, block->address, &block->field[k]);
        }
    }
}

int register_drive_read(register_drive_t *self, uint16_t address, uint16_t *value, unsigned count)
{
    show(self);
    for (unsigned i = 0; i < count; i++) {
        const register_cell_t *reg = register_drive_find(self, (uint16_t)(address + i));
        if (reg == NULL) {
            return MODBUS_NO_ADDRESS;
        }
        value[i] = reg->value;
    }
    return MODBUS_NO_EXCEPTION;
}

/* --- What it does --- */

static void stop(register_drive_t *self)
{
    (void)motor_stop(self->motor, self->usual_speed / STOP_S);
    self->has_target = false;
    self->state = self->state == REGISTER_HOMING ? REGISTER_TORQUE : self->state;
}

static void torque_off(register_drive_t *self, register_state_t state)
{
    motor_torque(self->motor, false);
    self->has_target = false;
    self->state = state;
}

void register_drive_fault(register_drive_t *self, uint32_t alarm)
{
    self->alarm = alarm;
    self->state = REGISTER_FAULT;
    if (!self->is_torque_kept) {
        torque_off(self, REGISTER_FAULT);
    }
}

void register_drive_drop(register_drive_t *self)
{
    torque_off(self, REGISTER_OFF);
}

void register_drive_power(register_drive_t *self, bool is_on, uint64_t now_us)
{
    const bool is_incremental = self->map->command[MODBUS_DRIVE_HOME].count != 0 && !self->is_absolute;
    self->is_powered = is_on;
    self->boot_us = self->heard_us = now_us + BOOT_US;
    self->alarm = 0;
    self->speed = self->usual_speed;
    self->has_homing_failed = false;
    self->is_homed = !is_incremental;
    self->origin = is_incremental ? self->motor->actual : self->origin;
    memset(self->step, 0, sizeof self->step);
    torque_off(self, REGISTER_OFF);
    for (unsigned i = 0; i < self->map->items; i++) {
        register_cell_t *reg = register_drive_find(self, self->map->item[i].address);
        if (reg != NULL && !reg->is_held && self->map->item[i].is_written) {
            reg->value = 0; /* not kept without its supply */
        }
    }
}

bool register_drive_is_there(const register_drive_t *self, uint64_t now_us)
{
    return self->is_powered && !self->is_cut && now_us >= self->boot_us;
}

static void go(register_drive_t *self)
{
    motor_travel(self->motor, self->target, self->speed);
}

static void command(register_drive_t *self, modbus_drive_command_t which)
{
    switch (which) {
    case MODBUS_DRIVE_STOP:
        stop(self);
        return;
    case MODBUS_DRIVE_DISABLE:
        torque_off(self, self->state == REGISTER_FAULT ? REGISTER_FAULT : REGISTER_OFF);
        return;
    case MODBUS_DRIVE_RESET:
        if (self->state == REGISTER_FAULT && !self->is_broken) {
            self->alarm = 0;
            torque_off(self, REGISTER_OFF);
        }
        return;
    case MODBUS_DRIVE_ENABLE:
        if (self->state == REGISTER_OFF) {
            motor_torque(self->motor, true);
            self->state = REGISTER_TORQUE;
            if (self->has_target && !self->map->is_target_last) { /* an old one moves it: that is for the master to prevent */
                go(self);
            }
        }
        return;
    case MODBUS_DRIVE_HOME:
        if (self->state == REGISTER_TORQUE) {
            self->state = REGISTER_HOMING;
            self->is_homed = self->has_homing_failed = false;
            motor_travel(self->motor, self->home, self->usual_speed / HOMING_PART);
        }
        return;
    }
}

/* A command is done when its last block has come behind the others. Blocks that several share count for each. */
static bool accept_commands(register_drive_t *self, uint16_t address, const uint16_t *value, unsigned count)
{
    bool is_taken = false;
    for (unsigned i = 0; i < MODBUS_DRIVE_COMMANDS; i++) {
        const modbus_drive_blocks_t *blocks = &self->map->command[i];
        if (blocks->count == 0) {
            continue;
        }
        const bool is_next = is_block(&blocks->block[self->step[i]], address, value, count);
        const bool is_first = is_block(&blocks->block[0], address, value, count);
        self->step[i] = is_next ? (uint8_t)(self->step[i] + 1u) : is_first ? 1 : 0;
        is_taken = is_taken || is_next || is_first;
        if (self->step[i] == blocks->count) {
            self->step[i] = 0;
            command(self, (modbus_drive_command_t)i);
        }
    }
    return is_taken;
}

static void apply_set_point(register_drive_t *self, const modbus_drive_block_t *block, const uint16_t *value)
{
    bool is_position = false;
    const double per_speed = fabs((double)self->axis->scale.num / self->axis->scale.den) * self->axis->speed.den /
                             (self->axis->speed.num != 0 ? self->axis->speed.num : 1);
    for (unsigned i = 0; i < block->fields; i++) {
        const double number = field_value(&block->field[i], value);
        if (block->field[i].value == MODBUS_DRIVE_POSITION) {
            is_position = true;
            self->target = number + self->origin;
        } else if (block->field[i].value == MODBUS_DRIVE_SPEED) {
            self->speed = fabs(number * per_speed);
        }
    }
    if (self->state == REGISTER_OFF && self->map->is_target_last) {
        register_drive_fault(self, ALARM_ORDER); /* such drives start by their target */
        return;
    }
    self->has_target = self->has_target || is_position;
    self->set_points += is_position && self->state == REGISTER_TORQUE;
    if (self->state == REGISTER_TORQUE && self->has_target) {
        go(self);
    }
}

/* Only what the map has is taken: a drive whose registers mean something else would act on it in its own way. */
static bool accept(register_drive_t *self, uint16_t address, const uint16_t *value, unsigned count)
{
    for (unsigned i = 0; i < self->map->setpoint.count; i++) {
        if (is_block(&self->map->setpoint.block[i], address, value, count)) {
            if (!self->is_deaf) {
                apply_set_point(self, &self->map->setpoint.block[i], value);
            }
            return true;
        }
    }
    if (self->is_deaf || accept_commands(self, address, value, count)) {
        return true;
    }
    for (unsigned i = 0; i < self->map->items; i++) {
        if (count == 1 && self->map->item[i].address == address && self->map->item[i].is_written) {
            return true;
        }
    }
    return false;
}

int register_drive_write(register_drive_t *self, uint16_t address, const uint16_t *value, unsigned count, uint64_t now_us)
{
    for (unsigned i = 0; i < count; i++) {
        if (register_drive_find(self, (uint16_t)(address + i)) == NULL) {
            return MODBUS_NO_ADDRESS;
        }
    }
    self->heard_us = now_us;
    if (!accept(self, address, value, count)) {
        return MODBUS_NO_VALUE;
    }
    for (unsigned i = 0; i < count; i++) {
        register_cell_t *reg = register_drive_find(self, (uint16_t)(address + i));
        reg->value = reg->is_held ? reg->value : value[i];
    }
    return MODBUS_NO_EXCEPTION;
}

void register_drive_advance(register_drive_t *self, uint64_t now_us)
{
    motor_advance(self->motor, now_us);
    const bool has_torque = self->state == REGISTER_TORQUE || self->state == REGISTER_HOMING;
    if (has_torque && self->watchdog_us != 0 && now_us > self->heard_us + self->watchdog_us) {
        register_drive_fault(self, ALARM_SILENCE);
    } else if (self->state == REGISTER_HOMING && motor_is_there(self->motor)) {
        self->state = REGISTER_TORQUE;
        if (self->is_homing_broken) {
            self->has_homing_failed = true;
            register_drive_fault(self, ALARM_ENCODER);
            return;
        }
        self->origin = 0;
        self->is_homed = true;
    }
}

/* SPDX-License-Identifier: MIT
 * modbus_drive_map.c - numbers in registers, how long transactions take, and whether a map can be used; see modbus_drive.h.
 */
#include "modbus_drive_axis.h"

#define SILENCE_US       1750u /* above 19,200 bit/s, where 3.5 characters would be less */
#define SILENCE_FAST_BPS 19200u

static unsigned bits_of(const modbus_drive_field_t *field)
{
    return 16u * field->registers;
}

int64_t modbus_drive_field_min(const modbus_drive_field_t *field)
{
    return field->is_signed ? -(INT64_C(1) << (bits_of(field) - 1u)) : 0;
}

int64_t modbus_drive_field_max(const modbus_drive_field_t *field)
{
    return (INT64_C(1) << (bits_of(field) - (field->is_signed ? 1u : 0u))) - 1;
}

static const modbus_drive_field_t *find_in(const modbus_drive_block_t *block, modbus_drive_value_t value)
{
    for (unsigned i = 0; i < block->fields; i++) {
        if (block->field[i].value == value) {
            return &block->field[i];
        }
    }
    return NULL;
}

const modbus_drive_field_t *modbus_drive_find(const modbus_drive_blocks_t *blocks, modbus_drive_value_t value, unsigned *block)
{
    const modbus_drive_field_t *found = NULL;
    unsigned b = 0;
    while (found == NULL && b < blocks->count) {
        found = find_in(&blocks->block[b++], value);
    }
    if (found != NULL && block != NULL) {
        *block = b - 1u;
    }
    return found;
}

static void put(const modbus_drive_field_t *field, int64_t value, uint16_t *registers)
{
    const uint32_t bits = (uint32_t)value;
    const uint16_t low = (uint16_t)(bits & 0xFFFFu);
    const uint16_t high = (uint16_t)(bits >> 16);
    registers[field->at] = field->registers == 1 || field->is_low_first ? low : high;
    if (field->registers == 2) {
        registers[field->at + 1u] = field->is_low_first ? high : low;
    }
}

hv_status_t modbus_drive_pack(const modbus_drive_block_t *block, const int64_t value[MODBUS_DRIVE_VALUES],
                              uint16_t out[MODBUS_DRIVE_REGISTERS_MAX])
{
    for (unsigned i = 0; i < block->fields; i++) {
        const modbus_drive_field_t *field = &block->field[i];
        if (value[field->value] < modbus_drive_field_min(field) || value[field->value] > modbus_drive_field_max(field)) {
            return HV_ERR_RANGE;
        }
    }
    for (unsigned i = 0; i < MODBUS_DRIVE_REGISTERS_MAX; i++) {
        out[i] = block->data[i];
    }
    for (unsigned i = 0; i < block->fields; i++) {
        put(&block->field[i], value[block->field[i].value], out);
    }
    return HV_OK;
}

int64_t modbus_drive_extract(const modbus_drive_field_t *field, const uint16_t *registers)
{
    const uint16_t first = registers[field->at];
    if (field->registers == 1) {
        return field->is_signed ? (int16_t)first : (int64_t)first;
    }
    const uint16_t second = registers[field->at + 1u];
    const uint32_t bits =
        field->is_low_first ? (uint32_t)second << 16 | (uint32_t)first : (uint32_t)first << 16 | (uint32_t)second;
    return field->is_signed ? (int32_t)bits : (int64_t)bits;
}

/* --- Time --- */

static bool is_read(modbus_function_t function)
{
    return function == MODBUS_READ_HOLDING || function == MODBUS_READ_INPUT;
}

/* Bytes of question and answer, with address and check sum. */
static uint32_t bytes_of(modbus_function_t function, unsigned count)
{
    if (is_read(function)) {
        return 8u + 5u + 2u * count;
    }
    return function == MODBUS_WRITE_REGISTERS ? 9u + 2u * count + 8u : 16u;
}

uint32_t modbus_drive_transaction_us(const modbus_drive_timing_t *timing, modbus_function_t function, unsigned count)
{
    if (timing->bitrate_bps == 0) {
        return timing->turnaround_us;
    }
    const uint64_t bits = (uint64_t)bytes_of(function, count) * timing->bits_per_char;
    const uint64_t wire_us = (bits * 1000000u + timing->bitrate_bps - 1u) / timing->bitrate_bps;
    const uint64_t silence_us = UINT64_C(3500000) * timing->bits_per_char / timing->bitrate_bps + 1u;
    return (uint32_t)(wire_us + timing->turnaround_us + (timing->bitrate_bps > SILENCE_FAST_BPS ? SILENCE_US : silence_us));
}

uint32_t modbus_drive_round_us(const modbus_drive_map_t *map, const modbus_drive_timing_t *timing, unsigned drives)
{
    uint32_t sum_us = 0;
    for (unsigned b = 0; b < map->setpoint.count; b++) {
        const unsigned count = map->setpoint.block[b].count;
        const bool is_single = map->is_single && count == 1;
        sum_us += modbus_drive_transaction_us(timing, is_single ? MODBUS_WRITE_REGISTER : MODBUS_WRITE_REGISTERS, count);
    }
    for (unsigned b = 0; b < map->feedback.count; b++) {
        const modbus_function_t function = map->is_input ? MODBUS_READ_INPUT : MODBUS_READ_HOLDING;
        sum_us += modbus_drive_transaction_us(timing, function, map->feedback.block[b].count);
    }
    sum_us *= drives;
    return sum_us > map->period_us ? sum_us : map->period_us;
}

/* --- Whether a map can be used --- */

static bool is_field_valid(const modbus_drive_block_t *block, const modbus_drive_field_t *field, unsigned values)
{
    return (values >> field->value & 1u) != 0 && (field->registers == 1 || field->registers == 2) &&
           field->at + (unsigned)field->registers <= block->count;
}

/* Every block moves something, within bounds; `values`: what its fields may carry, as bits. */
static bool are_blocks_valid(const modbus_drive_blocks_t *blocks, unsigned values)
{
    if (blocks->count > MODBUS_DRIVE_BLOCKS_MAX) {
        return false;
    }
    for (unsigned b = 0; b < blocks->count; b++) {
        const modbus_drive_block_t *block = &blocks->block[b];
        if (block->count < 1 || block->count > MODBUS_DRIVE_REGISTERS_MAX || block->fields > MODBUS_DRIVE_FIELDS_MAX ||
            block->address + (uint32_t)block->count > 65536u) {
            return false;
        }
        for (unsigned i = 0; i < block->fields; i++) {
            if (!is_field_valid(block, &block->field[i], values)) {
                return false;
            }
        }
    }
    return true;
}

static bool are_all_blocks_valid(const modbus_drive_map_t *map)
{
    bool is_valid =
        are_blocks_valid(&map->setpoint, 1u << MODBUS_DRIVE_POSITION | 1u << MODBUS_DRIVE_SPEED) &&
        are_blocks_valid(&map->feedback, 1u << MODBUS_DRIVE_POSITION | 1u << MODBUS_DRIVE_STATUS | 1u << MODBUS_DRIVE_ALARM) &&
        modbus_drive_find(&map->setpoint, MODBUS_DRIVE_POSITION, NULL) != NULL &&
        modbus_drive_find(&map->feedback, MODBUS_DRIVE_POSITION, NULL) != NULL;
    for (unsigned i = 0; i < MODBUS_DRIVE_COMMANDS; i++) {
        is_valid = is_valid && are_blocks_valid(&map->command[i], 0);
    }
    return is_valid;
}

static bool are_conditions_valid(const modbus_drive_map_t *map)
{
    const bool is_judged = (map->enabled_when.mask | map->fault_when.mask | map->homing_done.mask | map->homing_failed.mask) != 0;
    const bool can_home = map->command[MODBUS_DRIVE_HOME].count == 0 || map->homing_done.mask != 0;
    return can_home && (!is_judged || modbus_drive_find(&map->feedback, MODBUS_DRIVE_STATUS, NULL) != NULL);
}

static bool is_axis_valid(const modbus_drive_map_t *map, unsigned k)
{
    const modbus_drive_axis_map_t *axis = &map->axis[k];
    for (unsigned i = 0; i < k; i++) {
        if (map->axis[i].line == axis->line && map->axis[i].unit == axis->unit) {
            return false;
        }
    }
    return axis->line < DRIVES_MAX && axis->unit != HAL_MODBUS_BROADCAST && (axis->unit <= 247 || axis->unit == 255) &&
           counts_is_valid(&axis->scale) && axis->speed.den > 0 && axis->step_max_q32 > 0 && axis->speed_max_q32 > 0 &&
           axis->carry_q32 >= 0 && axis->following_max_q32 >= 0;
}

bool modbus_drive_map_is_valid(const modbus_drive_map_t *map)
{
    bool is_valid = map->axes >= 1 && map->axes <= DRIVES_MAX && map->period_us > 0 && map->expected_us > 0 &&
                    map->feedback_timeout_us > map->period_us && map->items <= MODBUS_DRIVE_STARTUP_MAX &&
                    are_all_blocks_valid(map) && are_conditions_valid(map);
    for (unsigned k = 0; is_valid && k < map->axes; k++) {
        is_valid = is_axis_valid(map, k);
    }
    for (unsigned i = 0; is_valid && i < map->items; i++) {
        is_valid = map->item[i].is_written || map->item[i].is_checked;
    }
    return is_valid;
}

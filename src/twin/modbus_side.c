/* SPDX-License-Identifier: MIT
 * modbus_side.c - all that answers on Modbus; see modbus_side.h. Function codes are those of the public application
 * protocol 1.1b3.
 */
#include "twin/modbus_side.h"

#include <string.h>

#include "platform/modbus_section.h"

#define VALUES_MAX  125u
#define COIL_ON     0xFF00u
#define WATCHDOG_MS 500u

static bool has_watchdog(const config_t *config)
{
    return config->modbus.drive_timeout.count != 0 || config->modbus.is_drive_timeout_confirmed;
}

void modbus_side_init(modbus_side_t *self, const config_t *config)
{
    memset(self, 0, sizeof *self);
    if (config_modbus_is_used(config)) {
        config_modbus_map(config, &self->map);
        self->drives = self->map.axes;
        self->lines = config_modbus_lines(config);
        const uint32_t patience_ms =
            config->modbus.feedback_timeout_ms > WATCHDOG_MS ? config->modbus.feedback_timeout_ms : WATCHDOG_MS;
        for (unsigned k = 0; k < self->drives; k++) {
            register_drive_init(&self->drive[k], &self->map, k);
            self->drive[k].watchdog_us = has_watchdog(config) ? patience_ms * 1000u : 0;
        }
    }
    if (config->relays.driver == CONFIG_RELAYS_MODBUS) {
        self->board.is_there = true;
        self->board.unit = (uint8_t)config->relays_modbus.unit;
    }
}

static unsigned word_at(const uint8_t *bytes)
{
    return (unsigned)bytes[0] << 8 | bytes[1];
}

static void put_word(uint8_t *bytes, unsigned word)
{
    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)word;
}

static unsigned reject(const uint8_t *question, int exception, uint8_t *answer)
{
    answer[0] = (uint8_t)(question[0] | 0x80u);
    answer[1] = (uint8_t)exception;
    return 2;
}

/* The answer to a write is the head of its question. */
static unsigned confirm(const uint8_t *question, uint8_t *answer)
{
    memcpy(answer, question, 5);
    return 5;
}

static bool is_read(uint8_t function)
{
    return function == MODBUS_READ_HOLDING || function == MODBUS_READ_INPUT;
}

/* --- A drive --- */

static unsigned read_registers(register_drive_t *drive, const uint8_t *question, uint64_t now_us, uint8_t *answer)
{
    uint16_t value[VALUES_MAX];
    const unsigned count = word_at(question + 3);
    if (count < 1 || count > VALUES_MAX) {
        return reject(question, MODBUS_NO_VALUE, answer);
    }
    const int exception = register_drive_read(drive, (uint16_t)word_at(question + 1), value, count);
    if (exception != MODBUS_NO_EXCEPTION) {
        return reject(question, exception, answer);
    }
    drive->heard_us = now_us;
    answer[0] = question[0];
    answer[1] = (uint8_t)(2 * count);
    for (unsigned i = 0; i < count; i++) {
        put_word(answer + 2 + (size_t)2 * i, value[i]);
    }
    return 2 + 2 * count;
}

static int write_registers(register_drive_t *drive, const uint8_t *question, unsigned length, uint64_t now_us)
{
    uint16_t value[VALUES_MAX];
    const unsigned count = word_at(question + 3);
    if (count < 1 || count > VALUES_MAX || question[5] != 2 * count || length != 6 + 2 * count) {
        return MODBUS_NO_VALUE;
    }
    for (unsigned i = 0; i < count; i++) {
        value[i] = (uint16_t)word_at(question + 6 + (size_t)2 * i);
    }
    return register_drive_write(drive, (uint16_t)word_at(question + 1), value, count, now_us);
}

static unsigned ask_drive(register_drive_t *drive, const uint8_t *question, unsigned length, uint64_t now_us, uint8_t *answer)
{
    int exception = MODBUS_NO_FUNCTION;
    if (length == 5 && is_read(question[0])) {
        return read_registers(drive, question, now_us, answer);
    }
    if (length == 5 && question[0] == MODBUS_WRITE_REGISTER) {
        const uint16_t value = (uint16_t)word_at(question + 3);
        exception = register_drive_write(drive, (uint16_t)word_at(question + 1), &value, 1, now_us);
    } else if (length >= 6 && question[0] == MODBUS_WRITE_REGISTERS) {
        exception = write_registers(drive, question, length, now_us);
    }
    return exception == MODBUS_NO_EXCEPTION ? confirm(question, answer) : reject(question, exception, answer);
}

/* One of so many that are still to come. */
static bool uses_one(uint32_t *count)
{
    const bool is_due = *count > 0;
    *count -= is_due;
    return is_due;
}

/* What is done to the answer of a drive; 0 where it is lost. */
static unsigned spoil(register_drive_t *drive, unsigned length, modbus_way_t *way)
{
    if (drive->is_mute || uses_one(&drive->lost)) {
        return 0;
    }
    way->late_us = drive->late_us;
    way->is_half = uses_one(&drive->halved);
    way->is_damaged = uses_one(&drive->damaged);
    return length;
}

/* --- The board --- */

static unsigned read_coils(const modbus_board_t *board, const uint8_t *question, unsigned count, uint8_t *answer)
{
    const unsigned address = word_at(question + 1);
    const unsigned bytes = (count + 7) / 8;
    memset(answer, 0, 2 + (size_t)bytes);
    answer[0] = question[0];
    answer[1] = (uint8_t)bytes;
    for (unsigned i = 0; i < count; i++) {
        answer[2 + i / 8] = (uint8_t)(answer[2 + i / 8] | (unsigned)board->coil[address + i] << i % 8);
    }
    return 2 + bytes;
}

static unsigned write_coil(modbus_board_t *board, const uint8_t *question, uint8_t *answer)
{
    const unsigned value = word_at(question + 3);
    if (value != COIL_ON && value != 0) {
        return reject(question, MODBUS_NO_VALUE, answer);
    }
    board->coil[word_at(question + 1)] = value == COIL_ON;
    return confirm(question, answer);
}

static unsigned write_coils(modbus_board_t *board, const uint8_t *question, unsigned length, unsigned count, uint8_t *answer)
{
    const unsigned bytes = (count + 7) / 8;
    if (length != 6 + bytes || question[5] != bytes) {
        return reject(question, MODBUS_NO_VALUE, answer);
    }
    for (unsigned i = 0; i < count; i++) {
        board->coil[word_at(question + 1) + i] = (question[6 + i / 8] >> i % 8 & 1u) != 0;
    }
    return confirm(question, answer);
}

static unsigned ask_board(modbus_board_t *board, const uint8_t *question, unsigned length, uint8_t *answer)
{
    const bool is_one = question[0] == MODBUS_WRITE_COIL;
    if (length < 5 || (question[0] != MODBUS_READ_COILS && question[0] != MODBUS_WRITE_COILS && !is_one)) {
        return reject(question, MODBUS_NO_FUNCTION, answer);
    }
    const unsigned count = is_one ? 1 : word_at(question + 3);
    if (count < 1 || word_at(question + 1) + count > MODBUS_COILS_MAX) {
        return reject(question, MODBUS_NO_ADDRESS, answer);
    }
    return question[0] == MODBUS_READ_COILS ? read_coils(board, question, count, answer)
           : is_one                         ? write_coil(board, question, answer)
                                            : write_coils(board, question, length, count, answer);
}

/* --- All --- */

unsigned modbus_side_ask(modbus_side_t *self, unsigned line, uint8_t unit, const uint8_t *question, unsigned length,
                         uint64_t now_us, uint8_t *answer, modbus_way_t *way)
{
    unsigned said = 0;
    *way = (modbus_way_t){0};
    if (self->is_cable_out || length < 1) {
        return 0;
    }
    if (line == MODBUS_BOARD_LINE) {
        modbus_board_t *board = &self->board;
        return board->is_there && !board->is_silent && unit == board->unit ? ask_board(board, question, length, answer) : 0;
    }
    for (unsigned k = 0; k < self->drives; k++) {
        register_drive_t *drive = &self->drive[k];
        if (drive->axis->line != line || (drive->axis->unit != unit && unit != HAL_MODBUS_BROADCAST) ||
            !register_drive_is_there(drive, now_us)) {
            continue;
        }
        if (unit != HAL_MODBUS_BROADCAST && uses_one(&drive->refused)) {
            said = reject(question, drive->exception, answer);
        } else {
            said = ask_drive(drive, question, length, now_us, answer);
        }
        if (unit != HAL_MODBUS_BROADCAST) {
            return spoil(drive, said, way);
        }
    }
    return 0;
}

/* SPDX-License-Identifier: MIT
 * row.h - reads a trace row by row: numbers as whole 1e-9, no floating point.
 */
#ifndef JUDGE_ROW_H
#define JUDGE_ROW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "mechanism.h"

typedef enum {
    AT_OFF,
    AT_HOMING,
    AT_SETTLED,
    AT_RISING,
    AT_NEUTRAL,
    AT_ENGAGED,
    AT_HOLD,
    AT_SETTLING,
    AT_SERVICE,
    AT_FAULT,
    AT_ESTOP,
    PLACES
} place_t;

enum {
    FLAG_CLAMPED = 1u << 0,
    FLAG_SPEED = 1u << 1,
    FLAG_ACCEL = 1u << 2,
    FLAG_STRETCHED = 1u << 3,
    FLAG_TAKEOVER = 1u << 4,
    FLAG_CYLINDERS = 1u << 5,
    FLAG_OFF_PATH = 1u << 6,
    FLAG_NO_POSE = 1u << 7,
    FLAG_LATE = 1u << 8,
    FLAG_FAULT = 1u << 9,
    FLAG_ESTOP = 1u << 10,
    FLAG_SILENT = 1u << 11,
    FLAG_LOOSE = 1u << 12, /**< in service: a drive without torque, or one that moves by itself, is where it is */
    FLAG_COUNT = 13
};

typedef struct {
    uint64_t t_us;
    place_t place;
    unsigned flags;
    int64_t value[COLUMNS]; /**< 1e-9 deg or mm */
} row_t;

/** The first line of every trace, without its newline. */
extern const char row_header[];

const char *row_place_name(place_t place);
const char *row_flag_name(unsigned bit);
const char *row_column_name(unsigned column);

/** Reads a line without its newline.
 *  @return false: it is none of a trace */
bool row_read(row_t *self, const char *line, size_t length);

#endif

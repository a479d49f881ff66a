/* SPDX-License-Identifier: MIT
 * rules.h - the limits of motion, applied to one row of a trace after the other. Shares nothing with heaved nor with
 * tools/check_trace. In OFF, HOMING and ESTOP, and in FAULT after the stop it begins with, set-points follow the actual
 * positions: those rows are nobody's plan and not judged.
 */
#ifndef JUDGE_RULES_H
#define JUDGE_RULES_H

#include <stdio.h>

#include "row.h"

/** The rules: of every column in use its range and its three rates, then these. */
enum {
    RULE_COLUMN = 0, /* 4 x column + order */
    RULE_FORMAT = 4 * COLUMNS,
    RULE_TIME,
    RULE_AGREE,
    RULE_GUIDE,
    RULE_REST,
    RULE_ENGAGE_SPEED,
    RULE_ENGAGE_ACCEL,
    RULES
};

#define FOUND_MAX 20u

/** Something wrong. */
typedef struct {
    uint64_t t_us;
    unsigned rule, column;
    int64_t value; /**< 1e-9 u per cycle^order */
} found_t;

/** A position that may be outside its range where it was placed. */
typedef struct {
    double least, most; /**< allowed now, 1e-9 u */
    double stopping;    /**< cycles for which that holds whatever happens */
} allowance_t;

typedef struct {
    const mechanism_t *mechanism;
    uint64_t rows, judged, pose_judged, in_place[PLACES], with_flag[FLAG_COUNT];
    uint64_t broken[RULES];
    double worst[RULES]; /**< share of the limit; RULE_AGREE, RULE_GUIDE: mm */
    found_t found[FOUND_MAX];
    unsigned found_count;

    row_t last;
    int64_t difference[ORDERS][COLUMNS]; /**< of the row at hand; [0] is the value */
    allowance_t allowance[COLUMNS];
    bool is_limited;
    unsigned age, pose_age; /**< rows in a row that limits held in */
    unsigned free_age;      /**< rows since one in which cylinders pulled the pose axes */
    bool was_still;         /**< every cylinder and the motor at rest in the last row */
    bool has_rested;        /**< in this stay in the state */
    bool is_stopping_anew;  /**< RISING or SETTLING: in another controlled stop than the first */
    unsigned still_rows;
    int64_t last_speed; /**< of the fastest cylinder */
} rules_t;

void rules_init(rules_t *self, const mechanism_t *mechanism);

/** Judges the next row. */
void rules_row(rules_t *self, const row_t *row);

/** A line that is no row. */
void rules_bad_line(rules_t *self);

/** How much was broken altogether. */
uint64_t rules_broken(const rules_t *self);

/** Prints what was judged and found. */
void rules_report(const rules_t *self, FILE *to);

#endif

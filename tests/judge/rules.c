/* SPDX-License-Identifier: MIT
 * rules.c - the limits of motion, applied to one row of a trace after the other; see rules.h.
 */
#include "rules.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define REST_ROWS  20u /* as many equal rows are taken for rest, not for the slow start of a move */
#define POSE_NOISE 10  /* a pose at rest may be solved anew from the same extensions, 1e-9 */
#define AGREE_MM   1e-6
#define POSE_SLACK 1000 /* the same in 1e-9 */
#define NO_POSE_FLAGS                                                                                                            \
    ((unsigned)FLAG_CYLINDERS | FLAG_NO_POSE)                 /* no pose is followed; the axes take over where such a row ends */
#define PULLED_FLAGS ((unsigned)FLAG_CLAMPED | FLAG_OFF_PATH) /* the axes are where the cylinders can be ... */

/* ... and may move with so many times their limits of speed, acceleration and jerk: near singular poses a little of a cylinder
 * is much of an axis. */
static const int k_pulled_times[ORDERS] = {1, 4, 4, 8};

static int64_t magnitude(int64_t value)
{
    return value < 0 ? -value : value;
}

static int64_t larger(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

static bool is_cylinder(const rules_t *self, unsigned column)
{
    return column >= FIRST_CYLINDER && column < FIRST_CYLINDER + self->mechanism->cylinders;
}

static bool is_mover(const rules_t *self, unsigned column)
{
    return is_cylinder(self, column) || (column == ANGLE_COLUMN && self->mechanism->has_angle);
}

/* ---- findings ---- */

static void find(rules_t *self, unsigned rule, unsigned column, int64_t value)
{
    self->broken[rule]++;
    if (self->found_count < FOUND_MAX) {
        self->found[self->found_count++] = (found_t){.t_us = self->last.t_us, .rule = rule, .column = column, .value = value};
    }
}

/* times: that the limit counts */
static void check_rate(rules_t *self, unsigned rule, unsigned column, unsigned order, const bounds_t *bounds, int times)
{
    const int64_t value = magnitude(self->difference[order][column]);
    if (times == 1) {
        self->worst[rule] = fmax(self->worst[rule], (double)value / bounds->exact[order]);
    }
    if (value > bounds->most[order] * times) {
        find(self, rule, column, value);
    }
}

/* ---- ranges ---- */

/* Where a column was before its range counted: there it may be, but not further out. One that moves may take its stopping
 * distance. keeps: what was allowed before still is. */
static void allow(rules_t *self, unsigned column, bool may_stop, bool keeps)
{
    const bounds_t *bounds = &self->mechanism->column[column];
    allowance_t *allowance = &self->allowance[column];
    const allowance_t before = *allowance;
    const double value = (double)self->difference[0][column], push = fabs((double)self->difference[2][column]);
    const double accel = bounds->exact[2], jerk = bounds->exact[3];
    const double speed = may_stop ? fabs((double)self->difference[1][column]) + push * push / (2 * jerk) : 0;
    allowance->stopping = speed > 0 ? ceil(speed / accel + 2 * fmax(accel, push) / jerk) : 0;
    allowance->least = fmin((double)bounds->low, value) - speed * allowance->stopping;
    allowance->most = fmax((double)bounds->high, value) + speed * allowance->stopping;
    if (keeps) {
        allowance->least = fmin(allowance->least, before.least);
        allowance->most = fmax(allowance->most, before.most);
    }
}

/* keeps: what was allowed stays so, although it is not made use of. */
static void check_range(rules_t *self, unsigned column, double slack, bool keeps)
{
    const bounds_t *bounds = &self->mechanism->column[column];
    allowance_t *allowance = &self->allowance[column];
    const int64_t exact = self->difference[0][column];
    const double value = (double)exact;
    if ((exact < bounds->low || exact > bounds->high) &&
        !(value >= allowance->least - slack && value <= allowance->most + slack)) {
        find(self, RULE_COLUMN + 4 * column, column, exact);
    }
    if (allowance->stopping > 0) {
        allowance->stopping--;
    } else if (!keeps) {
        allowance->least = fmin((double)bounds->low, fmax(value, allowance->least));
        allowance->most = fmax((double)bounds->high, fmin(value, allowance->most));
    }
}

/* ---- cylinders and the rotation motor ---- */

static void check_movers(rules_t *self)
{
    static const unsigned k_rows_needed[ORDERS] = {0, 0, 2, 3}; /* a speed needs one row before it, placed or not */
    for (unsigned column = ANGLE_COLUMN; column < COLUMNS; column++) {
        if (!is_mover(self, column)) {
            continue;
        }
        if (self->age == 0) {
            allow(self, column, false, false);
        }
        for (unsigned order = 1; order < ORDERS; order++) {
            if (self->age >= k_rows_needed[order]) {
                check_rate(self, RULE_COLUMN + 4 * column + order, column, order, &self->mechanism->column[column], 1);
            }
        }
        check_range(self, column, 0, false);
    }
    self->age++;
}

/* ---- pose axes ---- */

/* An axis that came in from outside its range may be pulled in further with the others (clamped), and then go back out to where
 * it would have been. */
static void check_pose(rules_t *self, unsigned flags)
{
    const bool is_followed = (flags & NO_POSE_FLAGS) == 0;
    const bool is_pulled = (flags & PULLED_FLAGS) != 0;
    for (unsigned axis = 0; axis < POSE_COLUMNS; axis++) {
        if (!self->mechanism->is_free[axis]) {
            continue;
        }
        if (!is_followed || (flags & FLAG_OFF_PATH) != 0) {
            allow(self, axis, true, is_followed);
        } else {
            check_range(self, axis, POSE_SLACK, (flags & FLAG_CLAMPED) != 0);
        }
        for (unsigned order = 1; order < ORDERS && is_followed; order++) {
            if (self->pose_age >= order) {
                const bool is_free = !is_pulled && self->free_age >= order;
                check_rate(self, RULE_COLUMN + 4 * axis + order, axis, order, &self->mechanism->column[axis],
                           is_free ? 1 : k_pulled_times[order]);
            }
        }
    }
    self->pose_judged += is_followed;
    self->pose_age = is_followed ? self->pose_age + 1 : 0;
    self->free_age = is_pulled ? 0 : self->free_age + 1;
}

/* ---- set-points that follow the actual positions ---- */

static void follow(rules_t *self)
{
    self->age = self->pose_age = 0;
    for (unsigned axis = 0; axis < POSE_COLUMNS; axis++) {
        if (self->mechanism->is_free[axis]) {
            allow(self, axis, true, false);
        }
    }
}

static void enter(rules_t *self, place_t place)
{
    const bool is_first_stopping = place == AT_OFF || place == AT_FAULT;
    const bool is_following = is_first_stopping || place == AT_HOMING || place == AT_ESTOP;
    self->is_limited = !is_following || (is_first_stopping && self->is_limited);
    self->has_rested = self->is_stopping_anew = false;
    self->still_rows = 0;
}

/* ---- rest and engage speed ---- */

static int64_t peak(const rules_t *self, unsigned order, unsigned first, bool with_angle)
{
    int64_t most = 0;
    for (unsigned column = first; column < COLUMNS; column++) {
        if (is_mover(self, column) && (with_angle || column != ANGLE_COLUMN)) {
            most = larger(most, magnitude(self->difference[order][column]));
        }
    }
    return most;
}

static void expect_rest(rules_t *self, int64_t movement)
{
    int64_t pose = 0;
    for (unsigned axis = 0; axis < POSE_COLUMNS; axis++) {
        pose = larger(pose, magnitude(self->difference[1][axis]));
    }
    if (movement > 0) {
        find(self, RULE_REST, FIRST_CYLINDER, movement);
    }
    if (pose > POSE_NOISE) {
        find(self, RULE_REST, 0, pose);
    }
}

/* A hold stays where it has come to rest. */
static void check_hold(rules_t *self, int64_t movement, bool is_still)
{
    if (self->has_rested) {
        expect_rest(self, movement);
        return;
    }
    self->still_rows = is_still ? self->still_rows + 1 : 0;
    self->has_rested = self->still_rows >= REST_ROWS;
}

/* After the stop it begins with, engage speed and acceleration; a hold and a park in one cycle make another such stop. */
static void check_gentle(rules_t *self, bool is_still)
{
    self->has_rested = self->has_rested || self->was_still;
    if (!self->has_rested) {
        return;
    }
    const int64_t speed = peak(self, 1, FIRST_CYLINDER, false), accel = peak(self, 2, FIRST_CYLINDER, false);
    self->is_stopping_anew |= accel > self->mechanism->engage.most[2] && speed < self->last_speed;
    for (unsigned i = 0; i < self->mechanism->cylinders; i++) {
        check_rate(self, RULE_ENGAGE_SPEED, FIRST_CYLINDER + i, 1, &self->mechanism->engage, 1);
        if (!self->is_stopping_anew) {
            check_rate(self, RULE_ENGAGE_ACCEL, FIRST_CYLINDER + i, 2, &self->mechanism->engage, 1);
        }
    }
    self->is_stopping_anew = self->is_stopping_anew && !is_still;
}

static void check_rest(rules_t *self, place_t place, bool is_placed_anew, bool is_still)
{
    const int64_t movement = peak(self, 1, ANGLE_COLUMN, true);
    if (place == AT_SETTLED || place == AT_NEUTRAL) {
        if (!is_placed_anew) {
            expect_rest(self, movement);
        }
    } else if (place == AT_HOLD) {
        check_hold(self, movement, is_still);
    } else if (place == AT_RISING || place == AT_SETTLING) {
        check_gentle(self, is_still);
    }
}

/* ---- kinematics ---- */

static void check_kinematics(rules_t *self)
{
    double pose[POSE_COLUMNS], mm[6];
    for (unsigned axis = 0; axis < POSE_COLUMNS; axis++) {
        pose[axis] = (double)self->difference[0][axis] / 1e9;
    }
    mechanism_extensions(self->mechanism, pose, mm);
    double worst = 0;
    unsigned column = FIRST_CYLINDER;
    for (unsigned i = 0; i < self->mechanism->cylinders; i++) {
        const double error = fabs(mm[i] - (double)self->difference[0][FIRST_CYLINDER + i] / 1e9);
        column = error > worst ? FIRST_CYLINDER + i : column;
        worst = fmax(worst, error);
    }
    const double guide = mechanism_guide_error(self->mechanism, pose);
    self->worst[RULE_AGREE] = fmax(self->worst[RULE_AGREE], worst);
    self->worst[RULE_GUIDE] = fmax(self->worst[RULE_GUIDE], guide);
    if (!(worst <= AGREE_MM)) {
        find(self, RULE_AGREE, column, (int64_t)(worst * 1e9));
    }
    if (!(guide <= AGREE_MM)) {
        find(self, RULE_GUIDE, 2, (int64_t)(guide * 1e9));
    }
}

/* ---- rows ---- */

static void difference(rules_t *self, const row_t *row)
{
    for (unsigned column = 0; column < COLUMNS; column++) {
        int64_t value = row->value[column];
        for (unsigned order = 0; order < ORDERS; order++) {
            const int64_t before = self->rows > 0 ? self->difference[order][column] : order == 0 ? value : 0;
            self->difference[order][column] = value;
            value -= before;
        }
    }
}

/* What the platform does not have stays zero, and the next row is one cycle later. */
static void check_form(rules_t *self, const row_t *row, uint64_t last_us)
{
    for (unsigned column = ANGLE_COLUMN; column < COLUMNS; column++) {
        if (!is_mover(self, column) && row->value[column] != 0) {
            find(self, RULE_FORMAT, column, row->value[column]);
        }
    }
    if (self->rows > 0 && row->t_us != last_us + self->mechanism->cycle_us) {
        find(self, RULE_TIME, 0, (int64_t)(row->t_us - last_us));
    }
}

static void count(rules_t *self, const row_t *row)
{
    self->rows++;
    self->judged += self->is_limited;
    self->in_place[row->place]++;
    for (unsigned bit = 0; bit < FLAG_COUNT; bit++) {
        self->with_flag[bit] += (row->flags >> bit) & 1u;
    }
}

void rules_init(rules_t *self, const mechanism_t *mechanism)
{
    *self = (rules_t){.mechanism = mechanism};
}

void rules_bad_line(rules_t *self)
{
    find(self, RULE_FORMAT, 0, 0);
}

void rules_row(rules_t *self, const row_t *row)
{
    const bool is_first = self->rows == 0;
    const place_t before = self->last.place;
    const uint64_t last_us = self->last.t_us;
    self->last = *row;
    check_form(self, row, last_us);
    difference(self, row);
    if (is_first || row->place != before) {
        enter(self, row->place);
        self->was_still |= is_first;
    }
    const bool is_placed_anew = !is_first && row->place != before &&
                                (before == AT_OFF || before == AT_HOMING || before == AT_FAULT || before == AT_ESTOP);
    if (row->place == AT_SERVICE) {
        self->is_limited = (row->flags & FLAG_LOOSE) == 0;
    }
    const bool is_still = larger(peak(self, 1, ANGLE_COLUMN, true), peak(self, 2, ANGLE_COLUMN, true)) == 0;
    if (self->is_limited) {
        check_movers(self);
        check_pose(self, row->flags);
    } else {
        follow(self);
    }
    check_rest(self, row->place, is_placed_anew, is_still);
    if ((row->flags & FLAG_NO_POSE) == 0) {
        check_kinematics(self);
    }
    count(self, row);
    self->is_limited = self->is_limited && !(is_still && (row->place == AT_OFF || row->place == AT_FAULT));
    self->was_still = is_still;
    self->last_speed = peak(self, 1, FIRST_CYLINDER, false);
}

/* ---- the report ---- */

static const char *rule_name(unsigned rule, char text[32])
{
    static const char *const k_orders[ORDERS] = {"position", "speed", "accel", "jerk"};
    static const char *const k_others[] = {
        "format", "time", "pose and cylinders agree", "pose is one the guides allow", "rest", "engage speed", "engage accel"};
    if (rule >= RULE_FORMAT) {
        return k_others[rule - RULE_FORMAT];
    }
    const unsigned column = rule / 4, order = rule % 4;
    const char *name = row_column_name(column);
    if (column >= FIRST_CYLINDER) {
        (void)snprintf(text, 32, "%s %s", order == 0 ? name : "cylinder", order == 0 ? "stroke" : k_orders[order]);
    } else {
        (void)snprintf(text, 32, "%.*s %s", (int)strcspn(name, "_"), name, k_orders[order]);
    }
    return text;
}

uint64_t rules_broken(const rules_t *self)
{
    uint64_t total = 0;
    for (unsigned rule = 0; rule < RULES; rule++) {
        total += self->broken[rule];
    }
    return total;
}

/* A line for each rule of one kind of them: what was broken, or the worst that was seen. */
static void report_rules(const rules_t *self, FILE *to)
{
    char text[32];
    for (unsigned rule = 0; rule < RULES; rule++) {
        if (self->broken[rule] > 0) {
            fprintf(to, "broken %" PRIu64 " %s\n", self->broken[rule], rule_name(rule, text));
        }
        if (self->worst[rule] > 0) {
            fprintf(to, "worst %.9g %s%s%s\n", self->worst[rule], rule < RULE_FORMAT ? row_column_name(rule / 4) : "",
                    rule < RULE_FORMAT ? ", " : "", rule_name(rule, text));
        }
    }
}

void rules_report(const rules_t *self, FILE *to)
{
    char text[32];
    fprintf(to, "rows %" PRIu64 "\njudged %" PRIu64 "\npose %" PRIu64 "\n", self->rows, self->judged, self->pose_judged);
    for (unsigned i = 0; i < PLACES; i++) {
        if (self->in_place[i] > 0) {
            fprintf(to, "state %" PRIu64 " %s\n", self->in_place[i], row_place_name((place_t)i));
        }
    }
    for (unsigned i = 0; i < FLAG_COUNT; i++) {
        if (self->with_flag[i] > 0) {
            fprintf(to, "flag %" PRIu64 " %s\n", self->with_flag[i], row_flag_name(i));
        }
    }
    report_rules(self, to);
    for (unsigned i = 0; i < self->found_count; i++) {
        const found_t *found = &self->found[i];
        fprintf(to, "found at %.3f ms: %s, %s: %" PRId64 "e-9 per cycle^%u\n", (double)found->t_us / 1000,
                row_column_name(found->column), rule_name(found->rule, text), found->value,
                found->rule < RULE_FORMAT ? found->rule % 4 : 0);
    }
}

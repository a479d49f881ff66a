/* SPDX-License-Identifier: MIT
 * following.c - whether a platform goes where it is sent; see following.h.
 */
#include "following.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LINE_BYTES       1024u
#define RANGE_US         2000000u /* the longest way at full speed takes less */
#define RANGED_US        50000u   /* a range is found anew so often */
#define APART_US         250000u  /* samples further apart are steps, not a stream */
#define STEP_US          40000u
#define STEPS            4u       /* the newest samples' steps count */
#define PERIODS          5u       /* a steady stream is met in so many, and ... */
#define LATE_US          25000u   /* ... so much for jitter and the cycle */
#define SETTLING_US      2500000u /* after its start; a slow one: */
#define SETTLING_PERIODS 40u
#define PERIOD_MIN_US    4000u /* of faster streams every so manyth sample is taken */
/* What is known to be left, 2.4 mm at most in the streams tried: values that come beside their time ask for accelerations beyond
 * the limits, and the way back to the curve swings out. */
#define SLACK     3000000000.0
#define QUANTUM   16000 /* frames are read to 2^-16 */
#define FOUND_MAX 20u
#define SAME_US   500000u /* what is found again so soon is not printed again */

static const char *const k_rules[FOLLOWING_RULES] = {"range", "steady stream", "rest on the last frame"};

/* ---- frames ---- */

static void *grown(void *list, unsigned long count, size_t size)
{
    if ((count & (count - 1)) != 0) {
        return list;
    }
    void *longer = realloc(list, (count == 0 ? 1 : 2 * count) * size);
    if (longer == NULL) {
        fputs("out of memory\n", stderr);
        exit(2);
    }
    return longer;
}

/* The column of a frame's value; COLUMNS: none that is judged. */
static unsigned column_of(const following_t *self, bool is_pose, unsigned which)
{
    static const unsigned k_tripod[] = {0, 1, 5};
    const unsigned cylinders = self->mechanism->cylinders;
    if (which >= cylinders) {
        return COLUMNS;
    }
    return !is_pose ? FIRST_CYLINDER + which : cylinders == 6 ? which : k_tripod[which];
}

/* How far the samples have gone since the one before, or in STEP_US: a motion goes on for so long where samples are missing. */
static void note_step(const following_t *self, sample_t *sample)
{
    for (unsigned long i = self->samples; i > 0; i--) {
        const sample_t *before = &self->sample[i - 1];
        const uint64_t gap_us = sample->t_us - before->t_us;
        if (before->is_pose != sample->is_pose || gap_us > APART_US || (i < self->samples && gap_us > STEP_US)) {
            return;
        }
        for (unsigned column = 0; column < COLUMNS; column++) {
            const int64_t step = llabs(sample->value[column] - before->value[column]);
            sample->step[column] = step > sample->step[column] ? step : sample->step[column];
        }
    }
}

static void take_frame(following_t *self, double ms, const char *text)
{
    sample_t sample = {.t_us = (uint64_t)llround(ms * 1000), .is_pose = text[1] == 'A'};
    const char *at = strchr(text, ':');
    if (at == NULL) {
        return;
    }
    for (unsigned which = 0;; which++) {
        char *end;
        const double value = strtod(at + 1, &end);
        const unsigned column = column_of(self, sample.is_pose, which);
        if (*end != ',' || column == COLUMNS) {
            break;
        }
        sample.value[column] = llround(value * 1e9);
        at = end;
    }
    note_step(self, &sample);
    self->sample = grown(self->sample, self->samples, sizeof sample);
    self->sample[self->samples++] = sample;
}

static void take_claim(following_t *self, double from_ms, double to_ms, unsigned long period_us)
{
    self->claim = grown(self->claim, self->claims, sizeof self->claim[0]);
    self->claim[self->claims++] = (claim_t){(uint64_t)(from_ms * 1000), (uint64_t)(to_ms * 1000), period_us};
}

/* So many numbers behind a word; 0 where there is none. */
static void take_numbers(const char *at, double *number, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        char *end;
        number[i] = strtod(at, &end);
        at = end;
    }
}

static void take_line(following_t *self, const char *line)
{
    static const char k_steady[] = "; steady ", k_rest[] = "; rest ";
    double number[3];
    if (strncmp(line, k_steady, sizeof k_steady - 1) == 0) {
        take_numbers(line + sizeof k_steady - 1, number, 3);
        take_claim(self, number[0], number[1], (unsigned long)number[2]);
    } else if (strncmp(line, k_rest, sizeof k_rest - 1) == 0) {
        take_numbers(line + sizeof k_rest - 1, number, 2);
        take_claim(self, number[0], number[1], 0);
    } else if (*line != ';' && strchr(line, '@') != NULL) {
        take_numbers(line, number, 1);
        take_frame(self, number[0], strchr(line, '@'));
    }
}

bool following_read(following_t *self, const mechanism_t *mechanism, const char *path)
{
    char line[LINE_BYTES];
    FILE *file = fopen(path, "r");
    *self = (following_t){.mechanism = mechanism};
    if (file == NULL) {
        perror(path);
        return false;
    }
    while (fgets(line, sizeof line, file) != NULL) {
        take_line(self, line);
    }
    (void)fclose(file);
    if (self->samples == 0) {
        fprintf(stderr, "%s: no frames\n", path);
    }
    return self->samples > 0;
}

/* ---- findings ---- */

static void judge(following_t *self, following_rule_t rule, const row_t *row, unsigned column, double beyond, FILE *to)
{
    self->worst[rule] = fmax(self->worst[rule], beyond / 1e9);
    if (beyond <= 0) {
        return;
    }
    self->broken[rule]++;
    const bool is_same = row->t_us < self->found_us[rule][column] + SAME_US;
    self->found_us[rule][column] = row->t_us;
    if (!is_same && self->found++ < FOUND_MAX) {
        fprintf(to, "found at %.3f ms: %s, %s: %.6f beyond, at %.6f\n", (double)row->t_us / 1000, row_column_name(column),
                k_rules[rule], beyond / 1e9, (double)row->value[column] / 1e9);
    }
}

/* ---- ranges ---- */

static void include(following_t *self, unsigned column, int64_t value)
{
    self->low[column] = value < self->low[column] ? value : self->low[column];
    self->high[column] = value > self->high[column] ? value : self->high[column];
}

/* Of the newest samples of this space, back to the one that was the newest when RANGE_US began. */
static void find_range(following_t *self, const row_t *row)
{
    const bool is_pose = (row->flags & FLAG_CYLINDERS) == 0;
    const uint64_t since_us = row->t_us > RANGE_US ? row->t_us - RANGE_US : 0;
    self->ranged_us = row->t_us;
    for (unsigned column = 0; column < COLUMNS; column++) {
        self->low[column] = INT64_MAX;
        self->high[column] = INT64_MIN;
        if (self->entered_us >= since_us) {
            include(self, column, self->entered[column]);
        }
    }
    for (unsigned long i = self->next; i > 0 && self->sample[i - 1].is_pose == is_pose; i--) {
        for (unsigned column = 0; column < COLUMNS; column++) {
            include(self, column, self->sample[i - 1].value[column]);
        }
        if (self->sample[i - 1].t_us < since_us) {
            break;
        }
    }
}

/* How far an axis goes on that stops with its own limits. */
static double stopping(const bounds_t *bounds, int64_t speed, int64_t push)
{
    const double accel = bounds->exact[2], jerk = bounds->exact[3], a = fabs((double)push);
    const double fastest = fabs((double)speed) + a * a / (2 * jerk); /* once it has stopped to accelerate */
    const double easing = a / jerk * (fabs((double)speed) + a * a / (3 * jerk));
    const double braking =
        fastest < accel * accel / jerk ? fastest * sqrt(fastest / jerk) : fastest / 2 * (fastest / accel + accel / jerk);
    return easing + braking;
}

static int64_t largest_step(const following_t *self, unsigned column)
{
    int64_t most = 0;
    for (unsigned long i = self->next; i > 0 && self->next - i < STEPS; i--) {
        most = self->sample[i - 1].step[column] > most ? self->sample[i - 1].step[column] : most;
    }
    return most;
}

static void judge_side(following_t *self, const row_t *row, unsigned column, bool is_above, double shrunk, FILE *to)
{
    double *room = &self->room[column][is_above];
    const int64_t value = row->value[column], speed = value - self->last[column];
    const double outside = (double)(is_above ? value - self->high[column] : self->low[column] - value);
    if (outside <= 0) {
        *room = stopping(&self->mechanism->column[column], speed, speed - self->last_speed[column]);
        return;
    }
    *room += fmax(0, shrunk);
    judge(self, FOLLOWING_RANGE, row, column, outside - *room - (double)largest_step(self, column) - SLACK, to);
}

static void judge_range(following_t *self, const row_t *row, unsigned column, int64_t low, int64_t high, FILE *to)
{
    judge_side(self, row, column, false, (double)self->low[column] - (double)low, to);
    judge_side(self, row, column, true, (double)high - (double)self->high[column], to);
    self->judged[FOLLOWING_RANGE]++;
}

/* ---- claims ---- */

static void judge_steady(following_t *self, const row_t *row, const claim_t *claim, unsigned column, FILE *to)
{
    const uint64_t period_us = claim->period_us > PERIOD_MIN_US ? claim->period_us : 2 * (uint64_t)PERIOD_MIN_US;
    const uint64_t since_us = row->t_us - PERIODS * period_us - LATE_US;
    int64_t low = INT64_MAX, high = INT64_MIN, step = 0;
    for (unsigned long i = self->next; i > 0 && self->sample[i - 1].t_us >= since_us; i--) {
        const sample_t *sample = &self->sample[i - 1];
        low = sample->value[column] < low ? sample->value[column] : low;
        high = sample->value[column] > high ? sample->value[column] : high;
        step = sample->step[column] > step ? sample->step[column] : step;
    }
    const double off = fmax((double)low - (double)row->value[column], (double)row->value[column] - (double)high);
    judge(self, FOLLOWING_STEADY, row, column, off - (double)step - SLACK, to);
    self->judged[FOLLOWING_STEADY]++;
}

static void judge_rest(following_t *self, const row_t *row, unsigned column, FILE *to)
{
    const double off = (double)llabs(row->value[column] - self->sample[self->next - 1].value[column]);
    const double moved = (double)llabs(row->value[column] - self->last[column]);
    judge(self, FOLLOWING_REST, row, column, fmax(off - QUANTUM, moved), to);
    self->judged[FOLLOWING_REST]++;
}

/* The claim that holds for this row, NULL = none. */
static const claim_t *claim_at(following_t *self, uint64_t t_us)
{
    while (self->claim_next < self->claims && self->claim[self->claim_next].to_us < t_us) {
        self->claim_next++;
    }
    if (self->claim_next == self->claims) {
        return NULL;
    }
    const claim_t *claim = &self->claim[self->claim_next];
    const uint64_t slow_us = SETTLING_PERIODS * claim->period_us;
    const uint64_t settling_us = claim->period_us == 0 ? 0 : slow_us > SETTLING_US ? slow_us : SETTLING_US;
    return t_us > claim->from_us + settling_us ? claim : NULL;
}

/* ---- rows ---- */

static bool is_judged(const following_t *self, const row_t *row)
{
    return row->place == AT_ENGAGED && (row->flags & (FLAG_TAKEOVER | FLAG_CLAMPED | FLAG_NO_POSE)) == 0 && self->next > 0 &&
           self->sample[self->next - 1].is_pose == ((row->flags & FLAG_CYLINDERS) == 0);
}

static void begin(following_t *self, const row_t *row)
{
    self->entered_us = row->t_us;
    memcpy(self->entered, row->value, sizeof self->entered);
    for (unsigned column = 0; column < COLUMNS; column++) {
        const int64_t speed = row->value[column] - self->last[column];
        self->room[column][0] = self->room[column][1] =
            stopping(&self->mechanism->column[column], speed, speed - self->last_speed[column]);
    }
}

static void judge_columns(following_t *self, const row_t *row, FILE *to)
{
    int64_t low[COLUMNS], high[COLUMNS];
    const claim_t *claim = claim_at(self, row->t_us);
    memcpy(low, self->low, sizeof low);
    memcpy(high, self->high, sizeof high);
    if (row->t_us >= self->ranged_us + RANGED_US) {
        find_range(self, row);
    }
    for (unsigned which = 0; which < self->mechanism->cylinders; which++) {
        const unsigned column = column_of(self, (row->flags & FLAG_CYLINDERS) == 0, which);
        judge_range(self, row, column, low[column], high[column], to);
        if (claim != NULL && claim->period_us > 0) {
            judge_steady(self, row, claim, column, to);
        } else if (claim != NULL) {
            judge_rest(self, row, column, to);
        }
    }
}

void following_row(following_t *self, const row_t *row, FILE *to)
{
    const unsigned long before = self->next;
    for (; self->next < self->samples && self->sample[self->next].t_us <= row->t_us; self->next++) {
        for (unsigned column = 0; column < COLUMNS; column++) {
            include(self, column, self->sample[self->next].value[column]);
        }
    }
    const bool is_following = is_judged(self, row);
    const bool is_space_new = before > 0 && self->sample[before - 1].is_pose != ((row->flags & FLAG_CYLINDERS) == 0);
    if (is_following && (!self->is_following || is_space_new)) {
        begin(self, row);
        find_range(self, row);
    }
    self->is_following = is_following;
    if (is_following) {
        judge_columns(self, row, to);
    }
    for (unsigned column = 0; column < COLUMNS; column++) {
        self->last_speed[column] = row->value[column] - self->last[column];
        self->last[column] = row->value[column];
    }
}

uint64_t following_report(const following_t *self, FILE *to)
{
    uint64_t total = 0;
    for (unsigned rule = 0; rule < FOLLOWING_RULES; rule++) {
        fprintf(to, "followed %" PRIu64 " %s\n", self->judged[rule], k_rules[rule]);
        if (self->broken[rule] > 0) {
            fprintf(to, "broken %" PRIu64 " %s\nbeyond %.6f %s\n", self->broken[rule], k_rules[rule], self->worst[rule],
                    k_rules[rule]);
        }
        total += self->broken[rule];
    }
    return total;
}

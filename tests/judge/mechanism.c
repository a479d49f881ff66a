/* SPDX-License-Identifier: MIT
 * mechanism.c - reads a configuration for the judge, and solves the inverse kinematics in double precision; see mechanism.h.
 */
#include "mechanism.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ENTRIES_MAX 512u
#define WORD_MAX    128u
#define LINE_MAX    512u

typedef struct {
    char section[WORD_MAX], key[WORD_MAX], value[LINE_MAX];
} entry_t;

typedef struct {
    entry_t entry[ENTRIES_MAX];
    unsigned count;
    const char *path;
    bool is_good;
} ini_t;

/* ---- the file ---- */

/* Without blanks at both ends; in place. */
static char *trimmed(char *text)
{
    text += strspn(text, " \t");
    size_t length = strlen(text);
    while (length > 0 && strchr(" \t\r\n", text[length - 1]) != NULL) {
        text[--length] = '\0';
    }
    return text;
}

/* A comment within a line begins with a semicolon after a blank. */
static void cut_comment(char *text)
{
    for (char *at = strchr(text, ';'); at != NULL; at = strchr(at + 1, ';')) {
        if (at > text && (at[-1] == ' ' || at[-1] == '\t')) {
            *at = '\0';
            return;
        }
    }
}

static void take_line(ini_t *ini, char *section, char *line)
{
    char *text = trimmed(line);
    if (*text == '\0' || *text == ';' || *text == '#') {
        return;
    }
    cut_comment(text);
    text = trimmed(text);
    char *equals = strchr(text, '=');
    if (*text == '[') {
        (void)snprintf(section, WORD_MAX, "%.*s", (int)strcspn(text + 1, "]"), text + 1);
    } else if (equals != NULL && ini->count < ENTRIES_MAX) {
        entry_t *entry = &ini->entry[ini->count++];
        *equals = '\0';
        (void)snprintf(entry->section, sizeof entry->section, "%s", section);
        (void)snprintf(entry->key, sizeof entry->key, "%.*s", (int)sizeof entry->key - 1, trimmed(text));
        (void)snprintf(entry->value, sizeof entry->value, "%s", trimmed(equals + 1));
    } else {
        ini->is_good = false;
    }
}

static bool read_ini(ini_t *ini, const char *path)
{
    FILE *file = fopen(path, "r");
    char section[WORD_MAX] = "", line[LINE_MAX];
    *ini = (ini_t){.path = path, .is_good = true};
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        take_line(ini, section, line);
    }
    if (file == NULL || fclose(file) != 0 || !ini->is_good) {
        fprintf(stderr, "judge: %s cannot be read\n", path);
        return false;
    }
    return true;
}

/* The value of a key, or what stands for it where it is missing: NULL makes that an error. */
static const char *text_of(ini_t *ini, const char *section, const char *key, const char *missing)
{
    for (unsigned i = 0; i < ini->count; i++) {
        if (strcmp(ini->entry[i].section, section) == 0 && strcmp(ini->entry[i].key, key) == 0) {
            return ini->entry[i].value;
        }
    }
    if (missing == NULL) {
        fprintf(stderr, "judge: %s: [%s] %s is not stated\n", ini->path, section, key);
        ini->is_good = false;
        return "0";
    }
    return missing;
}

/* Numbers, comma between them; a single one stands for all. Each is the nearest multiple of 2^-16, what a configuration can hold.
 */
static void numbers_of(ini_t *ini, const char *section, const char *key, const char *missing, unsigned count, long double *to)
{
    const char *at = text_of(ini, section, key, missing);
    unsigned found = 0;
    char *end = NULL;
    for (; found < count; found++) {
        to[found] = rintl(strtold(at, &end) * 65536) / 65536;
        if (end == at || *(end + strspn(end, " \t")) != ',') {
            break;
        }
        at = strchr(end, ',') + 1;
    }
    const bool is_single = found == 0 && end != at && count > 1;
    for (unsigned i = 1; is_single && i < count; i++) {
        to[i] = to[0];
    }
    if (end == at || *(end + strspn(end, " \t")) != '\0' || !(is_single || found + 1 == count)) {
        fprintf(stderr, "judge: %s: [%s] %s: %u numbers are needed\n", ini->path, section, key, count);
        ini->is_good = false;
    }
}

static long double number_of(ini_t *ini, const char *section, const char *key, const char *missing)
{
    long double value = 0;
    numbers_of(ini, section, key, missing, 1, &value);
    return value;
}

/* ---- limits ---- */

static void set_rate(bounds_t *bounds, unsigned order, long double stated, uint64_t cycle_us)
{
    static const int k_rounding[ORDERS] = {0, 1, 2, 4};
    long double scaled = stated * 1e9L, divisor = 1;
    for (unsigned i = 0; i < order; i++) {
        scaled *= (long double)cycle_us;
        divisor *= 1e6L;
    }
    bounds->stated[order] = (double)stated;
    bounds->exact[order] = (double)(scaled / divisor);
    bounds->most[order] = (int64_t)floorl(scaled / divisor + k_rounding[order]);
}

static void set_range(bounds_t *bounds, long double low, long double high)
{
    bounds->low = (int64_t)floorl(low * 1e9L);
    bounds->high = (int64_t)ceill(high * 1e9L);
}

static void read_axis(mechanism_t *self, ini_t *ini, unsigned column, const char *name, const char *unit)
{
    bounds_t *bounds = &self->column[column];
    char key[WORD_MAX], low[WORD_MAX];
    (void)snprintf(low, sizeof low, "min_%s", unit);
    (void)snprintf(key, sizeof key, "max_%s", unit);
    set_range(bounds, number_of(ini, name, low, NULL), number_of(ini, name, key, NULL));
    (void)snprintf(key, sizeof key, "speed_%s_s", unit);
    set_rate(bounds, 1, number_of(ini, name, key, NULL), self->cycle_us);
    (void)snprintf(key, sizeof key, "accel_%s_s2", unit);
    set_rate(bounds, 2, number_of(ini, name, key, NULL), self->cycle_us);
    (void)snprintf(key, sizeof key, "jerk_%s_s3", unit);
    set_rate(bounds, 3, number_of(ini, name, key, NULL), self->cycle_us);
}

static void read_axes(mechanism_t *self, ini_t *ini)
{
    static const char *const k_axes[POSE_COLUMNS] = {"roll", "pitch", "yaw", "x", "y", "z"};
    for (unsigned i = 0; i < POSE_COLUMNS; i++) {
        self->is_free[i] = self->kind == HEXAPOD || i < 2 || i == 5;
        if (self->is_free[i]) {
            read_axis(self, ini, i, k_axes[i], i < 3 ? "deg" : "mm");
        }
    }
    self->has_angle = strcmp(text_of(ini, "angle", "present", "no"), "yes") == 0;
    if (self->has_angle) {
        read_axis(self, ini, ANGLE_COLUMN, "angle", "deg");
    }
}

static void read_cylinders(mechanism_t *self, ini_t *ini)
{
    const long double margin = number_of(ini, "cylinders", "margin_mm", NULL);
    long double stroke[6];
    numbers_of(ini, "geometry", "stroke_mm", NULL, self->cylinders, stroke);
    for (unsigned i = 0; i < self->cylinders; i++) {
        bounds_t *bounds = &self->column[FIRST_CYLINDER + i];
        set_range(bounds, margin, stroke[i] - margin);
        set_rate(bounds, 1, number_of(ini, "cylinders", "speed_mm_s", NULL), self->cycle_us);
        set_rate(bounds, 2, number_of(ini, "cylinders", "accel_mm_s2", NULL), self->cycle_us);
        set_rate(bounds, 3, number_of(ini, "cylinders", "jerk_mm_s3", NULL), self->cycle_us);
    }
    set_rate(&self->engage, 1, number_of(ini, "engage", "speed_mm_s", NULL), self->cycle_us);
    set_rate(&self->engage, 2, number_of(ini, "engage", "accel_mm_s2", NULL), self->cycle_us);
}

/* ---- geometry ---- */

static void read_point(ini_t *ini, const char *name, unsigned number, double to[3])
{
    char key[WORD_MAX];
    long double at[3] = {0};
    (void)snprintf(key, sizeof key, "%s%u_mm", name, number);
    numbers_of(ini, "geometry", key, NULL, 3, at);
    for (unsigned i = 0; i < 3; i++) {
        to[i] = (double)at[i];
    }
}

/* 3-RPS: on the circle of joint 1, at 0, 120 and 240 degrees, where ideal hinges hold them. */
static void place_hinges(mechanism_t *self, const double plate_mm[6][3], const double mrp_mm[3])
{
    const double radius = hypot(plate_mm[0][0], plate_mm[0][1]);
    for (unsigned i = 0; i < 3; i++) {
        const double turn = i * acos(-1) * 2 / 3;
        self->hinge_mm[i][0] = radius * cos(turn) - mrp_mm[0];
        self->hinge_mm[i][1] = radius * sin(turn) - mrp_mm[1];
        self->hinge_mm[i][2] = plate_mm[0][2] - mrp_mm[2];
    }
}

static void read_geometry(mechanism_t *self, ini_t *ini)
{
    double plate_mm[6][3] = {{0}}, mrp_mm[3];
    long double mrp[3], retracted[6];
    numbers_of(ini, "geometry", "mrp_mm", "0, 0, 0", 3, mrp);
    numbers_of(ini, "geometry", "retracted_length_mm", NULL, self->cylinders, retracted);
    for (unsigned k = 0; k < 3; k++) {
        mrp_mm[k] = (double)mrp[k];
        self->centre_mm[k] = mrp_mm[k];
    }
    self->centre_mm[2] += (double)number_of(ini, "geometry", "zero_height_mm", NULL);
    for (unsigned i = 0; i < self->cylinders; i++) {
        read_point(ini, "base", i + 1, self->base_mm[i]);
        read_point(ini, "plate", i + 1, plate_mm[i]);
        self->retracted_mm[i] = (double)retracted[i];
        for (unsigned k = 0; k < 3; k++) {
            self->arm_mm[i][k] = plate_mm[i][k] - mrp_mm[k];
        }
    }
    place_hinges(self, (const double(*)[3])plate_mm, mrp_mm);
}

static bool read_kind(mechanism_t *self, ini_t *ini)
{
    static const char *const k_kinds[] = {[HEXAPOD] = "hexapod", [TRIPOD_GUIDED] = "tripod", [TRIPOD_3RPS] = "tripod-3rps"};
    const char *kind = text_of(ini, "platform", "kind", NULL);
    for (unsigned i = 0; i < 3; i++) {
        if (strcmp(kind, k_kinds[i]) == 0) {
            self->kind = (mechanism_kind_t)i;
            self->cylinders = self->kind == HEXAPOD ? 6 : 3;
            return true;
        }
    }
    fprintf(stderr, "judge: %s: [platform] kind = %s is unknown\n", ini->path, kind);
    return false;
}

bool mechanism_read(mechanism_t *self, const char *path)
{
    static ini_t s_ini;
    *self = (mechanism_t){0};
    if (!read_ini(&s_ini, path) || !read_kind(self, &s_ini)) {
        return false;
    }
    self->cycle_us = (uint64_t)number_of(&s_ini, "platform", "cycle_us", "1000");
    read_axes(self, &s_ini);
    read_cylinders(self, &s_ini);
    read_geometry(self, &s_ini);
    return s_ini.is_good && self->cycle_us > 0;
}

/* ---- kinematics ---- */

/* Turns two coordinates by an angle whose cosine and sine are given. */
static void turn(double *a, double *b, double cosine, double sine)
{
    const double was = *a;
    *a = was * cosine - *b * sine;
    *b = was * sine + *b * cosine;
}

/* Where a point of the plate is: rolled, then pitched, then yawed, then moved. */
static void place(const mechanism_t *self, const double pose[POSE_COLUMNS], const double cosine[3], const double sine[3],
                  const double arm[3], double at[3])
{
    memcpy(at, arm, 3 * sizeof *at);
    turn(&at[1], &at[2], cosine[0], sine[0]);
    turn(&at[2], &at[0], cosine[1], sine[1]);
    turn(&at[0], &at[1], cosine[2], sine[2]);
    for (unsigned k = 0; k < 3; k++) {
        at[k] += self->centre_mm[k] + pose[3 + k];
    }
}

static void trigonometry(const double pose[POSE_COLUMNS], double cosine[3], double sine[3])
{
    for (unsigned k = 0; k < 3; k++) {
        const double angle = pose[k] * acos(-1) / 180;
        cosine[k] = cos(angle);
        sine[k] = sin(angle);
    }
}

void mechanism_extensions(const mechanism_t *self, const double pose[POSE_COLUMNS], double mm[6])
{
    double cosine[3], sine[3], at[3];
    trigonometry(pose, cosine, sine);
    for (unsigned i = 0; i < self->cylinders; i++) {
        place(self, pose, cosine, sine, self->arm_mm[i], at);
        const double dx = at[0] - self->base_mm[i][0], dy = at[1] - self->base_mm[i][1], dz = at[2] - self->base_mm[i][2];
        mm[i] = sqrt(dx * dx + dy * dy + dz * dz) - self->retracted_mm[i];
    }
}

double mechanism_guide_error(const mechanism_t *self, const double pose[POSE_COLUMNS])
{
    if (self->kind == HEXAPOD) {
        return 0;
    }
    if (self->kind == TRIPOD_GUIDED) {
        return fmax(fabs(pose[2]), fmax(fabs(pose[3]), fabs(pose[4])));
    }
    double cosine[3], sine[3], at[3], worst = 0;
    trigonometry(pose, cosine, sine);
    for (unsigned i = 0; i < 3; i++) {
        const double plane = i * acos(-1) * 2 / 3;
        place(self, pose, cosine, sine, self->hinge_mm[i], at);
        worst = fmax(worst, fabs(sin(plane) * at[0] - cos(plane) * at[1]));
    }
    return worst;
}

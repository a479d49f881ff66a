/* SPDX-License-Identifier: MIT
 * configure.c - from answers to a configuration: the file that was begun from, with what was answered in its place.
 */
#include "setup/configure.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/translate.h"
#include "setup/answers.h"
#include "setup/distances.h"
#include "setup/legs_seen.h"
#include "setup/lengths.h"

#define CYLINDERS SETUP_DRIVES_MAX

/* Which drive, which way, how far: by cylinder, from 0. */
typedef struct {
    unsigned count;
    unsigned drive[CYLINDERS];
    bool is_reversed[CYLINDERS];
    unsigned times[CYLINDERS], parts[CYLINDERS];
} legs_t;

static bool is_driver(const setup_t *self, const char *driver)
{
    return strcmp(setup_driver(self), driver) == 0;
}

/* Where the keys of the drives are. */
static const char *section_of(const setup_t *self)
{
    return strncmp(setup_driver(self), "modbus", 6) == 0 ? "modbus" : setup_driver(self);
}

/* A list in the file, of which one value stands for all. */
static double nth_of_file(const setup_t *self, const char *section, const char *key, unsigned cylinder)
{
    char value[INI_VALUE_MAX];
    double number[CYLINDERS];
    const unsigned count = ini_text_get(&self->start, section, key, value) ? answers_list(value, number, CYLINDERS) : 0;
    return count == 0 ? 0 : number[cylinder <= count ? cylinder - 1u : 0];
}

double configure_retracted(const setup_t *self, unsigned cylinder)
{
    return setup_get(self, "retracted") != NULL ? answers_number(self, "retracted", 0)
                                                : nth_of_file(self, "geometry", "retracted_length_mm", cylinder);
}

double configure_stroke(const setup_t *self, unsigned cylinder)
{
    return setup_get(self, "stroke") != NULL ? answers_number(self, "stroke", 0)
                                             : nth_of_file(self, "geometry", "stroke_mm", cylinder);
}

static void set_number(ini_text_t *out, const char *section, const char *key, double value, const char *note)
{
    char text[64];
    (void)snprintf(text, sizeof text, "%.10g", value);
    ini_text_set(out, section, key, text, note);
}

/* An answer as it is, where there is one. */
static void set_answer(const setup_t *self, ini_text_t *out, const char *answer, const char *section, const char *key,
                       const char *note)
{
    const char *text = setup_get(self, answer);
    if (text != NULL) {
        set_number(out, section, key, strtod(text, NULL), note);
    }
}

/* --- Joints --- */

static void drop_joints(ini_text_t *out)
{
    static const char *const k_sizes[] = {"base_radius_mm",  "base_spread_deg",  "base_turn_deg",
                                          "plate_radius_mm", "plate_spread_deg", "plate_turn_deg"};
    char key[32];
    for (size_t i = 0; i < sizeof k_sizes / sizeof k_sizes[0]; i++) {
        ini_text_drop(out, "geometry", k_sizes[i]);
    }
    for (unsigned i = 1; i <= CYLINDERS; i++) {
        (void)snprintf(key, sizeof key, "base%u_mm", i);
        ini_text_drop(out, "geometry", key);
        (void)snprintf(key, sizeof key, "plate%u_mm", i);
        ini_text_drop(out, "geometry", key);
    }
}

static void set_circle(const setup_t *self, ini_text_t *out, const char *set)
{
    char near[32], far[32], key[32];
    double radius_mm = 0, spread_deg = 0;
    (void)snprintf(near, sizeof near, "%s.near", set);
    (void)snprintf(far, sizeof far, "%s.far", set);
    lengths_circle(answers_number(self, near, 0), answers_number(self, far, 0), &radius_mm, &spread_deg);
    if (setup_cylinders(self) == 3u) {
        (void)snprintf(near, sizeof near, "%s.side", set);
        radius_mm = answers_number(self, near, 0) / sqrt(3);
    }
    (void)snprintf(key, sizeof key, "%s_radius_mm", set);
    set_number(out, "geometry", key, round(radius_mm * 1000) / 1000, _("from the measured distances"));
    if (setup_cylinders(self) == 6u) {
        (void)snprintf(key, sizeof key, "%s_spread_deg", set);
        set_number(out, "geometry", key, round(spread_deg * 10000) / 10000, NULL);
    }
}

static void set_fitted(const setup_t *self, ini_text_t *out, const char *set)
{
    double distance_mm[LENGTHS_PAIRS];
    lengths_found_t found;
    char key[32], value[64];
    if (!distances_get(self, set, distance_mm) ||
        !lengths_fit(strcmp(set, "base") == 0 ? LENGTHS_BASE : LENGTHS_PLATE, distance_mm, &found)) {
        return;
    }
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        (void)snprintf(key, sizeof key, "%s%u_mm", set, i + 1u);
        (void)snprintf(value, sizeof value, "%.2f, %.2f, 0", found.joint_mm[i][0], found.joint_mm[i][1]);
        ini_text_set(out, "geometry", key, value, i == 0 ? _("fitted to fifteen distances") : NULL);
    }
}

static void set_joints(const setup_t *self, ini_text_t *out, const char *set)
{
    char answer[32], key[32], value[96];
    for (unsigned i = 1; i <= setup_cylinders(self); i++) {
        double number[3] = {0};
        (void)snprintf(answer, sizeof answer, "%s.joint", set);
        const char *text = answers_get_nth(self, answer, i);
        if (text != NULL && answers_list(text, number, 3) > 0) {
            (void)snprintf(key, sizeof key, "%s%u_mm", set, i);
            (void)snprintf(value, sizeof value, "%.6g, %.6g, %.6g", number[0], number[1], number[2]);
            ini_text_set(out, "geometry", key, value, NULL);
        }
    }
}

/* Limits, heights and poses of the file belong to its own geometry. */
static void drop_limits(ini_text_t *out)
{
    static const char *const k_axes[] = {"roll", "pitch", "yaw", "x", "y", "z"};
    static const char *const k_keys[] = {"min_%s", "max_%s", "speed_%s_s", "accel_%s_s2", "jerk_%s_s3"};
    char key[32];
    for (unsigned axis = 0; axis < 6u; axis++) {
        for (size_t i = 0; i < sizeof k_keys / sizeof k_keys[0]; i++) {
            const char *percent = strchr(k_keys[i], '%');
            (void)snprintf(key, sizeof key, "%.*s%s%s", (int)(percent - k_keys[i]), k_keys[i], axis < 3u ? "deg" : "mm",
                           percent + 2);
            ini_text_drop(out, k_axes[axis], key);
        }
    }
}

static void set_geometry(const setup_t *self, ini_text_t *out)
{
    const char *geometry = setup_get(self, "geometry");
    set_answer(self, out, "retracted", "geometry", "retracted_length_mm", _("from joint to joint, fully in"));
    set_answer(self, out, "stroke", "geometry", "stroke_mm", NULL);
    if (geometry == NULL || strcmp(geometry, "k") == 0) {
        return;
    }
    static const char *const k_sets[] = {"base", "plate"};
    drop_joints(out);
    for (unsigned i = 0; i < 2u; i++) {
        if (strcmp(geometry, "s") == 0) {
            set_circle(self, out, k_sets[i]);
        } else if (strcmp(geometry, "t") == 0) {
            set_fitted(self, out, k_sets[i]);
        } else {
            set_joints(self, out, k_sets[i]);
        }
    }
    ini_text_drop(out, "geometry", "zero_height_mm");
    ini_text_drop(out, "pose", "neutral");
    drop_limits(out);
}

/* --- Drives --- */

static legs_t find_legs(const setup_t *self, setup_stage_t stage)
{
    legs_t legs = {.count = setup_cylinders(self)};
    legs_found_t found;
    char text[LEGS_TEXT_MAX];
    const bool is_found =
        stage >= SETUP_STAGE_LEGS && setup_get(self, "legs.verdict") != NULL && legs_seen(self, &found, text) == LEGS_FOUND;
    for (unsigned i = 0; i < legs.count; i++) {
        legs.drive[i] = is_found ? found.drive[i] : i;
        legs.is_reversed[i] = is_found && found.is_reversed[i];
        legs.times[i] = is_found ? found.times[i] : 1u;
        legs.parts[i] = is_found ? found.parts[i] : 1u;
    }
    return legs;
}

static double counts_per_mm(const setup_t *self, const legs_t *legs, unsigned leg)
{
    const double lead_mm = answers_number(self, "lead", 0) * legs->times[leg] / legs->parts[leg];
    return answers_number(self, "turn", 0) * answers_number(self, "gear", 0) / lead_mm * (legs->is_reversed[leg] ? -1 : 1);
}

/* A list of words, in the order of the cylinders. One number stands for itself and those that follow it. */
static void permute(const legs_t *legs, const char *list, char out[INI_VALUE_MAX])
{
    char copy[INI_VALUE_MAX], *word[CYLINDERS] = {NULL}, *rest = NULL;
    unsigned words = 0;
    size_t length = 0;
    (void)snprintf(copy, sizeof copy, "%s", list);
    for (char *at = strtok_r(copy, ", ", &rest); at != NULL && words < CYLINDERS; at = strtok_r(NULL, ", ", &rest)) {
        word[words++] = at;
    }
    out[0] = '\0';
    for (unsigned i = 0; i < legs->count && words > 0; i++) {
        const unsigned drive = legs->drive[i];
        length += (size_t)snprintf(&out[length], INI_VALUE_MAX - length, "%s", i > 0 ? ", " : "");
        length += words == 1u
                      ? (size_t)snprintf(&out[length], INI_VALUE_MAX - length, strncmp(word[0], "0x", 2) == 0 ? "0x%lX" : "%lu",
                                         strtoul(word[0], NULL, 0) + drive)
                      : (size_t)snprintf(&out[length], INI_VALUE_MAX - length, "%s", word[drive < words ? drive : 0]);
    }
}

static void permute_key(const setup_t *self, const legs_t *legs, const char *answer, const char *section, const char *key,
                        ini_text_t *out)
{
    char value[INI_VALUE_MAX], list[INI_VALUE_MAX];
    const char *text = answer != NULL ? setup_get(self, answer) : NULL;
    if (text != NULL || ini_text_get(out, section, key, value)) {
        permute(legs, text != NULL ? text : value, list);
        ini_text_set(out, section, key, list, _("in the order of the cylinders"));
    }
}

/* The serial number that a drive has told in the scan, as text; NULL: none. */
static const char *serial_of(const setup_t *self, double node)
{
    for (const char *at = setup_get(self, "scan"); at != NULL; at = strchr(at, ','), at = at != NULL ? at + 1 : NULL) {
        char *end = NULL;
        if (fabs(strtod(at, &end) - node) < 0.5 && end != at) {
            return *end == '/' ? end + 1 : NULL;
        }
    }
    return NULL;
}

/* So that a drive that is exchanged later is seen. Where none tells its number, what the file has goes with the drives. */
static void set_serials(const setup_t *self, const legs_t *legs, ini_text_t *out)
{
    double node[CYLINDERS];
    char value[INI_VALUE_MAX] = "";
    size_t length = 0;
    bool is_any = false;
    const unsigned count = answers_list(setup_get(self, "nodes"), node, CYLINDERS);
    for (unsigned i = 0; i < legs->count && legs->drive[i] < count; i++) {
        const char *serial = serial_of(self, node[legs->drive[i]]);
        is_any = is_any || serial != NULL;
        length += (size_t)snprintf(&value[length], sizeof value - length, "%s%.*s", i > 0 ? ", " : "",
                                   serial != NULL ? (int)strcspn(serial, ",") : 1, serial != NULL ? serial : "0");
    }
    if (is_any) {
        ini_text_set(out, "cia402", "serial_numbers", value, _("so that no drive is exchanged unnoticed"));
    } else {
        permute_key(self, legs, NULL, "cia402", "serial_numbers", out);
    }
}

static void set_addresses(const setup_t *self, const legs_t *legs, ini_text_t *out)
{
    const char *hosts = setup_get(self, "hosts");
    if (is_driver(self, "cia402")) {
        permute_key(self, legs, "nodes", "cia402", "nodes", out);
        set_serials(self, legs, out);
    } else if (is_driver(self, "modbus-rtu")) {
        permute_key(self, legs, "nodes", "modbus", "units", out);
    } else if (hosts != NULL && strchr(hosts, ',') != NULL) {
        permute_key(self, legs, "hosts", "modbus-tcp", "hosts", out);
    } else if (hosts != NULL) { /* one gateway, which tells them by unit */
        ini_text_set(out, "modbus-tcp", "hosts", hosts, NULL);
        permute_key(self, legs, NULL, "modbus", "units", out);
    } else if (is_driver(self, "can-raw")) {
        permute_key(self, legs, NULL, "can-raw", "command_id", out);
        permute_key(self, legs, NULL, "can-raw", "reply_id", out);
    }
}

/* A ratio, so that a third is a third. */
static void set_leads(const setup_t *self, const legs_t *legs, ini_text_t *out)
{
    char value[INI_VALUE_MAX] = "";
    size_t length = 0;
    for (unsigned i = 0; i < legs->count; i++) {
        const double lead_mm = answers_number(self, "lead", 0) * legs->times[i] * (legs->is_reversed[i] ? -1 : 1);
        length += (size_t)snprintf(&value[length], sizeof value - length, legs->parts[i] == 1u ? "%s%.10g" : "%s%.10g/%u",
                                   i > 0 ? ", " : "", lead_mm, legs->parts[i]);
    }
    ini_text_drop(out, section_of(self), "counts_per_mm");
    ini_text_set(out, "drives", "lead_mm", value, _("of each cylinder; negative: its drive counts backwards"));
    set_number(out, "drives", "counts_per_turn", answers_number(self, "turn", 0), NULL);
    set_number(out, "drives", "gear", answers_number(self, "gear", 0), NULL);
}

/* What finds the zero at one end finds it at the other, for a drive that runs backwards. */
static double mirror(double method)
{
    static const double k_pairs[][2] = {{1, 2}, {17, 18}, {33, 34}, {-1, -2}, {-3, -4}};
    for (size_t i = 0; i < sizeof k_pairs / sizeof k_pairs[0]; i++) {
        for (unsigned k = 0; k < 2u; k++) {
            if (fabs(k_pairs[i][k] - method) < 0.5) {
                return k_pairs[i][1u - k];
            }
        }
    }
    return method;
}

static void set_homing(const setup_t *self, setup_stage_t stage, const legs_t *legs, ini_text_t *out)
{
    char value[INI_VALUE_MAX] = "0";
    size_t length = 0;
    const double method = stage >= SETUP_STAGE_ZERO ? answers_number(self, "zero.method", 0) : 0;
    for (unsigned i = 0; i < legs->count && fabs(method) > 0.5; i++) {
        length += (size_t)snprintf(&value[length], sizeof value - length, "%s%.0f", i > 0 ? ", " : "",
                                   legs->is_reversed[i] ? mirror(method) : method);
    }
    if (is_driver(self, "cia402") && (stage < SETUP_STAGE_ZERO || setup_get(self, "zero.kind") != NULL)) {
        ini_text_set(out, "cia402", "homing_method", value, NULL);
    }
}

/* Made up: each stands in the middle of its stroke. Measured: where the tape says. */
static void set_zero(const setup_t *self, setup_stage_t stage, const legs_t *legs, const double *counts, ini_text_t *out)
{
    double measured[CYLINDERS] = {0};
    char value[INI_VALUE_MAX] = "";
    size_t length = 0;
    const bool is_measured =
        stage == SETUP_STAGE_FULL && answers_list(setup_get(self, "zero.counts"), measured, CYLINDERS) == legs->count;
    const bool is_made_up = (stage == SETUP_STAGE_BUS || stage == SETUP_STAGE_LEGS) && counts != NULL;
    if (!is_measured && !is_made_up && stage == SETUP_STAGE_FULL) {
        return;
    }
    for (unsigned i = 0; i < legs->count; i++) {
        const double extension_mm = is_made_up ? configure_stroke(self, i + 1u) / 2
                                               : answers_number(self, "zero.length", i + 1u) - configure_retracted(self, i + 1u);
        const double now = is_made_up ? counts[i] : measured[i];
        const double zero = is_made_up || is_measured ? round(now - counts_per_mm(self, legs, i) * extension_mm) : 0;
        length += (size_t)snprintf(&value[length], sizeof value - length, "%s%.0f", i > 0 ? ", " : "", zero);
    }
    ini_text_set(out, section_of(self), "zero_counts", value, is_measured ? _("from the lengths that were measured") : NULL);
}

static void set_drives(const setup_t *self, setup_stage_t stage, const double *counts, ini_text_t *out)
{
    const legs_t legs = find_legs(self, stage);
    const char *text = setup_get(self, "interface");
    ini_text_set(out, "drives", "driver", setup_driver(self), NULL);
    if (text != NULL) {
        ini_text_set(out, "can", "interface", text, NULL);
    }
    text = setup_get(self, "device");
    if (text != NULL) {
        ini_text_set(out, "modbus-rtu", "device", text, NULL);
    }
    if (setup_get(self, "lead") == NULL) {
        return;
    }
    set_addresses(self, &legs, out);
    set_leads(self, &legs, out);
    set_homing(self, stage, &legs, out);
    set_zero(self, stage, &legs, counts, out);
}

/* --- What is at the panel --- */

static void set_lines(const setup_t *self, ini_text_t *out)
{
    static const char *const k_switches[] = {"estop", "enable", "reset", "power"};
    const char *lines = setup_get(self, "relays.lines"), *kind = setup_get(self, "relays.kind");
    char answer[32];
    if (kind != NULL && strcmp(kind, "k") != 0) {
        ini_text_set(out, "relays", "driver", strcmp(kind, "g") == 0 ? "gpio" : "sim", NULL);
        ini_text_set(out, "relays", "lines", lines != NULL ? lines : "none", NULL);
    }
    kind = setup_get(self, "switches.kind");
    if (kind == NULL || strcmp(kind, "k") == 0) {
        return;
    }
    ini_text_set(out, "inputs", "driver", strcmp(kind, "g") == 0 ? "gpio" : "sim", NULL);
    for (size_t i = 0; i < sizeof k_switches / sizeof k_switches[0]; i++) {
        (void)snprintf(answer, sizeof answer, "switches.%s", k_switches[i]);
        const char *line = setup_get(self, answer);
        ini_text_set(out, "inputs", k_switches[i], line != NULL ? line : "none", NULL);
    }
}

unsigned configure_relays(const setup_t *self)
{
    char value[INI_VALUE_MAX] = "";
    const char *kind = setup_get(self, "relays.kind"), *lines = setup_get(self, "relays.lines");
    if (kind == NULL || strcmp(kind, "n") == 0) {
        return 0;
    }
    if (strcmp(kind, "k") == 0) {
        if (!ini_text_get(&self->start, "relays", "lines", value) || strcmp(value, "none") == 0) {
            return 0;
        }
        lines = value;
    }
    unsigned count = lines != NULL ? 1u : 0;
    for (; lines != NULL && *lines != '\0'; lines++) {
        count += *lines == ',';
    }
    return count;
}

bool configure_has_switch(const setup_t *self, const char *key)
{
    char value[INI_VALUE_MAX], answer[32];
    const char *kind = setup_get(self, "switches.kind");
    if (kind != NULL && strcmp(kind, "k") == 0) {
        return ini_text_get(&self->start, "inputs", "driver", value) && strcmp(value, "gpio") == 0 &&
               ini_text_get(&self->start, "inputs", key, value) && strcmp(value, "none") != 0;
    }
    (void)snprintf(answer, sizeof answer, "switches.%s", key);
    const char *line = setup_get(self, answer);
    return kind != NULL && strcmp(kind, "g") == 0 && line != NULL && strcmp(line, "none") != 0;
}

void setup_configure(const setup_t *self, setup_stage_t stage, const double *counts, ini_text_t *out)
{
    *out = self->start;
    set_geometry(self, out);
    if (answers_is(self, "geometry.mend", "k")) {
        ini_text_set(out, "geometry", "as_measured", "yes", NULL);
    }
    if (answers_is(self, "start", "none")) {
        ini_text_set(out, "platform", "kind", setup_get(self, "kind") != NULL ? setup_get(self, "kind") : "hexapod", NULL);
        set_number(out, "cylinders", "speed_mm_s", setup_get(self, "speed") != NULL ? answers_number(self, "speed", 0) : 200,
                   NULL);
        set_number(out, "cylinders", "accel_mm_s2", setup_get(self, "accel") != NULL ? answers_number(self, "accel", 0) : 1000,
                   NULL);
        set_number(out, "cylinders", "jerk_mm_s3", setup_get(self, "jerk") != NULL ? answers_number(self, "jerk", 0) : 20000,
                   NULL);
        set_number(out, "pose", "settled_extension_mm",
                   setup_get(self, "settled") != NULL ? answers_number(self, "settled", 0) : 10, NULL);
        set_answer(self, out, "margin", "cylinders", "margin_mm", NULL);
    }
    if (stage != SETUP_STAGE_GEOMETRY && setup_driver(self)[0] != '\0') {
        set_drives(self, stage, counts, out);
    }
    if (stage == SETUP_STAGE_GEOMETRY && answers_is(self, "start", "none")) {
        ini_text_set(out, "drives", "driver", "sim", NULL);
        ini_text_drop(out, "drives", "lead_mm"); /* which the template of other drives leaves to be filled in */
        ini_text_drop(out, "drives", "counts_per_turn");
    }
    if (stage == SETUP_STAGE_FULL) {
        if (answers_is(self, "limits.take", "y")) {
            drop_limits(out);
        }
        set_lines(self, out);
    }
}

bool setup_bus(const setup_t *self, char out[SETUP_ANSWER_MAX])
{
    char baud[INI_VALUE_MAX], parity[INI_VALUE_MAX], stop_bits[INI_VALUE_MAX];
    const char *bus = setup_get(self, is_driver(self, "modbus-rtu") ? "device" : "interface");
    if (bus == NULL) {
        return false;
    }
    if (!is_driver(self, "modbus-rtu")) {
        (void)snprintf(out, SETUP_ANSWER_MAX, "%s", bus);
        return true;
    }
    const bool has_baud = ini_text_get(&self->start, "modbus-rtu", "baud_bps", baud);
    const bool has_parity = ini_text_get(&self->start, "modbus-rtu", "parity", parity);
    const bool has_stop = ini_text_get(&self->start, "modbus-rtu", "stop_bits", stop_bits);
    return snprintf(out, SETUP_ANSWER_MAX, "%s,%s,%s,%s", bus, has_baud ? baud : "115200", has_parity ? parity : "even",
                    has_stop ? stop_bits : "1") < (int)SETUP_ANSWER_MAX;
}

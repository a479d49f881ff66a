/* SPDX-License-Identifier: MIT
 * template.c - a configuration file to fill in; see config.h. From the table of keys: what has to be given stands there without a
 * value, what may be given stands there as a comment with its default.
 */
#include <string.h>

#include "config/config.h"

#include "common/translate.h"
#include "config/value.h"

/** How a key stands in the file. */
typedef enum {
    BLANK,     /**< to be filled in */
    BUS_BLANK, /**< likewise, but not for simulated drives */
    OPTIONAL,
    KIND,
    DRIVER
} entry_kind_t;

/* What everybody needs, in the order in which it is measured; the sections of the drives follow. */
static const struct {
    const char *section;
    const char *key;
    entry_kind_t kind;
} k_rows[] = {
    {"platform", "kind", KIND},
    {"platform", "engage", OPTIONAL},
    {"geometry", "base_radius_mm", BLANK},
    {"geometry", "base_spread_deg", BLANK},
    {"geometry", "plate_radius_mm", BLANK},
    {"geometry", "plate_spread_deg", BLANK},
    {"geometry", "retracted_length_mm", BLANK},
    {"geometry", "stroke_mm", BLANK},
    {"geometry", "zero_height_mm", OPTIONAL},
    {"geometry", "mrp_mm", OPTIONAL},
    {"pose", "settled_extension_mm", BLANK},
    {"pose", "neutral", OPTIONAL},
    {"cylinders", "speed_mm_s", BLANK},
    {"cylinders", "accel_mm_s2", BLANK},
    {"cylinders", "jerk_mm_s3", BLANK},
    {"cylinders", "margin_mm", OPTIONAL},
    {"engage", "speed_mm_s", OPTIONAL},
    {"engage", "accel_mm_s2", OPTIONAL},
    {"udp", "bind", OPTIONAL},
    {"udp", "port", OPTIONAL},
    {"udp", "allow", OPTIONAL},
    {"udp", "silence_hold_ms", OPTIONAL},
    {"udp", "silence_neutral_ms", OPTIONAL},
    {"udp", "silence_settle_ms", OPTIONAL},
    {"drives", "driver", DRIVER},
    {"drives", "lead_mm", BUS_BLANK},
    {"drives", "counts_per_turn", BUS_BLANK},
    {"drives", "gear", OPTIONAL},
};

/* What drives with frames or registers of their own cannot do without. */
static const char *const k_own[][2] = {
    {"can-raw", "command_id"}, {"can-raw", "setpoint"}, {"modbus", "setpoint"}, {"modbus", "feedback"}, {"modbus-tcp", "hosts"},
};

/* The sections of a driver. */
static const char *const k_sections[][3] = {
    {"sim", "sim"},
    {"cia402", "can", "cia402"},
    {"can-raw", "can", "can-raw"},
    {"modbus-tcp", "modbus", "modbus-tcp"},
    {"modbus-rtu", "modbus", "modbus-rtu"},
};

static bool is_one_of(const char *words, const char *asked)
{
    const size_t length = strlen(asked);
    while (words != NULL) {
        if (length > 0 && strcspn(words, "|") == length && strncmp(words, asked, length) == 0) {
            return true;
        }
        words = strchr(words, '|');
        words = words == NULL ? NULL : words + 1;
    }
    return false;
}

static const config_key_t *key_of(const char *section, const char *name)
{
    return &config_keys[config_key_find(section, name)];
}

/* A section begins with its help. */
static void begin(const char *section, FILE *out)
{
    const config_section_t *found = &config_sections[config_section_find(section)];
    fprintf(out, "\n; %s\n[%s]\n", translate(found->help), found->name);
}

static void write_key(const config_key_t *key, const char *value, FILE *out)
{
    config_text_t allowed;
    config_text_clear(&allowed);
    config_value_allowed(key, &allowed);
    fprintf(out, "; %s\n; %s\n", translate(key->help), allowed.data);
    if (value != NULL) {
        fprintf(out, "%s =%s%s\n", key->name, value[0] == '\0' ? "" : " ", value);
    } else {
        fprintf(out, ";%s = %s\n", key->name, key->fallback);
    }
}

static void write_row(size_t row, const char *kind, const char *driver, FILE *out)
{
    const config_key_t *key = key_of(k_rows[row].section, k_rows[row].key);
    const bool is_bus = strcmp(driver, "sim") != 0;
    if (key->needs == CONFIG_NEEDS_HEXAPOD && strcmp(kind, "hexapod") != 0) {
        return;
    }
    switch (k_rows[row].kind) {
    case BLANK:
        write_key(key, "", out);
        break;
    case BUS_BLANK:
        write_key(key, is_bus ? "" : NULL, out);
        break;
    case OPTIONAL:
        write_key(key, NULL, out);
        break;
    case KIND:
        write_key(key, kind, out);
        break;
    case DRIVER:
        write_key(key, driver, out);
        break;
    }
}

static bool is_own(const config_key_t *key)
{
    for (size_t i = 0; i < sizeof k_own / sizeof k_own[0]; i++) {
        if (strcmp(k_own[i][0], key->section) == 0 && strcmp(k_own[i][1], key->name) == 0) {
            return true;
        }
    }
    return false;
}

/* All keys; the scaling has been asked for already. */
static void write_section(const char *section, FILE *out)
{
    begin(section, out);
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        if (strcmp(key->section, section) == 0 && key->needs != CONFIG_NEEDS_ANGLE && strcmp(key->name, "counts_per_mm") != 0) {
            write_key(key, is_own(key) ? "" : NULL, out);
        }
    }
}

static void write_drives(const char *driver, FILE *out)
{
    for (size_t i = 0; i < sizeof k_sections / sizeof k_sections[0]; i++) {
        for (unsigned k = 1; strcmp(k_sections[i][0], driver) == 0 && k < 3u && k_sections[i][k] != NULL; k++) {
            write_section(k_sections[i][k], out);
        }
    }
}

const char *config_write_template(const char *kind, const char *driver, FILE *out)
{
    if (!is_one_of(key_of("platform", "kind")->words, kind)) {
        return key_of("platform", "kind")->words;
    }
    if (!is_one_of(key_of("drives", "driver")->words, driver)) {
        return key_of("drives", "driver")->words;
    }
    fprintf(out,
            _("; A platform to fill in: every key that has no value yet. `heaved --check --config FILE` says what is missing "
              "and what is wrong.\n"
              "; Keys behind a ; may stay so: then they have the value that stands there. [roll] to [z] are left out, and "
              "with them the limits\n"
              "; of the axes: they are then what each axis alone can do with these cylinders.\n"));
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if (i == 0 || strcmp(k_rows[i].section, k_rows[i - 1].section) != 0) {
            begin(k_rows[i].section, out);
        }
        write_row(i, kind, driver, out);
    }
    write_drives(driver, out);
    return NULL;
}

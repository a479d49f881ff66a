/* SPDX-License-Identifier: MIT
 * key_table.c - the table of keys as JSON, for programs that let people edit a configuration.
 */
#include <stdlib.h>
#include <string.h>

#include "common/json.h"
#include "config/startup.h"
#include "config/value.h"

#define TABLE_BYTES 524288u

static const char *need_name(config_needs_t needs)
{
    static const char *const k_names[] = {"", "hexapod", "angle"};
    return k_names[needs];
}

static void put_key(json_t *json, const config_key_t *key)
{
    config_text_t allowed;
    config_text_clear(&allowed);
    config_value_allowed(key, &allowed);
    json_open(json, NULL, '{');
    json_text(json, "name", key->name);
    json_text(json, "help", key->help);
    json_text(json, "allowed", allowed.data);
    json_text(json, "unit", key->unit != NULL ? key->unit : "");
    if (key->fallback != NULL) {
        json_text(json, "default", key->fallback);
    } else {
        json_null(json, "default");
    }
    json_text(json, "needs", need_name(key->needs));
    json_bool(json, "live", key->is_live);
    json_close(json, '}');
}

static void put_section(json_t *json, const config_section_t *section)
{
    json_open(json, NULL, '{');
    json_text(json, "name", section->name);
    json_text(json, "help", section->help);
    json_text(json, "needs", need_name(section->needs));
    if (config_startup_is_list(section)) {
        json_text(json, "list", config_startup_help);
    } else {
        json_null(json, "list");
    }
    json_open(json, "keys", '[');
    for (size_t k = 0; k < config_key_count; k++) {
        if (strcmp(config_keys[k].section, section->name) == 0) {
            put_key(json, &config_keys[k]);
        }
    }
    json_close(json, ']');
    json_close(json, '}');
}

void config_write_keys(FILE *out)
{
    json_t json;
    char *const text = malloc(TABLE_BYTES);
    if (text == NULL) {
        return;
    }
    json_start(&json, text, TABLE_BYTES);
    json_open(&json, NULL, '{');
    json_open(&json, "sections", '[');
    for (size_t i = 0; i < config_section_count; i++) {
        put_section(&json, &config_sections[i]);
    }
    json_close(&json, ']');
    json_close(&json, '}');
    json_newline(&json);
    HV_ASSERT(!json.is_cut);
    (void)fwrite(text, 1, json.length, out);
    free(text);
}

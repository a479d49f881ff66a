/* SPDX-License-Identifier: MIT
 * hash.c - what a configuration is recognised by; see hash.h.
 */
#include "config/hash.h"

#include <stdio.h>
#include <string.h>

#include "common/sha256.h"
#include "config/startup.h"
#include "config/value.h"

static bool is_approval(const config_key_t *key)
{
    return strcmp(key->section, "platform") == 0 && strcmp(key->name, "approved") == 0;
}

static bool counts(const config_key_t *key, const config_t *config)
{
    const config_section_t *section = &config_sections[config_section_find(key->section)];
    return config_is_applicable(section->needs, config) && config_is_applicable(key->needs, config) && !is_approval(key);
}

/* Defaults are not: a key that a later version adds leaves the machine what it was. */
static bool is_of_machine(const config_key_t *key, const char *value)
{
    const bool is_kind = strcmp(key->section, "platform") == 0 && strcmp(key->name, "kind") == 0;
    const bool is_default = key->fallback != NULL && strcmp(key->fallback, value) == 0;
    return (is_kind || config_sections[config_section_find(key->section)].is_of_machine) && !is_default;
}

void config_each_line(const config_t *config, config_line_visit_t visit, void *ctx)
{
    config_text_t line;
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        if (counts(key, config)) {
            config_text_clear(&line);
            config_text_add(&line, "%s.%s = ", key->section, key->name);
            const size_t before = strlen(line.data);
            config_value_format(key, config, &line);
            visit(ctx, line.data, is_of_machine(key, &line.data[before]));
        }
    }
    for (size_t i = 0; i < config_section_count; i++) {
        const config_startup_t *list = config_startup_of(&config_sections[i], config);
        for (unsigned k = 0; list != NULL && config_is_applicable(config_sections[i].needs, config) && k < list->count; k++) {
            config_text_clear(&line);
            config_text_add(&line, "%s ", config_sections[i].name);
            config_startup_format(&list->item[k], &line);
            visit(ctx, line.data, config_sections[i].is_of_machine);
        }
    }
}

/* All lines, and those of the machine. */
typedef struct {
    sha256_t all;
    sha256_t machine;
} hashes_t;

static void add_line(void *ctx, const char *line, bool is_of_both)
{
    hashes_t *self = ctx;
    sha256_add(&self->all, line, strlen(line) + 1); /* its end is a part of it */
    if (is_of_both) {
        sha256_add(&self->machine, line, strlen(line) + 1);
    }
}

void config_hash(config_t *config)
{
    hashes_t hashes;
    sha256_start(&hashes.all);
    sha256_start(&hashes.machine);
    config_each_line(config, add_line, &hashes);
    sha256_end_digits(&hashes.machine, config->machine_hash, sizeof config->machine_hash);
    sha256_end_digits(&hashes.all, config->hash, sizeof config->hash);
}

bool config_is_unapproved(const config_t *config)
{
    return config->approved.text[0] != '\0' && strcmp(config->approved.text, config->hash) != 0;
}

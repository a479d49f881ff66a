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

void config_hash(config_t *config)
{
    config_text_t value;
    sha256_t hash;
    sha256_start(&hash);
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        if (counts(key, config)) {
            config_text_clear(&value);
            config_text_add(&value, "%s.%s = ", key->section, key->name);
            config_value_format(key, config, &value);
            sha256_add(&hash, value.data, strlen(value.data) + 1); /* its end is a part of it */
        }
    }
    for (size_t i = 0; i < config_section_count; i++) {
        const config_startup_t *list = config_startup_of(&config_sections[i], config);
        for (unsigned k = 0; list != NULL && config_is_applicable(config_sections[i].needs, config) && k < list->count; k++) {
            config_text_clear(&value);
            config_text_add(&value, "%s ", config_sections[i].name);
            config_startup_format(&list->item[k], &value);
            sha256_add(&hash, value.data, strlen(value.data) + 1);
        }
    }
    sha256_end_digits(&hash, config->hash, sizeof config->hash);
}

bool config_is_unapproved(const config_t *config)
{
    return config->approved.text[0] != '\0' && strcmp(config->approved.text, config->hash) != 0;
}

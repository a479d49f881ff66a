/* SPDX-License-Identifier: MIT
 * reload.c - a configuration in place of the one that a platform runs with: what it would change, and taking over what may change
 * in operation. Allocates nothing.
 */
#include <string.h>

#include "common/translate.h"
#include "config/hash.h"
#include "config/source.h"
#include "config/startup_read.h"
#include "config/value.h"
#include "platform/check.h"
#include "platform/load.h"

/* What stands in the file now and what is in force, as they would be written. */
typedef struct {
    config_text_t was, is;
} pair_t;

static bool has_changed(const config_key_t *key, const config_t *running, const config_t *wanted, pair_t *pair)
{
    config_text_clear(&pair->was);
    config_text_clear(&pair->is);
    config_value_format(key, running, &pair->was);
    config_value_format(key, wanted, &pair->is);
    return strcmp(pair->was.data, pair->is.data) != 0;
}

/* Takes over one key that has another value now, or says that it cannot. */
static void apply_change(const config_source_t *self, size_t i, config_t *running)
{
    const config_key_t *key = &config_keys[i];
    pair_t pair;
    if (!has_changed(key, running, self->config, &pair)) {
        return;
    }
    fprintf(self->errors, "%s:%u: [%s] %s: ", self->path, config_source_line_of(self, key->section, key->name), key->section,
            key->name);
    if (key->is_live) {
        memcpy((char *)running + key->offset, (const char *)self->config + key->offset, key->size);
        fprintf(self->errors, _("%s from now on, was %s\n"), pair.is.data, pair.was.data);
    } else {
        fprintf(self->errors, _("%s needs a restart; %s stays\n"), pair.is.data, pair.was.data);
    }
}

/* A platform whose configuration was approved takes over no other one in motion. */
static void check_approval(config_source_t *self)
{
    config_hash(self->config);
    if (config_is_unapproved(self->config)) {
        config_source_key_error(self, "platform", "approved",
                                "%s is not this configuration; allowed: %s, once somebody has approved it",
                                self->config->approved.text, self->config->hash);
    }
}

/* A whole configuration and where its keys stood: for the service thread, which has no room for them on its stack. */
static config_source_t *load(const config_text_source_t *from, FILE *report)
{
    static config_t config;
    static config_source_t self;
    config_source_load(&self, from, &config, report);
    if (self.error_count == 0) {
        check_approval(&self);
    }
    return &self;
}

int config_reload(const char *name, const char *text, ssize_t length, config_t *running, FILE *report)
{
    const config_source_t *const self = load(&(config_text_source_t){.name = name, .text = text, .length = length}, report);
    for (size_t i = 0; self->error_count == 0 && i < config_key_count; i++) {
        if (config_is_applicable(config_keys[i].needs, running)) {
            apply_change(self, i, running);
        }
    }
    if (self->error_count == 0) {
        (void)config_startup_compare(self, running, report);
    }
    config_hash(running);
    return self->error_count;
}

int config_judge_text(const char *name, const char *text, size_t length, const config_t *running, config_changes_t *changes,
                      FILE *errors)
{
    const config_source_t *const self =
        load(&(config_text_source_t){.name = name, .text = text, .length = (ssize_t)length}, errors);
    pair_t pair;
    *changes = (config_changes_t){.live = 0};
    if (self->error_count != 0) {
        return self->error_count;
    }
    for (size_t i = 0; i < config_key_count; i++) {
        if (config_is_applicable(config_keys[i].needs, running) && has_changed(&config_keys[i], running, self->config, &pair)) {
            changes->live += config_keys[i].is_live ? 1u : 0u;
            changes->restart += config_keys[i].is_live ? 0u : 1u;
        }
    }
    changes->restart += config_startup_compare(self, running, NULL);
    memcpy(changes->hash, self->config->hash, sizeof changes->hash);
    return 0;
}

/* SPDX-License-Identifier: MIT
 * load.c - see load.h.
 */
#include "platform/load.h"

#include <string.h>

#include "config/hash.h"
#include "platform/check.h"

#define WAIT_MS 5000 /* for who writes a pipe; once heaved runs, nobody is waited for */

void config_source_load(config_source_t *self, const config_text_source_t *from, config_t *config, FILE *errors)
{
    if (config_source_read(self, from, config, errors)) {
        config_check(self);
    }
}

int config_load(const char *path, config_t *out, FILE *errors)
{
    config_t config;
    config_source_t self;
    config_source_load(&self, &(config_text_source_t){.name = path, .wait_ms = WAIT_MS}, &config, errors);
    if (self.error_count == 0) {
        config_hash(&config);
        memcpy(out, &config, sizeof config);
    }
    return self.error_count;
}

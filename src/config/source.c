/* SPDX-License-Identifier: MIT
 * source.c - a configuration file while it is loaded: what is known of its keys, and its errors; see source.h.
 */
#include "config/source.h"

#include "common/translate.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static void write_error(config_source_t *self, unsigned line, const char *where, const char *format, va_list arguments)
{
    if (line == 0) {
        fprintf(self->errors, "%s: ", self->path);
    } else {
        fprintf(self->errors, "%s:%u: %s", self->path, line, where);
    }
    vfprintf(self->errors, translate(format), arguments);
    fputc('\n', self->errors);
    self->error_count++;
}

void config_source_error(config_source_t *self, unsigned line, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    write_error(self, line, "", format, arguments);
    va_end(arguments);
}

unsigned config_source_line_of(const config_source_t *self, const char *section, const char *name)
{
    const int key = config_key_find(section, name);
    const int in = config_section_find(section);
    if (key >= 0 && self->entry[key].line != 0) {
        return self->entry[key].line;
    }
    if (in >= 0 && self->section_line[in] != 0) {
        return self->section_line[in];
    }
    return self->line == 0 ? 1 : self->line; /* an empty file has no line to name */
}

void config_source_key_error(config_source_t *self, const char *section, const char *name, const char *format, ...)
{
    config_text_t where;
    va_list arguments;
    config_text_clear(&where);
    config_text_add(&where, "[%s] %s: ", section, name);
    va_start(arguments, format);
    write_error(self, config_source_line_of(self, section, name), where.data, format, arguments);
    va_end(arguments);
}

bool config_source_has(const config_source_t *self, const char *section, const char *name)
{
    const int key = config_key_find(section, name);
    HV_ASSERT(key >= 0);
    return self->entry[key].is_valid;
}

bool config_source_has_all(const config_source_t *self, const char *section)
{
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].section, section) == 0 && !self->entry[i].is_valid) {
            return false;
        }
    }
    return true;
}

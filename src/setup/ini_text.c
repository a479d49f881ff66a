/* SPDX-License-Identifier: MIT
 * ini_text.c - see ini_text.h.
 */
#include "setup/ini_text.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

/* A line of the text. */
typedef struct {
    const char *begin;
    size_t length; /* with its line feed */
} line_t;

static line_t line_at(const char *text)
{
    const size_t length = strcspn(text, "\n");
    return (line_t){text, length + (text[length] == '\n')};
}

/* "[name]", after blanks. */
static bool is_section(const line_t *line, const char **name, size_t *length)
{
    const char *at = line->begin;
    while (*at == ' ' || *at == '\t') {
        at++;
    }
    *name = at + 1;
    *length = strcspn(at, "]\n");
    *length = *length > 0 ? *length - 1u : 0;
    return *at == '[';
}

/* "key = value", also ";key = value" where a comment will do. */
static bool is_key(const line_t *line, const char *key, bool is_comment_taken, const char **value)
{
    const char *at = line->begin;
    at += is_comment_taken && *at == ';';
    while (*at == ' ' || *at == '\t') {
        at++;
    }
    const size_t length = strlen(key);
    if (strncmp(at, key, length) != 0) {
        return false;
    }
    at += length + strspn(at + length, " \t");
    *value = at + 1;
    return *at == '=';
}

/* The line of a key, its section's end where it has none, or the end of the text where there is no section. */
typedef enum { FOUND_KEY, FOUND_END_OF_SECTION, FOUND_NOTHING } found_t;

static found_t find(const ini_text_t *self, const char *section, const char *key, bool is_comment_taken, line_t *out)
{
    found_t found = FOUND_NOTHING;
    bool is_inside = false;
    const char *value = NULL, *name = NULL;
    size_t length = 0;
    for (line_t line = line_at(self->text); line.length > 0; line = line_at(line.begin + line.length)) {
        if (is_section(&line, &name, &length)) {
            is_inside = length == strlen(section) && strncmp(name, section, length) == 0;
            if (is_inside) {
                *out = (line_t){line.begin + line.length, 0};
                found = FOUND_END_OF_SECTION;
            }
        } else if (is_inside && is_key(&line, key, is_comment_taken, &value)) {
            *out = line;
            return FOUND_KEY;
        } else if (is_inside && line.begin[0] != '\n' && line.begin[0] != ';') {
            *out = (line_t){line.begin + line.length, 0};
        }
    }
    return found;
}

/* Puts a text in the place of a part. */
static void replace(ini_text_t *self, const line_t *part, const char *text)
{
    const size_t at = (size_t)(part->begin - self->text), all = strlen(self->text), length = strlen(text);
    if (all - part->length + length + 1u > INI_TEXT_MAX) {
        self->is_cut = true;
        return;
    }
    memmove(&self->text[at + length], &self->text[at + part->length], all - at - part->length + 1u);
    memcpy(&self->text[at], text, length);
}

void ini_text_load(ini_text_t *self, const char *text)
{
    self->is_cut = strlen(text) >= INI_TEXT_MAX;
    (void)snprintf(self->text, sizeof self->text, "%s", text);
}

bool ini_text_read(ini_text_t *self, const char *path)
{
    FILE *file = fopen(path, "re");
    self->text[0] = '\0';
    self->is_cut = false;
    if (file == NULL) {
        return false;
    }
    const size_t length = fread(self->text, 1, INI_TEXT_MAX - 1u, file);
    self->text[length] = '\0';
    self->is_cut = length == INI_TEXT_MAX - 1u;
    const int error = ferror(file) != 0 ? errno : 0;
    (void)fclose(file);
    errno = error;
    return error == 0;
}

void ini_text_set(ini_text_t *self, const char *section, const char *key, const char *value, const char *note)
{
    char text[3u * INI_VALUE_MAX];
    line_t where;
    found_t found = find(self, section, key, false, &where);
    if (found != FOUND_KEY) {
        found = find(self, section, key, true, &where);
    }
    const bool is_new = found == FOUND_NOTHING;
    if (is_new) {
        where = (line_t){self->text + strlen(self->text), 0};
    }
    (void)snprintf(text, sizeof text, "%s%s%s%s = %s%s%s\n", is_new ? "\n[" : "", is_new ? section : "", is_new ? "]\n" : "", key,
                   value, note != NULL ? "  ; " : "", note != NULL ? note : "");
    replace(self, &where, text);
}

void ini_text_drop(ini_text_t *self, const char *section, const char *key)
{
    line_t where;
    if (find(self, section, key, false, &where) == FOUND_KEY) {
        replace(self, &where, "");
    }
}

/* Without blanks around it and what stands behind a " ;". */
static bool copy_value(const char *at, char value[INI_VALUE_MAX])
{
    at += strspn(at, " \t");
    size_t length = strcspn(at, "\n");
    for (size_t i = 0; i < length; i++) {
        if (at[i] == ';' && (i == 0 || isspace((unsigned char)at[i - 1u]))) {
            length = i;
        }
    }
    while (length > 0 && isspace((unsigned char)at[length - 1u])) {
        length--;
    }
    (void)snprintf(value, INI_VALUE_MAX, "%.*s", (int)length, at);
    return length > 0;
}

bool ini_text_get(const ini_text_t *self, const char *section, const char *key, char value[INI_VALUE_MAX])
{
    line_t line;
    const char *at = NULL;
    value[0] = '\0';
    return find(self, section, key, false, &line) == FOUND_KEY && is_key(&line, key, false, &at) && copy_value(at, value);
}

void ini_text_merge(ini_text_t *self, const ini_text_t *other)
{
    char section[64] = "", key[64], value[INI_VALUE_MAX];
    for (line_t line = line_at(other->text); line.length > 0; line = line_at(line.begin + line.length)) {
        const char *name = NULL;
        size_t length = 0;
        if (is_section(&line, &name, &length)) {
            (void)snprintf(section, sizeof section, "%.*s", (int)length, name);
            continue;
        }
        const char *equals = memchr(line.begin, '=', line.length);
        if (line.begin[0] == ';' || equals == NULL) {
            continue;
        }
        (void)snprintf(key, sizeof key, "%.*s", (int)strcspn(line.begin, " \t="), line.begin);
        if (copy_value(equals + 1, value)) {
            ini_text_set(self, section, key, value, NULL);
        }
    }
}

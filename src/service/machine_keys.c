/* SPDX-License-Identifier: MIT
 * machine_keys.c - see machine_keys.h.
 */
#include "service/machine_keys.h"

#include <stdio.h>
#include <string.h>

#include "common/sha256.h"
#include "common/state_file.h"
#include "common/translate.h"
#include "config/hash.h"

#define LINES_MAX 2048u
#define NAMED_MAX 2u  /* the others are counted */
#define VALUE_MAX 60  /* characters of a value that are shown */
#define NAME_MAX  100 /* of a section, and of a key */
#define SEPARATOR " = "

/* "section.key = value", in pieces of the line. */
typedef struct {
    const char *section;
    int section_length;
    const char *key;
    int key_length;
    const char *value;
    int value_length;
} line_t;

static line_t split(const char *line)
{
    const size_t length = strcspn(line, "\n");
    const size_t section = strcspn(line, ". ");
    const char *end = strstr(line, SEPARATOR);
    const size_t name = end != NULL && end < line + length ? (size_t)(end - line) : length;
    const size_t value = name + strlen(SEPARATOR) < length ? name + strlen(SEPARATOR) : length;
    const size_t key = section + 1u < name ? section + 1u : name;
    return (line_t){line, (int)section, line + key, (int)(name - key), line + value, (int)(length - value)};
}

static const char *next_line(const char *line)
{
    const char *end = strchr(line, '\n');
    return end != NULL ? end + 1 : line + strlen(line);
}

/* --- The file --- */

static void hash_of(const machine_keys_t *self, char digits[CONFIG_HASH_MAX])
{
    sha256_t hash;
    sha256_start(&hash);
    for (const char *line = self->text; *line != '\0'; line = next_line(line)) {
        sha256_add(&hash, line, strcspn(line, "\n"));
        sha256_add(&hash, "", 1); /* as config_hash() ends a line */
    }
    sha256_end_digits(&hash, digits, CONFIG_HASH_MAX);
}

void machine_keys_read(machine_keys_t *self, const char *life, const char *machine_hash)
{
    char digits[CONFIG_HASH_MAX];
    (void)snprintf(self->path, sizeof self->path, "%s%s", life, MACHINE_KEYS_SUFFIX);
    if (machine_hash[0] == '\0' || state_file_read(self->path, self->text, sizeof self->text, &self->length) != 0) {
        return;
    }
    hash_of(self, digits);
    if (strcmp(digits, machine_hash) != 0) {
        self->text[0] = '\0';
        self->length = 0;
    }
}

static void add_line(void *ctx, const char *line, bool is_of_machine)
{
    machine_keys_t *self = ctx;
    const size_t length = strlen(line);
    if (!is_of_machine || self->is_cut) {
        return;
    }
    self->is_cut = self->length + length + 2u > sizeof self->text;
    if (!self->is_cut) {
        memcpy(&self->text[self->length], line, length);
        self->length += length;
        self->text[self->length++] = '\n';
    }
}

bool machine_keys_note(machine_keys_t *self, const config_t *config)
{
    if (__atomic_load_n(&self->is_due, __ATOMIC_ACQUIRE) != 0) {
        return false;
    }
    self->length = 0;
    self->is_cut = false;
    config_each_line(config, add_line, self);
    self->length = self->is_cut ? 0 : self->length;
    self->text[self->length] = '\0';
    __atomic_store_n(&self->is_due, self->path[0] != '\0' ? 1u : 0u, __ATOMIC_RELEASE);
    return true;
}

int machine_keys_write(machine_keys_t *self)
{
    if (__atomic_load_n(&self->is_due, __ATOMIC_ACQUIRE) == 0) {
        return 0;
    }
    const int error = state_file_write(self->path, self->text, self->length);
    if (error == 0) {
        __atomic_store_n(&self->is_due, 0u, __ATOMIC_RELEASE);
    }
    return error;
}

/* --- What has changed --- */

typedef struct {
    const char *was;
    config_text_t *text;
    unsigned named;
    unsigned others;
    uint8_t is_met[LINES_MAX]; /* lines of was that are in the configuration now, changed or not */
} comparison_t;

static void add_change(comparison_t *self, const line_t *line, const line_t *was, const line_t *is)
{
    char section[NAME_MAX], key[NAME_MAX], before[VALUE_MAX], now[VALUE_MAX];
    if (self->named == NAMED_MAX) {
        self->others++;
        return;
    }
    config_text_add(self->text, "%s", self->named++ > 0 ? "; " : "");
    (void)snprintf(section, sizeof section, "%.*s", line->section_length, line->section);
    (void)snprintf(key, sizeof key, "%.*s", line->key_length, line->key);
    (void)snprintf(before, sizeof before, "%.*s", was != NULL ? was->value_length : 0, was != NULL ? was->value : "");
    (void)snprintf(now, sizeof now, "%.*s", is != NULL ? is->value_length : 0, is != NULL ? is->value : "");
    if (was == NULL) {
        config_text_add(self->text, N_("[%s] %s was the default and is %s"), section, key, now);
    } else if (is == NULL) {
        config_text_add(self->text, N_("[%s] %s was %s and is the default"), section, key, before);
    } else {
        config_text_add(self->text, N_("[%s] %s was %s and is %s"), section, key, before, now);
    }
}

static void compare_line(void *ctx, const char *line, bool is_of_machine)
{
    comparison_t *self = ctx;
    const line_t is = split(line);
    const size_t name = (size_t)(is.key + is.key_length - is.section);
    unsigned i = 0;
    if (!is_of_machine) {
        return;
    }
    for (const char *at = self->was; *at != '\0' && i < LINES_MAX; at = next_line(at), i++) {
        const line_t was = split(at);
        if ((size_t)(was.key + was.key_length - was.section) == name && memcmp(at, line, name) == 0) {
            self->is_met[i] = 1;
            if (was.value_length != is.value_length || memcmp(was.value, is.value, (size_t)is.value_length) != 0) {
                add_change(self, &is, &was, &is);
            }
            return;
        }
    }
    add_change(self, &is, NULL, &is);
}

void machine_keys_compare(const machine_keys_t *self, const config_t *config, config_text_t *text)
{
    comparison_t comparison = {.was = self->text, .text = text};
    unsigned i = 0;
    config_text_clear(text);
    if (self->length == 0) {
        return;
    }
    config_each_line(config, compare_line, &comparison);
    for (const char *at = self->text; *at != '\0' && i < LINES_MAX; at = next_line(at), i++) {
        if (comparison.is_met[i] == 0) {
            const line_t was = split(at);
            add_change(&comparison, &was, &was, NULL);
        }
    }
    if (comparison.others > 0) {
        config_text_add(text, "; ");
        config_text_add(text, N_("and %u more"), comparison.others);
    }
}

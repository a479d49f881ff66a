/* SPDX-License-Identifier: MIT
 * value_text.c - values that are words or names: choices, paths, lines and chips, network interfaces.
 */
#include "config/value.h"

#include "common/translate.h"

#include <string.h>

#define NAME_BYTES "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-"

static void format_text(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    (void)key, (void)config;
    config_text_add(text, "%s", (const char *)field);
}

/* --- Words --- */

static bool parse_word(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const span_t item = {text, strlen(text)};
    const int index = span_find_word(key->words, item);
    if (index >= 0) {
        config_value_store(field, key->size, index);
        return true;
    }
    if (span_find_word(key->absent, item) < 0) {
        return config_value_reject(key, item, _("is not known"), why);
    }
    config_text_add(why, _("driver %.*s is not built into this heaved; allowed: "), (int)item.length, item.at);
    config_value_allowed(key, why);
    return false;
}

static void format_word(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const char *words = key->words;
    (void)config;
    for (int64_t index = config_value_load(field, key->size); index > 0; index--) {
        words = strchr(words, '|') + 1;
    }
    config_text_add(text, "%.*s", (int)strcspn(words, "|"), words);
}

static void allowed_word(const config_key_t *key, config_text_t *text)
{
    for (const char *byte = key->words; *byte != '\0'; byte++) {
        config_text_add(text, *byte == '|' ? " %c " : "%c", *byte);
    }
}

const config_type_t config_type_word = {.parse = parse_word, .format = format_word, .allowed = allowed_word};

static bool parse_yes_no(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const int index = span_find_word("no|yes", (span_t){text, strlen(text)});
    if (index < 0) {
        return config_value_reject_text(key, text, _("is neither yes nor no"), why);
    }
    *(bool *)field = index == 1;
    return true;
}

static void format_yes_no(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    (void)key, (void)config;
    config_text_add(text, "%s", *(const bool *)field ? "yes" : "no");
}

static void allowed_yes_no(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("yes | no"));
}

const config_type_t config_type_yes_no = {.parse = parse_yes_no, .format = format_yes_no, .allowed = allowed_yes_no};

/* --- Paths --- */

static bool parse_path(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const span_t item = {text, strlen(text)};
    const bool is_none = key->words != NULL && span_is_word(item, key->words);
    if (!is_none && (item.length == 0 || item.at[0] != '/')) {
        return config_value_reject(key, item, _("is not an absolute path"), why);
    }
    if (item.length >= key->size) {
        return config_value_reject(key, item, _("is too long"), why);
    }
    memset(field, 0, key->size);
    memcpy(field, item.at, item.length);
    return true;
}

static void allowed_path(const config_key_t *key, config_text_t *text)
{
    if (key->words != NULL) {
        config_text_add(text, _("%s, or "), key->words);
    }
    config_text_add(text, _("an absolute path of at most %u characters"), (unsigned)key->size - 1u);
}

const config_type_t config_type_path = {.parse = parse_path, .format = format_text, .allowed = allowed_path};

/* --- Lines and chips --- */

/* Bytes that names of GPIO lines and chips are made of. */
static bool is_label_byte(char byte)
{
    const bool is_letter = (byte >= 'a' && byte <= 'z') || (byte >= 'A' && byte <= 'Z');
    return is_letter || (byte >= '0' && byte <= '9') || (byte != '\0' && strchr(" _-+./:#()[]&*~", byte) != NULL);
}

static bool read_label(const config_key_t *key, span_t item, config_label_t *label, config_text_t *why)
{
    memset(label, 0, sizeof *label);
    if (span_is_word(item, "none")) {
        return true;
    }
    if (item.length == 0 || item.length >= sizeof label->text) {
        return config_value_reject(key, item, item.length == 0 ? _("has no name") : _("is too long"), why);
    }
    for (size_t i = 0; i < item.length; i++) {
        if (!is_label_byte(item.at[i])) {
            return config_value_reject(key, item, _("is no name"), why);
        }
        label->text[i] = item.at[i];
    }
    return true;
}

static bool parse_label(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    return read_label(key, (span_t){text, strlen(text)}, field, why);
}

static void allowed_label(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("none, or a name of at most %u characters"), CONFIG_LABEL_MAX - 1u);
}

const config_type_t config_type_label = {.has_none = true, .parse = parse_label, .format = format_text, .allowed = allowed_label};

static bool has_line(const config_lines_t *lines, const config_label_t *line)
{
    for (unsigned i = 0; i < lines->count; i++) {
        if (strcmp(lines->line[i].text, line->text) == 0) {
            return true;
        }
    }
    return false;
}

static bool parse_lines(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_lines_t *lines = field;
    const unsigned count = span_count_items(text);
    const char *rest = text;
    memset(lines, 0, sizeof *lines);
    if (count > CONFIG_RELAYS_MAX) {
        return config_value_reject_count(key, count, why);
    }
    while (rest != NULL) {
        const span_t item = span_next_item(&rest);
        config_label_t line;
        if (!read_label(key, item, &line, why)) {
            return false;
        }
        if (line.text[0] == '\0' || has_line(lines, &line)) {
            return config_value_reject(key, item, line.text[0] == '\0' ? _("is no line") : _("is listed twice"), why);
        }
        lines->line[lines->count++] = line;
    }
    return true;
}

static void format_lines(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_lines_t *lines = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < lines->count; i++) {
        config_text_add(text, "%s%s", i == 0 ? "" : ", ", lines->line[i].text);
    }
}

static void allowed_lines(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("none, or up to %u different lines, by name or number"), CONFIG_RELAYS_MAX);
}

const config_type_t config_type_lines = {
    .has_none = true, .parse = parse_lines, .format = format_lines, .allowed = allowed_lines};

/* --- Names --- */

static bool parse_name(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const size_t length = strlen(text);
    if (length == 0 || strspn(text, NAME_BYTES) != length || length >= key->size) {
        return config_value_reject_text(key, text, _("is no name of an interface"), why);
    }
    memset(field, 0, key->size);
    memcpy(field, text, length);
    return true;
}

static void allowed_name(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("a name of up to %u letters, digits and . _ -"), (unsigned)key->size - 1u);
}

const config_type_t config_type_name = {.parse = parse_name, .format = format_text, .allowed = allowed_name};

/* SPDX-License-Identifier: MIT
 * startup_read.c - start-up lists of CANopen drives from a file; see startup_read.h.
 */
#include "config/startup_read.h"

#include "common/translate.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "config/startup.h"

#define WORDS_MAX  6u
#define WORD_BYTES 24u
#define BLANKS     " \t"

static const struct {
    const char *name;
    uint8_t bytes;
    int64_t low;
    int64_t high;
} k_types[] = {
    {"u8", 1, 0, UINT8_MAX},          {"i8", 1, INT8_MIN, INT8_MAX}, {"u16", 2, 0, UINT16_MAX},
    {"i16", 2, INT16_MIN, INT16_MAX}, {"u32", 4, 0, UINT32_MAX},     {"i32", 4, INT32_MIN, INT32_MAX},
};
#define TYPES (sizeof k_types / sizeof k_types[0])

static bool read_number(const char *text, int64_t low, int64_t high, int64_t *value)
{
    const char *digits = text + (text[0] == '-');
    const bool is_hex = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X');
    char *end = NULL;
    if (strchr(is_hex ? "0123456789ABCDEFabcdef" : "0123456789", digits[is_hex ? 2 : 0]) == NULL ||
        digits[is_hex ? 2 : 0] == '\0') {
        return false;
    }
    errno = 0;
    *value = strtoll(text, &end, is_hex ? 16 : 10);
    return errno == 0 && *end == '\0' && *value >= low && *value <= high;
}

/* One or two hexadecimal digits. Without 0x or a letter, two digits could be meant as decimal ones. */
static const char *read_sub(const char *text, uint8_t *sub)
{
    const bool has_prefix = text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
    const char *digits = text + (has_prefix ? 2 : 0);
    const size_t length = strlen(digits);
    if (length < 1 || length > 2 || strspn(digits, "0123456789ABCDEFabcdef") < length) {
        return _("has no sub-index from 00 to FF behind the colon, hexadecimal");
    }
    if (!has_prefix && length == 2 && digits[0] != '0' && strspn(digits, "0123456789") == length) {
        return _("has a sub-index that may be meant decimal: sub-indices are hexadecimal, such as :0x0A for the tenth; write 0x");
    }
    *sub = (uint8_t)strtoul(digits, NULL, 16);
    return NULL;
}

/* "0x2030:01" */
static const char *read_object(char *text, cia402_item_t *item)
{
    int64_t index = 0;
    char *colon = strchr(text, ':');
    if (colon == NULL) {
        return _("has no sub-index, such as :00");
    }
    *colon = '\0';
    if (strncmp(text, "0x", 2) != 0 || !read_number(text, 1, UINT16_MAX, &index)) {
        return _("has no object such as 0x2030");
    }
    item->index = (uint16_t)index;
    return read_sub(colon + 1, &item->sub);
}

static const char *read_value(const char *text, const char *type, cia402_item_t *item)
{
    int64_t value = 0;
    for (size_t i = 0; i < TYPES; i++) {
        if (strcmp(k_types[i].name, type) == 0) {
            item->bytes = k_types[i].bytes;
            if (!read_number(text, k_types[i].low, k_types[i].high, &value)) {
                return _("has a value that its type does not hold");
            }
            item->value = (uint32_t)(uint64_t)value & (item->bytes == 4 ? UINT32_MAX : (1u << 8u * item->bytes) - 1u);
            return NULL;
        }
    }
    return _("has no type that there is");
}

static const char *read_flag(const char *word, cia402_item_t *item)
{
    if (strcmp(word, "unchecked") == 0 && item->is_written && item->is_checked) {
        item->is_checked = false;
    } else if (strcmp(word, "if-there") == 0 && !item->is_optional) {
        item->is_optional = true;
    } else if (strcmp(word, "last") == 0 && !item->is_last) {
        item->is_last = true;
    } else {
        return _("ends with a word that does not belong there");
    }
    return NULL;
}

static const char *read_item(char word[WORDS_MAX + 1u][WORD_BYTES], unsigned words, cia402_item_t *item)
{
    const bool is_looked_at = strcmp(word[1], "is") == 0;
    if (words < 4 || words > WORDS_MAX || (!is_looked_at && strcmp(word[1], "=") != 0)) {
        return _("is no object with value and type");
    }
    *item = (cia402_item_t){.is_written = !is_looked_at, .is_checked = true};
    const char *wrong = read_object(word[0], item);
    wrong = wrong != NULL ? wrong : read_value(word[2], word[3], item);
    for (unsigned i = 4; wrong == NULL && i < words; i++) {
        wrong = read_flag(word[i], item);
    }
    return wrong;
}

/* The words of a line, those that are too long cut. */
static unsigned split(const char *line, char word[WORDS_MAX + 1u][WORD_BYTES])
{
    unsigned words = 0;
    for (const char *at = line + strspn(line, BLANKS); *at != '\0' && words <= WORDS_MAX; words++) {
        const size_t length = *at == '=' ? 1u : strcspn(at, BLANKS "=");
        (void)snprintf(word[words], WORD_BYTES, "%.*s", (int)length, at);
        at += length;
        at += strspn(at, BLANKS);
    }
    return words;
}

void config_startup_parse(config_source_t *self, const char *before, const char *behind)
{
    const config_section_t *section = &config_sections[self->section];
    config_startup_t *list = (config_startup_t *)config_startup_of(section, self->config);
    char word[WORDS_MAX + 1u][WORD_BYTES] = {""};
    config_text_t line, quoted;
    cia402_item_t item;
    config_text_clear(&line);
    config_text_clear(&quoted);
    /* cut at the first = or :, which is the colon of the object unless somebody left it out */
    const bool is_colon = strchr(behind, '=') != NULL || strstr(behind, " is ") != NULL;
    config_text_add(&line, "%s%s%s", before, is_colon ? ":" : " = ", behind);
    const char *wrong = read_item(word, split(line.data, word), &item);
    if (wrong == NULL && list->count == CONFIG_STARTUP_MAX) {
        wrong = _("is one too many: a list has up to 32");
    }
    if (wrong != NULL) {
        config_text_add_quoted(&quoted, line.data, line.length);
        config_source_error(self, self->line, "[%s] %s %s; allowed: %s", section->name, quoted.data, wrong,
                            translate(config_startup_allowed));
        return;
    }
    self->startup_line[self->section][list->count] = self->line;
    list->item[list->count++] = item;
}

static bool is_same(const config_startup_t *a, const config_startup_t *b)
{
    config_text_t is, was;
    bool is_equal = a->count == b->count;
    for (unsigned i = 0; is_equal && i < a->count; i++) {
        config_text_clear(&is);
        config_text_clear(&was);
        config_startup_format(&a->item[i], &is);
        config_startup_format(&b->item[i], &was);
        is_equal = strcmp(is.data, was.data) == 0;
    }
    return is_equal;
}

unsigned config_startup_compare(const config_source_t *self, const config_t *running, FILE *report)
{
    unsigned changed = 0;
    for (size_t i = 0; i < config_section_count; i++) {
        const config_startup_t *list = config_startup_of(&config_sections[i], self->config);
        const bool is_other = list != NULL && !is_same(list, config_startup_of(&config_sections[i], running));
        changed += is_other;
        if (is_other && report != NULL) {
            fprintf(report, _("%s:%u: [%s] another list needs a restart; the one of the start stays\n"), self->path,
                    self->section_line[i] != 0 ? self->section_line[i] : self->line, config_sections[i].name);
        }
    }
    return changed;
}

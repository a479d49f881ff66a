/* SPDX-License-Identifier: MIT
 * value_can.c - values that only CAN drives have: identifiers, ratios, conditions.
 */
#include "config/value.h"

#include "common/translate.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define ITEM_BYTES 64u /* longer ones are no value, and are cut */

/* A whole number with nothing behind it but `end`; hexadecimal with 0x. Returns what follows, NULL where it is none. */
static const char *read_number(const char *text, int64_t low, int64_t high, int64_t *value)
{
    const char *digits = text + (text[0] == '-' || text[0] == '+');
    const bool is_hex = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X');
    char *end = NULL;
    if (strchr(is_hex ? "0123456789ABCDEFabcdef" : "0123456789", digits[is_hex ? 2 : 0]) == NULL ||
        digits[is_hex ? 2 : 0] == '\0') {
        return NULL;
    }
    errno = 0;
    *value = strtoll(text, &end, is_hex ? 16 : 10);
    return errno == 0 && *value >= low && *value <= high ? end : NULL;
}

static bool reject_many(const config_key_t *key, unsigned most, config_text_t *why)
{
    config_text_add(why, _("has more than %u values; allowed: "), most);
    config_value_allowed(key, why);
    return false;
}

/* Of a key with a range: numbers of another kind. */
static bool parse_ids(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_ids_t *ids = field;
    const int64_t most = key->high_milli > 0 ? key->high_milli / 1000 : (int64_t)CAN_ID_EXTENDED_MAX;
    char item[ITEM_BYTES];
    memset(ids, 0, sizeof *ids);
    for (const char *rest = text; rest != NULL;) {
        int64_t value = 0;
        const char *end = read_number(span_copy_item(&rest, item, sizeof item), 0, most, &value);
        if (end == NULL || *end != '\0') {
            const bool is_identifier = key->high_milli == 0 && key->words == NULL;
            return config_value_reject_text(key, item, is_identifier ? _("is no identifier") : _("is no such number"), why);
        }
        if (ids->count == DRIVES_MAX) {
            return reject_many(key, DRIVES_MAX, why);
        }
        ids->id[ids->count++] = (uint32_t)value;
    }
    return true;
}

static void format_ids(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_ids_t *ids = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < ids->count; i++) {
        config_text_add(text, "%s0x%X", i == 0 ? "" : ", ", (unsigned)ids->id[i]);
    }
}

static void allowed_ids(const config_key_t *key, config_text_t *text)
{
    if (key->high_milli > 0) {
        config_text_add(text, _("none, or whole numbers up to %lld, one for each drive"), (long long)(key->high_milli / 1000));
    } else {
        config_text_add(text, _("%s, or one for each drive"),
                        key->words != NULL ? translate(key->words) : _("none, or an identifier such as 0x601"));
    }
}

const config_type_t config_type_ids = {
    .has_none = true, .is_list = true, .parse = parse_ids, .format = format_ids, .allowed = allowed_ids};

/* The digits behind a point: 5.08 is 508/100. Returns what follows, NULL where 32 bits do not hold them. */
static const char *read_decimals(const char *digits, bool is_negative, int64_t *above, int64_t *below)
{
    if (*digits < '0' || *digits > '9') {
        return NULL;
    }
    for (; *digits >= '0' && *digits <= '9'; digits++) {
        *above = *above * 10 + (is_negative ? '0' - *digits : *digits - '0');
        *below *= 10;
        if (*above < -INT32_MAX || *above > INT32_MAX || *below > INT32_MAX) {
            return NULL;
        }
    }
    return digits;
}

/* "20000/10", "2000" or "5.08". */
static bool read_ratio(const char *text, int32_t *num, int32_t *den)
{
    int64_t above = 0;
    int64_t below = 1;
    const char *end = read_number(text, -INT32_MAX, INT32_MAX, &above);
    if (end != NULL && *end == '.' && strpbrk(text, "xX") == NULL) {
        end = read_decimals(end + 1, text[0] == '-', &above, &below);
    } else if (end != NULL && *end == '/') {
        end = read_number(end + 1, 1, INT32_MAX, &below);
    }
    *num = (int32_t)above;
    *den = (int32_t)below;
    return end != NULL && *end == '\0' && above != 0;
}

static bool parse_ratios(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_ratios_t *ratios = field;
    char item[ITEM_BYTES];
    memset(ratios, 0, sizeof *ratios);
    for (const char *rest = text; rest != NULL; ratios->count++) {
        span_copy_item(&rest, item, sizeof item);
        if (ratios->count == key->count) {
            return reject_many(key, key->count, why);
        }
        if (!read_ratio(item, &ratios->num[ratios->count], &ratios->den[ratios->count])) {
            return config_value_reject_text(key, item, _("is no ratio"), why);
        }
    }
    return true;
}

static void format_ratios(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_ratios_t *ratios = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < ratios->count; i++) {
        config_text_add(text, "%s%" PRId32, i == 0 ? "" : ", ", ratios->num[i]);
        if (ratios->den[i] != 1) {
            config_text_add(text, "/%" PRId32, ratios->den[i]);
        }
    }
}

static void allowed_ratios(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("none, or a ratio such as 20000/10, 2000 or 5.08%s"),
                    key->count > 1 ? _(", or one for each cylinder") : "");
}

const config_type_t config_type_ratios = {
    .has_none = true, .parse = parse_ratios, .format = format_ratios, .allowed = allowed_ratios};

static bool parse_wholes(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_wholes_t *wholes = field;
    char item[ITEM_BYTES];
    memset(wholes, 0, sizeof *wholes);
    for (const char *rest = text; rest != NULL; wholes->count++) {
        int64_t value = 0;
        const char *end = read_number(span_copy_item(&rest, item, sizeof item), -INT32_MAX, INT32_MAX, &value);
        if (wholes->count == key->count) {
            return reject_many(key, key->count, why);
        }
        if (end == NULL || *end != '\0') {
            return config_value_reject_text(key, item, _("is no whole number"), why);
        }
        wholes->value[wholes->count] = (int32_t)value;
    }
    return true;
}

static void format_wholes(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_wholes_t *wholes = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < wholes->count; i++) {
        config_text_add(text, "%s%" PRId32, i == 0 ? "" : ", ", wholes->value[i]);
    }
}

static void allowed_wholes(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("a whole number%s"), key->count > 1 ? _(", or one for each cylinder") : "");
}

const config_type_t config_type_wholes = {
    .is_list = true, .parse = parse_wholes, .format = format_wholes, .allowed = allowed_wholes};

/* "0x27/0x6F": these bits of the mask. */
static bool parse_when(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    int64_t value = 0;
    int64_t mask = 0;
    const char *slash = read_number(text, 0, UINT32_MAX, &value);
    const char *end = slash != NULL && *slash == '/' ? read_number(slash + 1, 1, UINT32_MAX, &mask) : NULL;
    if (end == NULL || *end != '\0') {
        return config_value_reject_text(key, text, _("is no value/mask"), why);
    }
    if ((value & ~mask) != 0) {
        return config_value_reject_text(key, text, _("has a value with bits outside its mask"), why);
    }
    *(canraw_when_t *)field = (canraw_when_t){.value = (uint32_t)value, .mask = (uint32_t)mask};
    return true;
}

static void format_when(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const canraw_when_t *when = field;
    (void)key, (void)config;
    if (when->mask != 0) {
        config_text_add(text, "0x%X/0x%X", (unsigned)when->value, (unsigned)when->mask);
    }
}

static void allowed_when(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("none, or value/mask such as 0x27/0x6F"));
}

const config_type_t config_type_when = {.has_none = true, .parse = parse_when, .format = format_when, .allowed = allowed_when};

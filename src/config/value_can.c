/* SPDX-License-Identifier: MIT
 * value_can.c - values that only CAN drives have; see value_can.h.
 */
#include "config/value_can.h"

#include "common/translate.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "config/value_frame.h"

#define ITEM_BYTES 64u /* longer ones are no value, and are cut */
#define NAME_BYTES "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-"

static bool refuse(const config_key_t *key, const char *item, size_t length, const char *what, config_text_t *why)
{
    config_text_add_quoted(why, item, length);
    config_text_add(why, _(" %s; allowed: "), what);
    config_value_can_allowed(key, why);
    return false;
}

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

/* The next item of a list, copied without the blanks round it; *rest becomes NULL with the last one. */
static const char *take_item(const char **rest, char item[ITEM_BYTES])
{
    const char *start = *rest + strspn(*rest, " \t");
    size_t length = strcspn(start, ",");
    *rest = start[length] == ',' ? start + length + 1 : NULL;
    while (length > 0 && (start[length - 1] == ' ' || start[length - 1] == '\t')) {
        length--;
    }
    snprintf(item, ITEM_BYTES, "%.*s", (int)length, start);
    return item;
}

static bool refuse_many(const config_key_t *key, unsigned most, config_text_t *why)
{
    config_text_add(why, _("has more than %u values; allowed: "), most);
    config_value_can_allowed(key, why);
    return false;
}

static bool parse_name(const config_key_t *key, const char *text, char *name, config_text_t *why)
{
    const size_t length = strlen(text);
    if (length == 0 || strspn(text, NAME_BYTES) != length || length >= key->size) {
        return refuse(key, text, length, _("is no name of an interface"), why);
    }
    memset(name, 0, key->size);
    (void)snprintf(name, key->size, "%s", text);
    return true;
}

/* Of a key with a range: numbers of another kind. */
static bool parse_ids(const config_key_t *key, const char *text, config_ids_t *ids, config_text_t *why)
{
    const int64_t most = key->high_milli > 0 ? key->high_milli / 1000 : (int64_t)CAN_ID_EXTENDED_MAX;
    char item[ITEM_BYTES];
    memset(ids, 0, sizeof *ids);
    for (const char *rest = text; rest != NULL;) {
        int64_t value = 0;
        const char *end = read_number(take_item(&rest, item), 0, most, &value);
        if (end == NULL || *end != '\0') {
            const bool is_identifier = key->high_milli == 0 && key->words == NULL;
            return refuse(key, item, strlen(item), is_identifier ? _("is no identifier") : _("is no such number"), why);
        }
        if (ids->count == DRIVES_MAX) {
            return refuse_many(key, DRIVES_MAX, why);
        }
        ids->id[ids->count++] = (uint32_t)value;
    }
    return true;
}

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

static bool parse_ratios(const config_key_t *key, const char *text, config_ratios_t *ratios, config_text_t *why)
{
    char item[ITEM_BYTES];
    memset(ratios, 0, sizeof *ratios);
    for (const char *rest = text; rest != NULL; ratios->count++) {
        take_item(&rest, item);
        if (ratios->count == key->count) {
            return refuse_many(key, key->count, why);
        }
        if (!read_ratio(item, &ratios->num[ratios->count], &ratios->den[ratios->count])) {
            return refuse(key, item, strlen(item), _("is no ratio"), why);
        }
    }
    return true;
}

static bool parse_wholes(const config_key_t *key, const char *text, config_wholes_t *wholes, config_text_t *why)
{
    char item[ITEM_BYTES];
    memset(wholes, 0, sizeof *wholes);
    for (const char *rest = text; rest != NULL; wholes->count++) {
        int64_t value = 0;
        const char *end = read_number(take_item(&rest, item), -INT32_MAX, INT32_MAX, &value);
        if (wholes->count == key->count) {
            return refuse_many(key, key->count, why);
        }
        if (end == NULL || *end != '\0') {
            return refuse(key, item, strlen(item), _("is no whole number"), why);
        }
        wholes->value[wholes->count] = (int32_t)value;
    }
    return true;
}

/* "0x27/0x6F": these bits of the mask. */
static bool parse_when(const config_key_t *key, const char *text, canraw_when_t *when, config_text_t *why)
{
    int64_t value = 0;
    int64_t mask = 0;
    const char *slash = read_number(text, 0, UINT32_MAX, &value);
    const char *end = slash != NULL && *slash == '/' ? read_number(slash + 1, 1, UINT32_MAX, &mask) : NULL;
    if (end == NULL || *end != '\0') {
        return refuse(key, text, strlen(text), _("is no value/mask"), why);
    }
    if ((value & ~mask) != 0) {
        return refuse(key, text, strlen(text), _("has a value with bits outside its mask"), why);
    }
    *when = (canraw_when_t){.value = (uint32_t)value, .mask = (uint32_t)mask};
    return true;
}

bool config_value_can_parse(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    if (strcmp(text, "none") == 0 && key->type != CONFIG_NAME && key->type != CONFIG_WHOLES) {
        memset(field, 0, key->size);
        return true;
    }
    if (key->type == CONFIG_NAME) {
        return parse_name(key, text, field, why);
    }
    if (key->type == CONFIG_IDS) {
        return parse_ids(key, text, field, why);
    }
    if (key->type == CONFIG_RATIOS) {
        return parse_ratios(key, text, field, why);
    }
    if (key->type == CONFIG_WHOLES) {
        return parse_wholes(key, text, field, why);
    }
    if (key->type == CONFIG_FRAME) {
        return config_value_frame_parse(key, text, field, why);
    }
    return key->type == CONFIG_STEP ? config_value_step_parse(key, text, field, why) : parse_when(key, text, field, why);
}

/* --- To text --- */

static void format_ids(const config_ids_t *ids, config_text_t *text)
{
    for (unsigned i = 0; i < ids->count; i++) {
        config_text_add(text, "%s0x%X", i == 0 ? "" : ", ", (unsigned)ids->id[i]);
    }
}

static void format_ratios(const config_ratios_t *ratios, config_text_t *text)
{
    for (unsigned i = 0; i < ratios->count; i++) {
        config_text_add(text, "%s%" PRId32, i == 0 ? "" : ", ", ratios->num[i]);
        if (ratios->den[i] != 1) {
            config_text_add(text, "/%" PRId32, ratios->den[i]);
        }
    }
}

void config_value_can_format(const config_key_t *key, const void *field, config_text_t *text)
{
    const size_t length = text->length;
    if (key->type == CONFIG_NAME) {
        config_text_add(text, "%s", (const char *)field);
    } else if (key->type == CONFIG_IDS) {
        format_ids(field, text);
    } else if (key->type == CONFIG_RATIOS) {
        format_ratios(field, text);
    } else if (key->type == CONFIG_WHOLES) {
        const config_wholes_t *wholes = field;
        for (unsigned i = 0; i < wholes->count; i++) {
            config_text_add(text, "%s%" PRId32, i == 0 ? "" : ", ", wholes->value[i]);
        }
    } else if (key->type == CONFIG_FRAME) {
        config_value_frame_format(field, text);
    } else if (key->type == CONFIG_STEP) {
        config_value_step_format(field, text);
    } else if (((const canraw_when_t *)field)->mask != 0) {
        const canraw_when_t *when = field;
        config_text_add(text, "0x%X/0x%X", (unsigned)when->value, (unsigned)when->mask);
    }
    if (text->length == length) {
        config_text_add(text, "none");
    }
}

void config_value_can_allowed(const config_key_t *key, config_text_t *text)
{
    if (key->type == CONFIG_NAME) {
        config_text_add(text, _("a name of up to %u letters, digits and . _ -"), (unsigned)key->size - 1u);
    } else if (key->type == CONFIG_IDS && key->high_milli > 0) {
        config_text_add(text, _("none, or whole numbers up to %lld, one for each drive"), (long long)(key->high_milli / 1000));
    } else if (key->type == CONFIG_IDS) {
        config_text_add(text, _("%s, or one for each drive"),
                        key->words != NULL ? translate(key->words) : _("none, or an identifier such as 0x601"));
    } else if (key->type == CONFIG_RATIOS) {
        config_text_add(text, _("none, or a ratio such as 20000/10, 2000 or 5.08%s"),
                        key->count > 1 ? _(", or one for each cylinder") : "");
    } else if (key->type == CONFIG_WHOLES) {
        config_text_add(text, _("a whole number%s"), key->count > 1 ? _(", or one for each cylinder") : "");
    } else if (key->type == CONFIG_FRAME || key->type == CONFIG_STEP) {
        config_value_frame_allowed(key, text);
    } else {
        config_text_add(text, _("none, or value/mask such as 0x27/0x6F"));
    }
}

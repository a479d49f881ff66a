/* SPDX-License-Identifier: MIT
 * value_number.c - values that are numbers: decimals, whole numbers, masks, signs.
 * Decimals go through the core's number_parse: exact, the same as in frames, no locale.
 */
#include "config/value.h"

#include "common/translate.h"

#include <inttypes.h>
#include <string.h>

#include "heave/number.h"

/* "or none": the word that may stand in place of a number. */
static void add_number_word(const config_key_t *key, config_text_t *text)
{
    if (key->words != NULL) {
        config_text_add(text, _(", or %s"), key->words);
    }
}

/* --- Decimals --- */

/* Nearest Q16.16 of a range end, as number_parse would read it. */
static q16_t q16_from_milli(int64_t value_milli)
{
    const int64_t half = value_milli < 0 ? -500 : 500;
    return (q16_t)((value_milli * Q16_ONE + half) / 1000);
}

static bool parse_decimal(const config_key_t *key, span_t item, q16_t *value_q16, config_text_t *why)
{
    if (key->words != NULL && span_is_word(item, key->words)) {
        *value_q16 = CONFIG_NONE;
        return true;
    }
    q16_t parsed_q16 = 0;
    switch (number_parse(item.at, item.length, &parsed_q16)) {
    case NUMBER_OK:
        break;
    case NUMBER_EMPTY:
        return config_value_reject(key, item, _("has no number"), why);
    case NUMBER_SYNTAX:
        return config_value_reject(key, item, _("is not a number"), why);
    case NUMBER_OVERFLOW:
        return config_value_reject(key, item, _("is out of range"), why);
    }
    if (parsed_q16 < q16_from_milli(key->low_milli) || parsed_q16 > q16_from_milli(key->high_milli)) {
        return config_value_reject(key, item, _("is out of range"), why);
    }
    *value_q16 = parsed_q16;
    return true;
}

/* A list of exactly count numbers. */
static bool parse_each(const config_key_t *key, const char *text, q16_t *values_q16, unsigned count, config_text_t *why)
{
    const char *rest = text;
    for (unsigned i = 0; i < count; i++) {
        if (!parse_decimal(key, span_next_item(&rest), &values_q16[i], why)) {
            return false;
        }
    }
    return true;
}

static bool parse_decimals(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const unsigned count = span_count_items(text);
    return count == key->count ? parse_each(key, text, field, count, why) : config_value_reject_count(key, count, why);
}

static void format_each(const config_key_t *key, const q16_t *values_q16, unsigned count, config_text_t *text)
{
    for (unsigned i = 0; i < count; i++) {
        config_text_add(text, "%s", i == 0 ? "" : ", ");
        if (key->words != NULL && values_q16[i] == CONFIG_NONE) {
            config_text_add(text, "%s", key->words);
        } else {
            config_text_add_q16(text, values_q16[i]);
        }
    }
}

static void format_decimals(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    (void)config;
    format_each(key, field, key->count, text);
}

static void allowed_decimals(const config_key_t *key, config_text_t *text)
{
    if (key->count == 1u) {
        config_text_add(text, _("a number"));
    } else {
        config_text_add(text, _("%u numbers"), key->count);
    }
    config_value_add_range(key, text);
    config_text_add(text, "%s", key->count == 1u ? "" : _(", separated by commas"));
    add_number_word(key, text);
}

const config_type_t config_type_decimal = {
    .is_number = true, .is_list = true, .parse = parse_decimals, .format = format_decimals, .allowed = allowed_decimals};

/* --- One number for all, or one for each --- */

static bool parse_per_cylinder(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const unsigned count = span_count_items(text);
    q16_t *values_q16 = field;
    if (count != 1u && count != 3u && count != CYLINDERS_MAX) {
        return config_value_reject_count(key, count, why);
    }
    if (!parse_each(key, text, values_q16, count, why)) {
        return false;
    }
    for (unsigned i = 1; count == 1u && i < CYLINDERS_MAX; i++) {
        values_q16[i] = values_q16[0];
    }
    return true;
}

static void format_per_cylinder(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const q16_t *values_q16 = field;
    const unsigned cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
    bool is_same = true;
    for (unsigned i = 1; i < cylinders; i++) {
        is_same = is_same && values_q16[i] == values_q16[0];
    }
    format_each(key, values_q16, is_same ? 1u : cylinders, text);
}

static void allowed_per_cylinder(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, "%s", _("a number"));
    config_value_add_range(key, text);
    config_text_add(text, _(", or one for each %s"), _("cylinder"));
}

const config_type_t config_type_per_cylinder = {.is_number = true,
                                                .is_list = true,
                                                .parse = parse_per_cylinder,
                                                .format = format_per_cylinder,
                                                .allowed = allowed_per_cylinder};

/* --- Whole numbers --- */

static bool parse_whole(const config_key_t *key, span_t item, int64_t *value, config_text_t *why)
{
    int64_t parsed = 0;
    if (!span_read_whole(item, &parsed)) {
        return config_value_reject(key, item, _("is not a whole number"), why);
    }
    if (parsed * 1000 < key->low_milli || parsed * 1000 > key->high_milli) {
        return config_value_reject(key, item, _("is out of range"), why);
    }
    *value = parsed;
    return true;
}

static int hex_digit(char byte)
{
    if (byte >= '0' && byte <= '9') {
        return byte - '0';
    }
    if (byte >= 'A' && byte <= 'F') {
        return byte - 'A' + 10;
    }
    return byte >= 'a' && byte <= 'f' ? byte - 'a' + 10 : -1;
}

/* With 0x in front; not more digits than 32 bits have. */
static bool read_hex(span_t item, int64_t *value)
{
    int64_t sum = 0;
    if (item.length < 3 || item.length > 10 || item.at[0] != '0' || (item.at[1] != 'x' && item.at[1] != 'X')) {
        return false;
    }
    for (size_t i = 2; i < item.length; i++) {
        const int digit = hex_digit(item.at[i]);
        if (digit < 0) {
            return false;
        }
        sum = sum * 16 + digit;
    }
    *value = sum;
    return true;
}

/* A number that people know in hexadecimal: one of 32 bits, as identities are. Takes both. */
static bool is_hex_key(const config_key_t *key)
{
    return key->high_milli == (int64_t)UINT32_MAX * 1000;
}

static bool parse_integer(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const span_t item = {text, strlen(text)};
    int64_t value = CONFIG_NONE;
    const bool is_none = key->words != NULL && span_is_word(item, key->words);
    const bool is_hex = is_hex_key(key) && read_hex(item, &value);
    if (!is_none && !is_hex && !parse_whole(key, item, &value, why)) {
        return false;
    }
    config_value_store(field, key->size, value);
    return true;
}

static void format_integer(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const int64_t value = config_value_load(field, key->size);
    (void)config;
    if (key->words != NULL && value == CONFIG_NONE) {
        config_text_add(text, "%s", key->words);
    } else {
        config_text_add(text, "%" PRId64, value);
    }
}

static void allowed_integer(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("a whole number"));
    config_value_add_range(key, text);
    config_text_add(text, "%s", is_hex_key(key) ? _(", or hexadecimal with 0x") : "");
    add_number_word(key, text);
}

const config_type_t config_type_integer = {
    .is_number = true, .parse = parse_integer, .format = format_integer, .allowed = allowed_integer};

static bool parse_per_relay(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const unsigned count = span_count_items(text);
    const char *rest = text;
    uint32_t *values = field;
    if (count > CONFIG_RELAYS_MAX) {
        return config_value_reject_count(key, count, why);
    }
    memset(values, 0, key->size);
    for (unsigned i = 0; i < count; i++) {
        int64_t value = 0;
        if (!parse_whole(key, span_next_item(&rest), &value, why)) {
            return false;
        }
        values[i] = (uint32_t)value;
    }
    for (unsigned i = 1; count == 1u && i < CONFIG_RELAYS_MAX; i++) {
        values[i] = values[0];
    }
    return true;
}

static void format_per_relay(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const uint32_t *values = field;
    const unsigned relays = config->relays.lines.count;
    bool is_same = true;
    (void)key;
    for (unsigned i = 1; i < relays; i++) {
        is_same = is_same && values[i] == values[0];
    }
    for (unsigned i = 0; i < (is_same ? 1u : relays); i++) {
        config_text_add(text, "%s%" PRIu32, i == 0 ? "" : ", ", values[i]);
    }
}

static void allowed_per_relay(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, "%s", _("a whole number"));
    config_value_add_range(key, text);
    config_text_add(text, _(", or one for each %s"), _("relay"));
}

const config_type_t config_type_per_relay = {
    .is_list = true, .parse = parse_per_relay, .format = format_per_relay, .allowed = allowed_per_relay};

/* --- Masks and signs --- */

static bool parse_mask(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const span_t item = {text, strlen(text)};
    const bool has_prefix = item.length > 2u && item.at[0] == '0' && (item.at[1] == 'x' || item.at[1] == 'X');
    const size_t start = has_prefix ? 2u : 0u;
    int64_t value = 0;
    if (item.length == start || item.length - start > 4u) {
        return config_value_reject(key, item, _("is not a mask"), why);
    }
    for (size_t i = start; i < item.length; i++) {
        const int digit = hex_digit(item.at[i]);
        if (digit < 0) {
            return config_value_reject(key, item, _("is not a mask"), why);
        }
        value = value * 16 + digit;
    }
    if (value * 1000 > key->high_milli) {
        return config_value_reject(key, item, _("is out of range"), why);
    }
    config_value_store(field, key->size, value);
    return true;
}

static void format_mask(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    (void)config;
    config_text_add(text, "%03X", (unsigned)config_value_load(field, key->size));
}

static void allowed_mask(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("hexadecimal 0 to %X"), (unsigned)(key->high_milli / 1000));
}

const config_type_t config_type_mask = {.parse = parse_mask, .format = format_mask, .allowed = allowed_mask};

static bool parse_sign(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    int64_t value = 0;
    if (!span_read_whole((span_t){text, strlen(text)}, &value) || (value != 1 && value != -1)) {
        return config_value_reject_text(key, text, _("is not a sign"), why);
    }
    *(int8_t *)field = (int8_t)value;
    return true;
}

static void format_sign(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    (void)key, (void)config;
    config_text_add(text, "%d", *(const int8_t *)field);
}

static void allowed_sign(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("1 or -1"));
}

const config_type_t config_type_sign = {.parse = parse_sign, .format = format_sign, .allowed = allowed_sign};

/* SPDX-License-Identifier: MIT
 * value.c - values of the configuration file from text, one parser per type.
 * Decimals go through the core's number_parse: exact, the same as in frames, no locale.
 */
#include "config/value.h"

#include "common/translate.h"
#include "config/slip.h"
#include "config/span.h"
#include "config/value_can.h"
#include "config/value_canopen.h"
#include "config/value_modbus.h"
#include "config/value_network.h"

#include <string.h>

#include "heave/number.h"

static void store_whole(void *field, size_t size, int64_t value)
{
    if (size == 1u) {
        *(uint8_t *)field = (uint8_t)value;
    } else if (size == 2u) {
        *(uint16_t *)field = (uint16_t)value;
    } else {
        *(uint32_t *)field = (uint32_t)value;
    }
}

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
        return config_value_refuse(key, item, _("has no number"), why);
    case NUMBER_SYNTAX:
        return config_value_refuse(key, item, _("is not a number"), why);
    case NUMBER_OVERFLOW:
        return config_value_refuse(key, item, _("is out of range"), why);
    }
    if (parsed_q16 < q16_from_milli(key->low_milli) || parsed_q16 > q16_from_milli(key->high_milli)) {
        return config_value_refuse(key, item, _("is out of range"), why);
    }
    *value_q16 = parsed_q16;
    return true;
}

/* A list of exactly count numbers. */
static bool parse_decimals(const config_key_t *key, const char *text, q16_t *values_q16, unsigned count, config_text_t *why)
{
    const char *rest = text;
    for (unsigned i = 0; i < count; i++) {
        if (!parse_decimal(key, span_next_item(&rest), &values_q16[i], why)) {
            return false;
        }
    }
    return true;
}

static bool parse_per_cylinder(const config_key_t *key, const char *text, q16_t *values_q16, unsigned count, config_text_t *why)
{
    if (count != 1u && count != 3u && count != CYLINDERS_MAX) {
        return config_value_refuse_count(key, count, why);
    }
    if (!parse_decimals(key, text, values_q16, count, why)) {
        return false;
    }
    for (unsigned i = 1; count == 1u && i < CYLINDERS_MAX; i++) {
        values_q16[i] = values_q16[0];
    }
    return true;
}

static bool parse_whole(const config_key_t *key, span_t item, int64_t *value, config_text_t *why)
{
    int64_t parsed = 0;
    if (!span_read_whole(item, &parsed)) {
        return config_value_refuse(key, item, _("is not a whole number"), why);
    }
    if (parsed * 1000 < key->low_milli || parsed * 1000 > key->high_milli) {
        return config_value_refuse(key, item, _("is out of range"), why);
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

static bool parse_integer(const config_key_t *key, span_t item, void *field, config_text_t *why)
{
    int64_t value = CONFIG_NONE;
    const bool is_none = key->words != NULL && span_is_word(item, key->words);
    const bool is_hex = CONFIG_IS_HEX(key) && read_hex(item, &value);
    if (!is_none && !is_hex && !parse_whole(key, item, &value, why)) {
        return false;
    }
    store_whole(field, key->size, value);
    return true;
}

static bool parse_mask(const config_key_t *key, span_t item, void *field, config_text_t *why)
{
    const bool has_prefix = item.length > 2u && item.at[0] == '0' && (item.at[1] == 'x' || item.at[1] == 'X');
    const size_t start = has_prefix ? 2u : 0u;
    int64_t value = 0;
    if (item.length == start || item.length - start > 4u) {
        return config_value_refuse(key, item, _("is not a mask"), why);
    }
    for (size_t i = start; i < item.length; i++) {
        const int digit = hex_digit(item.at[i]);
        if (digit < 0) {
            return config_value_refuse(key, item, _("is not a mask"), why);
        }
        value = value * 16 + digit;
    }
    if (value * 1000 > key->high_milli) {
        return config_value_refuse(key, item, _("is out of range"), why);
    }
    store_whole(field, key->size, value);
    return true;
}

static bool parse_sign(const config_key_t *key, span_t item, int8_t *sign, config_text_t *why)
{
    int64_t value = 0;
    if (!span_read_whole(item, &value) || (value != 1 && value != -1)) {
        return config_value_refuse(key, item, _("is not a sign"), why);
    }
    *sign = (int8_t)value;
    return true;
}

static bool parse_word(const config_key_t *key, span_t item, void *field, config_text_t *why)
{
    const int index = span_find_word(key->words, item);
    if (index >= 0) {
        store_whole(field, key->size, index);
        return true;
    }
    if (span_find_word(key->absent, item) < 0) {
        return config_value_refuse(key, item, _("is not known"), why);
    }
    config_text_add(why, _("driver %.*s is not built into this heaved; allowed: "), (int)item.length, item.at);
    config_value_allowed(key, why);
    return false;
}

static bool parse_yes_no(const config_key_t *key, span_t item, bool *field, config_text_t *why)
{
    const int index = span_find_word("no|yes", item);
    if (index < 0) {
        return config_value_refuse(key, item, _("is neither yes nor no"), why);
    }
    *field = index == 1;
    return true;
}

static bool parse_path(const config_key_t *key, span_t item, char *field, config_text_t *why)
{
    const bool is_none = key->words != NULL && span_is_word(item, key->words);
    if (!is_none && (item.length == 0 || item.at[0] != '/')) {
        return config_value_refuse(key, item, _("is not an absolute path"), why);
    }
    if (item.length >= key->size) {
        return config_value_refuse(key, item, _("is too long"), why);
    }
    memset(field, 0, key->size);
    memcpy(field, item.at, item.length);
    return true;
}

/* Bytes that names of GPIO lines and chips are made of. */
static bool is_label_byte(char byte)
{
    const bool is_letter = (byte >= 'a' && byte <= 'z') || (byte >= 'A' && byte <= 'Z');
    return is_letter || (byte >= '0' && byte <= '9') || (byte != '\0' && strchr(" _-+./:#()[]&*~", byte) != NULL);
}

static bool parse_label(const config_key_t *key, span_t item, config_label_t *label, config_text_t *why)
{
    memset(label, 0, sizeof *label);
    if (span_is_word(item, "none")) {
        return true;
    }
    if (item.length == 0 || item.length >= sizeof label->text) {
        return config_value_refuse(key, item, item.length == 0 ? _("has no name") : _("is too long"), why);
    }
    for (size_t i = 0; i < item.length; i++) {
        if (!is_label_byte(item.at[i])) {
            return config_value_refuse(key, item, _("is no name"), why);
        }
        label->text[i] = item.at[i];
    }
    return true;
}

static bool has_line(const config_lines_t *lines, const config_label_t *line)
{
    for (unsigned i = 0; i < lines->count; i++) {
        if (strcmp(lines->line[i].text, line->text) == 0) {
            return true;
        }
    }
    return false;
}

static bool parse_lines(const config_key_t *key, const char *text, config_lines_t *lines, config_text_t *why)
{
    const unsigned count = span_count_items(text);
    const char *rest = text;
    memset(lines, 0, sizeof *lines);
    if (strcmp(text, "none") == 0) {
        return true;
    }
    if (count > CONFIG_RELAYS_MAX) {
        return config_value_refuse_count(key, count, why);
    }
    while (rest != NULL) {
        const span_t item = span_next_item(&rest);
        config_label_t line;
        if (!parse_label(key, item, &line, why)) {
            return false;
        }
        if (line.text[0] == '\0' || has_line(lines, &line)) {
            return config_value_refuse(key, item, line.text[0] == '\0' ? _("is no line") : _("is listed twice"), why);
        }
        lines->line[lines->count++] = line;
    }
    return true;
}

static bool parse_per_relay(const config_key_t *key, const char *text, uint32_t *values, unsigned count, config_text_t *why)
{
    const char *rest = text;
    if (count > CONFIG_RELAYS_MAX) {
        return config_value_refuse_count(key, count, why);
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

static bool parse(const config_key_t *key, const char *text, config_t *config, unsigned *count, config_text_t *why)
{
    void *const field = (char *)config + key->offset;
    const span_t whole = {text, strlen(text)};
    *count = span_count_items(text);
    switch (key->type) {
    case CONFIG_DECIMAL:
        return *count == key->count ? parse_decimals(key, text, field, key->count, why)
                                    : config_value_refuse_count(key, *count, why);
    case CONFIG_PER_CYLINDER:
        return parse_per_cylinder(key, text, field, *count, why);
    case CONFIG_INTEGER:
        return parse_integer(key, whole, field, why);
    case CONFIG_MASK:
        return parse_mask(key, whole, field, why);
    case CONFIG_SIGN:
        return parse_sign(key, whole, field, why);
    case CONFIG_WORD:
        return parse_word(key, whole, field, why);
    case CONFIG_YES_NO:
        return parse_yes_no(key, whole, field, why);
    case CONFIG_ADDRESS:
        return config_value_network_parse_address(key, whole, field, why);
    case CONFIG_GROUP:
        return config_value_network_parse_group(key, whole, field, why);
    case CONFIG_NETWORKS:
        return config_value_network_parse_list(key, text, field, why);
    case CONFIG_PATH:
        return parse_path(key, whole, field, why);
    case CONFIG_LABEL:
        return parse_label(key, whole, field, why);
    case CONFIG_LINES:
        return parse_lines(key, text, field, why);
    case CONFIG_PER_RELAY:
        return parse_per_relay(key, text, field, *count, why);
    case CONFIG_NAME:
    case CONFIG_IDS:
    case CONFIG_RATIOS:
    case CONFIG_WHOLES:
    case CONFIG_FRAME:
    case CONFIG_STEP:
    case CONFIG_WHEN:
        return config_value_can_parse(key, text, field, why);
    case CONFIG_NODES:
    case CONFIG_WORDS:
    case CONFIG_MAPS:
        return config_value_canopen_parse(key, text, field, why);
    case CONFIG_HOSTS:
    case CONFIG_BLOCKS:
    case CONFIG_ITEMS:
        return config_value_modbus_parse(key, text, field, why);
    }
    return false;
}

bool config_value_parse(const config_key_t *key, const char *text, config_t *config, unsigned *count, config_text_t *why)
{
    config_text_t slip;
    if (parse(key, text, config, count, why)) {
        return true;
    }
    config_text_clear(&slip);
    if (config_slip_find(key, text, &slip)) {
        config_text_add(&slip, _("; allowed: "));
        config_value_allowed(key, &slip);
        *why = slip;
    }
    return false;
}

/* SPDX-License-Identifier: MIT
 * value.c - values of the configuration file from text, one parser per type.
 * Decimals go through the core's number_parse: exact, the same as in frames, no locale.
 */
#include "config/value.h"

#include "config/slip.h"
#include "config/value_can.h"
#include "config/value_modbus.h"

#include <arpa/inet.h>
#include <string.h>

#include "heave/number.h"

#define WHOLE_DIGITS_MAX 12u /* more than any range needs */

/* A piece of the file's text, not ended by a NUL. */
typedef struct {
    const char *at;
    size_t length;
} span_t;

static bool is_blank(char byte)
{
    return byte == ' ' || byte == '\t';
}

/* Takes blanks off both ends. */
static span_t trimmed(span_t span)
{
    while (span.length > 0 && is_blank(span.at[0])) {
        span.at++;
        span.length--;
    }
    while (span.length > 0 && is_blank(span.at[span.length - 1u])) {
        span.length--;
    }
    return span;
}

/* Takes the next item off a comma-separated list; *rest becomes NULL with the last one. */
static span_t next_item(const char **rest)
{
    const char *comma = strchr(*rest, ',');
    const span_t item = {*rest, comma == NULL ? strlen(*rest) : (size_t)(comma - *rest)};
    *rest = comma == NULL ? NULL : comma + 1;
    return trimmed(item);
}

static unsigned count_items(const char *text)
{
    unsigned count = 1;
    for (; *text != '\0'; text++) {
        count += *text == ',';
    }
    return count;
}

static bool is_word(span_t span, const char *word)
{
    return span.length == strlen(word) && memcmp(span.at, word, span.length) == 0;
}

/* Index of a word in a list separated by `|`, -1 where it is not there. */
static int find_word(const char *words, span_t asked)
{
    for (int index = 0; words != NULL; index++) {
        const char *bar = strchr(words, '|');
        const size_t length = bar == NULL ? strlen(words) : (size_t)(bar - words);
        if (asked.length == length && memcmp(asked.at, words, length) == 0) {
            return index;
        }
        words = bar == NULL ? NULL : bar + 1;
    }
    return -1;
}

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

/* Says what is wrong with an item, then what is allowed. */
static bool refuse(const config_key_t *key, span_t item, const char *what, config_text_t *why)
{
    config_text_add_quoted(why, item.at, item.length);
    config_text_add(why, " %s; allowed: ", what);
    config_value_allowed(key, why);
    return false;
}

/* Nearest Q16.16 of a range end, as number_parse would read it. */
static q16_t q16_from_milli(int64_t value_milli)
{
    const int64_t half = value_milli < 0 ? -500 : 500;
    return (q16_t)((value_milli * Q16_ONE + half) / 1000);
}

static bool parse_decimal(const config_key_t *key, span_t item, q16_t *value_q16, config_text_t *why)
{
    if (key->words != NULL && is_word(item, key->words)) {
        *value_q16 = CONFIG_NONE;
        return true;
    }
    q16_t parsed_q16 = 0;
    switch (number_parse(item.at, item.length, &parsed_q16)) {
    case NUMBER_OK:
        break;
    case NUMBER_EMPTY:
        return refuse(key, item, "has no number", why);
    case NUMBER_SYNTAX:
        return refuse(key, item, "is not a number", why);
    case NUMBER_OVERFLOW:
        return refuse(key, item, "is out of range", why);
    }
    if (parsed_q16 < q16_from_milli(key->low_milli) || parsed_q16 > q16_from_milli(key->high_milli)) {
        return refuse(key, item, "is out of range", why);
    }
    *value_q16 = parsed_q16;
    return true;
}

static bool refuse_count(const config_key_t *key, unsigned count, config_text_t *why)
{
    config_text_add(why, "has %u value%s; allowed: ", count, count == 1u ? "" : "s");
    config_value_allowed(key, why);
    return false;
}

/* A list of exactly count numbers. */
static bool parse_decimals(const config_key_t *key, const char *text, q16_t *values_q16, unsigned count, config_text_t *why)
{
    const char *rest = text;
    for (unsigned i = 0; i < count; i++) {
        if (!parse_decimal(key, next_item(&rest), &values_q16[i], why)) {
            return false;
        }
    }
    return true;
}

static bool parse_per_cylinder(const config_key_t *key, const char *text, q16_t *values_q16, unsigned count, config_text_t *why)
{
    if (count != 1u && count != 3u && count != CYLINDERS_MAX) {
        return refuse_count(key, count, why);
    }
    if (!parse_decimals(key, text, values_q16, count, why)) {
        return false;
    }
    for (unsigned i = 1; count == 1u && i < CYLINDERS_MAX; i++) {
        values_q16[i] = values_q16[0];
    }
    return true;
}

/* Reads digits with an optional sign. */
static bool read_whole(span_t item, int64_t *value)
{
    const bool is_negative = item.length > 0 && item.at[0] == '-';
    const size_t start = item.length > 0 && (is_negative || item.at[0] == '+') ? 1u : 0u;
    int64_t sum = 0;
    if (item.length == start || item.length - start > WHOLE_DIGITS_MAX) {
        return false;
    }
    for (size_t i = start; i < item.length; i++) {
        if (item.at[i] < '0' || item.at[i] > '9') {
            return false;
        }
        sum = sum * 10 + (item.at[i] - '0');
    }
    *value = is_negative ? -sum : sum;
    return true;
}

static bool parse_whole(const config_key_t *key, span_t item, int64_t *value, config_text_t *why)
{
    int64_t parsed = 0;
    if (!read_whole(item, &parsed)) {
        return refuse(key, item, "is not a whole number", why);
    }
    if (parsed * 1000 < key->low_milli || parsed * 1000 > key->high_milli) {
        return refuse(key, item, "is out of range", why);
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
    const bool is_none = key->words != NULL && is_word(item, key->words);
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
        return refuse(key, item, "is not a mask", why);
    }
    for (size_t i = start; i < item.length; i++) {
        const int digit = hex_digit(item.at[i]);
        if (digit < 0) {
            return refuse(key, item, "is not a mask", why);
        }
        value = value * 16 + digit;
    }
    if (value * 1000 > key->high_milli) {
        return refuse(key, item, "is out of range", why);
    }
    store_whole(field, key->size, value);
    return true;
}

static bool parse_sign(const config_key_t *key, span_t item, int8_t *sign, config_text_t *why)
{
    int64_t value = 0;
    if (!read_whole(item, &value) || (value != 1 && value != -1)) {
        return refuse(key, item, "is not a sign", why);
    }
    *sign = (int8_t)value;
    return true;
}

static bool parse_word(const config_key_t *key, span_t item, void *field, config_text_t *why)
{
    const int index = find_word(key->words, item);
    if (index >= 0) {
        store_whole(field, key->size, index);
        return true;
    }
    if (find_word(key->absent, item) < 0) {
        return refuse(key, item, "is not known", why);
    }
    config_text_add(why, "driver %.*s is not built into this heaved; allowed: ", (int)item.length, item.at);
    config_value_allowed(key, why);
    return false;
}

static bool parse_yes_no(const config_key_t *key, span_t item, bool *field, config_text_t *why)
{
    const int index = find_word("no|yes", item);
    if (index < 0) {
        return refuse(key, item, "is neither yes nor no", why);
    }
    *field = index == 1;
    return true;
}

/* Reads a numeric address into 16 bytes.
 * Returns its bits: 32, 128, or 0 where it is none. */
static unsigned read_address(span_t item, uint8_t address[16])
{
    char text[CONFIG_ADDRESS_MAX];
    if (item.length >= sizeof text) {
        return 0;
    }
    memcpy(text, item.at, item.length);
    text[item.length] = '\0';
    memset(address, 0, 16);
    if (inet_pton(AF_INET, text, address) == 1) {
        return 32;
    }
    return inet_pton(AF_INET6, text, address) == 1 ? 128 : 0;
}

/* 224.0.0.0/4 and ff00::/8. */
static bool is_group(const uint8_t *address, unsigned bits)
{
    return bits == 32u ? (address[0] & 0xF0u) == 0xE0u : bits == 128u && address[0] == 0xFFu;
}

static bool parse_address(const config_key_t *key, span_t item, char *field, config_text_t *why)
{
    uint8_t address[16];
    const unsigned bits = read_address(item, address);
    if (bits == 0) {
        return refuse(key, item, "is not an address", why);
    }
    if (is_group(address, bits)) {
        config_text_add_quoted(why, item.at, item.length);
        config_text_add(why,
                        " is a multicast group, to be joined; write %s = %s and group = %.*s%%eth0 (the network card on which)",
                        key->name, bits == 32u ? "0.0.0.0" : "::", (int)item.length, item.at);
        return false;
    }
    memset(field, 0, key->size);
    memcpy(field, item.at, item.length);
    return true;
}

/* What the kernel takes as the name of an interface. */
static bool is_interface(span_t item)
{
    bool is_name = item.length > 0 && item.length < CONFIG_NAME_MAX;
    for (size_t i = 0; is_name && i < item.length; i++) {
        is_name = item.at[i] > ' ' && item.at[i] <= '~' && item.at[i] != '/' && item.at[i] != ':';
    }
    return is_name;
}

static bool parse_group(const config_key_t *key, span_t item, char *field, config_text_t *why)
{
    uint8_t address[16];
    memset(field, 0, key->size);
    if (find_word(key->words, item) == 0) {
        return true;
    }
    const char *const sign = memchr(item.at, '%', item.length);
    const span_t host = {item.at, sign == NULL ? item.length : (size_t)(sign - item.at)};
    const unsigned bits = read_address(host, address);
    if (bits == 0) {
        return refuse(key, item, "is not an address", why);
    }
    if (!is_group(address, bits)) {
        return refuse(key, item, "is not the address of a multicast group", why);
    }
    if (sign == NULL || !is_interface((span_t){sign + 1, item.length - host.length - 1u})) {
        return refuse(key, item, "does not name a network card", why);
    }
    memcpy(field, item.at, item.length);
    return true;
}

/* True where an address has a bit set behind the first prefix bits. */
static bool has_host_bits(const hal_udp_network_t *network)
{
    const unsigned bits = network->is_ipv6 ? 128u : 32u;
    for (unsigned bit = network->prefix; bit < bits; bit++) {
        const unsigned byte = network->address[bit / 8u];
        if ((byte >> (7u - bit % 8u) & 1u) != 0) {
            return true;
        }
    }
    return false;
}

static bool parse_network(const config_key_t *key, span_t item, hal_udp_network_t *network, config_text_t *why)
{
    const char *slash = item.length > 0 ? memchr(item.at, '/', item.length) : NULL;
    const span_t address = {item.at, slash == NULL ? item.length : (size_t)(slash - item.at)};
    const unsigned bits = read_address(address, network->address);
    int64_t prefix = bits;
    if (bits == 0) {
        return refuse(key, item, "is not an address", why);
    }
    if (slash != NULL) {
        const span_t digits = {slash + 1, item.length - address.length - 1u};
        if (!read_whole(digits, &prefix) || prefix < 0 || prefix > bits) {
            return refuse(key, item, bits == 32u ? "has no prefix from 0 to 32" : "has no prefix from 0 to 128", why);
        }
    }
    network->is_ipv6 = bits == 128u;
    network->prefix = (uint8_t)prefix;
    if (has_host_bits(network)) {
        return refuse(key, item, "has bits set behind its prefix", why);
    }
    return true;
}

static bool parse_networks(const config_key_t *key, const char *text, hal_udp_networks_t *networks, config_text_t *why)
{
    const unsigned count = count_items(text);
    const char *rest = text;
    memset(networks, 0, sizeof *networks);
    if (strcmp(text, key->words) == 0) {
        return true;
    }
    if (count > HAL_UDP_NETWORKS_MAX) {
        return refuse_count(key, count, why);
    }
    while (rest != NULL) {
        if (!parse_network(key, next_item(&rest), &networks->network[networks->count], why)) {
            return false;
        }
        networks->count++;
    }
    return true;
}

static bool parse_path(const config_key_t *key, span_t item, char *field, config_text_t *why)
{
    const bool is_none = key->words != NULL && is_word(item, key->words);
    if (!is_none && (item.length == 0 || item.at[0] != '/')) {
        return refuse(key, item, "is not an absolute path", why);
    }
    if (item.length >= key->size) {
        return refuse(key, item, "is too long", why);
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
    if (is_word(item, "none")) {
        return true;
    }
    if (item.length == 0 || item.length >= sizeof label->text) {
        return refuse(key, item, item.length == 0 ? "has no name" : "is too long", why);
    }
    for (size_t i = 0; i < item.length; i++) {
        if (!is_label_byte(item.at[i])) {
            return refuse(key, item, "is no name", why);
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
    const unsigned count = count_items(text);
    const char *rest = text;
    memset(lines, 0, sizeof *lines);
    if (strcmp(text, "none") == 0) {
        return true;
    }
    if (count > CONFIG_RELAYS_MAX) {
        return refuse_count(key, count, why);
    }
    while (rest != NULL) {
        const span_t item = next_item(&rest);
        config_label_t line;
        if (!parse_label(key, item, &line, why)) {
            return false;
        }
        if (line.text[0] == '\0' || has_line(lines, &line)) {
            return refuse(key, item, line.text[0] == '\0' ? "is no line" : "is listed twice", why);
        }
        lines->line[lines->count++] = line;
    }
    return true;
}

static bool parse_per_relay(const config_key_t *key, const char *text, uint32_t *values, unsigned count, config_text_t *why)
{
    const char *rest = text;
    if (count > CONFIG_RELAYS_MAX) {
        return refuse_count(key, count, why);
    }
    memset(values, 0, key->size);
    for (unsigned i = 0; i < count; i++) {
        int64_t value = 0;
        if (!parse_whole(key, next_item(&rest), &value, why)) {
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
    *count = count_items(text);
    switch (key->type) {
    case CONFIG_DECIMAL:
        return *count == key->count ? parse_decimals(key, text, field, key->count, why) : refuse_count(key, *count, why);
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
        return parse_address(key, whole, field, why);
    case CONFIG_GROUP:
        return parse_group(key, whole, field, why);
    case CONFIG_NETWORKS:
        return parse_networks(key, text, field, why);
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
    case CONFIG_WHEN:
        return config_value_can_parse(key, text, field, why);
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
        config_text_add(&slip, "; allowed: ");
        config_value_allowed(key, &slip);
        *why = slip;
    }
    return false;
}

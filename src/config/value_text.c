/* SPDX-License-Identifier: MIT
 * value_text.c - values of the configuration file to text, and what each key takes in words.
 */
#include "config/value.h"

#include "common/translate.h"

#include "config/value_can.h"
#include "config/value_canopen.h"
#include "config/value_modbus.h"

#include <arpa/inet.h>
#include <inttypes.h>
#include <string.h>

static int64_t load_whole(const void *field, size_t size)
{
    if (size == 1u) {
        return *(const uint8_t *)field;
    }
    if (size == 2u) {
        return *(const uint16_t *)field;
    }
    return *(const int32_t *)field; /* no range goes above that of int32_t */
}

static void format_decimals(const config_key_t *key, const q16_t *values_q16, unsigned count, config_text_t *text)
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

/* One number where all cylinders have the same. */
static void format_per_cylinder(const config_key_t *key, const config_t *config, const q16_t *values_q16, config_text_t *text)
{
    const unsigned cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
    bool is_same = true;
    for (unsigned i = 1; i < cylinders; i++) {
        is_same = is_same && values_q16[i] == values_q16[0];
    }
    format_decimals(key, values_q16, is_same ? 1u : cylinders, text);
}

static void format_word(const char *words, int64_t index, config_text_t *text)
{
    for (; index > 0; index--) {
        words = strchr(words, '|') + 1;
    }
    config_text_add(text, "%.*s", (int)strcspn(words, "|"), words);
}

static void format_integer(const config_key_t *key, const void *field, config_text_t *text)
{
    const int64_t value = load_whole(field, key->size);
    if (key->words != NULL && value == CONFIG_NONE) {
        config_text_add(text, "%s", key->words);
    } else {
        config_text_add(text, "%" PRId64, value);
    }
}

static void format_networks(const config_key_t *key, const hal_udp_networks_t *networks, config_text_t *text)
{
    if (networks->count == 0) {
        config_text_add(text, "%s", key->words);
    }
    for (unsigned i = 0; i < networks->count; i++) {
        const hal_udp_network_t *network = &networks->network[i];
        char address[INET6_ADDRSTRLEN] = "";
        (void)inet_ntop(network->is_ipv6 ? AF_INET6 : AF_INET, network->address, address, sizeof address);
        config_text_add(text, "%s%s", i == 0 ? "" : ",", address); /* no blanks: never longer than what was read */
        if (network->prefix != (network->is_ipv6 ? 128u : 32u)) {
            config_text_add(text, "/%u", network->prefix);
        }
    }
}

static void format_lines(const config_lines_t *lines, config_text_t *text)
{
    if (lines->count == 0) {
        config_text_add(text, "none");
    }
    for (unsigned i = 0; i < lines->count; i++) {
        config_text_add(text, "%s%s", i == 0 ? "" : ", ", lines->line[i].text);
    }
}

/* One number where all relays have the same. */
static void format_per_relay(const config_t *config, const uint32_t *values, config_text_t *text)
{
    const unsigned relays = config->relays.lines.count;
    bool is_same = true;
    for (unsigned i = 1; i < relays; i++) {
        is_same = is_same && values[i] == values[0];
    }
    for (unsigned i = 0; i < (is_same ? 1u : relays); i++) {
        config_text_add(text, "%s%" PRIu32, i == 0 ? "" : ", ", values[i]);
    }
}

/* A value that is text. */
static const char *text_of(const config_key_t *key, const char *field)
{
    const bool has_none = key->type == CONFIG_LABEL || key->type == CONFIG_GROUP;
    return has_none && field[0] == '\0' ? "none" : field;
}

void config_value_format(const config_key_t *key, const config_t *config, config_text_t *text)
{
    const void *const field = (const char *)config + key->offset;
    switch (key->type) {
    case CONFIG_DECIMAL:
        format_decimals(key, field, key->count, text);
        break;
    case CONFIG_PER_CYLINDER:
        format_per_cylinder(key, config, field, text);
        break;
    case CONFIG_INTEGER:
        format_integer(key, field, text);
        break;
    case CONFIG_MASK:
        config_text_add(text, "%03X", (unsigned)load_whole(field, key->size));
        break;
    case CONFIG_SIGN:
        config_text_add(text, "%d", *(const int8_t *)field);
        break;
    case CONFIG_WORD:
        format_word(key->words, load_whole(field, key->size), text);
        break;
    case CONFIG_YES_NO:
        config_text_add(text, "%s", *(const bool *)field ? "yes" : "no");
        break;
    case CONFIG_ADDRESS:
    case CONFIG_PATH:
    case CONFIG_GROUP:
    case CONFIG_LABEL:
        config_text_add(text, "%s", text_of(key, field));
        break;
    case CONFIG_NETWORKS:
        format_networks(key, field, text);
        break;
    case CONFIG_LINES:
        format_lines(field, text);
        break;
    case CONFIG_PER_RELAY:
        format_per_relay(config, field, text);
        break;
    case CONFIG_NAME:
    case CONFIG_IDS:
    case CONFIG_RATIOS:
    case CONFIG_WHOLES:
    case CONFIG_FRAME:
    case CONFIG_STEP:
    case CONFIG_WHEN:
        config_value_can_format(key, field, text);
        break;
    case CONFIG_NODES:
    case CONFIG_WORDS:
    case CONFIG_MAPS:
        config_value_canopen_format(key, field, text);
        break;
    case CONFIG_HOSTS:
    case CONFIG_BLOCKS:
    case CONFIG_ITEMS:
        config_value_modbus_format(key, field, text);
        break;
    }
}

static void add_range(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _(" from "));
    config_text_add_milli(text, key->low_milli);
    config_text_add(text, _(" to "));
    config_text_add_milli(text, key->high_milli);
    config_text_add(text, "%s%s", key->unit[0] == '\0' ? "" : " ", translate(key->unit));
}

/* "or none": the word that may stand in place of a number. */
static void add_number_word(const config_key_t *key, config_text_t *text)
{
    if (key->words != NULL) {
        config_text_add(text, _(", or %s"), key->words);
    }
}

static void add_words(const char *words, config_text_t *text)
{
    for (const char *byte = words; *byte != '\0'; byte++) {
        config_text_add(text, *byte == '|' ? " %c " : "%c", *byte);
    }
}

static void allowed_decimals(const config_key_t *key, config_text_t *text)
{
    if (key->count == 1u) {
        config_text_add(text, _("a number"));
    } else {
        config_text_add(text, _("%u numbers"), key->count);
    }
    add_range(key, text);
    config_text_add(text, "%s", key->count == 1u ? "" : _(", separated by commas"));
    add_number_word(key, text);
}

static void allowed_addresses(const config_key_t *key, config_text_t *text)
{
    if (key->type == CONFIG_ADDRESS) {
        config_text_add(text, _("a numeric IPv4 or IPv6 address"));
    } else if (key->type == CONFIG_GROUP) {
        config_text_add(text, _("%s, or a multicast address and its network card, such as 239.1.2.3%%eth0 or ff15::9800%%eth0"),
                        key->words);
    } else {
        config_text_add(text, _("%s, or up to %u addresses or networks such as 192.168.7.0/24"), key->words,
                        HAL_UDP_NETWORKS_MAX);
    }
}

static void allowed_path(const config_key_t *key, config_text_t *text)
{
    if (key->words != NULL) {
        config_text_add(text, _("%s, or "), key->words);
    }
    config_text_add(text, _("an absolute path of at most %u characters"), (unsigned)key->size - 1u);
}

static void allowed_each(const config_key_t *key, config_text_t *text)
{
    const bool is_relay = key->type == CONFIG_PER_RELAY;
    config_text_add(text, "%s", is_relay ? _("a whole number") : _("a number"));
    add_range(key, text);
    config_text_add(text, _(", or one for each %s"), is_relay ? _("relay") : _("cylinder"));
}

void config_value_allowed(const config_key_t *key, config_text_t *text)
{
    switch (key->type) {
    case CONFIG_DECIMAL:
        allowed_decimals(key, text);
        break;
    case CONFIG_PER_CYLINDER:
    case CONFIG_PER_RELAY:
        allowed_each(key, text);
        break;
    case CONFIG_INTEGER:
        config_text_add(text, _("a whole number"));
        add_range(key, text);
        config_text_add(text, "%s", CONFIG_IS_HEX(key) ? _(", or hexadecimal with 0x") : "");
        add_number_word(key, text);
        break;
    case CONFIG_MASK:
        config_text_add(text, _("hexadecimal 0 to %X"), (unsigned)(key->high_milli / 1000));
        break;
    case CONFIG_WORD:
        add_words(key->words, text);
        break;
    case CONFIG_SIGN:
    case CONFIG_YES_NO:
        config_text_add(text, "%s", key->type == CONFIG_SIGN ? _("1 or -1") : _("yes | no"));
        break;
    case CONFIG_ADDRESS:
    case CONFIG_GROUP:
    case CONFIG_NETWORKS:
        allowed_addresses(key, text);
        break;
    case CONFIG_PATH:
        allowed_path(key, text);
        break;
    case CONFIG_LABEL:
        config_text_add(text, _("none, or a name of at most %u characters"), CONFIG_LABEL_MAX - 1u);
        break;
    case CONFIG_LINES:
        config_text_add(text, _("none, or up to %u different lines, by name or number"), CONFIG_RELAYS_MAX);
        break;
    case CONFIG_NAME:
    case CONFIG_IDS:
    case CONFIG_RATIOS:
    case CONFIG_WHOLES:
    case CONFIG_FRAME:
    case CONFIG_STEP:
    case CONFIG_WHEN:
        config_value_can_allowed(key, text);
        break;
    case CONFIG_NODES:
    case CONFIG_WORDS:
    case CONFIG_MAPS:
        config_value_canopen_allowed(key, text);
        break;
    case CONFIG_HOSTS:
    case CONFIG_BLOCKS:
    case CONFIG_ITEMS:
        config_value_modbus_allowed(key, text);
        break;
    }
}

bool config_value_refuse(const config_key_t *key, span_t item, const char *what, config_text_t *why)
{
    config_text_add_quoted(why, item.at, item.length);
    config_text_add(why, _(" %s; allowed: "), what);
    config_value_allowed(key, why);
    return false;
}

bool config_value_refuse_count(const config_key_t *key, unsigned count, config_text_t *why)
{
    config_text_add(why, translate_count("has %u value; allowed: ", "has %u values; allowed: ", count), count);
    config_value_allowed(key, why);
    return false;
}

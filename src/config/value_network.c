/* SPDX-License-Identifier: MIT
 * value_network.c - addresses, multicast groups and networks from text; how they are written.
 */
#include "config/value.h"

#include <arpa/inet.h>
#include <string.h>

#include "common/translate.h"
#include "heave/hal/udp.h"

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

static void format_text(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    (void)key, (void)config;
    config_text_add(text, "%s", (const char *)field);
}

static bool parse_address(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const span_t item = {text, strlen(text)};
    uint8_t address[16];
    const unsigned bits = read_address(item, address);
    if (bits == 0) {
        return config_value_reject(key, item, _("is not an address"), why);
    }
    if (is_group(address, bits)) {
        config_text_add_quoted(why, item.at, item.length);
        config_text_add(
            why, _(" is a multicast group, to be joined; write %s = %s and group = %.*s%%eth0 (the network card on which)"),
            key->name, bits == 32u ? "0.0.0.0" : "::", (int)item.length, item.at);
        return false;
    }
    memset(field, 0, key->size);
    memcpy(field, item.at, item.length);
    return true;
}

static void allowed_address(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("a numeric IPv4 or IPv6 address"));
}

const config_type_t config_type_address = {.parse = parse_address, .format = format_text, .allowed = allowed_address};

/* What the kernel takes as the name of an interface. */
static bool is_interface(span_t item)
{
    bool is_name = item.length > 0 && item.length < CONFIG_NAME_MAX;
    for (size_t i = 0; is_name && i < item.length; i++) {
        is_name = item.at[i] > ' ' && item.at[i] <= '~' && item.at[i] != '/' && item.at[i] != ':';
    }
    return is_name;
}

static bool parse_group(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    const span_t item = {text, strlen(text)};
    uint8_t address[16];
    memset(field, 0, key->size);
    const char *const sign = memchr(item.at, '%', item.length);
    const span_t host = {item.at, sign == NULL ? item.length : (size_t)(sign - item.at)};
    const unsigned bits = read_address(host, address);
    if (bits == 0) {
        return config_value_reject(key, item, _("is not an address"), why);
    }
    if (!is_group(address, bits)) {
        return config_value_reject(key, item, _("is not the address of a multicast group"), why);
    }
    if (sign == NULL || !is_interface((span_t){sign + 1, item.length - host.length - 1u})) {
        return config_value_reject(key, item, _("does not name a network card"), why);
    }
    memcpy(field, item.at, item.length);
    return true;
}

static void allowed_group(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("%s, or a multicast address and its network card, such as 239.1.2.3%%eth0 or ff15::9800%%eth0"),
                    key->words);
}

const config_type_t config_type_group = {.has_none = true, .parse = parse_group, .format = format_text, .allowed = allowed_group};

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
        return config_value_reject(key, item, _("is not an address"), why);
    }
    if (slash != NULL) {
        const span_t digits = {slash + 1, item.length - address.length - 1u};
        if (!span_read_whole(digits, &prefix) || prefix < 0 || prefix > bits) {
            return config_value_reject(key, item,
                                       bits == 32u ? _("has no prefix from 0 to 32") : _("has no prefix from 0 to 128"), why);
        }
    }
    network->is_ipv6 = bits == 128u;
    network->prefix = (uint8_t)prefix;
    if (has_host_bits(network)) {
        return config_value_reject(key, item, _("has bits set behind its prefix"), why);
    }
    return true;
}

static bool parse_networks(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    hal_udp_networks_t *networks = field;
    const unsigned count = span_count_items(text);
    const char *rest = text;
    memset(networks, 0, sizeof *networks);
    if (strcmp(text, key->words) == 0) {
        return true;
    }
    if (count > HAL_UDP_NETWORKS_MAX) {
        return config_value_reject_count(key, count, why);
    }
    while (rest != NULL) {
        if (!parse_network(key, span_next_item(&rest), &networks->network[networks->count], why)) {
            return false;
        }
        networks->count++;
    }
    return true;
}

static void format_networks(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const hal_udp_networks_t *networks = field;
    (void)config;
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

static void allowed_networks(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("%s, or up to %u addresses or networks such as 192.168.7.0/24"), key->words, HAL_UDP_NETWORKS_MAX);
}

const config_type_t config_type_networks = {.parse = parse_networks, .format = format_networks, .allowed = allowed_networks};

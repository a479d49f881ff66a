/* SPDX-License-Identifier: MIT
 * hal_udp.c - addresses of peers: comparison, networks, and text, IPv6 in the canonical form of RFC 5952.
 */
#include "heave/hal/udp.h"

#define GROUPS 8u

/** Text that grows up to its capacity, always ended by NUL. */
typedef struct {
    char *text;
    size_t capacity;
    size_t length;
} writer_t;

static void put(writer_t *out, char c)
{
    if (out->length + 1 < out->capacity) {
        out->text[out->length++] = c;
        out->text[out->length] = '\0';
    }
}

static void put_number(writer_t *out, uint32_t value, uint32_t base)
{
    char digits[10];
    size_t count = 0;
    do {
        digits[count++] = "0123456789abcdef"[value % base];
        value /= base;
    } while (value != 0);
    while (count > 0) {
        put(out, digits[--count]);
    }
}

static void put_ipv4(writer_t *out, const uint8_t *address)
{
    for (unsigned i = 0; i < 4; i++) {
        if (i > 0) {
            put(out, '.');
        }
        put_number(out, address[i], 10);
    }
}

static uint32_t group(const uint8_t *address, unsigned i)
{
    return (uint32_t)address[2 * i] << 8 | address[2 * i + 1];
}

/* Groups of zero from `from` on. */
static unsigned zeros_at(const uint8_t *address, unsigned from)
{
    unsigned end = from;
    while (end < GROUPS && group(address, end) == 0) {
        end++;
    }
    return end - from;
}

static void put_ipv6(writer_t *out, const uint8_t *address)
{
    unsigned gap = GROUPS; /* the first of the longest runs of zero groups; a single one is written out */
    unsigned gap_length = 1;
    for (unsigned i = 0; i < GROUPS; i++) {
        if (zeros_at(address, i) > gap_length) {
            gap = i;
            gap_length = zeros_at(address, i);
        }
    }
    for (unsigned i = 0; i < GROUPS; i++) {
        if (i == gap) {
            put(out, ':');
            put(out, ':');
            i += gap_length - 1;
            continue;
        }
        if (i > 0 && i != gap + gap_length) {
            put(out, ':');
        }
        put_number(out, group(address, i), 16);
    }
}

static void put_host(writer_t *out, const hal_udp_peer_t *peer)
{
    if (!peer->is_ipv6) {
        put_ipv4(out, peer->address);
        return;
    }
    put_ipv6(out, peer->address);
    if (peer->scope_id != 0) {
        put(out, '%');
        put_number(out, peer->scope_id, 10);
    }
}

size_t hal_udp_host_text(const hal_udp_peer_t *peer, char *text, size_t capacity)
{
    writer_t out = {text, capacity, 0};
    text[0] = '\0';
    put_host(&out, peer);
    return out.length;
}

size_t hal_udp_peer_text(const hal_udp_peer_t *peer, char *text, size_t capacity)
{
    writer_t out = {text, capacity, 0};
    text[0] = '\0';
    if (peer->is_ipv6) {
        put(&out, '[');
    }
    put_host(&out, peer);
    if (peer->is_ipv6) {
        put(&out, ']');
    }
    put(&out, ':');
    put_number(&out, peer->port, 10);
    return out.length;
}

/* True where the first bits of two addresses are the same. */
static bool are_bits_same(const uint8_t *a, const uint8_t *b, unsigned bits)
{
    unsigned byte = 0;
    for (; bits >= 8; bits -= 8, byte++) {
        if (a[byte] != b[byte]) {
            return false;
        }
    }
    return bits == 0 || (uint8_t)(a[byte] ^ b[byte]) >> (8u - bits) == 0;
}

bool hal_udp_is_same_host(const hal_udp_peer_t *a, const hal_udp_peer_t *b)
{
    return a->is_ipv6 == b->is_ipv6 && a->scope_id == b->scope_id && are_bits_same(a->address, b->address, 128);
}

unsigned hal_udp_rank(const hal_udp_networks_t *list, const hal_udp_peer_t *peer)
{
    unsigned i = 0;
    for (; i < list->count; i++) {
        const hal_udp_network_t *network = &list->network[i];
        if (network->is_ipv6 == peer->is_ipv6 && are_bits_same(network->address, peer->address, network->prefix)) {
            break;
        }
    }
    return i;
}

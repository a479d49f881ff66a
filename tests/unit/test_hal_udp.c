/* SPDX-License-Identifier: MIT
 * test_hal_udp.c - text of a peer's address, against inet_ntop and hand-written cases.
 */
#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>

#include "random.h"
#include "unity.h"

#include "heave/hal/udp.h"

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

static void assert_text(const char *expected, const hal_udp_peer_t *peer)
{
    char text[HAL_UDP_PEER_TEXT_MAX];
    TEST_ASSERT_EQUAL_UINT64(strlen(expected), hal_udp_peer_text(peer, text, sizeof text));
    TEST_ASSERT_EQUAL_STRING(expected, text);
}

static void test_peer_text_ipv4_corners_read_as_dotted(void)
{
    assert_text("0.0.0.0:0", &(hal_udp_peer_t){.port = 0});
    assert_text("255.255.255.255:65535", &(hal_udp_peer_t){.address = {255, 255, 255, 255}, .port = 65535});
    assert_text("192.168.1.5:9800", &(hal_udp_peer_t){.address = {192, 168, 1, 5}, .port = 9800});
}

static void test_peer_text_ipv6_corners_are_canonical(void)
{
    assert_text("[::]:1", &(hal_udp_peer_t){.is_ipv6 = true, .port = 1});
    assert_text("[::1]:9800", &(hal_udp_peer_t){.address = {[15] = 1}, .is_ipv6 = true, .port = 9800});
    assert_text("[fe80::1%2]:9800",
                &(hal_udp_peer_t){.address = {0xFE, 0x80, [15] = 1}, .is_ipv6 = true, .port = 9800, .scope_id = 2});
    assert_text(
        "[2001:db8:0:1:1:1:1:1]:5", /* a single zero group is not shortened */
        &(hal_udp_peer_t){.address = {0x20, 1, 0x0D, 0xB8, 0, 0, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1}, .is_ipv6 = true, .port = 5});
}

static void test_peer_text_longest_fits_the_documented_size(void)
{
    hal_udp_peer_t peer = {.scope_id = UINT32_MAX, .port = 65535, .is_ipv6 = true};
    memset(peer.address, 0xFF, sizeof peer.address);
    assert_text("[ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff%4294967295]:65535", &peer);
}

/* Addresses made mostly of zero groups, where the forms differ. Those whose first five groups are zero are left out: there
 * inet_ntop writes the last 32 bits as dotted decimals, which this text never does. */
static void test_peer_text_random_ipv6_matches_inet_ntop(void)
{
    unsigned compared = 0;
    for (unsigned i = 0; i < 100000; i++) {
        hal_udp_peer_t peer = {.is_ipv6 = true, .port = (uint16_t)(uint32_t)(random_bits() >> 32)};
        char address[INET6_ADDRSTRLEN], expected[80];
        unsigned leading = 0;
        for (unsigned g = 0; g < 8; g++) {
            const uint32_t bits = (uint32_t)(random_bits() >> 32);
            const uint32_t value = bits % 3 != 0 ? 0 : bits >> 16 >> (bits >> 8 & 15);
            peer.address[2 * g] = (uint8_t)(value >> 8);
            peer.address[2 * g + 1] = (uint8_t)value;
            leading += leading == g && value == 0;
        }
        if (leading >= 5) {
            continue;
        }
        TEST_ASSERT_NOT_NULL(inet_ntop(AF_INET6, peer.address, address, sizeof address));
        (void)snprintf(expected, sizeof expected, "[%s]:%u", address, (unsigned)peer.port);
        assert_text(expected, &peer);
        compared++;
    }
    TEST_ASSERT_TRUE(compared > 50000);
}

static void test_peer_text_short_buffer_is_cut_and_ended(void)
{
    const hal_udp_peer_t peer = {.address = {192, 168, 1, 5}, .port = 9800};
    const char *whole = "192.168.1.5:9800";
    for (size_t capacity = 1; capacity <= strlen(whole) + 1; capacity++) {
        char text[32];
        memset(text, 'x', sizeof text);
        TEST_ASSERT_EQUAL_UINT64(capacity - 1, hal_udp_peer_text(&peer, text, capacity));
        TEST_ASSERT_EQUAL_INT(0, strncmp(whole, text, capacity - 1));
        TEST_ASSERT_EQUAL_INT('\0', text[capacity - 1]);
        TEST_ASSERT_EQUAL_INT('x', text[capacity]);
    }
}

static void test_host_text_is_the_address_alone(void)
{
    char text[HAL_UDP_PEER_TEXT_MAX];
    (void)hal_udp_host_text(&(hal_udp_peer_t){.address = {192, 168, 1, 5}, .port = 9800}, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("192.168.1.5", text);
    const hal_udp_peer_t local = {.address = {0xfe, 0x80, [15] = 1}, .scope_id = 2, .is_ipv6 = true, .port = 7};
    (void)hal_udp_host_text(&local, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("fe80::1%2", text);
}

static void test_is_same_host_tells_addresses_and_widths_not_ports(void)
{
    const hal_udp_peer_t a = {.address = {10, 0, 0, 1}, .port = 1};
    hal_udp_peer_t b = a;
    b.port = 2;
    TEST_ASSERT_TRUE(hal_udp_is_same_host(&a, &b));
    b.address[3] = 2;
    TEST_ASSERT_FALSE(hal_udp_is_same_host(&a, &b));
    b = a;
    b.is_ipv6 = true;
    TEST_ASSERT_FALSE(hal_udp_is_same_host(&a, &b));
    b = a;
    b.scope_id = 3;
    TEST_ASSERT_FALSE(hal_udp_is_same_host(&a, &b));
}

/* Against the bits one by one. */
static void test_rank_random_networks_match_bit_by_bit(void)
{
    for (unsigned round = 0; round < 20000; round++) {
        hal_udp_network_t network = {.is_ipv6 = (uint32_t)(random_bits() >> 32) & 1u};
        network.prefix = (uint8_t)((uint32_t)(random_bits() >> 32) % (network.is_ipv6 ? 129u : 33u));
        hal_udp_peer_t peer = {.is_ipv6 = ((uint32_t)(random_bits() >> 32) & 7u) == 0 ? !network.is_ipv6 : network.is_ipv6};
        for (unsigned i = 0; i < (network.is_ipv6 ? 16u : 4u); i++) {
            network.address[i] = (uint8_t)(uint32_t)(random_bits() >> 32);
            peer.address[i] = network.address[i];
        }
        const unsigned flipped = (uint32_t)(random_bits() >> 32) % (network.is_ipv6 ? 128u : 32u);
        peer.address[flipped / 8] ^= (uint8_t)(0x80u >> flipped % 8);
        const hal_udp_networks_t list = {.count = 1, .network = {network}};
        const bool is_in = peer.is_ipv6 == network.is_ipv6 && flipped >= network.prefix;
        TEST_ASSERT_EQUAL_UINT(is_in ? 0 : 1, hal_udp_rank(&list, &peer));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_peer_text_ipv4_corners_read_as_dotted);
    RUN_TEST(test_peer_text_ipv6_corners_are_canonical);
    RUN_TEST(test_peer_text_longest_fits_the_documented_size);
    RUN_TEST(test_peer_text_random_ipv6_matches_inet_ntop);
    RUN_TEST(test_peer_text_short_buffer_is_cut_and_ended);
    RUN_TEST(test_host_text_is_the_address_alone);
    RUN_TEST(test_is_same_host_tells_addresses_and_widths_not_ports);
    RUN_TEST(test_rank_random_networks_match_bit_by_bit);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_hal_udp.c - the contract of hal/udp.h on every backend (Linux over loopback), and what single backends promise beyond it.
 */
#include "contract.h"

#include <arpa/inet.h>
#include <errno.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sched.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "linux_udp.h"
#include "linux_udp_filter.h"
#include "sim_udp.h"

/** A backend under test. */
typedef struct {
    const char *name;
    bool (*open)(hal_udp_t *udp); /**< false: not to be had on this machine */
    void (*close)(void);
    hal_udp_peer_t (*send)(const void *data, size_t length); /**< the other side sends; returns who it is */
    void (*wait)(void);                                      /**< until something may have arrived */
} fixture_t;

static const fixture_t *fixture;
static hal_udp_t hal;

/* Simulated. */

static sim_udp_t sim;

static bool open_sim(hal_udp_t *udp)
{
    sim_udp_init(&sim);
    *udp = sim_udp_hal(&sim);
    return true;
}

static void do_nothing(void) {}

static hal_udp_peer_t send_sim(const void *data, size_t length)
{
    const hal_udp_peer_t peer = {.address = {10, 1, 2, 3}, .port = 54321};
    (void)!sim_udp_push(&sim, data, length, &peer);
    return peer;
}

/* Linux: a socket of the backend, and a plain one that sends to it. */

static linux_udp_t lin;
static int sender = -1;

static hal_udp_peer_t peer_of(const struct sockaddr_storage *address)
{
    hal_udp_peer_t peer;
    memset(&peer, 0, sizeof peer);
    if (address->ss_family == AF_INET) {
        const struct sockaddr_in *v4 = (const struct sockaddr_in *)address;
        memcpy(peer.address, &v4->sin_addr, 4);
        peer.port = ntohs(v4->sin_port);
    } else {
        const struct sockaddr_in6 *v6 = (const struct sockaddr_in6 *)address;
        memcpy(peer.address, &v6->sin6_addr, 16);
        peer.port = ntohs(v6->sin6_port);
        peer.is_ipv6 = true;
    }
    return peer;
}

static bool open_linux(hal_udp_t *udp, const char *bind_to, int family)
{
    struct sockaddr_in v4 = {.sin_family = AF_INET};
    struct sockaddr_in6 v6 = {.sin6_family = AF_INET6, .sin6_addr = IN6ADDR_LOOPBACK_INIT};
    if (linux_udp_open(&lin, &(linux_udp_config_t){.bind = bind_to, .receive_buffer = 4096}) != HV_OK) {
        return false;
    }
    sender = socket(family, SOCK_DGRAM, 0);
    v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    v4.sin_port = htons(lin.port);
    v6.sin6_port = htons(lin.port);
    *udp = linux_udp_hal(&lin);
    return sender >= 0 && (family == AF_INET ? connect(sender, (struct sockaddr *)&v4, sizeof v4)
                                             : connect(sender, (struct sockaddr *)&v6, sizeof v6)) == 0;
}

static bool open_linux4(hal_udp_t *udp)
{
    return open_linux(udp, "127.0.0.1", AF_INET);
}

static bool open_linux6(hal_udp_t *udp)
{
    return open_linux(udp, "::1", AF_INET6);
}

static bool open_linux_both(hal_udp_t *udp)
{
    return open_linux(udp, "::", AF_INET);
}

static void close_linux(void)
{
    linux_udp_close(&lin);
    if (sender >= 0) {
        (void)close(sender);
        sender = -1;
    }
}

static hal_udp_peer_t send_linux(const void *data, size_t length)
{
    struct sockaddr_storage address;
    socklen_t size = sizeof address;
    TEST_ASSERT_EQUAL((ssize_t)length, send(sender, data, length, 0));
    TEST_ASSERT_EQUAL(0, getsockname(sender, (struct sockaddr *)&address, &size));
    return peer_of(&address);
}

static void wait_linux(void)
{
    struct pollfd readable = {.fd = lin.fd, .events = POLLIN};
    (void)poll(&readable, 1, 50);
}

static const fixture_t k_fixtures[] = {
    {"sim", open_sim, do_nothing, send_sim, do_nothing},
    {"linux_ipv4", open_linux4, close_linux, send_linux, wait_linux},
    {"linux_ipv6", open_linux6, close_linux, send_linux, wait_linux},
    {"linux_ipv4_on_ipv6", open_linux_both, close_linux, send_linux, wait_linux},
};

void setUp(void)
{
    if (!fixture->open(&hal)) {
        TEST_IGNORE_MESSAGE("not to be had on this machine");
    }
}

void tearDown(void)
{
    fixture->close();
}

/* recv that gives the network time; HV_ERR_AGAIN only where nothing came for a minute. */
static hv_status_t recv_patiently(uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    hv_status_t status = HV_ERR_AGAIN;
    for (int i = 0; i < 1200 && status == HV_ERR_AGAIN; i++) {
        fixture->wait();
        status = hal_udp_recv(hal, buffer, capacity, length, from);
    }
    return status;
}

static void assert_received(const void *data, size_t length, const hal_udp_peer_t *peer)
{
    uint8_t buffer[2048];
    size_t received = SIZE_MAX;
    hal_udp_peer_t from;
    memset(&from, 0xEE, sizeof from);
    TEST_ASSERT_EQUAL(HV_OK, recv_patiently(buffer, sizeof buffer, &received, &from));
    TEST_ASSERT_EQUAL_UINT64(length, received);
    TEST_ASSERT_TRUE(length == 0 || memcmp(data, buffer, length) == 0);
    TEST_ASSERT_EQUAL_UINT8_ARRAY(peer->address, from.address, 16);
    TEST_ASSERT_EQUAL_UINT16(peer->port, from.port);
    TEST_ASSERT_EQUAL(peer->is_ipv6, from.is_ipv6);
    TEST_ASSERT_EQUAL_UINT32(peer->scope_id, from.scope_id);
}

static void assert_none_waiting(void)
{
    uint8_t byte;
    size_t length;
    hal_udp_peer_t from;
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_udp_recv(hal, &byte, 1, &length, &from));
}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(hal_udp_valid(hal));
}

static void test_valid_recv_missing_refuses(void)
{
    hal_udp_ops_t ops = *hal.ops;
    ops.recv = NULL;
    TEST_ASSERT_FALSE(hal_udp_valid((hal_udp_t){&ops, hal.ctx}));
    TEST_ASSERT_FALSE(hal_udp_valid((hal_udp_t){NULL, NULL}));
}

static void test_dropped_absent_says_nosup(void)
{
    hal_udp_ops_t ops = *hal.ops;
    uint32_t dropped = 77;
    ops.dropped = NULL;
    TEST_ASSERT_TRUE(hal_udp_valid((hal_udp_t){&ops, hal.ctx}));
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, hal_udp_dropped((hal_udp_t){&ops, hal.ctx}, &dropped));
    TEST_ASSERT_EQUAL_UINT32(77, dropped);
}

static void test_waited_absent_says_nosup(void)
{
    hal_udp_ops_t ops = *hal.ops;
    uint32_t waited_us = 77;
    ops.waited = NULL;
    TEST_ASSERT_TRUE(hal_udp_valid((hal_udp_t){&ops, hal.ctx}));
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, hal_udp_waited((hal_udp_t){&ops, hal.ctx}, &waited_us));
    TEST_ASSERT_EQUAL_UINT32(77, waited_us);
}

static void test_recv_nothing_waiting_says_again_and_keeps_outputs(void)
{
    uint8_t buffer[4] = {1, 2, 3, 4};
    const uint8_t before[4] = {1, 2, 3, 4};
    size_t length = 99;
    hal_udp_peer_t from = {.port = 1234};
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_udp_recv(hal, buffer, sizeof buffer, &length, &from));
    TEST_ASSERT_EQUAL_UINT8_ARRAY(before, buffer, 4);
    TEST_ASSERT_EQUAL_UINT64(99, length);
    TEST_ASSERT_EQUAL_UINT16(1234, from.port);
}

static void test_recv_datagram_brings_bytes_and_sender(void)
{
    const char *frame = "@A6:5,6,0,5.5,3.0,20,F0#";
    const hal_udp_peer_t peer = fixture->send(frame, strlen(frame));
    assert_received(frame, strlen(frame), &peer);
    assert_none_waiting();
}

static void test_recv_every_byte_value_passes(void)
{
    uint8_t data[256];
    for (unsigned i = 0; i < sizeof data; i++) {
        data[i] = (uint8_t)i;
    }
    const hal_udp_peer_t peer = fixture->send(data, sizeof data);
    assert_received(data, sizeof data, &peer);
}

static void test_recv_several_keeps_order_and_borders(void)
{
    char text[4][16];
    hal_udp_peer_t peer = {.port = 0};
    for (int i = 0; i < 4; i++) {
        (void)snprintf(text[i], sizeof text[i], "%.*s", i * 3, "abcdefghijklmnop");
        peer = fixture->send(text[i], strlen(text[i]));
    }
    for (int i = 0; i < 4; i++) {
        assert_received(text[i], strlen(text[i]), &peer);
    }
    assert_none_waiting();
}

static void test_recv_empty_datagram_is_ok_with_length_zero(void)
{
    const hal_udp_peer_t peer = fixture->send("", 0);
    assert_received("", 0, &peer);
    assert_none_waiting();
}

static void test_recv_exactly_capacity_fits(void)
{
    uint8_t buffer[8];
    size_t length = 0;
    hal_udp_peer_t from;
    (void)fixture->send("12345678", 8);
    TEST_ASSERT_EQUAL(HV_OK, recv_patiently(buffer, 8, &length, &from));
    TEST_ASSERT_EQUAL_UINT64(8, length);
    TEST_ASSERT_EQUAL_MEMORY("12345678", buffer, 8);
}

static void test_recv_longer_than_capacity_is_dropped_whole_and_told(void)
{
    uint8_t buffer[16];
    for (size_t capacity = 0; capacity < 9; capacity++) {
        size_t length = 0;
        hal_udp_peer_t from;
        memset(buffer, 0xCC, sizeof buffer);
        (void)fixture->send("123456789", 9);
        const hal_udp_peer_t peer = fixture->send("next", 4);
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, recv_patiently(buffer, capacity, &length, &from));
        TEST_ASSERT_EQUAL_UINT64(9, length);
        TEST_ASSERT_EQUAL_UINT16(peer.port, from.port);
        for (size_t i = capacity; i < sizeof buffer; i++) {
            TEST_ASSERT_EQUAL_HEX8(0xCC, buffer[i]);
        }
        assert_received("next", 4, &peer);
    }
}

/* Numbers in order, until there is none at the moment; counts them, and keeps the last one. */
static uint32_t receive_numbers(uint32_t *last)
{
    uint32_t count = 0, number;
    size_t length;
    hal_udp_peer_t from;
    fixture->wait();
    while (hal_udp_recv(hal, (uint8_t *)&number, sizeof number, &length, &from) == HV_OK) {
        TEST_ASSERT_TRUE(number > *last);
        *last = number;
        count++;
    }
    return count;
}

/* However many are lost, each is either received or counted, those received are in order, and the queue works on afterwards:
 * one more comes through once a busy kernel has brought all that was on its way. */
static void test_dropped_queue_overrun_accounts_for_every_datagram(void)
{
    uint32_t sent = 0, received = 0, dropped = 0, last = 0;
    if (hal_udp_dropped(hal, &dropped) == HV_ERR_NOSUP) {
        TEST_IGNORE_MESSAGE("this backend does not count");
    }
    TEST_ASSERT_EQUAL_UINT32(0, dropped);
    while (sent < 500) {
        sent++;
        (void)fixture->send(&sent, sizeof sent);
    }
    received += receive_numbers(&last);
    for (int i = 0; i < 1200 && (last != sent || sent == 500); i++) {
        sent++;
        (void)fixture->send(&sent, sizeof sent);
        received += receive_numbers(&last);
    }
    TEST_ASSERT_EQUAL_UINT32(sent, last);
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_dropped(hal, &dropped));
    TEST_ASSERT_TRUE(dropped > 0);
    TEST_ASSERT_EQUAL_UINT32(sent, received + dropped);
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_recv_missing_refuses);
    RUN_TEST(test_dropped_absent_says_nosup);
    RUN_TEST(test_waited_absent_says_nosup);
    RUN_TEST(test_recv_nothing_waiting_says_again_and_keeps_outputs);
    RUN_TEST(test_recv_datagram_brings_bytes_and_sender);
    RUN_TEST(test_recv_every_byte_value_passes);
    RUN_TEST(test_recv_several_keeps_order_and_borders);
    RUN_TEST(test_recv_empty_datagram_is_ok_with_length_zero);
    RUN_TEST(test_recv_exactly_capacity_fits);
    RUN_TEST(test_recv_longer_than_capacity_is_dropped_whole_and_told);
    RUN_TEST(test_dropped_queue_overrun_accounts_for_every_datagram);
}

/* An error of recv loses no datagram, wherever it comes. */
static void test_sim_recv_failing_at_every_step_loses_nothing(void)
{
    for (uint32_t first = 1; first <= 10; first++) {
        uint32_t next = 1;
        uint8_t byte = 0;
        size_t length;
        hal_udp_peer_t from;
        TEST_ASSERT_TRUE(open_sim(&hal));
        sim.fail = (sim_fail_t){.first = first, .count = 2};
        for (uint8_t i = 1; i <= 8; i++) {
            (void)send_sim(&i, 1);
        }
        for (uint32_t call = 1; call <= 10; call++) {
            const hv_status_t status = hal_udp_recv(hal, &byte, 1, &length, &from);
            TEST_ASSERT_EQUAL(call >= first && call < first + 2 ? HV_ERR_IO : next <= 8 ? HV_OK : HV_ERR_AGAIN, status);
            if (status == HV_OK) {
                TEST_ASSERT_EQUAL_UINT32(next++, byte);
            }
        }
        TEST_ASSERT_TRUE(next == 9 || first > 8);
    }
}

static void test_sim_push_too_long_is_refused(void)
{
    static const uint8_t data[SIM_UDP_BYTES_MAX + 1];
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, sim_udp_push(&sim, data, sizeof data, NULL));
    TEST_ASSERT_EQUAL(HV_OK, sim_udp_push(&sim, data, sizeof data - 1, NULL));
}

/* Opening a socket. */

static void test_linux_open_port_in_use_says_so(void)
{
    linux_udp_t second;
    char where[64];
    (void)snprintf(where, sizeof where, "bind 127.0.0.1 port %u", (unsigned)lin.port);
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_udp_open(&second, &(linux_udp_config_t){.bind = "127.0.0.1", .port = lin.port}));
    TEST_ASSERT_EQUAL(EADDRINUSE, second.error);
    TEST_ASSERT_NOT_NULL(strstr(second.error_text, where));
    TEST_ASSERT_NOT_NULL(strstr(second.error_text, strerror(EADDRINUSE)));
    TEST_ASSERT_EQUAL(-1, second.fd);
    linux_udp_close(&second);
}

static void test_linux_open_foreign_address_says_so(void)
{
    linux_udp_t other;
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_udp_open(&other, &(linux_udp_config_t){.bind = "192.0.2.1"}));
    TEST_ASSERT_EQUAL(EADDRNOTAVAIL, other.error);
    TEST_ASSERT_NOT_NULL(strstr(other.error_text, "192.0.2.1"));
}

static void test_linux_open_not_an_address_is_refused(void)
{
    static const char *const k_wrong[] = {"", "localhost", "1.2.3.4.5", "300.1.1.1", "::1::", "fe80::1%nonesuch0"};
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        linux_udp_t other;
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_ARG, linux_udp_open(&other, &(linux_udp_config_t){.bind = k_wrong[i]}), k_wrong[i]);
        TEST_ASSERT_TRUE(other.error < 0);
        TEST_ASSERT_NOT_NULL(strstr(other.error_text, "not a numeric address"));
    }
}

static void test_linux_open_receive_buffer_is_bounded(void)
{
    linux_udp_t other;
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_open(&other, &(linux_udp_config_t){.bind = "127.0.0.1", .receive_buffer = 4096}));
    TEST_ASSERT_TRUE(other.receive_buffer >= 4096 && other.receive_buffer <= 16384);
    TEST_ASSERT_EQUAL_STRING("", other.error_text);
    linux_udp_close(&other);
}

/* Sends one datagram to a group on the loopback interface. */
static void send_to_group(const char *group, uint16_t port)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(port)};
    const struct ip_mreqn on = {.imr_ifindex = (int)if_nametoindex("lo")};
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    TEST_ASSERT_EQUAL_INT(1, inet_pton(AF_INET, group, &to.sin_addr));
    TEST_ASSERT_EQUAL_INT(0, setsockopt(fd, IPPROTO_IP, IP_MULTICAST_IF, &on, sizeof on));
    TEST_ASSERT_EQUAL_INT(3, sendto(fd, "abc", 3, 0, (struct sockaddr *)&to, sizeof to));
    (void)close(fd);
}

static unsigned heard(linux_udp_t *socket)
{
    uint8_t bytes[16];
    size_t length;
    hal_udp_peer_t from;
    unsigned count = 0;
    struct pollfd readable = {.fd = socket->fd, .events = POLLIN};
    (void)poll(&readable, 1, 50);
    while (hal_udp_recv(linux_udp_hal(socket), bytes, sizeof bytes, &length, &from) == HV_OK) {
        count++;
    }
    return count;
}

/* The group that was asked for, and none that another program has joined. */
static void test_linux_group_is_heard_alone(void)
{
    static const char *const k_binds[] = {"0.0.0.0", "::"};
    for (size_t i = 0; i < sizeof k_binds / sizeof k_binds[0]; i++) {
        linux_udp_t member, other, plain;
        TEST_ASSERT_EQUAL(HV_OK, linux_udp_open(&member, &(linux_udp_config_t){.bind = k_binds[i], .group = "239.77.1.2%lo"}));
        TEST_ASSERT_EQUAL(HV_OK, linux_udp_open(&other, &(linux_udp_config_t){.bind = k_binds[i], .group = "239.77.1.3%lo"}));
        TEST_ASSERT_EQUAL(HV_OK, linux_udp_open(&plain, &(linux_udp_config_t){.bind = k_binds[i], .group = ""}));
        send_to_group("239.77.1.2", member.port);
        TEST_ASSERT_EQUAL_UINT(1, heard(&member));
        send_to_group("239.77.1.3", member.port);
        TEST_ASSERT_EQUAL_UINT(0, heard(&member));
        send_to_group("239.77.1.2", plain.port);
        TEST_ASSERT_EQUAL_UINT(0, heard(&plain));
        linux_udp_close(&member);
        linux_udp_close(&other);
        linux_udp_close(&plain);
    }
}

static void test_linux_group_that_cannot_be_joined_says_why(void)
{
    static const struct {
        const char *bind, *group, *text;
        hv_status_t status;
    } k_rows[] = {
        {"0.0.0.0", "239.1.2.3%nonesuch0", "udp: group 239.1.2.3%nonesuch0: this machine has no network interface \"nonesuch0\"",
         HV_ERR_IO},
        {"0.0.0.0", "239.1.2.3", "this machine has no network interface \"\"", HV_ERR_IO},
        {"0.0.0.0", "localhost%lo", "udp: group localhost%lo: not a numeric address", HV_ERR_ARG},
        {"0.0.0.0", "127.0.0.1%lo", "udp: join group 127.0.0.1%lo: ", HV_ERR_IO},
        {"0.0.0.0", "ff15::7%lo", "udp: join group ff15::7%lo: ", HV_ERR_IO},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        linux_udp_t socket;
        const linux_udp_config_t config = {.bind = k_rows[i].bind, .group = k_rows[i].group};
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].status, linux_udp_open(&socket, &config), k_rows[i].text);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(socket.error_text, k_rows[i].text), socket.error_text);
        TEST_ASSERT_NOT_EQUAL(0, socket.error);
        TEST_ASSERT_EQUAL(-1, socket.fd);
    }
}

static void test_linux_close_twice_and_recv_after_it_do_no_harm(void)
{
    uint8_t byte;
    size_t length;
    hal_udp_peer_t from;
    linux_udp_close(&lin);
    linux_udp_close(&lin);
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_udp_recv(hal, &byte, 1, &length, &from));
    TEST_ASSERT_EQUAL(EBADF, lin.error);
}

/* How long a datagram waited that was left for 20 ms. */
static uint32_t waited_of_20_ms(void)
{
    uint32_t waited_us = 0;
    const hal_udp_peer_t peer = send_linux("@", 1);
    struct pollfd arrival = {.fd = lin.fd, .events = POLLIN};
    TEST_ASSERT_EQUAL_INT(1, poll(&arrival, 1, 60000)); /* a busy kernel takes its time from one socket to the other */
    (void)usleep(20000);
    assert_received("@", 1, &peer);
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_waited(hal, &waited_us));
    return waited_us;
}

/* At least as long as it was left there: how much longer is the machine's business. */
static void test_waited_is_since_the_arrival(void)
{
    unsigned tries = 0;
    while (waited_of_20_ms() < 19000) { /* the kernel begins to take the time of arrivals some time after it was asked to */
        TEST_ASSERT_TRUE(++tries < 200);
    }
    TEST_ASSERT_TRUE(waited_of_20_ms() >= 19000);
}

/* Filters. */

static const linux_udp_form_t k_first[] = {{{LINUX_UDP_SET("@ \0")}}};

static linux_udp_filter_t filter_of(const hal_udp_network_t *networks, uint8_t count)
{
    linux_udp_filter_t filter = {.forms = k_first, .form_count = 1, .bytes_max = 100, .allow = {.count = count}};
    for (unsigned i = 0; i < count; i++) {
        filter.allow.network[i] = networks[i];
    }
    return filter;
}

/* Sends it, and then what shows that it would have come. */
static void assert_comes(const void *data, size_t length, bool does_come)
{
    uint32_t before, after;
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_dropped(hal, &before));
    const hal_udp_peer_t peer = send_linux(data, length);
    if (does_come) {
        assert_received(data, length, &peer);
    }
    (void)send_linux("@", 1);
    assert_received("@", 1, &peer);
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_dropped(hal, &after));
    TEST_ASSERT_EQUAL_UINT32(does_come ? 0 : 1, after - before);
}

static void test_filter_head_byte_decides(void)
{
    const linux_udp_filter_t filter = filter_of(NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &filter));
    for (unsigned byte = 0; byte < 256; byte++) {
        const uint8_t data[2] = {(uint8_t)byte, '@'};
        assert_comes(data, sizeof data, byte == '@' || byte == ' ' || byte == 0);
    }
    assert_comes("", 0, false);
    linux_udp_filter_off(&lin);
    linux_udp_filter_off(&lin);
    assert_comes("x", 1, true);
    assert_comes("", 0, true);
}

/* Every byte at every place of two forms, the others right. */
static void test_filter_each_place_decides(void)
{
    static const linux_udp_form_t k_forms[] = {
        {{LINUX_UDP_SET("@#"), LINUX_UDP_SET("AC"), LINUX_UDP_SET("12345678"), LINUX_UDP_SET(":")}},
        {{LINUX_UDP_SET(" "), LINUX_UDP_SET("A")}}};
    linux_udp_filter_t filter = filter_of(NULL, 0);
    filter.forms = k_forms;
    filter.form_count = 2;
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &filter));
    for (unsigned place = 0; place < 4; place++) {
        for (unsigned byte = 0; byte < 256; byte++) {
            char data[6] = "#C8:zz";
            const linux_udp_set_t *set = &k_forms[0].place[place];
            data[place] = (char)byte;
            const hal_udp_peer_t peer = send_linux(data, sizeof data);
            if (memchr(set->bytes, (int)byte, set->count) != NULL) {
                assert_received(data, sizeof data, &peer);
            }
            (void)send_linux(" A", 2);
            assert_received(" A", 2, &peer);
        }
    }
    (void)send_linux("@A3", 3); /* ends before the form does */
    (void)send_linux(" B3:", 4);
    const hal_udp_peer_t peer = send_linux("@A3:", 4);
    assert_received("@A3:", 4, &peer);
    assert_none_waiting();
}

static void test_filter_length_decides(void)
{
    static const uint8_t k_data[1400] = {'@'};
    const linux_udp_filter_t filter = filter_of(NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &filter));
    assert_comes(k_data, 99, true);
    assert_comes(k_data, 100, true);
    assert_comes(k_data, 101, false);
    assert_comes(k_data, sizeof k_data, false);
    linux_udp_filter_t least = filter;
    least.bytes_min = 2;
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &least));
    (void)send_linux("@", 1);
    const hal_udp_peer_t peer = send_linux("@x", 2);
    assert_received("@x", 2, &peer);
}

/* So many are dropped from now on, and nothing comes through; known although nothing does. */
static void assert_dropped(uint32_t before, uint32_t count)
{
    uint32_t dropped = before;
    for (unsigned i = 0; i < 1200 && dropped - before < count; i++) {
        if (i > 0) {
            wait_linux();
        }
        TEST_ASSERT_EQUAL(HV_OK, hal_udp_dropped(hal, &dropped));
    }
    TEST_ASSERT_EQUAL_UINT32(count, dropped - before);
    assert_none_waiting();
}

static void test_filter_drops_are_counted_at_once(void)
{
    const linux_udp_filter_t filter = filter_of(NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &filter));
    for (unsigned i = 0; i < 7; i++) {
        (void)send_linux("junk", 4);
    }
    assert_dropped(0, 7);
}

/* The sender's own network of every length, alone, behind others, and with each of its bits wrong. */
static void test_filter_networks_decide(void)
{
    const hal_udp_peer_t me = send_linux("@", 1);
    const unsigned bits = me.is_ipv6 ? 128 : 32;
    assert_received("@", 1, &me);
    for (unsigned prefix = 0; prefix <= bits; prefix++) {
        hal_udp_network_t list[HAL_UDP_NETWORKS_MAX];
        for (unsigned i = 0; i < HAL_UDP_NETWORKS_MAX - 1u; i++) { /* nobody's, of both families */
            list[i] = (hal_udp_network_t){.is_ipv6 = i % 2 != 0, .prefix = (uint8_t)(8u + i), .address = {0xFE, 0x77}};
        }
        hal_udp_network_t *mine = &list[HAL_UDP_NETWORKS_MAX - 1u];
        *mine = (hal_udp_network_t){.is_ipv6 = me.is_ipv6, .prefix = (uint8_t)prefix};
        memcpy(mine->address, me.address, sizeof me.address);
        if (prefix < bits) { /* a bit that does not count */
            mine->address[prefix / 8] ^= (uint8_t)(0x80u >> prefix % 8);
        }
        linux_udp_filter_t filter = filter_of(list, HAL_UDP_NETWORKS_MAX);
        TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &filter));
        assert_comes("@x", 2, true);
        assert_comes("x", 1, false);
        if (prefix > 0) { /* the last bit that counts: nobody comes through */
            uint32_t before;
            mine->address[(prefix - 1) / 8] ^= (uint8_t)(0x80u >> (prefix - 1) % 8);
            filter = filter_of(list, HAL_UDP_NETWORKS_MAX);
            TEST_ASSERT_EQUAL(HV_OK, hal_udp_dropped(hal, &before));
            TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &filter));
            (void)send_linux("@", 1);
            assert_dropped(before, 1);
        }
    }
}

static void test_filter_other_family_does_not_come(void)
{
    const hal_udp_peer_t me = send_linux("@", 1);
    assert_received("@", 1, &me);
    const hal_udp_network_t list[] = {{.is_ipv6 = !me.is_ipv6, .prefix = 0}};
    const linux_udp_filter_t filter = filter_of(list, 1);
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, &filter));
    (void)send_linux("@", 1);
    assert_dropped(0, 1);
}

/* Of so many datagrams: how many come through. */
static unsigned count_coming(const linux_udp_filter_t *filter, unsigned count)
{
    uint8_t byte;
    size_t length;
    hal_udp_peer_t from;
    uint32_t before, dropped;
    unsigned come = 0;
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_dropped(hal, &before));
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_filter_on(&lin, filter));
    for (unsigned i = 0; i < count; i++) {
        (void)send_linux("@", 1);
        dropped = before;
        for (unsigned k = 0; k < 1200 && come + (dropped - before) < i + 1; k++) { /* it has come, or it is lost */
            come += hal_udp_recv(hal, &byte, 1, &length, &from) == HV_OK;
            TEST_ASSERT_EQUAL(HV_OK, hal_udp_dropped(hal, &dropped));
            if (k > 0) {
                wait_linux();
            }
        }
    }
    TEST_ASSERT_EQUAL_UINT32(count, come + (dropped - before));
    return come;
}

/* One sender comes through whole, by address and port or by its address; of all others one datagram in so many. */
static void test_filter_first_sender_comes_whole_and_others_by_their_share(void)
{
    const hal_udp_peer_t me = send_linux("@", 1);
    assert_received("@", 1, &me);
    linux_udp_filter_t filter = filter_of(NULL, 0);
    filter.first = me;
    filter.others_one_of = UINT32_MAX; /* as good as none */
    TEST_ASSERT_EQUAL_UINT(20, count_coming(&filter, 20));
    filter.first.port ^= 1u;
    TEST_ASSERT_EQUAL_UINT(0, count_coming(&filter, 20));
    filter.is_first_any_port = true;
    TEST_ASSERT_EQUAL_UINT(20, count_coming(&filter, 20));
    for (unsigned bit = 0; bit < (me.is_ipv6 ? 128u : 32u); bit++) {
        filter.first = me;
        filter.first.address[bit / 8] ^= (uint8_t)(0x80u >> bit % 8);
        TEST_ASSERT_EQUAL_UINT(0, count_coming(&filter, 1));
    }
    filter.first = me;
    filter.first.is_ipv6 = !me.is_ipv6;
    TEST_ASSERT_EQUAL_UINT(0, count_coming(&filter, 20));
    filter.others_one_of = 8;
    TEST_ASSERT_UINT_WITHIN(120, 250, count_coming(&filter, 2000)); /* eight times its standard deviation */
    filter.others_one_of = 1;
    TEST_ASSERT_EQUAL_UINT(20, count_coming(&filter, 20));
    const hal_udp_network_t nobody = {.is_ipv6 = me.is_ipv6, .prefix = 8, .address = {0xFE}}; /* a share is no permission */
    filter = filter_of(&nobody, 1);
    filter.others_one_of = 1;
    TEST_ASSERT_EQUAL_UINT(0, count_coming(&filter, 20));
}

static void test_filter_what_is_out_of_range_is_refused(void)
{
    const hal_udp_network_t too_long = {.prefix = 33};
    linux_udp_filter_t filter = filter_of(&too_long, 1);
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_udp_filter_on(&lin, &filter));
    filter = filter_of(NULL, 0);
    filter.form_count = 0;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_udp_filter_on(&lin, &filter));
    filter.form_count = LINUX_UDP_FORMS_MAX + 1u;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_udp_filter_on(&lin, &filter));
    static const linux_udp_form_t k_empty = {{{NULL, 0}}}, k_many = {{{"@@@@@@@@@", LINUX_UDP_SET_MAX + 1u}}};
    filter = filter_of(NULL, 0);
    filter.forms = &k_empty;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_udp_filter_on(&lin, &filter));
    filter.forms = &k_many;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_udp_filter_on(&lin, &filter));
    filter = filter_of(NULL, 0);
    filter.bytes_min = filter.bytes_max + 1u;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_udp_filter_on(&lin, &filter));
    filter = filter_of(NULL, 0);
    filter.allow.count = HAL_UDP_NETWORKS_MAX + 1u;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_udp_filter_on(&lin, &filter));
    linux_udp_close(&lin);
    filter = filter_of(NULL, 0);
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_udp_filter_on(&lin, &filter));
}

/* On sockets of both families. */
static void run_sockets(void)
{
    RUN_TEST(test_waited_is_since_the_arrival);
    RUN_TEST(test_filter_head_byte_decides);
    RUN_TEST(test_filter_each_place_decides);
    RUN_TEST(test_filter_length_decides);
    RUN_TEST(test_filter_drops_are_counted_at_once);
    RUN_TEST(test_filter_networks_decide);
    RUN_TEST(test_filter_other_family_does_not_come);
    RUN_TEST(test_filter_first_sender_comes_whole_and_others_by_their_share);
    RUN_TEST(test_filter_what_is_out_of_range_is_refused);
}

static void run_sim(void)
{
    RUN_TEST(test_sim_recv_failing_at_every_step_loses_nothing);
    RUN_TEST(test_sim_push_too_long_is_refused);
}

static void run_linux(void)
{
    RUN_TEST(test_linux_open_port_in_use_says_so);
    RUN_TEST(test_linux_open_foreign_address_says_so);
    RUN_TEST(test_linux_open_not_an_address_is_refused);
    RUN_TEST(test_linux_open_receive_buffer_is_bounded);
    RUN_TEST(test_linux_group_is_heard_alone);
    RUN_TEST(test_linux_group_that_cannot_be_joined_says_why);
    RUN_TEST(test_linux_close_twice_and_recv_after_it_do_no_harm);
}

/* Datagrams that one processor sends arrive in their order: a busy kernel leaves them in a queue of each processor's own. */
static void stay_on_this_processor(void)
{
    cpu_set_t here;
    CPU_ZERO(&here);
    CPU_SET((size_t)sched_getcpu(), &here);
    (void)sched_setaffinity(0, sizeof here, &here);
}

int main(void)
{
    UNITY_BEGIN();
    stay_on_this_processor();
    for (size_t i = 0; i < sizeof k_fixtures / sizeof k_fixtures[0]; i++) {
        fixture = &k_fixtures[i];
        contract_backend = fixture->name;
        run_contract();
    }
    fixture = &k_fixtures[0];
    contract_backend = fixture->name;
    run_sim();
    fixture = &k_fixtures[1];
    contract_backend = fixture->name;
    run_linux();
    for (size_t i = 1; i < sizeof k_fixtures / sizeof k_fixtures[0]; i++) {
        fixture = &k_fixtures[i];
        contract_backend = fixture->name;
        run_sockets();
    }
    return UNITY_END();
}

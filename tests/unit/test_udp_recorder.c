/* SPDX-License-Identifier: MIT
 * test_udp_recorder.c - when datagrams came, as a recording tells it and as the gateway hears it.
 */
#include <string.h>

#include "record/record.h"
#include "record/udp_recorder.h"
#include "unity.h"

#define CYCLE_US 1000u

static bool m_is_empty;
static uint32_t m_waited_us;
static uint64_t m_now_us;
static uint8_t m_bytes[8192];
static ring_t m_ring;
static udp_recorder_t m_tap;

static hv_status_t behind_recv(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    (void)ctx;
    (void)capacity;
    if (m_is_empty) {
        return HV_ERR_AGAIN;
    }
    buffer[0] = 'x';
    *length = 1;
    *from = (hal_udp_peer_t){.port = 9};
    return HV_OK;
}

static hv_status_t behind_waited(void *ctx, uint32_t *us)
{
    (void)ctx;
    *us = m_waited_us;
    return HV_OK;
}

static uint64_t clock_now_us(void *ctx)
{
    (void)ctx;
    return m_now_us;
}

void setUp(void)
{
    static const hal_udp_ops_t k_udp = {.recv = behind_recv, .waited = behind_waited};
    static const hal_clock_ops_t k_clock = {.now_us = clock_now_us};
    static const hal_udp_networks_t k_everyone = {0};
    ring_init(&m_ring, m_bytes, sizeof m_bytes);
    m_now_us = 5000;
    m_tap = (udp_recorder_t){.behind = {&k_udp, NULL},
                             .allow = &k_everyone,
                             .record = {&m_ring, NULL},
                             .now_us = &m_now_us,
                             .clock = {&k_clock, NULL},
                             .cycle_us = CYCLE_US};
}

void tearDown(void) {}

/* Takes one that has waited so long; checks that recording and gateway agree. Returns when it came. */
static uint64_t take(uint32_t waited_us)
{
    uint8_t buffer[16];
    size_t length = 0;
    hal_udp_peer_t from;
    record_t record;
    uint32_t told_us = 0;
    m_waited_us = waited_us;
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_recv(udp_recorder_hal(&m_tap), buffer, sizeof buffer, &length, &from));
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_waited(udp_recorder_hal(&m_tap), &told_us));
    TEST_ASSERT_GREATER_THAN(0, ring_pop(&m_ring, &record, sizeof record));
    TEST_ASSERT_EQUAL_UINT64(m_now_us - told_us, record.head.t_us);
    return record.head.t_us;
}

static void test_tap_tells_when_a_datagram_came(void)
{
    TEST_ASSERT_EQUAL_UINT64(4300, take(700));
    TEST_ASSERT_EQUAL_UINT64(5000, take(0));
}

static void test_tap_what_waited_for_longer_than_a_cycle_came_in_this_one(void)
{
    TEST_ASSERT_EQUAL_UINT64(4001, take(1000));
    m_now_us += CYCLE_US;
    TEST_ASSERT_EQUAL_UINT64(5001, take(300000));
}

static void test_tap_read_late_is_not_before_the_one_before(void)
{
    TEST_ASSERT_EQUAL_UINT64(4900, take(100));
    TEST_ASSERT_EQUAL_UINT64(4900, take(4000)); /* the machine did something else between the two */
    TEST_ASSERT_EQUAL_UINT64(4950, take(50));
    m_now_us += CYCLE_US;
    TEST_ASSERT_EQUAL_UINT64(5200, take(800));
}

/* What the tap makes of one that has waited so long, in a cycle that is so late. */
static hv_status_t what_becomes(uint32_t waited_us, uint64_t late_us)
{
    uint8_t buffer[16];
    size_t length = 0;
    hal_udp_peer_t from;
    m_waited_us = waited_us;
    m_tap.late_us = late_us;
    return hal_udp_recv(udp_recorder_hal(&m_tap), buffer, sizeof buffer, &length, &from);
}

static void test_tap_lets_nothing_old_through(void)
{
    TEST_ASSERT_EQUAL(HV_OK, what_becomes(0, UDP_RECORDER_FRESH_US));
    TEST_ASSERT_EQUAL(HV_OK, what_becomes(UDP_RECORDER_FRESH_US, 30000000));
    TEST_ASSERT_EQUAL_UINT32(0, m_tap.stale);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, what_becomes(UDP_RECORDER_FRESH_US + 1, 0)); /* the backend never runs dry: a cycle's share */
    const uint32_t share = m_tap.stale;
    TEST_ASSERT_GREATER_THAN(0, share);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, what_becomes(0, UDP_RECORDER_FRESH_US + 1)); /* nobody knows: the time of day was set */
    TEST_ASSERT_EQUAL_UINT32(2 * share, m_tap.stale);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, what_becomes(0, 0)); /* nor of the rest of that queue, in the next cycle */
    TEST_ASSERT_EQUAL_UINT32(3 * share, m_tap.stale);
    TEST_ASSERT_EQUAL(HV_OK, what_becomes(5, 0));
    m_is_empty = true;
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, what_becomes(0, 0));
    m_is_empty = false;
    TEST_ASSERT_EQUAL(HV_OK, what_becomes(0, 0));
    TEST_ASSERT_EQUAL_UINT32(0, m_tap.refused);
}

static void test_tap_writes_nothing_old_down(void)
{
    record_t record;
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, what_becomes(5000000, 0));
    TEST_ASSERT_EQUAL(0, ring_pop(&m_ring, &record, sizeof record));
    TEST_ASSERT_EQUAL_UINT64(0, m_tap.arrival_us);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tap_lets_nothing_old_through);
    RUN_TEST(test_tap_writes_nothing_old_down);
    RUN_TEST(test_tap_tells_when_a_datagram_came);
    RUN_TEST(test_tap_what_waited_for_longer_than_a_cycle_came_in_this_one);
    RUN_TEST(test_tap_read_late_is_not_before_the_one_before);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_flood.c - when a flood begins and ends, in made-up time.
 */
#include "daemon/flood.h"

#include "unity.h"

#define TICK_US 10000u

static flood_t m_flood;
static uint64_t m_now_us;
static uint32_t m_useless;

void setUp(void)
{
    m_flood = (flood_t){.is_on = false};
    m_now_us = 1000000;
    m_useless = UINT32_MAX - 700u; /* the count wraps within every test */
    TEST_ASSERT_FALSE(flood_judge(&m_flood, m_useless, m_now_us));
}

void tearDown(void) {}

/* So many a second for so long; returns how often it changed. */
static unsigned run(uint32_t per_s, uint32_t ms)
{
    unsigned changes = 0;
    for (uint32_t i = 0; i < ms / 10u; i++) {
        m_now_us += TICK_US;
        m_useless += per_s / 100u;
        changes += flood_judge(&m_flood, m_useless, m_now_us);
    }
    return changes;
}

static void test_flood_wrong_frames_of_some_senders_are_none(void)
{
    TEST_ASSERT_EQUAL_UINT32(0, run(FLOOD_BEGIN_PER_S - 100u, 20000));
    TEST_ASSERT_FALSE(m_flood.is_on);
}

static void test_flood_begins_within_a_window(void)
{
    TEST_ASSERT_EQUAL_UINT32(0, run(100, 1000));
    TEST_ASSERT_EQUAL_UINT32(1, run(2u * FLOOD_BEGIN_PER_S, 2u * FLOOD_WINDOW_US / 1000u));
    TEST_ASSERT_TRUE(m_flood.is_on);
}

/* A burst that was waiting while nobody looked is spread over that time. */
static void test_flood_late_look_counts_by_rate(void)
{
    m_now_us += 2000000;
    TEST_ASSERT_FALSE(flood_judge(&m_flood, m_useless + FLOOD_BEGIN_PER_S, m_now_us));
    TEST_ASSERT_FALSE(m_flood.is_on);
}

static void test_flood_ends_once_it_has_been_calm_for_long_enough(void)
{
    (void)run(100000, 300);
    TEST_ASSERT_TRUE(m_flood.is_on);
    TEST_ASSERT_EQUAL_UINT32(0, run(FLOOD_END_PER_S, 60000)); /* less than it began with, but not calm */
    TEST_ASSERT_EQUAL_UINT32(0, run(0, 4900));
    TEST_ASSERT_EQUAL_UINT32(0, run(FLOOD_END_PER_S, 100)); /* once more: it has to be calm anew */
    TEST_ASSERT_EQUAL_UINT32(0, run(0, 4800));
    TEST_ASSERT_TRUE(m_flood.is_on);
    TEST_ASSERT_EQUAL_UINT32(1, run(0, 300));
    TEST_ASSERT_FALSE(m_flood.is_on);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_flood_wrong_frames_of_some_senders_are_none);
    RUN_TEST(test_flood_begins_within_a_window);
    RUN_TEST(test_flood_late_look_counts_by_rate);
    RUN_TEST(test_flood_ends_once_it_has_been_calm_for_long_enough);
    return UNITY_END();
}

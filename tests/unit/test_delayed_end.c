/* SPDX-License-Identifier: MIT
 * test_delayed_end.c - holds after the signal that ends heaved: each delays it, none for ever.
 */
#include "daemon/delayed_end.h"

#include "unity.h"

#define CYCLE_US 2000u
#define CYCLES_S (1000000u / CYCLE_US)

static delayed_end_t m_end;
static uint64_t m_now_us;

static bool step(bool is_due, bool is_held)
{
    m_now_us += CYCLE_US;
    return delayed_end_step(&m_end, is_due, is_held, m_now_us);
}

void setUp(void)
{
    m_end = (delayed_end_t){0};
    m_now_us = 123456789;
    TEST_ASSERT_FALSE(step(false, false));
}

void tearDown(void) {}

/* Cycles until it goes on, with a hold in each of so many; most: not within that. */
static unsigned cycles_until_on(unsigned hold_every, unsigned most)
{
    for (unsigned i = 1; i < most; i++) {
        if (i % hold_every == 0 && !delayed_end_hold(&m_end)) {
            return i;
        }
        if (step(false, true)) {
            return i;
        }
        TEST_ASSERT_TRUE(delayed_end_is_held(&m_end));
    }
    return most;
}

static void test_a_hold_without_an_end_is_none_of_its(void)
{
    for (unsigned i = 0; i < 1000 * CYCLES_S; i++) {
        TEST_ASSERT_FALSE(step(false, true));
        TEST_ASSERT_FALSE(delayed_end_is_held(&m_end));
    }
    TEST_ASSERT_TRUE(delayed_end_hold(&m_end));
}

static void test_the_end_of_a_platform_on_hold_begins_at_once(void)
{
    TEST_ASSERT_TRUE(step(true, true));
    TEST_ASSERT_FALSE(delayed_end_is_held(&m_end));
    TEST_ASSERT_FALSE(step(false, false));
}

static void test_a_hold_delays_it_by_ten_seconds(void)
{
    TEST_ASSERT_TRUE(step(true, false));
    TEST_ASSERT_TRUE(delayed_end_hold(&m_end));
    TEST_ASSERT_EQUAL_UINT(10 * CYCLES_S, cycles_until_on(UINT32_MAX, 100 * CYCLES_S));
    TEST_ASSERT_FALSE(step(false, false)); /* it settles */
    TEST_ASSERT_TRUE(delayed_end_hold(&m_end));
    TEST_ASSERT_EQUAL_UINT(10 * CYCLES_S, cycles_until_on(UINT32_MAX, 100 * CYCLES_S));
}

static void test_a_hold_in_the_hold_delays_it_anew(void)
{
    TEST_ASSERT_TRUE(step(true, false));
    TEST_ASSERT_TRUE(delayed_end_hold(&m_end));
    TEST_ASSERT_EQUAL_UINT(5 * CYCLES_S, cycles_until_on(UINT32_MAX, 5 * CYCLES_S));
    TEST_ASSERT_TRUE(delayed_end_hold(&m_end));
    TEST_ASSERT_EQUAL_UINT(10 * CYCLES_S, cycles_until_on(UINT32_MAX, 100 * CYCLES_S));
}

static void test_holds_without_end_delay_it_by_a_minute(void)
{
    TEST_ASSERT_TRUE(step(true, false));
    TEST_ASSERT_EQUAL_UINT(60 * CYCLES_S, cycles_until_on(7, 1000 * CYCLES_S));
    TEST_ASSERT_FALSE(delayed_end_hold(&m_end));
    TEST_ASSERT_FALSE(step(false, false));
    TEST_ASSERT_TRUE(step(false, true)); /* heaved's own hold, for lateness */
}

/* A machine that skips nine of ten cycles is given no more time by the service manager. */
static void test_cycles_that_are_skipped_count_by_their_time(void)
{
    TEST_ASSERT_TRUE(step(true, false));
    TEST_ASSERT_TRUE(delayed_end_hold(&m_end));
    for (unsigned i = 1; i < CYCLES_S; i++) {
        m_now_us += 9 * CYCLE_US;
        TEST_ASSERT_FALSE(step(false, true));
    }
    m_now_us += 9 * CYCLE_US;
    TEST_ASSERT_TRUE(step(false, true));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_hold_without_an_end_is_none_of_its);
    RUN_TEST(test_the_end_of_a_platform_on_hold_begins_at_once);
    RUN_TEST(test_a_hold_delays_it_by_ten_seconds);
    RUN_TEST(test_a_hold_in_the_hold_delays_it_anew);
    RUN_TEST(test_cycles_that_are_skipped_count_by_their_time);
    RUN_TEST(test_holds_without_end_delay_it_by_a_minute);
    return UNITY_END();
}

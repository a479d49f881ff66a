/* SPDX-License-Identifier: MIT
 * test_wear.c - what an axis has done: way, changes of direction and time under torque, and what must not count.
 */
#include "heave/wear.h"

#include <math.h>

#include "unity.h"

#define CYCLE_US 1000u

static wear_t m_wear;
static drive_feedback_t m_feedback;

void setUp(void)
{
    m_wear = (wear_t){.turns = 0};
    m_feedback = (drive_feedback_t){.state = DRIVE_ENABLED, .is_homed = true, .has_actual = true, .is_energized = true};
}

void tearDown(void) {}

static void be_at(double mm)
{
    m_feedback.actual_mm_q32 = (q32_t)(mm * 4294967296.0);
    wear_step(&m_wear, &m_feedback, CYCLE_US);
}

static void go(double from, double to, unsigned cycles)
{
    for (unsigned i = 1; i <= cycles; i++) {
        be_at(from + (to - from) * i / cycles);
    }
}

static void test_wear_counts_way_turns_and_time(void)
{
    be_at(50);
    for (unsigned i = 0; i < 100; i++) {
        go(50, 150, 500);
        go(150, 50, 250);
    }
    TEST_ASSERT_UINT64_WITHIN(100 * 300, 100 * 200 * 1000, m_wear.travel_milli);
    TEST_ASSERT_UINT_WITHIN(1, 200, m_wear.turns);
    TEST_ASSERT_EQUAL_UINT64((100 * 750 + 1) * CYCLE_US, m_wear.energized_us);
}

static void test_wear_slow_ways_count_as_quick_ones(void)
{
    be_at(10);
    go(10, 20, 1000000);
    TEST_ASSERT_UINT64_WITHIN(150, 10000, m_wear.travel_milli);
}

static void test_wear_trembling_at_rest_is_no_way(void)
{
    for (unsigned i = 0; i < 100000; i++) {
        be_at(100 + 0.045 * sin(i * 1.7));
    }
    TEST_ASSERT_EQUAL_UINT64(0, m_wear.travel_milli);
    TEST_ASSERT_EQUAL_UINT32(0, m_wear.turns);
}

static void test_wear_small_motion_is_way_but_no_turn(void)
{
    be_at(100);
    for (unsigned i = 0; i < 100; i++) {
        go(100, 100.8, 100);
        go(100.8, 100, 100);
    }
    TEST_ASSERT_UINT64_WITHIN(25000, 160000, m_wear.travel_milli);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(1, m_wear.turns);
}

static void test_wear_another_zero_is_no_way(void)
{
    m_feedback.is_homed = false;
    go(-300, 0, 100); /* it finds its zero */
    m_feedback.is_homed = true;
    be_at(60);
    m_feedback.state = DRIVE_OFFLINE;
    be_at(0);
    m_feedback.state = DRIVE_DISABLED;
    be_at(180); /* moved by hand while nobody looked, or another drive */
    be_at(20);  /* counts that jump */
    TEST_ASSERT_EQUAL_UINT64(0, m_wear.travel_milli);
    TEST_ASSERT_EQUAL_UINT32(0, m_wear.turns);
    go(20, 30, 100);
    TEST_ASSERT_UINT64_WITHIN(150, 10000, m_wear.travel_milli);
}

static void test_wear_time_is_that_under_torque(void)
{
    be_at(10);
    m_feedback.is_energized = false;
    be_at(10);
    TEST_ASSERT_EQUAL_UINT64(CYCLE_US, m_wear.energized_us);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_wear_counts_way_turns_and_time);
    RUN_TEST(test_wear_slow_ways_count_as_quick_ones);
    RUN_TEST(test_wear_trembling_at_rest_is_no_way);
    RUN_TEST(test_wear_small_motion_is_way_but_no_turn);
    RUN_TEST(test_wear_another_zero_is_no_way);
    RUN_TEST(test_wear_time_is_that_under_torque);
    return UNITY_END();
}

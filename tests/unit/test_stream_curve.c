/* SPDX-License-Identifier: MIT
 * test_stream_curve.c - states of the curve and of the clock that a stream seldom or never gets into, made by hand.
 */
#include "../../src/stream/stream_curve.h"

#include <string.h>

#include "../../src/stream/stream_clock.h"
#include "unity.h"

#define PERIOD_US 20000u
#define CYCLE_US  1000u

static stream_curve_t m_curve;
static stream_clock_t m_clock;

void setUp(void)
{
    const q32_t zero_q32 = 0;
    m_curve = (stream_curve_t){.axes = 1};
    stream_curve_start(&m_curve, NULL, &zero_q32);
    stream_curve_pace(&m_curve, STREAM_SMOOTH, PERIOD_US, CYCLE_US, false);
    m_clock = (stream_clock_t){.hint_us = 0};
}

void tearDown(void) {}

static void append(unsigned samples, q32_t sample_q32)
{
    for (unsigned i = 0; i < samples; i++) {
        stream_curve_append(&m_curve, 1, false, &sample_q32, &sample_q32);
    }
}

static void commit(unsigned points)
{
    for (unsigned i = 0; i < points; i++) {
        stream_curve_commit(&m_curve, NULL);
    }
}

/* ---- corrections of the time line ---- */

static void check_is_unchanged_by(void (*correct)(stream_curve_t *self))
{
    static stream_curve_t before;
    memcpy(&before, &m_curve, sizeof before);
    correct(&m_curve);
    TEST_ASSERT_EQUAL_MEMORY(&before, &m_curve, sizeof before);
}

static void test_skip_without_two_samples_ahead_changes_nothing(void)
{
    append(1, Q32_ONE);
    check_is_unchanged_by(stream_curve_skip);
    append(1, 2 * Q32_ONE);
    stream_curve_skip(&m_curve);
    TEST_ASSERT_EQUAL_INT(1, m_curve.ahead);
}

static q32_t last_control(void)
{
    return m_curve.control_q32[0] + (m_curve.way_q36[0][0] + m_curve.way_q36[1][0] + m_curve.way_q36[2][0]) / 16;
}

/* What the curve is off leads it a sixteenth further than the motion has been, and no more. */
static void test_commit_correction_stays_where_the_motion_has_been(void)
{
    append(1, 0);
    m_curve.off_q32[0][0] = Q32_ONE;
    m_curve.off_q32[0][1] = 7 * Q32_ONE;
    m_curve.low_q32[0] = -2 * Q32_ONE;
    m_curve.high_q32[0] = 2 * Q32_ONE;
    m_curve.bandwidth_q32 = Q32_ONE / 8;
    m_curve.is_off = true;
    commit(1);
    TEST_ASSERT_EQUAL_INT64(2 * Q32_ONE + Q32_ONE / 4, last_control());
    TEST_ASSERT_EQUAL_INT64(0, m_curve.off_q32[0][1]);
    append(1, 0);
    commit(1);
    TEST_ASSERT_TRUE(last_control() < 2 * Q32_ONE + Q32_ONE / 4);
}

/* At the turn of a swing it is on the point for a moment, and yet not back. */
static void test_commit_on_the_way_through_the_point_the_curve_is_still_off(void)
{
    append(1, 0);
    m_curve.off_q32[0][0] = 4 * Q32_ONE;
    m_curve.off_q32[0][1] = -7 * Q32_ONE;
    m_curve.low_q32[0] = -16 * Q32_ONE;
    m_curve.high_q32[0] = 16 * Q32_ONE;
    m_curve.bandwidth_q32 = Q32_ONE / 2;
    m_curve.is_off = true;
    commit(1);
    TEST_ASSERT_EQUAL_INT64(0, last_control());
    TEST_ASSERT_EQUAL_INT64(-4 * Q32_ONE, m_curve.off_q32[0][1]);
    TEST_ASSERT_TRUE(m_curve.is_off);
    append(1, 0);
    commit(1);
    TEST_ASSERT_TRUE(last_control() < -Q32_ONE);
    for (unsigned i = 0; i < 60; i++) {
        append(1, 0);
        commit(1);
    }
    TEST_ASSERT_EQUAL_INT64(0, last_control());
    TEST_ASSERT_FALSE(m_curve.is_off);
}

/* ---- coarse values ---- */

static void check_window(int32_t expected, uint32_t period_us)
{
    stream_curve_pace(&m_curve, STREAM_SMOOTH, period_us, CYCLE_US, false);
    TEST_ASSERT_EQUAL_INT32(expected, m_curve.window);
}

/* Steps of 1 mm on an axis with 3000 mm/s^2: means of 4, 3, 2 and 1 points at 12, 16, 20 and 40 ms. */
static void test_pace_a_longer_mean_than_needed_is_kept_where_one_less_would_do(void)
{
    m_curve.limits[0] = (governor_limits_t){.acc_per_cycle2_q32 = Q32_ONE * 3 / 1000, .jerk_per_cycle3_q32 = Q32_ONE};
    m_curve.quantum[0].quantum_q32 = Q32_ONE;
    check_window(2, 20000);
    check_window(3, 16000);
    check_window(3, 20000);
    check_window(4, 12000);
    check_window(2, 20000);
    check_window(1, 40000);
}

/* ---- the clock ---- */

static void test_elapsed_longer_than_it_counts_is_the_longest(void)
{
    stream_clock_start(&m_clock, 1000);
    TEST_ASSERT_EQUAL_UINT32(0, stream_clock_elapsed_us(&m_clock, 999));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX - 1, stream_clock_elapsed_us(&m_clock, 1000 + (uint64_t)UINT32_MAX - 1));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, stream_clock_elapsed_us(&m_clock, 1000 + (uint64_t)UINT32_MAX));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, stream_clock_elapsed_us(&m_clock, 1001 + (uint64_t)UINT32_MAX));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, stream_clock_elapsed_us(&m_clock, UINT64_MAX));
}

static void test_take_after_more_periods_than_it_counts_keeps_the_period(void)
{
    uint64_t now_us = 1000;
    stream_clock_start(&m_clock, now_us);
    for (unsigned i = 0; i < 2 * STREAM_GAPS; i++) {
        now_us += STREAM_PERIOD_MIN_US;
        (void)stream_clock_accept(&m_clock, now_us, 1);
    }
    now_us += 260u * STREAM_PERIOD_MIN_US;
    TEST_ASSERT_FALSE(stream_clock_accept(&m_clock, now_us, 260));
    TEST_ASSERT_INT64_WITHIN(STREAM_PERIOD_MIN_US * STREAM_US_Q16 / 50, STREAM_PERIOD_MIN_US * STREAM_US_Q16,
                             m_clock.period_us_q16);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_skip_without_two_samples_ahead_changes_nothing);
    RUN_TEST(test_commit_correction_stays_where_the_motion_has_been);
    RUN_TEST(test_commit_on_the_way_through_the_point_the_curve_is_still_off);
    RUN_TEST(test_pace_a_longer_mean_than_needed_is_kept_where_one_less_would_do);
    RUN_TEST(test_elapsed_longer_than_it_counts_is_the_longest);
    RUN_TEST(test_take_after_more_periods_than_it_counts_keeps_the_period);
    return UNITY_END();
}

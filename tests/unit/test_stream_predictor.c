/* SPDX-License-Identifier: MIT
 * test_stream_predictor.c - where the motion of a stream's newest points leads.
 */
#include "../../src/stream/stream_predictor.h"

#include <math.h>

#include "../../src/stream/stream_points.h"
#include "unity.h"

static stream_curve_t m_curve;
static const stream_predictor_t k_even = {.by_newest_q32 = Q32_ONE};

void setUp(void)
{
    m_curve = (stream_curve_t){.axes = POSE_AXES, .age = 100, .head = 40};
}

void tearDown(void) {}

static q32_t q32(double value)
{
    return (q32_t)(value * 4294967296.0);
}

/* The points of an axis, the newest at 0: what a function of the time says. */
static void place(unsigned axis, double (*at)(int period))
{
    for (int back = 0; back < 20; back++) {
        m_curve.point_q32[stream_points_place(m_curve.head - (uint32_t)back)][axis] = q32(at(-back));
    }
}

static double fit_and_lead(double (*at)(int period))
{
    const stream_predictor_t fitted = stream_predictor_fit(&m_curve, k_even);
    return (double)stream_predictor_next(&fitted, q32(at(0)) - q32(at(-1)), q32(at(-1)) - q32(at(-2))) / 4294967296.0;
}

static double resting(int period)
{
    return 17.0 + 0 * period;
}

static double even(int period)
{
    return 3.0 + 0.25 * period;
}

static double shake(int period)
{
    return 8.0 * sin(0.63 * period + 0.4); /* 6 Hz at 60 Hz */
}

static double slow_sway(int period)
{
    return 100.0 * sin(0.05 * period + 2.0);
}

static double jump(int period)
{
    return period == 0 ? 60.0 : 0.001 * period;
}

static void test_fit_of_points_at_rest_leads_nowhere(void)
{
    place(2, resting);
    TEST_ASSERT_EQUAL_DOUBLE(0, fit_and_lead(resting));
}

static void test_fit_even_motion_goes_on(void)
{
    place(0, even);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.25, fit_and_lead(even));
}

/* The next step of a sine is 2 cos w times the newest less the one before. */
static void test_fit_shake_turns_back_where_it_does(void)
{
    place(5, shake);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, shake(1) - shake(0), fit_and_lead(shake));
}

static void test_fit_slow_sway_is_led_on_better_than_by_its_last_step(void)
{
    place(3, slow_sway);
    const double next = slow_sway(1) - slow_sway(0);
    TEST_ASSERT_TRUE(fabs(fit_and_lead(slow_sway) - next) < 0.2 * fabs(slow_sway(0) - slow_sway(-1) - next));
}

/* One axis that stands, and one that moves little, change nothing. */
static void test_fit_axes_have_one_motion_together(void)
{
    place(5, shake);
    const double alone = fit_and_lead(shake);
    place(0, resting);
    place(1, even);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, alone, fit_and_lead(shake));
}

/* From a millionth to a million of the size the coefficients are the same. */
static void test_fit_does_not_depend_on_the_unit(void)
{
    place(5, shake);
    const stream_predictor_t fitted = stream_predictor_fit(&m_curve, k_even);
    for (int shift = -20; shift <= 18; shift++) {
        for (unsigned i = 0; i < STREAM_POINTS; i++) {
            const q32_t point_q32 = q32(i <= m_curve.head && i + 20 > m_curve.head ? shake((int)i - (int)m_curve.head) : 0);
            m_curve.point_q32[i][5] = shift < 0 ? point_q32 / (1 << -shift) : point_q32 * (1 << shift);
        }
        const stream_predictor_t other = stream_predictor_fit(&m_curve, k_even);
        TEST_ASSERT_INT64_WITHIN(Q32_ONE / 100, fitted.by_newest_q32, other.by_newest_q32);
        TEST_ASSERT_INT64_WITHIN(Q32_ONE / 100, fitted.by_before_q32, other.by_before_q32);
    }
}

static void test_fit_coefficients_stay_within_their_bounds(void)
{
    place(4, jump);
    const stream_predictor_t fitted = stream_predictor_fit(&m_curve, k_even);
    TEST_ASSERT_TRUE(fitted.by_newest_q32 >= -Q32_ONE && fitted.by_newest_q32 <= 2 * Q32_ONE);
    TEST_ASSERT_TRUE(fitted.by_before_q32 >= -Q32_ONE && fitted.by_before_q32 <= Q32_ONE);
}

static void test_fit_of_a_stream_that_has_just_begun_is_what_is_assumed(void)
{
    place(5, shake);
    m_curve.age = 7;
    const stream_predictor_t fitted = stream_predictor_fit(&m_curve, k_even);
    TEST_ASSERT_EQUAL_INT64(Q32_ONE, fitted.by_newest_q32);
    TEST_ASSERT_EQUAL_INT64(0, fitted.by_before_q32);
    m_curve.age = 8;
    TEST_ASSERT_TRUE(stream_predictor_fit(&m_curve, k_even).by_before_q32 < -Q32_ONE / 2);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_fit_of_points_at_rest_leads_nowhere);
    RUN_TEST(test_fit_even_motion_goes_on);
    RUN_TEST(test_fit_shake_turns_back_where_it_does);
    RUN_TEST(test_fit_slow_sway_is_led_on_better_than_by_its_last_step);
    RUN_TEST(test_fit_axes_have_one_motion_together);
    RUN_TEST(test_fit_does_not_depend_on_the_unit);
    RUN_TEST(test_fit_coefficients_stay_within_their_bounds);
    RUN_TEST(test_fit_of_a_stream_that_has_just_begun_is_what_is_assumed);
    return UNITY_END();
}

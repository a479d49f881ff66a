/* SPDX-License-Identifier: MIT
 * test_response.c - frequency responses of simulated axes whose lag, gain, bandwidth and backlash are known, by the chirp that
 * heaved makes, in a quantized and noisy feedback.
 */
#include "identify/response.h"

#include <math.h>
#include <stdlib.h>

#include "heave/excitation.h"
#include "unity.h"

#define CYCLE_US  1000u
#define COUNT     62000u /* 60 s, and rest */
#define AMPLITUDE 2.0

static double m_sent[COUNT];
static double m_actual[COUNT];
static response_t m_response;

/* 0.2 to 20 Hz, 50 mm/s, 2500 mm/s^2, 50000 mm/s^3. */
void setUp(void)
{
    static excitation_t signal;
    const excitation_request_t request = {EXCITATION_CHIRP, 2 * 65536, 200, 20000, 60000};
    const double one = (double)((int64_t)1 << 62);
    const path_limits_t limits = {(int64_t)(0.05 / AMPLITUDE * one), (int64_t)(0.0025 / AMPLITUDE * one),
                                  (int64_t)(0.00005 / AMPLITUDE * one)};
    TEST_ASSERT_EQUAL(HV_OK, excitation_init(&signal, &request, &limits, CYCLE_US));
    for (unsigned n = 0; n < COUNT; n++) {
        m_sent[n] = 100 + AMPLITUDE * (n < 500 ? 0 : (double)excitation_step(&signal) / one);
    }
}

void tearDown(void) {}

/* A dead time in cycles, a first-order lag, a gain, backlash, a step of the encoder, and white noise. */
static void follow(unsigned dead, double lag_s, double gain, double backlash, double step, double noise)
{
    uint32_t random = 1;
    double motor = m_sent[0], plate = m_sent[0];
    for (unsigned n = 0; n < COUNT; n++) {
        const double asked = m_sent[0] + gain * (m_sent[n < dead ? 0 : n - dead] - m_sent[0]);
        motor += lag_s > 0 ? (asked - motor) * (1 - exp(-1e-6 * CYCLE_US / lag_s)) : asked - motor;
        plate = motor - plate > backlash / 2 ? motor - backlash / 2 : plate - motor > backlash / 2 ? motor + backlash / 2 : plate;
        random = random * 1664525u + 1013904223u;
        const double seen = plate + noise * ((double)(random >> 8) / 8388608.0 - 1);
        m_actual[n] = step > 0 ? step * round(seen / step) : seen;
    }
    response_find(&m_response, m_sent, m_actual, COUNT, CYCLE_US / 1e6, 0.2, 20);
    TEST_ASSERT_TRUE(m_response.is_moved);
}

static void test_a_dead_time_is_a_lag_with_gain_1(void)
{
    follow(12, 0, 1, 0, 0.001, 0);
    TEST_ASSERT_DOUBLE_WITHIN(0.12, 12, m_response.lag_ms);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 1, m_response.gain);
    TEST_ASSERT_TRUE(m_response.gain_3db_hz == 0);
    TEST_ASSERT_DOUBLE_WITHIN(1, 1000.0 / 12 / 4, m_response.phase_90_hz == 0 ? 1000.0 / 12 / 4 : m_response.phase_90_hz);
    TEST_ASSERT_TRUE(m_response.hysteresis < 0.002);
    for (unsigned i = 0; i < RESPONSE_POINTS; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.03, 1, m_response.point[i].gain);
        TEST_ASSERT_TRUE(m_response.point[i].coherence > 0.98);
    }
}

static void test_a_first_order_lag_has_its_corner(void)
{
    const double lag_s = 0.02;
    follow(0, lag_s, 1, 0, 0.001, 0.002);
    TEST_ASSERT_DOUBLE_WITHIN(0.4, 19.5, m_response.lag_ms); /* half a cycle is the model's own */
    TEST_ASSERT_DOUBLE_WITHIN(0.4, 1 / (2 * acos(-1) * lag_s), m_response.gain_3db_hz);
    for (unsigned i = 0; i < RESPONSE_POINTS; i++) {
        const double x = 2 * acos(-1) * m_response.point[i].hz * lag_s;
        TEST_ASSERT_DOUBLE_WITHIN(0.03, 1 / sqrt(1 + x * x), m_response.point[i].gain);
        TEST_ASSERT_DOUBLE_WITHIN(5, -atan(x) * 180 / acos(-1), m_response.point[i].phase_deg);
    }
    TEST_ASSERT_TRUE(m_response.following_most > 0.2 && m_response.following_most < 1 && m_response.following_rms < 0.5);
}

static void test_a_wrong_gain_is_seen(void)
{
    follow(5, 0.005, 0.5, 0, 0.001, 0);
    TEST_ASSERT_DOUBLE_WITHIN(0.005, 0.5, m_response.gain);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 9.5, m_response.lag_ms);
}

static void test_backlash_is_told_from_lag(void)
{
    follow(0, 0.015, 1, 0, 0, 0);
    TEST_ASSERT_TRUE(m_response.hysteresis < 0.005);
    follow(0, 0.015, 1, 0.1, 0.001, 0.001);
    TEST_ASSERT_DOUBLE_WITHIN(0.015, 0.1, m_response.hysteresis);
    follow(0, 0.015, 1, 0.3, 0.001, 0.001);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 0.3, m_response.hysteresis);
}

static void test_what_does_not_move_has_no_response(void)
{
    for (unsigned n = 0; n < COUNT; n++) {
        m_actual[n] = 7;
    }
    response_find(&m_response, m_sent, m_actual, COUNT, 0.001, 0.2, 20);
    TEST_ASSERT_FALSE(m_response.is_moved);
    response_find(&m_response, m_sent, m_actual, 3, 0.001, 0.2, 20);
    TEST_ASSERT_FALSE(m_response.is_moved);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_dead_time_is_a_lag_with_gain_1);
    RUN_TEST(test_a_first_order_lag_has_its_corner);
    RUN_TEST(test_a_wrong_gain_is_seen);
    RUN_TEST(test_backlash_is_told_from_lag);
    RUN_TEST(test_what_does_not_move_has_no_response);
    return UNITY_END();
}

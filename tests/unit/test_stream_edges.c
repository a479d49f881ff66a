/* SPDX-License-Identifier: MIT
 * test_stream_edges.c - a whole stream in states that motion never gives it: poses beyond what the mechanism can calculate, axes
 * without limits, times beyond all senders.
 */
#include <math.h>

#include "heave/stream.h"
#include "rig.h"
#include "unity.h"

#define CYCLE_US  1000u
#define PERIOD_US 20000u

static stream_t m_stream;
static kin_t m_kin;
static q32_t m_at_q32[AXES_MAX];
static uint64_t m_now_us;

static q32_t q32(double value)
{
    return (q32_t)(value * 4294967296.0);
}

static double number(q32_t value_q32)
{
    return (double)value_q32 / 4294967296.0;
}

/* Limits of the rig's axes and cylinders. */
void setUp(void)
{
    const settings_t settings = rig_hexapod();
    const governor_limits_t axis = {q32(400 * 1e-3), q32(3000 * 1e-6), q32(50000 * 1e-9)};
    TEST_ASSERT_EQUAL(HV_OK, kin_init(&m_kin, &settings.geometry));
    stream_init(&m_stream, CYCLE_US, AXES_MAX, STREAM_SMOOTH);
    stream_set_delay_max(&m_stream, 120000);
    stream_set_scale(&m_stream, Q16_ONE);
    for (unsigned i = 0; i < AXES_MAX; i++) {
        stream_set_limits(&m_stream, i, &axis);
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        stream_set_cylinder_limits(&m_stream, i, &axis);
        m_at_q32[i] = 0;
    }
    const history_t rest[AXES_MAX] = {{.pos_q32 = 0}};
    stream_place(&m_stream, rest);
    m_now_us = 10000000;
}

void tearDown(void) {}

/* So many ms of an axis; where it gets to. */
static void stream_ms(unsigned axis, unsigned ms, double from, double per_s)
{
    for (unsigned at = 0; at < ms; at++) {
        ramp_ref_t ref[AXES_MAX];
        if (at % (PERIOD_US / 1000) == 0) {
            q32_t sample_q32[AXES_MAX] = {0};
            sample_q32[axis] = q32(from + per_s * at / 1000);
            stream_push(&m_stream, m_now_us, &m_kin, sample_q32);
        }
        m_now_us += CYCLE_US;
        if (stream_step(&m_stream, m_now_us, &m_kin, ref)) {
            for (unsigned i = 0; i < AXES_MAX; i++) {
                m_at_q32[i] = ref[i].pos_q32;
            }
        }
    }
}

/* No sample comes. */
static void wait_ms(unsigned ms)
{
    for (unsigned at = 0; at < ms; at++) {
        ramp_ref_t ref[AXES_MAX];
        m_now_us += CYCLE_US;
        (void)stream_step(&m_stream, m_now_us, &m_kin, ref);
    }
}

/* There is no such pose: only the axes count, and they are where they were asked for. */
static void test_stream_beyond_the_mechanism_follows_its_axes(void)
{
    stream_ms(AXIS_X, 2000, 7800, 200);
    const double at = number(m_at_q32[AXIS_X]);
    TEST_ASSERT_TRUE(at > 7800 + 300 && at < 8200);
    stream_ms(AXIS_X, 4000, 8200, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 8200, number(m_at_q32[AXIS_X]));
    stream_ms(AXIS_X, 4000, 8200, -200); /* and back */
    stream_ms(AXIS_X, 4000, 7400, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 7400, number(m_at_q32[AXIS_X]));
}

static void test_stream_beyond_the_mechanism_can_be_shifted(void)
{
    q32_t by_q32[POSE_AXES] = {[AXIS_X] = q32(50)};
    stream_ms(AXIS_X, 2000, 8100, 100);
    const double at = number(m_at_q32[AXIS_X]);
    stream_shift(&m_stream, &m_kin, by_q32);
    stream_ms(AXIS_X, 1, 8350, 100);
    TEST_ASSERT_DOUBLE_WITHIN(1, at + 50, number(m_at_q32[AXIS_X]));
}

/* What has no limits is never far from where it was left. */
static void test_axis_without_limits_returns_nowhere_else(void)
{
    const governor_limits_t none = {0};
    q32_t sample_q32[AXES_MAX] = {0};
    stream_ms(AXIS_Z, 2000, 0, 10);
    wait_ms(600);
    sample_q32[AXIS_Z] = q32(90);
    TEST_ASSERT_TRUE(stream_returns_elsewhere(&m_stream, m_now_us, sample_q32));
    setUp();
    stream_set_limits(&m_stream, AXIS_Z, &none);
    stream_ms(AXIS_Z, 2000, 0, 10);
    wait_ms(600);
    TEST_ASSERT_FALSE(stream_returns_elsewhere(&m_stream, m_now_us, sample_q32));
}

/* A flood of frames of one and the same time has no period. */
static void test_flood_within_one_time_is_no_stream(void)
{
    for (unsigned i = 0; i < 50; i++) {
        q32_t sample_q32[AXES_MAX] = {[AXIS_Z] = q32(i * 0.1)};
        stream_push(&m_stream, m_now_us, &m_kin, sample_q32);
    }
    TEST_ASSERT_NOT_EQUAL(STREAM_RUNNING, stream_phase(&m_stream));
    for (unsigned ms = 0; ms < 3000; ms++) {
        ramp_ref_t ref[AXES_MAX];
        m_now_us += CYCLE_US;
        if (stream_step(&m_stream, m_now_us, &m_kin, ref)) {
            TEST_ASSERT_TRUE(fabs(number(ref[AXIS_Z].pos_q32)) < 5.1);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_stream_beyond_the_mechanism_follows_its_axes);
    RUN_TEST(test_stream_beyond_the_mechanism_can_be_shifted);
    RUN_TEST(test_axis_without_limits_returns_nowhere_else);
    RUN_TEST(test_flood_within_one_time_is_no_stream);
    return UNITY_END();
}

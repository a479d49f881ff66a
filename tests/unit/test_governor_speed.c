/* SPDX-License-Identifier: MIT
 * test_governor_speed.c - what the governor leaves of speeds beyond the limits, and how it catches up.
 */
#include "../../src/stream/governor_speed.h"

#include "unity.h"

#define PERIOD_US 20000u
#define CYCLE_US  1000u

static governor_t m_governor;

void setUp(void)
{
    m_governor = (governor_t){0};
}

void tearDown(void) {}

static q32_t q32(double value)
{
    return (q32_t)(value * 4294967296.0);
}

#define SPEED 100.0 /* mm/s */

/* Two axes with limits of speed, one of which moves twice as far. */
static void start_speeds(void)
{
    const q32_t rest_q32[3] = {0};
    for (unsigned i = 0; i < 2; i++) {
        governor_set_limits(&m_governor, i, &(governor_limits_t){q32(SPEED / 1000), q32(1), q32(1)});
    }
    governor_pace(&m_governor, PERIOD_US, CYCLE_US);
    governor_start(&m_governor);
    for (unsigned i = 0; i < 2; i++) {
        governor_place(&m_governor, i, true, rest_q32);
    }
}

static void limit(double asked, q32_t kept_q32[2])
{
    const q32_t asked_q32[2] = {q32(asked), q32(asked / 2)};
    governor_limit_speed(&m_governor, asked_q32, Q16_ONE, kept_q32);
}

static void test_speed_below_the_limits_is_kept_to_the_last_bit(void)
{
    start_speeds();
    for (int period = 1; period < 100; period++) {
        q32_t kept_q32[2];
        limit(0.8 * SPEED * 0.02 * period, kept_q32);
        TEST_ASSERT_EQUAL_INT64(q32(0.8 * SPEED * 0.02 * period), kept_q32[0]);
        TEST_ASSERT_FALSE(m_governor.is_slowed);
    }
}

/* A ramp of twice the speed for half a second: no more than 92 % of the limit, both axes by the same factor, and then all of it.
 */
static void test_speed_beyond_the_limits_is_made_up_for(void)
{
    q32_t kept_q32[2] = {0};
    q32_t before_q32 = 0;
    start_speeds();
    for (int period = 1; period < 200; period++) {
        const double asked = 2 * SPEED * 0.02 * (period < 25 ? period : 25);
        before_q32 = kept_q32[0];
        limit(asked, kept_q32);
        TEST_ASSERT_TRUE(kept_q32[0] - before_q32 <= q32(0.9201 * SPEED * 0.02));
        TEST_ASSERT_TRUE(kept_q32[0] >= before_q32 && kept_q32[0] <= q32(asked));
        TEST_ASSERT_INT64_WITHIN(q32(0.001), kept_q32[0] / 2, kept_q32[1]);
        TEST_ASSERT_TRUE(period > 25 || m_governor.is_slowed);
    }
    TEST_ASSERT_FALSE(m_governor.is_slowed);
    TEST_ASSERT_EQUAL_INT64(q32(2 * SPEED * 0.02 * 25), kept_q32[0]);
    TEST_ASSERT_EQUAL_INT64(q32(SPEED * 0.02 * 25), kept_q32[1]);
}

/* What comes out is multiplied by the intensity: at a half, twice as much may be asked. */
static void test_speed_at_half_of_the_intensity_may_be_twice_as_large(void)
{
    q32_t kept_q32[2];
    start_speeds();
    const q32_t asked_q32[2] = {q32(1.6 * SPEED * 0.02), 0};
    governor_limit_speed(&m_governor, asked_q32, Q16_ONE / 2, kept_q32);
    TEST_ASSERT_EQUAL_INT64(asked_q32[0], kept_q32[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_speed_below_the_limits_is_kept_to_the_last_bit);
    RUN_TEST(test_speed_beyond_the_limits_is_made_up_for);
    RUN_TEST(test_speed_at_half_of_the_intensity_may_be_twice_as_large);
    return UNITY_END();
}

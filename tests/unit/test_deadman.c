/* SPDX-License-Identifier: MIT
 * test_deadman.c - a hand: how long it counts, and what an old proof of it is worth.
 */
#include "heave/deadman.h"
#include "random.h"
#include "unity.h"

#define T0 1000000u

static deadman_t m_hand;

void setUp(void)
{
    m_hand = (deadman_t){.is_held = false};
}

void tearDown(void) {}

static void test_nobody_pressed_is_not_held(void)
{
    TEST_ASSERT_FALSE(deadman_step(&m_hand, 0));
    TEST_ASSERT_EQUAL(DEADMAN_OVER, deadman_beat(&m_hand, 0, 1, 0, T0));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0));
}

static void test_press_holds_for_250_ms_to_the_microsecond(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 0, T0));
    TEST_ASSERT_TRUE(deadman_step(&m_hand, T0 + 249999));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 250000));
}

static void test_press_what_the_way_took_is_taken_off(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 100000, T0));
    TEST_ASSERT_TRUE(deadman_step(&m_hand, T0 + 149999));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 150000));
}

static void test_press_that_is_stale_holds_nothing(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_STALE, deadman_press(&m_hand, 1, 250000, T0));
    TEST_ASSERT_EQUAL(DEADMAN_STALE, deadman_press(&m_hand, 1, UINT64_MAX, T0));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0));
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 249999, T0));
    TEST_ASSERT_TRUE(deadman_step(&m_hand, T0));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 1));
}

static void test_beats_hold_on_for_ever(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 7, 0, T0));
    for (uint32_t i = 1; i < 1000; i++) {
        const uint64_t now_us = T0 + i * 50000u;
        TEST_ASSERT_TRUE(deadman_step(&m_hand, now_us));
        TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_beat(&m_hand, 7, i, 49000, now_us));
    }
    TEST_ASSERT_TRUE(deadman_step(&m_hand, T0 + 999u * 50000u + 200999u));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 999u * 50000u + 201000u));
}

static void test_beat_after_the_end_needs_a_new_press(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 0, T0));
    TEST_ASSERT_EQUAL(DEADMAN_OVER, deadman_beat(&m_hand, 1, 1, 0, T0 + 250000)); /* though nobody stepped in between */
    TEST_ASSERT_EQUAL(DEADMAN_OVER, deadman_beat(&m_hand, 1, 2, 0, T0 + 250001));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 250001));
    TEST_ASSERT_EQUAL(DEADMAN_KNOWN, deadman_press(&m_hand, 1, 0, T0 + 300000)); /* the same press once more is none */
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 2, 0, T0 + 300000));
    TEST_ASSERT_EQUAL(DEADMAN_OVER, deadman_beat(&m_hand, 1, 3, 0, T0 + 300000)); /* nor does the old series hold the new one */
}

/* A link that stood still for a second delivers what was sent every 50 ms meanwhile, all at once. */
static void test_burst_of_old_beats_adds_nothing(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 0, T0));
    for (uint32_t i = 1; i <= 3; i++) {
        TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_beat(&m_hand, 1, i, 0, T0 + i * 50000u));
    }
    const uint64_t end_us = T0 + 3u * 50000u + 250000u;
    const uint64_t burst_us = end_us - 10000u; /* just before the end: these are of the time from 200 ms on */
    for (uint32_t i = 4; i <= 7; i++) {
        (void)deadman_beat(&m_hand, 1, i, burst_us - (T0 + 150000u), burst_us); /* the newest tick they heard is that of beat 3 */
    }
    TEST_ASSERT_TRUE(deadman_step(&m_hand, end_us - 1));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, end_us));
    for (uint32_t i = 8; i <= 30; i++) {
        TEST_ASSERT_EQUAL(DEADMAN_OVER, deadman_beat(&m_hand, 1, i, 300000, T0 + 1000000u));
    }
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 1000000u));
}

static void test_beat_counter_goes_upwards_only(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 0, T0));
    TEST_ASSERT_EQUAL(DEADMAN_KNOWN, deadman_beat(&m_hand, 1, 0, 0, T0 + 100000));
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_beat(&m_hand, 1, 5, 0, T0 + 100000));
    TEST_ASSERT_EQUAL(DEADMAN_KNOWN, deadman_beat(&m_hand, 1, 5, 0, T0 + 200000));
    TEST_ASSERT_EQUAL(DEADMAN_KNOWN, deadman_beat(&m_hand, 1, 4, 0, T0 + 200000));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 350000));
}

static void test_beat_with_an_older_tick_does_not_shorten(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 0, T0));
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_beat(&m_hand, 1, 1, 200000, T0 + 50000));
    TEST_ASSERT_TRUE(deadman_step(&m_hand, T0 + 249999));
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0 + 250000));
}

static void test_release_ends_at_once_and_a_beat_does_not_bring_it_back(void)
{
    TEST_ASSERT_EQUAL(DEADMAN_TAKEN, deadman_press(&m_hand, 1, 0, T0));
    deadman_release(&m_hand);
    TEST_ASSERT_FALSE(deadman_step(&m_hand, T0));
    TEST_ASSERT_EQUAL(DEADMAN_OVER, deadman_beat(&m_hand, 1, 1, 0, T0 + 1000));
}

/* Whatever arrives, in whatever order: nobody is held for longer than 250 ms after the newest tick that was echoed. */
static void test_random_traffic_never_holds_beyond_the_newest_echo(void)
{
    uint64_t newest_us = 0; /* tick echoed, of what was taken or not */
    uint32_t series = 0;
    for (uint32_t n = 0; n < 1000000u; n++) {
        const uint32_t random = random_below(UINT32_MAX);
        const uint64_t now_us = T0 + n * 1000u;
        const uint64_t age_us = (random >> 8) % 600000u;
        const bool is_quiet = n / 700u % 2u == 1u;
        if (!is_quiet && random % 50u == 0) {
            series += random % 3u;
            (void)deadman_press(&m_hand, series, age_us, now_us);
            newest_us = now_us - age_us > newest_us ? now_us - age_us : newest_us;
        } else if (!is_quiet && random % 20u == 0) {
            (void)deadman_beat(&m_hand, series - random % 2u, n, age_us, now_us);
            newest_us = now_us - age_us > newest_us ? now_us - age_us : newest_us;
        }
        TEST_ASSERT_TRUE(!deadman_step(&m_hand, now_us) || now_us < newest_us + DEADMAN_HOLD_US);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nobody_pressed_is_not_held);
    RUN_TEST(test_press_holds_for_250_ms_to_the_microsecond);
    RUN_TEST(test_press_what_the_way_took_is_taken_off);
    RUN_TEST(test_press_that_is_stale_holds_nothing);
    RUN_TEST(test_beats_hold_on_for_ever);
    RUN_TEST(test_beat_after_the_end_needs_a_new_press);
    RUN_TEST(test_burst_of_old_beats_adds_nothing);
    RUN_TEST(test_beat_counter_goes_upwards_only);
    RUN_TEST(test_beat_with_an_older_tick_does_not_shorten);
    RUN_TEST(test_release_ends_at_once_and_a_beat_does_not_bring_it_back);
    RUN_TEST(test_random_traffic_never_holds_beyond_the_newest_echo);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_guard.c - the last look at a set-point before it is sent, and for how long another master is listened for.
 */
#include "heave/guard.h"

#include <string.h>

#include "heave/canmaster.h"
#include "unity.h"

static const guard_limits_t k_limits = {
    .from_q32 = 10 * Q32_ONE, .step_max_q32 = Q32_ONE, .actual_q32 = 8 * Q32_ONE, .window_q32 = 3 * Q32_ONE / 2};

void setUp(void) {}

void tearDown(void) {}

/* ---- set-points ---- */

static void check(q32_t setpoint_q32, const guard_limits_t *limits, q32_t jump_q32, q32_t lag_q32, q32_t allowed_q32)
{
    const drive_guard_t guard = guard_judge(setpoint_q32, limits);
    TEST_ASSERT_EQUAL_INT64(jump_q32, guard.jump_q32);
    TEST_ASSERT_EQUAL_INT64(lag_q32, guard.lag_q32);
    TEST_ASSERT_EQUAL_INT64(allowed_q32, guard.allowed_q32);
    TEST_ASSERT_EQUAL(jump_q32 != 0 || lag_q32 != 0, drive_guard_is_found(&guard));
}

static void test_set_point_is_near_the_last_one_and_the_position(void)
{
    guard_limits_t limits = k_limits;
    check(9 * Q32_ONE, &limits, 0, 0, 0);
    check(19 * Q32_ONE / 2, &limits, 0, 0, 0); /* just within the window */
    check(19 * Q32_ONE / 2 + 1, &limits, 0, 3 * Q32_ONE / 2 + 1, 3 * Q32_ONE / 2);
    check(11 * Q32_ONE, &limits, 0, 3 * Q32_ONE, 3 * Q32_ONE / 2);
    check(11 * Q32_ONE + 1, &limits, Q32_ONE + 1, 0, Q32_ONE);
    check(9 * Q32_ONE - 1, &limits, Q32_ONE + 1, 0, Q32_ONE);
    check(INT64_MAX, &limits, INT64_MAX - 10 * Q32_ONE, 0, Q32_ONE);
    check(INT64_MIN, &limits, INT64_MAX, 0, Q32_ONE);
    limits.window_q32 = 0; /* not watched */
    check(11 * Q32_ONE, &limits, 0, 0, 0);
}

/* It is a jump also where it is exactly at the position: no counts can tell the drive. */
static void test_set_point_without_counts_is_a_jump(void)
{
    TEST_ASSERT_EQUAL_INT64(4 * Q32_ONE, guard_out_of_counts(12 * Q32_ONE, &k_limits).jump_q32);
    TEST_ASSERT_EQUAL_INT64(1, guard_out_of_counts(8 * Q32_ONE, &k_limits).jump_q32);
    TEST_ASSERT_EQUAL_INT64(Q32_ONE, guard_out_of_counts(8 * Q32_ONE, &k_limits).allowed_q32);
}

static void test_words_tell_a_jump_from_a_lag(void)
{
    TEST_ASSERT_NOT_NULL(strstr(guard_text(&(drive_guard_t){.jump_q32 = 1}), "jump"));
    TEST_ASSERT_NOT_NULL(strstr(guard_text(&(drive_guard_t){.lag_q32 = 1}), "too far from its position"));
}

/* ---- another master ---- */

/* Nothing may be sent for so long after it was heard last. */
static unsigned listened_ms(uint32_t listen_ms, unsigned heard_at_ms)
{
    canmaster_t master = {.heard_us = 0};
    unsigned ms = 1;
    canmaster_listen(&master, listen_ms, 1000);
    for (; ms < 10000; ms++) {
        if (ms == heard_at_ms) {
            canmaster_note(&master, 7);
        }
        if (canmaster_step(&master, 1000 + ms * 1000u) == CANMASTER_BEGIN) {
            break;
        }
        TEST_ASSERT_EQUAL(ms >= heard_at_ms, canmaster_leads(&master, 1000 + ms * 1000u));
    }
    return ms;
}

static void test_silence_is_a_second_at_least_where_somebody_was_heard(void)
{
    TEST_ASSERT_EQUAL_UINT(300, listened_ms(300, 99999));
    TEST_ASSERT_EQUAL_UINT(1200, listened_ms(300, 200));
    TEST_ASSERT_EQUAL_UINT(2200, listened_ms(2000, 200)); /* or as long as at first */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_set_point_is_near_the_last_one_and_the_position);
    RUN_TEST(test_set_point_without_counts_is_a_jump);
    RUN_TEST(test_words_tell_a_jump_from_a_lag);
    RUN_TEST(test_silence_is_a_second_at_least_where_somebody_was_heard);
    return UNITY_END();
}

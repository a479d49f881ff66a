/* SPDX-License-Identifier: MIT
 * test_fade.c - fading a sender in: what the share adds to the motion of the cylinders, and how long it takes.
 */
#include <math.h>
#include <stdio.h>

#include "heave/fade.h"
#include "unity.h"

#define ONE    4294967296.0 /* in Q32 */
#define RISE_S 0.064        /* in which the acceleration is there */

static uint64_t m_random;

static double unit(void)
{
    m_random = m_random * 6364136223846793005u + 1442695040888963407u;
    return (double)(m_random >> 11) / 9007199254740992.0;
}

void setUp(void)
{
    m_random = 20261129;
}

void tearDown(void) {}

/* What fading did. Speeds in units of the limits. */
typedef struct {
    double speed, accel;
    long cycles;
    bool is_monotone;
} seen_t;

static const q32_t k_from[POSE_AXES];

/* Travel of the cylinder in a cycle. mm */
typedef double travel_t(long cycle, double mm);

static double even(long cycle, double mm)
{
    (void)cycle;
    return mm;
}

/* A sender that rides, +-40 % at 0.5 Hz. */
static double riding(long cycle, double mm)
{
    return mm * (1 + 0.4 * sin(cycle * 0.001 * 3.14159));
}

/* One that goes twice as far within a tenth of a second. */
static double leaping(long cycle, double mm)
{
    return cycle < 500 ? mm : cycle > 600 ? 2 * mm : mm * (1 + (cycle - 500) / 100.0);
}

static seen_t run(const fade_limits_t *limits, int64_t least, double mm, travel_t *travel)
{
    fade_t fade;
    seen_t seen = {.is_monotone = true};
    bool goes_on = true;
    fade_begin(&fade, k_from, least);
    while (goes_on && seen.cycles < 100000) {
        const int64_t *at = fade.share_q46;
        const double here_mm = travel(seen.cycles, mm);
        ramp_ref_t ref[POSE_AXES] = {{.pos_q32 = 0}};
        ref[0].pos_q32 = (q32_t)(here_mm * ONE);
        goes_on = fade_step(&fade, limits, ref[0].pos_q32, ref);
        const double step = (double)(at[0] - at[1]) / (double)FADE_FULL * here_mm * ONE;
        const double bend = (double)(at[0] - 2 * at[1] + at[2]) / (double)FADE_FULL * here_mm * ONE;
        seen.speed = fmax(seen.speed, step / (double)limits->vel_q32);
        seen.accel = fmax(seen.accel, fabs(bend) / (double)limits->acc_q32);
        seen.is_monotone = seen.is_monotone && at[0] >= at[1] && at[0] <= FADE_FULL;
        seen.cycles++;
    }
    TEST_ASSERT_FALSE(goes_on);
    TEST_ASSERT_TRUE(seen.is_monotone);
    TEST_ASSERT_TRUE(seen.speed <= 1.0001);
    return seen;
}

/* Limits as they come from a configuration. */
static fade_limits_t limits_of(double speed, double accel, double cycle_s)
{
    return (fade_limits_t){(q32_t)(speed * cycle_s * ONE), (q32_t)(accel * cycle_s * cycle_s * ONE),
                           (q32_t)(accel / RISE_S * cycle_s * cycle_s * cycle_s * ONE)};
}

/* The shortest time from rest to rest, with any jerk. */
static double least_s(double speed, double accel, double mm)
{
    return mm > speed * speed / accel ? mm / speed + speed / accel : 2 * sqrt(mm / accel);
}

static void test_keeps_the_limits_and_is_as_quick_as_they_allow(void)
{
    double accel = 0, longer = 0;
    for (unsigned i = 0; i < 3000; i++) {
        static const double k_cycles_s[] = {0.0005, 0.001, 0.002, 0.004, 0.01};
        const double cycle_s = k_cycles_s[i % 5];
        const double v = 5 * pow(60, unit()), a = 20 * pow(50, unit()), mm = 0.5 * pow(300, unit());
        const fade_limits_t limits = limits_of(v, a, cycle_s);
        const seen_t seen = run(&limits, 0, mm, even);
        const double quickest_s = fmax(least_s(v, a, mm), (FADE_CYCLES_MIN + 4) * cycle_s);
        accel = fmax(accel, seen.accel);
        longer = fmax(longer, (double)seen.cycles * cycle_s - quickest_s);
    }
    printf("fading: acceleration %.4f of the limit, %.0f ms longer than without a limit of the jerk\n", accel, 1000 * longer);
    TEST_ASSERT_TRUE(accel <= 1.01);
    TEST_ASSERT_TRUE(longer <= 2.5 * RISE_S);
}

/* Whatever somebody configures, and wherever a sender leads, fading ends. */
static void test_ends_with_any_limits(void)
{
    static const double k_speeds[] = {0.001, 1, 500, 10000};
    static const double k_accels[] = {0.01, 1, 1000, 30000};
    for (unsigned i = 0; i < 16; i++) {
        const double v = k_speeds[i % 4], a = k_accels[i / 4];
        const fade_limits_t limits = limits_of(v, a, 0.0005);
        for (double mm = 0; mm < 1e5; mm = 30 * mm + 0.01) {
            fade_t fade;
            bool goes_on = true;
            fade_begin(&fade, k_from, 0);
            for (long cycle = 0; cycle < 3000 && goes_on; cycle++) {
                ramp_ref_t ref[POSE_AXES] = {{.pos_q32 = 0}};
                goes_on = fade_step(&fade, &limits, (q32_t)(mm * ONE), ref);
            }
            TEST_ASSERT_TRUE(!goes_on || fade.share_q46[0] > 0);
        }
    }
}

static void test_takes_the_time_that_it_is_given(void)
{
    const fade_limits_t limits = limits_of(40, 100, 0.001);
    for (int64_t least = FADE_CYCLES_MIN; least <= FADE_CYCLES_MAX; least = least * 3 / 2) {
        const seen_t seen = run(&limits, least, 0.001, even);
        TEST_ASSERT_INT_WITHIN(least / 20 + 8, least, seen.cycles);
    }
}

/* Cycles beyond what a share can be made of are as many as it can. */
static void test_time_is_within_what_a_share_can_take(void)
{
    fade_t fade;
    fade_begin(&fade, k_from, UINT32_MAX);
    TEST_ASSERT_EQUAL_UINT32(FADE_CYCLES_MAX, fade.least_cycles);
    fade_begin(&fade, k_from, 0);
    TEST_ASSERT_EQUAL_UINT32(FADE_CYCLES_MIN, fade.least_cycles);
}

static void test_tells_how_long_a_plan_takes(void)
{
    const fade_limits_t limits = limits_of(40, 100, 0.001);
    for (double mm = 0.1; mm < 300; mm *= 1.3) {
        fade_t fade;
        fade_begin(&fade, k_from, 500);
        fade.plan_travel_mm_q32 = (q32_t)(mm * ONE);
        const seen_t seen = run(&limits, 500, mm, even);
        TEST_ASSERT_INT_WITHIN(seen.cycles / 20 + 8, seen.cycles, fade_cycles(&fade, &limits));
    }
}

/* The cylinders are never quicker by it. Its acceleration is larger only where the travel grows while it ends. */
static void test_travel_that_grows_makes_it_slower_at_once(void)
{
    const fade_limits_t limits = limits_of(40, 100, 0.001);
    double ridden = 0, leapt = 0;
    for (double mm = 1; mm < 300; mm *= 1.1) {
        ridden = fmax(ridden, run(&limits, 2000, mm, riding).accel);
        leapt = fmax(leapt, run(&limits, 0, mm, leaping).accel);
    }
    printf("fading: acceleration %.2f of the limit while the travel changes, %.1f where it leaps\n", ridden, leapt);
    TEST_ASSERT_TRUE(ridden < 1.8 && leapt < 5.5);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_keeps_the_limits_and_is_as_quick_as_they_allow);
    RUN_TEST(test_ends_with_any_limits);
    RUN_TEST(test_takes_the_time_that_it_is_given);
    RUN_TEST(test_time_is_within_what_a_share_can_take);
    RUN_TEST(test_tells_how_long_a_plan_takes);
    RUN_TEST(test_travel_that_grows_makes_it_slower_at_once);
    return UNITY_END();
}

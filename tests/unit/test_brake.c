/* SPDX-License-Identifier: MIT
 * test_brake.c - what brake.h says in closed form, against brakes walked cycle by cycle.
 */
#include "../../src/motion/brake.h"

#include "random.h"
#include "unity.h"

enum { STATES = 20000 };

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

/* From -limit to limit. */
static q32_t random_within(q32_t limit_q32)
{
    return (q32_t)(random_bits() % (2 * (uint64_t)limit_q32 + 1)) - limit_q32;
}

static ramp_t ramp_of(q32_t vel_q32, q32_t acc_q32, q32_t jerk_q32)
{
    const ramp_limits_t limits = {.pos_min_q32 = -((q32_t)1 << 56),
                                  .pos_max_q32 = (q32_t)1 << 56,
                                  .vel_per_cycle_q32 = vel_q32,
                                  .acc_per_cycle2_q32 = acc_q32,
                                  .jerk_per_cycle3_q32 = jerk_q32};
    ramp_t ramp;
    TEST_ASSERT_EQUAL(HV_OK, ramp_init(&ramp, &limits, 0));
    return ramp;
}

/* From little jerk, where a brake is long, to so much that one cycle is enough. */
static ramp_t nth_ramp(unsigned n)
{
    const q32_t jerk_q32 = (q32_t)64 << 4 * (n % 10);
    return ramp_of(jerk_q32 * 2000, jerk_q32 * (1 + n % 37), jerk_q32);
}

/* Full jerk downwards until -acc_safe, from here to where it has turned. */
static q32_t walk_peak(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32)
{
    q32_t pos_q32 = 0, peak_q32 = 0;
    while (vel_q32 > 0 || acc_q32 > 0) {
        const q32_t next_q32 = acc_q32 - ramp->limits.jerk_per_cycle3_q32;
        acc_q32 = next_q32 > -ramp->acc_safe_q32 ? next_q32 : -ramp->acc_safe_q32;
        vel_q32 += acc_q32;
        pos_q32 += vel_q32;
        peak_q32 = pos_q32 > peak_q32 ? pos_q32 : peak_q32;
    }
    return peak_q32;
}

static void test_brake_peak_any_state_is_that_of_the_brake_walked(void)
{
    for (unsigned n = 0; n < STATES; n++) {
        const ramp_t ramp = nth_ramp(n);
        const q32_t vel_q32 = random_within(n % 2 == 0 ? ramp.limits.vel_per_cycle_q32 : 8 * ramp.limits.jerk_per_cycle3_q32);
        const q32_t acc_q32 = random_within(ramp.acc_safe_q32);
        TEST_ASSERT_EQUAL_INT64(walk_peak(&ramp, vel_q32, acc_q32), brake_peak(&ramp, vel_q32, acc_q32));
    }
}

static void test_brake_peak_what_falls_for_good_does_not_rise(void)
{
    const ramp_t ramp = nth_ramp(30); /* 31 cycles of jerk are the acceleration limit */
    const q32_t jerk_q32 = ramp.limits.jerk_per_cycle3_q32;
    TEST_ASSERT_EQUAL_INT64(0, brake_peak(&ramp, 0, 0));
    TEST_ASSERT_EQUAL_INT64(0, brake_peak(&ramp, -1, 0));
    TEST_ASSERT_EQUAL_INT64(0, brake_peak(&ramp, 0, -jerk_q32));
    TEST_ASSERT_EQUAL_INT64(0, brake_peak(&ramp, -2000 * jerk_q32, 30 * jerk_q32));
}

/* The acceleration left lasts for just as much as the fall: cycle by cycle it does not rise, but where a bit more is left. */
static void test_brake_peak_fall_that_is_just_taken_back_does_not_rise(void)
{
    const ramp_t ramp = nth_ramp(36);
    const q32_t jerk_q32 = ramp.limits.jerk_per_cycle3_q32;
    for (int64_t n = 1; n < 30; n++) {
        const q32_t gain_q32 = jerk_q32 * (n * (n - 1) / 2);
        TEST_ASSERT_EQUAL_INT64(0, brake_peak(&ramp, -gain_q32 - 1, n * jerk_q32));
        TEST_ASSERT_EQUAL_INT64(0, brake_peak(&ramp, -gain_q32, n * jerk_q32));
        TEST_ASSERT_EQUAL_INT64(walk_peak(&ramp, 1 - gain_q32, n * jerk_q32), brake_peak(&ramp, 1 - gain_q32, n * jerk_q32));
    }
}

/* The largest acceleration from which the room is kept: one more would not. */
static void check_room(const ramp_t *ramp, q32_t room_q32)
{
    const q32_t acc_q32 = brake_acc_for_velocity_room(ramp, room_q32);
    TEST_ASSERT_TRUE(brake_velocity_peak(ramp, acc_q32, acc_q32) <= room_q32);
    TEST_ASSERT_TRUE(brake_velocity_peak(ramp, acc_q32 + 1, acc_q32 + 1) > room_q32);
}

static void test_brake_acc_for_velocity_room_is_the_largest(void)
{
    for (unsigned n = 0; n < STATES; n++) {
        const ramp_t ramp = nth_ramp(n);
        const q32_t jerk_q32 = ramp.limits.jerk_per_cycle3_q32;
        const int64_t cycles = n % 50;
        check_room(&ramp, jerk_q32 * 1000 + random_within(jerk_q32 * 1000));
        for (q32_t more_q32 = cycles == 0 ? 0 : -1; more_q32 <= 1; more_q32++) {
            check_room(&ramp, jerk_q32 * (cycles * (cycles + 1) / 2) + more_q32); /* the room of whole cycles, to the bit */
        }
    }
}

/* So much jerk that a bit less room than whole cycles take is rounded to those. */
static void test_brake_acc_for_velocity_room_of_a_jerk_beyond_all_platforms_is_the_largest(void)
{
    const q32_t jerk_q32 = (q32_t)1 << 42;
    const ramp_t ramp = ramp_of(64 * jerk_q32, 4 * jerk_q32, jerk_q32);
    TEST_ASSERT_EQUAL_INT64(jerk_q32, ramp.limits.jerk_per_cycle3_q32);
    for (int64_t cycles = 1; cycles < 8; cycles++) {
        for (q32_t less_q32 = 0; less_q32 < 100; less_q32++) {
            check_room(&ramp, jerk_q32 * (cycles * (cycles + 1) / 2) - less_q32);
        }
    }
}

/* ---- brakes too long to reckon with ---- */

/* Cycles that do not fit: taken for few, they would lead the ramp past its bound. */
static void test_ramp_with_brakes_of_more_cycles_than_it_counts_stops_on_its_bound(void)
{
    const q32_t acc_q32 = 16, bound_q32 = (q32_t)1 << 24;
    const ramp_limits_t limits = {.pos_max_q32 = bound_q32,
                                  .vel_per_cycle_q32 = (q32_t)1 << 38,
                                  .acc_per_cycle2_q32 = acc_q32,
                                  .jerk_per_cycle3_q32 = (q32_t)1 << 12};
    const ramp_ref_t beyond = {.pos_q32 = 2 * bound_q32};
    ramp_t ramp;
    TEST_ASSERT_EQUAL(HV_OK, ramp_init(&ramp, &limits, 0));
    TEST_ASSERT_EQUAL_UINT32(0, ramp.brake_cycles);
    for (unsigned cycle = 0; cycle < 5000; cycle++) {
        TEST_ASSERT_TRUE(ramp_step(&ramp, &beyond, RAMP_FIRM) <= bound_q32);
        TEST_ASSERT_INT64_WITHIN(acc_q32, 0, ramp.state.acc_per_cycle2_q32);
    }
    TEST_ASSERT_EQUAL_INT64(bound_q32, ramp.state.pos_q32);
    TEST_ASSERT_TRUE(ramp_is_at_rest(&ramp));
}

static void test_ramp_with_brakes_of_a_way_beyond_all_numbers_does_not_reckon_with_them(void)
{
    const q32_t jerk_q32 = (q32_t)1 << 16;
    TEST_ASSERT_EQUAL_UINT32(0, ramp_of((q32_t)1 << 42, (q32_t)1 << 12, jerk_q32).brake_cycles);
    TEST_ASSERT_TRUE(ramp_of((q32_t)1 << 34, (q32_t)1 << 17, jerk_q32).brake_cycles > 1u << 16);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_brake_peak_any_state_is_that_of_the_brake_walked);
    RUN_TEST(test_brake_peak_what_falls_for_good_does_not_rise);
    RUN_TEST(test_brake_peak_fall_that_is_just_taken_back_does_not_rise);
    RUN_TEST(test_brake_acc_for_velocity_room_is_the_largest);
    RUN_TEST(test_brake_acc_for_velocity_room_of_a_jerk_beyond_all_platforms_is_the_largest);
    RUN_TEST(test_ramp_with_brakes_of_more_cycles_than_it_counts_stops_on_its_bound);
    RUN_TEST(test_ramp_with_brakes_of_a_way_beyond_all_numbers_does_not_reckon_with_them);
    return UNITY_END();
}

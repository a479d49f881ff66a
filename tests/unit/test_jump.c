/* SPDX-License-Identifier: MIT
 * test_jump.c - streams that jump, seen at the drives: how long the platform takes, that it goes straight and no further than
 * what was sent, and that what is no jump is none. Limits are judged by the rig in every cycle of every test.
 */
#include <math.h>
#include <stdio.h>

#include "random.h"
#include "rig.h"
#include "unity.h"

static rig_t m_rig;
static rig_t m_ready; /* following, at neutral, nothing moving */
static bool m_is_ready;

void setUp(void)
{
    random_begin(RANDOM_SEED);
    if (!m_is_ready) {
        settings_t settings = rig_hexapod();
        settings.spike_gate = 10;
        rig_start(&m_rig, &settings, true);
        m_rig.is_auto_checking = true;
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        rig_send(&m_rig, "@A6:0,0,0,0,0,0#");
        rig_run_ms(&m_rig, 3000);
        m_ready = m_rig;
        m_is_ready = true;
    }
    m_rig = m_ready; /* at the same address, so that what points into it stays right */
}

void tearDown(void)
{
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    TEST_ASSERT_EQUAL(FAULT_NONE, m_rig.gateway.snapshot.fault.code);
}

static const double k_aside[POSE_AXES] = {0, 0.6, 0, 5, 0, 3}; /* direction of the jumps */

/* A frame at so many times k_aside, beside a ride of so many times that of the test. */
static void send_at(double times, double ride, double t_s)
{
    rig_sendf(&m_rig, "@A6:%.4f,%.4f,%.4f,%.4f,%.4f,%.4f#", ride * sin(1.9 * t_s), times * k_aside[1], ride * cos(1.3 * t_s),
              times * k_aside[3], 5 * ride * sin(2.3 * t_s), times * k_aside[5]);
}

/* Where it is, in k_aside, and how far beside the straight line. mm */
static double along(double *beside_mm)
{
    const double times = rig_pose(&m_rig, AXIS_X) / k_aside[3];
    *beside_mm =
        fabs(rig_pose(&m_rig, AXIS_Z) - times * k_aside[5]) + 10 * fabs(rig_pose(&m_rig, AXIS_PITCH) - times * k_aside[1]);
    return times;
}

/* What a stream made of a jump. */
typedef struct {
    unsigned there_ms; /**< 98 % of it for good */
    double low, high;  /**< range of along() */
    double beside_mm;
    unsigned jumping; /**< cycles in which a jump was made */
} made_t;

/* 60 Hz: half a second at 0, then what the jump is after so many ms. */
static made_t run(double (*jump)(unsigned ms, double size), double size, double ride, unsigned ms)
{
    made_t made = {.low = 1e9, .high = -1e9};
    double t_s = 0;
    for (unsigned t = 0; t < 2000; t++, t_s += 0.001) {
        if (t % 50 % 17 == 0) {
            send_at(0, ride, t_s);
        }
        rig_run_ms(&m_rig, 1);
    }
    for (unsigned t = 0; t < ms; t++, t_s += 0.001) {
        double beside_mm;
        if (t % 50 % 17 == 0) {
            send_at(jump(t, size), ride, t_s);
        }
        rig_run_ms(&m_rig, 1);
        const double times = along(&beside_mm);
        made.jumping += m_rig.gateway.motion.is_jumping;
        made.low = fmin(made.low, times);
        made.high = fmax(made.high, times);
        made.beside_mm = fmax(made.beside_mm, beside_mm);
        made.there_ms = fabs(times - jump(ms, size)) > 0.02 * fabs(size) ? t : made.there_ms;
    }
    return made;
}

static double once(unsigned ms, double size)
{
    (void)ms;
    return size;
}

/* A lone step of the same size from rest: the shortest time along the straight line. */
static unsigned step_ms(double size)
{
    unsigned there_ms = 0;
    m_rig = m_ready;
    send_at(size, 0, 0);
    for (unsigned t = 0; t < 2000; t++) {
        double beside_mm;
        rig_run_ms(&m_rig, 1);
        there_ms = fabs(along(&beside_mm) - size) > 0.02 * fabs(size) ? t : there_ms;
    }
    m_rig = m_ready;
    return there_ms;
}

static void test_is_made_hardly_slower_than_a_lone_step(void)
{
    double longest = 0;
    for (double size = -12; size <= 12; size += 3) {
        if (size == 0) {
            continue;
        }
        const unsigned least_ms = step_ms(size);
        const made_t made = run(once, size, 0, 2500);
        longest = fmax(longest, (double)made.there_ms - least_ms);
        TEST_ASSERT_TRUE(made.there_ms <= least_ms * 9 / 8 + 30);
        TEST_ASSERT_TRUE(made.beside_mm < 0.01);
        TEST_ASSERT_TRUE(made.low >= fmin(0, size) - 1e-5 && made.high <= fmax(0, size) + 1e-5);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, size, along(&(double){0}));
    }
    printf("jumps: 98 %% at most %.0f ms later than a lone step\n", longest);
}

static void test_in_a_ride_leaves_the_ride_as_it_is(void)
{
    for (int i = 0; i < 12; i++) {
        m_rig = m_ready;
        const double size = (i % 2 == 0 ? 1 : -1) * (4 + i / 2);
        const made_t made = run(once, size, 2, 600 + 130 * (unsigned)i);
        TEST_ASSERT_TRUE(made.there_ms < 600);
        TEST_ASSERT_TRUE(made.beside_mm < 0.1);
        TEST_ASSERT_TRUE(made.low >= fmin(0, size) - 0.01 && made.high <= fmax(0, size) + 0.01);
    }
}

static double for_a_moment(unsigned ms, double size)
{
    return ms < 150 ? size : 0;
}

static void test_to_and_fro_goes_no_further_and_ends_where_it_began(void)
{
    for (double size = 3; size <= 12; size += 3) {
        m_rig = m_ready;
        const made_t made = run(for_a_moment, size, 0, 2000);
        TEST_ASSERT_TRUE(made.low >= -1e-5 && made.high <= size && made.high > 0.2 * size);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0, along(&(double){0}));
    }
}

static double stairs(unsigned ms, double size)
{
    return size * fmin(8, 1 + ms / 50);
}

static double slow_stairs(unsigned ms, double size)
{
    return size * fmin(5, 1 + ms / 400);
}

static void test_more_of_them_than_can_be_made_go_no_further_than_the_last(void)
{
    for (double size = -1.5; size <= 1.5; size += 0.3) {
        m_rig = m_ready;
        const made_t made = run(stairs, size, 0, 3000);
        TEST_ASSERT_TRUE(fmax(fabs(made.low), fabs(made.high)) <= 8 * fabs(size) * 1.02);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 8 * size, along(&(double){0}));
        m_rig = m_ready;
        const made_t slow = run(slow_stairs, size, 0, 4000);
        TEST_ASSERT_TRUE(fmax(fabs(slow.low), fabs(slow.high)) <= 5 * fabs(size) * 1.001);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 5 * size, along(&(double){0}));
    }
}

static double noise(unsigned ms, double size)
{
    (void)ms;
    return size * (2 * random_unit() - 1);
}

/* That would be a chase at all of the limits. */
static void test_noise_is_no_series_of_jumps(void)
{
    for (double size = 1; size <= 10; size += 1.5) {
        m_rig = m_ready;
        const made_t made = run(noise, size, 0, 3000);
        TEST_ASSERT_TRUE(made.jumping < 700); /* of 3000 */
    }
}

static void test_followed_by_silence_is_made(void)
{
    for (double size = 3; size <= 12; size += 3) {
        m_rig = m_ready;
        (void)run(once, 0, 0, 500);
        send_at(size, 0, 0);
        rig_run_ms(&m_rig, 700);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, size, along(&(double){0}));
    }
}

/* Whatever comes while one is made: the limits are kept, and the end is that of the last command. */
static void test_anything_may_follow_at_any_moment(void)
{
    for (unsigned i = 0; i < 60; i++) {
        m_rig = m_ready;
        const double size = 3 + 9 * random_unit();
        (void)run(once, size, 2 * random_unit(), (unsigned)(600 * random_unit()));
        if (i % 3 == 0) {
            rig_send(&m_rig, "@A6T:0,0,0,-20,0,10,700#");
            rig_run_ms(&m_rig, 2500);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, -20, rig_pose(&m_rig, AXIS_X));
        } else if (i % 3 == 1) {
            TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
            rig_run_ms(&m_rig, 1000);
            TEST_ASSERT_TRUE(motion_is_at_rest(&m_rig.gateway.motion));
        } else {
            rig_send(&m_rig, "@C6:110,95,105,100,90,115#");
            rig_run_ms(&m_rig, 2500);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, 110, rig_cylinder_mm(&m_rig, 1));
        }
        tearDown();
    }
}

static void test_with_intensity_is_as_much_smaller(void)
{
    m_rig = m_ready;
    TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, 40));
    rig_run_ms(&m_rig, 3000);
    const made_t made = run(once, 10, 0, 1500);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 4, along(&(double){0}));
    TEST_ASSERT_TRUE(made.low >= -1e-5 && made.high <= 4 + 1e-5);
    TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, 100)); /* and while one is made */
    const made_t back = run(once, -10, 0, 4000);
    TEST_ASSERT_TRUE(back.low >= -10 - 1e-5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, -10, along(&(double){0}));
}

static void test_at_intensity_0_nothing_moves_and_the_jump_is_kept(void)
{
    m_rig = m_ready;
    TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, 0));
    rig_run_ms(&m_rig, 3000);
    const made_t made = run(once, 10, 0, 1500);
    TEST_ASSERT_TRUE(made.low == 0 && made.high == 0);
    TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, 1));
    (void)run(for_a_moment, -10, 0, 400); /* while hardly anything of it shows */
    TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, 100));
    (void)run(once, 10, 0, 4000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 10, along(&(double){0}));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_is_made_hardly_slower_than_a_lone_step);
    RUN_TEST(test_in_a_ride_leaves_the_ride_as_it_is);
    RUN_TEST(test_to_and_fro_goes_no_further_and_ends_where_it_began);
    RUN_TEST(test_more_of_them_than_can_be_made_go_no_further_than_the_last);
    RUN_TEST(test_noise_is_no_series_of_jumps);
    RUN_TEST(test_followed_by_silence_is_made);
    RUN_TEST(test_anything_may_follow_at_any_moment);
    RUN_TEST(test_with_intensity_is_as_much_smaller);
    RUN_TEST(test_at_intensity_0_nothing_moves_and_the_jump_is_kept);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_stream_sample.c - what a frame of a stream is: the next sample, a repetition, a frozen value, an old one.
 */
#include "../../src/stream/stream_sample.h"

#include <math.h>

#include "../../src/stream/stream_points.h"
#include "unity.h"

#define PERIOD_US 16667u

static stream_t m_stream;
static uint64_t m_now_us; /* the newest frame that came in time */
static unsigned m_at;     /* whose value that was */

static q32_t q32(double value)
{
    return (q32_t)llround(value * 65536.0) * 65536;
}

/* Value of each axis at a time, in periods: it never comes back to where it was. */
static void values_at(double at, q32_t *value_q32)
{
    value_q32[0] = q32(0.7 * at);
    value_q32[1] = q32(20 * sin(0.05 * at));
}

static stream_sample_kind_t kind_of(double at, double after_periods)
{
    q32_t value_q32[AXES_MAX] = {0};
    stream_t seen = m_stream; /* asking changes nothing here */
    values_at(at, value_q32);
    return stream_sample_kind(&seen, m_now_us + (uint64_t)(after_periods * PERIOD_US), value_q32);
}

/* A frame so long after the newest one in time, and the cycles up to it. */
static void push(double at, double after_periods)
{
    q32_t value_q32[AXES_MAX] = {0};
    ramp_ref_t ref[AXES_MAX];
    const uint64_t arrives_us = m_now_us + (uint64_t)(after_periods * PERIOD_US);
    values_at(at, value_q32);
    stream_push(&m_stream, arrives_us, NULL, value_q32);
    (void)stream_step(&m_stream, arrives_us, NULL, ref);
}

/* The next frame in time, with the value of another time. */
static void frame_with(unsigned at)
{
    push(at, 1);
    m_now_us += PERIOD_US;
    m_at++;
}

static void frames(unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        frame_with(m_at + 1);
    }
}

void setUp(void)
{
    const governor_limits_t limits = {
        .vel_per_cycle_q32 = q32(0.5), .acc_per_cycle2_q32 = q32(0.01), .jerk_per_cycle3_q32 = q32(0.001)};
    stream_init(&m_stream, 1000, 2, STREAM_SMOOTH);
    for (unsigned axis = 0; axis < 2; axis++) {
        stream_set_limits(&m_stream, axis, &limits);
    }
    m_now_us = 1000000;
    m_at = 0;
    frames(60);
}

void tearDown(void) {}

static void test_the_newest_values_again_are_a_repetition_if_they_come_too_soon(void)
{
    for (double after = 0; after < 0.6; after += 0.1) {
        TEST_ASSERT_EQUAL(STREAM_SAMPLE_NONE, kind_of(m_at, after));
    }
    TEST_ASSERT_EQUAL(STREAM_SAMPLE_NEXT, kind_of(m_at, 1)); /* the sender stands */
    TEST_ASSERT_EQUAL(STREAM_SAMPLE_NEXT, kind_of(m_at + 1, 1));
}

/* A value that stands for some frames and is then where it is when: that is learnt with the first time, and unlearnt if it only
 * goes on from where it stood. */
static void test_values_freeze_if_they_catch_up(void)
{
    for (unsigned n = 1; n <= STREAM_STOOD_MAX; n++) {
        setUp();
        const unsigned before = m_at;
        for (unsigned i = 0; i < n; i++) {
            TEST_ASSERT_EQUAL(STREAM_SAMPLE_NEXT, kind_of(before, 1));
            frame_with(before);
        }
        frames(4);
        TEST_ASSERT_EQUAL_UINT(1, m_stream.sample.caught);
        const unsigned again = m_at;
        for (unsigned i = 0; i < STREAM_STOOD_MAX; i++) {
            TEST_ASSERT_EQUAL(STREAM_SAMPLE_NONE, kind_of(again, 1));
            frame_with(again);
        }
        TEST_ASSERT_EQUAL(STREAM_SAMPLE_NEXT, kind_of(again, 1)); /* now it stands */
    }
}

static void test_values_that_go_on_from_where_they_stood_did_not_freeze(void)
{
    for (unsigned round = 0; round < 3; round++) {
        const unsigned before = m_at;
        frame_with(before);
        m_at = before;
        frames(6);
    }
    TEST_ASSERT_EQUAL_UINT(0, m_stream.sample.caught);
    const unsigned before = m_at;
    frame_with(before);
    frames(6);
    TEST_ASSERT_EQUAL_UINT(1, m_stream.sample.caught);
    const unsigned again = m_at;
    frame_with(again);
    m_at = again;
    frames(6);
    TEST_ASSERT_EQUAL_UINT(0, m_stream.sample.caught);
}

/* A loop that sends each value two or three times makes one step in the time of as many frames. */
static void test_repeated_values_are_not_frozen(void)
{
    for (unsigned each = 2; each <= 3; each++) {
        setUp();
        unsigned at = m_at;
        for (unsigned i = 0; i < 60; i++) {
            at += i % each == 0 ? each : 0;
            frame_with(at);
            TEST_ASSERT_EQUAL_UINT(0, m_stream.sample.caught);
        }
        TEST_ASSERT_EQUAL_UINT(each, m_stream.repeat.each);
    }
}

static void test_an_old_frame_that_comes_between_two_is_none(void)
{
    for (unsigned back = 1; back <= 4; back++) {
        for (double after = 0.05; after < 0.6; after += 0.1) {
            TEST_ASSERT_EQUAL(STREAM_SAMPLE_NONE, kind_of(m_at - back, after));
        }
    }
}

/* Of a lost one too: it comes out of order. */
static void test_a_frame_that_was_overtaken_is_none(void)
{
    m_now_us += PERIOD_US;
    m_at++;
    const unsigned lost = m_at;
    frames(1);
    TEST_ASSERT_EQUAL(STREAM_SAMPLE_NONE, kind_of(lost, 0.2));
    frames(2);
    TEST_ASSERT_EQUAL(STREAM_SAMPLE_NONE, kind_of(lost, 0.2));
}

/* It is followed if no other comes, and has not been there if one does. */
static void test_an_old_frame_that_comes_when_the_next_is_due_is_in_doubt(void)
{
    for (double after = 0.7; after < 1.15; after += 0.1) {
        setUp();
        TEST_ASSERT_EQUAL(STREAM_SAMPLE_DOUBTFUL, kind_of(m_at - 2, after));
        push(m_at - 2, after);
        TEST_ASSERT_EQUAL(STREAM_SAMPLE_INSTEAD, kind_of(m_at + 1, after + 0.1));
        push(m_at + 1, after + 0.1);
        const stream_t other = m_stream;
        setUp();
        push(m_at + 1, after + 0.1);
        TEST_ASSERT_EQUAL_INT64(m_stream.curve.newest_q32[0], other.curve.newest_q32[0]);
        TEST_ASSERT_EQUAL_UINT32(stream_points_newest(&m_stream.curve), stream_points_newest(&other.curve));
        TEST_ASSERT_EQUAL_UINT(m_stream.evidence.count, other.evidence.count);
        for (unsigned i = 0; i < STREAM_EVIDENCE; i++) {
            TEST_ASSERT_EQUAL_INT64(m_stream.evidence.value_q32[i][1], other.evidence.value_q32[i][1]);
            TEST_ASSERT_EQUAL_INT32(m_stream.evidence.index[i], other.evidence.index[i]);
        }
    }
    setUp();
    const unsigned before = m_at;
    for (unsigned back = 2; back < 20; back++) { /* a jump back, and on from there: followed all the way */
        push(before - 3 + 0.1 * back, 1);
        m_now_us += PERIOD_US;
        TEST_ASSERT_EQUAL_INT64(q32(0.7 * (before - 3 + 0.1 * back)), m_stream.curve.newest_q32[0]);
    }
}

static void test_a_turn_is_no_old_frame(void)
{
    const unsigned top = m_at;
    for (unsigned i = 1; i < 40; i++) { /* back the same way: the values have all been there */
        TEST_ASSERT_NOT_EQUAL(STREAM_SAMPLE_NONE, kind_of(top - i, 1));
        push(top - i, 1);
        m_now_us += PERIOD_US;
        TEST_ASSERT_EQUAL_INT64(q32(0.7 * (top - i)), m_stream.curve.newest_q32[0]);
    }
}

static void test_frames_half_way_tell_twice_the_rate_with_the_fourth(void)
{
    for (unsigned i = 1; i <= 4; i++) {
        TEST_ASSERT_EQUAL(i < 4 ? STREAM_SAMPLE_NONE : STREAM_SAMPLE_OTHER_RATE, kind_of(m_at + 0.5, 0.5));
        push(m_at + 0.5, 0.5);
        if (i < 4) {
            frames(1);
        }
    }
    TEST_ASSERT_UINT32_WITHIN(PERIOD_US / 100, PERIOD_US / 2, stream_period_us(&m_stream));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_newest_values_again_are_a_repetition_if_they_come_too_soon);
    RUN_TEST(test_values_freeze_if_they_catch_up);
    RUN_TEST(test_values_that_go_on_from_where_they_stood_did_not_freeze);
    RUN_TEST(test_repeated_values_are_not_frozen);
    RUN_TEST(test_an_old_frame_that_comes_between_two_is_none);
    RUN_TEST(test_a_frame_that_was_overtaken_is_none);
    RUN_TEST(test_an_old_frame_that_comes_when_the_next_is_due_is_in_doubt);
    RUN_TEST(test_a_turn_is_no_old_frame);
    RUN_TEST(test_frames_half_way_tell_twice_the_rate_with_the_fourth);
    return UNITY_END();
}

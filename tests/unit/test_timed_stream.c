/* SPDX-License-Identifier: MIT
 * test_timed_stream.c - streams of T frames whose time is their period, seen at the drives: speed on constant-rate ramps, late
 * and lost frames, beginnings and ends; and what is no stream. Limits are judged by the rig in every cycle of every test.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "random.h"
#include "rig.h"
#include "unity.h"

#define LONGEST_MS 9000

static rig_t m_rig;
static rig_t m_ready; /* following, at neutral, nothing moving */
static bool m_is_ready;
static double m_z[LONGEST_MS + 1]; /* after each ms */

static const unsigned k_times_ms[] = {10, 16, 20, 33, 40, 50, 100, 150, 200, 300, 400, 500};
enum { TIMES = sizeof k_times_ms / sizeof k_times_ms[0] };

void setUp(void)
{
    const settings_t settings = rig_hexapod();
    random_begin(RANDOM_SEED);
    if (!m_is_ready) {
        rig_start(&m_rig, &settings, true);
        m_rig.is_auto_checking = true;
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        rig_send(&m_rig, "@A6:0,0,0,0,0,0#");
        rig_run_ms(&m_rig, 1500);
        m_ready = m_rig;
        m_is_ready = true;
    }
    m_rig = m_ready; /* at the same address, so that what points into it stays right */
}

static void check_kept(void)
{
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    TEST_ASSERT_EQUAL(FAULT_NONE, m_rig.gateway.snapshot.fault.code);
    TEST_ASSERT_EQUAL_UINT32(0, m_rig.gateway.snapshot.counters.spikes);
}

void tearDown(void)
{
    check_kept();
}

static bool is_resting(void)
{
    return motion_is_at_rest(&m_rig.gateway.motion);
}

/* ---- a sender ---- */

/* A ramp in z from 0, a frame of time_ms each time_ms; arrivals are in ms since the first one. */
typedef struct {
    const char *format;
    unsigned time_ms;
    double period_ms; /* of the sender; the time it states may be a bit off it */
    double speed, jitter_ms, phase_ms;
    unsigned late;    /* this frame comes late ... */
    double lateness;  /* ... by so many periods */
    unsigned lost;    /* this frame does not come */
    unsigned untimed; /* from this frame on there is no time in them */
    unsigned frames;
} timed_sender_t;

static timed_sender_t sender(unsigned time_ms)
{
    timed_sender_t s = {.format = "@A6T:0,0,0,0,0,%.4f,%u#",
                        .time_ms = time_ms,
                        .period_ms = time_ms,
                        .speed = time_ms > 100 ? 10 : 25,
                        .late = ~0u,
                        .lost = ~0u,
                        .untimed = ~0u};
    s.frames = 2500 / time_ms > 14 ? 2500 / time_ms : 14;
    return s;
}

static double sent_z(const timed_sender_t *s, unsigned frame)
{
    return s->speed * frame * s->period_ms / 1000;
}

/* Sends it all and keeps where the platform was; ends a period after the last frame. Returns the ms. */
static unsigned run(const timed_sender_t *s)
{
    const unsigned total = (unsigned)((s->frames + 1) * s->period_ms) + 10;
    double before = 0, at = s->phase_ms + (s->late == 0 ? s->lateness * s->period_ms : 0);
    unsigned frame = 0;
    m_rig = m_ready;
    TEST_ASSERT_TRUE(total < LONGEST_MS);
    m_z[0] = rig_pose(&m_rig, AXIS_Z);
    for (unsigned t = 0; t < total; t++) {
        while (at <= t && frame < s->frames) {
            if (frame != s->lost) {
                rig_sendf(&m_rig, frame < s->untimed ? s->format : "@A6:0,0,0,0,0,%.4f#", sent_z(s, frame), s->time_ms);
            }
            frame++;
            before = at;
            at = s->phase_ms + frame * s->period_ms + s->jitter_ms * random_unit() +
                 (frame == s->late ? s->lateness * s->period_ms : 0);
            at = at > before ? at : before;
        }
        rig_run_ms(&m_rig, 1);
        m_z[t + 1] = rig_pose(&m_rig, AXIS_Z);
    }
    return total;
}

/* Least speed from one ms to another as a share of the sender's. */
static double least_share(const timed_sender_t *s, unsigned from_ms, unsigned to_ms)
{
    double least = INFINITY;
    for (unsigned t = from_ms; t < to_ms; t++) {
        least = fmin(least, 1000 * (m_z[t + 1] - m_z[t]) / s->speed);
    }
    return least;
}

/* The first ms in which the speed is up to that share of the sender's. */
static unsigned first_at_share(const timed_sender_t *s, double share, unsigned most_ms)
{
    unsigned t = 0;
    while (t < most_ms && 1000 * (m_z[t + 1] - m_z[t]) < share * s->speed) {
        t++;
    }
    return t;
}

/* ---- ramps ---- */

static void test_ramp_constant_rate_keeps_its_speed_from_when_it_is_reached(void)
{
    for (unsigned i = 0; i < TIMES; i++) {
        printf("T %3u ms: least speed", k_times_ms[i]);
        for (unsigned jitter = 0; jitter <= 5; jitter += 5) {
            double worst = 1;
            for (unsigned k = 0; k < 6; k++) {
                timed_sender_t s = sender(k_times_ms[i]);
                s.jitter_ms = jitter;
                s.phase_ms = random_unit() * s.time_ms;
                const unsigned total = run(&s);
                const unsigned reached = first_at_share(&s, 0.9, total);
                TEST_ASSERT_TRUE(reached < 5 * s.time_ms + 200);
                worst = fmin(worst, least_share(&s, reached, total - s.time_ms));
                check_kept();
            }
            printf("  jitter %u ms %.3f", jitter, worst);
            TEST_ASSERT_TRUE(worst >= 0.7); /* of the first 200 ms, where the platform comes out of its first steps */
        }
        printf("\n");
    }
}

/* A program that waits for T and then works is slower than it says; one that rounds T may be quicker. */
static void test_ramp_time_a_bit_off_the_period_keeps_its_speed(void)
{
    static const double k_shares[] = {0.7, 0.9, 0.97, 1.03, 1.1, 1.2, 1.5};
    for (unsigned i = 0; i < TIMES; i++) {
        for (unsigned k = 0; k < sizeof k_shares / sizeof k_shares[0]; k++) {
            timed_sender_t s = sender(k_times_ms[i]);
            s.period_ms = k_shares[k] * s.time_ms;
            const unsigned far = (unsigned)(80000 / s.speed / s.period_ms); /* within the workspace */
            s.frames = s.frames < far ? s.frames : far;
            if (s.frames < 10 || (s.frames + 1) * s.period_ms > LONGEST_MS - 20) {
                continue;
            }
            const unsigned total = run(&s);
            const unsigned reached = first_at_share(&s, 0.9, total);
            const double least = least_share(&s, reached, total - (unsigned)s.period_ms);
            TEST_ASSERT_TRUE(least >= 0.5 || k_shares[k] > 1.2);
            TEST_ASSERT_TRUE(least >= -0.1); /* first steps of 75 ms, between which it comes to rest */
            check_kept();
        }
    }
}

static void test_ramp_late_and_lost_frames_do_not_stop_it(void)
{
    static const double k_lateness[] = {0.5, 1, 0};
    for (unsigned i = 0; i < TIMES; i++) {
        printf("T %3u ms: least speed, late by half a period, by one, lost:", k_times_ms[i]);
        for (unsigned k = 0; k < 3; k++) {
            double worst = 1;
            for (unsigned jitter = 0; jitter <= 5; jitter += 5) {
                timed_sender_t s = sender(k_times_ms[i]);
                s.jitter_ms = jitter;
                s.lateness = k_lateness[k];
                *(k < 2 ? &s.late : &s.lost) = s.frames - 5;
                const unsigned total = run(&s);
                worst = fmin(worst, least_share(&s, 6 * s.time_ms + 200, total - s.time_ms));
                check_kept();
            }
            printf(" %.2f", worst);
            TEST_ASSERT_TRUE(worst >= 0.33);
            TEST_ASSERT_TRUE(k_times_ms[i] > 50 || worst >= 0.7);
        }
        printf("\n");
    }
}

/* From rest to the sender's speed, and then no slower; where T is long enough to be believed before the period is measured. */
static void test_ramp_begins_without_a_dip_however_late_its_first_frames_are(void)
{
    for (unsigned i = 0; i < 200; i++) {
        timed_sender_t s = sender(60 + (unsigned)(random_unit() * 440));
        s.phase_ms = random_unit() * s.time_ms;
        s.late = i % 2;
        s.lateness = random_unit() * 0.5;
        const unsigned total = run(&s);
        const unsigned reached = first_at_share(&s, 0.9, total);
        double fastest = 0;
        for (unsigned t = 0; t < reached; t++) { /* from rest up to speed */
            const double speed = 1000 * (m_z[t + 1] - m_z[t]);
            TEST_ASSERT_TRUE(speed > fastest - 0.05 * s.speed);
            fastest = fmax(fastest, speed);
        }
        TEST_ASSERT_TRUE(reached < total && least_share(&s, reached, total - s.time_ms) >= 0.8);
        check_kept();
    }
}

/* From anywhere else the first frame is a move of its own, and the stream goes on from wherever that is. */
static void test_ramp_begins_somewhere_else_within_limits(void)
{
    for (unsigned i = 0; i < 60; i++) {
        const unsigned time_ms = k_times_ms[i % TIMES];
        const double from = 40 * random_unit() - 20;
        m_rig = m_ready;
        for (unsigned k = 0; k < 12; k++) {
            rig_sendf(&m_rig, "@A6T:%.3f,0,0,0,0,%.3f,%u#", from / 4, from + 6.0 * k * time_ms / 1000, time_ms);
            rig_run_ms(&m_rig, time_ms + (unsigned)(random_unit() * 5));
        }
        rig_run_ms(&m_rig, 1000 + 30 * time_ms);
        TEST_ASSERT_TRUE(is_resting());
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, from + 6.0 * 11 * time_ms / 1000, rig_pose(&m_rig, AXIS_Z));
        check_kept();
    }
}

static void test_ramp_ends_at_rest_on_its_last_sample(void)
{
    for (unsigned i = 0; i < TIMES; i++) {
        const timed_sender_t s = sender(k_times_ms[i]);
        (void)run(&s);
        rig_run_ms(&m_rig, 1000 + 30 * s.time_ms);
        TEST_ASSERT_TRUE(is_resting());
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, sent_z(&s, s.frames - 1), rig_pose(&m_rig, AXIS_Z));
        check_kept();
    }
}

/* ---- no stream ---- */

/* Up to the last ms it moves, then it is there; what is left of the smoothing, 0.2 um, has gone 12 ms later. */
static void check_arrives_after(unsigned ms, double z)
{
    rig_run_ms(&m_rig, ms - 3);
    TEST_ASSERT_FALSE(is_resting());
    rig_run_ms(&m_rig, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, z, rig_pose(&m_rig, AXIS_Z));
    rig_run_ms(&m_rig, 12);
    TEST_ASSERT_TRUE(is_resting());
}

static void test_isolated_timed_frame_arrives_at_its_time(void)
{
    for (unsigned i = 0; i < 40; i++) {
        const unsigned ms = 300 + (unsigned)(random_unit() * 250);
        const double z = 4 + 6 * random_unit();
        m_rig = m_ready;
        rig_sendf(&m_rig, "@A6T:0,0,0,0,0,%.4f,%u#", z, ms);
        check_arrives_after(ms, z);
        rig_run_ms(&m_rig, 2 * ms);
        rig_sendf(&m_rig, "@A6T:0,0,0,0,0,%.4f,%u#", -z, ms);
        check_arrives_after(ms, -z);
        check_kept();
    }
}

static void test_isolated_timed_frame_after_a_stream_arrives_at_its_time(void)
{
    for (unsigned i = 0; i < TIMES; i++) {
        const timed_sender_t s = sender(k_times_ms[i]);
        (void)run(&s);
        rig_run_ms(&m_rig, 1000 + 30 * s.time_ms);
        const double z = sent_z(&s, s.frames - 1) - 8;
        rig_sendf(&m_rig, "@A6T:0,0,0,0,0,%.4f,450#", z);
        check_arrives_after(450, z);
        check_kept();
    }
}

/* A step of 5 mm takes some 200 ms; a stream would take a period and a half for it. */
static void check_steps(unsigned gap_ms, double from)
{
    for (unsigned k = 1; k <= 8; k++) {
        rig_sendf(&m_rig, "@A6:0,0,0,0,0,%.3f#", from + 5 * k);
        rig_run_ms(&m_rig, gap_ms - 1);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, from + 5 * k, rig_pose(&m_rig, AXIS_Z));
        rig_run_ms(&m_rig, 1);
    }
}

static void test_lone_frames_far_apart_stay_steps(void)
{
    for (unsigned gap_ms = 560; gap_ms <= 800; gap_ms += 60) {
        m_rig = m_ready;
        check_steps(gap_ms, 0);
        check_kept();
    }
}

/* Poses of a program that happen to lead on for a while, and then go to and fro: each is reached, and all within the limits. */
static void test_poses_to_and_fro_after_some_that_led_on_are_steps(void)
{
    static const double k_z[] = {4, 8, 12, 16, 20, 15, 20, 15, 20};
    for (unsigned gap_ms = 300; gap_ms <= 540; gap_ms += 60) {
        m_rig = m_ready;
        for (unsigned k = 0; k < 9; k++) {
            rig_sendf(&m_rig, "@A6:0,0,0,0,0,%.3f#", k_z[k]);
            rig_run_ms(&m_rig, gap_ms);
            TEST_ASSERT_TRUE(k < 6 || fabs(rig_pose(&m_rig, AXIS_Z) - k_z[k]) < 1e-3);
        }
        check_kept();
    }
}

/* From some frame on the sender writes no time any more: the stream goes on. */
static void test_frames_without_a_time_go_on_with_a_timed_stream(void)
{
    for (unsigned i = 0; i < TIMES; i++) {
        timed_sender_t s = sender(k_times_ms[i]);
        s.untimed = s.frames / 2;
        const unsigned total = run(&s);
        TEST_ASSERT_TRUE(least_share(&s, first_at_share(&s, 0.9, total), total - s.time_ms) >= 0.7); /* as with times */
        check_kept();
    }
}

static void test_timed_frame_unlike_the_period_of_a_stream_is_a_move(void)
{
    for (unsigned t = 0; t < 1000; t += 16) {
        rig_send(&m_rig, "@A6:0,0,0,0,0,3#");
        rig_run_ms(&m_rig, 16);
    }
    rig_run_ms(&m_rig, 100);
    rig_send(&m_rig, "@A6T:0,0,0,0,0,20,450#");
    check_arrives_after(450, 20);
}

/* A time that says nothing, and a gap that a quick stream alone explains: it goes on as if there were no times. */
static void test_stream_with_times_of_1_ms_is_one_without_also_where_a_frame_is_lost(void)
{
    static double plain_z[LONGEST_MS + 1];
    timed_sender_t s = sender(16);
    s.lost = 60;
    s.format = "@A6:0,0,0,0,0,%.4f#";
    const unsigned total = run(&s);
    memcpy(plain_z, m_z, sizeof plain_z);
    s.format = "@A6T:0,0,0,0,0,%.4f,1#";
    TEST_ASSERT_EQUAL_UINT(total, run(&s));
    TEST_ASSERT_EQUAL_MEMORY(plain_z, m_z, (total + 1) * sizeof m_z[0]);
    TEST_ASSERT_EQUAL(MOTION_STREAMED, m_rig.gateway.motion.source);
}

/* A loop that states its own period and sends each value of a slower game three or four times: neither a move each time nor, once
 * it is known to repeat, a stream that is told by the values' period alone. */
static void test_timed_stream_of_repeated_values_stays_a_stream(void)
{
    const unsigned times_ms[] = {4, 10, 20};
    for (unsigned i = 0; i < sizeof times_ms / sizeof times_ms[0]; i++) {
        setUp();
        const unsigned time_ms = times_ms[i], value_ms = 10 * time_ms / 3;
        unsigned streamed_ms = 0;
        for (unsigned ms = 0; ms < 8000; ms++) {
            if (ms % time_ms == 0) {
                char text[64];
                snprintf(text, sizeof text, "@A6T:0,0,0,0,0,%.3f,%u#", 15 * sin(0.005 * (ms / value_ms * value_ms)), time_ms);
                rig_send(&m_rig, text);
            }
            rig_run_ms(&m_rig, 1);
            streamed_ms += ms >= 1000 && m_rig.gateway.motion.source == MOTION_STREAMED ? 1u : 0u;
        }
        TEST_ASSERT_EQUAL_UINT(7000, streamed_ms);
        check_kept();
    }
}

/* The same where frames in a row are lost: the next one is a sample by its time, whether that is of the frames or of the values.
 */
static void test_timed_stream_of_repeated_values_goes_on_after_losses(void)
{
    for (unsigned i = 0; i < 4; i++) {
        setUp();
        const unsigned frame_ms = i % 2 == 0 ? 10 : 20, value_ms = 4 * frame_ms, time_ms = i < 2 ? frame_ms : value_ms;
        unsigned streamed_ms = 0;
        for (unsigned ms = 0; ms < 8000; ms++) {
            const bool is_lost = ms >= 3000 && ms % 1000 < 4 * frame_ms;
            if (ms % frame_ms == 0 && !is_lost) {
                char text[64];
                snprintf(text, sizeof text, "@A6T:0,0,0,0,0,%.3f,%u#", 15 * sin(0.005 * (ms / value_ms * value_ms)), time_ms);
                rig_send(&m_rig, text);
            }
            rig_run_ms(&m_rig, 1);
            streamed_ms += ms >= 2000 && m_rig.gateway.motion.source == MOTION_STREAMED ? 1u : 0u;
        }
        TEST_ASSERT_EQUAL_UINT(6000, streamed_ms);
        check_kept();
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_ramp_constant_rate_keeps_its_speed_from_when_it_is_reached);
    RUN_TEST(test_ramp_time_a_bit_off_the_period_keeps_its_speed);
    RUN_TEST(test_ramp_late_and_lost_frames_do_not_stop_it);
    RUN_TEST(test_ramp_begins_without_a_dip_however_late_its_first_frames_are);
    RUN_TEST(test_ramp_begins_somewhere_else_within_limits);
    RUN_TEST(test_ramp_ends_at_rest_on_its_last_sample);
    RUN_TEST(test_isolated_timed_frame_arrives_at_its_time);
    RUN_TEST(test_isolated_timed_frame_after_a_stream_arrives_at_its_time);
    RUN_TEST(test_lone_frames_far_apart_stay_steps);
    RUN_TEST(test_poses_to_and_fro_after_some_that_led_on_are_steps);
    RUN_TEST(test_frames_without_a_time_go_on_with_a_timed_stream);
    RUN_TEST(test_timed_frame_unlike_the_period_of_a_stream_is_a_move);
    RUN_TEST(test_stream_with_times_of_1_ms_is_one_without_also_where_a_frame_is_lost);
    RUN_TEST(test_timed_stream_of_repeated_values_stays_a_stream);
    RUN_TEST(test_timed_stream_of_repeated_values_goes_on_after_losses);
    return UNITY_END();
}

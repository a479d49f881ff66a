/* SPDX-License-Identifier: MIT
 * test_motion.c - how the platform moves, seen at the drives: sources, their changes at every phase, times, speeds, the
 * workspace. Limits and steps are judged by the rig in every cycle of every test.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "random.h"
#include "rig.h"
#include "unity.h"

static rig_t m_rig;
static rig_t m_ready; /* following, at neutral, nothing moving */
static bool m_is_ready;

/* Up and following, with the take-over of the first pose behind it. */
static void engage(const settings_t *settings)
{
    rig_start(&m_rig, settings, true);
    m_rig.is_auto_checking = true;
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    rig_send(&m_rig, settings->geometry.kind == KIN_HEXAPOD ? "@A6:0,0,0,0,0,0#" : "@A3:0,0,0#");
    rig_run_ms(&m_rig, 1000);
}

void setUp(void)
{
    const settings_t settings = rig_hexapod();
    random_begin(RANDOM_SEED);
    if (!m_is_ready) {
        engage(&settings);
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
}

void tearDown(void)
{
    check_kept();
}

static const snapshot_t *seen(void)
{
    return gateway_snapshot(&m_rig.gateway);
}

static bool is_resting(void)
{
    return motion_is_at_rest(&m_rig.gateway.motion);
}

static void cylinders_now(double mm[6])
{
    for (unsigned i = 0; i < 6; i++) {
        mm[i] = rig_cylinder_mm(&m_rig, i + 1);
    }
}

/* Everything arrives after exactly so many ms: on the way until then, and no change any more. */
static void check_arrives_after(unsigned ms)
{
    double before[6], there[6], after[6];
    const unsigned last = 2 + ms / 500; /* the last of a long move is less than a bit */
    rig_run_ms(&m_rig, ms - last);
    cylinders_now(before);
    rig_run_ms(&m_rig, last);
    cylinders_now(there);
    TEST_ASSERT_TRUE(memcmp(before, there, sizeof there) != 0);
    rig_run_ms(&m_rig, 300);
    cylinders_now(after);
    for (unsigned i = 0; i < 6; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(5e-7, after[i], there[i]);
    }
    TEST_ASSERT_TRUE(is_resting());
}

static long run_until_rest(long most_ms)
{
    for (long ms = 0; ms < most_ms; ms++) {
        if (is_resting()) {
            return ms;
        }
        rig_run_ms(&m_rig, 1);
    }
    TEST_FAIL_MESSAGE("does not come to rest");
    return -1;
}

/* The same after some ms on the way; counts those too. */
static long run_until_rest_after(unsigned ms, long most_ms)
{
    rig_run_ms(&m_rig, ms);
    return (long)ms + run_until_rest(most_ms);
}

static void assert_pose(double roll, double pitch, double yaw, double x, double y, double z)
{
    const double expected[POSE_AXES] = {roll, pitch, yaw, x, y, z};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, expected[i], rig_pose(&m_rig, i));
    }
}

/* ---- requests in motion ---- */

static void start_moving(void)
{
    rig_sendf(&m_rig, "@A6:%u,%u,%u,%u,%u,%u#", random_below(9), random_below(9), random_below(9), random_below(40),
              random_below(40), random_below(60));
    rig_run_ms(&m_rig, random_below(700));
}

static void test_requests_random_moments_stop_and_go_on_within_limits(void)
{
    static const event_t k_requests[] = {EVENT_HOLD, EVENT_RESUME, EVENT_PARK, EVENT_ENGAGE};
    for (int run = 0; run < 150; run++) {
        m_rig = m_ready;
        start_moving();
        for (int i = 0; i < 6; i++) {
            (void)!rig_request(&m_rig, k_requests[random_below(4)]);
            rig_run_ms(&m_rig, random_below(random_below(2) == 0 ? 40 : 2500));
        }
        (void)!rig_request(&m_rig, EVENT_ENGAGE);
        TEST_ASSERT_TRUE(seen()->state == STATE_ENGAGED || rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        check_kept();
    }
}

static void test_hold_in_motion_stops_every_cylinder_in_the_same_cycle(void)
{
    unsigned compared = 0;
    for (unsigned run = 0; run < 60; run++) {
        m_rig = m_ready;
        rig_send(&m_rig, "@A6:2,-1,1,4,4,8#"); /* far from every end of stroke */
        rig_run_ms(&m_rig, 40 + 4 * run);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
        double first[6], last[6], now[6];
        long stopped[6] = {0}, latest = 0;
        cylinders_now(first);
        cylinders_now(last);
        for (long ms = 1; ms < 1000; ms++) {
            rig_run_ms(&m_rig, 1);
            cylinders_now(now);
            for (unsigned i = 0; i < 6; i++) {
                stopped[i] = fabs(now[i] - last[i]) > 1e-7 ? ms : stopped[i];
                latest = stopped[i] > latest ? stopped[i] : latest;
            }
            memcpy(last, now, sizeof last);
        }
        TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
        TEST_ASSERT_TRUE(is_resting());
        for (unsigned i = 0; i < 6; i++) {
            if (fabs(now[i] - first[i]) > 0.1) { /* the last nanometres of a stop do not count */
                TEST_ASSERT_INT_WITHIN(6, latest, stopped[i]);
                compared++;
            }
        }
        TEST_ASSERT_TRUE(latest < 400);
        check_kept();
    }
    TEST_ASSERT_TRUE(compared > 100);
}

/* Towards an end of the stroke a cylinder may stop earlier than the others, but it is never thrown back. */
static void test_hold_before_the_end_of_the_stroke_does_not_bounce(void)
{
    for (unsigned run = 0; run < 60; run++) {
        m_rig = m_ready;
        rig_send(&m_rig, "@A6:8,5,-6,30,-20,40#");
        rig_run_ms(&m_rig, 40 + 5 * run);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
        double nearest = 1e9, last = 0;
        for (long ms = 1; ms < 1000; ms++) {
            rig_run_ms(&m_rig, 1);
            for (unsigned i = 1; i <= 6; i++) {
                const double room = fmin(rig_cylinder_mm(&m_rig, i) - 5, 195 - rig_cylinder_mm(&m_rig, i));
                last = i == 1 ? room : fmin(last, room);
            }
            nearest = fmin(nearest, last);
        }
        TEST_ASSERT_TRUE(nearest > 1 || last < nearest + 0.2);
        check_kept();
    }
}

static void test_park_in_motion_ends_at_the_settled_extension_at_engage_speed(void)
{
    rig_send(&m_rig, "@A6:8,5,-6,30,-20,40#");
    rig_run_ms(&m_rig, 300);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    rig_run_ms(&m_rig, 500); /* the stop */
    rig_check_reset(&m_rig);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 20000));
    for (unsigned i = 1; i <= 6; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(6, rig_cylinder_mm(&m_rig, i));
    }
    TEST_ASSERT_TRUE(m_rig.check.speed <= 50.001 / 400);
    TEST_ASSERT_TRUE(m_rig.check.accel <= 200.1 / 3000);
}

/* ---- changes of mode ---- */

typedef enum { MODE_POSE, MODE_CYLINDERS, MODE_TIMED, MODE_TIMED_CYLINDERS, MODE_STREAM, MODE_MOTOR, MODES } mode_t;

/* The ms from begin to end of a mode. */
static void run_part(mode_t mode, unsigned begin, unsigned end)
{
    static const char *const k_frames[MODES] = {
        [MODE_POSE] = "@A6:6,-4,8,20,-30,25#",       [MODE_CYLINDERS] = "@C6:120,80,100,90,110,70#",
        [MODE_TIMED] = "@A6T:-6,5,3,-20,10,30,600#", [MODE_TIMED_CYLINDERS] = "@C6T:90,130,120,100,80,110,500#",
        [MODE_MOTOR] = "@A7:2,3,4,10,20,10,45#",
    };
    if (mode != MODE_STREAM) {
        if (begin == 0) {
            rig_send(&m_rig, k_frames[mode]);
        }
        rig_run_ms(&m_rig, end - begin);
        return;
    }
    for (unsigned t = begin; t < end; t++) {
        if (t % 20 == 0) {
            rig_sendf(&m_rig, "@A6T:%.3f,%.3f,0,0,0,%.3f,20#", 5 * sin(t * 0.006), 4 * sin(t * 0.004), 20 * sin(t * 0.005));
        }
        rig_run_ms(&m_rig, 1);
    }
}

/* Goes on in a mode for so many ms. */
static void run_mode(mode_t mode, unsigned ms)
{
    run_part(mode, 0, ms);
}

/* From each mode to each other, for every 19th ms to every other one of them. */
static void test_modes_change_at_every_phase_is_continuous(void)
{
    static rig_t s_before; /* the change */
    double jerk = 0;
    for (unsigned from = 0; from < MODES; from++) {
        s_before = m_ready;
        rig_check_reset(&s_before);
        for (unsigned ms = 1, last = 0, turn = 0; ms < 900; last = ms, ms += from == MODE_STREAM ? 31 : 19, turn++) {
            m_rig = s_before;
            run_part((mode_t)from, last, ms);
            s_before = m_rig;
            for (unsigned to = turn % 2; to < MODES; to += 2) {
                m_rig = s_before;
                run_mode((mode_t)to, 700);
                check_kept();
                jerk = fmax(jerk, m_rig.check.jerk);
            }
        }
    }
    TEST_ASSERT_TRUE(jerk > 0.9); /* the limits were in use, the judge has seen something */
}

static void test_modes_change_ends_on_the_last_target(void)
{
    for (unsigned from = 0; from < MODES; from++) {
        for (unsigned ms = 5; ms < 900; ms += 45) {
            m_rig = m_ready;
            run_mode((mode_t)from, ms);
            rig_send(&m_rig, "@C6:120,80,100,90,110,70#");
            rig_run_ms(&m_rig, 2500);
            TEST_ASSERT_TRUE(is_resting());
            TEST_ASSERT_EQUAL_DOUBLE(120, rig_cylinder_mm(&m_rig, 1));
            TEST_ASSERT_EQUAL_DOUBLE(70, rig_cylinder_mm(&m_rig, 6));
            run_mode((mode_t)from, ms);
            rig_send(&m_rig, "@A6:3,2,1,10,20,30#");
            rig_run_ms(&m_rig, 2500);
            TEST_ASSERT_TRUE(is_resting());
            assert_pose(3, 2, 1, 10, 20, 30);
            check_kept();
        }
    }
}

/* ---- timed moves ---- */

static void test_timed_feasible_time_is_kept_to_the_cycle(void)
{
    static const unsigned k_ms[] = {700, 701, 850, 1000, 1337, 3000, 10000, 60000};
    for (unsigned i = 0; i < sizeof k_ms / sizeof k_ms[0]; i++) {
        m_rig = m_ready;
        rig_sendf(&m_rig, "@A6T:5,-4,3,10,20,30,%u#", k_ms[i]);
        check_arrives_after(k_ms[i]);
        TEST_ASSERT_EQUAL_UINT(0, seen()->flags & MOTION_STRETCHED);
        assert_pose(5, -4, 3, 10, 20, 30);
        TEST_ASSERT_EQUAL_UINT32(0, seen()->counters.stretched);
        check_kept();
    }
}

static void test_timed_infeasible_time_is_stretched_flagged_and_counted(void)
{
    static const unsigned k_ms[] = {1, 5, 50, 200};
    for (unsigned i = 0; i < 4; i++) {
        m_rig = m_ready;
        rig_sendf(&m_rig, "@A6T:5,-4,3,10,20,30,%u#", k_ms[i]);
        rig_run_ms(&m_rig, k_ms[i]);
        TEST_ASSERT_TRUE((seen()->flags & MOTION_STRETCHED) != 0);
        TEST_ASSERT_EQUAL_UINT32(1, seen()->counters.stretched);
        TEST_ASSERT_FALSE(is_resting());
        (void)run_until_rest(2000);
        assert_pose(5, -4, 3, 10, 20, 30);
        check_kept();
    }
}

static void test_timed_zero_is_as_fast_as_the_limits_allow_and_not_stretched(void)
{
    rig_send(&m_rig, "@A6T:0,0,0,0,0,60,0#");
    rig_run_ms(&m_rig, 1);
    const long ms = run_until_rest(3000);
    TEST_ASSERT_EQUAL_UINT32(0, seen()->counters.stretched);
    assert_pose(0, 0, 0, 0, 0, 60);
    TEST_ASSERT_TRUE(ms < 400); /* the optimum of 60 mm at 400/3000/50000 is 349 ms */
}

static void test_timed_in_motion_with_room_ends_in_time(void)
{
    for (unsigned ms = 10; ms < 400; ms += 17) {
        m_rig = m_ready;
        rig_send(&m_rig, "@A6:5,-4,3,10,20,30#");
        rig_run_ms(&m_rig, ms);
        rig_send(&m_rig, "@A6T:-5,2,4,0,30,-20,3000#");
        rig_run_ms(&m_rig, 3001);
        assert_pose(-5, 2, 4, 0, 30, -20);
        rig_run_ms(&m_rig, 500);
        assert_pose(-5, 2, 4, 0, 30, -20);
        TEST_ASSERT_EQUAL_UINT32(0, seen()->counters.stretched);
        check_kept();
    }
}

static void test_timed_cylinders_are_kept_to_the_cycle(void)
{
    rig_send(&m_rig, "@C7T:120,80,100,90,110,70,30,2000#");
    check_arrives_after(2000);
    TEST_ASSERT_EQUAL_DOUBLE(120, rig_cylinder_mm(&m_rig, 1));
    TEST_ASSERT_EQUAL_DOUBLE(30, rig_angle_deg(&m_rig));
}

/* Shortest time from rest to rest with limited speed, acceleration and jerk, ms. */
static double optimal_ms(double distance, double v, double a, double j)
{
    const double most = fmin(a, sqrt(j * v)), rise = v / most + most / j;
    if (distance >= v * rise) {
        return 1000 * (distance / v + rise);
    }
    const double peak = distance >= 2 * a * a * a / (j * j) ? a / j / 2 : 0;
    return 1000 * (peak > 0 ? 2 * (peak + sqrt(peak * peak + distance / a)) : 4 * cbrt(distance / (2 * j)));
}

static void test_timed_infeasible_time_is_stretched_to_hardly_more_than_the_shortest(void)
{
    double worst = 0;
    for (int mm = 5; mm <= 90; mm += 5) {
        m_rig = m_ready;
        rig_sendf(&m_rig, "@A6T:0,0,0,0,0,%d,5#", mm);
        const double ms = (double)run_until_rest_after(5, 2000);
        worst = fmax(worst, ms / optimal_ms(mm, 400, 3000, 50000));
        TEST_ASSERT_EQUAL_UINT32(1, seen()->counters.stretched);
        assert_pose(0, 0, 0, 0, 0, mm);
        check_kept();
    }
    printf("timed moves that are too quick: at most %.3f times the shortest\n", worst);
    TEST_ASSERT_TRUE(worst <= 1.02);
}

/* From any motion, for any time: what is not flagged as stretched is there, at rest, to the cycle. */
static void test_timed_from_random_motion_arrives_in_its_time_or_says_so(void)
{
    unsigned in_time = 0, stretched = 0;
    double latest = 0;
    for (int run = 0; run < 200; run++) {
        m_rig = m_ready;
        if (run % 2 == 0) {
            start_moving();
        } else {
            run_mode(MODE_STREAM, 100 + random_below(700));
        }
        const int at[POSE_AXES] = {(int)random_below(9) - 4,   (int)random_below(9) - 4,   (int)random_below(13) - 6,
                                   (int)random_below(41) - 20, (int)random_below(41) - 20, (int)random_below(61) - 30};
        const unsigned ms = 200 + random_below(2500);
        rig_run_ms(&m_rig, 200); /* the stream is over: a frame with a time is a move */
        rig_sendf(&m_rig, "@A6T:%d,%d,%d,%d,%d,%d,%u#", at[0], at[1], at[2], at[3], at[4], at[5], ms);
        rig_run_ms(&m_rig, ms);
        if (seen()->counters.stretched != 0) {
            stretched++;
            (void)run_until_rest(3000);
            assert_pose(at[0], at[1], at[2], at[3], at[4], at[5]);
        } else {
            in_time++;
            for (unsigned i = 0; i < POSE_AXES; i++) {
                TEST_ASSERT_DOUBLE_WITHIN(1e-3, at[i], rig_pose(&m_rig, i));
            }
            latest = fmax(latest, (double)run_until_rest(60)); /* a cylinder's limiter may be a hair behind */
            assert_pose(at[0], at[1], at[2], at[3], at[4], at[5]);
        }
        check_kept();
    }
    printf("timed moves from random motion: %u in time (exactly at rest %.0f ms later at most), %u stretched\n", in_time, latest,
           stretched);
    TEST_ASSERT_TRUE(in_time > 100 && stretched > 5);
}

/* ---- streams ---- */

/* Least and mean speed of a constant ramp in z once it runs. */
static void ramp_speed(const char *format, unsigned period_us, double *least, double *mean)
{
    const double speed = 40; /* mm/s */
    double last = 0, sum = 0;
    long count = 0, next_us = 0;
    *least = 1e9;
    for (long t_us = 0; t_us < 3000000; t_us += 1000) {
        if (t_us >= next_us) {
            rig_sendf(&m_rig, format, -60 + speed * (double)next_us / 1e6, period_us / 1000);
            next_us += (long)period_us;
        }
        rig_run_ms(&m_rig, 1);
        const double z = rig_pose(&m_rig, AXIS_Z);
        if (t_us > 1500000) {
            *least = fmin(*least, (z - last) * 1000);
            sum += (z - last) * 1000;
            count++;
        }
        last = z;
    }
    *mean = sum / (double)count;
}

static void test_stream_constant_rate_never_stutters(void)
{
    static const unsigned k_periods_us[] = {10000, 16667, 20000, 33333, 40000};
    for (unsigned i = 0; i < 5; i++) {
        static const char *const k_formats[2] = {"@A6T:0,0,0,0,0,%.3f,%u#", "@A6:0,0,0,0,0,%.3f#"};
        for (unsigned form = 0; form < 2; form++) {
            double least, mean;
            m_rig = m_ready;
            rig_send(&m_rig, "@A6:0,0,0,0,0,-60#");
            rig_run_ms(&m_rig, 1000);
            ramp_speed(k_formats[form], k_periods_us[i], &least, &mean);
            printf("stream %s every %.1f ms: speed %.2f mm/s, least %.2f\n", form == 0 ? "A6T" : "A6", k_periods_us[i] / 1000.0,
                   mean, least);
            TEST_ASSERT_DOUBLE_WITHIN(2, 40, mean);
            TEST_ASSERT_TRUE(least >= 0.8 * mean);
            check_kept();
        }
    }
}

static void test_stream_end_comes_to_rest_on_the_last_sample(void)
{
    for (unsigned t = 0; t < 1000; t += 20) {
        rig_sendf(&m_rig, "@A6T:%.3f,0,0,0,0,%.3f,20#", 8 * sin(t * 0.006), 30 * sin(t * 0.005));
        rig_run_ms(&m_rig, 20);
    }
    rig_run_ms(&m_rig, 1500);
    TEST_ASSERT_TRUE(is_resting());
    assert_pose(round(8000 * sin(980 * 0.006)) / 1000, 0, 0, 0, 0, round(30000 * sin(980 * 0.005)) / 1000);
}

/* ---- one body ---- */

/* The pose in mm at a lever of 500 mm, so that degrees and mm can be compared. */
static void body_now(double at[POSE_AXES])
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        at[i] = rig_pose(&m_rig, i) * (i < AXIS_X ? 500 * acos(-1) / 180 : 1);
    }
}

static double length(const double v[POSE_AXES])
{
    double sum = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        sum += v[i] * v[i];
    }
    return sqrt(sum);
}

/* Distance of a pose from the straight line through the origin. */
static double beside(const double at[POSE_AXES], const double direction[POSE_AXES], double *along)
{
    double off[POSE_AXES];
    *along = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        *along += at[i] * direction[i] / length(direction);
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        off[i] = at[i] - *along * direction[i] / length(direction);
    }
    return length(off);
}

static void test_body_step_from_rest_goes_straight(void)
{
    double worst = 0;
    for (int run = 0; run < 60; run++) {
        m_rig = m_ready;
        rig_sendf(&m_rig, "@A6:%d,%d,%d,%d,%d,%d#", (int)random_below(11) - 5, (int)random_below(11) - 5,
                  (int)random_below(17) - 8, (int)random_below(41) - 20, (int)random_below(41) - 20, (int)random_below(61) - 30);
        double at[250][POSE_AXES], along;
        for (unsigned k = 0; k < 250; k++) {
            rig_run_ms(&m_rig, 2);
            body_now(at[k]);
        }
        rig_run_ms(&m_rig, 500);
        TEST_ASSERT_TRUE(is_resting());
        double there[POSE_AXES];
        body_now(there);
        for (unsigned k = 0; k < 250 && length(there) > 1; k++) {
            worst = fmax(worst, beside(at[k], there, &along) / length(there));
        }
        check_kept();
    }
    printf("steps from rest: at most %.4f %% of the step beside the straight line\n", 100 * worst);
    TEST_ASSERT_TRUE(worst < 1e-4);
}

/* A stream along one direction, far quicker than the limits: slower, but in its direction. */
static void test_body_stream_beyond_the_limits_keeps_its_direction(void)
{
    static const double k_direction[POSE_AXES] = {0.5, -0.4, 0.3, 2, 1.5, 1};
    double direction[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        direction[i] = k_direction[i] * (i < AXIS_X ? 500 * acos(-1) / 180 : 1);
    }
    for (unsigned size = 4; size <= 10; size += 2) {
        double worst = 0, farthest = 0;
        m_rig = m_ready;
        for (unsigned t = 0; t < 6000; t += 16) {
            const double a = size * sin(t * 0.0095);
            rig_sendf(&m_rig, "@A6:%.4f,%.4f,%.4f,%.4f,%.4f,%.4f#", a * k_direction[0], a * k_direction[1], a * k_direction[2],
                      a * k_direction[3], a * k_direction[4], a * k_direction[5]);
            for (unsigned ms = 0; ms < 16; ms++) {
                double at[POSE_AXES], along;
                rig_run_ms(&m_rig, 1);
                body_now(at);
                worst = fmax(worst, beside(at, direction, &along));
                farthest = fmax(farthest, fabs(along));
            }
        }
        printf("stream of +-%.0f mm: went %.1f mm, at most %.3f mm (%.2f %%) beside its direction\n", size * length(direction),
               farthest, worst, 100 * worst / farthest);
        TEST_ASSERT_TRUE(worst < 0.03 * farthest);
        TEST_ASSERT_TRUE(farthest < 1.15 * size * length(direction));
        check_kept();
    }
}

/* A running sine jumps aside: the body joins it again and stays on it. */
static void test_body_stream_that_jumps_is_joined_again(void)
{
    double latest = 0;
    for (unsigned run = 0; run < 12; run++) {
        m_rig = m_ready;
        const double rate = 0.006 + 0.0005 * run, z = 36 - 2.0 * run, phase = 0.5 * run;
        unsigned last_off = 0;
        for (unsigned t = 0; t < 4000; t += 16) {
            const double aside = t >= 2000 ? 6 : 0;
            rig_sendf(&m_rig, "@A6T:%.4f,%.4f,0,%.4f,0,%.4f,16#", aside / 2, 0.5 * sin(rate * t), aside,
                      z * sin(rate * t + phase));
            rig_run_ms(&m_rig, 16);
            const double late = rate * 1e-3 * stream_delay_us(motion_stream(&m_rig.gateway.motion));
            const double off =
                fabs(rig_pose(&m_rig, AXIS_Z) - z * sin(rate * (t + 16) + phase - late)) + fabs(rig_pose(&m_rig, AXIS_X) - aside);
            last_off = t >= 2000 && off > 0.5 + 0.02 * z ? t : last_off;
        }
        latest = fmax(latest, (double)last_off - 2000);
        TEST_ASSERT_TRUE(last_off < 2000 + 1400);
        check_kept();
    }
    printf("streams that jump: joined again after %.0f ms at most\n", latest);
}

/* ---- take-over ---- */

static void test_follow_far_first_pose_is_reached_at_engage_speed(void)
{
    const settings_t settings = rig_hexapod();
    rig_start(&m_rig, &settings, true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    rig_check_reset(&m_rig);
    rig_send(&m_rig, "@A6:5,-4,3,10,20,30#");
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_TRUE((seen()->flags & MOTION_TAKEOVER) != 0);
    rig_run_ms(&m_rig, 8000);
    assert_pose(5, -4, 3, 10, 20, 30);
    TEST_ASSERT_EQUAL_UINT(0, seen()->flags & MOTION_TAKEOVER);
    printf("take-over: %.1f mm/s of 50\n", m_rig.check.speed * 400);
    TEST_ASSERT_TRUE(m_rig.check.speed * 400 <= 50.1);
    rig_check_reset(&m_rig);
    rig_send(&m_rig, "@A6:-5,4,-3,-10,-20,-30#");
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_TRUE(m_rig.check.speed * 400 > 200); /* the second one at full speed */
}

#define FARTHEST_MM 35 /* way of a cylinder there */

static void test_follow_first_timed_move_arrives_in_its_time_at_engage_speed_beside_its_own(void)
{
    static const char *const k_frames[2] = {"@A6T:3,-2,2,5,10,20,%u#", "@C6T:110,90,115,80,85,120,%u#"};
    const settings_t settings = rig_hexapod();
    for (unsigned form = 0; form < 2; form++) {
        for (unsigned ms = 300; ms < 10000; ms = ms * 3 / 2) {
            rig_start(&m_rig, &settings, true);
            TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
            rig_check_reset(&m_rig);
            rig_sendf(&m_rig, k_frames[form], ms);
            rig_run_ms(&m_rig, 2);
            if ((seen()->flags & MOTION_STRETCHED) == 0) {
                check_arrives_after(ms - 2);
            } else {
                TEST_ASSERT_TRUE(ms < 2000);
                rig_run_ms(&m_rig, 3000);
            }
            if (form == 0) {
                assert_pose(3, -2, 2, 5, 10, 20);
            } else {
                TEST_ASSERT_EQUAL_DOUBLE(110, rig_cylinder_mm(&m_rig, 1));
            }
            TEST_ASSERT_TRUE(m_rig.check.speed * 400 <= 50.1 + 1.1 * 1.875 * FARTHEST_MM * 1000 / fmax(ms, 2000));
            check_kept();
        }
    }
}

static void test_follow_moving_stream_is_taken_over_smoothly(void)
{
    const settings_t settings = rig_hexapod();
    for (unsigned phase = 0; phase < 1000; phase += 130) {
        rig_start(&m_rig, &settings, true);
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        for (unsigned t = phase; t < phase + 6000; t += 20) {
            rig_sendf(&m_rig, "@A6T:%.3f,%.3f,0,0,0,%.3f,20#", 5 * sin(t * 0.004), 4 * sin(t * 0.003), 20 * sin(t * 0.005));
            rig_run_ms(&m_rig, 20);
        }
        TEST_ASSERT_EQUAL_UINT(0, seen()->flags & MOTION_TAKEOVER);
        TEST_ASSERT_DOUBLE_WITHIN(6, 20 * sin((phase + 6000) * 0.005), rig_pose(&m_rig, AXIS_Z));
        check_kept();
    }
}

static void test_follow_space_changed_in_the_take_over_stops_first(void)
{
    const settings_t settings = rig_hexapod();
    for (unsigned ms = 20; ms < 900; ms += 110) {
        rig_start(&m_rig, &settings, true);
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        rig_check_reset(&m_rig);
        rig_send(&m_rig, "@A6:5,-4,3,10,20,30#");
        rig_run_ms(&m_rig, ms);
        rig_send(&m_rig, "@C6:120,80,100,90,110,70#");
        rig_run_ms(&m_rig, 5000);
        TEST_ASSERT_EQUAL_DOUBLE(120, rig_cylinder_mm(&m_rig, 1));
        TEST_ASSERT_TRUE(m_rig.check.speed * 400 <= 50.1); /* engage speed all the way */
        TEST_ASSERT_TRUE(m_rig.check.accel < 0.5);
        check_kept();
    }
}

/* ---- workspace ---- */

static void test_reach_pose_outside_is_pulled_in_as_a_whole(void)
{
    static const double k_asked[POSE_AXES] = {18, -14, 10, 60, 50, 90};
    rig_sendf(&m_rig, "@A6:%f,%f,%f,%f,%f,%f#", k_asked[0], k_asked[1], k_asked[2], k_asked[3], k_asked[4], k_asked[5]);
    rig_run_ms(&m_rig, 3000);
    TEST_ASSERT_TRUE(is_resting());
    TEST_ASSERT_TRUE((seen()->flags & MOTION_CLAMPED) != 0);
    TEST_ASSERT_TRUE(seen()->limiting_cylinder >= 1 && seen()->limiting_cylinder <= 6);
    const double share = rig_pose(&m_rig, AXIS_Z) / 90;
    TEST_ASSERT_TRUE(share > 0.3 && share < 0.99);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, k_asked[i] * share, rig_pose(&m_rig, i));
    }
    const double mm = rig_cylinder_mm(&m_rig, seen()->limiting_cylinder);
    TEST_ASSERT_TRUE(fabs(mm - 195) < 0.01 || fabs(mm - 5) < 0.01);
    TEST_ASSERT_TRUE(seen()->counters.clamped > 0);
    rig_send(&m_rig, "@A6:1,2,3,4,5,6#");
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_EQUAL_UINT(0, seen()->flags & MOTION_CLAMPED);
    TEST_ASSERT_EQUAL_UINT8(0, seen()->limiting_cylinder);
    assert_pose(1, 2, 3, 4, 5, 6);
}

static void test_reach_stream_in_and_out_of_the_workspace_is_continuous(void)
{
    unsigned clamped = 0;
    for (unsigned t = 0; t < 20000; t += 20) {
        rig_sendf(&m_rig, "@A6T:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,20#", 15 * sin(t * 0.0011), 12 * sin(t * 0.0017),
                  8 * sin(t * 0.0013), 60 * sin(t * 0.0007), 50 * sin(t * 0.0009), 100 * sin(t * 0.0015));
        rig_run_ms(&m_rig, 20);
        clamped += (seen()->flags & MOTION_CLAMPED) != 0;
    }
    TEST_ASSERT_TRUE(clamped > 50 && clamped < 990);
}

static void test_axis_limits_clamp_the_axis(void)
{
    rig_send(&m_rig, "@A6:0,0,0,0,0,-500#");
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_TRUE((seen()->flags & MOTION_CLAMPED) != 0);
    rig_send(&m_rig, "@A6:0,0,300,0,0,0#");
    rig_run_ms(&m_rig, 3000);
    TEST_ASSERT_TRUE(fabs(rig_pose(&m_rig, AXIS_YAW)) <= 25.0001);
    TEST_ASSERT_TRUE((seen()->flags & MOTION_CLAMPED) != 0);
}

static void test_cylinders_beyond_the_stroke_stop_at_the_margin(void)
{
    rig_send(&m_rig, "@C6:1000,900,800,1000,900,800#");
    rig_run_ms(&m_rig, 3000);
    TEST_ASSERT_TRUE((seen()->flags & MOTION_CLAMPED) != 0);
    for (unsigned i = 1; i <= 6; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(195, rig_cylinder_mm(&m_rig, i));
    }
    TEST_ASSERT_TRUE(is_resting());
}

/* A share that changes in a planned move is added to it: the end is where the scaled pose is, in the time asked for. */
static void test_intensity_changed_in_a_timed_move_ends_at_the_scaled_pose(void)
{
    static const unsigned k_percent[] = {50, 100, 0, 100};
    for (unsigned i = 0; i < sizeof k_percent / sizeof k_percent[0]; i++) {
        rig_sendf(&m_rig, "@A7T:0,4,0,10,0,%d,30,5000#", i % 2 == 0 ? 40 : -40);
        rig_run_ms(&m_rig, 700);
        TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, k_percent[i]));
        rig_run_ms(&m_rig, 4310);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, (i % 2 == 0 ? 0.4 : -0.4) * k_percent[i], rig_pose(&m_rig, AXIS_Z));
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.04 * k_percent[i], rig_pose(&m_rig, AXIS_PITCH));
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 30, rig_angle_deg(&m_rig)); /* turns from its zero are not scaled */
        TEST_ASSERT_TRUE(is_resting());
    }
}

/* At an intensity of 0 every pose is neutral; with the intensity the platform goes to the one that was sent last. */
static void test_intensity_0_a_pose_is_kept_for_later(void)
{
    settings_t settings = rig_hexapod();
    settings.intensity_start_percent = 0;
    engage(&settings);
    for (int z = 10; z <= 20; z += 10) {
        rig_sendf(&m_rig, "@A6:0,0,0,0,0,%d#", z);
        rig_run_ms(&m_rig, 2000);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, rig_pose(&m_rig, AXIS_Z));
    }
    TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, 100));
    rig_run_ms(&m_rig, 10000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20, rig_pose(&m_rig, AXIS_Z));
    TEST_ASSERT_TRUE(is_resting());
}

/* A value that no limit reaches is told as clamped even where nothing is left of it. */
static void test_intensity_0_values_beyond_all_limits_are_told(void)
{
    settings_t settings = rig_hexapod();
    settings.axis[AXIS_Z].scale_q16 = 2 * Q16_ONE;
    settings.intensity_start_percent = 0;
    engage(&settings);
    rig_send(&m_rig, "@A6:0,0,0,0,0,30000#");
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_BITS_HIGH(MOTION_CLAMPED, seen()->flags);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, rig_pose(&m_rig, AXIS_Z));
}

/* Drives that have not found their zero tell positions that no plate has. */
static void test_place_positions_without_a_pose_are_told_as_such(void)
{
    settings_t settings = rig_hexapod();
    rig_start(&m_rig, &settings, false);
    for (unsigned i = 0; i < 6; i++) {
        m_rig.drive_config[i].unhomed_offset_q32 = q32_from_int(i % 2 == 0 ? 9000 : -600);
    }
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_BITS_HIGH(MOTION_NO_POSE, seen()->flags);
    TEST_ASSERT_FALSE(seen()->plate.has_pose);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 60000));
    TEST_ASSERT_BITS_LOW(MOTION_NO_POSE, seen()->flags);
    TEST_ASSERT_TRUE(seen()->plate.has_pose);
}

static void test_target_is_nothing_to_a_motion_that_follows_nobody(void)
{
    const motion_target_t target = {.space = MOTION_POSE, .value_q32 = {[AXIS_Z] = q32_from_int(40)}};
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(HV_OK, motion_target(&m_rig.gateway.motion, &target, m_rig.now_us));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, rig_pose(&m_rig, AXIS_Z));
}

static void test_init_settings_that_no_platform_moves_with_are_refused(void)
{
    static motion_t motion;
    settings_t good = rig_hexapod();
    TEST_ASSERT_EQUAL(HV_OK, motion_init(&motion, &good));
#define SPOIL(member, value)                                                                                                     \
    do {                                                                                                                         \
        settings_t bad = good;                                                                                                   \
        bad.member = (value);                                                                                                    \
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, motion_init(&motion, &bad), #member);                                            \
    } while (0)
    SPOIL(geometry.retracted_mm_q16[2], 0);
    SPOIL(stroke_mm_q16[5], good.margin_mm_q16 * 2);
    SPOIL(cylinder_jerk_mm_s3, 0);
    SPOIL(engage_speed_mm_s_q16, 0);
    SPOIL(axis[AXIS_YAW].accel_q16, 0);
    SPOIL(axis[AXIS_ANGLE].jerk, 0);
    SPOIL(spike_gate, SPIKE_FILTER_FACTOR_MAX + 1);
    SPOIL(neutral_q16[AXIS_Z], 110 * Q16_ONE);
    SPOIL(intensity_start_percent, 101);
    SPOIL(settled_extension_mm_q16, -700 * Q16_ONE);
#undef SPOIL
}

static void test_cycle_times_and_tripod_keep_limits(void)
{
    static const uint32_t k_cycles_us[] = {500, 2000, 5000, 10000};
    for (unsigned i = 0; i < 8; i++) {
        settings_t settings = i < 4 ? rig_hexapod() : rig_tripod();
        const char *const name = i < 4 ? "@A6" : "@A3";
        const char *const zeros = i < 4 ? "0,0,0,0," : "0,";
        settings.cycle_us = k_cycles_us[i % 4];
        engage(&settings);
        for (int k = 0; k < 200; k++) {
            rig_sendf(&m_rig, "%s%s:%u,%s%u%s#", name, k % 3 == 0 ? "T" : "", random_below(8), zeros, random_below(70),
                      k % 3 == 0 ? ",200" : "");
            rig_run_ms(&m_rig, 10 * random_below(60));
        }
        check_kept();
    }
    m_is_ready = false;
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_requests_random_moments_stop_and_go_on_within_limits);
    RUN_TEST(test_hold_in_motion_stops_every_cylinder_in_the_same_cycle);
    RUN_TEST(test_hold_before_the_end_of_the_stroke_does_not_bounce);
    RUN_TEST(test_park_in_motion_ends_at_the_settled_extension_at_engage_speed);
    RUN_TEST(test_modes_change_at_every_phase_is_continuous);
    RUN_TEST(test_modes_change_ends_on_the_last_target);
    RUN_TEST(test_timed_feasible_time_is_kept_to_the_cycle);
    RUN_TEST(test_timed_infeasible_time_is_stretched_flagged_and_counted);
    RUN_TEST(test_timed_zero_is_as_fast_as_the_limits_allow_and_not_stretched);
    RUN_TEST(test_timed_in_motion_with_room_ends_in_time);
    RUN_TEST(test_timed_cylinders_are_kept_to_the_cycle);
    RUN_TEST(test_timed_infeasible_time_is_stretched_to_hardly_more_than_the_shortest);
    RUN_TEST(test_timed_from_random_motion_arrives_in_its_time_or_says_so);
    RUN_TEST(test_stream_constant_rate_never_stutters);
    RUN_TEST(test_stream_end_comes_to_rest_on_the_last_sample);
    RUN_TEST(test_body_step_from_rest_goes_straight);
    RUN_TEST(test_body_stream_beyond_the_limits_keeps_its_direction);
    RUN_TEST(test_body_stream_that_jumps_is_joined_again);
    RUN_TEST(test_follow_far_first_pose_is_reached_at_engage_speed);
    RUN_TEST(test_follow_first_timed_move_arrives_in_its_time_at_engage_speed_beside_its_own);
    RUN_TEST(test_follow_moving_stream_is_taken_over_smoothly);
    RUN_TEST(test_follow_space_changed_in_the_take_over_stops_first);
    RUN_TEST(test_reach_pose_outside_is_pulled_in_as_a_whole);
    RUN_TEST(test_reach_stream_in_and_out_of_the_workspace_is_continuous);
    RUN_TEST(test_axis_limits_clamp_the_axis);
    RUN_TEST(test_cylinders_beyond_the_stroke_stop_at_the_margin);
    RUN_TEST(test_intensity_changed_in_a_timed_move_ends_at_the_scaled_pose);
    RUN_TEST(test_intensity_0_a_pose_is_kept_for_later);
    RUN_TEST(test_intensity_0_values_beyond_all_limits_are_told);
    RUN_TEST(test_place_positions_without_a_pose_are_told_as_such);
    RUN_TEST(test_target_is_nothing_to_a_motion_that_follows_nobody);
    RUN_TEST(test_init_settings_that_no_platform_moves_with_are_refused);
    RUN_TEST(test_cycle_times_and_tripod_keep_limits);
    return UNITY_END();
}

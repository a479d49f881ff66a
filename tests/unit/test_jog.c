/* SPDX-License-Identifier: MIT
 * test_jog.c - manual motion at its edges: where a jog or a test signal is refused and why, cylinders outside of their stroke,
 * poses near a singularity or without any, settings that allow nothing.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "rig.h"
#include "unity.h"

#define Q(x)      ((q16_t)((x)*65536.0))
#define CYCLE_US  1000u
#define JOG_MM_S  20.0 /* of the rig */
#define TINY_MM_S 1e-5

static settings_t m_settings;
static motion_t m_motion;
static motion_output_t m_out;
static uint64_t m_now_us;
static double m_fastest; /* mm/s of any cylinder since the last call of run_ms() */

void setUp(void)
{
    m_settings = rig_hexapod();
}

void tearDown(void) {}

static double mm(q32_t value_q32)
{
    return (double)value_q32 / 4294967296.0;
}

static q32_t q32(double value)
{
    return (q32_t)(value * 4294967296.0);
}

/* Cycles; the fastest that a cylinder got. */
static void run_ms(unsigned ms)
{
    m_fastest = 0;
    for (unsigned n = 0; n < ms; n++) {
        q32_t before_q32[CYLINDERS_MAX];
        for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
            before_q32[i] = m_motion.platform.cylinder[i].state.pos_q32;
        }
        m_now_us += CYCLE_US;
        motion_step(&m_motion, m_now_us, &m_out);
        for (unsigned i = 0; i < m_motion.platform.cylinders; i++) {
            const double speed = mm(llabs(m_out.extension_mm_q32[i] - before_q32[i])) * 1e6 / CYCLE_US;
            m_fastest = speed > m_fastest ? speed : m_fastest;
        }
    }
}

/* In manual operation, with the cylinders there. */
static void serve_at(const double *at_mm)
{
    q32_t at_q32[CYLINDERS_MAX] = {0};
    m_now_us = 1000000;
    TEST_ASSERT_EQUAL(HV_OK, motion_init(&m_motion, &m_settings));
    for (unsigned i = 0; i < m_motion.platform.cylinders; i++) {
        at_q32[i] = q32(at_mm[i]);
    }
    motion_place(&m_motion, at_q32, 0);
    motion_serve(&m_motion);
    run_ms(1);
}

static void serve_at_all(double all_mm)
{
    const double at_mm[CYLINDERS_MAX] = {all_mm, all_mm, all_mm, all_mm, all_mm, all_mm};
    serve_at(at_mm);
}

static double at(unsigned cylinder)
{
    return mm(m_motion.platform.cylinder[cylinder - 1].state.pos_q32);
}

static hv_status_t jog_axis(unsigned axis, double speed)
{
    return motion_jog_axis(&m_motion, axis, Q(speed), 0);
}

static hv_status_t jog_pose(unsigned axis, double speed)
{
    return motion_jog_pose(&m_motion, axis, Q(speed), 0);
}

static excitation_request_t sine_of(double amplitude)
{
    return (excitation_request_t){EXCITATION_SINE, Q(amplitude), 2000, 0, 4000};
}

static hv_status_t excite_axis(unsigned axis, double amplitude)
{
    const excitation_request_t request = sine_of(amplitude);
    return motion_excite_axis(&m_motion, axis, &request);
}

static hv_status_t excite_pose(unsigned axis, double amplitude)
{
    const excitation_request_t request = sine_of(amplitude);
    return motion_excite_pose(&m_motion, axis, &request);
}

/* Strokes so long that not all extensions belong to a pose; those of serve_askew() do not. */
static void lengthen_strokes(void)
{
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        m_settings.geometry.retracted_mm_q16[i] = Q(650);
        m_settings.stroke_mm_q16[i] = Q(1200);
    }
}

static void serve_askew(void)
{
    static const double k_askew[] = {1195, 5, 1195, 5, 1195, 5};
    lengthen_strokes();
    serve_at(k_askew);
    TEST_ASSERT_BITS_HIGH(MOTION_NO_POSE, m_out.flags);
}

/* ---- where nothing begins ---- */

static void test_nothing_begins_outside_of_manual_operation(void)
{
    TEST_ASSERT_EQUAL(HV_OK, motion_init(&m_motion, &m_settings));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, jog_axis(0, 5));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, jog_pose(AXIS_Z, 5));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, excite_axis(0, 1));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, excite_pose(AXIS_Z, 1));
}

static void test_nothing_begins_before_the_last_cylinder_rests(void)
{
    serve_at_all(100);
    m_motion.platform.cylinder[4].state.vel_per_cycle_q32 = 1;
    TEST_ASSERT_EQUAL(HV_ERR_STATE, jog_axis(0, 5));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, excite_pose(AXIS_Z, 1));
    m_motion.platform.cylinder[4].state.vel_per_cycle_q32 = 0;
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(0, 5));
}

static void test_jog_of_no_speed_is_refused(void)
{
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_axis(0, 0));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_axis(AXIS_ANGLE, 0));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_pose(AXIS_Z, 0));
    run_ms(100);
    TEST_ASSERT_TRUE(m_fastest == 0);
}

/* As where nobody ever moves anything by hand. */
static void test_jog_speed_of_zero_in_the_settings_moves_nothing(void)
{
    m_settings.jog_mm_s_q16 = 0;
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_axis(0, 5));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_axis(AXIS_ANGLE, 5));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_pose(AXIS_Z, 5));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_pose(AXIS_ROLL, 5));
    TEST_ASSERT_EQUAL(HV_ERR_FORMAT, excite_axis(0, 1));
    TEST_ASSERT_EQUAL(HV_ERR_FORMAT, excite_pose(AXIS_Z, 1));
    run_ms(100);
    TEST_ASSERT_TRUE(m_fastest == 0);
}

static void test_signal_speed_of_zero_in_the_settings_moves_nothing(void)
{
    m_settings.signal_mm_s_q16 = 0;
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_axis(0, 1));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_pose(AXIS_Z, 1));
    run_ms(100);
    TEST_ASSERT_TRUE(m_fastest == 0);
}

static void test_axis_that_is_not_moved_is_refused_by_name(void)
{
    m_settings = rig_tripod();
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, jog_pose(AXIS_X, 5));
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, excite_pose(AXIS_X, 1));
    TEST_ASSERT_EQUAL(HV_OK, excite_pose(AXIS_Z, 1));
}

static void test_pose_is_not_moved_where_none_belongs_to_the_extensions(void)
{
    serve_askew();
    TEST_ASSERT_EQUAL(HV_ERR_ARG, jog_pose(AXIS_Z, 5));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, excite_pose(AXIS_Z, 1));
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(0, -5)); /* that is how it comes back to where there is one */
    run_ms(2000);
    TEST_ASSERT_TRUE(m_fastest > 4.9 && m_fastest <= 5 + TINY_MM_S);
    TEST_ASSERT_TRUE(at(1) < 1195 - 9);
    TEST_ASSERT_EQUAL_UINT32(0, motion_singular_stops(&m_motion)); /* nothing is known of what is near */
}

/* ---- speeds ---- */

static void test_jog_is_no_faster_than_the_platform_ever_is(void)
{
    m_settings.cylinder_speed_mm_s_q16 = Q(10);
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(0, 1000));
    run_ms(2000);
    TEST_ASSERT_TRUE(m_fastest > 9.5 && m_fastest <= 10 + TINY_MM_S);
}

static void test_jog_of_a_pose_keeps_the_speed_of_its_axis(void)
{
    m_settings.axis[AXIS_Z].speed_q16 = Q(4);
    serve_at_all(100);
    const double from = mm(motion_pose(&m_motion)->axis_q32[AXIS_Z]);
    TEST_ASSERT_EQUAL(HV_OK, jog_pose(AXIS_Z, 15));
    run_ms(3000);
    const double went = mm(motion_pose(&m_motion)->axis_q32[AXIS_Z]) - from;
    TEST_ASSERT_TRUE(went > 3 * 4 * 0.9 && went <= 3 * 4);
}

static void test_signal_is_no_faster_than_a_ride(void)
{
    const excitation_request_t request = {EXCITATION_SINE, Q(10), 3000, 0, 4000}; /* 188 mm/s by itself */
    m_settings.cylinder_speed_mm_s_q16 = Q(30);
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_OK, motion_excite_axis(&m_motion, 2, &request));
    run_ms(3000);
    TEST_ASSERT_TRUE(m_fastest > 15 && m_fastest <= 30 + TINY_MM_S);
    run_ms(1500);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 100, at(3));
}

/* ---- ends ---- */

/* As homing may leave it, or a drive without a zero reports: a way back, and none further out. */
static void test_jog_from_beyond_the_stroke_leads_back_only(void)
{
    static const double k_out[] = {100, 100, 230, 100, 100, 100};
    serve_at(k_out);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_axis(2, 5));
    run_ms(100);
    TEST_ASSERT_TRUE(m_fastest == 0);
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(2, -1000));
    run_ms(3000);
    TEST_ASSERT_TRUE(m_fastest > JOG_MM_S * 0.95 && m_fastest <= JOG_MM_S + TINY_MM_S);
    TEST_ASSERT_TRUE(at(3) < 230 - 50);
}

static void test_jog_of_a_pose_from_beyond_the_stroke_leads_back_only(void)
{
    serve_at_all(198); /* 3 mm within the margin */
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_pose(AXIS_Z, 5));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_pose(AXIS_Z, 1));
    TEST_ASSERT_EQUAL(HV_OK, jog_pose(AXIS_Z, -5));
    run_ms(3000);
    TEST_ASSERT_TRUE(at(1) < 190);
}

static void test_jog_of_a_pose_ends_where_its_axis_does(void)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        m_settings.axis[AXIS_ROLL].min_q16 = Q(-1);
        m_settings.axis[AXIS_ROLL].max_q16 = Q(1);
        serve_at_all(100);
        TEST_ASSERT_EQUAL(HV_OK, jog_pose(AXIS_ROLL, sign * 5));
        run_ms(3000);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, sign, mm(motion_pose(&m_motion)->axis_q32[AXIS_ROLL]));
        TEST_ASSERT_TRUE(motion_is_at_rest(&m_motion));
        const double from = at(1);
        const hv_status_t again = jog_pose(AXIS_ROLL, sign * 5); /* what forward kinematics rounds off may be left */
        run_ms(1000);
        TEST_ASSERT_TRUE(again == HV_ERR_RANGE || fabs(at(1) - from) < 1e-5);
        m_motion.platform.axis[AXIS_ROLL].limits.pos_min_q32 = q32(-0.5); /* as where it was led beyond its range */
        m_motion.platform.axis[AXIS_ROLL].limits.pos_max_q32 = q32(0.5);
        run_ms(1000);
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, jog_pose(AXIS_ROLL, sign * 5));
        TEST_ASSERT_EQUAL(HV_OK, jog_pose(AXIS_ROLL, sign * -5));
    }
}

static void test_signal_needs_way_to_both_sides(void)
{
    static const double k_at[] = {8, 192, 100, 100, 100, 100};
    serve_at(k_at);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_axis(0, 5));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_axis(1, 5));
    TEST_ASSERT_EQUAL(HV_OK, excite_axis(1, 2));
    m_settings.axis[AXIS_Z].max_q16 = Q(2); /* of the pose, the range of its axis counts as well */
    serve_at_all(100);
    const double z = mm(motion_pose(&m_motion)->axis_q32[AXIS_Z]);
    TEST_ASSERT_TRUE(z < 1 && z > -1);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_pose(AXIS_Z, 5));
    TEST_ASSERT_EQUAL(HV_OK, excite_pose(AXIS_Z, 0.5));
    m_settings.axis[AXIS_Z].max_q16 = Q(120);
    m_settings.axis[AXIS_Z].min_q16 = Q(-2);
    m_settings.settled_extension_mm_q16 = Q(100);
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_pose(AXIS_Z, 5));
    TEST_ASSERT_EQUAL(HV_OK, excite_pose(AXIS_Z, 0.5));
}

/* The joint of cylinder 1 is on the axis of roll: it need not move. It is outside of its stroke, and gets no further out; where
 * rounding would have it so, the signal is refused. */
static void test_signal_of_a_pose_moves_no_cylinder_further_out(void)
{
    m_settings = rig_tripod();
    for (unsigned high = 0; high < 2; high++) {
        unsigned begun = 0;
        for (unsigned n = 0; n < 20; n++) {
            const double out = high ? 195.5 + n * 0.1 : 4.5 - n * 0.1, others = high ? 140 : 60;
            const double at_mm[] = {out, others, others};
            double least = out, most = out;
            serve_at(at_mm);
            const hv_status_t status = excite_pose(AXIS_ROLL, 2);
            TEST_ASSERT_TRUE(status == HV_OK || status == HV_ERR_RANGE);
            begun += status == HV_OK;
            for (unsigned ms = 0; ms < 4100; ms++) {
                run_ms(1);
                least = fmin(least, at(1));
                most = fmax(most, at(1));
            }
            TEST_ASSERT_TRUE(high ? most <= out + 1e-6 : least >= out - 1e-6);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, others, at(2));
        }
        TEST_ASSERT_GREATER_THAN_UINT(0, begun);
    }
}

/* Out, a rest there, and back, in each period. */
static void test_steps_of_a_cylinder_rest_at_their_side(void)
{
    const excitation_request_t steps = {EXCITATION_STEP, Q(3), 500, 0, 8000};
    unsigned rests = 0;
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_OK, motion_excite_axis(&m_motion, 1, &steps));
    for (unsigned ms = 0; ms < 8100; ms++) {
        run_ms(1);
        TEST_ASSERT_TRUE(at(2) >= 100 - 1e-6 && at(2) <= 103 + 1e-6);
        rests += m_fastest == 0 && at(2) > 102.999999;
    }
    TEST_ASSERT_GREATER_THAN_UINT(3000, rests);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 100, at(2));
    TEST_ASSERT_EQUAL_UINT32(0, motion_singular_stops(&m_motion));
}

static void test_signal_that_no_pose_has_is_refused(void)
{
    m_settings.signal_mm_q16 = Q(30000);
    m_settings.axis[AXIS_X].min_q16 = Q(-30000);
    m_settings.axis[AXIS_X].max_q16 = Q(30000);
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excite_pose(AXIS_X, 25000));
    TEST_ASSERT_EQUAL(HV_OK, excite_pose(AXIS_X, 5));
}

/* Each side takes an S-curve, and out and back at least must fit in. */
static void test_steps_that_do_not_fit_into_their_time_are_refused(void)
{
    const excitation_request_t steps = {EXCITATION_STEP, Q(10), 2000, 0, 3000};
    m_settings.signal_mm_s_q16 = Q(5);
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, motion_excite_axis(&m_motion, 0, &steps));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, motion_excite_pose(&m_motion, AXIS_Z, &steps));
    run_ms(100);
    TEST_ASSERT_TRUE(m_fastest == 0);
}

/* ---- singularities ---- */

/* A hexapod whose plate is turned so far that its cylinders hold it no more. */
static void test_jog_of_a_pose_ends_before_a_singularity(void)
{
    lengthen_strokes();
    m_settings.axis[AXIS_YAW].min_q16 = Q(-120);
    m_settings.axis[AXIS_YAW].max_q16 = Q(120);
    m_settings.jog_deg_s_q16 = Q(30);
    m_settings.jog_mm_s_q16 = Q(400);
    m_settings.engage_accel_mm_s2_q16 = Q(3000);
    serve_at_all(300);
    TEST_ASSERT_EQUAL(HV_OK, jog_pose(AXIS_YAW, 30));
    run_ms(20000);
    TEST_ASSERT_TRUE(motion_is_at_rest(&m_motion));
    const double yaw = mm(motion_pose(&m_motion)->axis_q32[AXIS_YAW]);
    printf("jog of yaw ends at %.1f deg\n", yaw);
    TEST_ASSERT_TRUE(yaw > 30 && yaw < 90);
    TEST_ASSERT_TRUE(kin_margin(motion_kin(&m_motion), motion_pose(&m_motion)) >= KIN_MARGIN_LEAST_Q32 * 99 / 100);
    TEST_ASSERT_EQUAL_UINT32(0, motion_singular_stops(&m_motion)); /* it was known before it began */
}

/* One cylinder after the other: each of them has its way, and where they lead together is seen on it. */
static void test_jog_of_a_cylinder_stops_before_a_singularity(void)
{
    static const double k_at[] = {260, 600, 891};
    m_settings = rig_tripod();
    for (unsigned i = 0; i < 3; i++) {
        m_settings.geometry.retracted_mm_q16[i] = Q(260);
        m_settings.stroke_mm_q16[i] = Q(1000);
    }
    m_settings.jog_mm_s_q16 = Q(50); /* its stop takes 6 mm, that of a ride less than 1 */
    serve_at(k_at);
    TEST_ASSERT_BITS_LOW(MOTION_NO_POSE, m_out.flags);
    TEST_ASSERT_TRUE(kin_margin(motion_kin(&m_motion), motion_pose(&m_motion)) >= KIN_MARGIN_LEAST_Q32);
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(0, -50));
    run_ms(9000);
    TEST_ASSERT_EQUAL_UINT32(1, motion_singular_stops(&m_motion));
    TEST_ASSERT_TRUE(motion_is_at_rest(&m_motion));
    TEST_ASSERT_TRUE(at(1) > 6);
    TEST_ASSERT_TRUE(kin_margin(motion_kin(&m_motion), motion_pose(&m_motion)) >= KIN_MARGIN_LEAST_Q32 * 99 / 100);
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(0, 50)); /* and there is a way back */
    run_ms(1000);
    TEST_ASSERT_EQUAL_UINT32(1, motion_singular_stops(&m_motion));
    TEST_ASSERT_TRUE(m_fastest > 45);
}

/* Nearer to one than is allowed, as torque may come on: a jog that leads away from it goes on. */
static void check_leads_out_from(int from_mm)
{
    static const double k_far[] = {260, 600, 891};
    m_settings = rig_tripod();
    for (unsigned i = 0; i < 3; i++) {
        m_settings.geometry.retracted_mm_q16[i] = Q(260);
        m_settings.stroke_mm_q16[i] = Q(1000);
    }
    serve_at(k_far);
    for (int to_mm = 259; to_mm >= from_mm; to_mm--) { /* turned there by hand: the pose is known all the way */
        motion_place_axis(&m_motion, 0, q32(to_mm));
        run_ms(1);
    }
    TEST_ASSERT_BITS_LOW(MOTION_NO_POSE, m_out.flags);
    const q32_t margin_q32 = kin_margin(motion_kin(&m_motion), motion_pose(&m_motion));
    TEST_ASSERT_TRUE(margin_q32 < KIN_MARGIN_LEAST_Q32);
    for (uint32_t stops = 1; stops <= 20; stops++) { /* not further in, however slow and often it is tried */
        TEST_ASSERT_EQUAL(HV_OK, stops % 3 == 0 ? jog_axis(2, 1) : jog_axis(0, stops % 3 == 1 ? -20 : -1));
        run_ms(200);
        TEST_ASSERT_EQUAL_UINT32(stops, motion_singular_stops(&m_motion));
    }
    TEST_ASSERT_TRUE(at(1) > from_mm - 0.1);
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(0, 1));
    run_ms(1000);
    TEST_ASSERT_EQUAL_UINT32(20, motion_singular_stops(&m_motion));
    TEST_ASSERT_TRUE(at(1) > from_mm + 0.5);
    motion_stop(&m_motion);
    run_ms(200);
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(0, 20));
    run_ms(1000);
    TEST_ASSERT_EQUAL_UINT32(20, motion_singular_stops(&m_motion));
    TEST_ASSERT_TRUE(at(1) > 145);
    TEST_ASSERT_TRUE(kin_margin(motion_kin(&m_motion), motion_pose(&m_motion)) > margin_q32);
}

static void test_jog_of_a_cylinder_leads_out_of_a_singularity(void)
{
    check_leads_out_from(134);
    check_leads_out_from(136);
}

/* ---- by hand ---- */

/* No pose on a line that was looked at is out of reach. Were one, the cylinders would not leave for it. */
static void test_cylinders_stay_where_a_line_has_no_pose(void)
{
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_OK, jog_pose(AXIS_X, 20));
    run_ms(300);
    m_motion.plan.path.way.straight.from_q32[AXIS_X] = m_motion.plan.path.way.straight.to_q32[AXIS_X] = q32_from_int(20000);
    double before[CYLINDERS_MAX];
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        before[i] = at(i + 1);
    }
    run_ms(2000);
    TEST_ASSERT_TRUE(m_fastest <= JOG_MM_S + TINY_MM_S);
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(2, before[i], at(i + 1)); /* the way of a stop */
    }
}

/* A cylinder pushed after its stop is led to rest by the limits of the jog, and then stands. */
static void test_cylinder_that_is_pushed_after_its_stop_comes_to_rest(void)
{
    serve_at_all(100);
    TEST_ASSERT_EQUAL(HV_OK, jog_axis(2, 10));
    run_ms(1000);
    motion_stop(&m_motion);
    while (m_motion.source != MOTION_RESTING) {
        run_ms(1);
    }
    m_motion.jog.moved = 1u << 2;
    m_motion.jog.ramp[2].state.vel_per_cycle_q32 = q32(0.005);
    run_ms(1);
    TEST_ASSERT_EQUAL_HEX32(1u << 2, m_motion.jog.moved);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, jog_axis(2, 10));
    run_ms(1000);
    TEST_ASSERT_EQUAL_HEX32(0, m_motion.jog.moved);
    TEST_ASSERT_TRUE(m_fastest < JOG_MM_S && motion_is_at_rest(&m_motion));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_begins_outside_of_manual_operation);
    RUN_TEST(test_nothing_begins_before_the_last_cylinder_rests);
    RUN_TEST(test_jog_of_no_speed_is_refused);
    RUN_TEST(test_jog_speed_of_zero_in_the_settings_moves_nothing);
    RUN_TEST(test_signal_speed_of_zero_in_the_settings_moves_nothing);
    RUN_TEST(test_axis_that_is_not_moved_is_refused_by_name);
    RUN_TEST(test_pose_is_not_moved_where_none_belongs_to_the_extensions);
    RUN_TEST(test_jog_is_no_faster_than_the_platform_ever_is);
    RUN_TEST(test_jog_of_a_pose_keeps_the_speed_of_its_axis);
    RUN_TEST(test_signal_is_no_faster_than_a_ride);
    RUN_TEST(test_jog_from_beyond_the_stroke_leads_back_only);
    RUN_TEST(test_jog_of_a_pose_from_beyond_the_stroke_leads_back_only);
    RUN_TEST(test_jog_of_a_pose_ends_where_its_axis_does);
    RUN_TEST(test_signal_needs_way_to_both_sides);
    RUN_TEST(test_signal_of_a_pose_moves_no_cylinder_further_out);
    RUN_TEST(test_steps_of_a_cylinder_rest_at_their_side);
    RUN_TEST(test_signal_that_no_pose_has_is_refused);
    RUN_TEST(test_steps_that_do_not_fit_into_their_time_are_refused);
    RUN_TEST(test_jog_of_a_pose_ends_before_a_singularity);
    RUN_TEST(test_jog_of_a_cylinder_stops_before_a_singularity);
    RUN_TEST(test_jog_of_a_cylinder_leads_out_of_a_singularity);
    RUN_TEST(test_cylinders_stay_where_a_line_has_no_pose);
    RUN_TEST(test_cylinder_that_is_pushed_after_its_stop_comes_to_rest);
    return UNITY_END();
}

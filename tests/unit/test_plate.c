/* SPDX-License-Identifier: MIT
 * test_plate.c - pose, speed and acceleration of the plate from feedback, judged by motions whose derivatives are known: the
 * extensions come from a mechanism in double precision, the expected rates from the formula of the motion.
 */
#include <math.h>
#include <string.h>

#include "heave/plate.h"
#include "unity.h"

#define CYLINDERS 6u
#define CYCLE_US  1000u
#define PI        3.14159265358979323846

/* A motion: an axis' value, speed and acceleration at a time in s. */
typedef void motion_of_t(double t, double value[POSE_AXES], double speed[POSE_AXES], double accel[POSE_AXES]);

static kin_geometry_t m_geometry;
static kin_t m_kin;
static plate_t m_plate;
static drive_feedback_t m_feedback[CYLINDERS_MAX];

void setUp(void)
{
    static const double k_base_deg[CYLINDERS] = {-8, 8, 112, 128, 232, 248},
                        k_plate_deg[CYLINDERS] = {-50, 50, 70, 170, 190, 290};
    memset(&m_geometry, 0, sizeof m_geometry);
    m_geometry.kind = KIN_HEXAPOD;
    for (unsigned i = 0; i < CYLINDERS; i++) {
        m_geometry.base_mm_q16[i][0] = (q16_t)lround(420 * cos(k_base_deg[i] * PI / 180) * Q16_ONE);
        m_geometry.base_mm_q16[i][1] = (q16_t)lround(420 * sin(k_base_deg[i] * PI / 180) * Q16_ONE);
        m_geometry.plate_mm_q16[i][0] = (q16_t)lround(300 * cos(k_plate_deg[i] * PI / 180) * Q16_ONE);
        m_geometry.plate_mm_q16[i][1] = (q16_t)lround(300 * sin(k_plate_deg[i] * PI / 180) * Q16_ONE);
        m_geometry.retracted_mm_q16[i] = 520 * Q16_ONE;
    }
    m_geometry.zero_height_mm_q16 = 560 * Q16_ONE;
    TEST_ASSERT_EQUAL(HV_OK, kin_init(&m_kin, &m_geometry));
    memset(m_feedback, 0, sizeof m_feedback);
    plate_init(&m_plate);
}

void tearDown(void) {}

/* Turned about X, then Y, then Z, one after the other. */
static double model_extension(const double pose[POSE_AXES], unsigned i)
{
    double p[3], sum = 0;
    for (unsigned k = 0; k < 3; k++) {
        p[k] = (double)m_geometry.plate_mm_q16[i][k] / Q16_ONE;
    }
    for (unsigned axis = 0; axis < 3; axis++) {
        const double c = cos(pose[axis] * PI / 180), s = sin(pose[axis] * PI / 180);
        const unsigned a = (axis + 1) % 3, b = (axis + 2) % 3;
        const double first = c * p[a] - s * p[b];
        p[b] = s * p[a] + c * p[b];
        p[a] = first;
    }
    p[2] += 560;
    for (unsigned k = 0; k < 3; k++) {
        const double d = p[k] + pose[3 + k] - (double)m_geometry.base_mm_q16[i][k] / Q16_ONE;
        sum += d * d;
    }
    return sqrt(sum) - 520;
}

static void feed(const double pose[POSE_AXES], uint64_t at_us, double count_mm)
{
    for (unsigned i = 0; i < CYLINDERS; i++) {
        const double mm = model_extension(pose, i);
        m_feedback[i].has_actual = true;
        m_feedback[i].actual_us = at_us;
        m_feedback[i].actual_mm_q32 = (q32_t)llround((count_mm > 0 ? count_mm * round(mm / count_mm) : mm) * (double)Q32_ONE);
    }
}

static void take(uint64_t now_us)
{
    const pose_t zero = {{0}};
    plate_step(&m_plate, &m_kin, m_feedback, &zero, now_us);
}

static double real(q32_t value_q32)
{
    return (double)value_q32 / (double)Q32_ONE;
}

/* Swings of all axes at once, 0.3 to 0.8 Hz. */
static void swing(double t, double value[], double speed[], double accel[])
{
    static const double k_size[POSE_AXES] = {6, 5, 8, 30, 25, 40}, k_hz[POSE_AXES] = {0.5, 0.4, 0.3, 0.6, 0.8, 0.5};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const double w = 2 * PI * k_hz[i];
        value[i] = k_size[i] * sin(w * t + i);
        speed[i] = k_size[i] * w * cos(w * t + i);
        accel[i] = -k_size[i] * w * w * sin(w * t + i);
    }
}

/* From -4 s on, so that it is in the middle of the workspace after 4 s: constant acceleration of every axis. */
static void accelerate(double t, double value[], double speed[], double accel[])
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        accel[i] = i < AXIS_X ? 12 + i : 60 - 10.0 * i;
        speed[i] = accel[i] * (t - 0.5) + i;
        value[i] = accel[i] * (t - 0.5) * (t - 0.5) / 2 + i * (t - 0.5);
    }
}

static void hang(double t, double value[], double speed[], double accel[])
{
    (void)t;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        value[i] = 3.0 + i;
        speed[i] = accel[i] = 0;
    }
}

/* Worst errors of speed and acceleration over a motion, against what they were so much before. */
typedef struct {
    double speed, accel, speed_size, accel_size, pose;
    unsigned told;
} errors_t;

static errors_t run(motion_of_t *motion, double seconds, uint64_t bus_us, double count_mm, double speed_late_s,
                    double accel_late_s)
{
    errors_t worst = {0, 0, 0, 0, 0, 0};
    uint64_t fed_us = 0;
    for (uint64_t now_us = CYCLE_US; (double)now_us < seconds * 1e6; now_us += CYCLE_US) {
        double value[POSE_AXES], speed[POSE_AXES], accel[POSE_AXES], ignored[POSE_AXES];
        if (fed_us == 0 || now_us - fed_us >= bus_us) {
            motion((double)now_us / 1e6, value, speed, accel);
            feed(value, now_us, count_mm);
            fed_us = now_us;
        }
        take(now_us);
        TEST_ASSERT_TRUE(m_plate.has_pose);
        motion((double)m_plate.at_us / 1e6, value, speed, accel);
        for (unsigned i = 0; i < POSE_AXES; i++) {
            worst.pose = fmax(worst.pose, fabs(real(m_plate.pose.axis_q32[i]) - value[i]));
        }
        if (!m_plate.has_rates) {
            continue;
        }
        worst.told++;
        motion((double)m_plate.at_us / 1e6 - speed_late_s, value, speed, ignored);
        motion((double)m_plate.at_us / 1e6 - accel_late_s, value, ignored, accel);
        for (unsigned i = 0; i < POSE_AXES; i++) {
            worst.speed = fmax(worst.speed, fabs(real(m_plate.speed_per_s.axis_q32[i]) - speed[i]));
            worst.accel = fmax(worst.accel, fabs(real(m_plate.accel_per_s2.axis_q32[i]) - accel[i]));
            worst.speed_size = fmax(worst.speed_size, fabs(speed[i]));
            worst.accel_size = fmax(worst.accel_size, fabs(accel[i]));
        }
    }
    return worst;
}

static void test_take_constant_acceleration_is_told_exactly(void)
{
    static const uint64_t k_bus_us[] = {1000, 4000, 7000, 10000, 30000};
    for (unsigned i = 0; i < sizeof k_bus_us / sizeof k_bus_us[0]; i++) {
        setUp();
        const errors_t worst = run(accelerate, 1.0, k_bus_us[i], 0, 0, 0);
        TEST_ASSERT_TRUE(worst.told > 200);
        TEST_ASSERT_TRUE(worst.pose < 1e-6);
        TEST_ASSERT_TRUE_MESSAGE(worst.speed < 0.01 * worst.speed_size, "speed");
        TEST_ASSERT_TRUE_MESSAGE(worst.accel < 0.02 * worst.accel_size, "acceleration");
        double value[POSE_AXES], speed[POSE_AXES], accel[POSE_AXES]; /* long after the start: exact */
        accelerate((double)m_plate.at_us / 1e6, value, speed, accel);
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            TEST_ASSERT_DOUBLE_WITHIN(0.01, speed[axis], real(m_plate.speed_per_s.axis_q32[axis]));
            TEST_ASSERT_DOUBLE_WITHIN(0.1, accel[axis], real(m_plate.accel_per_s2.axis_q32[axis]));
        }
    }
}

static void test_take_swinging_plate_is_told_within_a_few_percent(void)
{
    static const uint64_t k_bus_us[] = {1000, 4000, 10000};
    for (unsigned i = 0; i < sizeof k_bus_us / sizeof k_bus_us[0]; i++) {
        setUp();
        const errors_t worst = run(swing, 6.0, k_bus_us[i], 0, 0, 0.02);
        TEST_ASSERT_TRUE(worst.told > 5000);
        TEST_ASSERT_TRUE(worst.pose < 1e-6);
        TEST_ASSERT_TRUE_MESSAGE(worst.speed < 0.02 * worst.speed_size, "speed");
        TEST_ASSERT_TRUE_MESSAGE(worst.accel < 0.05 * worst.accel_size, "acceleration");
    }
}

static void test_take_standing_plate_has_no_speed(void)
{
    (void)run(hang, 1.0, 1000, 0, 0, 0);
    TEST_ASSERT_TRUE(m_plate.has_rates);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        TEST_ASSERT_INT64_WITHIN(16, 0, m_plate.speed_per_s.axis_q32[i]); /* of 2^32 */
        TEST_ASSERT_INT64_WITHIN(1024, 0, m_plate.accel_per_s2.axis_q32[i]);
    }
}

static void test_take_counts_of_a_micrometre_do_not_shake_it(void)
{
    const errors_t worst = run(swing, 4.0, 4000, 0.001, 0, 0.02);
    TEST_ASSERT_TRUE(worst.speed < 0.03 * worst.speed_size);
    TEST_ASSERT_TRUE(worst.accel < 0.1 * worst.accel_size);
}

static void test_take_without_feedback_of_every_cylinder_there_is_nothing(void)
{
    double value[POSE_AXES], ignored[POSE_AXES];
    hang(0, value, ignored, ignored);
    take(CYCLE_US);
    TEST_ASSERT_FALSE(m_plate.has_pose);
    feed(value, CYCLE_US, 0);
    m_feedback[3].has_actual = false;
    take(CYCLE_US);
    TEST_ASSERT_FALSE(m_plate.has_pose);
    m_feedback[3].has_actual = true;
    take(CYCLE_US);
    TEST_ASSERT_TRUE(m_plate.has_pose);
    TEST_ASSERT_FALSE(m_plate.has_rates);
    m_feedback[3].has_actual = false;
    take(2 * CYCLE_US);
    TEST_ASSERT_FALSE(m_plate.has_pose);
}

static void test_take_stale_feedback_tells_no_speed_and_the_filter_starts_anew(void)
{
    double value[POSE_AXES], ignored[POSE_AXES];
    (void)run(swing, 1.0, 1000, 0, 0, 0);
    const uint64_t last_us = m_plate.at_us;
    take(last_us + PLATE_GAP_US);
    TEST_ASSERT_TRUE(m_plate.has_rates);
    take(last_us + PLATE_GAP_US + CYCLE_US);
    TEST_ASSERT_FALSE(m_plate.has_rates);
    TEST_ASSERT_TRUE(m_plate.has_pose);
    hang(0, value, ignored, ignored);
    for (unsigned i = 0; i < PLATE_SAMPLES; i++) {
        const uint64_t now_us = last_us + 200000 + i * PLATE_PERIOD_US;
        TEST_ASSERT_FALSE(m_plate.has_rates);
        feed(value, now_us, 0);
        take(now_us);
    }
    TEST_ASSERT_TRUE(m_plate.has_rates);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, real(m_plate.speed_per_s.axis_q32[AXIS_Z]));
}

/* A drive that was started anew counts its time from an earlier moment on: nothing is divided by that. */
static void test_take_time_that_goes_back_is_a_gap(void)
{
    double value[POSE_AXES], ignored[POSE_AXES];
    (void)run(swing, 1.0, 1000, 0, 0, 0);
    TEST_ASSERT_TRUE(m_plate.has_rates);
    hang(0, value, ignored, ignored);
    for (unsigned i = 0; i < PLATE_SAMPLES; i++) {
        feed(value, 500000 + i * PLATE_PERIOD_US, 0);
        take(1000000 + i * PLATE_PERIOD_US);
        TEST_ASSERT_TRUE(m_plate.has_pose);
        TEST_ASSERT_EQUAL_UINT64(500000 + i * PLATE_PERIOD_US, m_plate.at_us);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, real(m_plate.speed_per_s.axis_q32[AXIS_Z]));
    }
}

static void test_take_jump_of_the_feedback_is_no_speed(void)
{
    double value[POSE_AXES], ignored[POSE_AXES];
    (void)run(hang, 0.5, 1000, 0, 0, 0);
    hang(0, value, ignored, ignored);
    value[AXIS_Z] += 30; /* homing ends */
    for (unsigned i = 0; i < 40; i++) {
        const uint64_t now_us = 500000 + i * PLATE_PERIOD_US;
        feed(value, now_us, 0);
        take(now_us);
        TEST_ASSERT_TRUE(m_plate.has_pose);
        TEST_ASSERT_TRUE(!m_plate.has_rates || fabs(real(m_plate.speed_per_s.axis_q32[AXIS_Z])) < 0.01);
    }
    TEST_ASSERT_TRUE(m_plate.has_rates);
}

static void test_take_extensions_of_no_pose_are_told_as_none_and_it_recovers(void)
{
    double value[POSE_AXES], ignored[POSE_AXES];
    (void)run(hang, 0.5, 1000, 0, 0, 0);
    m_feedback[0].actual_mm_q32 = q32_from_int(30000);
    for (unsigned i = 0; i < CYLINDERS; i++) {
        m_feedback[i].actual_us = 600000;
    }
    take(600000);
    TEST_ASSERT_FALSE(m_plate.has_pose);
    TEST_ASSERT_FALSE(m_plate.has_rates);
    hang(0, value, ignored, ignored);
    for (uint64_t now_us = 601000; now_us < 600000 + PLATE_PERIOD_US; now_us += CYCLE_US) {
        feed(value, now_us, 0);
        take(now_us);
        TEST_ASSERT_FALSE_MESSAGE(m_plate.has_pose, "looked for in every cycle");
    }
    feed(value, 600000 + PLATE_PERIOD_US, 0);
    take(600000 + PLATE_PERIOD_US);
    TEST_ASSERT_TRUE(m_plate.has_pose);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, value[AXIS_Z], real(m_plate.pose.axis_q32[AXIS_Z]));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_take_constant_acceleration_is_told_exactly);
    RUN_TEST(test_take_swinging_plate_is_told_within_a_few_percent);
    RUN_TEST(test_take_standing_plate_has_no_speed);
    RUN_TEST(test_take_counts_of_a_micrometre_do_not_shake_it);
    RUN_TEST(test_take_without_feedback_of_every_cylinder_there_is_nothing);
    RUN_TEST(test_take_stale_feedback_tells_no_speed_and_the_filter_starts_anew);
    RUN_TEST(test_take_time_that_goes_back_is_a_gap);
    RUN_TEST(test_take_jump_of_the_feedback_is_no_speed);
    RUN_TEST(test_take_extensions_of_no_pose_are_told_as_none_and_it_recovers);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_coordinated_step.c - all pose axes at once, with more than the cylinders can do: no cylinder is left behind, each axis
 * keeps its limits, and the pose stays on its way. Limits of the cylinders are judged by the rig in every cycle of every test.
 */
#include <math.h>
#include <stdio.h>

#include "random.h"
#include "rig.h"
#include "unity.h"

static rig_t m_rig;
static rig_t m_ready; /* following, at neutral, nothing moving */
static bool m_is_ready;

/* What the pose axes did in the cycles of a test. */
static struct {
    double last[POSE_AXES][4]; /* the newest first */
    double accel, jerk;        /* the largest shares of a limit */
    unsigned cycles, off_path;
} m_seen;

void setUp(void)
{
    random_begin(RANDOM_SEED);
    if (!m_is_ready) {
        const settings_t settings = rig_hexapod();
        rig_start(&m_rig, &settings, true);
        m_rig.is_auto_checking = true;
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        rig_send(&m_rig, "@A6:0,0,0,0,0,0#");
        rig_run_ms(&m_rig, 3000);
        m_ready = m_rig;
        m_is_ready = true;
    }
    m_rig = m_ready; /* at the same address, so that what points into it stays right */
    m_seen.cycles = 0;
    m_seen.off_path = 0;
    m_seen.accel = 0;
    m_seen.jerk = 0;
}

void tearDown(void)
{
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    TEST_ASSERT_EQUAL(FAULT_NONE, m_rig.gateway.snapshot.fault.code);
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* A cycle, and a look at the pose after it. */
static void run_cycle(void)
{
    rig_run_ms(&m_rig, 1);
    m_seen.cycles++;
    m_seen.off_path += (m_rig.gateway.snapshot.flags & MOTION_OFF_PATH) != 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        double *at = m_seen.last[i];
        for (unsigned age = 3; age > 0; age--) {
            at[age] = at[age - 1];
        }
        at[0] = rig_pose(&m_rig, i);
        const double acc = at[0] - 2 * at[1] + at[2];
        const double jerk = acc - (at[1] - 2 * at[2] + at[3]);
        const axis_settings_t *axis = &m_rig.settings.axis[i];
        m_seen.accel = m_seen.cycles > 2 ? larger(m_seen.accel, fabs(acc) * 1e6 / (axis->accel_q16 / 65536.0)) : 0;
        m_seen.jerk = m_seen.cycles > 3 ? larger(m_seen.jerk, fabs(jerk) * 1e9 / axis->jerk) : 0;
    }
}

static void send(const double pose[POSE_AXES])
{
    rig_sendf(&m_rig, "@A6:%.4f,%.4f,%.4f,%.4f,%.4f,%.4f#", pose[0], pose[1], pose[2], pose[3], pose[4], pose[5]);
}

/* All axes swing, each in its own way: speeds and accelerations of so many times what is comfortable. */
typedef struct {
    double size[POSE_AXES], hz[POSE_AXES], phase[POSE_AXES];
} ride_t;

static ride_t some_ride(double low_hz, double high_hz)
{
    ride_t ride;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        ride.size[i] = random_between(0.5, 1) * (i < AXIS_X ? 3 : 15);
        ride.hz[i] = random_between(low_hz, high_hz);
        ride.phase[i] = random_between(0, 6.28);
    }
    return ride;
}

static void pose_of(const ride_t *ride, double t_s, double pose[POSE_AXES])
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose[i] = ride->size[i] * (sin(6.2832 * ride->hz[i] * t_s + ride->phase[i]) - sin(ride->phase[i]));
    }
}

/* 60 Hz for so long, then silence. */
static void run_ride(const ride_t *ride, unsigned ride_ms, unsigned silent_ms)
{
    double pose[POSE_AXES];
    for (unsigned t = 0; t < ride_ms + silent_ms; t++) {
        if (t < ride_ms && t % 50 % 17 == 0) {
            pose_of(ride, t / 1000.0, pose);
            send(pose);
        }
        run_cycle();
    }
}

static void expect_together(void)
{
    TEST_ASSERT_EQUAL_UINT(0, m_seen.off_path);
    TEST_ASSERT_TRUE(m_seen.accel <= 1.0001);
    TEST_ASSERT_TRUE(m_seen.jerk <= 1.001);
}

static void test_rides_of_all_axes_leave_no_cylinder_behind(void)
{
    double accel = 0;
    double jerk = 0;
    for (int i = 0; i < 30; i++) {
        m_rig = m_ready;
        m_seen.cycles = 0;
        const ride_t ride = some_ride(0.3, 0.5 + i % 6);
        run_ride(&ride, 3000, 1000);
        expect_together();
        accel = larger(accel, m_seen.accel);
        jerk = larger(jerk, m_seen.jerk);
    }
    printf("six axes at once: acceleration %.3f, jerk %.3f of an axis' limit\n", accel, jerk);
    TEST_ASSERT_TRUE(jerk > 0.5); /* or it would be no test */
}

static void test_a_sender_that_leaps_to_zero_and_stops_leaves_no_cylinder_behind(void)
{
    for (int i = 0; i < 30; i++) {
        m_rig = m_ready;
        m_seen.cycles = 0;
        const ride_t ride = some_ride(0.3, 1.2);
        run_ride(&ride, 1500 + 40 * (unsigned)i, 0);
        for (unsigned n = 0; n < 3; n++) {
            send((const double[POSE_AXES]){0});
            for (unsigned t = 0; t < 20; t++) {
                run_cycle();
            }
        }
        for (unsigned t = 0; t < 1500; t++) {
            run_cycle();
        }
        expect_together();
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            TEST_ASSERT_DOUBLE_WITHIN(0.005, 0, rig_pose(&m_rig, axis));
        }
    }
}

static void test_noise_of_all_axes_leaves_no_cylinder_behind(void)
{
    for (int i = 0; i < 10; i++) {
        m_rig = m_ready;
        m_seen.cycles = 0;
        const double size = 0.4 * (i + 1);
        for (unsigned t = 0; t < 3000; t++) {
            if (t % 50 % 17 == 0) {
                double pose[POSE_AXES];
                for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                    pose[axis] = random_between(-size, size) * (axis < AXIS_X ? 0.3 : 3);
                }
                send(pose);
            }
            run_cycle();
        }
        expect_together();
    }
}

/* A sender that stands, and then sends noise on some axes. */
static void test_noise_that_begins_at_rest_hardly_leaves_its_range(void)
{
    static const unsigned k_axes[] = {0x20, 0x38, 0x07, 0x11, 0x3F};
    double farthest = 0;
    for (unsigned i = 0; i < 20; i++) {
        const double size = 0.5 * (1 << i / 5);
        m_rig = m_ready;
        m_seen.cycles = 0;
        for (unsigned t = 0; t < 4500; t++) {
            if (t % 50 % 17 == 0) {
                double pose[POSE_AXES];
                for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                    const bool is_noisy = t >= 1500 && (k_axes[i % 5] >> axis & 1) != 0;
                    pose[axis] = is_noisy ? random_between(-size, size) * (axis < AXIS_X ? 0.2 : 1) : 0;
                }
                send(pose);
            }
            run_cycle();
            for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                farthest = larger(farthest, fabs(rig_pose(&m_rig, axis)) / size / (axis < AXIS_X ? 0.2 : 1));
            }
        }
        expect_together();
    }
    printf("noise after a rest: at most %.2f of its range\n", farthest);
    TEST_ASSERT_TRUE(farthest < 1.5); /* a governor that waits for a second event: 10 */
}

/* How far the pose is from a line through neutral, as a share of the line; degrees count as ten mm. */
static double beside(const double way[POSE_AXES])
{
    double along = 0;
    double length = 0;
    double off = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const double weight = i < AXIS_X ? 100 : 1;
        along += weight * way[i] * rig_pose(&m_rig, i);
        length += weight * way[i] * way[i];
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const double by = rig_pose(&m_rig, i) - way[i] * along / length;
        off += (i < AXIS_X ? 100 : 1) * by * by;
    }
    return sqrt(off / length);
}

/* All axes along one line, and a stop dead: each axis by itself would brake in its own time, and the pose leave the line. */
static void test_what_stops_dead_hardly_leaves_its_line(void)
{
    double farthest = 0;
    for (int i = 0; i < 20; i++) {
        double pose[POSE_AXES];
        double way[POSE_AXES];
        m_rig = m_ready;
        m_seen.cycles = 0;
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            way[axis] = random_between(-1, 1) * (axis < AXIS_X ? 6 : 60);
        }
        for (unsigned t = 0; t < 1500; t++) {
            const double share = sin(0.004 * (t < 200 ? t : 200));
            for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                pose[axis] = way[axis] * share;
            }
            if (t % 50 % 17 == 0) {
                send(pose);
            }
            run_cycle();
            farthest = larger(farthest, beside(way));
        }
        expect_together();
    }
    printf("a stop dead: at most %.1f %% of the way beside it\n", 100 * farthest);
    TEST_ASSERT_TRUE(farthest < 0.05);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_rides_of_all_axes_leave_no_cylinder_behind);
    RUN_TEST(test_a_sender_that_leaps_to_zero_and_stops_leaves_no_cylinder_behind);
    RUN_TEST(test_noise_of_all_axes_leaves_no_cylinder_behind);
    RUN_TEST(test_noise_that_begins_at_rest_hardly_leaves_its_range);
    RUN_TEST(test_what_stops_dead_hardly_leaves_its_line);
    return UNITY_END();
}

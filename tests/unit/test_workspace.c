/* SPDX-License-Identifier: MIT
 * test_workspace.c - poses pulled into the workspace, on every ready-made platform: inside the stroke, in the asked direction,
 * with the cylinder that bounds them, and continuous. Judged by kin_inverse in double precision differences.
 */
#include "../../src/motion/workspace.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "config/config.h"
#include "platform/load.h"
#include "random.h"
#include "unity.h"

#define LSB 4294967296.0

static const char *const k_platforms[] = {"demo-hexapod", "hexapod-400",     "hexapod-435-300",
                                          "tripod",       "tripod-rotation", "can-raw-hexapod"};
enum { PLATFORMS = sizeof k_platforms / sizeof k_platforms[0] };

static config_t m_config;
static motion_t m_motion;

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

static void load(unsigned platform)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s.ini", HEAVE_CONFIG_DIR, k_platforms[platform]);
    TEST_ASSERT_EQUAL(0, config_load(path, &m_config, stderr));
    TEST_ASSERT_EQUAL(HV_OK, motion_init(&m_motion, &m_config.settings));
}

/* A pose somewhere in the box that the axes' own limits are. */
static pose_t random_pose(void)
{
    pose_t pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_limits_t *limits = &m_motion.platform.axis[i].limits;
        const double middle = (double)(limits->pos_min_q32 / 2 + limits->pos_max_q32 / 2);
        const double half = (double)(limits->pos_max_q32 / 2 - limits->pos_min_q32 / 2);
        pose.axis_q32[i] = m_motion.platform.is_axis_moved[i] ? (q32_t)(middle + half * random_between(-1, 1)) : 0;
    }
    return pose;
}

static double room_mm(const q32_t *extension_mm_q32, unsigned cylinder)
{
    const ramp_limits_t *limits = &m_motion.platform.cylinder[cylinder].limits;
    return fmin((double)(extension_mm_q32[cylinder] - limits->pos_min_q32),
                (double)(limits->pos_max_q32 - extension_mm_q32[cylinder])) /
           LSB;
}

/* Difference of two poses; degrees count with a lever of 500 mm. */
static double distance(const pose_t *a, const pose_t *b)
{
    double sum = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const double d = (double)(a->axis_q32[i] - b->axis_q32[i]) / LSB * (i < AXIS_X ? 500 * acos(-1) / 180 : 1);
        sum += d * d;
    }
    return sqrt(sum);
}

static void test_reach_pull_in_result_is_inside_on_the_way_and_bounded_by_the_named_cylinder(void)
{
    for (unsigned platform = 0; platform < PLATFORMS; platform++) {
        unsigned outside = 0;
        double worst_direction = 0, farthest_room = 0;
        load(platform);
        for (int run = 0; run < 3000; run++) {
            const pose_t asked = random_pose();
            pose_t pose = asked;
            q32_t extension[CYLINDERS_MAX], judged[CYLINDERS_MAX];
            q62_t share = 0;
            const unsigned cylinder = workspace_pull_in(&m_motion.platform, &pose, extension, &share);
            TEST_ASSERT_EQUAL(HV_OK, kin_inverse(&m_motion.platform.kin, &pose, judged));
            for (unsigned i = 0; i < m_motion.platform.cylinders; i++) {
                TEST_ASSERT_EQUAL_INT64(judged[i], extension[i]);
                TEST_ASSERT_TRUE(room_mm(judged, i) >= 0);
            }
            if (cylinder == 0) {
                TEST_ASSERT_EQUAL_MEMORY(&asked, &pose, sizeof pose);
                continue;
            }
            outside++;
            TEST_ASSERT_TRUE(cylinder <= m_motion.platform.cylinders);
            farthest_room = fmax(farthest_room, room_mm(judged, cylinder - 1));
            const double whole = distance(&asked, &m_motion.platform.neutral), kept = distance(&pose, &m_motion.platform.neutral);
            pose_t on_way;
            for (unsigned i = 0; i < POSE_AXES; i++) {
                on_way.axis_q32[i] =
                    m_motion.platform.neutral.axis_q32[i] +
                    (q32_t)((double)(asked.axis_q32[i] - m_motion.platform.neutral.axis_q32[i]) * (kept / whole));
            }
            worst_direction = fmax(worst_direction, distance(&pose, &on_way) / kept);
        }
        printf("%s: %u of 3000 pulled in; direction off by %.2g at most, bounding cylinder %.4f mm from its end at most\n",
               k_platforms[platform], outside, worst_direction, farthest_room);
        TEST_ASSERT_TRUE(outside > 100);
        TEST_ASSERT_TRUE(worst_direction < 1e-6);
        TEST_ASSERT_TRUE(farthest_room < 0.05);
    }
}

/* Beyond what kinematics takes at all, as beyond the strokes: pulled in on the way there. */
static void test_reach_pull_in_pose_beyond_all_solving_comes_in_too(void)
{
    load(0);
    pose_t asked = m_motion.platform.neutral, pose;
    asked.axis_q32[AXIS_Z] += q32_from_int(12000);
    pose = asked;
    q32_t extension[CYLINDERS_MAX];
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, kin_inverse(&m_motion.platform.kin, &asked, extension));
    const unsigned cylinder = workspace_pull_in(&m_motion.platform, &pose, extension, NULL);
    TEST_ASSERT_EQUAL(HV_OK, kin_inverse(&m_motion.platform.kin, &pose, extension));
    double least = 1e9;
    for (unsigned i = 0; i < m_motion.platform.cylinders; i++) {
        least = fmin(least, room_mm(extension, i));
    }
    TEST_ASSERT_TRUE(cylinder != 0 && pose.axis_q32[AXIS_Z] > m_motion.platform.neutral.axis_q32[AXIS_Z]);
    TEST_ASSERT_TRUE(least >= 0 && least < 1);
}

/* A pose asked for a little differently is answered a little differently. */
static void test_reach_pull_in_is_continuous(void)
{
    for (unsigned platform = 0; platform < PLATFORMS; platform++) {
        double worst = 0;
        load(platform);
        for (int run = 0; run < 200; run++) {
            const pose_t from = random_pose(), to = random_pose();
            const double step = distance(&from, &to) / 400;
            pose_t last = {{0}};
            for (int k = 0; k <= 400; k++) {
                pose_t pose;
                q32_t extension[CYLINDERS_MAX];
                for (unsigned i = 0; i < POSE_AXES; i++) {
                    pose.axis_q32[i] = from.axis_q32[i] + (to.axis_q32[i] - from.axis_q32[i]) / 400 * k;
                }
                (void)workspace_pull_in(&m_motion.platform, &pose, extension, NULL);
                worst = k > 0 ? fmax(worst, distance(&pose, &last) / step) : worst;
                last = pose;
            }
        }
        printf("%s: the answer changes by at most %.2f times what was asked changes\n", k_platforms[platform], worst);
        TEST_ASSERT_TRUE(worst < 6);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_reach_pull_in_result_is_inside_on_the_way_and_bounded_by_the_named_cylinder);
    RUN_TEST(test_reach_pull_in_pose_beyond_all_solving_comes_in_too);
    RUN_TEST(test_reach_pull_in_is_continuous);
    return UNITY_END();
}

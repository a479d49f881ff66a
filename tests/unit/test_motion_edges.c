/* SPDX-License-Identifier: MIT
 * test_motion_edges.c - what a platform seldom or never gets into, made by hand: positions without a pose, cylinders thrown off
 * their path, ways beyond all solving; and what `fast` asks of one body.
 */
#include <math.h>
#include <stdlib.h>

#include "../../src/motion/path_check.h"
#include "rig.h"
#include "unity.h"

#define CYCLE_US 1000u

static motion_t m_motion;
static motion_output_t m_out;
static uint64_t m_now_us;

static void init(settings_t settings)
{
    m_now_us = 1000000;
    TEST_ASSERT_EQUAL(HV_OK, motion_init(&m_motion, &settings));
}

void setUp(void)
{
    init(rig_hexapod());
}

void tearDown(void) {}

/* One cycle; no cylinder may move faster than so. */
static void step(double most_mm_s)
{
    q32_t before_q32[CYLINDERS_MAX];
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        before_q32[i] = m_motion.platform.cylinder[i].state.pos_q32;
    }
    m_now_us += CYCLE_US;
    motion_step(&m_motion, m_now_us, &m_out);
    for (unsigned i = 0; i < m_motion.platform.cylinders; i++) {
        TEST_ASSERT_TRUE((double)llabs(m_out.extension_mm_q32[i] - before_q32[i]) / 4294967.296 <= most_mm_s);
    }
}

static void run_ms(unsigned ms, double most_mm_s)
{
    for (unsigned i = 0; i < ms; i++) {
        step(most_mm_s);
    }
}

static void take(const motion_target_t *target)
{
    TEST_ASSERT_EQUAL(HV_OK, motion_target(&m_motion, target, m_now_us));
}

static double mm(q32_t value_q32)
{
    return (double)value_q32 / 4294967296.0;
}

/* At neutral, following; no target yet. */
static void start_following(void)
{
    motion_rise(&m_motion);
    run_ms(10000, 400);
    motion_follow(&m_motion);
    step(0);
}

static void assert_extensions(const q32_t *expected_q32)
{
    for (unsigned i = 0; i < m_motion.platform.cylinders; i++) {
        TEST_ASSERT_EQUAL_INT64(expected_q32[i], m_out.extension_mm_q32[i]);
    }
}

/* ---- at rest is done, and nothing else ---- */

static void test_done_is_not_before_the_last_cylinder_rests(void)
{
    TEST_ASSERT_TRUE(motion_is_done(&m_motion));
    m_motion.platform.cylinder[4].state.pos_q32 += Q32_ONE / 10;
    m_motion.platform.cylinder[4].state.vel_per_cycle_q32 = Q32_ONE / 100;
    TEST_ASSERT_FALSE(motion_is_done(&m_motion));
    run_ms(500, 50);
    TEST_ASSERT_TRUE(motion_is_done(&m_motion));
    assert_extensions(m_motion.platform.settled_mm_q32);
}

static void test_path_is_not_over_before_a_cylinder_thrown_off_is_back(void)
{
    motion_rise(&m_motion);
    run_ms(10, 50);
    TEST_ASSERT_EQUAL(MOTION_ON_PATH, m_motion.source);
    while (!scurve_is_done(&m_motion.plan.path.way.straight.curve)) {
        TEST_ASSERT_FALSE(motion_is_done(&m_motion));
        m_motion.platform.cylinder[2].state.pos_q32 -= Q32_ONE / 1000; /* pushed down all the way */
        step(400);
    }
    for (unsigned i = 0; i < 3; i++) {
        TEST_ASSERT_FALSE(motion_is_done(&m_motion));
        TEST_ASSERT_EQUAL(MOTION_ON_PATH, m_motion.source);
        step(400);
    }
    run_ms(500, 400);
    TEST_ASSERT_TRUE(motion_is_done(&m_motion));
    assert_extensions(m_motion.platform.neutral_mm_q32);
}

/* ---- targets that cannot be ---- */

/* Strokes so long that not all extensions belong to a pose; these do not. */
static motion_target_t start_askew(void)
{
    settings_t settings = rig_hexapod();
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        settings.geometry.retracted_mm_q16[i] = 650 * Q16_ONE;
        settings.stroke_mm_q16[i] = 1200 * Q16_ONE;
    }
    init(settings);
    motion_target_t target = {.space = MOTION_CYLINDERS};
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        target.value_q32[i] = q32_from_int(i % 2 == 0 ? 1195 : 5);
    }
    return target;
}

/* Of extensions that can be at a tenth of the way, but not where the intensity has risen until their turn comes. */
static void test_target_that_intensity_makes_impossible_while_it_waits_is_dropped(void)
{
    const motion_target_t target = start_askew();
    const motion_target_t pose = {.space = MOTION_POSE, .value_q32 = {[AXIS_Z] = q32_from_int(10)}};
    motion_rise(&m_motion);
    run_ms(10000, 50);
    motion_follow(&m_motion);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, motion_target(&m_motion, &target, m_now_us));
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_motion, 10));
    step(0);
    motion_follow(&m_motion);
    take(&target);
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_motion, 100));
    run_ms(1000, 0);
    assert_extensions(m_motion.platform.neutral_mm_q32);
    take(&pose); /* what comes then is followed */
    run_ms(5000, 50);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 10, mm(m_out.sent.axis_q32[AXIS_Z]));
}

/* The axes have nowhere to begin then; the cylinders are led to the pose all the same, at engage speed. */
static void test_follow_a_pose_from_positions_without_one(void)
{
    const motion_target_t target = {.space = MOTION_POSE, .value_q32 = {[AXIS_ROLL] = q32_from_int(3)}};
    const motion_target_t from = start_askew();
    motion_place(&m_motion, from.value_q32, 0);
    step(0);
    TEST_ASSERT_BITS_HIGH(MOTION_NO_POSE, m_out.flags);
    motion_follow(&m_motion);
    step(0);
    take(&target);
    run_ms(10, 50);
    TEST_ASSERT_BITS_HIGH(MOTION_TAKEOVER, m_out.flags);
    run_ms(30000, 50.1);
    TEST_ASSERT_EQUAL_UINT(0, m_out.flags);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 3, mm(m_out.sent.axis_q32[AXIS_ROLL]));
    TEST_ASSERT_TRUE(motion_is_at_rest(&m_motion));
}

/* What comes on the way there waits for its end; the last of it counts. */
static void test_target_on_the_way_from_positions_without_a_pose_waits(void)
{
    motion_target_t target = {.space = MOTION_POSE, .value_q32 = {[AXIS_ROLL] = q32_from_int(3)}};
    const motion_target_t from = start_askew();
    motion_place(&m_motion, from.value_q32, 0);
    step(0);
    motion_follow(&m_motion);
    step(0);
    take(&target);
    run_ms(100, 50);
    TEST_ASSERT_EQUAL(MOTION_ON_PATH, m_motion.source);
    target.value_q32[AXIS_ROLL] = q32_from_int(-4);
    take(&target);
    run_ms(100, 50);
    TEST_ASSERT_EQUAL(MOTION_ON_PATH, m_motion.source);
    run_ms(30000, 50.1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -4, mm(m_out.sent.axis_q32[AXIS_ROLL]));
}

/* Cylinders that were thrown to where they have no pose while they were followed, and then a pose: no cylinder jumps, and the
 * platform gets there. */
static void test_pose_behind_extensions_that_lost_theirs_is_reached(void)
{
    const motion_target_t pose = {.space = MOTION_POSE, .value_q32 = {[AXIS_Z] = q32_from_int(10)}};
    motion_target_t extensions = {.space = MOTION_CYLINDERS};
    const motion_target_t askew = start_askew();
    start_following();
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        extensions.value_q32[i] = m_motion.platform.neutral_mm_q32[i];
    }
    take(&extensions);
    run_ms(3000, 400);
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        m_motion.platform.cylinder[i].state = (ramp_state_t){.pos_q32 = askew.value_q32[i]};
    }
    take(&pose);
    run_ms(30000, 400.1);
    TEST_ASSERT_TRUE(motion_is_at_rest(&m_motion));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 10, mm(m_out.sent.axis_q32[AXIS_Z]));
}

/* What a tripod does not move changes nothing of what it moves, however far it is asked for. */
static void test_axis_that_is_not_moved_is_told_and_left_out(void)
{
    const motion_target_t target = {.space = MOTION_POSE,
                                    .value_q32 = {[AXIS_X] = q32_from_int(40000), [AXIS_Z] = q32_from_int(20)}};
    init(rig_tripod());
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_motion, 50));
    motion_rise(&m_motion);
    run_ms(10000, 50);
    motion_follow(&m_motion);
    step(0);
    take(&target);
    run_ms(5000, 50);
    TEST_ASSERT_BITS_HIGH(MOTION_CLAMPED, m_out.flags);
    TEST_ASSERT_EQUAL_INT64(0, m_motion.targets.value_q32[AXIS_X]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 10, mm(m_out.sent.axis_q32[AXIS_Z]));
}

/* The frame of a timed move once more, at half of its time: the same goes on, one with another angle is a move of its own. */
static void test_timed_move_told_again_begins_anew_only_for_another_angle(void)
{
    static const struct {
        motion_target_t first, again;
        bool is_same;
    } k_moves[] = {
        {{.has_angle = false}, {.has_angle = false}, true},
        {{.has_angle = false}, {.has_angle = true}, false},
        {{.has_angle = true, .angle_deg_q32 = 10 * Q32_ONE}, {.has_angle = true, .angle_deg_q32 = 10 * Q32_ONE}, true},
        {{.has_angle = true, .angle_deg_q32 = 10 * Q32_ONE}, {.has_angle = true, .angle_deg_q32 = 11 * Q32_ONE}, false},
    };
    for (unsigned i = 0; i < sizeof k_moves / sizeof k_moves[0]; i++) {
        const motion_target_t rest = {.space = MOTION_POSE};
        motion_target_t first = k_moves[i].first, again = k_moves[i].again;
        first.is_timed = again.is_timed = true;
        first.time_ms = again.time_ms = 2000;
        first.value_q32[AXIS_Z] = again.value_q32[AXIS_Z] = q32_from_int(20);
        start_following();
        take(&rest);
        run_ms(1000, 400);
        take(&first);
        run_ms(1000, 400);
        take(&again);
        run_ms(1005, 400);
        TEST_ASSERT_EQUAL(k_moves[i].is_same, fabs(mm(m_out.sent.axis_q32[AXIS_Z]) - 20) < 1e-6);
        run_ms(1000, 400);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 20, mm(m_out.sent.axis_q32[AXIS_Z]));
    }
}

/* ---- take-over ---- */

static void take_extensions(double all_mm, bool is_timed)
{
    motion_target_t target = {.space = MOTION_CYLINDERS, .is_timed = is_timed, .time_ms = is_timed ? 3000 : 0};
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        target.value_q32[i] = (q32_t)(all_mm * 4294967296.0);
    }
    take(&target);
}

/* Extensions that creep and then jump to and fro by so much in a take-over, until they ask for more than twice the acceleration
 * there is, at hardly any speed; then a timed move, or a lone frame behind it in the same cycle. The platform goes there, at
 * engage speed all the way. */
static void check_jumps_are_left(double jump_mm, bool is_timed)
{
    const ramp_limits_t *limits = &m_motion.platform.cylinder[0].limits;
    init(rig_hexapod());
    start_following();
    for (unsigned ms = 0; llabs(m_motion.followed.past[0].acc_per_cycle2_q32) <= 2 * limits->acc_per_cycle2_q32; ms++) {
        TEST_ASSERT_TRUE(ms < 1300);
        if (ms % 10 == 0) {
            const double off_mm = ms / 10 % 2 ? jump_mm : -jump_mm;
            take_extensions(ms < 1100 ? 139 + ms * 0.01 : 150 + off_mm, false);
        }
        step(50.1);
    }
    TEST_ASSERT_TRUE(jump_mm > 0.3 || llabs(m_motion.followed.past[0].vel_per_cycle_q32) < limits->vel_per_cycle_q32);
    take_extensions(120, true);
    if (!is_timed) {
        take_extensions(120, false);
    }
    run_ms(4000, 50.1);
    TEST_ASSERT_TRUE(motion_is_at_rest(&m_motion));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 120, mm(m_out.extension_mm_q32[0]));
}

static void test_take_over_that_was_led_beyond_the_limits_begins_anew(void)
{
    for (unsigned i = 0; i < 2; i++) {
        check_jumps_are_left(0.3, i > 0);
        check_jumps_are_left(1, i > 0);
        check_jumps_are_left(10, i > 0);
    }
}

/* ---- ways ---- */

static void test_way_where_nothing_can_be_solved_is_not_feasible(void)
{
    const q32_t beyond_q32[POSE_AXES] = {[AXIS_X] = q32_from_int(20000)};
    const ramp_state_t rest[POSE_AXES] = {[AXIS_X] = {.pos_q32 = beyond_q32[AXIS_X]}};
    const ramp_state_t start[POSE_AXES] = {{.pos_q32 = 0}};
    const q32_t near_q32[POSE_AXES] = {[AXIS_X] = q32_from_int(10)};
    quintic_t quintic;
    TEST_ASSERT_EQUAL(HV_OK, quintic_plan(&quintic, POSE_AXES, start, near_q32, 1000));
    TEST_ASSERT_TRUE(path_check_is_feasible(&m_motion.platform, &quintic));
    TEST_ASSERT_EQUAL(HV_OK, quintic_plan(&quintic, POSE_AXES, rest, beyond_q32, 1000));
    TEST_ASSERT_FALSE(path_check_is_feasible(&m_motion.platform, &quintic));
}

static void test_way_where_nothing_can_be_solved_narrows_nothing(void)
{
    const q32_t from_q32[POSE_AXES] = {0};
    const q32_t near_q32[POSE_AXES] = {[AXIS_X] = q32_from_int(10)};
    const q32_t beyond_q32[POSE_AXES] = {[AXIS_X] = q32_from_int(20000)};
    const path_limits_t none = path_limits_none();
    path_limits_t limits = none;
    path_check_narrow(&m_motion.platform, m_motion.platform.cylinder, from_q32, beyond_q32, &limits);
    TEST_ASSERT_EQUAL_MEMORY(&none, &limits, sizeof limits);
    path_check_narrow(&m_motion.platform, m_motion.platform.cylinder, from_q32, near_q32, &limits);
    TEST_ASSERT_TRUE(limits.vel_q62 < none.vel_q62 && limits.acc_q62 < none.acc_q62 && limits.jerk_q62 < none.jerk_q62);
}

/* ---- what limits do not allow ---- */

/* A swing of 20 mm and 1.6 Hz at 50 Hz. */
static void test_stream_within_the_limits_is_not_smoothed(void)
{
    settings_t settings = rig_hexapod();
    settings.stream_style = STREAM_BALANCED;
    init(settings);
    motion_rise(&m_motion);
    run_ms(10000, 50);
    motion_follow(&m_motion);
    for (unsigned ms = 0; ms < 8000; ms++) {
        motion_target_t target = {.space = MOTION_POSE};
        if (ms % 20 == 0) {
            target.value_q32[AXIS_Z] = (q32_t)(20 * sin(ms * 1.6 * 6.283185307 / 1000) * 4294967296.0);
            take(&target);
        }
        step(400);
        TEST_ASSERT_TRUE(ms < 3200 || m_motion.stream.curve.governor.strength_q32 == 0);
    }
}

/* ---- intensity ---- */

/* A sine of 20 mm and 0.5 Hz for so many ms; how far it leads. */
static double stream_swing_mm(unsigned ms)
{
    double most = 0;
    for (unsigned at = 0; at < ms; at++) {
        motion_target_t target = {.space = MOTION_POSE};
        if (at % 20 == 0) {
            target.value_q32[AXIS_Z] = (q32_t)(20 * sin(at * 0.5 * 6.283185307 / 1000) * 4294967296.0);
            take(&target);
        }
        step(400);
        most = at >= 4000 ? fmax(most, fabs(mm(m_out.sent.axis_q32[AXIS_Z]))) : most; /* after take-over and change */
    }
    return most;
}

static void test_stream_is_scaled_by_the_intensity(void)
{
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_motion, 50));
    motion_rise(&m_motion);
    run_ms(10000, 50);
    motion_follow(&m_motion);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 10, stream_swing_mm(8000));
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_motion, 100));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 20, stream_swing_mm(8000));
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_motion, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, stream_swing_mm(8000));
}

/* Samples that come while the bus takes nothing are a stream before the first of them has been planned for. */
static void test_stream_from_the_first_cycle_on_does_not_go_on_along_what_the_last_one_left(void)
{
    motion_target_t target = {.space = MOTION_POSE};
    start_following();
    for (unsigned n = 0; n < 3; n++) {
        target.value_q32[AXIS_Z] = n * (Q32_ONE / 10);
        take(&target);
        m_now_us += 20000;
    }
    step(400);
    TEST_ASSERT_EQUAL(MOTION_STREAMED, m_motion.source);
}

/* What the intensity adds to a timed move is not planned twice: else the axes are led faster than they go, and lag. */
static void test_timed_move_planned_while_the_intensity_changes_starts_where_the_axes_are(void)
{
    start_following();
    motion_target_t target = {.space = MOTION_POSE, .is_timed = true, .time_ms = 3000};
    take(&target);
    run_ms(4000, 400); /* the first one is taken over, from rest */
    target.value_q32[AXIS_Z] = q32_from_int(60);
    take(&target);
    run_ms(1200, 400);
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_motion, 40));
    run_ms(400, 400);
    TEST_ASSERT_FALSE(intensity_is_still(&m_motion.intensity, m_motion.intensity.share_q46[0]));
    target.value_q32[AXIS_Z] = q32_from_int(-30);
    take(&target);
    for (unsigned ms = 0; ms < 3000; ms++) {
        step(400);
        TEST_ASSERT_EQUAL(MOTION_PLANNED, m_motion.source);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, mm(m_out.asked.axis_q32[AXIS_Z]), mm(m_out.sent.axis_q32[AXIS_Z]));
    }
    run_ms(10, 400);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -12, mm(m_out.sent.axis_q32[AXIS_Z]));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_done_is_not_before_the_last_cylinder_rests);
    RUN_TEST(test_path_is_not_over_before_a_cylinder_thrown_off_is_back);
    RUN_TEST(test_target_that_intensity_makes_impossible_while_it_waits_is_dropped);
    RUN_TEST(test_follow_a_pose_from_positions_without_one);
    RUN_TEST(test_target_on_the_way_from_positions_without_a_pose_waits);
    RUN_TEST(test_pose_behind_extensions_that_lost_theirs_is_reached);
    RUN_TEST(test_axis_that_is_not_moved_is_told_and_left_out);
    RUN_TEST(test_timed_move_told_again_begins_anew_only_for_another_angle);
    RUN_TEST(test_take_over_that_was_led_beyond_the_limits_begins_anew);
    RUN_TEST(test_way_where_nothing_can_be_solved_is_not_feasible);
    RUN_TEST(test_way_where_nothing_can_be_solved_narrows_nothing);
    RUN_TEST(test_stream_within_the_limits_is_not_smoothed);
    RUN_TEST(test_stream_is_scaled_by_the_intensity);
    RUN_TEST(test_stream_from_the_first_cycle_on_does_not_go_on_along_what_the_last_one_left);
    RUN_TEST(test_timed_move_planned_while_the_intensity_changes_starts_where_the_axes_are);
    return UNITY_END();
}

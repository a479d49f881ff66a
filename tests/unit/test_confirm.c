/* SPDX-License-Identifier: MIT
 * test_confirm.c - far jumps wait for a second frame: values written by hand, at the very edges of distance and time.
 */
#include "unity.h"

#include "heave/confirm.h"

#define MS(t) ((uint64_t)(t)*1000)

static confirm_t m_confirm;
static confirm_distance_t m_far;
static motion_target_t m_here;

void setUp(void)
{
    m_confirm = (confirm_t){.dropped = 0};
    m_far = (confirm_distance_t){q32_from_int(20), q32_from_int(5)};
    m_here = (motion_target_t){.space = MOTION_POSE, .has_angle = true};
}

void tearDown(void) {}

static motion_target_t pose(unsigned axis, q32_t value_q32)
{
    motion_target_t target = {.space = MOTION_POSE};
    target.value_q32[axis] = value_q32;
    return target;
}

static motion_target_t angle(int deg)
{
    return (motion_target_t){.space = MOTION_POSE, .has_angle = true, .angle_deg_q32 = q32_from_int(deg)};
}

/* As the gateway does: what passes is followed. */
static bool take(motion_target_t target, uint64_t now_us)
{
    confirm_cycle(&m_confirm, now_us);
    const bool passes = confirm_passes(&m_confirm, &m_far, &m_here, &target, now_us);
    if (passes) {
        confirm_followed(&m_confirm, &target);
    }
    return passes;
}

static bool take_z(int mm, uint64_t now_us)
{
    return take(pose(AXIS_Z, q32_from_int(mm)), now_us);
}

static void test_confirm_passes_what_is_near_at_once(void)
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q32_t far_q32 = q32_from_int(i <= AXIS_YAW ? 5 : 20);
        setUp();
        TEST_ASSERT_TRUE(take(pose(i, far_q32), 0));
        TEST_ASSERT_TRUE(take(pose(i, 0), MS(20)));
        TEST_ASSERT_TRUE(take(pose(i, -far_q32), MS(40)));
        TEST_ASSERT_FALSE(take(pose(i, 1), MS(60))); /* by one bit */
        TEST_ASSERT_EQUAL_UINT32(0, m_confirm.dropped);
    }
}

static void test_confirm_passes_second_frame_near_the_first_is_followed(void)
{
    TEST_ASSERT_FALSE(take_z(100, 0));
    TEST_ASSERT_TRUE(take_z(120, MS(20)));
    TEST_ASSERT_TRUE(take_z(110, MS(40))); /* measured from what was followed */
    TEST_ASSERT_EQUAL_UINT32(0, m_confirm.dropped);
}

static void test_confirm_passes_lone_jump_is_dropped_by_the_next_frame(void)
{
    TEST_ASSERT_TRUE(take_z(3, 0));
    TEST_ASSERT_FALSE(take_z(100, MS(20)));
    TEST_ASSERT_TRUE(take_z(4, MS(40)));
    TEST_ASSERT_EQUAL_UINT32(1, m_confirm.dropped);
    TEST_ASSERT_EQUAL_UINT8(AXIS_Z, m_confirm.drop.axis);
    TEST_ASSERT_EQUAL_INT64(q32_from_int(100), m_confirm.drop.value_q32);
    TEST_ASSERT_EQUAL_INT64(q32_from_int(3), m_confirm.drop.from_q32);
}

static void test_confirm_passes_jump_elsewhere_waits_itself(void)
{
    TEST_ASSERT_FALSE(take_z(100, 0));
    TEST_ASSERT_FALSE(take_z(-100, MS(20)));
    TEST_ASSERT_EQUAL_UINT32(1, m_confirm.dropped);
    TEST_ASSERT_FALSE(take_z(100, MS(40))); /* not confirmed by one that was dropped */
    TEST_ASSERT_TRUE(take_z(100, MS(60)));
    TEST_ASSERT_EQUAL_UINT32(2, m_confirm.dropped);
}

static void test_confirm_passes_same_frame_at_once_confirms_nothing(void)
{
    TEST_ASSERT_FALSE(take_z(100, 0));
    TEST_ASSERT_FALSE(take_z(100, 0));
    TEST_ASSERT_FALSE(take_z(100, CONFIRM_APART_US - 1));
    TEST_ASSERT_TRUE(take_z(100, CONFIRM_APART_US)); /* from the first one, not from the last copy */
    setUp();
    TEST_ASSERT_FALSE(take_z(100, 0));
    TEST_ASSERT_TRUE(take_z(101, 0)); /* another frame */
}

/* Copies of a datagram are the same in everything; another time, another space, or a word on the motor make another frame. */
static void test_confirm_passes_only_a_copy_counts_as_one(void)
{
    motion_target_t first = angle(0);
    first.value_q32[AXIS_Z] = q32_from_int(100);
    first.is_timed = true;
    first.time_ms = 500;
    for (unsigned what = 0; what < 4; what++) {
        motion_target_t second = first;
        second.is_timed = what != 1;
        second.time_ms = what == 2 ? 400 : 500;
        second.has_angle = what != 3;
        setUp();
        TEST_ASSERT_FALSE(take(first, 0));
        TEST_ASSERT_EQUAL(what != 0, take(second, 1));
    }
    setUp();
    TEST_ASSERT_FALSE(take(first, 0));
    first.space = MOTION_CYLINDERS; /* as numbers the same */
    m_here.space = MOTION_CYLINDERS;
    TEST_ASSERT_FALSE(take(first, 1));
    TEST_ASSERT_EQUAL_UINT32(1, m_confirm.dropped);
}

static void test_confirm_cycle_drops_what_waits_too_long(void)
{
    TEST_ASSERT_FALSE(take_z(100, 0));
    TEST_ASSERT_TRUE(take_z(100, CONFIRM_WAIT_US));
    TEST_ASSERT_EQUAL_UINT32(0, m_confirm.dropped);
    setUp();
    TEST_ASSERT_FALSE(take_z(100, 0));
    confirm_cycle(&m_confirm, CONFIRM_WAIT_US + 1);
    TEST_ASSERT_EQUAL_UINT32(1, m_confirm.dropped);
    TEST_ASSERT_FALSE(take_z(100, CONFIRM_WAIT_US + 2));
    TEST_ASSERT_TRUE(take_z(100, CONFIRM_WAIT_US + MS(20)));
}

static void test_confirm_passes_first_one_is_measured_from_the_platform(void)
{
    m_here.value_q32[AXIS_Z] = q32_from_int(90);
    TEST_ASSERT_TRUE(take_z(100, 0));
    TEST_ASSERT_FALSE(take_z(0, MS(20)));
    confirm_restart(&m_confirm); /* what waited is forgotten, and not counted: nobody asks for it any more */
    m_here.value_q32[AXIS_Z] = 0;
    TEST_ASSERT_TRUE(take_z(1, MS(40)));
    TEST_ASSERT_EQUAL_UINT32(0, m_confirm.dropped);
}

static void test_confirm_passes_extensions_are_measured_from_extensions(void)
{
    motion_target_t target = {.space = MOTION_CYLINDERS};
    TEST_ASSERT_TRUE(take_z(10, 0));
    m_here = (motion_target_t){.space = MOTION_CYLINDERS};
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        m_here.value_q32[i] = target.value_q32[i] = q32_from_int(100);
    }
    target.value_q32[0] = q32_from_int(106); /* more than 5, which are degrees of a pose only */
    TEST_ASSERT_TRUE(take(target, MS(20)));
    target.value_q32[5] = q32_from_int(121);
    TEST_ASSERT_FALSE(take(target, MS(40)));
    confirm_cycle(&m_confirm, MS(2000));
    TEST_ASSERT_EQUAL(MOTION_CYLINDERS, m_confirm.drop.space);
    TEST_ASSERT_EQUAL_UINT8(5, m_confirm.drop.axis);
    TEST_ASSERT_FALSE(take(target, MS(2000)));
    m_here = (motion_target_t){.space = MOTION_POSE};
    TEST_ASSERT_FALSE(take_z(121, MS(2020))); /* a pose confirms no extensions */
    TEST_ASSERT_EQUAL_UINT32(2, m_confirm.dropped);
}

static void test_confirm_passes_rotation_motor_counts_where_it_is_named(void)
{
    TEST_ASSERT_TRUE(take(angle(5), 0));
    TEST_ASSERT_TRUE(take_z(1, MS(20))); /* without an angle: the motor stays */
    TEST_ASSERT_FALSE(take(angle(11), MS(40)));
    TEST_ASSERT_TRUE(take(angle(11), MS(60)));
    TEST_ASSERT_EQUAL_UINT32(0, m_confirm.dropped);
    TEST_ASSERT_FALSE(take(angle(0), MS(80)));
    confirm_cycle(&m_confirm, MS(2000));
    TEST_ASSERT_EQUAL_UINT8(AXIS_ANGLE, m_confirm.drop.axis);
}

static void test_confirm_passes_zero_is_any_distance(void)
{
    m_far.mm_q32 = 0;
    TEST_ASSERT_TRUE(take_z(1000, 0));
    TEST_ASSERT_FALSE(take(pose(AXIS_ROLL, q32_from_int(6)), MS(20)));
    m_far = (confirm_distance_t){q32_from_int(20), 0};
    setUp();
    m_far.deg_q32 = 0;
    TEST_ASSERT_TRUE(take(pose(AXIS_ROLL, q32_from_int(60)), 0));
    TEST_ASSERT_TRUE(take(angle(3000), MS(20)));
    TEST_ASSERT_FALSE(take_z(21, MS(40)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_confirm_passes_what_is_near_at_once);
    RUN_TEST(test_confirm_passes_second_frame_near_the_first_is_followed);
    RUN_TEST(test_confirm_passes_lone_jump_is_dropped_by_the_next_frame);
    RUN_TEST(test_confirm_passes_jump_elsewhere_waits_itself);
    RUN_TEST(test_confirm_passes_same_frame_at_once_confirms_nothing);
    RUN_TEST(test_confirm_passes_only_a_copy_counts_as_one);
    RUN_TEST(test_confirm_cycle_drops_what_waits_too_long);
    RUN_TEST(test_confirm_passes_first_one_is_measured_from_the_platform);
    RUN_TEST(test_confirm_passes_extensions_are_measured_from_extensions);
    RUN_TEST(test_confirm_passes_rotation_motor_counts_where_it_is_named);
    RUN_TEST(test_confirm_passes_zero_is_any_distance);
    return UNITY_END();
}

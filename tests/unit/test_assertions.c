/* SPDX-License-Identifier: MIT
 * test_assertions.c - a state that no cycle leaves behind, as broken memory makes it: the next cycle ends the program, and the
 * drives have got nothing from it.
 */
#include <setjmp.h>
#include <string.h>

#include "rig.h"
#include "unity.h"

static rig_t m_rig;
static settings_t m_settings;
static jmp_buf m_failed;

void hv_assert_failed(const char *file, int line)
{
    (void)file;
    (void)line;
    longjmp(m_failed, 1);
}

void setUp(void)
{
    m_settings = rig_hexapod();
}

void tearDown(void) {}

/* A cycle with what stands in the gateway now. */
static void check_ends_without_set_points(const char *what)
{
    q32_t sent_q32[DRIVES_MAX];
    volatile bool has_ended = true;
    memcpy(sent_q32, m_rig.sent_q32, sizeof sent_q32);
    if (setjmp(m_failed) == 0) {
        rig_run_ms(&m_rig, 1);
        has_ended = false;
    }
    TEST_ASSERT_TRUE_MESSAGE(has_ended, what);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(sent_q32, m_rig.sent_q32, sizeof sent_q32, what);
}

/* In a ride, going up. */
static void ride(void)
{
    rig_start(&m_rig, &m_settings, true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    for (unsigned i = 0; i < 240; i++) {
        rig_sendf(&m_rig, "@A6:0,0,0,0,0,%f#", 0.05 * i);
        rig_run_ms(&m_rig, 16);
    }
    TEST_ASSERT_TRUE(gateway_snapshot(&m_rig.gateway)->state == STATE_ENGAGED && !motion_is_at_rest(&m_rig.gateway.motion));
}

/* Standing settled, with torque. */
static void settle(void)
{
    ride();
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 20000));
}

#define BROKEN_RIDE(member, value)                                                                                               \
    do {                                                                                                                         \
        ride();                                                                                                                  \
        m_rig.gateway.member = (value);                                                                                          \
        check_ends_without_set_points(#member " = " #value);                                                                     \
    } while (0)

static void test_a_sender_moves_a_platform_that_is_engaged_only(void)
{
    BROKEN_RIDE(sequencer.supervisor.state, STATE_HOLD);
    BROKEN_RIDE(sequencer.supervisor.state, STATE_FAULT);
    BROKEN_RIDE(sequencer.supervisor.state, STATE_SERVICE);
    BROKEN_RIDE(sequencer.supervisor.state, STATE_ESTOP);
    BROKEN_RIDE(motion.followed.phase, FOLLOW_NOBODY);
    BROKEN_RIDE(motion.jog.is_serving, true);
}

static void test_values_that_no_enumeration_has(void)
{
    BROKEN_RIDE(motion.source, (motion_source_t)9);
    BROKEN_RIDE(motion.next, (motion_next_t)7);
    BROKEN_RIDE(motion.due, (motion_due_t)200);
    BROKEN_RIDE(motion.followed.phase, (follow_phase_t)4);
    BROKEN_RIDE(sequencer.drive_control.bring_up, (bring_up_t)17);
}

static void test_a_platform_that_is_none(void)
{
    BROKEN_RIDE(motion.platform.cylinders, 0);
    BROKEN_RIDE(motion.platform.cylinders, 7);
}

static void test_a_path_of_no_axes(void)
{
    settle();
    m_rig.gateway.motion.plan.path.axes = 0;
    check_ends_without_set_points("no axes");
    settle();
    m_rig.gateway.motion.plan.path.axes = AXES_MAX + 1u;
    check_ends_without_set_points("too many axes");
}

static void test_a_set_point_beyond_the_speed_limit(void)
{
    ride();
    ramp_t *cylinder = &m_rig.gateway.motion.platform.cylinder[3];
    cylinder->state.vel_per_cycle_q32 = 3 * cylinder->limits.vel_per_cycle_q32;
    check_ends_without_set_points("three times the speed");
}

static void test_e_stop_has_the_set_points_on_the_actual_positions(void)
{
    settle();
    sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ESTOP, 1000));
    m_rig.gateway.sequencer.drive_control.is_tracking = false;
    check_ends_without_set_points("not tracking");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_sender_moves_a_platform_that_is_engaged_only);
    RUN_TEST(test_values_that_no_enumeration_has);
    RUN_TEST(test_a_platform_that_is_none);
    RUN_TEST(test_a_path_of_no_axes);
    RUN_TEST(test_a_set_point_beyond_the_speed_limit);
    RUN_TEST(test_e_stop_has_the_set_points_on_the_actual_positions);
    return UNITY_END();
}

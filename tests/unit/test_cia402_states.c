/* SPDX-License-Identifier: MIT
 * test_cia402_states.c - states of CANopen drives that no simulated drive gets into, made by hand: who is asked, stopped or left
 * alone then.
 */
#include <string.h>

#include "../../src/canopen/cia402_master.h"
#include "../../src/canopen/cia402_node.h"
#include "../../src/canopen/cia402_objects.h"
#include "../../src/canopen/cia402_stage.h"
#include "sim_can.h"
#include "unity.h"

#define AXES 3u

static cia402_config_t m_config;
static sim_can_bus_t m_bus;
static sim_can_t m_node;
static cia402_t m_driver;
static drives_t m_drives;

/* Drive 1 and 2 are one node, drive 3 is another. */
void setUp(void)
{
    m_config = (cia402_config_t){.axes = AXES,
                                 .master_node = 127,
                                 .mode = CIA402_MODE_CSP,
                                 .period_us = 2000,
                                 .heartbeat_ms = 50,
                                 .heartbeat_timeout_ms = 200,
                                 .sdo_timeout_ms = 50,
                                 .boot_timeout_ms = 1000,
                                 .power_timeout_ms = 1000,
                                 .abort_option = 3};
    m_config.reaction[CIA402_WATCH_MASTER] = CIA402_STOP;
    for (unsigned k = 0; k < AXES; k++) {
        m_config.axis[k] = (cia402_axis_config_t){
            .node = k < 2 ? 1 : 3, .channel = k == 1, .scale = {1000, 1, 0}, .step_max_q32 = Q32_ONE, .window_counts = 100};
    }
    sim_can_bus_init(&m_bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_node, &m_bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&m_driver, &m_config, sim_can_hal(&m_node)));
    m_drives = cia402_hal(&m_driver);
    m_driver.now_us = 1000000;
    m_driver.has_time = true;
    for (unsigned k = 0; k < AXES; k++) {
        cia402_axis_init(cia402_drive(&m_driver, k));
    }
}

void tearDown(void)
{
    sim_can_close(&m_node);
}

/* ---- another master ---- */

static void hear(void)
{
    const can_frame_t sync = {.id = 0x80};
    TEST_ASSERT_TRUE(cia402_master_receive(&m_driver, &sync));
    (void)cia402_master_step(&m_driver);
}

/* Those that have a fault already keep it, and those that are lost or refused stay so. */
static void test_master_stops_each_drive_by_where_it_is(void)
{
    m_driver.axis[0].phase = CIA402_UP;
    m_driver.axis[1].phase = CIA402_UP;
    m_driver.axis[1].own_fault = 0x8611;
    m_driver.axis[2].phase = CIA402_CONFIGURING;
    hear();
    TEST_ASSERT_EQUAL_HEX32(CIA402_OTHER_SYNC, m_driver.axis[0].own_fault);
    TEST_ASSERT_EQUAL_HEX32(0x8611, m_driver.axis[1].own_fault);
    TEST_ASSERT_EQUAL(CIA402_REFUSED, m_driver.axis[2].phase);
    m_driver.axis[0].phase = CIA402_LEAVING;
    m_driver.axis[1].phase = CIA402_REFUSED;
    hear();
    TEST_ASSERT_EQUAL(CIA402_LEAVING, m_driver.axis[0].phase);
    TEST_ASSERT_EQUAL(CIA402_REFUSED, m_driver.axis[1].phase);
}

/* It is not heard, and may have torque: the driver does not fall silent. */
static void test_master_is_not_waited_for_where_a_drive_may_have_torque(void)
{
    m_config.listen_ms = 500;
    m_driver.axis[2].phase = CIA402_CONFIGURING;
    m_driver.axis[2].live_answers = 3;
    TEST_ASSERT_TRUE(cia402_axis_is_energized(&m_driver.axis[2]));
    hear();
    TEST_ASSERT_FALSE(m_driver.master.is_listening);
    TEST_ASSERT_EQUAL(CIA402_REFUSED, m_driver.axis[2].phase);
    setUp();
    m_config.listen_ms = 500;
    hear();
    TEST_ASSERT_TRUE(m_driver.master.is_listening);
}

/* Nothing is sent to a bus that is gone, nor while another master leads it. */
static void test_reset_wakes_nobody_where_nothing_may_be_sent(void)
{
    m_driver.axis[0].phase = CIA402_REFUSED;
    m_driver.is_gone = true;
    cia402_master_wake(&m_driver);
    TEST_ASSERT_EQUAL(CIA402_REFUSED, m_driver.axis[0].phase);
    m_driver.is_gone = false;
    m_driver.master.is_listening = true;
    cia402_master_wake(&m_driver);
    TEST_ASSERT_EQUAL(CIA402_REFUSED, m_driver.axis[0].phase);
    m_driver.master.is_listening = false;
    cia402_master_wake(&m_driver);
    TEST_ASSERT_EQUAL(CIA402_MISSING, m_driver.axis[0].phase);
    TEST_ASSERT_EQUAL_HEX8(0x80, m_driver.axis[0].nmt_command);
}

/* ---- torque that is lost on the way ---- */

/* While the others come up: it does not get it again, and they are stopped. */
static void test_torque_that_is_lost_while_others_come_up_is_not_put_on_again(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        m_driver.axis[k].phase = CIA402_UP;
        m_driver.axis[k].is_in = true;
    }
    m_driver.stage = CIA402_STAGE_OPERATE;
    m_driver.stage_us = m_driver.now_us;
    m_driver.is_begun = true;
    m_driver.axis[1].operating_us = m_driver.now_us;
    cia402_stage_step(&m_driver);
    TEST_ASSERT_TRUE(m_driver.axis[1].has_operated);
    TEST_ASSERT_EQUAL(CIA402_STAGE_OPERATE, m_driver.stage);
    m_driver.axis[1].operating_us = 0;
    cia402_stage_step(&m_driver);
    TEST_ASSERT_EQUAL_HEX32(CIA402_FELL_OUT, m_driver.axis[1].own_fault);
    TEST_ASSERT_EQUAL(CIA402_STAGE_OFF, m_driver.stage);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(CIA402_GOAL_STOP, m_driver.axis[k].goal);
        TEST_ASSERT_FALSE(m_driver.axis[k].is_in);
    }
}

/* ---- answers ---- */

/* More answers than were asked for are those of a second drive with the same node; only while they come. */
static void test_fault_is_blamed_on_a_second_drive_only_while_it_answers(void)
{
    cia402_axis_t *axis = &m_driver.axis[2];
    axis->phase = CIA402_UP;
    for (unsigned i = 0; i < 1000; i++) {
        cia402_axis_note_answer(cia402_drive(&m_driver, 2), 0, 1);
        cia402_axis_count_answer(cia402_drive(&m_driver, 2));
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, axis->surplus);
    cia402_axis_fail(cia402_drive(&m_driver, 2), 0x8611);
    TEST_ASSERT_EQUAL_HEX32(CIA402_TWICE, axis->own_fault);
    axis->plain_syncs = 2;
    cia402_axis_fail(cia402_drive(&m_driver, 2), 0x8611);
    TEST_ASSERT_EQUAL_HEX32(0x8611, axis->own_fault);
}

/* The order in which two drives answer changes, so that each of them confirms the other one. */
static void test_second_drive_is_found_in_whatever_order_they_answer(void)
{
    cia402_axis_t *axis = &m_driver.axis[2];
    axis->phase = CIA402_UP;
    for (unsigned n = 0; n < 20 && axis->surplus < 2; n++) {
        for (unsigned i = 0; i < 2; i++) {
            axis->awaited = i == 0 ? 1 : 0;
            axis->statusword = (n + i) % 2 == 0 ? 0x250 : 0x231;
            cia402_axis_count_answer(cia402_drive(&m_driver, 2));
        }
    }
    TEST_ASSERT_EQUAL_UINT8(2, axis->surplus);
}

static void test_node_answers_where_each_of_its_axes_has(void)
{
    const cia402_drive_t drive = cia402_drive(&m_driver, 0);
    for (unsigned set = 0; set < 16; set++) {
        for (unsigned k = 0; k < 2; k++) {
            m_driver.axis[k].has_actual = (set >> 2 * k & 1u) != 0;
            m_driver.axis[k].has_answered = (set >> 2 * k & 2u) != 0;
        }
        TEST_ASSERT_EQUAL(set == 15, cia402_node_is_answering(drive));
    }
}

static void test_counts_are_unknown_before_the_first_position(void)
{
    int64_t counts = 4711;
    TEST_ASSERT_FALSE(drives_counts(m_drives, 0, &counts));
    TEST_ASSERT_EQUAL_INT64(4711, counts);
    cia402_axis_receive_position(cia402_drive(&m_driver, 0), 12345);
    TEST_ASSERT_TRUE(drives_counts(m_drives, 0, &counts));
    TEST_ASSERT_EQUAL_INT64(12345, counts);
}

/* ---- objects ---- */

static void test_objects_are_not_asked_for_before_the_first_poll_or_on_a_bus_that_is_gone(void)
{
    const drive_object_t read = {.index = 0x6041};
    m_driver.axis[2].phase = CIA402_UP;
    m_driver.axis[2].sdo.state = SDO_IDLE;
    m_driver.has_time = false;
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_object_begin(m_drives, 2, &read));
    m_driver.has_time = true;
    m_driver.is_gone = true;
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_object_begin(m_drives, 2, &read));
    m_driver.is_gone = false;
    m_driver.axis[2].nmt_command = 0x80; /* it is about to be told to leave */
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_object_begin(m_drives, 2, &read));
    m_driver.axis[2].nmt_command = 0;
    TEST_ASSERT_EQUAL(HV_OK, drives_object_begin(m_drives, 2, &read));
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, drives_object_begin(m_drives, 2, &read));
}

/* Requests that a drive may miss: for the guard time that it has, or that it shall have, and no more than a byte holds. */
static void test_life_factor_covers_the_time_of_silence(void)
{
    const cia402_object_t row = {.source = CIA402_LIFE_FACTOR, .bytes = 1};
    cia402_setup_t setup = {.guard_ms = 0};
    TEST_ASSERT_EQUAL_UINT32(4, cia402_object_value(&row, &m_config, &m_config.axis[0], &setup));
    setup.guard_ms = 70;
    TEST_ASSERT_EQUAL_UINT32(3, cia402_object_value(&row, &m_config, &m_config.axis[0], &setup));
    m_config.heartbeat_timeout_ms = 60000;
    TEST_ASSERT_EQUAL_UINT32(255, cia402_object_value(&row, &m_config, &m_config.axis[0], &setup));
}

/* ---- frames ---- */

/* What a drive of ours sends beside its answers is none of the driver's: time stamps of others, objects of a maker. */
static void test_frames_that_nobody_has_asked_for_change_nothing(void)
{
    static const uint16_t k_ids[] = {0x103, 0x583 + 0x40, 0x603, 0x680 + 3};
    drive_feedback_t feedback[DRIVES_MAX];
    sim_can_t other;
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&other, &m_bus, NULL, 0));
    (void)!drives_poll(m_drives, m_driver.now_us + 1000, feedback);
    const cia402_axis_t before = m_driver.axis[2];
    for (unsigned i = 0; i < 4; i++) {
        const can_frame_t frame = {.id = k_ids[i], .length = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&other), &frame));
    }
    sim_can_bus_step(&m_bus, m_driver.now_us + 500);
    (void)!drives_poll(m_drives, m_driver.now_us + 1000, feedback);
    TEST_ASSERT_EQUAL(before.phase, m_driver.axis[2].phase);
    TEST_ASSERT_EQUAL_HEX32(before.trouble, m_driver.axis[2].trouble);
    TEST_ASSERT_EQUAL_UINT32(0, m_driver.axis[2].emergency.count);
    TEST_ASSERT_FALSE(m_driver.axis[2].has_actual);
    sim_can_close(&other);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_master_stops_each_drive_by_where_it_is);
    RUN_TEST(test_master_is_not_waited_for_where_a_drive_may_have_torque);
    RUN_TEST(test_reset_wakes_nobody_where_nothing_may_be_sent);
    RUN_TEST(test_torque_that_is_lost_while_others_come_up_is_not_put_on_again);
    RUN_TEST(test_fault_is_blamed_on_a_second_drive_only_while_it_answers);
    RUN_TEST(test_second_drive_is_found_in_whatever_order_they_answer);
    RUN_TEST(test_node_answers_where_each_of_its_axes_has);
    RUN_TEST(test_counts_are_unknown_before_the_first_position);
    RUN_TEST(test_objects_are_not_asked_for_before_the_first_poll_or_on_a_bus_that_is_gone);
    RUN_TEST(test_life_factor_covers_the_time_of_silence);
    RUN_TEST(test_frames_that_nobody_has_asked_for_change_nothing);
    return UNITY_END();
}

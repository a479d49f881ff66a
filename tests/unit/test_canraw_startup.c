/* SPDX-License-Identifier: MIT
 * test_canraw_startup.c - frames that start a drive up: their order, waits and answers, drives that were silent, and those that
 * answer wrongly or come back.
 */
#include <string.h>

#include "heave/canraw.h"
#include "sim_can.h"
#include "unity.h"

#define CYCLE_US 1000u
#define LOG      256u

/* One drive: 2F 10 answered by 60 10 and any byte, 50 ms; 2F 11 with a counter; then positions. Queries 30. */
static sim_can_bus_t m_bus;
static sim_can_t m_node;
static sim_can_t m_drive;
static canraw_map_t m_map;
static canraw_t m_driver;
static drives_t m_hal;
static uint64_t m_now_us;
static drive_feedback_t m_feedback[DRIVES_MAX];
static q32_t m_setpoint_q32[DRIVES_MAX];
static can_frame_t m_log[LOG]; /* steps that it got */
static uint64_t m_log_us[LOG];
static unsigned m_logged;
static unsigned m_steps;
static bool m_is_on, m_is_wrong, m_is_talking_before;
static bool m_is_deaf;    /* takes no step */
static bool m_has_torque; /* and takes no step while it has */

static void describe(void)
{
    m_map = (canraw_map_t){.axes = 1, .period_us = 2000, .query_every = 1, .offline_periods = 5};
    m_map.setpoint = (canraw_frame_t){
        .length = 5, .constant = 1, .data = {0x10}, .fields = 1, .field = {{CANRAW_POSITION, 1, 32, true, false, 0, 0, 0}}};
    m_map.position_query = (canraw_frame_t){.length = 1, .constant = 1, .data = {0x30}};
    m_map.position_reply = (canraw_frame_t){
        .length = 5, .constant = 1, .data = {0x30}, .fields = 1, .field = {{CANRAW_POSITION, 1, 32, true, false, 0, 0, 0}}};
    m_map.step[0] = (canraw_step_t){.frame = {.length = 2, .constant = 3, .data = {0x2F, 0x10}},
                                    .answer = {.length = 3, .constant = 3, .data = {0x60, 0x10}},
                                    .wait_us = 50000};
    m_map.step[1].frame = (canraw_frame_t){
        .length = 3, .constant = 3, .data = {0x2F, 0x11}, .fields = 1, .field = {{CANRAW_COUNTER, 2, 8, false, false, 0, 0, 0}}};
    m_map.axis[0] = (canraw_axis_map_t){.command_id = 0x601,
                                        .setpoint_id = 0x601,
                                        .reply_id = 0x581,
                                        .scale = {100, 1, 0},
                                        .speed = {0, 1, 0},
                                        .step_max_q32 = Q32_ONE};
}

void setUp(void)
{
    m_now_us = 1000000;
    m_logged = m_steps = 0;
    m_is_on = true;
    m_is_wrong = m_is_talking_before = m_is_deaf = m_has_torque = false;
    describe();
    sim_can_bus_init(&m_bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_node, &m_bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_drive, &m_bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)));
    m_hal = canraw_hal(&m_driver);
}

void tearDown(void) {}

static void tell(uint8_t length, const uint8_t *data)
{
    can_frame_t frame = {.id = 0x581, .length = length};
    memcpy(frame.data, data, length);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&m_drive), &frame));
}

static void hear(const can_frame_t *frame)
{
    if (frame->data[0] == 0x2F) {
        TEST_ASSERT_LESS_THAN(LOG, m_logged);
        m_log_us[m_logged] = m_now_us;
        m_log[m_logged++] = *frame;
    }
    if (!m_is_on) {
        return;
    }
    if (frame->data[0] >= 0xB1) {
        m_has_torque = frame->data[0] == 0xB1;
    } else if (frame->data[0] == 0x2F && (m_has_torque || m_is_deaf)) {
        return;
    } else if (frame->data[0] == 0x2F && frame->data[1] == 0x10) {
        m_steps = 1;
        tell(3, m_is_wrong ? (const uint8_t[]){0x80, 0x10, 0} : (const uint8_t[]){0x60, 0x10, 0x77});
    } else if (frame->data[0] == 0x2F) {
        m_steps += m_steps == 1;
    } else if (frame->data[0] == 0x30 && (m_steps == 2 || m_is_talking_before)) {
        tell(5, (const uint8_t[]){0x30, 0xE8, 0x03, 0, 0});
    }
}

static void cycles(unsigned count)
{
    while (count-- > 0) {
        can_frame_t frame;
        uint64_t at_us = 0;
        m_now_us += CYCLE_US;
        sim_can_bus_step(&m_bus, m_now_us);
        while (hal_can_recv(sim_can_hal(&m_drive), &frame, &at_us) == HV_OK) {
            hear(&frame);
        }
        sim_can_bus_step(&m_bus, m_now_us);
        (void)!drives_poll(m_hal, m_now_us, m_feedback);
        (void)!drives_send(m_hal, m_now_us, m_setpoint_q32);
    }
}

static drive_report_t report(void)
{
    drive_report_t out;
    TEST_ASSERT_TRUE(drives_report(m_hal, 0, &out));
    return out;
}

/* It answers, so the list begins again once: it might have been switched on in the middle. Then each frame once. */
static void test_steps_go_out_in_order_with_their_waits(void)
{
    cycles(200);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_UINT(2, m_logged);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){0x2F, 0x10}), m_log[0].data, 2);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){0x2F, 0x11}), m_log[1].data, 2);
    TEST_ASSERT_EQUAL_UINT8(3, m_log[1].length);
    TEST_ASSERT_TRUE(m_log_us[1] - m_log_us[0] >= 50000 && m_log_us[1] - m_log_us[0] <= 54000);
    cycles(3000);
    TEST_ASSERT_EQUAL_UINT(2, m_logged);
}

static void test_a_drive_that_is_switched_on_later_gets_all_of_them(void)
{
    m_is_on = false;
    cycles(5000);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    TEST_ASSERT_TRUE(m_logged >= 3 && m_logged <= 5); /* the first one, once in a second and a half */
    m_is_on = true;
    cycles(2000);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_UINT(2, m_steps);
}

/* Without answers nobody knows whether it heard them: what it says first begins them again. */
static void test_a_drive_that_speaks_first_is_not_there_before_the_steps(void)
{
    m_map.step[0].answer.length = 0;
    m_is_on = false;
    cycles(5300);
    const unsigned logged = m_logged;
    TEST_ASSERT_TRUE(logged >= 8);
    m_is_on = m_is_talking_before = true;
    m_steps = 0;
    for (unsigned i = 0; i < 300 && m_feedback[0].state == DRIVE_OFFLINE; i++) {
        cycles(1);
    }
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_TRUE(m_logged >= logged + 2 && m_logged <= logged + 4); /* of the turn that was under way, too */
    TEST_ASSERT_EQUAL_UINT(2, m_steps);
}

/* It talks, but does not say where it is: it may not have taken what it was told, and is told again. */
static void test_a_drive_that_only_talks_gets_steps_without_answers_again(void)
{
    m_map.step[0].answer.length = 0;
    m_is_deaf = true;
    cycles(1000);
    tell(1, (const uint8_t[]){0xAA}); /* its boot frame */
    cycles(200);
    const unsigned logged = m_logged;
    const uint64_t told_us = m_log_us[logged - 1];
    m_is_deaf = false;
    for (unsigned i = 0; i < 6000 && m_logged == logged; i++) {
        cycles(1);
        if (i % 2 == 0) {
            tell(1, (const uint8_t[]){0xAA});
        }
    }
    TEST_ASSERT_EQUAL_UINT(logged + 1, m_logged);
    TEST_ASSERT_UINT64_WITHIN(CYCLE_US, 5000000, m_log_us[logged] - told_us);
    cycles(200);
    TEST_ASSERT_EQUAL_UINT(logged + 2, m_logged);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    cycles(12000);
    TEST_ASSERT_EQUAL_UINT(logged + 2, m_logged); /* it says where it is: no more */
}

static void test_a_drive_that_comes_back_is_started_up_again(void)
{
    cycles(200);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    m_is_on = false;
    m_steps = 0;
    cycles(30);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    m_is_on = true;
    cycles(2000);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_UINT(2, m_steps);
}

/* One that was lost under torque still has it, and takes nothing before that is gone. */
static void test_a_drive_that_comes_back_under_torque_loses_it_before_the_steps(void)
{
    m_map.command[CANRAW_ENABLE] = (canraw_frame_t){.length = 1, .constant = 1, .data = {0xB1}};
    m_map.command[CANRAW_DISABLE] = (canraw_frame_t){.length = 1, .constant = 1, .data = {0xB2}};
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)));
    m_hal = canraw_hal(&m_driver);
    cycles(200);
    m_setpoint_q32[0] = m_feedback[0].actual_mm_q32;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_hal, DRIVES_ENABLE));
    cycles(50);
    TEST_ASSERT_TRUE(m_has_torque);
    m_is_on = false;
    cycles(30);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    m_is_on = true;
    m_steps = 0;
    cycles(3000);
    TEST_ASSERT_FALSE(m_has_torque);
    TEST_ASSERT_EQUAL_UINT(2, m_steps);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
}

static void test_a_wrong_answer_is_named_and_tried_again(void)
{
    m_is_wrong = true;
    cycles(1000);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    cycles(1000);
    TEST_ASSERT_TRUE(m_logged >= 2 && m_logged <= 4);
    m_is_wrong = false;
    m_is_on = false;
    cycles(1200);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_NO_ANSWER, report().code);
    TEST_ASSERT_EQUAL_STRING("it does not answer as it should when it is started up", report().trouble);
    TEST_ASSERT_EQUAL_UINT32(1, report().detail_code);
    m_is_on = true;
    cycles(2000);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_HEX32(0, report().code);
}

static void test_maps_with_steps_that_make_no_sense_are_refused(void)
{
    for (unsigned i = 0; i < 4; i++) {
        describe();
        switch (i) {
        case 0:
            m_map.step[0].answer = m_map.position_reply;
            break;
        case 1:
            m_map.step[2].answer = m_map.step[0].answer; /* to nothing */
            break;
        case 2:
            m_map.step[0].frame.constant = 1; /* a byte is open */
            break;
        default:
            m_map.step[1].frame.field[0].value = CANRAW_POSITION;
            break;
        }
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)), "taken");
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_steps_go_out_in_order_with_their_waits);
    RUN_TEST(test_a_drive_that_is_switched_on_later_gets_all_of_them);
    RUN_TEST(test_a_drive_that_speaks_first_is_not_there_before_the_steps);
    RUN_TEST(test_a_drive_that_only_talks_gets_steps_without_answers_again);
    RUN_TEST(test_a_drive_that_comes_back_is_started_up_again);
    RUN_TEST(test_a_drive_that_comes_back_under_torque_loses_it_before_the_steps);
    RUN_TEST(test_a_wrong_answer_is_named_and_tried_again);
    RUN_TEST(test_maps_with_steps_that_make_no_sense_are_refused);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_canraw_status.c - drives that tell their status in a frame of its own, and what the driver says of them in words.
 */
#include <string.h>

#include "heave/canraw.h"
#include "sim_can.h"
#include "unity.h"

#define CYCLE_US  1000u
#define PERIOD_US 2000u
#define EVERY     5u /* periods between two statuses */

/* Two drives: positions in 281h and 282h (i32, counter), both statuses in 701h: u8 and fault code u16 each, a check byte. */
static sim_can_bus_t m_bus;
static sim_can_t m_node;
static sim_can_t m_drives;
static canraw_map_t m_map;
static canraw_t m_driver;
static drives_t m_hal;
static uint64_t m_now_us;
static drive_feedback_t m_feedback[DRIVES_MAX];
static q32_t m_setpoint_q32[DRIVES_MAX];
static uint8_t m_status[2];
static uint16_t m_code[2];
static uint8_t m_counter;
static bool m_is_status_on, m_is_position_on, m_is_stuck, m_is_check_wrong;
static unsigned m_enables, m_disables;

static canraw_frame_t command(uint8_t byte)
{
    return (canraw_frame_t){.length = 1, .constant = 1, .data = {byte}};
}

static void describe(void)
{
    m_map = (canraw_map_t){.axes = 2,
                           .period_us = PERIOD_US,
                           .query_every = 1,
                           .offline_periods = 5,
                           .status_every = EVERY,
                           .enabled_when = {1, 1},
                           .fault_when = {2, 2}};
    m_map.setpoint = (canraw_frame_t){.length = 4, .fields = 1, .field = {{CANRAW_POSITION, 0, 32, true, false, 0, 0, 0}}};
    m_map.command[CANRAW_ENABLE] = command(0xB1);
    m_map.command[CANRAW_DISABLE] = command(0xB2);
    m_map.command[CANRAW_RESET] = command(0xB4);
    m_map.position_reply = (canraw_frame_t){
        .length = 7,
        .fields = 3,
        .field = {{CANRAW_POSITION, 0, 32, true, false, 0, 0, 0}, {CANRAW_COUNTER, 4, 8, false, false, 0, 0, 0}}};
    m_map.position_reply.field[2] = (canraw_field_t){CANRAW_TORQUE, 5, 16, true, false, 0, 0, 0};
    m_map.status_reply = (canraw_frame_t){.length = 7, .fields = 5};
    for (uint8_t slot = 1; slot <= 2; slot++) {
        const uint8_t at = (uint8_t)(3 * slot - 3);
        m_map.status_reply.field[2 * slot - 2] = (canraw_field_t){CANRAW_STATUS, at, 8, false, false, 0, 0, slot};
        m_map.status_reply.field[2 * slot - 1] = (canraw_field_t){CANRAW_FAULT, (uint8_t)(at + 1), 16, false, false, 0, 0, slot};
        m_map.axis[slot - 1] = (canraw_axis_map_t){.command_id = 0x600u + slot,
                                                   .setpoint_id = 0x600u + slot,
                                                   .reply_id = 0x280u + slot,
                                                   .status_id = 0x701,
                                                   .status_slot = slot,
                                                   .scale = {100, 1, 0},
                                                   .speed = {0, 1, 0},
                                                   .step_max_q32 = Q32_ONE,
                                                   .following_max_q32 = q32_from_int(10)};
    }
    m_map.status_reply.field[4] = (canraw_field_t){CANRAW_SUM, 6, 8, false, false, 0, 0, 0};
}

static void open_driver(void)
{
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    m_now_us = 1000000;
    sim_can_bus_init(&m_bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL_UINT32(5, canraw_filters(&m_map, filter));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_node, &m_bus, filter, 5));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_drives, &m_bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)));
    m_hal = canraw_hal(&m_driver);
}

void setUp(void)
{
    memset(m_feedback, 0, sizeof m_feedback);
    memset(m_setpoint_q32, 0, sizeof m_setpoint_q32);
    memset(m_status, 0, sizeof m_status);
    memset(m_code, 0, sizeof m_code);
    m_is_status_on = m_is_position_on = true;
    m_is_stuck = m_is_check_wrong = false;
    m_enables = m_disables = 0;
    describe();
    open_driver();
}

void tearDown(void) {}

static void hear_all(void)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    while (hal_can_recv(sim_can_hal(&m_drives), &frame, &at_us) == HV_OK) {
        if (frame.length == 1) {
            const unsigned k = frame.id - 0x601;
            m_enables += frame.data[0] == 0xB1;
            m_disables += frame.data[0] == 0xB2;
            m_status[k] = frame.data[0] == 0xB1 ? 1 : frame.data[0] == 0xB2 ? 0 : m_status[k];
        }
    }
}

static void tell(uint32_t id, const uint8_t data[7])
{
    can_frame_t frame = {.id = id, .length = 7};
    memcpy(frame.data, data, 7);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&m_drives), &frame));
}

static void tell_status(void)
{
    uint8_t data[7] = {m_status[0],
                       (uint8_t)m_code[0],
                       (uint8_t)(m_code[0] >> 8),
                       m_status[1],
                       (uint8_t)m_code[1],
                       (uint8_t)(m_code[1] >> 8),
                       0};
    for (unsigned i = 0; i < 6; i++) {
        data[6] = (uint8_t)(data[6] + data[i]);
    }
    data[6] ^= m_is_check_wrong ? 0x55 : 0;
    tell(0x701, data);
}

static void cycle(void)
{
    m_now_us += CYCLE_US;
    sim_can_bus_step(&m_bus, m_now_us);
    hear_all();
    if (m_is_position_on && m_now_us % PERIOD_US == 0) {
        m_counter = (uint8_t)(m_counter + (m_is_stuck ? 0 : 1));
        const uint8_t data[7] = {0xE8, 0x03, 0, 0, m_counter, 0xFE, 0xFF}; /* 1000 counts, torque -2 */
        tell(0x281, data);
        tell(0x282, data);
    }
    if (m_is_status_on && m_now_us % (EVERY * PERIOD_US) == 0) {
        tell_status();
    }
    sim_can_bus_step(&m_bus, m_now_us);
    (void)!drives_poll(m_hal, m_now_us, m_feedback);
    (void)!drives_send(m_hal, m_now_us, m_setpoint_q32);
}

static void cycles(unsigned count)
{
    while (count-- > 0) {
        cycle();
    }
}

static void enable(void)
{
    cycles(30);
    m_setpoint_q32[0] = m_setpoint_q32[1] = q32_from_int(10);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_hal, DRIVES_ENABLE));
    cycles(30);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[1].state);
}

static drive_report_t report(uint8_t k)
{
    drive_report_t out;
    TEST_ASSERT_TRUE(drives_report(m_hal, k, &out));
    return out;
}

static void test_a_drive_is_there_once_position_and_status_came(void)
{
    m_is_status_on = false;
    cycles(30);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    TEST_ASSERT_EQUAL_STRING("its position comes, but no status", report(0).trouble);
    m_is_status_on = true;
    cycles(10);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_STRING("ready", report(0).phase);
    TEST_ASSERT_EQUAL_STRING("", report(0).trouble);
    TEST_ASSERT_EQUAL_HEX32(0x282, report(1).identifier);
}

/* One from before the frame that enables it says nothing of now. */
static void test_enabled_is_believed_from_a_status_after_the_command(void)
{
    cycles(30);
    m_status[0] = m_status[1] = 1; /* of before */
    cycles(10);
    m_is_status_on = false;
    m_setpoint_q32[0] = m_setpoint_q32[1] = q32_from_int(10);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_hal, DRIVES_ENABLE));
    cycles(15);
    TEST_ASSERT_EQUAL(DRIVE_ENABLING, m_feedback[0].state);
    m_is_status_on = true;
    cycles(11);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
}

static void test_a_status_that_fails_while_positions_come_is_a_drive_that_is_gone(void)
{
    enable();
    m_is_status_on = false;
    cycles(EVERY * 10 - 10);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_NO_STATUS, report(0).code);
    const unsigned disables = m_disables;
    m_is_status_on = true;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_UINT(disables + 2, m_disables); /* it was lost under torque */
}

/* It is lost for its status alone, and can hear: it may not keep its torque where the others lose theirs. */
static void test_a_drive_without_a_status_is_stopped_with_the_others(void)
{
    enable();
    m_is_status_on = false;
    cycles(EVERY * 10 + 10);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    const unsigned disables = m_disables;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_hal, DRIVES_DISABLE));
    cycles(5);
    TEST_ASSERT_EQUAL_UINT(disables + 2, m_disables);
}

static void test_the_fault_of_one_has_its_own_code(void)
{
    enable();
    m_status[1] = 2;
    m_code[1] = 0x1234;
    cycles(12);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, m_feedback[1].state);
    TEST_ASSERT_EQUAL_HEX32(0x1234, m_feedback[1].fault_code);
    TEST_ASSERT_EQUAL_HEX32(0x1234, report(1).code);
    TEST_ASSERT_EQUAL_STRING("fault of the drive", report(1).trouble);
    m_status[1] = 0;
    m_code[1] = 0;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_hal, DRIVES_RESET_FAULT));
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[1].state);
}

static void test_a_fault_may_be_any_bit_of_the_status(void)
{
    for (unsigned bit = 0; bit < 8; bit++) {
        setUp();
        m_map.enabled_when = (canraw_when_t){0, 0};
        m_map.fault_when = (canraw_when_t){1u << bit, 1u << bit};
        open_driver();
        cycles(30);
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
        m_status[0] = (uint8_t)(1u << bit);
        cycles(12);
        TEST_ASSERT_EQUAL(DRIVE_FAULT, m_feedback[0].state);
    }
}

/* A warning: told, and nothing stops. */
static void test_a_code_without_a_fault_is_told(void)
{
    enable();
    m_code[0] = 7;
    cycles(12);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_REPORTS_ERROR, report(0).code);
    TEST_ASSERT_EQUAL_HEX32(7, report(0).detail_code);
    TEST_ASSERT_EQUAL_HEX32(0, report(1).code);
    m_code[0] = 0;
    cycles(12);
    TEST_ASSERT_EQUAL_HEX32(0, report(0).code);
}

/* In percent of the rated one, in the direction of the extension; a map that does not know the rated one tells nothing. */
static void test_torque_is_told_in_the_direction_of_the_extension(void)
{
    m_map.rated_torque = 400;
    m_map.axis[1].scale.num = -100;
    TEST_ASSERT_EQUAL_HEX8(0, report(0).telemetry.has);
    cycles(30);
    for (uint8_t k = 0; k < 2; k++) {
        const drive_telemetry_t told = report(k).telemetry;
        TEST_ASSERT_EQUAL_HEX8(DRIVE_HAS_TORQUE, told.has);
        TEST_ASSERT_EQUAL_INT32(k == 0 ? -5 : 5, told.torque_permille);
        TEST_ASSERT_TRUE(m_now_us - told.at_us <= 2 * PERIOD_US);
    }
    m_map.rated_torque = 0;
    TEST_ASSERT_EQUAL_HEX8(0, report(0).telemetry.has);
}

static void test_what_is_not_believed_is_named(void)
{
    enable();
    m_is_check_wrong = true;
    cycles(12);
    TEST_ASSERT_EQUAL_STRING("the check byte of what it sends is wrong", report(1).trouble);
    m_is_check_wrong = false;
    cycles(1100); /* shown for a second */
    TEST_ASSERT_EQUAL_HEX32(0, report(1).code);
    m_is_stuck = true;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    TEST_ASSERT_EQUAL_STRING("its alive counter stands still", report(0).trouble);
    m_is_stuck = false;
    cycles(1100);
    TEST_ASSERT_EQUAL_STRING("", report(0).trouble);
    const can_frame_t other = {.id = 0x282, .length = 3};
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&m_drives), &other));
    cycles(2);
    TEST_ASSERT_EQUAL_STRING("it sends other bytes than its replies in the configuration", report(1).trouble);
    TEST_ASSERT_EQUAL_STRING("", report(0).trouble);
}

static void test_silence_is_named_once_there_was_time_for_a_frame(void)
{
    m_is_status_on = m_is_position_on = false;
    cycles(5);
    TEST_ASSERT_EQUAL_STRING("missing", report(0).phase);
    TEST_ASSERT_EQUAL_HEX32(0, report(0).code);
    cycles(15);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_SILENT, report(0).code);
    m_is_status_on = m_is_position_on = true;
    enable();
    m_is_position_on = m_is_status_on = false;
    cycles(12);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_SILENT, report(0).code);
}

static void test_maps_that_confuse_statuses_are_refused(void)
{
    for (unsigned i = 0; i < 5; i++) {
        describe();
        switch (i) {
        case 0:
            m_map.axis[1].status_slot = 1;
            break;
        case 1:
            m_map.axis[1].status_id = 0x601; /* commands */
            break;
        case 2:
            m_map.axis[1].status_id = 0x281; /* looks like a position */
            break;
        case 3:
            m_map.status_every = 0;
            break;
        default:
            m_map.status_reply.field[0].value = CANRAW_TORQUE; /* the first drive has none */
            break;
        }
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)), "taken");
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_drive_is_there_once_position_and_status_came);
    RUN_TEST(test_enabled_is_believed_from_a_status_after_the_command);
    RUN_TEST(test_a_status_that_fails_while_positions_come_is_a_drive_that_is_gone);
    RUN_TEST(test_a_drive_without_a_status_is_stopped_with_the_others);
    RUN_TEST(test_the_fault_of_one_has_its_own_code);
    RUN_TEST(test_a_fault_may_be_any_bit_of_the_status);
    RUN_TEST(test_a_code_without_a_fault_is_told);
    RUN_TEST(test_torque_is_told_in_the_direction_of_the_extension);
    RUN_TEST(test_what_is_not_believed_is_named);
    RUN_TEST(test_silence_is_named_once_there_was_time_for_a_frame);
    RUN_TEST(test_maps_that_confuse_statuses_are_refused);
    return UNITY_END();
}

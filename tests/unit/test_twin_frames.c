/* SPDX-License-Identifier: MIT
 * test_twin_frames.c - a simulated drive with frames of its own: what it takes, tells and does, byte by byte.
 */
#include <string.h>

#include "twin/frame_drive.h"
#include "unity.h"

#define HELD 64u

static frame_drive_t m_drive;
static canraw_map_t m_map;
static motor_t m_motor;
static can_frame_t m_sent[HELD];
static unsigned m_count;
static uint64_t m_now_us;

static void put(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    TEST_ASSERT_LESS_THAN(HELD, m_count);
    m_sent[m_count++] = *frame;
}

static canraw_frame_t frame_of(uint8_t length, uint8_t constant, const uint8_t *data)
{
    canraw_frame_t frame = {.length = length, .constant = constant};
    memcpy(frame.data, data, length);
    return frame;
}

/* Set-point 10 i32be, enable 20, disable 21, stop 22, reset 23, home 24; query 30; reply 30 status i32be counter xor. */
void setUp(void)
{
    m_map = (canraw_map_t){.axes = 2, .period_us = 4000, .query_every = 1, .offline_periods = 10};
    m_map.setpoint = frame_of(5, 0x01, (const uint8_t[]){0x10, 0, 0, 0, 0});
    m_map.setpoint.fields = 1;
    m_map.setpoint.field[0] = (canraw_field_t){CANRAW_POSITION, 1, 4, true, true};
    const uint8_t bytes[CANRAW_COMMANDS] = {0x22, 0x21, 0x23, 0x20, 0x24};
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        m_map.command[i] = frame_of(1, 0x01, &bytes[i]);
    }
    m_map.position_query = frame_of(1, 0x01, (const uint8_t[]){0x30});
    m_map.position_reply = frame_of(8, 0x01, (const uint8_t[]){0x30, 0, 0, 0, 0, 0, 0, 0});
    m_map.position_reply.fields = 4;
    m_map.position_reply.field[0] = (canraw_field_t){CANRAW_STATUS, 1, 1, false, false};
    m_map.position_reply.field[1] = (canraw_field_t){CANRAW_POSITION, 2, 4, true, true};
    m_map.position_reply.field[2] = (canraw_field_t){CANRAW_COUNTER, 6, 1, false, false};
    m_map.position_reply.field[3] = (canraw_field_t){CANRAW_XOR, 7, 1, false, false};
    m_map.enabled_when = (canraw_when_t){1, 1};
    m_map.fault_when = (canraw_when_t){2, 2};
    m_map.homing_done = (canraw_when_t){4, 4};
    m_map.homing_failed = (canraw_when_t){8, 8};
    m_map.axis[1] = (canraw_axis_map_t){.command_id = 0x602, .reply_id = 0x582, .scale = {1000, 1, 0}};
    memset(&m_motor, 0, sizeof m_motor);
    motor_start(&m_motor, 5000, 0);
    TEST_ASSERT_NULL(frame_drive_refusal(&m_map));
    frame_drive_init(&m_drive, &m_map, 1, (node_out_t){put, NULL});
    m_drive.motor = &m_motor;
    m_drive.usual_speed = 100000;
    m_drive.home = 1000;
    m_count = 0;
    m_now_us = 1000000;
    frame_drive_power(&m_drive, true, m_now_us);
    m_now_us += 300000;
}

void tearDown(void) {}

static void say(uint32_t id, uint8_t length, const uint8_t *data)
{
    can_frame_t frame = {.id = id, .length = length};
    memcpy(frame.data, data, length);
    frame_drive_hear(&m_drive, &frame, m_now_us);
}

static void command(uint8_t byte)
{
    say(0x602, 1, &byte);
}

/* Status of the reply to a query. */
static uint8_t status(void)
{
    m_count = 0;
    command(0x30);
    TEST_ASSERT_EQUAL(1, m_count);
    return m_sent[0].data[1];
}

static void wait_ms(unsigned ms)
{
    for (unsigned i = 0; i < ms; i++) {
        m_now_us += 1000;
        frame_drive_advance(&m_drive, m_now_us);
    }
}

static void home(void)
{
    command(0x24);
    wait_ms(1000);
}

static void test_reply_has_status_position_counter_and_check_byte(void)
{
    command(0x30);
    const uint8_t expected[8] = {0x30, 0x00, 0, 0, 0, 0, 1, 0x31};
    TEST_ASSERT_EQUAL(1, m_count);
    TEST_ASSERT_EQUAL_HEX32(0x582, m_sent[0].id);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(expected, m_sent[0].data, 8);
    command(0x30);
    TEST_ASSERT_EQUAL_HEX8(2, m_sent[1].data[6]);
}

static void test_other_frames_are_not_its_own(void)
{
    say(0x601, 1, (const uint8_t[]){0x30});
    say(0x602, 2, (const uint8_t[]){0x30, 0});
    say(0x602, 1, (const uint8_t[]){0x77});
    can_frame_t frame = {.id = 0x602, .is_extended = true, .length = 1, .data = {0x30}};
    frame_drive_hear(&m_drive, &frame, m_now_us);
    TEST_ASSERT_EQUAL(0, m_count);
}

static void test_homing_finds_the_zero_and_gives_no_torque_that_was_not_there(void)
{
    TEST_ASSERT_EQUAL_HEX8(0, status());
    command(0x24);
    TEST_ASSERT_EQUAL_HEX8(1, status()); /* torque, not homed */
    wait_ms(1000);
    TEST_ASSERT_EQUAL_HEX8(4, status());
    TEST_ASSERT_EQUAL(1000, frame_drive_count(&m_drive));
    command(0x20);
    TEST_ASSERT_EQUAL_HEX8(5, status());
    home();
    TEST_ASSERT_EQUAL_HEX8(5, status());
}

static void test_set_points_move_it_only_with_torque(void)
{
    home();
    say(0x602, 5, (const uint8_t[]){0x10, 0, 0, 0x07, 0xD0});
    wait_ms(20);
    TEST_ASSERT_EQUAL(1000, frame_drive_count(&m_drive));
    command(0x20);
    say(0x602, 5, (const uint8_t[]){0x10, 0, 0, 0x07, 0xD0});
    wait_ms(20);
    TEST_ASSERT_EQUAL(2000, frame_drive_count(&m_drive));
    command(0x21);
    say(0x602, 5, (const uint8_t[]){0x10, 0xFF, 0xFF, 0xFF, 0x00});
    wait_ms(20);
    TEST_ASSERT_EQUAL(2000, frame_drive_count(&m_drive));
    TEST_ASSERT_EQUAL(1, m_drive.set_points);
}

static void test_a_fault_stays_until_its_cause_is_gone(void)
{
    home();
    command(0x20);
    frame_drive_fault(&m_drive, 0x17);
    TEST_ASSERT_EQUAL_HEX8(6, status());
    m_drive.is_broken = true;
    command(0x23);
    TEST_ASSERT_EQUAL_HEX8(6, status());
    command(0x20);
    command(0x24);
    TEST_ASSERT_EQUAL_HEX8(6, status());
    m_drive.is_broken = false;
    command(0x23);
    TEST_ASSERT_EQUAL_HEX8(4, status());
}

static void test_homing_that_fails_is_a_fault_that_says_so(void)
{
    m_drive.is_homing_broken = true;
    home();
    TEST_ASSERT_EQUAL_HEX8(0x0A, status());
}

static void test_what_is_made_to_fail(void)
{
    m_drive.lost = 1;
    command(0x30);
    TEST_ASSERT_EQUAL(0, m_count);
    m_drive.damaged = 1;
    command(0x30);
    TEST_ASSERT_FALSE(canraw_matches(&m_map.position_reply, m_sent[0].data, 8));
    command(0x30);
    TEST_ASSERT_TRUE(canraw_matches(&m_map.position_reply, m_sent[1].data, 8));
    m_drive.is_stuck = true;
    command(0x30);
    TEST_ASSERT_EQUAL_HEX8(m_sent[1].data[6], m_sent[2].data[6]);
    m_drive.late_us = 5000;
    command(0x30);
    TEST_ASSERT_EQUAL(3, m_count);
    TEST_ASSERT_EQUAL_UINT64(m_now_us + 5000, frame_drive_due_us(&m_drive));
    wait_ms(5);
    TEST_ASSERT_EQUAL(4, m_count);
    m_drive.is_mute = true;
    command(0x30);
    m_drive.is_mute = false;
    m_drive.is_cut = true;
    command(0x30);
    TEST_ASSERT_EQUAL(4, m_count);
    m_drive.is_cut = false;
    frame_drive_power(&m_drive, false, m_now_us);
    command(0x30);
    frame_drive_power(&m_drive, true, m_now_us);
    command(0x30); /* it starts for 300 ms */
    TEST_ASSERT_EQUAL(4, m_count);
}

static void test_without_a_query_it_tells_by_itself(void)
{
    m_map.position_query.length = 0;
    frame_drive_power(&m_drive, true, m_now_us);
    wait_ms(299);
    TEST_ASSERT_EQUAL(0, m_count);
    wait_ms(41);
    TEST_ASSERT_EQUAL(11, m_count);
}

static void test_a_map_without_a_word_for_torque_always_has_it(void)
{
    m_map.command[CANRAW_ENABLE].length = 0;
    m_map.enabled_when.mask = 0;
    frame_drive_power(&m_drive, true, m_now_us);
    TEST_ASSERT_TRUE(frame_drive_is_enabled(&m_drive));
    m_map.enabled_when = (canraw_when_t){1, 1}; /* it tells, and its first set-point is the word */
    frame_drive_power(&m_drive, true, m_now_us);
    TEST_ASSERT_FALSE(frame_drive_is_enabled(&m_drive));
    m_now_us += 300000;
    say(0x602, 5, (const uint8_t[]){0x10, 0, 0, 0, 0});
    TEST_ASSERT_TRUE(frame_drive_is_enabled(&m_drive));
}

static void test_a_map_whose_states_no_status_tells_apart_is_refused(void)
{
    m_map.fault_when = m_map.enabled_when;
    TEST_ASSERT_NOT_NULL(frame_drive_refusal(&m_map));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_reply_has_status_position_counter_and_check_byte);
    RUN_TEST(test_other_frames_are_not_its_own);
    RUN_TEST(test_homing_finds_the_zero_and_gives_no_torque_that_was_not_there);
    RUN_TEST(test_set_points_move_it_only_with_torque);
    RUN_TEST(test_a_fault_stays_until_its_cause_is_gone);
    RUN_TEST(test_homing_that_fails_is_a_fault_that_says_so);
    RUN_TEST(test_what_is_made_to_fail);
    RUN_TEST(test_without_a_query_it_tells_by_itself);
    RUN_TEST(test_a_map_without_a_word_for_torque_always_has_it);
    RUN_TEST(test_a_map_whose_states_no_status_tells_apart_is_refused);
    return UNITY_END();
}

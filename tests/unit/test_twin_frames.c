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
    m_map.setpoint.field[0] = (canraw_field_t){CANRAW_POSITION, 1, 32, true, true, 0, 0, 0};
    const uint8_t bytes[CANRAW_COMMANDS] = {0x22, 0x21, 0x23, 0x20, 0x24};
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        m_map.command[i] = frame_of(1, 0x01, &bytes[i]);
    }
    m_map.position_query = frame_of(1, 0x01, (const uint8_t[]){0x30});
    m_map.position_reply = frame_of(8, 0x01, (const uint8_t[]){0x30, 0, 0, 0, 0, 0, 0, 0});
    m_map.position_reply.fields = 4;
    m_map.position_reply.field[0] = (canraw_field_t){CANRAW_STATUS, 1, 8, false, false, 0, 0, 0};
    m_map.position_reply.field[1] = (canraw_field_t){CANRAW_POSITION, 2, 32, true, true, 0, 0, 0};
    m_map.position_reply.field[2] = (canraw_field_t){CANRAW_COUNTER, 6, 8, false, false, 0, 0, 0};
    m_map.position_reply.field[3] = (canraw_field_t){CANRAW_XOR, 7, 8, false, false, 0, 0, 0};
    m_map.enabled_when = (canraw_when_t){1, 1};
    m_map.fault_when = (canraw_when_t){2, 2};
    m_map.homing_done = (canraw_when_t){4, 4};
    m_map.homing_failed = (canraw_when_t){8, 8};
    m_map.axis[1] = (canraw_axis_map_t){.command_id = 0x602, .setpoint_id = 0x602, .reply_id = 0x582, .scale = {1000, 1, 0}};
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
        TEST_ASSERT_TRUE_MESSAGE(frame_drive_due_us(&m_drive) > m_now_us,
                                 "what is due has been done: heave-twin would never sleep");
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

static void test_tells_nothing_by_itself_where_it_is_cut_off_or_not_started(void)
{
    m_map.position_query.length = 0;
    m_map.status_every = 5;
    m_map.status_reply = m_map.position_reply;
    m_map.step[0].frame = frame_of(1, 0x01, (const uint8_t[]){0x40});
    wait_ms(20);
    TEST_ASSERT_EQUAL(0, m_count);
    command(0x40);
    wait_ms(20);
    TEST_ASSERT_EQUAL(5 + 1, m_count);
    m_drive.is_cut = true;
    wait_ms(20);
    TEST_ASSERT_EQUAL(5 + 1, m_count);
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

static void test_an_absolute_encoder_knows_its_zero_without_homing(void)
{
    m_drive.is_absolute = true;
    m_drive.origin = 0;
    frame_drive_power(&m_drive, false, m_now_us);
    frame_drive_power(&m_drive, true, m_now_us);
    m_now_us += 300000;
    TEST_ASSERT_EQUAL(5000, frame_drive_count(&m_drive));
    TEST_ASSERT_EQUAL_HEX8(4, status()); /* no torque, homed */
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

static void test_a_stop_ends_homing_without_a_zero(void)
{
    command(0x20);
    command(0x24);
    wait_ms(10);
    command(0x22);
    wait_ms(1000);
    TEST_ASSERT_EQUAL_HEX8(0x01, status());
}

static void test_torque_that_outlives_a_fault_is_taken_by_a_command(void)
{
    m_drive.is_torque_kept = true;
    command(0x20);
    frame_drive_fault(&m_drive, 5);
    TEST_ASSERT_EQUAL_HEX8(0x03, status());
    command(0x21);
    TEST_ASSERT_EQUAL_HEX8(0x02, status());
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

/* Two axes in a frame, as one controller has them: each takes its own field, and one frame tells both. */
static void test_drives_that_share_frames_take_and_tell_their_own_fields(void)
{
    static frame_drive_t all[2];
    motor_t motor[2];
    m_map.setpoint = frame_of(6, 0x03, (const uint8_t[]){0x10, 0, 0, 0, 0, 0});
    m_map.setpoint.fields = 2;
    m_map.position_reply.fields = 3;
    m_map.position_reply.constant = 0x01;
    m_map.position_reply.length = 6;
    m_map.position_query.length = 0;
    m_map.command[CANRAW_HOME].length = 0;
    m_map.homing_done = m_map.homing_failed = (canraw_when_t){0, 0};
    m_map.position_reply.field[0] = (canraw_field_t){CANRAW_STATUS, 1, 8, false, false, 0, 0, 0};
    for (unsigned k = 0; k < 2; k++) {
        const uint8_t at = (uint8_t)(2 + 2 * k), slot = (uint8_t)(1 + k);
        m_map.setpoint.field[k] = (canraw_field_t){CANRAW_POSITION, at, 16, true, false, 0, 0, slot};
        m_map.position_reply.field[1 + k] = (canraw_field_t){CANRAW_POSITION, at, 16, true, false, 0, 0, slot};
        m_map.axis[k] = (canraw_axis_map_t){.command_id = 0x602 + k,
                                            .setpoint_id = 0x200,
                                            .reply_id = 0x300,
                                            .setpoint_slot = slot,
                                            .reply_slot = slot,
                                            .scale = {1000, 1, 0}};
        memset(&motor[k], 0, sizeof motor[k]);
        motor_start(&motor[k], 5000 + k, 0);
        frame_drive_init(&all[k], &m_map, k, (node_out_t){put, NULL});
        all[k].all = all;
        all[k].motor = &motor[k];
        all[k].usual_speed = 100000;
    }
    for (unsigned k = 0; k < 2; k++) {
        frame_drive_power(&all[k], true, m_now_us);
    }
    m_now_us += 300000;
    m_count = 0;
    frame_drive_advance(&all[0], m_now_us);
    frame_drive_advance(&all[1], m_now_us); /* does not tell the same again */
    TEST_ASSERT_EQUAL(1, m_count);
    TEST_ASSERT_EQUAL_HEX32(0x300, m_sent[0].id);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){0x30, 0x00, 0x88, 0x13, 0x89, 0x13}), m_sent[0].data, 6);
    can_frame_t enable = {.id = 0x602, .length = 1, .data = {0x20}};
    frame_drive_hear(&all[0], &enable, m_now_us);
    frame_drive_hear(&all[1], &enable, m_now_us); /* not its own */
    TEST_ASSERT_TRUE(frame_drive_is_enabled(&all[0]));
    TEST_ASSERT_FALSE(frame_drive_is_enabled(&all[1]));
    enable.id = 0x603;
    frame_drive_hear(&all[1], &enable, m_now_us);
    const can_frame_t setpoints = {.id = 0x200, .length = 6, .data = {0x10, 0x00, 0xA0, 0x0F, 0x70, 0x17}};
    for (unsigned ms = 0; ms < 200; ms++) {
        m_now_us += 1000;
        m_count = 0;
        for (unsigned k = 0; k < 2; k++) {
            frame_drive_hear(&all[k], &setpoints, m_now_us);
            frame_drive_advance(&all[k], m_now_us);
        }
    }
    TEST_ASSERT_EQUAL(4000, frame_drive_count(&all[0]));
    TEST_ASSERT_EQUAL(6000, frame_drive_count(&all[1]));
    frame_drive_fault(&all[1], 5); /* a status of both: the fault of any */
    m_count = 0;
    m_now_us += 5000;
    frame_drive_advance(&all[0], m_now_us);
    TEST_ASSERT_EQUAL_HEX8(0x02, m_sent[0].data[1]);
    all[1].is_mute = true; /* one device */
    m_count = 0;
    m_now_us += 5000;
    frame_drive_advance(&all[0], m_now_us);
    TEST_ASSERT_EQUAL(0, m_count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_reply_has_status_position_counter_and_check_byte);
    RUN_TEST(test_other_frames_are_not_its_own);
    RUN_TEST(test_tells_nothing_by_itself_where_it_is_cut_off_or_not_started);
    RUN_TEST(test_homing_finds_the_zero_and_gives_no_torque_that_was_not_there);
    RUN_TEST(test_an_absolute_encoder_knows_its_zero_without_homing);
    RUN_TEST(test_set_points_move_it_only_with_torque);
    RUN_TEST(test_a_fault_stays_until_its_cause_is_gone);
    RUN_TEST(test_a_stop_ends_homing_without_a_zero);
    RUN_TEST(test_torque_that_outlives_a_fault_is_taken_by_a_command);
    RUN_TEST(test_homing_that_fails_is_a_fault_that_says_so);
    RUN_TEST(test_what_is_made_to_fail);
    RUN_TEST(test_without_a_query_it_tells_by_itself);
    RUN_TEST(test_a_map_without_a_word_for_torque_always_has_it);
    RUN_TEST(test_a_map_whose_states_no_status_tells_apart_is_refused);
    RUN_TEST(test_drives_that_share_frames_take_and_tell_their_own_fields);
    return UNITY_END();
}

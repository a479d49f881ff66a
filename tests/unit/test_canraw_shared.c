/* SPDX-License-Identifier: MIT
 * test_canraw_shared.c - drives that share a frame of set-points and one of replies: what each field carries, whoever follows.
 */
#include <string.h>

#include "heave/canraw.h"
#include "sim_can.h"
#include "unity.h"

#define AXES     3u
#define CYCLE_US 1000u
#define MM(x)    ((q32_t)(x)*Q32_ONE)

/* Drives 1 and 2 get their set-points in 201h, drive 3 alone in 202h; all tell in 281h: three positions, a bit of torque each. */
static sim_can_bus_t m_bus;
static sim_can_t m_node;   /* the driver's */
static sim_can_t m_drives; /* theirs */
static canraw_map_t m_map;
static canraw_t m_driver;
static drives_t m_hal;
static uint64_t m_now_us;
static drive_feedback_t m_feedback[DRIVES_MAX];
static q32_t m_setpoint_q32[DRIVES_MAX];
static int16_t m_position[AXES];
static bool m_has_torque[AXES];
static bool m_is_silent;
static bool m_takes_torque;   /* with the first set-point */
static can_frame_t m_last[2]; /* of 201h and 202h */
static unsigned m_heard[2];

static canraw_field_t position(uint8_t slot)
{
    return (canraw_field_t){CANRAW_POSITION, (uint8_t)(2 * slot - 2), 16, true, false, 0, 0, slot};
}

static canraw_frame_t command(uint8_t byte)
{
    return (canraw_frame_t){.length = 1, .constant = 1, .data = {byte}};
}

static void describe(void)
{
    m_map = (canraw_map_t){.axes = AXES, .period_us = 2000, .query_every = 1, .offline_periods = 5, .enabled_when = {1, 1}};
    m_map.setpoint = (canraw_frame_t){.length = 5, .fields = 3, .field = {position(1), position(2)}};
    m_map.setpoint.field[2] = (canraw_field_t){CANRAW_COUNTER, 4, 8, false, false, 0, 0, 0};
    m_map.command[CANRAW_ENABLE] = command(0xB1);
    m_map.command[CANRAW_DISABLE] = command(0xB2);
    m_map.position_reply = (canraw_frame_t){.length = 7, .fields = 6, .field = {position(1), position(2), position(3)}};
    for (uint8_t slot = 1; slot <= AXES; slot++) {
        m_map.position_reply.field[2 + slot] = (canraw_field_t){CANRAW_STATUS, 6, 1, false, false, (uint8_t)(slot - 1), 0, slot};
        m_map.axis[slot - 1] = (canraw_axis_map_t){.command_id = 0x600u + slot,
                                                   .setpoint_id = slot < 3 ? 0x201 : 0x202,
                                                   .reply_id = 0x281,
                                                   .setpoint_slot = slot < 3 ? slot : 1,
                                                   .reply_slot = slot,
                                                   .scale = {100, 1, 0},
                                                   .speed = {0, 1, 0},
                                                   .step_max_q32 = Q32_ONE,
                                                   .following_max_q32 = MM(10)};
    }
}

static void open_driver(void)
{
    m_now_us = 1000000;
    sim_can_bus_init(&m_bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_node, &m_bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_drives, &m_bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)));
    m_hal = canraw_hal(&m_driver);
}

void setUp(void)
{
    memset(m_feedback, 0, sizeof m_feedback);
    memset(m_setpoint_q32, 0, sizeof m_setpoint_q32);
    memset(m_heard, 0, sizeof m_heard);
    m_is_silent = false;
    m_takes_torque = false;
    for (unsigned k = 0; k < AXES; k++) {
        m_position[k] = (int16_t)(1000 * (k + 1));
        m_has_torque[k] = false;
    }
    describe();
    open_driver();
}

void tearDown(void) {}

static int16_t number_at(const can_frame_t *frame, unsigned at)
{
    return (int16_t)(frame->data[at] | frame->data[at + 1] << 8);
}

static void hear(const can_frame_t *frame)
{
    if (frame->id >= 0x601 && frame->id <= 0x603) {
        m_has_torque[frame->id - 0x601] = frame->data[0] == 0xB1;
        return;
    }
    TEST_ASSERT_TRUE(frame->id == 0x201 || frame->id == 0x202);
    const unsigned which = frame->id - 0x201;
    TEST_ASSERT_TRUE_MESSAGE(m_heard[which] == 0 || frame->data[4] == (uint8_t)(m_last[which].data[4] + 1), "a gap");
    m_heard[which]++;
    m_last[which] = *frame;
    for (unsigned k = 2 * which; k < (which == 0 ? 2u : 3u); k++) {
        m_has_torque[k] |= m_takes_torque;
        m_position[k] = m_has_torque[k] ? number_at(frame, 2 * (k - 2 * which)) : m_position[k];
    }
}

static void cycle(void)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    m_now_us += CYCLE_US;
    sim_can_bus_step(&m_bus, m_now_us);
    while (hal_can_recv(sim_can_hal(&m_drives), &frame, &at_us) == HV_OK) {
        hear(&frame);
    }
    if (!m_is_silent && m_now_us % 2000 == 0) {
        can_frame_t reply = {.id = 0x281, .length = 7};
        for (unsigned k = 0; k < AXES; k++) {
            reply.data[2 * k] = (uint8_t)m_position[k];
            reply.data[2 * k + 1] = (uint8_t)((uint16_t)m_position[k] >> 8);
            reply.data[6] |= (uint8_t)(m_has_torque[k] << k);
        }
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&m_drives), &reply));
        sim_can_bus_step(&m_bus, m_now_us);
    }
    (void)!drives_poll(m_hal, m_now_us, m_feedback);
    (void)!drives_send(m_hal, m_now_us, m_setpoint_q32);
}

static void cycles(unsigned count)
{
    while (count-- > 0) {
        cycle();
    }
}

static void follow_actual(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        m_setpoint_q32[k] = m_feedback[k].actual_mm_q32;
    }
}

static void enable_all(void)
{
    cycles(20);
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_hal, DRIVES_ENABLE));
    cycles(20);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[k].state);
    }
}

static void test_each_drive_gets_its_field_and_tells_its_own(void)
{
    enable_all();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT64(MM(10 * (int)(k + 1)), m_feedback[k].actual_mm_q32);
    }
    for (unsigned i = 0; i < 20; i++) {
        m_setpoint_q32[0] += Q32_ONE / 4;
        m_setpoint_q32[1] -= Q32_ONE / 4;
        m_setpoint_q32[2] += Q32_ONE / 2;
        cycles(2);
    }
    cycles(4);
    TEST_ASSERT_EQUAL_INT(1500, m_position[0]);
    TEST_ASSERT_EQUAL_INT(1500, m_position[1]);
    TEST_ASSERT_EQUAL_INT(4000, m_position[2]);
    TEST_ASSERT_EQUAL_INT64(MM(15), m_feedback[1].actual_mm_q32);
    TEST_ASSERT_EQUAL_INT(0, number_at(&m_last[1], 2)); /* nobody's field */
}

/* The frame goes on for the one that follows. The other's field leaves it where it is: without torque at its position, wherever
 * it is moved; with torque at its last set-point, since its position would let it creep under load. */
static void test_a_drive_that_does_not_follow_is_left_where_it_is(void)
{
    enable_all();
    cycles(10);
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(m_hal, 1, DRIVES_DISABLE));
    cycles(10);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[1].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    m_position[1] = 1234;
    m_setpoint_q32[0] += Q32_ONE / 2;
    m_setpoint_q32[1] = MM(77); /* whatever the motion has for it */
    cycles(10);
    TEST_ASSERT_EQUAL_INT(1050, m_position[0]);
    TEST_ASSERT_EQUAL_INT(1234, number_at(&m_last[0], 2));

    setUp();
    m_map.command[CANRAW_DISABLE] = (canraw_frame_t){.length = 0};
    enable_all();
    cycles(10);
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(m_hal, 1, DRIVES_DISABLE)); /* nothing that it could be told */
    m_position[1] = 1990;                                                   /* its load draws it back a little */
    cycles(10);
    TEST_ASSERT_EQUAL_INT(2000, number_at(&m_last[0], 2));
}

/* A step of one drive stops that one, and no set-point of it leaves; the other goes on. */
static void test_a_jump_of_one_is_not_sent_to_anyone(void)
{
    enable_all();
    cycles(10);
    m_setpoint_q32[1] += MM(5);
    m_setpoint_q32[0] += Q32_ONE / 2;
    cycles(2);
    TEST_ASSERT_EQUAL_INT(2000, number_at(&m_last[0], 2));
    cycles(10);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, m_feedback[1].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_INT(1050, m_position[0]);
}

/* 32767 counts are the end of the field. */
static void test_a_set_point_beyond_the_field_stops_that_drive(void)
{
    m_position[1] = 32760;
    enable_all();
    cycles(10);
    m_setpoint_q32[1] += Q32_ONE / 2;
    cycles(10);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, m_feedback[1].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL_INT(32760, number_at(&m_last[0], 2));
}

static void test_silence_is_that_of_all_that_share_the_reply(void)
{
    enable_all();
    m_is_silent = true;
    cycles(20);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[k].state);
    }
}

/* One drive alone may be enabled by a frame of its own. Where the set-point is the word, the others would be, too. */
static void test_one_of_several_is_enabled_only_by_a_frame_of_its_own(void)
{
    cycles(20);
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(m_hal, 0, DRIVES_ENABLE));
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[1].state);
    TEST_ASSERT_FALSE(m_has_torque[1]);

    setUp();
    m_map.command[CANRAW_ENABLE] = (canraw_frame_t){.length = 0};
    cycles(20);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request_one(m_hal, 0, DRIVES_ENABLE));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request_one(m_hal, 1, DRIVES_ENABLE));
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(m_hal, 2, DRIVES_ENABLE));
}

/* Without `enable` a set-point is the word for torque: the next one of the neighbour would give it back. */
static void test_one_that_is_switched_off_takes_those_along_whose_set_points_would_switch_it_on(void)
{
    m_map.command[CANRAW_ENABLE] = (canraw_frame_t){.length = 0};
    m_takes_torque = true;
    open_driver();
    enable_all();
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(m_hal, 1, DRIVES_DISABLE));
    cycles(20);
    TEST_ASSERT_FALSE(m_has_torque[0]);
    TEST_ASSERT_FALSE(m_has_torque[1]);
    TEST_ASSERT_TRUE(m_has_torque[2]); /* has a frame to itself */
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_feedback[1].state);
}

static void test_a_drive_that_homes_gets_no_set_points_of_a_frame_that_it_shares(void)
{
    m_map.command[CANRAW_HOME] = command(0xB3);
    m_map.homing_done = (canraw_when_t){0xFF, 0x80}; /* never */
    open_driver();
    enable_all();
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(m_hal, 1, DRIVES_HOME));
    cycles(6);
    TEST_ASSERT_EQUAL(DRIVE_HOMING, m_feedback[1].state);
    const unsigned heard = m_heard[0];
    const unsigned alone = m_heard[1];
    cycles(20);
    TEST_ASSERT_EQUAL_UINT(heard, m_heard[0]);
    TEST_ASSERT_TRUE(m_heard[1] > alone);
}

static void test_set_points_that_stand_are_left_out_of_the_frame_only_together(void)
{
    m_map.is_on_change = true;
    enable_all();
    cycles(10);
    const unsigned heard = m_heard[0];
    cycles(10);
    TEST_ASSERT_EQUAL_UINT(heard, m_heard[0]);
    m_setpoint_q32[1] += Q32_ONE / 2;
    cycles(10);
    TEST_ASSERT_EQUAL_UINT(heard + 1, m_heard[0]);
    TEST_ASSERT_EQUAL_INT(2050, m_position[1]);
}

/* Each kind of confusion of who has which field. */
static void test_maps_that_confuse_drives_are_refused(void)
{
    for (unsigned i = 0; i < 8; i++) {
        describe();
        switch (i) {
        case 0:
            m_map.axis[1].setpoint_slot = 1; /* that of drive 1 */
            break;
        case 1:
            m_map.axis[1].setpoint_slot = 0;
            break;
        case 2:
            m_map.axis[1].setpoint_slot = 3; /* which the frame does not have */
            break;
        case 3:
            m_map.axis[2].reply_slot = 1;
            break;
        case 4:
            m_map.axis[2].setpoint_id = 0x602; /* commands of drive 2 */
            break;
        case 5:
            m_map.axis[2].setpoint_id = 0x281;
            break;
        case 6:
            m_map.setpoint.field[2].slot = 1; /* a counter is of the whole frame */
            break;
        default:
            m_map.setpoint.field[1].slot = DRIVES_MAX + 1;
            break;
        }
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)), "taken");
    }
    describe();
    for (unsigned k = 0; k < AXES; k++) { /* without commands nobody needs an identifier of its own */
        m_map.axis[k].command_id = m_map.axis[k].setpoint_id;
    }
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)));
    m_map.command[CANRAW_ENABLE] = m_map.command[CANRAW_DISABLE] = (canraw_frame_t){.length = 0};
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&m_driver, &m_map, sim_can_hal(&m_node)));
}

static void test_filters_have_each_identifier_once(void)
{
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    hal_can_filter_t own[CANRAW_OWNS_MAX];
    TEST_ASSERT_EQUAL_UINT32(6, canraw_filters(&m_map, filter)); /* and another master's */
    TEST_ASSERT_EQUAL_HEX32(0x281, filter[0].id);
    TEST_ASSERT_EQUAL_UINT32(5, canraw_owns(&m_map, own));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_each_drive_gets_its_field_and_tells_its_own);
    RUN_TEST(test_a_drive_that_does_not_follow_is_left_where_it_is);
    RUN_TEST(test_a_jump_of_one_is_not_sent_to_anyone);
    RUN_TEST(test_a_set_point_beyond_the_field_stops_that_drive);
    RUN_TEST(test_silence_is_that_of_all_that_share_the_reply);
    RUN_TEST(test_one_of_several_is_enabled_only_by_a_frame_of_its_own);
    RUN_TEST(test_one_that_is_switched_off_takes_those_along_whose_set_points_would_switch_it_on);
    RUN_TEST(test_a_drive_that_homes_gets_no_set_points_of_a_frame_that_it_shares);
    RUN_TEST(test_set_points_that_stand_are_left_out_of_the_frame_only_together);
    RUN_TEST(test_maps_that_confuse_drives_are_refused);
    RUN_TEST(test_filters_have_each_identifier_once);
    return UNITY_END();
}

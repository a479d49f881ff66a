/* SPDX-License-Identifier: MIT
 * test_canraw_master.c - another master on the bus of drives with frames of their own: heaved listens before it speaks, and
 * frames with its identifiers that it has not sent stop the platform, or are told, or ignored, as it is configured.
 */
#include "heave/canraw.h"

#include <string.h>

#include "canraw_drives.h"
#include "canraw_maps.h"
#include "unity.h"

#define AXES      DRIVES_MAX
#define CYCLE_US  1000u
#define LISTEN_MS 100u

static sim_can_bus_t bus;
static sim_can_t node;
static sim_can_t other; /* the other master's */
static sim_can_t spy;   /* hears all */
static canraw_drives_t slave;
static canraw_map_t map;
static canraw_t driver;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];

static void cycles(unsigned count)
{
    while (count-- > 0) {
        now_us += CYCLE_US;
        canraw_drives_step(&slave, now_us);
        (void)!drives_poll(hal, now_us, feedback);
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] = feedback[k].state == DRIVE_ENABLED ? setpoint_q32[k] : feedback[k].actual_mm_q32;
        }
        (void)!drives_send(hal, now_us, setpoint_q32);
    }
}

static bool are_all(drive_state_t state)
{
    for (unsigned k = 0; k < AXES; k++) {
        if (feedback[k].state != state) {
            return false;
        }
    }
    return true;
}

static void await(drive_state_t state)
{
    for (unsigned i = 0; i < 3000 && !are_all(state); i++) {
        cycles(1);
    }
    TEST_ASSERT_TRUE(are_all(state));
}

static void start(canraw_master_t reaction)
{
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    map = canraw_maps_rich();
    map.other_master = reaction;
    map.listen_ms = LISTEN_MS;
    now_us = 1000000;
    sim_can_bus_init(&bus, 0, NULL, 0);
    canraw_drives_open(&slave, &bus, canraw_maps_rich());
    for (unsigned k = 0; k < AXES; k++) {
        canraw_drives_place(&slave, k, CANRAW_DRIVES_RICH_ZERO - (20 + 10 * (int)k) * 10000 / 3);
    }
    memset(feedback, 0, sizeof feedback);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, filter, canraw_filters(&map, filter)));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&other, &bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&spy, &bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&driver, &map, sim_can_hal(&node)));
    hal = canraw_hal(&driver);
}

void setUp(void) {}

void tearDown(void) {}

/* A query of a position, which these drives understand. */
static void say(uint32_t id)
{
    can_frame_t frame = {.id = id, .is_extended = map.is_extended, .length = map.position_query.length};
    memcpy(frame.data, map.position_query.data, sizeof frame.data);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&other), &frame));
}

/* Frames to drives since the last call. */
static unsigned frames_heard(void)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    unsigned count = 0;
    while (hal_can_recv(sim_can_hal(&spy), &frame, &at_us) == HV_OK) {
        for (unsigned k = 0; k < AXES; k++) {
            count += frame.id == map.axis[k].command_id || frame.id == map.axis[k].setpoint_id;
        }
    }
    return count;
}

static drive_report_t report_of(uint8_t axis)
{
    drive_report_t report;
    drives_report(hal, axis, &report);
    return report;
}

static void test_nothing_is_sent_before_it_has_listened(void)
{
    start(CANRAW_MASTER_STOP);
    cycles(LISTEN_MS);
    TEST_ASSERT_EQUAL_UINT(0, frames_heard());
    TEST_ASSERT_EQUAL_STRING("listening", report_of(0).phase);
    TEST_ASSERT_FALSE(drive_has_other_master(&feedback[0]));
    TEST_ASSERT_EQUAL_HEX32(0, report_of(0).code);
    cycles(2);
    TEST_ASSERT_GREATER_THAN_UINT(0, frames_heard());
    await(DRIVE_DISABLED);
}

static void test_a_bus_with_a_master_is_left_alone_until_that_is_silent(void)
{
    start(CANRAW_MASTER_STOP);
    for (unsigned n = 0; n < 50; n++) {
        cycles(LISTEN_MS - 10u);
        TEST_ASSERT_EQUAL_UINT(0, frames_heard());
        say(map.axis[2].command_id);
        cycles(1);
        TEST_ASSERT_EQUAL_UINT(1, frames_heard());
        TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
        TEST_ASSERT_TRUE(drive_has_other_master(&feedback[5]));
        TEST_ASSERT_EQUAL_HEX32(CANRAW_OTHER_MASTER, report_of(5).code);
        TEST_ASSERT_NOT_NULL(strstr(report_of(5).trouble, "another master"));
    }
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_DISABLED);
    TEST_ASSERT_EQUAL_HEX32(0, report_of(5).code);
}

static void test_in_motion_it_is_named_within_a_period_and_all_stop(void)
{
    start(CANRAW_MASTER_STOP);
    await(DRIVE_DISABLED);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED);
    cycles(100);
    say(map.axis[1].setpoint_id);
    cycles(1);
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[k].state);
        TEST_ASSERT_EQUAL_HEX32(CANRAW_OTHER_MASTER, feedback[k].fault_code);
    }
    cycles(6000);
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_FALSE(feedback[k].is_energized);
        TEST_ASSERT_FALSE(frame_drive_is_enabled(&slave.twin[k]));
    }
}

/* Each of its frames may have given torque again. */
static void test_one_that_goes_on_is_answered_each_time(void)
{
    start(CANRAW_MASTER_STOP);
    await(DRIVE_DISABLED);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED);
    for (unsigned n = 0; n < 1000; n++) {
        say(map.axis[1].setpoint_id);
        cycles(5);
        TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
        TEST_ASSERT_FALSE(frame_drive_is_enabled(&slave.twin[1]) && n > 300);
        if (n == 500) {
            canraw_drives_command(&slave, 1, CANRAW_ENABLE); /* it was told to */
        }
    }
    cycles(1000);
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_FALSE(feedback[k].is_energized);
        TEST_ASSERT_FALSE(frame_drive_is_enabled(&slave.twin[k]));
    }
}

/* Before any drive is known heaved is silent again, and begins anew. */
static void test_while_no_drive_is_known_it_listens_again(void)
{
    start(CANRAW_MASTER_STOP);
    for (unsigned k = 0; k < AXES; k++) {
        slave.twin[k].is_mute = true;
    }
    cycles(3 * LISTEN_MS);
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    say(map.axis[2].command_id);
    cycles(1);
    TEST_ASSERT_TRUE(drive_has_other_master(&feedback[0]));
    cycles(2);
    (void)frames_heard();
    cycles(990);
    TEST_ASSERT_EQUAL_UINT(0, frames_heard());
    for (unsigned k = 0; k < AXES; k++) {
        slave.twin[k].is_mute = false;
    }
    await(DRIVE_DISABLED);
}

static void test_time_in_which_nothing_is_heard_does_not_count(void)
{
    start(CANRAW_MASTER_STOP);
    sim_can_unplug(&node);
    cycles(3000);
    sim_can_plug(&node);
    for (unsigned n = 0; n < 20; n++) {
        (void)frames_heard();
        say(map.axis[2].command_id);
        cycles(LISTEN_MS - 10u);
        TEST_ASSERT_EQUAL_UINT(1, frames_heard());
    }
    await(DRIVE_DISABLED);
}

static void test_told_or_ignored_it_goes_on(void)
{
    for (unsigned reaction = CANRAW_MASTER_IGNORE; reaction <= CANRAW_MASTER_REPORT; reaction++) {
        start((canraw_master_t)reaction);
        cycles(2);
        TEST_ASSERT_GREATER_THAN_UINT(0, frames_heard());
        await(DRIVE_DISABLED);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        await(DRIVE_ENABLED);
        cycles(50); /* what the drives say is their own */
        TEST_ASSERT_EQUAL_UINT32(0, report_of(0).notes);
        TEST_ASSERT_EQUAL_UINT32(0, driver.master.count);
        say(map.axis[1].command_id);
        cycles(5);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        TEST_ASSERT_EQUAL_UINT32(reaction == CANRAW_MASTER_REPORT ? 1u << DRIVE_NOTE_MASTER : 0u, report_of(0).notes);
        cycles(6000);
        TEST_ASSERT_EQUAL_UINT32(0, report_of(0).notes);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_is_sent_before_it_has_listened);
    RUN_TEST(test_a_bus_with_a_master_is_left_alone_until_that_is_silent);
    RUN_TEST(test_in_motion_it_is_named_within_a_period_and_all_stop);
    RUN_TEST(test_one_that_goes_on_is_answered_each_time);
    RUN_TEST(test_while_no_drive_is_known_it_listens_again);
    RUN_TEST(test_time_in_which_nothing_is_heard_does_not_count);
    RUN_TEST(test_told_or_ignored_it_goes_on);
    return UNITY_END();
}

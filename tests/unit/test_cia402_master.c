/* SPDX-License-Identifier: MIT
 * test_cia402_master.c - another master on the bus: heaved listens before it speaks, and whatever only a master sends is named
 * and stops the platform, or is told, or ignored, as it is configured. And what a master has left behind: nodes that it has
 * stopped.
 */
#include "heave/cia402.h"

#include <string.h>

#include "canopen_drives.h"
#include "unity.h"

#define AXES      CANOPEN_DRIVES
#define CYCLE_US  1000u
#define PERIOD    4u
#define LISTEN_MS 100u
#define MM(x)     ((q32_t)(x)*Q32_ONE)

static sim_can_bus_t bus;
static sim_can_t node;
static sim_can_t other; /* the other master's */
static sim_can_t spy;   /* hears all */
static canopen_drives_t twin;
static cia402_config_t config;
static cia402_t driver;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];

static void cycles(unsigned count)
{
    while (count-- > 0) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
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
    for (unsigned i = 0; i < 5000 && !are_all(state); i++) {
        cycles(1);
    }
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(state, feedback[k].state);
    }
}

static void start(void)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    const uint32_t filters = cia402_filters(&config, filter);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, filter, filters));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&other, &bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&spy, &bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&node)));
    hal = cia402_hal(&driver);
}

void setUp(void)
{
    now_us = 5000000;
    memset(feedback, 0, sizeof feedback);
    sim_can_bus_init(&bus, 0, NULL, 0);
    canopen_drives_open(&twin, &bus);
    config = (cia402_config_t){.axes = AXES,
                               .master_node = 127,
                               .mode = CIA402_MODE_CSP,
                               .period_us = PERIOD * CYCLE_US,
                               .heartbeat_ms = 50,
                               .heartbeat_timeout_ms = 150,
                               .sdo_timeout_ms = 50,
                               .boot_timeout_ms = 500,
                               .power_timeout_ms = 300,
                               .window_ms = 20,
                               .abort_option = 1,
                               .is_reset_wanted = true,
                               .listen_ms = LISTEN_MS};
    config.reaction[CIA402_WATCH_MASTER] = CIA402_STOP;
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k + 1),
                                                .scale = {1000, 1, 0},
                                                .step_max_q32 = MM(2),
                                                .following_max_q32 = MM(10),
                                                .window_counts = 10000};
    }
}

void tearDown(void) {}

static void say(uint32_t id, uint8_t length, uint8_t first, uint8_t second)
{
    const can_frame_t frame = {.id = id, .length = length, .data = {first, second}};
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&other), &frame));
}

/* Frames on the bus since the last call, but what only drives say; what the other master says is one of them. */
static unsigned frames_heard(void)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    unsigned count = 0;
    while (hal_can_recv(sim_can_hal(&spy), &frame, &at_us) == HV_OK) {
        const uint32_t function = frame.id & 0x780u;
        count += frame.id == 0x000 || frame.id == 0x080 || frame.id == 0x77F || function == 0x600 || function == 0x200 ||
                 function == 0x500;
    }
    return count;
}

static drive_report_t report_of(uint8_t axis)
{
    drive_report_t report;
    drives_report(hal, axis, &report);
    return report;
}

static const struct {
    uint32_t id;
    uint8_t length;
    uint8_t data[2];
    cia402_trouble_t trouble;
} k_said[] = {
    {0x080, 0, {0}, CIA402_OTHER_SYNC},          {0x080, 1, {7}, CIA402_OTHER_SYNC},
    {0x000, 2, {0x80, 0}, CIA402_OTHER_NMT},     {0x000, 2, {0x01, 3}, CIA402_OTHER_NMT},
    {0x77F, 1, {0x05}, CIA402_OTHER_HEARTBEAT},  {0x203, 6, {0x0F, 0}, CIA402_OTHER_COMMAND},
    {0x502, 8, {0x0F, 0}, CIA402_OTHER_COMMAND}, /* of a map that is not ours */
};
#define SAID (sizeof k_said / sizeof k_said[0])

static void say_row(size_t i)
{
    say(k_said[i].id, k_said[i].length, k_said[i].data[0], k_said[i].data[1]);
}

/* --- At the start --- */

static void test_nothing_is_sent_before_it_has_listened(void)
{
    start();
    cycles(LISTEN_MS);
    TEST_ASSERT_EQUAL_UINT(0, frames_heard());
    TEST_ASSERT_EQUAL_STRING("listening", report_of(0).phase);
    cycles(2);
    TEST_ASSERT_GREATER_THAN_UINT(0, frames_heard());
    await(DRIVE_DISABLED);
}

static void test_a_bus_with_a_master_is_left_alone_until_that_is_silent(void)
{
    for (size_t i = 0; i < SAID; i++) {
        setUp();
        start();
        for (unsigned n = 0; n < 50; n++) {
            cycles(LISTEN_MS - 10u);
            say_row(i);
            cycles(1);
            TEST_ASSERT_EQUAL_UINT(1, frames_heard());
            TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
            TEST_ASSERT_EQUAL_HEX32(k_said[i].trouble, report_of(2).code);
            TEST_ASSERT_EQUAL_STRING("listening", report_of(2).phase);
        }
        TEST_ASSERT_NOT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        cia402_leave(&driver);
        cycles(LISTEN_MS - 2u);
        TEST_ASSERT_EQUAL_UINT(0, frames_heard());
        await(DRIVE_DISABLED);
        TEST_ASSERT_EQUAL_HEX32(0, report_of(2).code);
    }
}

/* A bus that comes later: nobody was heard on it before. */
static void test_time_in_which_nothing_is_heard_does_not_count(void)
{
    start();
    sim_can_unplug(&node);
    cycles(8000);
    sim_can_plug(&node);
    for (unsigned n = 0; n < 20; n++) {
        cycles(LISTEN_MS - 10u);
        (void)frames_heard();
        say_row(0);
        cycles(1);
        TEST_ASSERT_EQUAL_UINT(1, frames_heard());
    }
    TEST_ASSERT_TRUE(drive_has_other_master(&feedback[0]));
    await(DRIVE_DISABLED);
}

/* Whoever was heard may be silent while it restarts its bus. */
static void test_who_was_heard_has_to_be_silent_for_a_second(void)
{
    start();
    cycles(10);
    say_row(0);
    cycles(999);
    TEST_ASSERT_EQUAL_UINT(1, frames_heard());
    await(DRIVE_DISABLED);
}

/* Drives that are still being set up have nothing to hear of a stop: heaved is silent again, and begins anew. */
static void test_while_no_drive_is_known_it_listens_again(void)
{
    for (unsigned at = 1; at < 40; at++) {
        setUp();
        start();
        cycles(LISTEN_MS + at);
        TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
        say_row(2);
        cycles(1);
        TEST_ASSERT_TRUE(drive_has_other_master(&feedback[0]));
        TEST_ASSERT_EQUAL_STRING("listening", report_of(0).phase);
        cycles(2);
        (void)frames_heard();
        cycles(990);
        TEST_ASSERT_EQUAL_UINT(0, frames_heard());
        await(DRIVE_DISABLED);
    }
}

/* One that comes later than the others is not left out. */
static void test_in_the_middle_of_bringing_up_nobody_is_enabled(void)
{
    canopen_drives_power(&twin, 4, false);
    start();
    for (unsigned i = 0; i < 5000 && (feedback[0].state != DRIVE_DISABLED || feedback[AXES - 1].state != DRIVE_DISABLED); i++) {
        cycles(1);
    }
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[AXES - 1].state);
    say_row(3);
    cycles(1);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(k == 4 ? DRIVE_OFFLINE : DRIVE_FAULT, feedback[k].state);
        TEST_ASSERT_TRUE(drive_has_other_master(&feedback[k]));
    }
    canopen_drives_power(&twin, 4, true);
    cycles(3000);
    TEST_ASSERT_NOT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED);
}

/* All its kinds by turns would be a line of the log each time. */
static void test_the_first_that_was_heard_is_named(void)
{
    start();
    cycles(10);
    for (size_t i = 0; i < 5 * SAID; i++) {
        say_row((i + 1) % SAID);
        cycles(1);
        TEST_ASSERT_EQUAL_HEX32(k_said[1].trouble, report_of(0).code);
        TEST_ASSERT_EQUAL_HEX32(k_said[1].trouble, feedback[0].fault_code);
    }
}

static void test_a_master_that_may_be_there_is_not_waited_for(void)
{
    for (unsigned reaction = CIA402_IGNORE; reaction <= CIA402_REPORT; reaction++) {
        setUp();
        config.reaction[CIA402_WATCH_MASTER] = (cia402_reaction_t)reaction;
        start();
        cycles(2);
        TEST_ASSERT_GREATER_THAN_UINT(0, frames_heard());
    }
}

/* --- Later --- */

static void test_in_motion_each_is_named_within_a_period_and_all_stop(void)
{
    for (size_t i = 0; i < SAID; i++) {
        setUp();
        start();
        await(DRIVE_DISABLED);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        await(DRIVE_ENABLED);
        cycles(40 + (unsigned)i);
        say_row(i);
        cycles(PERIOD);
        for (uint8_t k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[k].state);
            TEST_ASSERT_EQUAL_HEX32(k_said[i].trouble, feedback[k].fault_code);
            TEST_ASSERT_EQUAL_HEX32(k_said[i].trouble, report_of(k).code);
        }
        cycles(2000);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_FALSE(feedback[k].is_energized);
        }
    }
}

static void test_at_rest_nobody_is_enabled_until_a_reset_and_silence(void)
{
    start();
    await(DRIVE_DISABLED);
    say_row(0);
    cycles(PERIOD);
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_NOT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    say_row(0);
    cycles(PERIOD);
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED);
}

/* SYNC of somebody else ten times: the drives answer to each, and are not taken for two of a kind. */
static void test_told_or_ignored_it_goes_on(void)
{
    for (unsigned reaction = CIA402_IGNORE; reaction <= CIA402_REPORT; reaction++) {
        setUp();
        config.reaction[CIA402_WATCH_MASTER] = (cia402_reaction_t)reaction;
        start();
        await(DRIVE_DISABLED);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        await(DRIVE_ENABLED);
        for (unsigned n = 0; n < 10; n++) {
            say_row(0);
            cycles(7);
            TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        }
        const bool is_told = (report_of(0).notes >> CIA402_WATCH_MASTER & 1u) != 0;
        TEST_ASSERT_EQUAL(reaction == CIA402_REPORT, is_told);
        cycles(6000);
        TEST_ASSERT_EQUAL_UINT32(0, report_of(0).notes >> CIA402_WATCH_MASTER & 1u);
    }
}

/* What other nodes are told, and what others than masters say. */
static void test_what_is_no_concern_of_ours_is_none(void)
{
    start();
    await(DRIVE_DISABLED);
    say(0x000, 2, 0x01, 60); /* to a node that is not ours */
    say(0x000, 1, 0x01, 0);  /* of another length */
    say(0x100, 6, 0, 0);     /* time stamp */
    say(0x23C, 8, 0x0F, 0);  /* a PDO of node 60 */
    say(0x77E, 1, 0x05, 0);  /* another master's heartbeat, which none of ours watches */
    say(0x63C, 8, 0x40, 0);  /* and its SDO */
    cycles(10 * PERIOD);
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    TEST_ASSERT_EQUAL_UINT32(0, driver.master.count);
}

/* --- A node that somebody has stopped (NMT) --- */

static void come_up_beside_a_master(void)
{
    config.reaction[CIA402_WATCH_MASTER] = CIA402_REPORT;
    start();
    await(DRIVE_DISABLED);
}

static void test_a_stopped_node_stays_so_until_somebody_resets(void)
{
    come_up_beside_a_master();
    say(0x000, 2, 0x02, 3);
    cycles(10000);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[2].state);
    TEST_ASSERT_EQUAL_UINT8(0x04, twin.drive[2].node.nmt);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED);
}

static void test_a_stopped_node_stays_so_while_others_have_torque(void)
{
    come_up_beside_a_master();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED);
    say(0x000, 2, 0x02, 3);
    cycles(500);
    TEST_ASSERT_TRUE(feedback[1].is_energized);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(2000);
    TEST_ASSERT_EQUAL_UINT8(0x04, twin.drive[2].node.nmt);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    cycles(2000);
    TEST_ASSERT_EQUAL_UINT8(0x04, twin.drive[2].node.nmt);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED);
}

static void test_nodes_that_are_all_stopped_come_back_with_a_reset(void)
{
    come_up_beside_a_master();
    say(0x000, 2, 0x02, 0);
    cycles(3000);
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    (void)!drives_request(hal, DRIVES_RESET_FAULT);
    await(DRIVE_DISABLED);
}

static void test_nodes_that_are_stopped_at_the_start_come_up(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        twin.drive[k].node.nmt = 0x04;
    }
    start();
    await(DRIVE_DISABLED);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_is_sent_before_it_has_listened);
    RUN_TEST(test_a_bus_with_a_master_is_left_alone_until_that_is_silent);
    RUN_TEST(test_time_in_which_nothing_is_heard_does_not_count);
    RUN_TEST(test_who_was_heard_has_to_be_silent_for_a_second);
    RUN_TEST(test_while_no_drive_is_known_it_listens_again);
    RUN_TEST(test_in_the_middle_of_bringing_up_nobody_is_enabled);
    RUN_TEST(test_the_first_that_was_heard_is_named);
    RUN_TEST(test_a_master_that_may_be_there_is_not_waited_for);
    RUN_TEST(test_in_motion_each_is_named_within_a_period_and_all_stop);
    RUN_TEST(test_at_rest_nobody_is_enabled_until_a_reset_and_silence);
    RUN_TEST(test_told_or_ignored_it_goes_on);
    RUN_TEST(test_what_is_no_concern_of_ours_is_none);
    RUN_TEST(test_a_stopped_node_stays_so_until_somebody_resets);
    RUN_TEST(test_a_stopped_node_stays_so_while_others_have_torque);
    RUN_TEST(test_nodes_that_are_all_stopped_come_back_with_a_reset);
    RUN_TEST(test_nodes_that_are_stopped_at_the_start_come_up);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_cia402_nodes.c - drives with several axes in a node, and PDOs as drives have them, against the drives of heave-twin:
 * coming up, following, losses of one axis and of the node, refusals, maps that are written and maps that are fixed.
 */
#include "heave/cia402.h"

#include <string.h>

#include "sim_can.h"
#include "twin/node.h"
#include "unity.h"

#define AXES     7u
#define CYCLE_US 1000u
#define PERIOD   4u /* cycles */
#define MM(x)    ((q32_t)(x)*Q32_ONE)

static sim_can_bus_t bus;
static sim_can_t master, slaves;
static node_t node[AXES];
static cia402_config_t config;
static cia402_t driver;
static drives_t hal;
static uint64_t now_us;
static unsigned axes, cycle_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];
static unsigned syncs, requests, open_requests, most_open; /* seen on the bus; SDO requests without an answer, of node 1 */
static unsigned frames[0x800];
static bool is_boot_lost; /* boot-ups do not arrive */
#define OUT_MAX 64u
static can_frame_t waiting[OUT_MAX]; /* of the drives, on their way */
static unsigned outs;

static void put(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    if (is_boot_lost && (frame->id & 0x780u) == 0x700 && frame->data[0] == 0) {
        return;
    }
    frames[frame->id]++;
    open_requests -= frame->id == 0x581 && open_requests > 0;
    if (frame->id == 0x701 && frame->data[0] == 0) { /* what it was asked before it was there gets no answer */
        open_requests = most_open = 0;
    }
    TEST_ASSERT_TRUE(outs < OUT_MAX);
    waiting[outs++] = *frame;
}

static void flush(void)
{
    unsigned sent = 0;
    while (sent < outs && hal_can_send(sim_can_hal(&slaves), &waiting[sent]) == HV_OK) {
        sent++;
    }
    memmove(waiting, waiting + sent, (outs - sent) * sizeof waiting[0]);
    outs -= sent;
}

static void hear_all(void)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    sim_can_bus_step(&bus, now_us);
    while (hal_can_recv(sim_can_hal(&slaves), &frame, &at_us) == HV_OK) {
        frames[frame.id]++;
        syncs += frame.id == 0x80;
        if (frame.id == 0x601) {
            requests++;
            open_requests++;
            most_open = open_requests > most_open ? open_requests : most_open;
        }
        for (unsigned k = 0; k < axes; k++) {
            node_hear(&node[k], &frame, now_us);
        }
    }
    for (unsigned k = 0; k < axes; k++) {
        node_advance(&node[k], now_us);
    }
    for (unsigned i = 0; i < 3; i++) {
        flush();
        sim_can_bus_step(&bus, now_us);
    }
}

static void cycle(void)
{
    now_us += cycle_us;
    hear_all();
    (void)!drives_poll(hal, now_us, feedback);
    (void)!drives_send(hal, now_us, setpoint_q32);
}

static void cycles(unsigned count)
{
    while (count-- > 0) {
        cycle();
    }
}

/* Nodes 1 to 3 with two axes each: drives 1 and 2 are those of node 1. */
static void configure(void)
{
    config = (cia402_config_t){.axes = axes,
                               .master_node = 127,
                               .mode = CIA402_MODE_CSP,
                               .period_us = PERIOD * CYCLE_US,
                               .heartbeat_ms = 50,
                               .heartbeat_timeout_ms = 150,
                               .sdo_timeout_ms = 50,
                               .boot_timeout_ms = 500,
                               .power_timeout_ms = 1000,
                               .window_ms = 20,
                               .abort_option = 1,
                               .is_reset_wanted = true,
                               .is_support_checked = true};
    for (unsigned k = 0; k < axes; k++) {
        config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k / 2 + 1),
                                                .channel = (uint8_t)(k % 2),
                                                .scale = {1000, 1, 0},
                                                .step_max_q32 = MM(4),
                                                .following_max_q32 = MM(20),
                                                .window_counts = 20000,
                                                .homing_speed = {10000, 1000},
                                                .profile_speed = 20000,
                                                .profile_accel = 100000,
                                                .homing_accel = 100000};
    }
    for (unsigned i = 0; i < CIA402_WATCHES; i++) {
        config.reaction[i] = i < CIA402_WATCH_LIMIT ? CIA402_STOP : CIA402_REPORT;
    }
}

void setUp(void)
{
    now_us = 5000000;
    axes = 6;
    cycle_us = CYCLE_US;
    memset(feedback, 0, sizeof feedback);
    memset(setpoint_q32, 0, sizeof setpoint_q32);
    memset(node, 0, sizeof node);
    memset(frames, 0, sizeof frames);
    is_boot_lost = false;
    outs = syncs = requests = open_requests = most_open = 0;
    sim_can_bus_init(&bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&slaves, &bus, NULL, 0));
    configure();
}

void tearDown(void) {}

/* The drives as the configuration has them. */
static void power_up(void)
{
    for (unsigned k = 0; k < axes; k++) {
        const uint32_t identity[4] = {0x2E5, 1, 1, k + 1};
        node[k].number = config.axis[k].node;
        memcpy(node[k].identity, identity, sizeof identity);
        node[k].boot_us = 30000;
        node[k].out = (node_out_t){put, NULL};
        node[k].pdo_step = config.pdo_step;
        node[k].commands = config.commands;
        node[k].answers = config.answers;
        node[k].are_maps_fixed = config.are_maps_fixed;
        node[k].drive.switch_on_us = 5000;
        node[k].drive.brake_us = 8000;
        node[k].drive.missed_max = 3;
        node[k].drive.jump_counts = 20000;
        node[k].drive.is_absolute = true;
        node[k].drive.motor.lag_us = 1000;
        node[k].drive.motor.rated_speed = 1e6;
        motor_start(&node[k].drive.motor, 100000 + 1000.0 * k, now_us);
    }
    for (unsigned k = 0; k < axes; k++) {
        node_t *axis[OBJECT_AXES] = {&node[k]};
        unsigned channels = 1;
        for (unsigned i = 0; i < axes && config.axis[k].channel == 0; i++) {
            if (config.axis[i].node == config.axis[k].node && config.axis[i].channel > 0) {
                axis[config.axis[i].channel] = &node[i];
                channels++;
            }
        }
        if (config.axis[k].channel == 0) {
            node_join(axis, channels);
        }
    }
    for (unsigned k = 0; k < axes; k++) {
        node_power(&node[k], true, now_us);
    }
}

static void start(void)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    hal_can_filter_t own[CIA402_OWNS_MAX];
    power_up();
    TEST_ASSERT_TRUE(cia402_owns(&config, own) <= CIA402_OWNS_MAX);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&master, &bus, filter, cia402_filters(&config, filter)));
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&master)));
    hal = cia402_hal(&driver);
}

static drive_report_t report(uint8_t axis)
{
    drive_report_t out;
    TEST_ASSERT_TRUE(drives_report(hal, axis, &out));
    return out;
}

static bool are_all(drive_state_t state)
{
    for (unsigned k = 0; k < axes; k++) {
        if (feedback[k].state != state) {
            return false;
        }
    }
    return true;
}

static void await(drive_state_t state, unsigned most)
{
    for (unsigned i = 0; i < most && !are_all(state); i++) {
        cycle();
        for (unsigned k = 0; k < axes; k++) {
            setpoint_q32[k] = feedback[k].actual_mm_q32;
        }
    }
    for (unsigned k = 0; k < axes; k++) {
        TEST_ASSERT_EQUAL_MESSAGE(state, feedback[k].state, report((uint8_t)k).trouble);
    }
}

static void come_up(void)
{
    start();
    await(DRIVE_DISABLED, 6000);
}

static void enable(void)
{
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED, 3000);
}

/* Each axis goes its own way, and gets there. */
static void follow(void)
{
    q32_t from_q32[AXES];
    for (unsigned k = 0; k < axes; k++) {
        from_q32[k] = feedback[k].actual_mm_q32;
    }
    for (unsigned i = 1; i <= 200; i++) {
        for (unsigned k = 0; k < axes; k++) {
            setpoint_q32[k] = from_q32[k] + ((q32_t)k + 1) * Q32_ONE * i / 200;
        }
        cycle();
    }
    cycles(40);
    for (unsigned k = 0; k < axes; k++) {
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[k].state);
        TEST_ASSERT_INT32_WITHIN(5, (int32_t)(100000 + 1000 * k + 1000 * (k + 1)), drive_count(&node[k].drive));
    }
}

static uint32_t held(unsigned axis, uint16_t index, uint8_t sub)
{
    return objects_get(&node[axis].drive.od, index, sub);
}

/* --- Axes of a node --- */

static void test_axes_of_a_node_come_up_and_each_follows_its_own_setpoints(void)
{
    come_up();
    TEST_ASSERT_EQUAL_UINT(1, most_open); /* one transfer at a time, whatever its axes want */
    TEST_ASSERT_TRUE(requests > 100);
    enable();
    follow();
    TEST_ASSERT_EQUAL_HEX32(0x60400010, held(0, 0x1600, 1));
    TEST_ASSERT_EQUAL_HEX32(0x68400010, held(1, 0x1600, 1));
    TEST_ASSERT_EQUAL_HEX32(0x687A0020, held(1, 0x1600, 2));
    TEST_ASSERT_EQUAL_HEX32(0x301, held(1, 0x1400, 1));
    TEST_ASSERT_EQUAL_HEX32(0x40000281, held(1, 0x1800, 1));
    TEST_ASSERT_EQUAL_HEX32(4, held(1, 0x60C2, 1));
    TEST_ASSERT_EQUAL_HEX32(0x7F0096, held(0, 0x1016, 1)); /* the node's, once */
    TEST_ASSERT_EQUAL_HEX32(0, held(1, 0x1016, 1));
    TEST_ASSERT_EQUAL_UINT8(2, report(3).address);
    TEST_ASSERT_EQUAL_UINT8(2, report(3).channel);
}

static void test_axes_may_stand_in_any_order(void)
{
    static const uint8_t k_nodes[][2] = {{9, 1}, {9, 0}, {5, 0}, {7, 2}, {7, 1}, {7, 0}};
    for (unsigned k = 0; k < axes; k++) {
        config.axis[k].node = k_nodes[k][0];
        config.axis[k].channel = k_nodes[k][1];
    }
    config.pdo_step = 2;
    come_up();
    enable();
    follow();
    TEST_ASSERT_EQUAL_UINT8(0, report(2).channel); /* has its node to itself */
    TEST_ASSERT_EQUAL_UINT8(3, report(3).channel);
    TEST_ASSERT_EQUAL_HEX32(0x407, held(3, 0x1400, 1));
}

static void test_each_axis_has_its_own_mode_and_homing(void)
{
    config.axis[1].mode = CIA402_MODE_IP;
    config.axis[2].homing_method = 37;
    config.axis[3].homing_method = 35;
    config.axis[4].mode = CIA402_MODE_PP;
    come_up();
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    cycle();
    await(DRIVE_ENABLED, 3000);
    TEST_ASSERT_EQUAL_HEX32(0x60C10120 + 0x08000000, held(1, 0x1600, 2));
    static const int8_t k_modes[] = {8, 7, 8, 8, 1, 8};
    static const uint8_t k_methods[] = {0, 0, 37, 35, 0, 0};
    for (unsigned k = 0; k < axes; k++) {
        TEST_ASSERT_EQUAL_INT8(k_modes[k], node[k].drive.mode);
        TEST_ASSERT_EQUAL_UINT8(k_methods[k], held(k, 0x6098, 0));
    }
    TEST_ASSERT_INT32_WITHIN(2, 0, drive_count(&node[2].drive)); /* here is its zero */
    TEST_ASSERT_INT32_WITHIN(2, 104000, drive_count(&node[4].drive));
    setpoint_q32[4] += MM(1);
    setpoint_q32[1] += MM(1);
    cycles(200);
    TEST_ASSERT_INT32_WITHIN(5, 105000, drive_count(&node[4].drive));
    TEST_ASSERT_INT32_WITHIN(5, 102000, drive_count(&node[1].drive));
}

static void test_axis_that_falls_silent_is_named_and_takes_its_node_along(void)
{
    come_up();
    enable();
    node[1].tpdo_drop = 200;
    unsigned count = 0;
    while (feedback[1].state == DRIVE_ENABLED && count++ < 100) {
        cycle();
        TEST_ASSERT_TRUE(feedback[0].state == DRIVE_ENABLED || feedback[1].state != DRIVE_ENABLED); /* the cause comes first */
    }
    TEST_ASSERT_TRUE(count <= 4 * PERIOD + 1); /* four periods and a cycle */
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_TPDO, feedback[1].fault_code);
    cycle();
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[0].state);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_NODE, feedback[0].fault_code);
    TEST_ASSERT_EQUAL_STRING("was lost with another axis of its node, which is set up again", report(0).trouble);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[2].state); /* what becomes of the others is the gateway's to say */
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    node[1].tpdo_drop = 0;
    await(DRIVE_DISABLED, 6000);
    cycles(500);
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED)); /* nothing is enabled by itself */
    enable();
    follow();
}

static void test_node_that_starts_again_is_lost_with_all_its_axes(void)
{
    come_up();
    enable();
    node_reboot(&node[3], now_us);
    cycles(60);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[2].state);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[3].state);
    TEST_ASSERT_EQUAL_HEX32(CIA402_REBOOTED, report(2).code);
    TEST_ASSERT_EQUAL_HEX32(CIA402_REBOOTED, report(3).code);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    await(DRIVE_DISABLED, 6000);
    enable();
}

static void test_axis_in_fault_leaves_the_other_to_the_gateway_and_is_reset(void)
{
    come_up();
    enable();
    drive_fault(&node[1].drive, 0x2310);
    cycles(3 * PERIOD);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    TEST_ASSERT_EQUAL_HEX32(0x2310, feedback[1].fault_code);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(200);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 1000);
    enable();
}

/* The one that does not take an object is refused; the other waits, and comes up once a reset finds the cause gone. */
static void test_axis_that_is_refused_names_its_object_and_the_other_waits(void)
{
    start();
    objects_find(&node[3].drive.od, 0x60C2, 1)->refusal = 0x06090030;
    cycles(3000);
    const drive_report_t refused = report(3);
    TEST_ASSERT_EQUAL_STRING("refused", refused.phase);
    TEST_ASSERT_EQUAL_HEX32(0x68C201, refused.object);
    TEST_ASSERT_EQUAL_HEX32(0x06090030, refused.detail_code);
    TEST_ASSERT_EQUAL_STRING("waits for the other axes of its node", report(2).phase);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[0].state);
    const unsigned before = requests;
    cycles(2000);
    TEST_ASSERT_EQUAL_UINT(before, requests);
    objects_find(&node[3].drive.od, 0x60C2, 1)->refusal = 0;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
}

static void test_axis_that_never_answers_at_an_object_is_refused_with_it(void)
{
    start();
    objects_find(&node[1].drive.od, 0x6065, 0)->is_silent = true;
    cycles(8000);
    TEST_ASSERT_EQUAL_STRING("refused", report(1).phase);
    TEST_ASSERT_EQUAL_HEX32(0x686500, report(1).object);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_ANSWER, report(1).code);
    objects_find(&node[1].drive.od, 0x6065, 0)->is_silent = false;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 4000);
}

static void test_axis_whose_answers_never_come_is_refused_and_the_node_settles(void)
{
    start();
    node[5].tpdo_drop = 1000000;
    cycles(12000);
    TEST_ASSERT_EQUAL_STRING("refused", report(5).phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_START, report(5).code);
    TEST_ASSERT_EQUAL_STRING("waits for the other axes of its node", report(4).phase);
    const unsigned boots = frames[0x703];
    cycles(3000);
    TEST_ASSERT_TRUE(frames[0x703] - boots <= 3000 / 50 + 2); /* heartbeats alone */
    node[5].tpdo_drop = 0;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 4000);
}

static void test_nodes_and_channels_that_contradict_are_refused(void)
{
    config.axis[1].channel = 0; /* twice */
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&slaves)));
    config.axis[1].channel = 2; /* a gap */
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&slaves)));
    configure();
    config.telemetry = DRIVE_HAS_TORQUE | DRIVE_HAS_LAG | DRIVE_HAS_INPUTS; /* six identifiers of four */
    config.telemetry_every = 1;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&slaves)));
    config.telemetry = DRIVE_HAS_TORQUE | DRIVE_HAS_LAG;
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&slaves)));
    config.answer_every = 2;
    config.axis[3].mode = CIA402_MODE_PP;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&slaves)));
}

static void test_orderly_end_resets_each_node_once(void)
{
    come_up();
    const unsigned before = frames[0];
    cia402_leave(&driver);
    cycles(2);
    TEST_ASSERT_EQUAL_UINT(3, frames[0] - before);
}

/* What has gone meanwhile has forgotten what it was set to: it may not be started as it is when the other one is ready. */
static void test_axis_that_waits_for_its_node_is_watched(void)
{
    for (unsigned is_guarded = 0; is_guarded < 2; is_guarded++) {
        setUp();
        config.is_guarded = is_guarded != 0;
        start();
        objects_find(&node[3].drive.od, 0x60C2, 1)->refusal = 0x06090030;
        cycles(3000);
        TEST_ASSERT_EQUAL_STRING("waits for the other axes of its node", report(2).phase);
        node_power(&node[2], false, now_us);
        unsigned count = 0;
        while (strcmp(report(2).phase, "waits for the other axes of its node") == 0 && count++ < 1000) {
            cycle();
        }
        TEST_ASSERT_TRUE(count <= 151 + 1);
        cycles(500);
        TEST_ASSERT_EQUAL_STRING("missing", report(2).phase);
        is_boot_lost = true; /* nothing but the heartbeats told of it */
        node_power(&node[2], true, now_us);
        cycles(100);
        is_boot_lost = false;
        objects_find(&node[3].drive.od, 0x60C2, 1)->refusal = 0;
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        await(DRIVE_DISABLED, 4000);
        TEST_ASSERT_EQUAL_UINT32(is_guarded != 0 ? 50 : 0, held(2, 0x100C, 0));
        TEST_ASSERT_EQUAL_UINT32(20000, held(2, 0x6065, 0));
        enable();
    }
}

static void alone(void)
{
    for (unsigned k = 0; k < axes; k++) {
        config.axis[k].node = (uint8_t)(k + 1);
        config.axis[k].channel = 0;
    }
}

/* --- Node guarding --- */

static void guard(void)
{
    config.is_guarded = true;
    config.axis[5].node = 4; /* one that has its node to itself */
    config.axis[5].channel = 0;
}

static void take_heartbeats_away(void)
{
    for (unsigned k = 0; k < axes; k++) {
        objects_find(&node[k].drive.od, 0x1017, 0)->is_missing = true;
        objects_find(&node[k].drive.od, 0x1016, 1)->is_missing = true;
    }
}

static void test_drives_without_heartbeats_are_guarded(void)
{
    guard();
    start();
    take_heartbeats_away();
    await(DRIVE_DISABLED, 6000);
    enable();
    TEST_ASSERT_EQUAL_UINT32(50, held(0, 0x100C, 0));
    TEST_ASSERT_EQUAL_UINT32(3, held(0, 0x100D, 0));
    const unsigned before = frames[0x701];
    cycles(1000);
    TEST_ASSERT_UINT_WITHIN(4, 40, frames[0x701] - before); /* a request and an answer in 50 ms */
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

/* PDOs go on: nothing else tells that its NMT side does not live. */
static void test_drive_that_answers_no_guarding_is_lost_in_time(void)
{
    guard();
    come_up();
    enable();
    node[5].has_no_heartbeat = true;
    unsigned count = 0;
    while (feedback[5].state == DRIVE_ENABLED && count++ < 1000) {
        cycle();
    }
    TEST_ASSERT_TRUE(count <= 151 + 1);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_HEARTBEAT, feedback[5].fault_code);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(3000);
    TEST_ASSERT_EQUAL_STRING("refused", report(5).phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_HEARTBEAT, report(5).code);
    node[5].has_no_heartbeat = false;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
}

/* An answer whose bit does not change is an old one. */
static void test_answer_to_guarding_that_is_repeated_counts_for_nothing(void)
{
    guard();
    come_up();
    for (unsigned i = 0; i < 300 && feedback[5].state == DRIVE_DISABLED; i++) {
        node[5].guard_toggle = 0x80;
        cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[5].state);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_HEARTBEAT, feedback[5].fault_code);
}

static void test_guarded_drives_stop_when_nobody_guards_them_any_more(void)
{
    guard();
    come_up();
    enable();
    for (unsigned i = 0; i < 150 + 50 + 10; i++) { /* SYNC and set-points go on */
        driver.axis[5].guard_us = now_us + CYCLE_US;
        cycle();
    }
    TEST_ASSERT_EQUAL_HEX32(TWIN_FAULT, node[5].drive.state);
    TEST_ASSERT_EQUAL_HEX32(TWIN_ENABLED, node[0].drive.state);
}

/* One request goes out in a call of the driver, which is fewer than seven nodes are due for in a cycle of 10 ms. */
static void test_guarding_asks_the_nodes_in_turns(void)
{
    axes = 7;
    cycle_us = 10000;
    configure();
    config.period_us = 10000;
    config.is_guarded = true;
    alone();
    start();
    take_heartbeats_away();
    await(DRIVE_DISABLED, 1500);
    unsigned before[AXES];
    for (unsigned k = 0; k < axes; k++) {
        before[k] = frames[0x701 + k];
    }
    for (unsigned i = 0; i < 700; i++) {
        cycle();
        TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    }
    for (unsigned k = 0; k < axes; k++) { /* a request and an answer, every 70 ms */
        TEST_ASSERT_UINT_WITHIN(4, 200, frames[0x701 + k] - before[k]);
    }
}

static void fix(unsigned axis, uint16_t index, uint32_t value)
{
    object_t *row = objects_find(&node[axis].drive.od, index, 0);
    row->value = row->fallback = value;
    row->is_read_only = true;
}

/* A life time of 150 ms is asked for: twice of it is taken, more is not. */
static void test_guard_time_that_cannot_be_written_is_met_by_the_life_factor(void)
{
    static const struct {
        uint16_t guard_ms;
        uint8_t factor; /* that is written */
        bool is_taken;
    } k_rows[] = {{10, 15, true}, {100, 2, true}, {300, 1, true}, {301, 0, false}, {0, 0, false}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        setUp();
        guard();
        config.is_reset_wanted = false;
        start();
        fix(5, 0x100C, k_rows[i].guard_ms);
        cycles(3000);
        if (k_rows[i].is_taken) {
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[5].state);
            TEST_ASSERT_EQUAL_UINT32(k_rows[i].factor, held(5, 0x100D, 0));
        } else {
            TEST_ASSERT_EQUAL_HEX32(k_rows[i].guard_ms == 0 ? CIA402_UNGUARDED : CIA402_GUARDED_LATE, report(5).code);
            TEST_ASSERT_EQUAL_HEX32(0x100C00, report(5).object);
            TEST_ASSERT_EQUAL_HEX32(k_rows[i].guard_ms, report(5).found);
            TEST_ASSERT_EQUAL_HEX32(50, report(5).wanted);
        }
    }
}

static void test_life_factor_that_is_far_too_large_is_refused(void)
{
    static const uint8_t k_factors[] = {6, 7}; /* times 50 ms */
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        guard();
        config.is_reset_wanted = false;
        start();
        fix(5, 0x100D, k_factors[i]);
        cycles(3000);
        TEST_ASSERT_EQUAL(i == 0 ? DRIVE_DISABLED : DRIVE_OFFLINE, feedback[5].state);
    }
    TEST_ASSERT_EQUAL_HEX32(CIA402_GUARDED_LATE, report(5).code);
    TEST_ASSERT_EQUAL_HEX32(0x100D00, report(5).object);
    TEST_ASSERT_EQUAL_HEX32(7, report(5).found);
    TEST_ASSERT_EQUAL_HEX32(3, report(5).wanted);
}

/* --- Maps --- */

static void test_telemetry_of_both_axes_arrives(void)
{
    config.telemetry = DRIVE_HAS_TORQUE | DRIVE_HAS_INPUTS;
    config.telemetry_every = 2;
    come_up();
    enable();
    node[1].drive.motor.load = 500;
    cycles(40);
    TEST_ASSERT_EQUAL_HEX8(DRIVE_HAS_TORQUE | DRIVE_HAS_INPUTS, report(0).telemetry.has);
    TEST_ASSERT_EQUAL_HEX8(DRIVE_HAS_TORQUE | DRIVE_HAS_INPUTS, report(1).telemetry.has);
    TEST_ASSERT_EQUAL_INT16((int16_t)held(1, 0x6077, 0), report(1).telemetry.torque_permille);
    TEST_ASSERT_TRUE(frames[0x381] > 5 && frames[0x481] > 5);
}

/* One RPDO with both controlwords, one with both targets; answers likewise. */
static void share_pdos(void)
{
    config.commands = (cia402_maps_t){.count = 2, .map = {{1, 2, {0x60400010, 0x68400010}}, {2, 2, {0x607A0020, 0x687A0020}}}};
    config.answers = (cia402_maps_t){
        .count = 2, .map = {{1, 4, {0x60410010, 0x60610008, 0x68410010, 0x68610008}}, {2, 2, {0x60640020, 0x68640020}}}};
}

static void test_pdos_may_be_of_the_whole_node(void)
{
    share_pdos();
    come_up();
    enable();
    const unsigned before[4] = {syncs, frames[0x201], frames[0x301], frames[0x281]};
    follow();
    TEST_ASSERT_UINT_WITHIN(1, syncs - before[0], frames[0x201] - before[1]);
    TEST_ASSERT_UINT_WITHIN(1, syncs - before[0], frames[0x301] - before[2]);
    TEST_ASSERT_UINT_WITHIN(1, syncs - before[0], frames[0x281] - before[3]);
    TEST_ASSERT_EQUAL_UINT(0, frames[0x401] + frames[0x381]);
    node[0].tpdo_drop = 200; /* the first axis sends what both tell */
    cycles(5 * PERIOD);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[1].state);
}

/* Its records beside, of the second axis, are not there. */
static void take_pdos_away(unsigned axis)
{
    objects_t *od = &node[axis].drive.od;
    for (uint32_t i = 0; i < od->count; i++) {
        od->row[i].is_missing |= od->row[i].index >= 0x1400 && od->row[i].index < 0x1C00;
    }
}

static void test_whole_node_needs_no_pdos_of_its_other_axes(void)
{
    share_pdos();
    config.telemetry = DRIVE_HAS_TORQUE;
    config.telemetry_every = 2;
    start();
    for (unsigned k = 1; k < axes; k += 2) {
        take_pdos_away(k);
    }
    await(DRIVE_DISABLED, 6000);
    enable();
    follow();
    node[1].drive.motor.load = 500;
    cycles(40);
    TEST_ASSERT_EQUAL_INT16((int16_t)held(1, 0x6077, 0), report(1).telemetry.torque_permille);
    TEST_ASSERT_TRUE(report(1).telemetry.torque_permille != report(0).telemetry.torque_permille);
    TEST_ASSERT_EQUAL_HEX32(0x68770010, held(0, 0x1A03, 1)); /* the first TPDO that is free behind that of the first axis */
    setUp();
    start(); /* PDOs of each axis: here they are needed */
    take_pdos_away(1);
    cycles(3000);
    TEST_ASSERT_EQUAL_STRING("refused", report(1).phase);
    TEST_ASSERT_EQUAL_HEX32(0x144001, report(1).object);
}

/* All of it in the records of the first axis. */
static void test_whole_node_needs_room_for_the_telemetry_of_its_axes(void)
{
    const char *why = NULL;
    share_pdos();
    config.telemetry = DRIVE_HAS_TORQUE;
    config.telemetry_every = 2;
    config.pdo_step = 4;
    TEST_ASSERT_TRUE(cia402_pdos_fit(&config, &why));
    config.pdo_step = 3;
    TEST_ASSERT_FALSE(cia402_pdos_fit(&config, &why));
    TEST_ASSERT_NOT_NULL(strstr(why, "pdo_step"));
}

/* As CiA 402 has them by default: the mode in the command, positions in TPDO 3, the mode never told. */
static void fix_maps(void)
{
    config.are_maps_fixed = true;
    config.commands = (cia402_maps_t){.count = 2, .map = {{2, 2, {0x60400010, 0x60600008}}, {3, 1, {0x607A0020}}}};
    config.answers = (cia402_maps_t){.count = 2, .map = {{1, 1, {0x60410010}}, {3, 2, {0x60410010, 0x60640020}}}};
}

static void test_fixed_maps_are_compared_and_used(void)
{
    alone();
    fix_maps();
    come_up();
    TEST_ASSERT_TRUE(objects_find(&node[0].drive.od, 0x1600 + 1, 0)->is_read_only);
    enable();
    follow();
}

/* On when the drive comes, which a strict one does not let be mapped. */
static void test_pdos_may_have_any_numbers(void)
{
    alone();
    config.commands = (cia402_maps_t){.count = 2, .map = {{65, 1, {0x60400010}}, {4, 1, {0x607A0020}}}};
    config.answers = (cia402_maps_t){.count = 1, .map = {{129, 3, {0x60410010, 0x60640020, 0x60610008}}}};
    config.telemetry = DRIVE_HAS_TORQUE;
    config.telemetry_every = 2;
    start();
    for (unsigned k = 0; k < axes; k++) { /* the places that they have taken: the last ones that are free */
        objects_put(&node[k].drive.od, 0x1402, 1, 0x200 + k + 1);
        objects_put(&node[k].drive.od, 0x1803, 1, 0x40000180 + k + 1);
    }
    config.is_reset_wanted = false; /* it would switch them off */
    await(DRIVE_DISABLED, 6000);
    enable();
    follow();
    TEST_ASSERT_EQUAL_HEX32(0x201, held(0, 0x1402, 1));
    TEST_ASSERT_EQUAL_HEX32(0x40000181, held(0, 0x1803, 1));
    TEST_ASSERT_EQUAL_HEX8(DRIVE_HAS_TORQUE, report(0).telemetry.has);
    config.commands.map[1].number = 5; /* which the drive has not got: it was not made for it */
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&master)));
    cycles(3000);
    TEST_ASSERT_EQUAL_STRING("refused", report(0).phase);
    TEST_ASSERT_EQUAL_HEX32(0x140401, report(0).object);
}

static void test_fixed_map_that_is_another_is_refused_with_what_it_holds(void)
{
    alone();
    fix_maps();
    start();
    objects_find(&node[2].drive.od, 0x1602, 1)->value = objects_find(&node[2].drive.od, 0x1602, 1)->fallback = 0x60FF0020;
    cycles(3000);
    const drive_report_t refused = report(2);
    TEST_ASSERT_EQUAL_STRING("refused", refused.phase);
    TEST_ASSERT_EQUAL_HEX32(0x160201, refused.object);
    TEST_ASSERT_EQUAL_HEX32(0x60FF0020, refused.found);
    TEST_ASSERT_EQUAL_HEX32(0x607A0020, refused.wanted);
}

/* Each of its two answers is needed: a position that does not come is seen though states do. */
static void test_either_answer_that_stays_away_is_a_loss(void)
{
    alone();
    fix_maps();
    come_up();
    enable();
    objects_put(&node[4].drive.od, 0x1802, 2, 255); /* answers no SYNC any more */
    cycles(5 * PERIOD);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_TPDO, feedback[4].fault_code);
}

static void test_maps_without_what_they_need_do_not_fit(void)
{
    const char *why = NULL;
    alone();
    TEST_ASSERT_TRUE(cia402_pdos_fit(&config, &why));
    fix_maps();
    TEST_ASSERT_TRUE(cia402_pdos_fit(&config, &why));
    config.commands.map[1].entry[0] = 0x60FF0020; /* no target */
    TEST_ASSERT_FALSE(cia402_pdos_fit(&config, &why));
    TEST_ASSERT_NOT_NULL(strstr(why, "607Ah"));
    fix_maps();
    config.answers.map[1].entries = 1; /* no position */
    TEST_ASSERT_FALSE(cia402_pdos_fit(&config, &why));
    TEST_ASSERT_NOT_NULL(strstr(why, "6064h"));
    fix_maps();
    config.commands.map[1].number = 2; /* twice */
    TEST_ASSERT_FALSE(cia402_pdos_fit(&config, &why));
    fix_maps();
    config.commands.map[0].entry[1] = 0x60600004; /* no whole byte */
    TEST_ASSERT_FALSE(cia402_pdos_fit(&config, &why));
    fix_maps();
    config.axis[0].mode = CIA402_MODE_IP; /* which has its target elsewhere */
    TEST_ASSERT_FALSE(cia402_pdos_fit(&config, &why));
    fix_maps();
    config.axis[1].node = 1;
    config.axis[1].channel = 1;
    config.pdo_step = 2; /* the third PDO would be of the second axis */
    TEST_ASSERT_FALSE(cia402_pdos_fit(&config, &why));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_axes_of_a_node_come_up_and_each_follows_its_own_setpoints);
    RUN_TEST(test_axes_may_stand_in_any_order);
    RUN_TEST(test_each_axis_has_its_own_mode_and_homing);
    RUN_TEST(test_axis_that_falls_silent_is_named_and_takes_its_node_along);
    RUN_TEST(test_node_that_starts_again_is_lost_with_all_its_axes);
    RUN_TEST(test_axis_in_fault_leaves_the_other_to_the_gateway_and_is_reset);
    RUN_TEST(test_axis_that_is_refused_names_its_object_and_the_other_waits);
    RUN_TEST(test_axis_that_never_answers_at_an_object_is_refused_with_it);
    RUN_TEST(test_axis_whose_answers_never_come_is_refused_and_the_node_settles);
    RUN_TEST(test_nodes_and_channels_that_contradict_are_refused);
    RUN_TEST(test_orderly_end_resets_each_node_once);
    RUN_TEST(test_axis_that_waits_for_its_node_is_watched);
    RUN_TEST(test_drives_without_heartbeats_are_guarded);
    RUN_TEST(test_guarding_asks_the_nodes_in_turns);
    RUN_TEST(test_drive_that_answers_no_guarding_is_lost_in_time);
    RUN_TEST(test_answer_to_guarding_that_is_repeated_counts_for_nothing);
    RUN_TEST(test_guarded_drives_stop_when_nobody_guards_them_any_more);
    RUN_TEST(test_guard_time_that_cannot_be_written_is_met_by_the_life_factor);
    RUN_TEST(test_life_factor_that_is_far_too_large_is_refused);
    RUN_TEST(test_telemetry_of_both_axes_arrives);
    RUN_TEST(test_pdos_may_be_of_the_whole_node);
    RUN_TEST(test_whole_node_needs_no_pdos_of_its_other_axes);
    RUN_TEST(test_whole_node_needs_room_for_the_telemetry_of_its_axes);
    RUN_TEST(test_fixed_maps_are_compared_and_used);
    RUN_TEST(test_pdos_may_have_any_numbers);
    RUN_TEST(test_fixed_map_that_is_another_is_refused_with_what_it_holds);
    RUN_TEST(test_either_answer_that_stays_away_is_a_loss);
    RUN_TEST(test_maps_without_what_they_need_do_not_fit);
    return UNITY_END();
}

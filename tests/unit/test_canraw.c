/* SPDX-License-Identifier: MIT
 * test_canraw.c - the raw CAN driver byte by byte, against drives that know the bytes alone: set-points, homing, feedback that
 * is lost, a bus that stalls, stop frames, maps that contradict themselves.
 */
#include "heave/canraw.h"

#include <string.h>

#include "canraw_drives.h"
#include "canraw_maps.h"
#include "unity.h"

#define AXES     DRIVES_MAX
#define CYCLE_US 1000u
#define MM(x)    ((q32_t)(x)*Q32_ONE)

static sim_can_bus_t bus;
static sim_can_t node;
static canraw_drives_t slave;
static canraw_map_t map;
static canraw_t driver;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];

static hv_status_t poll_once(void)
{
    now_us += CYCLE_US;
    canraw_drives_step(&slave, now_us);
    return drives_poll(hal, now_us, feedback);
}

static hv_status_t cycle(void)
{
    (void)!poll_once();
    return drives_send(hal, now_us, setpoint_q32);
}

static void cycles(int count)
{
    while (count-- > 0) {
        (void)!cycle();
    }
}

static void follow_actual(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        setpoint_q32[k] = feedback[k].actual_mm_q32;
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

static void await(drive_state_t state, int most)
{
    for (int i = 0; i < most && !are_all(state); i++) {
        (void)!cycle();
        follow_actual();
    }
    TEST_ASSERT_TRUE(are_all(state));
}

static void open_with(const sim_can_fault_t *plan, uint32_t planned, bool is_rich)
{
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    now_us = 1000000;
    sim_can_bus_init(&bus, 0, plan, planned);
    canraw_drives_open(&slave, &bus, is_rich ? canraw_maps_rich() : canraw_maps_plain());
    for (unsigned k = 0; k < AXES; k++) {
        const int mm = 20 + 10 * (int)k;
        canraw_drives_place(&slave, k, is_rich ? CANRAW_DRIVES_RICH_ZERO - mm * 10000 / 3 : mm * 2000);
    }
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, filter, canraw_filters(&map, filter)));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&driver, &map, sim_can_hal(&node)));
    hal = canraw_hal(&driver);
    memset(feedback, 0, sizeof feedback);
    memset(setpoint_q32, 0, sizeof setpoint_q32);
}

static void open_rich(void)
{
    map = canraw_maps_rich();
    open_with(NULL, 0, true);
}

static void open_sealed(void)
{
    map = canraw_maps_sealed();
    open_with(NULL, 0, true);
    slave.map = canraw_maps_sealed();
}

void setUp(void)
{
    map = canraw_maps_plain();
    open_with(NULL, 0, false);
}

void tearDown(void) {}

static void enable(void)
{
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED, 100);
}

/* Frames of a leg in the slave's log that start with these two bytes. */
static unsigned count_frames(unsigned leg, uint8_t first, uint8_t second)
{
    unsigned count = 0;
    for (unsigned i = 0; i < slave.logged; i++) {
        const can_frame_t *frame = &slave.log[i];
        count += frame->id == 0x601 + leg && frame->data[0] == first && frame->data[1] == second;
    }
    return count;
}

/* ---- Drives without an enable frame that say whether they have torque ---- */

/* They wait for a set-point, and nobody waits for them. */
static void test_enable_drives_that_set_points_enable(void)
{
    map = canraw_maps_rich();
    map.command[CANRAW_ENABLE] = (canraw_frame_t){.length = 0};
    open_with(NULL, 0, true);
    slave.map.command[CANRAW_ENABLE].length = 0;
    await(DRIVE_DISABLED, 100);
    cycles(100);
    TEST_ASSERT_EQUAL_UINT32(0, slave.sent[0].setpoints);
    enable();
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(frame_drive_is_enabled(&slave.twin[k]));
        TEST_ASSERT_EQUAL_INT32(0, slave.sent[k].largest_step);
    }
}

/* Theirs is switched by an input of their own. */
static void test_enable_drives_that_are_enabled_by_themselves(void)
{
    map = canraw_maps_rich();
    map.command[CANRAW_ENABLE] = (canraw_frame_t){.length = 0};
    open_with(NULL, 0, true);
    for (unsigned k = 0; k < AXES; k++) {
        if (k != 4) {
            canraw_drives_command(&slave, k, CANRAW_ENABLE);
        }
    }
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    for (unsigned i = 0; i < 100; i++) {
        (void)!cycle();
        follow_actual();
    }
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[3].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLING, feedback[4].state);
    canraw_drives_command(&slave, 4, CANRAW_ENABLE);
    await(DRIVE_ENABLED, 100);
}

/* ---- Counters and check bytes ---- */

static void test_sealed_frames_have_no_gap_and_no_wrong_check_byte(void)
{
    open_sealed(); /* the drives abort at a wrong check byte */
    enable();
    cycles(1000);
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(10);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(slave.sent[k].frames > 900);
        TEST_ASSERT_EQUAL_UINT32(0, slave.sent[k].gaps);
        TEST_ASSERT_EQUAL_UINT32(1, slave.sent[k].stops);
    }
    TEST_ASSERT_EQUAL_UINT32(0, driver.strange);
}

/* A frame that never left is no gap: the drive would take it for a loss. */
static void test_sealed_frame_that_finds_no_room_is_no_gap(void)
{
    for (uint32_t at = 150; at < 150 + 2 * AXES; at++) {
        const sim_can_fault_t plan[] = {{SIM_CAN_FULL, at, 0}};
        map = canraw_maps_sealed();
        open_with(plan, 1, true);
        slave.map = canraw_maps_sealed();
        enable();
        cycles(100);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL_UINT32(0, slave.sent[k].gaps);
        }
    }
}

static void test_reply_with_a_wrong_check_byte_is_not_believed(void)
{
    open_sealed();
    enable();
    const q32_t before_q32 = feedback[2].actual_mm_q32;
    can_frame_t frame = {.id = 0x18FF0202, .is_extended = true, .length = 8, .data = {0x30, 0x01, 0, 0, 0, 0, 0x77}};
    frame.data[7] = (uint8_t)(canraw_drives_crc(frame.data, 7) ^ 0x10);
    const uint32_t strange = driver.strange;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&slave.node), &frame));
    sim_can_bus_step(&bus, now_us);
    (void)!drives_poll(hal, now_us, feedback);
    TEST_ASSERT_EQUAL_INT64(before_q32, feedback[2].actual_mm_q32);
    TEST_ASSERT_EQUAL_UINT32(strange + 1, driver.strange);
}

/* It answers, with what it said last: a controller that hangs behind a bus controller that does not. */
static void test_drive_whose_counter_stands_still_is_lost_and_stays_so(void)
{
    open_sealed();
    enable();
    slave.twin[4].is_stuck = true;
    cycles(2 * ((int)map.offline_periods + 2));
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
    for (unsigned i = 0; i < 200; i++) {
        (void)!cycle();
        TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
    }
    slave.twin[4].is_stuck = false;
    cycles(10);
    TEST_ASSERT_TRUE(feedback[4].state != DRIVE_OFFLINE);
}

/* All counters stand still, or all answers are other ones: the drives are there, so the bus is not lost. Silence is. */
static void test_all_that_answer_strangely_are_no_lost_bus(void)
{
    for (unsigned i = 0; i < 3; i++) {
        hv_status_t status = HV_OK;
        setUp();
        open_sealed();
        enable();
        for (unsigned k = 0; k < AXES; k++) {
            slave.twin[k].is_stuck = i == 0;
            slave.twin[k].is_mute = i == 2;
        }
        map.position_reply.data[0] ^= i == 1 ? 0x10 : 0; /* they send something else than heaved waits for */
        for (unsigned n = 0; n < 4u * ((unsigned)map.offline_periods + 2u); n++) {
            status = cycle();
        }
        TEST_ASSERT_EQUAL(i == 2 ? HV_ERR_IO : HV_OK, status);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[k].state);
        }
    }
}

static void test_fault_of_a_drive_has_the_code_that_it_tells(void)
{
    map = canraw_maps_rich();
    map.position_reply = (canraw_frame_t){6,
                                          0x01,
                                          3,
                                          {0x30},
                                          {{CANRAW_STATUS, 1, 8, false, false, 0, 0, 0},
                                           {CANRAW_FAULT, 2, 8, false, false, 0, 0, 0},
                                           {CANRAW_POSITION, 3, 24, true, true, 0, 0, 0}},
                                          0,
                                          0};
    open_with(NULL, 0, true);
    const can_frame_t bad = {.id = 0x18FF0203, .is_extended = true, .length = 6, .data = {0x30, 0x02, 0x2A, 0xFF, 0xFF, 0xFE}};
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&slave.node), &bad));
    sim_can_bus_step(&bus, now_us);
    (void)!drives_poll(hal, now_us + 1, feedback);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[3].state);
    TEST_ASSERT_EQUAL_HEX32(0x2A, feedback[3].fault_code);
    TEST_ASSERT_INT64_WITHIN(Q32_ONE / 1000, fx_mul_div(4000002, Q32_ONE * 3, 10000), feedback[3].actual_mm_q32); /* -2 counts */
}

/* ---- Bytes ---- */

static void test_frames_of_the_plain_dialect_byte_for_byte(void)
{
    static const uint8_t k_setpoint[8] = {0x01, 0x05, 0x40, 0x9C, 0x00, 0x00, 0xB8, 0x0B}; /* 40000 = 20 mm, 3000 */
    static const uint8_t k_home[8] = {0x01, 0x03, 0x01, 0, 0, 0, 0, 0};
    static const uint8_t k_position[8] = {0x00, 0x15};
    static const uint8_t k_homing[8] = {0x00, 0x12};
    unsigned seen = 0;
    slave.twin[0].is_homed = false;
    enable();
    cycles(10);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    cycles(10);
    for (unsigned i = 0; i < slave.logged; i++) {
        const can_frame_t *frame = &slave.log[i];
        if (frame->id != 0x601) {
            continue;
        }
        TEST_ASSERT_FALSE(frame->is_extended || frame->is_rtr);
        if (frame->length == 2) {
            seen |= frame->data[1] == 0x15 ? 1u : 2u;
            TEST_ASSERT_EQUAL_HEX8_ARRAY(frame->data[1] == 0x15 ? k_position : k_homing, frame->data, 8);
        } else {
            seen |= frame->data[1] == 0x05 ? 4u : 8u;
            TEST_ASSERT_EQUAL_UINT8(8, frame->length);
            TEST_ASSERT_EQUAL_HEX8_ARRAY(frame->data[1] == 0x05 ? k_setpoint : k_home, frame->data, 8);
        }
    }
    TEST_ASSERT_EQUAL_HEX(15, seen);
    TEST_ASSERT_EQUAL_UINT(1, count_frames(0, 0x01, 0x03));
    TEST_ASSERT_EQUAL_UINT(1, count_frames(6, 0x01, 0x03));
}

/* 300 mm are 600000 pulses: C0 27 09 00. */
static void test_setpoint_at_full_stroke_byte_for_byte(void)
{
    static const uint8_t k_full[8] = {0x01, 0x05, 0xC0, 0x27, 0x09, 0x00, 0xB8, 0x0B};
    canraw_drives_place(&slave, 2, 600000);
    enable();
    slave.logged = 0;
    cycles(4);
    for (unsigned i = 0; i < slave.logged; i++) {
        if (slave.log[i].id == 0x603 && slave.log[i].length == 8) {
            TEST_ASSERT_EQUAL_HEX8_ARRAY(k_full, slave.log[i].data, 8);
        }
    }
    TEST_ASSERT_EQUAL_UINT(2, count_frames(2, 0x01, 0x05));
}

static void test_speed_field_is_that_of_the_setpoints(void)
{
    map.speed_least = 7;
    for (unsigned k = 0; k < AXES; k++) {
        map.axis[k].speed = (counts_scale_t){60, 10, 0}; /* rev/min at 10 mm per turn */
    }
    open_with(NULL, 0, false);
    enable();
    for (int i = 0; i < 40; i++) {
        setpoint_q32[0] += MM(1) / 10;  /* per 1 ms: 100 mm/s */
        setpoint_q32[1] -= MM(1) / 100; /* the magnitude counts */
        cycle();
    }
    TEST_ASSERT_EQUAL_UINT16(600, slave.sent[0].speed);
    TEST_ASSERT_EQUAL_UINT16(60, slave.sent[1].speed);
    TEST_ASSERT_EQUAL_UINT16(7, slave.sent[2].speed);
}

static void test_speed_field_with_a_sign_has_the_direction(void)
{
    map.setpoint.field[1].is_signed = true;
    map.speed_least = 7;
    for (unsigned k = 0; k < AXES; k++) {
        map.axis[k].speed = (counts_scale_t){60, 10, 0};
    }
    open_with(NULL, 0, false);
    enable();
    for (int i = 0; i < 40; i++) {
        setpoint_q32[0] += MM(1) / 10;
        setpoint_q32[1] -= MM(1) / 100;
        cycle();
    }
    TEST_ASSERT_EQUAL_INT16(600, (int16_t)slave.sent[0].speed);
    TEST_ASSERT_EQUAL_INT16(-60, (int16_t)slave.sent[1].speed);
    TEST_ASSERT_EQUAL_INT16(7, (int16_t)slave.sent[2].speed);
}

/* Beyond all numbers there and back, with a drive that counts the other way round. */
static void test_speed_that_no_number_tells_is_at_the_end_of_its_field(void)
{
    static const int16_t k_speeds[] = {INT16_MAX, INT16_MIN};
    map.setpoint.field[0].is_signed = map.setpoint.field[1].is_signed = true;
    map.axis[3].scale = (counts_scale_t){1, 1000, 0};
    map.axis[3].speed = (counts_scale_t){INT32_MIN, 1, -1};
    map.axis[3].step_max_q32 = INT64_MAX;
    map.axis[3].following_max_q32 = 0;
    open_with(NULL, 0, false);
    enable();
    setpoint_q32[3] = MM(1 << 30);
    cycles(4);
    for (unsigned i = 0; i < 2; i++) {
        setpoint_q32[3] = -setpoint_q32[3];
        cycles(2);
        canraw_drives_step(&slave, now_us);
        TEST_ASSERT_EQUAL_INT16(k_speeds[i], (int16_t)slave.sent[3].speed);
    }
}

static void test_every_query_every_period_in_turn(void)
{
    map.query_every = 4;
    map.offline_periods = 20;
    open_with(NULL, 0, false);
    cycles(200);
    slave.logged = 0;
    cycles(80); /* 40 periods */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT(10, count_frames(k, 0x00, 0x15));
    }
}

/* ---- Sets and periods ---- */

static void test_setpoints_go_out_once_per_period_and_only_while_enabled(void)
{
    await(DRIVE_DISABLED, 100);
    cycles(50);
    TEST_ASSERT_EQUAL_UINT32(0, slave.sent[0].setpoints);
    enable();
    const uint32_t before = slave.sent[3].setpoints;
    cycles(100);
    TEST_ASSERT_EQUAL_UINT32(50, slave.sent[3].setpoints - before);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    cycle();
    const uint32_t after = slave.sent[3].setpoints;
    cycles(100);
    TEST_ASSERT_EQUAL_UINT32(after, slave.sent[3].setpoints);
}

static void test_on_change_sends_nothing_twice(void)
{
    map.is_on_change = true;
    open_with(NULL, 0, false);
    enable();
    cycles(4);
    const uint32_t before = slave.sent[0].setpoints;
    cycles(100);
    TEST_ASSERT_EQUAL_UINT32(before, slave.sent[0].setpoints);
    setpoint_q32[0] += MM(1) / 2000;
    cycles(3);
    TEST_ASSERT_EQUAL_UINT32(before + 1, slave.sent[0].setpoints);
    TEST_ASSERT_EQUAL_INT32(40001, slave.sent[0].target);
}

/* A frame that hangs on the wire: the next set waits for it, and no set is ever queued behind another. */
static void test_gate_the_next_set_waits_for_the_last(void)
{
    const sim_can_fault_t plan[] = {{SIM_CAN_DELAY, 300, 3500}};
    open_with(plan, 1, false);
    enable();
    unsigned waits = 0;
    for (int i = 0; i < 200; i++) {
        const hv_status_t status = cycle();
        waits += status == HV_ERR_AGAIN;
        TEST_ASSERT_TRUE(status == HV_OK || status == HV_ERR_AGAIN);
        TEST_ASSERT_TRUE(node.tx_count <= 2 * AXES);
        for (unsigned k = 0; status == HV_OK && k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 10; /* as the gateway does: motion waits */
        }
    }
    TEST_ASSERT_TRUE(waits > 0 && driver.refused == waits);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(slave.sent[k].largest_step <= 2 * 200 + 1);
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

/* A full queue in the middle of a set: offered again as a whole, one step late. */
static void test_queue_full_at_every_frame_of_a_set_makes_no_larger_step(void)
{
    for (uint32_t at = 150; at < 150 + 2 * AXES; at++) {
        const sim_can_fault_t plan[] = {{SIM_CAN_FULL, at, 0}};
        open_with(plan, 1, false);
        enable();
        for (int i = 0; i < 100; i++) {
            const q32_t step_q32 = cycle() == HV_OK ? MM(1) / 10 : 0;
            for (unsigned k = 0; k < AXES; k++) {
                setpoint_q32[k] += step_q32;
            }
        }
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(slave.sent[k].largest_step <= 2 * 200 + 1);
        }
    }
}

static void test_bus_without_partner_is_gone_after_three_periods_and_returns(void)
{
    enable();
    sim_can_close(&slave.node);
    int polls = 0;
    hv_status_t status = HV_OK;
    for (; polls < 100 && status == HV_OK; polls++) {
        now_us += CYCLE_US;
        sim_can_bus_step(&bus, now_us);
        status = drives_poll(hal, now_us, feedback);
        (void)!drives_send(hal, now_us, setpoint_q32);
    }
    TEST_ASSERT_EQUAL(HV_ERR_IO, status);
    TEST_ASSERT_TRUE(polls <= 2 + 4 * 2);
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_send(hal, now_us, setpoint_q32));
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(hal, DRIVES_QUICK_STOP));
    TEST_ASSERT_TRUE(driver.restarts > 0);
    const uint32_t setpoints = slave.sent[0].setpoints;
    const bool was_homed = slave.twin[0].is_homed;
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&slave.node, &bus, NULL, 0));
    await(DRIVE_DISABLED, 2000);
    TEST_ASSERT_EQUAL_UINT32(setpoints, slave.sent[0].setpoints); /* no stale set-point */
    TEST_ASSERT_TRUE(was_homed && slave.twin[0].is_homed);
    enable();
}

static void test_bus_off_unplugged_and_restarted_lose_every_drive(void)
{
    for (int i = 0; i < 3; i++) {
        open_with(NULL, 0, false);
        enable();
        if (i == 0) {
            sim_can_set_state(&node, HAL_CAN_BUS_OFF);
        } else if (i == 1) {
            sim_can_unplug(&node);
        } else {
            sim_can_set_state(&node, HAL_CAN_BUS_OFF);
            sim_can_set_state(&node, HAL_CAN_ACTIVE); /* reported as a restart */
        }
        (void)!poll_once();
        TEST_ASSERT_TRUE(i == 2 ? !are_all(DRIVE_ENABLED) : are_all(DRIVE_OFFLINE));
        sim_can_plug(&node);
        await(DRIVE_DISABLED, 2000);
        enable();
    }
}

static hal_can_state_t told_state;
static hv_status_t told_status;

static hv_status_t tell_state(void *ctx, hal_can_state_t *out)
{
    (void)ctx;
    *out = told_state;
    return told_status;
}

/* Whatever else works: a controller that is not on the bus carries nothing. */
static void test_bus_whose_controller_is_not_on_it_is_gone_at_once(void)
{
    static const struct {
        hal_can_state_t state;
        hv_status_t status;
        hv_status_t expected;
    } k_rows[] = {{HAL_CAN_ACTIVE, HV_OK, HV_OK},   {HAL_CAN_PASSIVE, HV_OK, HV_OK},  {HAL_CAN_BUS_OFF, HV_OK, HV_ERR_IO},
                  {HAL_CAN_DOWN, HV_OK, HV_ERR_IO}, {HAL_CAN_GONE, HV_OK, HV_ERR_IO}, {HAL_CAN_ACTIVE, HV_ERR_IO, HV_ERR_IO}};
    hal_can_ops_t telling = *sim_can_hal(&node).ops;
    telling.bus_state = tell_state;
    for (size_t i = 0; i < 6; i++) {
        setUp();
        await(DRIVE_DISABLED, 100);
        driver.can.ops = &telling;
        told_state = k_rows[i].state;
        told_status = k_rows[i].status;
        TEST_ASSERT_EQUAL(k_rows[i].expected, poll_once());
        TEST_ASSERT_TRUE(are_all(k_rows[i].expected == HV_OK ? DRIVE_DISABLED : DRIVE_OFFLINE));
    }
}

static void test_bus_without_echoes_is_trusted(void)
{
    hal_can_ops_t blind = *sim_can_hal(&node).ops;
    blind.unconfirmed = NULL;
    driver.can.ops = &blind;
    enable();
    const uint32_t before = slave.sent[3].setpoints;
    cycles(100);
    TEST_ASSERT_EQUAL_UINT32(50, slave.sent[3].setpoints - before);
    driver.can.ops = sim_can_hal(&node).ops;
}

/* It cannot be told anything, so it is not there. */
static void test_drive_that_is_heard_while_the_bus_is_gone_stays_offline(void)
{
    hal_can_ops_t deaf = *sim_can_hal(&node).ops;
    deaf.bus_state = tell_state;
    told_state = HAL_CAN_BUS_OFF;
    told_status = HV_OK;
    await(DRIVE_DISABLED, 100);
    driver.can.ops = &deaf;
    for (int i = 0; i < 10; i++) {
        const can_frame_t told = {.id = 0x581, .length = 6, .data = {0x00, 0x15}};
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&slave.node), &told));
        driver.axis[0].asked = CANRAW_ASKED_POSITION;
        TEST_ASSERT_EQUAL(HV_ERR_IO, poll_once());
        TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    }
    driver.can.ops = sim_can_hal(&node).ops;
    await(DRIVE_DISABLED, 2000);
}

static hv_status_t take_nothing(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    (void)frame;
    return HV_ERR_AGAIN;
}

/* Somebody else's frames fill the queue: nothing of ours waits for an echo. */
static void test_bus_whose_queue_stays_full_is_gone_after_three_periods(void)
{
    const unsigned period = map.period_us / CYCLE_US;
    enable();
    hal_can_ops_t full = *sim_can_hal(&node).ops;
    full.send = take_nothing;
    driver.can.ops = &full;
    unsigned count = 0;
    while (!are_all(DRIVE_OFFLINE) && count++ < 100) {
        (void)!cycle();
    }
    TEST_ASSERT_UINT_WITHIN(period / 2, 3 * period + period / 2, count);
    driver.can.ops = sim_can_hal(&node).ops;
    await(DRIVE_DISABLED, 2000);
}

/* ---- Disturbed frames ---- */

static void test_error_passive_is_failing_after_its_time_and_stops_nothing_here(void)
{
    map.passive_stop_ms = 1000;
    open_with(NULL, 0, false);
    enable();
    sim_can_set_state(&node, HAL_CAN_PASSIVE);
    cycles(1000);
    TEST_ASSERT_FALSE(drives_is_failing(hal));
    cycles(1);
    TEST_ASSERT_TRUE(drives_is_failing(hal));
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    sim_can_set_state(&node, HAL_CAN_ACTIVE);
    cycles(1);
    TEST_ASSERT_FALSE(drives_is_failing(hal));
}

static unsigned received;

/* A controller that has a report at any time. */
static hv_status_t flood(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    (void)ctx;
    received++;
    *out = (can_frame_t){.id = CAN_ERROR_OTHER, .is_error = true};
    *rx_time_us = now_us;
    return HV_OK;
}

static void test_storm_of_error_frames_is_bounded_and_stops_nothing(void)
{
    hal_can_ops_t endless = *sim_can_hal(&node).ops;
    endless.recv = flood;
    enable();
    for (unsigned i = 0; i < 1000; i++) {
        for (unsigned k = 0; k < 20; k++) {
            sim_can_report(&node, CAN_ERROR_OTHER);
        }
        (void)!cycle();
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    }
    driver.can.ops = &endless;
    cycles(1);
    TEST_ASSERT_EQUAL_UINT(1024, received);
}

static const hal_can_ops_t *s_behind;
static unsigned s_burst;

static hv_status_t burst_first(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    s_burst -= s_burst > 0 ? 1 : 0;
    return s_burst > 0 ? flood(ctx, out, rx_time_us) : s_behind->recv(ctx, out, rx_time_us);
}

/* What came while the gateway could not run: the echoes of its frames wait behind it, at any moment of a period. */
static void test_burst_of_error_frames_is_not_taken_for_a_bus_that_is_gone(void)
{
    s_behind = sim_can_hal(&node).ops;
    hal_can_ops_t storm = *s_behind;
    storm.recv = burst_first;
    enable();
    driver.can.ops = &storm;
    for (unsigned phase = 0; phase < 6; phase++) {
        s_burst = 1700;
        for (unsigned i = 0; i < 20 + phase; i++) {
            (void)!cycle();
            TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        }
    }
}

static void say(uint32_t id, bool is_extended, uint8_t length, const uint8_t *data)
{
    can_frame_t frame = {.id = id, .is_extended = is_extended, .length = length};
    memcpy(frame.data, data, length);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&slave.node), &frame));
}

/* On a backend without filters: other identifiers, other widths and remote requests mean nothing; what comes on a reply_id and is
 * no reply is counted. */
static void test_frames_that_are_no_replies_change_nothing(void)
{
    static const uint8_t k_far[8] = {0x30, 0x01, 0, 0, 0, 0};
    open_rich();
    node.filters = 0;
    await(DRIVE_DISABLED, 100);
    const q32_t actual_q32 = feedback[2].actual_mm_q32;
    for (unsigned i = 0; i < 20; i++) {
        say(0x18FF0300, true, 6, k_far);
        say(0x202, false, 6, k_far);
        TEST_ASSERT_EQUAL(HV_OK,
                          hal_can_send(sim_can_hal(&slave.node),
                                       &(can_frame_t){.id = 0x18FF0202, .is_extended = true, .is_rtr = true, .length = 6}));
        cycles(1);
    }
    TEST_ASSERT_EQUAL_UINT32(0, driver.strange);
    say(0x18FF0202, true, 5, k_far); /* too short */
    say(0x18FF0202, true, 6, (const uint8_t[6]){0x31});
    cycles(1);
    TEST_ASSERT_EQUAL_UINT32(2, driver.strange);
    TEST_ASSERT_EQUAL_INT64(actual_q32, feedback[2].actual_mm_q32);
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    setUp();
    node.filters = 0;
    slave.twin[2].is_mute = true;
    for (unsigned i = 0; i < 20; i++) {
        say(0x583, true, 6, k_far);
        cycles(1);
    }
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[2].state);
    TEST_ASSERT_EQUAL_UINT32(0, driver.strange);
}

/* A position that has no place in millimetres is none: the drive is not there. */
static void test_position_beyond_all_millimetres_is_not_taken(void)
{
    map.axis[4].scale = (counts_scale_t){1, 1, 0};
    open_with(NULL, 0, false);
    canraw_drives_place(&slave, 4, INT32_MAX);
    cycles(50);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
    TEST_ASSERT_FALSE(feedback[4].has_actual);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[3].state);
    TEST_ASSERT_TRUE(driver.strange > 0);
}

/* ---- Feedback ---- */

static void test_silent_drive_is_offline_after_its_periods_and_gets_nothing_more(void)
{
    enable();
    slave.twin[4].is_mute = true;
    int silent = 0;
    while (feedback[4].state == DRIVE_ENABLED && silent < 1000) {
        (void)!cycle();
        silent++;
    }
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
    TEST_ASSERT_TRUE(silent >= 5 * 2 - 2 && silent <= 5 * 2 + 2);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[3].state);
    const uint32_t setpoints = slave.sent[4].setpoints;
    cycles(20);
    TEST_ASSERT_EQUAL_UINT32(setpoints, slave.sent[4].setpoints);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    slave.twin[4].is_mute = false;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[4].state);
    TEST_ASSERT_TRUE(feedback[4].is_homed);
}

/* Lost frames, one at every place: no axis leaves ENABLED, no step is larger than it should be. */
static void test_one_lost_frame_anywhere_is_survived(void)
{
    for (uint32_t at = 130; at < 190; at++) {
        const sim_can_fault_t plan[] = {{SIM_CAN_DROP, at, 0}};
        open_with(plan, 1, false);
        enable();
        for (int i = 0; i < 60; i++) {
            TEST_ASSERT_EQUAL(HV_OK, cycle());
            TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
            for (unsigned k = 0; k < AXES; k++) {
                setpoint_q32[k] += MM(1) / 20;
            }
        }
    }
}

static void test_following_error_stops_that_axis_and_it_hears_nothing_more(void)
{
    enable();
    cycles(4);
    const uint32_t setpoints = slave.sent[1].setpoints;
    setpoint_q32[1] += MM(1) + 1;
    cycles(3);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_FAULT_FOLLOWING, feedback[1].fault_code);
    TEST_ASSERT_TRUE(feedback[1].guard.jump_q32 > 0);
    TEST_ASSERT_EQUAL_INT64(MM(1) + 1, feedback[1].guard.jump_q32);
    TEST_ASSERT_EQUAL_INT64(MM(1), feedback[1].guard.allowed_q32);
    TEST_ASSERT_TRUE(slave.sent[1].setpoints <= setpoints + 1);
    TEST_ASSERT_EQUAL_INT32(60000, slave.sent[1].target);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    (void)!cycle();
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    follow_actual();
    enable();
}

/* Below the field's first number, or beyond all counts: a fault, and no frame. */
static void test_setpoint_that_no_frame_can_carry_is_a_fault_and_is_not_sent(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        map.axis[1].step_max_q32 = INT64_MAX;
        map.axis[1].following_max_q32 = 0;
        map.axis[1].scale = i == 0 ? (counts_scale_t){2000, 1, 0} : (counts_scale_t){INT32_MIN, 1, 0};
        open_with(NULL, 0, false);
        canraw_drives_place(&slave, 1, 0);
        enable();
        cycles(4);
        const uint32_t setpoints = slave.sent[1].setpoints;
        setpoint_q32[1] = i == 0 ? -MM(1) : INT64_MIN;
        cycles(4);
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
        TEST_ASSERT_EQUAL_HEX32(CANRAW_FAULT_FOLLOWING, feedback[1].fault_code);
        TEST_ASSERT_TRUE(feedback[1].guard.jump_q32 > 0);
        TEST_ASSERT_TRUE(slave.sent[1].setpoints <= setpoints + 1);
        TEST_ASSERT_EQUAL_INT32(0, slave.sent[1].target);
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
    }
}

/* A drive that does not move while its set-points do. */
static void test_lag_beyond_the_window_is_a_following_error(void)
{
    enable();
    slave.motor[2].is_jammed = true;
    int steps = 0;
    while (feedback[2].state == DRIVE_ENABLED && steps < 1000) {
        setpoint_q32[2] += MM(1) / 10;
        (void)!cycle();
        steps++;
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_TRUE(steps > 95 && steps < 110);
}

static void test_lag_that_is_not_watched_is_no_fault(void)
{
    map.axis[2].following_max_q32 = 0;
    open_with(NULL, 0, false);
    enable();
    slave.motor[2].is_jammed = true;
    for (int i = 0; i < 300; i++) {
        setpoint_q32[2] += MM(1) / 10;
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

/* ---- Homing ---- */

static void test_homing_ends_when_the_drive_says_so_and_the_new_position_is_known(void)
{
    slave.twin[5].is_homed = false;
    enable();
    TEST_ASSERT_FALSE(feedback[5].is_homed);
    TEST_ASSERT_TRUE(feedback[4].is_homed);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    const uint32_t setpoints = slave.sent[5].setpoints;
    while (slave.twin[5].state == FRAME_DRIVE_HOMING || frame_drive_count(&slave.twin[5]) != 0) {
        TEST_ASSERT_EQUAL(HV_OK, cycle());
        TEST_ASSERT_EQUAL(DRIVE_HOMING, feedback[5].state);
    }
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(slave.sent[k].setpoints <= setpoints + 1);
    }
    await(DRIVE_ENABLED, 50);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(feedback[k].is_homed);
        TEST_ASSERT_EQUAL_INT64(0, feedback[k].actual_mm_q32);
        TEST_ASSERT_EQUAL_UINT(1, count_frames(k, 0x01, 0x03));
    }
}

/* A drive that still reports the last homing as done at first. */
static void test_homing_done_of_the_last_time_is_not_believed(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        slave.sent[k].homing_takes_us = 400000;
    }
    slave.homing_stale_us = 100000;
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    for (int i = 0; i < 400; i++) {
        TEST_ASSERT_EQUAL(HV_OK, cycle());
        TEST_ASSERT_TRUE(are_all(DRIVE_HOMING));
        TEST_ASSERT_EQUAL_UINT32(slave.sent[0].setpoints, slave.sent[1].setpoints);
    }
    follow_actual();
    await(DRIVE_ENABLED, 1000);
}

/* A drive that is at its zero already never says "not done": believed after half a second. */
static void test_homing_done_from_the_start_is_believed_after_a_while(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        canraw_drives_place(&slave, k, 0);
    }
    enable();
    const uint64_t begin_us = now_us;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    cycles(1);
    TEST_ASSERT_TRUE(are_all(DRIVE_HOMING));
    await(DRIVE_ENABLED, 1000);
    TEST_ASSERT_TRUE(now_us - begin_us >= 500000 && now_us - begin_us < 520000);
}

/* A status in the positions says nothing of homing where there is a query for that. */
static void test_homing_is_judged_by_its_own_query_where_there_is_one(void)
{
    map.position_reply.fields = 2;
    map.position_reply.field[1] = (canraw_field_t){CANRAW_STATUS, 1, 8, false, false, 0, 0, 0}; /* 15h, always: done would be 1 */
    open_with(NULL, 0, false);
    enable();
    TEST_ASSERT_TRUE(feedback[0].is_homed);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    cycles(1);
    TEST_ASSERT_TRUE(are_all(DRIVE_HOMING) && !feedback[0].is_homed);
    await(DRIVE_ENABLED, 200);
    TEST_ASSERT_TRUE(feedback[0].is_homed);
}

static void test_homing_failed_is_a_fault(void)
{
    map.homing_failed = (canraw_when_t){0x00, 0xFF};
    open_with(NULL, 0, false);
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    cycles(20);
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_EQUAL_HEX32(CANRAW_FAULT_HOMING, feedback[0].fault_code);
}

static void test_homing_that_never_ends_can_be_stopped(void)
{
    open_rich();
    enable();
    slave.sent[0].homing_takes_us = UINT32_MAX;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    for (int i = 0; i < 500; i++) {
        (void)!cycle();
        follow_actual();
    }
    TEST_ASSERT_EQUAL(DRIVE_HOMING, feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[1].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(3);
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    TEST_ASSERT_TRUE(slave.twin[0].state != FRAME_DRIVE_HOMING);
}

/* A map without a homing frame: the zero is where the drive has it, "homing" just passes. */
static void test_homing_without_a_frame_is_homed_from_the_start(void)
{
    memset(&map.command[CANRAW_HOME], 0, sizeof map.command[0]);
    open_with(NULL, 0, false);
    enable();
    TEST_ASSERT_TRUE(feedback[0].is_homed);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    await(DRIVE_ENABLED, 50);
    TEST_ASSERT_TRUE(feedback[0].is_homed);
    TEST_ASSERT_EQUAL_UINT(0, count_frames(0, 0x01, 0x03));
}

/* ---- Drives that report more ---- */

static void test_rich_setpoints_stand_on_actual_before_enabling(void)
{
    open_rich();
    await(DRIVE_DISABLED, 100);
    for (unsigned k = 0; k < AXES; k++) {
        slave.sent[k].has_target = true;
        slave.sent[k].target = 0; /* left over from before */
    }
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(frame_drive_is_enabled(&slave.twin[k]));
        TEST_ASSERT_TRUE(slave.sent[k].largest_step <= 1);
    }
}

static void test_rich_quick_stop_reaches_the_drives_without_another_send(void)
{
    open_rich();
    enable();
    cycles(4);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    canraw_drives_step(&slave, now_us + CYCLE_US);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, slave.sent[k].stops);
        TEST_ASSERT_FALSE(frame_drive_is_enabled(&slave.twin[k]));
    }
}

static void test_rich_drive_that_drops_out_is_seen(void)
{
    open_rich();
    enable();
    frame_drive_drop(&slave.twin[6]);
    cycles(6);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[6].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[5].state);
}

static void test_rich_homing_does_not_end_without_torque(void)
{
    open_rich();
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    frame_drive_drop(&slave.twin[6]);
    for (int i = 0; i < 100; i++) {
        (void)!cycle();
        follow_actual();
    }
    TEST_ASSERT_TRUE(slave.twin[6].is_homed);
    TEST_ASSERT_EQUAL(DRIVE_HOMING, feedback[6].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[5].state);
    canraw_drives_command(&slave, 6, CANRAW_ENABLE);
    await(DRIVE_ENABLED, 6);
}

static void test_rich_fault_that_stays_outlives_its_reset(void)
{
    open_rich();
    enable();
    frame_drive_fault(&slave.twin[0], 1);
    cycles(6);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state);
    TEST_ASSERT_EQUAL_HEX32(0x07, feedback[0].fault_code);
    slave.twin[0].is_mute = true; /* says nothing about its reset */
    map.offline_periods = 5000;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(1500);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state);
    slave.twin[0].is_mute = false;
    cycles(10);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state); /* too late: ask again */
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(10);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[0].state);
}

/* Where the map knows nothing of a drive's state, it is what it was asked to be. */
static void test_rich_status_that_the_map_does_not_judge_means_nothing(void)
{
    map = canraw_maps_rich();
    map.enabled_when.mask = map.fault_when.mask = 0;
    memset(&map.command[CANRAW_HOME], 0, sizeof map.command[0]);
    open_with(NULL, 0, true);
    slave.twin[6].is_homed = false;
    enable();
    TEST_ASSERT_TRUE(feedback[6].is_homed);
    frame_drive_drop(&slave.twin[5]);
    frame_drive_fault(&slave.twin[6], 1);
    cycles(20);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    setpoint_q32[6] += MM(2); /* found here: a reset ends it with the quick stop, as the drive says nothing */
    cycles(4);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[6].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(100);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[6].state);
    cycles(300);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[6].state);
}

/* A code is never 0, as that would be no fault. */
static void test_rich_fault_whose_status_is_nothing_has_a_code(void)
{
    map = canraw_maps_rich();
    map.fault_when = (canraw_when_t){0x00, 0xFF};
    open_with(NULL, 0, true);
    slave.twin[2].is_homed = false;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(1, feedback[2].fault_code);
}

/* What a drive says before its reset has gone out is of before. */
static void test_rich_reset_that_has_not_gone_out_ends_no_fault(void)
{
    hal_can_ops_t full = *sim_can_hal(&node).ops;
    full.send = take_nothing;
    open_rich();
    enable();
    frame_drive_fault(&slave.twin[0], 1);
    cycles(6);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state);
    driver.can.ops = &full;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    say(0x18FF0200, true, 6, (const uint8_t[6]){0x30, 0x04, 0, 0x3D, 0x09, 0});
    (void)!poll_once();
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state);
    driver.can.ops = sim_can_hal(&node).ops;
    cycles(10);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[0].state);
}

/* It may hear what it does not answer. It is DISABLED when it comes back. */
static void test_rich_quick_stop_with_a_drive_that_is_gone(void)
{
    open_rich();
    enable();
    slave.twin[4].is_mute = true;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(4);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(slave.sent[k].stops >= 1);
    }
    slave.twin[4].is_mute = false;
    cycles(10);
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
}

static unsigned with_torque(void)
{
    unsigned count = 0;
    for (unsigned k = 0; k < AXES; k++) {
        count += frame_drive_is_enabled(&slave.twin[k]);
    }
    return count;
}

/* Drives that keep their torque after a stop and go on for so long, enabled. */
static void enable_gliding(uint32_t for_us)
{
    open_rich();
    slave.is_holding_on_stop = true;
    slave.glide_takes_us = for_us;
    enable();
    cycles(50);
    TEST_ASSERT_EQUAL_UINT(AXES, with_torque());
}

/* Whenever it falls silent: before the stop, in it, or where it would have been told to lose its torque. */
static void test_stop_goes_on_for_a_drive_that_falls_silent(void)
{
    static const int k_before[] = {-30, 0, 20, 150, 245};
    for (unsigned i = 0; i < sizeof k_before / sizeof k_before[0]; i++) {
        enable_gliding(0);
        slave.twin[4].is_mute = k_before[i] < 0;
        cycles(k_before[i] < 0 ? -k_before[i] : 0);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        cycles(k_before[i] > 0 ? k_before[i] : 0);
        slave.twin[4].is_mute = true;
        cycles(5200);
        TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
        TEST_ASSERT_TRUE(feedback[4].is_energized); /* nobody has heard otherwise */
        TEST_ASSERT_EQUAL_UINT(0, with_torque());
    }
}

/* All at once, on a bus that works: that is as good as lost for the gateway, and the driver itself tells them. */
static void test_stop_of_drives_that_all_fall_silent(void)
{
    enable_gliding(0);
    for (unsigned k = 0; k < AXES; k++) {
        slave.twin[k].is_mute = true;
    }
    for (int i = 0; i < 5300; i++) {
        (void)!cycle();
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    TEST_ASSERT_EQUAL_UINT(0, with_torque());
}

/* A bus that is restarted loses all drives for a moment, in the midst of their stop or before it: their torque stays on until
 * they stand still. */
static void test_stop_is_not_cut_short_by_a_bus_that_restarts(void)
{
    for (int is_stopping = 0; is_stopping < 2; is_stopping++) {
        enable_gliding(400000);
        if (is_stopping == 1) {
            TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        }
        cycles(20);
        sim_can_set_state(&node, HAL_CAN_BUS_OFF);
        for (int i = 0; i < 300; i++) {
            (void)!cycle();
            TEST_ASSERT_EQUAL_UINT(AXES, with_torque());
        }
        for (int i = 0; i < 1500 && with_torque() > 0; i++) {
            (void)!cycle();
        }
        TEST_ASSERT_EQUAL_UINT(0, with_torque());
        cycles(20);
        TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    }
}

/* Where the bus has not taken it yet, neither torque on nor torque off takes its place. */
static void test_stop_that_waits_is_replaced_by_nothing(void)
{
    for (int has_disable = 0; has_disable < 2; has_disable++) {
        hal_can_ops_t full = *sim_can_hal(&node).ops;
        full.send = take_nothing;
        enable_gliding(0);
        map.command[CANRAW_DISABLE].length = has_disable == 1 ? map.command[CANRAW_DISABLE].length : 0;
        driver.can.ops = &full;
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
        TEST_ASSERT_EQUAL(HV_ERR_AGAIN, drives_request(hal, DRIVES_ENABLE));
        TEST_ASSERT_TRUE(drives_is_stopping(hal));
        driver.can.ops = sim_can_hal(&node).ops;
        cycles(4);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL_UINT32(1, slave.sent[k].stops);
        }
    }
}

/* Nobody counts on it any more, and another fault is not the one that it was for. */
static void test_reset_that_has_waited_for_long_is_given_up(void)
{
    for (int is_new_fault = 0; is_new_fault < 2; is_new_fault++) {
        enable_gliding(is_new_fault == 1 ? 400000 : 4000000);
        setpoint_q32[6] += MM(2);
        cycles(4);
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[6].state);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        cycles(100);
        if (is_new_fault == 1) {
            frame_drive_fault(&slave.twin[5], 1);
        }
        cycles(5500);
        TEST_ASSERT_EQUAL_UINT(0, with_torque());
        TEST_ASSERT_EQUAL(is_new_fault == 1 ? DRIVE_DISABLED : DRIVE_FAULT, feedback[6].state);
        TEST_ASSERT_EQUAL(is_new_fault == 1 ? DRIVE_FAULT : DRIVE_DISABLED, feedback[5].state);
    }
}

static void test_rich_enable_again_is_for_those_that_are_not(void)
{
    open_rich();
    enable();
    frame_drive_drop(&slave.twin[6]);
    cycles(6);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[6].state);
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    (void)!poll_once();
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[5].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLING, feedback[6].state);
    await(DRIVE_ENABLED, 20);
}

/* ---- Drives that are not asked ---- */

static void test_positions_that_come_unasked(void)
{
    map.position_query = (canraw_frame_t){0};
    map.position_reply.constant = map.homing_reply.constant = 0x03;
    map.position_reply.data[1] = 0x15;
    map.homing_reply.data[1] = 0x12;
    open_with(NULL, 0, false);
    slave.twin[3].is_homed = false;
    for (int i = 0; i < 100; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            say(0x581 + k, false, 6, (const uint8_t[6]){0x00, 0x15, 0x40, 0x9C});
        }
        cycles(1);
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    TEST_ASSERT_EQUAL_INT64(MM(20), feedback[0].actual_mm_q32);
    TEST_ASSERT_FALSE(feedback[3].is_homed); /* asked again and again */
    TEST_ASSERT_TRUE(feedback[2].is_homed);  /* once is enough */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT(0, count_frames(k, 0x00, 0x15));
    }
    TEST_ASSERT_TRUE(count_frames(3, 0x00, 0x12) > 40 && count_frames(2, 0x00, 0x12) < 5);
}

/* ---- Replies that look alike ---- */

static void test_ambiguous_late_answers_are_not_taken_for_another(void)
{
    const uint8_t one_count[8] = {0x00, 0x15, 0x01, 0x00, 0x00, 0x00}; /* a position whose first byte reads as homed */
    slave.twin[0].is_homed = false;
    slave.twin[0].is_mute = true;
    for (int i = 0; i < 400; i++) {
        (void)!cycle();
        if (i % 3 == 0) { /* late by more than a period, any phase */
            can_frame_t late = {.id = 0x581, .length = 6};
            memcpy(late.data, one_count, 8);
            if (driver.axis[0].asked == CANRAW_ASKED_NOTHING) {
                TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&slave.node), &late));
            }
        }
        TEST_ASSERT_FALSE(feedback[0].is_homed);
    }
    TEST_ASSERT_TRUE(driver.strange > 0);
}

/* ---- Maps ---- */

static void test_init_map_that_contradicts_itself_is_refused(void)
{
    const canraw_map_t good = canraw_maps_plain();
    for (int i = 0; i < 38; i++) {
        map = good;
        switch (i) {
        case 0:
            map.axes = 0;
            break;
        case 1:
            map.axes = DRIVES_MAX + 1;
            break;
        case 2:
            map.period_us = 0;
            break;
        case 3:
            map.query_every = 0;
            break;
        case 4:
            map.query_every = 1001;
            break;
        case 5:
            map.offline_periods = 2;
            break;
        case 6:
            map.axis[3].command_id = map.axis[2].command_id;
            break;
        case 7:
            map.axis[3].reply_id = map.axis[2].reply_id;
            break;
        case 8:
            map.axis[3].reply_id = map.axis[5].command_id;
            break;
        case 9:
            map.axis[3].command_id = 0x800;
            break;
        case 10:
            map.axis[1].scale.num = 0;
            break;
        case 11:
            map.axis[1].scale.den = 0;
            break;
        case 12:
            map.axis[1].step_max_q32 = 0;
            break;
        case 13:
            map.axis[1].following_max_q32 = -1;
            break;
        case 14:
            map.setpoint.length = 9;
            break;
        case 15:
            map.setpoint.field[1].at = 5;
            break;
        case 16:
            map.setpoint.field[0].bits = 24;
            break;
        case 17:
            map.setpoint.length = 7;
            break;
        case 18:
            map.setpoint.constant = 0x01;
            break;
        case 19:
            map.setpoint.fields = 0;
            break;
        case 20:
            map.position_reply.fields = 0;
            break;
        case 21:
            map.homing_done.mask = 0;
            break;
        case 22:
            map.fault_when.mask = 1;
            break;
        case 23:
            map.position_query.length = 0;
            map.position_query.constant = 0;
            break;
        case 24:
            map.setpoint.fields = CANRAW_FIELDS_MAX + 1;
            break;
        case 25:
            map.position_query.constant = 0x07; /* of two bytes */
            break;
        case 26:
            map.command[CANRAW_HOME].constant = 0x7F; /* a byte is open */
            break;
        case 27:
            map.command[CANRAW_HOME].constant = 0xFC;
            map.command[CANRAW_HOME].fields = 1;
            map.command[CANRAW_HOME].field[0] = (canraw_field_t){CANRAW_POSITION, 0, 16, false, false, 0, 0, 0};
            break;
        case 28:
            map.command[CANRAW_HOME].length = 9;
            break;
        case 29:
            map.position_query.constant = 0x01;
            break;
        case 30:
            map.homing_query.constant = 0x01;
            break;
        case 31:
            map.position_reply.field[0].at = 3;
            break;
        case 32:
            map.homing_reply.field[0].bits = 24;
            break;
        case 33:
            map.setpoint.field[0].value = CANRAW_SPEED;
            break;
        case 34:
            map.homing_query = map.homing_reply = (canraw_frame_t){0}; /* nothing to judge homing by */
            break;
        case 35:
            map.command[CANRAW_HOME] = map.homing_query = (canraw_frame_t){0};
            map.homing_reply.field[0].value = CANRAW_POSITION;
            break;
        case 36:
            map.axis[3].reply_id = 0x800;
            break;
        case 37:
            map.axis[1].speed.den = 0;
            break;
        }
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, canraw_init(&driver, &map, sim_can_hal(&node)));
    }
    map = good;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, canraw_init(&driver, &map, (hal_can_t){NULL, NULL}));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&driver, &map, sim_can_hal(&node)));
}

/* ---- Whether the torque is off ---- */

static unsigned energized(void)
{
    unsigned count = 0;
    for (unsigned k = 0; k < AXES; k++) {
        count += feedback[k].is_energized;
    }
    return count;
}

/* What a drive is said to be without stays off, whenever it was asked to go off. */
static void test_off_is_told_once_it_is_so_whenever_it_is_asked_for(void)
{
    for (int i = 0; i < 80; i++) {
        map = canraw_maps_rich();
        map.enabled_when.mask = i % 4 < 2 ? 1 : 0; /* it says whether it has torque, or not */
        map.enabled_when.value = map.enabled_when.mask;
        open_with(NULL, 0, true);
        await(DRIVE_DISABLED, 100);
        TEST_ASSERT_EQUAL_UINT(0, energized());
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        for (int n = 0; n < i / 4; n++) {
            (void)!cycle();
            follow_actual();
        }
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, i % 2 == 0 ? DRIVES_DISABLE : DRIVES_QUICK_STOP));
        for (int n = 0; n < 400; n++) {
            (void)!cycle();
            for (unsigned k = 0; k < AXES; k++) {
                TEST_ASSERT_TRUE(feedback[k].is_energized || !frame_drive_is_enabled(&slave.twin[k]));
            }
        }
        TEST_ASSERT_EQUAL_UINT(0, energized());
    }
}

/* A drive that was lost while the others were told is told when it is back. */
static void test_off_is_told_again_to_a_drive_that_was_lost(void)
{
    for (unsigned can_tell = 0; can_tell < 2; can_tell++) {
        map = canraw_maps_rich();
        map.enabled_when.mask = map.enabled_when.value = can_tell;
        open_with(NULL, 0, true);
        enable();
        slave.twin[3].is_cut = true;
        cycles(30);
        TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[3].state);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        cycles(400);
        TEST_ASSERT_EQUAL_UINT(1, energized());
        TEST_ASSERT_TRUE(feedback[3].is_energized && frame_drive_is_enabled(&slave.twin[3]));
        slave.twin[3].is_cut = false;
        cycles(400);
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[3].state);
        TEST_ASSERT_EQUAL_UINT(0, energized());
        TEST_ASSERT_FALSE(frame_drive_is_enabled(&slave.twin[3]));
        slave.twin[3].is_cut = true;
        cycles(30);
        slave.twin[3].is_cut = false;
        slave.logged = 0;
        cycles(30);
        for (unsigned i = 0; i < slave.logged; i++) {
            TEST_ASSERT_TRUE(slave.log[i].data[0] != 0x21); /* it was without torque when it was lost */
        }
    }
}

/* Also where it has a fault when it is back. */
static void test_off_is_told_to_a_drive_that_comes_back_with_a_fault(void)
{
    for (unsigned can_tell = 0; can_tell < 2; can_tell++) {
        map = canraw_maps_rich();
        map.enabled_when.mask = map.enabled_when.value = can_tell;
        open_with(NULL, 0, true);
        enable();
        slave.twin[3].is_cut = true;
        cycles(30);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        frame_drive_fault(&slave.twin[3], 1);
        slave.twin[3].is_cut = false;
        cycles(400);
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[3].state);
        TEST_ASSERT_FALSE(frame_drive_is_enabled(&slave.twin[3]));
        TEST_ASSERT_EQUAL_UINT(0, energized());
    }
}

/* A stop that waits for room on the bus still goes to a drive that tells of a fault meanwhile. */
static void test_stop_that_waits_goes_out_to_a_drive_in_fault(void)
{
    hal_can_ops_t full = *sim_can_hal(&node).ops;
    full.send = take_nothing;
    open_rich();
    enable();
    driver.can.ops = &full;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    frame_drive_fault(&slave.twin[3], 1);
    say(0x18FF0203, true, 6, (const uint8_t[6]){0x30, 0x07, 0, 0x3D, 0x09, 0});
    (void)!poll_once();
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[3].state);
    TEST_ASSERT_EQUAL_UINT32(0, slave.sent[3].stops);
    driver.can.ops = sim_can_hal(&node).ops;
    cycles(10);
    TEST_ASSERT_EQUAL_UINT32(1, slave.sent[3].stops);
}

static uint32_t waiting_frames;

static hv_status_t tell_waiting(void *ctx, uint32_t *out)
{
    (void)ctx;
    *out = waiting_frames;
    return HV_OK;
}

/* An answer may be one to what went out before. */
static void test_off_that_is_not_on_the_wire_is_not_told(void)
{
    map = canraw_maps_rich();
    map.enabled_when.mask = map.enabled_when.value = 0;
    open_with(NULL, 0, true);
    enable();
    hal_can_ops_t telling = *sim_can_hal(&node).ops;
    telling.unconfirmed = tell_waiting;
    driver.can.ops = &telling;
    waiting_frames = 0;
    cycles(3);
    for (unsigned i = 0; i < 2; i++) {
        const uint64_t heard_us = feedback[0].actual_us;
        waiting_frames = i == 0 ? 1 : 0;
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
        cycles(3);
        TEST_ASSERT_TRUE(feedback[0].actual_us > heard_us);
        TEST_ASSERT_EQUAL_UINT(i == 0 ? AXES : 0, energized());
    }
    driver.can.ops = sim_can_hal(&node).ops;
}

static void test_off_of_drives_that_no_frame_takes_torque_from_is_not_waited_for(void)
{
    enable();
    TEST_ASSERT_EQUAL_UINT(0, energized());
}

static void test_off_of_a_drive_in_fault_is_told_when_it_says_so(void)
{
    open_rich();
    enable();
    frame_drive_fault(&slave.twin[1], 1);
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    TEST_ASSERT_TRUE(feedback[1].is_energized && frame_drive_is_enabled(&slave.twin[1]));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(320);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    TEST_ASSERT_EQUAL_UINT(0, energized());
}

/* It hears what takes its torque away, and keeps it. */
static void test_off_that_is_not_confirmed_is_not_told(void)
{
    open_rich();
    enable();
    map.command[CANRAW_DISABLE].data[0] = 0x23; /* to this drive, a reset */
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    cycles(200);
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    TEST_ASSERT_EQUAL_UINT(AXES, energized());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sealed_frames_have_no_gap_and_no_wrong_check_byte);
    RUN_TEST(test_sealed_frame_that_finds_no_room_is_no_gap);
    RUN_TEST(test_reply_with_a_wrong_check_byte_is_not_believed);
    RUN_TEST(test_drive_whose_counter_stands_still_is_lost_and_stays_so);
    RUN_TEST(test_all_that_answer_strangely_are_no_lost_bus);
    RUN_TEST(test_fault_of_a_drive_has_the_code_that_it_tells);
    RUN_TEST(test_frames_of_the_plain_dialect_byte_for_byte);
    RUN_TEST(test_setpoint_at_full_stroke_byte_for_byte);
    RUN_TEST(test_speed_field_is_that_of_the_setpoints);
    RUN_TEST(test_speed_field_with_a_sign_has_the_direction);
    RUN_TEST(test_speed_that_no_number_tells_is_at_the_end_of_its_field);
    RUN_TEST(test_every_query_every_period_in_turn);
    RUN_TEST(test_setpoints_go_out_once_per_period_and_only_while_enabled);
    RUN_TEST(test_on_change_sends_nothing_twice);
    RUN_TEST(test_gate_the_next_set_waits_for_the_last);
    RUN_TEST(test_queue_full_at_every_frame_of_a_set_makes_no_larger_step);
    RUN_TEST(test_bus_without_partner_is_gone_after_three_periods_and_returns);
    RUN_TEST(test_bus_off_unplugged_and_restarted_lose_every_drive);
    RUN_TEST(test_bus_whose_controller_is_not_on_it_is_gone_at_once);
    RUN_TEST(test_bus_without_echoes_is_trusted);
    RUN_TEST(test_drive_that_is_heard_while_the_bus_is_gone_stays_offline);
    RUN_TEST(test_bus_whose_queue_stays_full_is_gone_after_three_periods);
    RUN_TEST(test_error_passive_is_failing_after_its_time_and_stops_nothing_here);
    RUN_TEST(test_storm_of_error_frames_is_bounded_and_stops_nothing);
    RUN_TEST(test_burst_of_error_frames_is_not_taken_for_a_bus_that_is_gone);
    RUN_TEST(test_frames_that_are_no_replies_change_nothing);
    RUN_TEST(test_position_beyond_all_millimetres_is_not_taken);
    RUN_TEST(test_silent_drive_is_offline_after_its_periods_and_gets_nothing_more);
    RUN_TEST(test_one_lost_frame_anywhere_is_survived);
    RUN_TEST(test_following_error_stops_that_axis_and_it_hears_nothing_more);
    RUN_TEST(test_setpoint_that_no_frame_can_carry_is_a_fault_and_is_not_sent);
    RUN_TEST(test_lag_beyond_the_window_is_a_following_error);
    RUN_TEST(test_lag_that_is_not_watched_is_no_fault);
    RUN_TEST(test_homing_ends_when_the_drive_says_so_and_the_new_position_is_known);
    RUN_TEST(test_homing_done_of_the_last_time_is_not_believed);
    RUN_TEST(test_homing_done_from_the_start_is_believed_after_a_while);
    RUN_TEST(test_homing_is_judged_by_its_own_query_where_there_is_one);
    RUN_TEST(test_homing_failed_is_a_fault);
    RUN_TEST(test_homing_that_never_ends_can_be_stopped);
    RUN_TEST(test_homing_without_a_frame_is_homed_from_the_start);
    RUN_TEST(test_rich_setpoints_stand_on_actual_before_enabling);
    RUN_TEST(test_rich_quick_stop_reaches_the_drives_without_another_send);
    RUN_TEST(test_rich_drive_that_drops_out_is_seen);
    RUN_TEST(test_rich_homing_does_not_end_without_torque);
    RUN_TEST(test_rich_fault_that_stays_outlives_its_reset);
    RUN_TEST(test_rich_status_that_the_map_does_not_judge_means_nothing);
    RUN_TEST(test_rich_fault_whose_status_is_nothing_has_a_code);
    RUN_TEST(test_rich_reset_that_has_not_gone_out_ends_no_fault);
    RUN_TEST(test_rich_quick_stop_with_a_drive_that_is_gone);
    RUN_TEST(test_stop_goes_on_for_a_drive_that_falls_silent);
    RUN_TEST(test_stop_of_drives_that_all_fall_silent);
    RUN_TEST(test_stop_is_not_cut_short_by_a_bus_that_restarts);
    RUN_TEST(test_stop_that_waits_is_replaced_by_nothing);
    RUN_TEST(test_reset_that_has_waited_for_long_is_given_up);
    RUN_TEST(test_rich_enable_again_is_for_those_that_are_not);
    RUN_TEST(test_positions_that_come_unasked);
    RUN_TEST(test_ambiguous_late_answers_are_not_taken_for_another);
    RUN_TEST(test_init_map_that_contradicts_itself_is_refused);
    RUN_TEST(test_off_is_told_once_it_is_so_whenever_it_is_asked_for);
    RUN_TEST(test_off_is_told_again_to_a_drive_that_was_lost);
    RUN_TEST(test_off_is_told_to_a_drive_that_comes_back_with_a_fault);
    RUN_TEST(test_stop_that_waits_goes_out_to_a_drive_in_fault);
    RUN_TEST(test_off_that_is_not_on_the_wire_is_not_told);
    RUN_TEST(test_off_of_drives_that_no_frame_takes_torque_from_is_not_waited_for);
    RUN_TEST(test_off_of_a_drive_in_fault_is_told_when_it_says_so);
    RUN_TEST(test_off_that_is_not_confirmed_is_not_told);
    RUN_TEST(test_enable_drives_that_set_points_enable);
    RUN_TEST(test_enable_drives_that_are_enabled_by_themselves);
    return UNITY_END();
}

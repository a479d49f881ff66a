/* SPDX-License-Identifier: MIT
 * test_cia402.c - CANopen drives behind drives.h, against strict simulated ones: setting up, refusals, enabling without a jump,
 * one drive that does not come along, losses and how soon they are seen, faults and their reset, homing, a bus that stalls.
 */
#include "heave/cia402.h"

#include <stdlib.h>
#include <string.h>

#include "cia402_slave.h"
#include "unity.h"

#define AXES     CIA402_SLAVES
#define CYCLE_US 1000u
#define PERIOD   4u /* cycles */
#define MM(x)    ((q32_t)(x)*Q32_ONE)

static sim_can_bus_t bus;
static sim_can_t node;
static cia402_slave_t slave;
static cia402_config_t config;
static cia402_t driver;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];

void hv_assert_failed(const char *file, int line)
{
    (void)file;
    (void)line;
    TEST_FAIL_MESSAGE("assertion");
}

static hv_status_t cycle(void)
{
    now_us += CYCLE_US;
    cia402_slave_step(&slave, now_us);
    const hv_status_t status = drives_poll(hal, now_us, feedback);
    (void)!drives_send(hal, now_us, setpoint_q32);
    return status;
}

static void cycles(unsigned count)
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

static void configure(void)
{
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
                               .is_reset_wanted = true};
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k + 1),
                                                .scale = {1000, 1, 0},
                                                .step_max_q32 = MM(2),
                                                .following_max_q32 = MM(10),
                                                .window_counts = 10000,
                                                .homing_speed = {10000, 1000},
                                                .homing_accel = 100000};
    }
}

static void start(void)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    const uint32_t filters = cia402_filters(&config, filter);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, filter, filters));
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&node)));
    hal = cia402_hal(&driver);
}

void setUp(void)
{
    now_us = 5000000;
    memset(feedback, 0, sizeof feedback);
    memset(setpoint_q32, 0, sizeof setpoint_q32);
    sim_can_bus_init(&bus, 0, NULL, 0);
    cia402_slave_open(&slave, &bus);
    for (unsigned k = 0; k < AXES; k++) {
        slave.drive[k].position = 100000 + 1000 * (int32_t)k;
    }
    configure();
}

void tearDown(void) {}

static bool are_all(drive_state_t state)
{
    for (unsigned k = 0; k < AXES; k++) {
        if (feedback[k].state != state) {
            return false;
        }
    }
    return true;
}

static void await(drive_state_t state, unsigned most)
{
    unsigned count = 0;
    do {
        (void)!cycle();
        follow_actual();
    } while (!are_all(state) && ++count < most);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(state, feedback[k].state);
    }
}

static void come_up(void)
{
    start();
    await(DRIVE_DISABLED, 5000);
}

static void enable(void)
{
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED, 2000);
}

/* Cycles until an axis is in a state. */
static unsigned cycles_until(unsigned axis, drive_state_t state, unsigned most)
{
    unsigned count = 0;
    while (feedback[axis].state != state && count < most) {
        (void)!cycle();
        count++;
    }
    TEST_ASSERT_EQUAL(state, feedback[axis].state);
    return count;
}

static drive_report_t report(uint8_t axis)
{
    drive_report_t out;
    TEST_ASSERT_TRUE(drives_report(hal, axis, &out));
    return out;
}

/* --- Setting up --- */

static unsigned place(unsigned drive, uint32_t object, unsigned from)
{
    const cia402_slave_drive_t *d = &slave.drive[drive];
    for (unsigned i = from; i < d->logged; i++) {
        if (d->log[i] == object) {
            return i;
        }
    }
    TEST_FAIL_MESSAGE("object was not written");
    return 0;
}

static void test_setup_pdos_are_mapped_in_the_order_every_stack_accepts(void)
{
    static const uint32_t k_order[] = {0x140001, 0x180001, 0x140002, 0x160000, 0x160001, 0x160002, 0x160000, 0x140001,
                                       0x180002, 0x1A0000, 0x1A0001, 0x1A0002, 0x1A0003, 0x1A0000, 0x180001};
    come_up();
    for (unsigned k = 0; k < AXES; k++) {
        unsigned at = 0;
        for (size_t i = 0; i < sizeof k_order / sizeof k_order[0]; i++) {
            at = place(k, k_order[i], at) + 1;
        }
        TEST_ASSERT_EQUAL_HEX32(0x200 + k + 1, cia402_slave_row(&slave, k, 0x1400, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0x40000180 + k + 1, cia402_slave_row(&slave, k, 0x1800, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0x80000300 + k + 1, cia402_slave_row(&slave, k, 0x1401, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0xC0000280 + k + 1, cia402_slave_row(&slave, k, 0x1801, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0x607A0020, cia402_slave_row(&slave, k, 0x1600, 2)->value);
        TEST_ASSERT_EQUAL_HEX32(0x7F0096, cia402_slave_row(&slave, k, 0x1016, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(4, cia402_slave_row(&slave, k, 0x60C2, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0xFD, cia402_slave_row(&slave, k, 0x60C2, 2)->value);
        TEST_ASSERT_EQUAL_HEX32(2, cia402_slave_row(&slave, k, 0x605A, 0)->value);
        TEST_ASSERT_EQUAL_HEX32(10000, cia402_slave_row(&slave, k, 0x6065, 0)->value);
        TEST_ASSERT_EQUAL_UINT32(1, slave.drive[k].boots); /* it has just begun anew: nothing to reset */
    }
}

static void test_setup_drives_that_are_up_already_are_reset_first(void)
{
    start();
    for (unsigned i = 0; i < 100; i++) {
        now_us += CYCLE_US;
        cia402_slave_step(&slave, now_us);
    }
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(sim_can_hal(&node))); /* their boot-up messages were heard by nobody */
    await(DRIVE_DISABLED, 5000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(2, slave.drive[k].boots);
    }
}

/* Configures with one drive spoiled and tells how that ends. */
static drive_report_t refusal_of(unsigned drive)
{
    start();
    cycles(4000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(k == drive ? DRIVE_OFFLINE : DRIVE_DISABLED, feedback[k].state);
    }
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    return report((uint8_t)drive);
}

static void test_setup_object_refused_names_drive_object_and_reason(void)
{
    cia402_slave_row(&slave, 3, 0x60C2, 1)->refusal = 0x06090030;
    const drive_report_t r = refusal_of(3);
    TEST_ASSERT_EQUAL_UINT8(4, r.address);
    TEST_ASSERT_EQUAL_STRING("refused", r.phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_TAKEN, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x60C201, r.object);
    TEST_ASSERT_EQUAL_STRING("the value is out of range", r.detail);
}

static void test_setup_wrong_identity_is_refused(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k].identity[0] = 0x2E5;
        config.axis[k].identity[1] = k == 2 ? 0x403 : 0x402;
    }
    TEST_ASSERT_EQUAL_HEX32(CIA402_WRONG_IDENTITY, refusal_of(2).code);
}

static void test_setup_wrong_revision_and_serial_number_are_refused(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k].identity[2] = 1;
        config.axis[k].identity[3] = k == 4 ? 98 : 99;
    }
    const drive_report_t r = refusal_of(4);
    TEST_ASSERT_EQUAL_HEX32(CIA402_WRONG_IDENTITY, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x101804, r.object);
}

static void test_setup_position_limits_are_written_where_wanted(void)
{
    config.axis[1].has_limits = true;
    config.axis[1].limit_counts[0] = -5000;
    config.axis[1].limit_counts[1] = 205000;
    cia402_slave_row(&slave, 1, 0x607D, 2)->refusal = 0x06090036; /* a second line of defence: no reason to refuse a drive */
    come_up();
    TEST_ASSERT_EQUAL_INT32(-5000, (int32_t)cia402_slave_row(&slave, 1, 0x607D, 1)->value);
    TEST_ASSERT_EQUAL_INT32(0, (int32_t)cia402_slave_row(&slave, 0, 0x607D, 1)->value);
}

static void test_setup_other_profile_is_refused(void)
{
    cia402_slave_row(&slave, 0, 0x1000, 0)->value = 0x00020191;
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_402, refusal_of(0).code);
}

static void test_setup_missing_guard_is_refused_unless_allowed(void)
{
    static const uint16_t k_guards[] = {0x1016, 0x6007, 0x605A, 0x605E, 0x6065};
    for (size_t i = 0; i < 5; i++) {
        const uint8_t sub = k_guards[i] == 0x1016 ? 1 : 0;
        setUp();
        cia402_slave_row(&slave, 1, k_guards[i], sub)->is_missing = true;
        const drive_report_t refused = refusal_of(1);
        TEST_ASSERT_EQUAL_HEX32(CIA402_UNGUARDED, refused.code);
        TEST_ASSERT_EQUAL_HEX32((uint32_t)k_guards[i] << 8 | sub, refused.object);
        setUp();
        cia402_slave_row(&slave, 1, k_guards[i], sub)->is_missing = true;
        config.is_unguarded_allowed = true;
        come_up();
        TEST_ASSERT_EQUAL_HEX32((uint32_t)k_guards[i] << 8 | sub, report(1).object);
        enable();
    }
}

static void test_setup_guard_that_cannot_be_written_but_is_on_is_taken(void)
{
    cia402_slave_row_t *row = cia402_slave_row(&slave, 1, 0x605E, 0);
    row->is_read_only = true;
    row->value = row->initial = 1;
    come_up();
    setUp();
    cia402_slave_row(&slave, 1, 0x605E, 0)->is_read_only = true; /* 0: it coasts */
    TEST_ASSERT_EQUAL_HEX32(CIA402_UNGUARDED, refusal_of(1).code);
}

static void test_setup_without_heartbeats_is_refused(void)
{
    slave.drive[5].has_no_beat = true;
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_HEARTBEAT, refusal_of(5).code);
}

static void test_setup_optional_objects_missing_is_no_trouble(void)
{
    static const uint16_t k_optional[] = {0x1006, 0x1019, 0x605B, 0x605C, 0x6066};
    for (size_t i = 0; i < 5; i++) {
        cia402_slave_row(&slave, 1, k_optional[i], 0)->is_missing = true;
    }
    come_up();
}

static void test_setup_missing_drive_is_named_and_taken_when_it_comes(void)
{
    cia402_slave_power(&slave, 6, false);
    TEST_ASSERT_EQUAL_HEX32(CIA402_SILENT, refusal_of(6).code);
    TEST_ASSERT_EQUAL_STRING("missing", report(6).phase);
    cia402_slave_power(&slave, 6, true);
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL_HEX32(0, report(6).code);
}

/* Every answer is given to the next question only: with the retries each object is right in the end. */
static void test_setup_answers_that_come_late_do_not_confuse(void)
{
    slave.drive[2].is_answering_late = true;
    start();
    await(DRIVE_DISABLED, 60000);
    TEST_ASSERT_EQUAL_HEX32(0x607A0020, cia402_slave_row(&slave, 2, 0x1600, 2)->value);
    TEST_ASSERT_EQUAL_HEX32(0x7F0096, cia402_slave_row(&slave, 2, 0x1016, 1)->value);
    TEST_ASSERT_EQUAL_HEX32(10000, cia402_slave_row(&slave, 2, 0x6065, 0)->value);
    slave.drive[2].is_answering_late = false;
    enable();
}

static void test_setup_refused_drive_is_tried_again_by_a_reset(void)
{
    cia402_slave_row(&slave, 3, 0x6060, 0)->refusal = 0x06090030;
    (void)refusal_of(3);
    cia402_slave_row(&slave, 3, 0x6060, 0)->refusal = 0;
    cycles(2000);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[3].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
}

/* --- Enabling --- */

static void test_enable_all_together_without_a_jump(void)
{
    come_up();
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        const cia402_slave_drive_t *d = &slave.drive[k];
        TEST_ASSERT_EQUAL_INT32(0, d->largest_step);
        TEST_ASSERT_EQUAL_UINT32(1, d->enabled);
        TEST_ASSERT_TRUE(d->enabled_us - slave.drive[0].enabled_us <= 10000); /* brakes of 8 to 14 ms */
        TEST_ASSERT_EQUAL_INT32(100000 + 1000 * (int32_t)k, d->position);
    }
}

static void test_enable_drives_whose_states_move_by_themselves_come_up(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        slave.drive[k].is_restless = k % 2 == 0;
    }
    come_up();
    cycles(57);
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    await(DRIVE_DISABLED, 100);
    enable();
}

static void test_enable_drive_that_does_not_come_along_leads_all_back(void)
{
    static const struct {
        uint16_t at;
        uint32_t code;
    } k_cases[] = {{0x21, CIA402_NO_POWER}, {0x40, CIA402_NO_POWER}, {0x23, CIA402_NO_TORQUE}};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        slave.drive[4].is_stuck = true;
        slave.drive[4].stuck_at = k_cases[i].at;
        come_up();
        follow_actual();
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        (void)cycles_until(4, DRIVE_FAULT, 2000);
        TEST_ASSERT_EQUAL_HEX32(k_cases[i].code, feedback[4].fault_code);
        cycles(50);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL(k == 4 ? DRIVE_FAULT : DRIVE_DISABLED, feedback[k].state);
            TEST_ASSERT_TRUE(k == 4 || slave.drive[k].status == 0x40 || slave.drive[k].status == 0x21);
        }
        slave.drive[4].is_stuck = false;
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        await(DRIVE_DISABLED, 100);
        enable();
    }
}

static void test_send_set_points_arrive_as_counts_one_set_per_period(void)
{
    come_up();
    enable();
    const uint32_t before = slave.drive[0].setpoints;
    for (int i = 0; i < 400; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 100;
        }
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
    TEST_ASSERT_UINT32_WITHIN(2, 100, slave.drive[0].setpoints - before);
    TEST_ASSERT_EQUAL_INT32(40, slave.drive[6].largest_step);
    cycles(3 * PERIOD);
    TEST_ASSERT_EQUAL_INT32(104000, slave.drive[0].position);
}

static void test_send_position_wraps_round_without_a_jump(void)
{
    slave.drive[6].position = INT32_MAX - 100;
    come_up();
    enable();
    for (int i = 0; i < 100; i++) {
        setpoint_q32[6] += MM(1) / 100;
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
    cycles(3 * PERIOD);
    TEST_ASSERT_EQUAL_INT32(INT32_MIN + 899, slave.drive[6].position);
    TEST_ASSERT_TRUE(feedback[6].actual_mm_q32 > MM(2147483));
}

/* --- Losses --- */

/* One drive fails while all follow; how many cycles until it is seen, and that all others can be stopped. */
static unsigned cycles_to_loss(uint32_t code, drive_state_t state)
{
    const unsigned count = cycles_until(2, state, 1000);
    TEST_ASSERT_EQUAL_HEX32(code, feedback[2].fault_code);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(5 * PERIOD);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(k == 2 || slave.drive[k].quick_stops == 1);
    }
    return count;
}

static void test_poll_drive_silent_is_lost_after_three_syncs(void)
{
    come_up();
    enable();
    slave.drive[2].is_mute = true;
    TEST_ASSERT_TRUE(cycles_to_loss(CIA402_LOST_TPDO, DRIVE_OFFLINE) <= 4 * PERIOD + 1);
    TEST_ASSERT_EQUAL_UINT32(1, slave.drive[2].quick_stops); /* it still hears */
    slave.drive[2].is_mute = false;
    await(DRIVE_DISABLED, 5000);
    enable();
}

static void test_poll_two_tpdos_lost_is_no_loss(void)
{
    come_up();
    enable();
    for (int i = 0; i < 20; i++) {
        slave.drive[2].tpdo_drop = 2;
        cycles(4 * PERIOD);
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

static void test_poll_heartbeat_lost_is_a_loss_in_time(void)
{
    come_up();
    enable();
    slave.drive[2].has_no_beat = true;
    TEST_ASSERT_TRUE(cycles_to_loss(CIA402_LOST_HEARTBEAT, DRIVE_OFFLINE) <= 152);
}

static void test_poll_boot_up_in_mid_run_is_a_loss_at_once(void)
{
    come_up();
    enable();
    cia402_slave_power(&slave, 2, true);
    slave.drive[2].boot_us = now_us;
    TEST_ASSERT_TRUE(cycles_to_loss(CIA402_REBOOTED, DRIVE_OFFLINE) <= 2);
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL_UINT32(2, slave.drive[2].boots); /* not reset once more */
    enable();
}

static void test_poll_node_that_leaves_operational_is_lost(void)
{
    come_up();
    enable();
    slave.drive[2].nmt = 0x7F;
    const unsigned count = cycles_to_loss(CIA402_LOST_TPDO, DRIVE_OFFLINE);
    TEST_ASSERT_TRUE(count <= 4 * PERIOD + 1);
}

static void test_poll_torque_gone_by_itself_is_seen_in_a_period(void)
{
    come_up();
    enable();
    cia402_slave_drop(&slave, 2);
    TEST_ASSERT_TRUE(cycles_to_loss(0, DRIVE_DISABLED) <= PERIOD + 1);
    TEST_ASSERT_EQUAL_HEX32(CIA402_FELL_OUT, report(2).code);
    TEST_ASSERT_EQUAL_UINT32(1, slave.drive[2].enabled); /* nobody enables it again by itself */
}

static void test_poll_fault_has_the_code_of_its_emergency(void)
{
    come_up();
    enable();
    cia402_slave_fault(&slave, 2, 0x3210);
    TEST_ASSERT_TRUE(cycles_to_loss(0x3210, DRIVE_FAULT) <= PERIOD + 1);
    TEST_ASSERT_EQUAL_STRING("over-voltage of the DC link", report(2).trouble);
}

static void test_poll_fault_without_emergency_is_looked_up(void)
{
    come_up();
    enable();
    slave.drive[2].is_mute = true;
    cia402_slave_fault(&slave, 2, 0x7305);
    slave.drive[2].is_mute = false;
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    cycles(20);
    TEST_ASSERT_EQUAL_HEX32(0x7305, feedback[2].fault_code);
}

static void test_request_reset_is_one_edge_and_only_when_asked(void)
{
    come_up();
    enable();
    cia402_slave_fault(&slave, 2, 0x2310);
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(2000);
    TEST_ASSERT_EQUAL_UINT32(0, slave.drive[2].resets);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL_UINT32(1, slave.drive[2].resets);
    cia402_slave_fault(&slave, 2, 0x2310);
    cycles(500);
    TEST_ASSERT_EQUAL_UINT32(1, slave.drive[2].resets);
    TEST_ASSERT_EQUAL_UINT32(0, slave.drive[3].resets);
}

static void listen_to_silence(unsigned ms)
{
    while (ms-- > 0) {
        now_us += CYCLE_US;
        cia402_slave_step(&slave, now_us);
    }
}

static void test_leave_drives_without_torque_forget_the_gateway(void)
{
    come_up();
    cia402_leave(&driver);
    listen_to_silence(1000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(2, slave.drive[k].boots);
        TEST_ASSERT_EQUAL_HEX32(0, cia402_slave_row(&slave, k, 0x603F, 0)->value); /* no 8130h */
    }
}

static void test_leave_drives_with_torque_are_left_to_their_watchdogs(void)
{
    come_up();
    enable();
    cia402_leave(&driver);
    listen_to_silence(90); /* the last heartbeat is up to 50 ms old */
    TEST_ASSERT_EQUAL_HEX16(0x27, slave.drive[0].status);
    listen_to_silence(70);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, slave.drive[k].boots);
        TEST_ASSERT_EQUAL_HEX16(0x08, slave.drive[k].status);
    }
}

/* --- The bus --- */

static void test_bus_off_ended_syncs_go_on_at_their_period(void)
{
    come_up();
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
    const uint32_t restarts = driver.restarts;
    for (unsigned n = 0; n < 4000 && driver.restarts == restarts; n++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL_UINT32(restarts + 1, driver.restarts);
    const uint32_t syncs = driver.syncs; /* the first of them left in the cycle of the restart */
    cycles(PERIOD - 1);
    TEST_ASSERT_EQUAL_UINT32(syncs, driver.syncs);
    for (unsigned n = 1; n <= 5; n++) {
        cycles(PERIOD);
        TEST_ASSERT_EQUAL_UINT32(syncs + n, driver.syncs);
    }
}

static void test_bus_off_keeps_silent_until_the_drives_have_stopped(void)
{
    come_up();
    enable();
    const uint32_t restarts = driver.restarts;
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
    TEST_ASSERT_EQUAL(HV_ERR_IO, cycle());
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(hal, DRIVES_DISABLE));
    cycles(400);
    TEST_ASSERT_EQUAL_UINT32(restarts, driver.restarts);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_HEX16(0x08, slave.drive[k].status); /* 6007h = 1: they found out by themselves */
    }
    cycles(4000);
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 200);
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(0, slave.drive[k].largest_step);
    }
}

static void test_bus_that_echoes_nothing_is_gone_after_three_periods(void)
{
    come_up();
    enable();
    unsigned count = 0;
    hv_status_t status = HV_OK;
    bus.frame_us = 1000000;
    while (status == HV_OK && count < 100) {
        status = cycle();
        count++;
    }
    TEST_ASSERT_EQUAL(HV_ERR_IO, status);
    TEST_ASSERT_TRUE(count <= 4 * PERIOD + 1);
}

static void test_error_passive_is_failing_after_its_time_and_stops_nothing_here(void)
{
    config.passive_stop_ms = 1000;
    come_up();
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
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
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

/* 20 000 a second are more than 1 Mbit/s has room for beside the drives' frames. */
static void test_storm_of_error_frames_is_bounded_and_stops_nothing(void)
{
    come_up();
    enable();
    for (unsigned i = 0; i < 1000; i++) {
        for (unsigned k = 0; k < 20; k++) {
            sim_can_report(&node, CAN_ERROR_OTHER);
        }
        (void)!cycle();
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    }
    hal_can_ops_t endless = *sim_can_hal(&node).ops;
    endless.recv = flood;
    driver.can.ops = &endless;
    (void)!cycle();
    TEST_ASSERT_EQUAL_UINT(128, received);
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
    come_up();
    enable();
    hal_can_ops_t full = *sim_can_hal(&node).ops;
    full.send = take_nothing;
    driver.can.ops = &full;
    unsigned count = 0;
    while (!are_all(DRIVE_OFFLINE) && count++ < 100) {
        (void)!cycle();
    }
    TEST_ASSERT_UINT_WITHIN(PERIOD / 2, 3 * PERIOD + PERIOD / 2, count);
    driver.can.ops = sim_can_hal(&node).ops;
    await(DRIVE_FAULT, 10000); /* by their watch over the heartbeat */
}

static void test_send_slow_bus_refuses_instead_of_queueing(void)
{
    come_up();
    enable();
    bus.frame_us = 700; /* a set takes 10 ms */
    unsigned refused = 0;
    for (int i = 0; i < 10; i++) {
        now_us += CYCLE_US;
        cia402_slave_step(&slave, now_us);
        (void)!drives_poll(hal, now_us, feedback);
        refused += drives_send(hal, now_us, setpoint_q32) == HV_ERR_AGAIN;
        TEST_ASSERT_TRUE(node.tx_count <= 1 + AXES + 1);
    }
    TEST_ASSERT_TRUE(refused > 0);
}

/* --- Homing --- */

static void home(bool is_in_turn)
{
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k].homing_method = k == 6 ? 0 : 17;
        config.axis[k].homing_offset_counts = 500;
    }
    config.is_homing_in_turn = is_in_turn;
    come_up();
    enable();
    TEST_ASSERT_FALSE(feedback[0].is_homed);
    TEST_ASSERT_TRUE(feedback[6].is_homed);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
}

static void test_request_home_finds_the_zero_of_all_and_returns_without_a_jump(void)
{
    for (unsigned turn = 0; turn < 2; turn++) {
        setUp();
        home(turn == 1);
        const uint64_t begin_us = now_us;
        await(DRIVE_ENABLED, 5000);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(feedback[k].is_homed);
            TEST_ASSERT_EQUAL_INT32(k == 6 ? 106000 : 500, slave.drive[k].position);
            TEST_ASSERT_EQUAL_INT32(0, slave.drive[k].largest_step);
            TEST_ASSERT_EQUAL_INT8(8, slave.drive[k].mode);
        }
        TEST_ASSERT_TRUE(now_us - begin_us < (turn == 1 ? 1000000u : 400000u));
        TEST_ASSERT_TRUE(now_us - begin_us > (turn == 1 ? 300000u : 50000u));
    }
}

static void test_request_home_one_failure_stops_all(void)
{
    slave.drive[3].is_homing_failing = true;
    home(false);
    (void)cycles_until(3, DRIVE_FAULT, 3000);
    TEST_ASSERT_EQUAL_HEX32(0x8613, feedback[3].fault_code);
    cycles(50);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(slave.drive[k].status != 0x27);
    }
}

static void test_request_home_again_is_not_over_before_it_begins(void)
{
    home(false);
    await(DRIVE_ENABLED, 5000);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    await(DRIVE_DISABLED, 200);
    slave.drive[0].position = 7000;
    cycles(2 * PERIOD);
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    await(DRIVE_ENABLED, 5000);
    TEST_ASSERT_EQUAL_INT32(500, slave.drive[0].position);
}

static void test_power_lost_means_that_the_zero_is_lost(void)
{
    home(false);
    await(DRIVE_ENABLED, 5000);
    cia402_slave_power(&slave, 1, true);
    (void)cycles_until(1, DRIVE_OFFLINE, 100);
    TEST_ASSERT_FALSE(feedback[1].is_homed);
    TEST_ASSERT_TRUE(feedback[0].is_homed);
}

/* --- Random trouble --- */

/* Whatever happens to one drive, and whenever: no drive jumps, and none has torque while another one is gone for long. */
static void test_any_trouble_at_any_time_moves_nothing(void)
{
    srand(7);
    for (int round = 0; round < 60; round++) {
        setUp();
        come_up();
        follow_actual();
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        const unsigned axis = (unsigned)rand() % AXES;
        cycles((unsigned)rand() % 120);
        switch (rand() % 5) {
        case 0:
            cia402_slave_fault(&slave, axis, 0x5000);
            break;
        case 1:
            cia402_slave_power(&slave, axis, true);
            break;
        case 2:
            slave.drive[axis].is_mute = true;
            break;
        case 3:
            cia402_slave_drop(&slave, axis);
            break;
        default:
            slave.drive[axis].nmt = 0x04;
            break;
        }
        for (int i = 0; i < 600; i++) {
            (void)!cycle();
            bool is_bad = false;
            for (unsigned k = 0; k < AXES; k++) {
                is_bad |= feedback[k].state == DRIVE_FAULT || feedback[k].state == DRIVE_OFFLINE;
            }
            if (is_bad) {
                (void)!drives_request(hal, DRIVES_QUICK_STOP);
            }
        }
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL_INT32(0, slave.drive[k].largest_step);
            TEST_ASSERT_EQUAL_INT32(100000 + 1000 * (int32_t)k, slave.drive[k].position);
        }
    }
}

static void test_init_contradictions_are_refused(void)
{
    const cia402_config_t fine = config;
    const hal_can_t can = sim_can_hal(&slave.node);
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, can));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, cia402_init(&driver, &config, (hal_can_t){NULL, NULL}));
    for (int i = 0; i < 9; i++) {
        config = fine;
        config.axes = i == 0 ? 0 : i == 1 ? DRIVES_MAX + 1 : config.axes;
        config.axis[1].node = i == 2 ? 1 : i == 3 ? 0 : i == 4 ? 127 : 2;
        config.period_us = i == 5 ? 4050 : config.period_us;
        config.sync_counter = i == 6 ? 1 : 0;
        config.heartbeat_timeout_ms = i == 7 ? config.heartbeat_ms : config.heartbeat_timeout_ms;
        config.axis[2].scale.num = i == 8 ? 0 : 1000;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, can));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_setup_pdos_are_mapped_in_the_order_every_stack_accepts);
    RUN_TEST(test_setup_drives_that_are_up_already_are_reset_first);
    RUN_TEST(test_setup_object_refused_names_drive_object_and_reason);
    RUN_TEST(test_setup_wrong_identity_is_refused);
    RUN_TEST(test_setup_wrong_revision_and_serial_number_are_refused);
    RUN_TEST(test_setup_position_limits_are_written_where_wanted);
    RUN_TEST(test_setup_other_profile_is_refused);
    RUN_TEST(test_setup_missing_guard_is_refused_unless_allowed);
    RUN_TEST(test_setup_guard_that_cannot_be_written_but_is_on_is_taken);
    RUN_TEST(test_setup_without_heartbeats_is_refused);
    RUN_TEST(test_setup_optional_objects_missing_is_no_trouble);
    RUN_TEST(test_setup_missing_drive_is_named_and_taken_when_it_comes);
    RUN_TEST(test_setup_answers_that_come_late_do_not_confuse);
    RUN_TEST(test_setup_refused_drive_is_tried_again_by_a_reset);
    RUN_TEST(test_enable_all_together_without_a_jump);
    RUN_TEST(test_enable_drives_whose_states_move_by_themselves_come_up);
    RUN_TEST(test_enable_drive_that_does_not_come_along_leads_all_back);
    RUN_TEST(test_send_set_points_arrive_as_counts_one_set_per_period);
    RUN_TEST(test_send_position_wraps_round_without_a_jump);
    RUN_TEST(test_poll_drive_silent_is_lost_after_three_syncs);
    RUN_TEST(test_poll_two_tpdos_lost_is_no_loss);
    RUN_TEST(test_poll_heartbeat_lost_is_a_loss_in_time);
    RUN_TEST(test_poll_boot_up_in_mid_run_is_a_loss_at_once);
    RUN_TEST(test_poll_node_that_leaves_operational_is_lost);
    RUN_TEST(test_poll_torque_gone_by_itself_is_seen_in_a_period);
    RUN_TEST(test_poll_fault_has_the_code_of_its_emergency);
    RUN_TEST(test_poll_fault_without_emergency_is_looked_up);
    RUN_TEST(test_request_reset_is_one_edge_and_only_when_asked);
    RUN_TEST(test_leave_drives_without_torque_forget_the_gateway);
    RUN_TEST(test_leave_drives_with_torque_are_left_to_their_watchdogs);
    RUN_TEST(test_bus_off_ended_syncs_go_on_at_their_period);
    RUN_TEST(test_bus_off_keeps_silent_until_the_drives_have_stopped);
    RUN_TEST(test_bus_that_echoes_nothing_is_gone_after_three_periods);
    RUN_TEST(test_bus_whose_queue_stays_full_is_gone_after_three_periods);
    RUN_TEST(test_send_slow_bus_refuses_instead_of_queueing);
    RUN_TEST(test_error_passive_is_failing_after_its_time_and_stops_nothing_here);
    RUN_TEST(test_storm_of_error_frames_is_bounded_and_stops_nothing);
    RUN_TEST(test_request_home_finds_the_zero_of_all_and_returns_without_a_jump);
    RUN_TEST(test_request_home_one_failure_stops_all);
    RUN_TEST(test_request_home_again_is_not_over_before_it_begins);
    RUN_TEST(test_power_lost_means_that_the_zero_is_lost);
    RUN_TEST(test_any_trouble_at_any_time_moves_nothing);
    RUN_TEST(test_init_contradictions_are_refused);
    return UNITY_END();
}

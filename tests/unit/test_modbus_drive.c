/* SPDX-License-Identifier: MIT
 * test_modbus_drive.c - drives on Modbus against registers written from a list alone: start-up, enabling without a step, what a
 * slow line is asked, failures within and beyond the retries, stops, maps that contradict themselves.
 */
#include "heave/modbus_drive.h"

#include <string.h>

#include "modbus_maps.h"
#include "modbus_slave.h"
#include "unity.h"

#define AXES     MODBUS_SLAVES
#define CYCLE_US 1000u
#define MM(x)    ((q32_t)(x)*Q32_ONE)
#define START_MM 150

static modbus_slave_t slave;
static modbus_drive_map_t map;
static modbus_drive_t driver;
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

static int32_t wide_counts(int32_t mm)
{
    return MODBUS_SLAVE_WIDE_ZERO - (mm * 10000 + 1) / 3;
}

static hv_status_t cycle(void)
{
    now_us += CYCLE_US;
    modbus_slave_step(&slave, now_us);
    (void)!drives_poll(hal, now_us, feedback);
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

static void open_slaves(bool is_small, bool is_shared, uint32_t transaction_us)
{
    hal_modbus_t line[DRIVES_MAX];
    now_us = 1000000;
    memset(feedback, 0, sizeof feedback);
    memset(setpoint_q32, 0, sizeof setpoint_q32);
    modbus_slave_open(&slave, is_small, is_shared, transaction_us, 20000, NULL, 0);
    for (unsigned k = 0; k < AXES; k++) {
        modbus_slave_place(&slave, k, is_small ? START_MM * 100 : wide_counts(START_MM));
    }
    modbus_slave_lines(&slave, line);
    TEST_ASSERT_EQUAL(HV_OK, modbus_drive_init(&driver, &map, line));
    hal = modbus_drive_hal(&driver);
}

/* A line each, quick. */
void setUp(void)
{
    map = modbus_maps_wide(false);
    open_slaves(false, false, 300);
}

void tearDown(void) {}

/* One line for all, as slow as RTU: a round takes 14 of these. */
static void open_shared(uint32_t transaction_us)
{
    map = modbus_maps_wide(true);
    map.expected_us = 14 * transaction_us;
    map.feedback_timeout_us = 300000;
    open_slaves(false, true, transaction_us);
}

static void enable(void)
{
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED, 3000);
}

static drive_report_t report_of(uint8_t axis)
{
    drive_report_t report;
    TEST_ASSERT_TRUE(drives_report(hal, axis, &report));
    return report;
}

/* --- Registers --- */

static void test_pack_puts_words_and_halves_where_the_map_says(void)
{
    const modbus_drive_block_t block = {0x200,
                                        6,
                                        3,
                                        0,
                                        {7, 0, 0, 0, 0, 9},
                                        {{MODBUS_DRIVE_POSITION, 1, 2, true, true},
                                         {MODBUS_DRIVE_SPEED, 3, 1, false, false},
                                         {MODBUS_DRIVE_ALARM, 4, 1, true, false}}};
    const int64_t value[MODBUS_DRIVE_VALUES] = {-2, 65535, 0, -32768};
    const uint16_t expected[6] = {7, 0xFFFE, 0xFFFF, 0xFFFF, 0x8000, 9};
    uint16_t out[MODBUS_DRIVE_REGISTERS_MAX];
    TEST_ASSERT_EQUAL(HV_OK, modbus_drive_pack(&block, value, out));
    TEST_ASSERT_EQUAL_HEX16_ARRAY(expected, out, 6);
    TEST_ASSERT_EQUAL_INT64(-2, modbus_drive_extract(&block.field[0], out));
    TEST_ASSERT_EQUAL_INT64(65535, modbus_drive_extract(&block.field[1], out));
    TEST_ASSERT_EQUAL_INT64(-32768, modbus_drive_extract(&block.field[2], out));
}

static void test_pack_high_half_first_and_unsigned(void)
{
    const modbus_drive_block_t block = {0, 2, 1, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 2, false, false}}};
    const int64_t value[MODBUS_DRIVE_VALUES] = {0xFFFE0001};
    uint16_t out[MODBUS_DRIVE_REGISTERS_MAX];
    TEST_ASSERT_EQUAL(HV_OK, modbus_drive_pack(&block, value, out));
    TEST_ASSERT_EQUAL_HEX16(0xFFFE, out[0]);
    TEST_ASSERT_EQUAL_HEX16(0x0001, out[1]);
    TEST_ASSERT_EQUAL_INT64(0xFFFE0001, modbus_drive_extract(&block.field[0], out));
}

static void test_pack_out_of_range_changes_nothing(void)
{
    const modbus_drive_block_t block = {0, 1, 1, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 1, true, false}}};
    static const int64_t k_wrong[] = {32768, -32769, INT64_MAX, INT64_MIN};
    uint16_t out[MODBUS_DRIVE_REGISTERS_MAX] = {0x1234};
    for (size_t i = 0; i < 4; i++) {
        const int64_t value[MODBUS_DRIVE_VALUES] = {k_wrong[i]};
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, modbus_drive_pack(&block, value, out));
        TEST_ASSERT_EQUAL_HEX16(0x1234, out[0]);
    }
}

/* By hand: question and answer in bytes, 11 bits each, silence of 1.75 ms above 19,200 bit/s. */
static void test_transaction_us_is_what_bytes_and_silence_take(void)
{
    const modbus_drive_timing_t fast = {115200, 11, 2000};
    const modbus_drive_timing_t slow = {9600, 10, 0};
    const modbus_drive_timing_t tcp = {0, 0, 1500};
    TEST_ASSERT_UINT32_WITHIN(2, 23 * 11 * 1000000 / 115200 + 2000 + 1750,
                              modbus_drive_transaction_us(&fast, MODBUS_WRITE_REGISTERS, 3));
    TEST_ASSERT_UINT32_WITHIN(2, 21 * 11 * 1000000 / 115200 + 2000 + 1750,
                              modbus_drive_transaction_us(&fast, MODBUS_READ_HOLDING, 4));
    TEST_ASSERT_UINT32_WITHIN(2, 16 * 10 * 1000000 / 9600 + 35 * 1000000 / 9600,
                              modbus_drive_transaction_us(&slow, MODBUS_WRITE_REGISTER, 1));
    TEST_ASSERT_EQUAL_UINT32(1500, modbus_drive_transaction_us(&tcp, MODBUS_READ_INPUT, 60));
}

static void test_round_us_is_all_drives_of_a_line_and_no_less_than_the_period(void)
{
    const modbus_drive_timing_t tcp = {0, 0, 1500};
    TEST_ASSERT_EQUAL_UINT32(6 * 2 * 1500, modbus_drive_round_us(&map, &tcp, 6));
    map.period_us = 50000;
    TEST_ASSERT_EQUAL_UINT32(50000, modbus_drive_round_us(&map, &tcp, 6));
}

/* --- Start-up --- */

static void test_startup_writes_and_reads_back_before_a_drive_is_ready(void)
{
    await(DRIVE_DISABLED, 100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT16(50, slave.device[k].holding[20]);
    }
    TEST_ASSERT_EQUAL_STRING("ready", report_of(0).phase);
    TEST_ASSERT_EQUAL_UINT8(1, report_of(0).address);
}

static void test_startup_takes_torque_off_a_drive_that_was_left_with_it(void)
{
    slave.drive[3].is_enabled = true;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_FALSE(slave.drive[3].is_enabled);
}

static void test_startup_wrong_value_is_refused_by_name_and_taken_when_mended(void)
{
    map.item[0].value = 0x0204;
    cycles(100);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_VALUE, feedback[2].fault_code);
    TEST_ASSERT_EQUAL_STRING("refused", report_of(2).phase);
    TEST_ASSERT_EQUAL_STRING("a register holds another value", report_of(2).trouble);
    TEST_ASSERT_EQUAL_HEX32(21 << 8, report_of(2).object);
    map.item[0].value = 0x0203;
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(hal, DRIVES_DISABLE));
    await(DRIVE_DISABLED, 3000);
}

static void test_startup_missing_register_is_refused_with_the_exception(void)
{
    map.item[1].address = 5000;
    cycles(100);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_EXCEPTION, feedback[0].fault_code);
    TEST_ASSERT_EQUAL_STRING("no such register", report_of(0).detail);
    TEST_ASSERT_EQUAL_HEX32(5000 << 8, report_of(0).object);
}

static void test_startup_item_that_is_not_checked_may_read_as_it_likes(void)
{
    map.item[1] = (modbus_drive_item_t){21, 0x0999, true, false}; /* the slave puts its own value back */
    await(DRIVE_DISABLED, 100);
}

static void test_startup_drive_that_comes_late_is_found(void)
{
    slave.drive[6].is_on = false;
    cycles(1000);
    TEST_ASSERT_EQUAL_STRING("waiting for the line", report_of(6).phase);
    TEST_ASSERT_EQUAL_STRING("no answer", report_of(6).trouble);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[5].state);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    slave.drive[6].is_on = true;
    await(DRIVE_DISABLED, 1000);
}

static void test_startup_torque_off_that_was_refused_is_tried_again(void)
{
    map.command[MODBUS_DRIVE_DISABLE].block[0].address = 5000;
    slave.drive[3].is_enabled = true;
    cycles(100);
    TEST_ASSERT_EQUAL_STRING("refused", report_of(3).phase);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_EXCEPTION, feedback[3].fault_code);
    TEST_ASSERT_EQUAL_UINT8(0, driver.axis[3].write.failures);
    map.command[MODBUS_DRIVE_DISABLE].block[0].address = 0;
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_FALSE(slave.drive[3].is_enabled);
}

static void test_startup_drive_with_an_alarm_is_never_ready(void)
{
    slave.drive[4].is_faulty = true;
    for (int i = 0; i < 100; i++) {
        (void)!cycle();
        TEST_ASSERT_TRUE(feedback[4].state == DRIVE_OFFLINE || feedback[4].state == DRIVE_FAULT);
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[4].state);
    TEST_ASSERT_EQUAL_HEX32(0x0E21, feedback[4].fault_code);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[5].state);
}

/* --- Enabling --- */

static void test_enable_with_an_old_target_in_the_register_makes_no_step(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        slave.device[k].holding[10] = 7;
        slave.device[k].holding[11] = 7;
    }
    enable();
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(0, slave.drive[k].largest_step);
        TEST_ASSERT_EQUAL_INT32(wide_counts(START_MM), slave.drive[k].position);
    }
}

static void test_enable_one_drive_without_torque_keeps_all_waiting(void)
{
    slave.drive[4].is_weak = true;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(500);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLING));
    TEST_ASSERT_EQUAL_STRING("waits for its torque", report_of(4).phase);
    TEST_ASSERT_EQUAL_STRING("waits for all drives", report_of(3).phase);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    await(DRIVE_DISABLED, 100);
    cycles(20);
    TEST_ASSERT_FALSE(slave.drive[3].is_enabled);
}

/* The register holds an old target, which must neither be touched before torque nor be the first that is written. */
static void test_enable_target_last_writes_it_after_torque_only(void)
{
    map.is_target_last = true;
    await(DRIVE_DISABLED, 100);
    for (unsigned k = 0; k < AXES; k++) {
        slave.drive[k].is_frozen = true;
        slave.device[k].holding[10] = 7;
        slave.device[k].holding[11] = 7;
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    for (int i = 0; i < 300 && !are_all(DRIVE_ENABLED); i++) {
        bool had_torque[AXES];
        for (unsigned k = 0; k < AXES; k++) {
            had_torque[k] = slave.drive[k].is_enabled;
        }
        (void)!cycle();
        follow_actual();
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(had_torque[k] || slave.device[k].holding[11] == 7);
        }
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(wide_counts(START_MM), slave.drive[k].target);
    }
}

static void test_enable_target_last_waits_for_torque(void)
{
    map.is_target_last = true;
    slave.drive[3].is_frozen = true; /* else it follows the old target */
    slave.drive[4].is_weak = true;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(500);
    TEST_ASSERT_EQUAL_STRING("waits for its torque", report_of(4).phase);
    TEST_ASSERT_EQUAL_STRING("waits for all drives", report_of(3).phase);
    TEST_ASSERT_EQUAL_UINT16(0, slave.device[4].holding[11]);
}

static void test_torque_lost_is_disabled(void)
{
    enable();
    slave.drive[2].is_enabled = false;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[2].state);
}

static void test_alarm_is_the_fault_code(void)
{
    enable();
    slave.drive[2].is_faulty = true;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(0x0E21, feedback[2].fault_code);
    TEST_ASSERT_EQUAL_STRING("its own alarm", report_of(2).trouble);
}

/* --- What a slow line is asked --- */

/* All axes at a speed, in mm per cycle, for so many cycles; the first one faster by `more` eighths. */
static void move(q32_t per_cycle_q32, int more, int count)
{
    while (count-- > 0) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += per_cycle_q32 + (k == 0 ? per_cycle_q32 * more / 8 : 0);
        }
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
}

/* A drive that was moved by hand since it last followed. */
static void test_enable_target_last_begins_where_the_drive_is_now(void)
{
    map.is_target_last = true;
    for (unsigned k = 0; k < AXES; k++) {
        slave.device[k].holding[10] = (uint16_t)((uint32_t)wide_counts(START_MM) >> 16);
        slave.device[k].holding[11] = (uint16_t)wide_counts(START_MM);
    }
    enable();
    move(MM(1) / 50, 0, 50);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    await(DRIVE_DISABLED, 200);
    for (unsigned k = 0; k < AXES; k++) {
        modbus_slave_place(&slave, k, slave.drive[k].position - 10000);
        slave.drive[k].is_frozen = true;
    }
    cycles(20);
    follow_actual();
    enable();
}

static void test_slow_line_gets_the_newest_setpoint_and_no_backlog(void)
{
    open_shared(4000);
    enable();
    cycles(300);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    const uint32_t before = slave.line[0].transactions;
    move(MM(1) / 50, 0, 1000); /* 20 mm/s */
    const uint32_t transactions = slave.line[0].transactions - before;
    TEST_ASSERT_UINT32_WITHIN(3, 250, transactions);  /* the line is never asked for more than it has time for */
    TEST_ASSERT_TRUE(slave.line[0].replaced > 1000u); /* what waited was replaced by what was newer */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_UINT32_WITHIN(4, 1000 / 56 + 0, slave.drive[k].targets);
    }
    cycles(180); /* three rounds: the mean, its turn, the way there */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_INT32_WITHIN(1, wide_counts(START_MM + 20), slave.drive[k].target);
    }
}

static void test_slow_line_is_measured(void)
{
    open_shared(4000);
    map.expected_us = 20000; /* wrong on purpose */
    enable();
    TEST_ASSERT_EQUAL_UINT32(0, report_of(0).period_us);
    cycles(3000);
    for (uint8_t k = 0; k < AXES; k++) {
        const drive_report_t report = report_of(k);
        TEST_ASSERT_UINT32_WITHIN(3000, 56000, report.period_us);
        TEST_ASSERT_TRUE(report.setpoint_us <= now_us && now_us - report.setpoint_us <= 60000);
    }
}

/* 100 mm/s on a line of 56 ms is 5.6 mm per set-point: more than the 4 mm that it may be. */
static void test_slow_line_paces_all_axes_alike(void)
{
    open_shared(4000);
    for (unsigned k = 0; k < AXES; k++) {
        map.axis[k].following_max_q32 = 0;
    }
    enable();
    cycles(500);
    move(MM(1) / 10, 4, 400);
    TEST_ASSERT_TRUE(driver.paced > 300);
    const int32_t slow = wide_counts(START_MM) - slave.drive[1].target;
    const int32_t fast = wide_counts(START_MM) - slave.drive[0].target;
    TEST_ASSERT_INT32_WITHIN(4 * 10000 / 3, slow * 12 / 8, fast); /* their proportion, but for one set-point */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_LESS_THAN_INT32(5 * 10000 / 3, slave.drive[k].largest_step);
    }
}

static void test_pace_unlimited_where_carry_is_none(void)
{
    map = modbus_maps_wide(true);
    for (unsigned k = 0; k < AXES; k++) {
        map.axis[k].carry_q32 = 0;
    }
    map.feedback_timeout_us = 300000;
    open_slaves(false, true, 4000);
    enable();
    move(MM(1) / 10, 0, 400);
    TEST_ASSERT_EQUAL_UINT32(0, driver.paced);
}

/* 50 mm/s is 500 counts of speed; an eighth more of it. */
static void test_speed_register_fits_the_period_of_the_line(void)
{
    open_shared(2000);
    enable();
    cycles(500);
    move(MM(1) / 20, 0, 600);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_UINT16_WITHIN(60, 562, slave.drive[k].speed);
    }
    cycles(200);
    TEST_ASSERT_EQUAL_UINT16(0, slave.drive[0].speed);
}

/* 50 mm/s again, but a drive that takes more than 40 mm/s for an alarm. */
static void test_speed_register_keeps_below_its_limit(void)
{
    open_shared(2000);
    for (unsigned k = 0; k < AXES; k++) {
        map.axis[k].speed_max_q32 = MM(40);
    }
    enable();
    cycles(500);
    move(MM(1) / 20, 0, 600);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT16(400, slave.drive[k].speed);
    }
}

/* A wave that is quicker than the line: what is written is its mean, not samples of it. */
static void test_smoothing_takes_out_what_the_line_cannot_carry(void)
{
    open_shared(4000);
    enable();
    cycles(300);
    int32_t low = INT32_MAX, high = INT32_MIN;
    const q32_t middle_q32 = setpoint_q32[0];
    for (int i = 0; i < 2000; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] = middle_q32 + (i / 4 % 2 == 0 ? MM(1) / 4 : -MM(1) / 4);
        }
        TEST_ASSERT_EQUAL(HV_OK, cycle());
        low = i > 200 && slave.drive[0].target < low ? slave.drive[0].target : low;
        high = i > 200 && slave.drive[0].target > high ? slave.drive[0].target : high;
    }
    TEST_ASSERT_TRUE(high - low < 10000 / 3 / 8); /* 0.5 mm from top to bottom, sampled: now less than a quarter of it */
}

/* --- What goes wrong --- */

static sim_modbus_fault_t plan[40];

static void plan_next(sim_modbus_fault_kind_t kind, unsigned k, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        plan[i] = (sim_modbus_fault_t){.kind = kind, .at = slave.line[k].transactions + 1 + i, .code = 4};
    }
    slave.line[k].plan = plan;
    slave.line[k].planned = count;
}

static void test_failures_within_the_retries_are_borne(void)
{
    static const sim_modbus_fault_kind_t k_kinds[] = {SIM_MODBUS_EXCEPTION, SIM_MODBUS_SILENT, SIM_MODBUS_LATE,
                                                      SIM_MODBUS_DAMAGED, SIM_MODBUS_NO_LINK};
    enable();
    for (size_t i = 0; i < 5; i++) {
        plan_next(k_kinds[i], 1, 2);
        move(MM(1) / 50, 0, 100);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    }
    TEST_ASSERT_EQUAL_UINT32(10, driver.failures);
}

static void test_failures_beyond_the_retries_are_offline_with_their_reason(void)
{
    static const struct {
        sim_modbus_fault_kind_t kind;
        uint32_t code;
    } k_rows[] = {{SIM_MODBUS_EXCEPTION, MODBUS_DRIVE_EXCEPTION},
                  {SIM_MODBUS_SILENT, MODBUS_DRIVE_NO_ANSWER},
                  {SIM_MODBUS_LATE, MODBUS_DRIVE_NO_ANSWER},
                  {SIM_MODBUS_DAMAGED, MODBUS_DRIVE_DAMAGED},
                  {SIM_MODBUS_NO_LINK, MODBUS_DRIVE_NO_LINK}};
    for (size_t i = 0; i < 5; i++) {
        setUp();
        enable();
        plan_next(k_rows[i].kind, 1, 40);
        for (int n = 0; n < 200 && feedback[1].state != DRIVE_OFFLINE; n++) {
            (void)!cycle();
        }
        TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[1].state);
        TEST_ASSERT_EQUAL_HEX32(k_rows[i].code, feedback[1].fault_code);
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
    }
}

/* A worker that is stuck says nothing at all. */
static void test_feedback_too_old_is_offline(void)
{
    enable();
    const uint64_t start_us = now_us;
    while (feedback[0].state != DRIVE_OFFLINE && now_us - start_us < 1000000) {
        now_us += CYCLE_US;
        (void)!drives_poll(hal, now_us, feedback);
        (void)!drives_send(hal, now_us, setpoint_q32);
    }
    TEST_ASSERT_TRUE(now_us - start_us >= 195000 && now_us - start_us <= 206000);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_OLD, feedback[0].fault_code);
}

/* On a shared line a dead drive costs the others time, but not their set-points. */
static void test_silent_drive_on_a_shared_line_leaves_the_others_alive(void)
{
    open_shared(1000);
    enable();
    slave.drive[5].is_on = false;
    for (int i = 0; i < 2000 && feedback[5].state != DRIVE_OFFLINE; i++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[5].state);
    const uint32_t before = driver.setpoints;
    cycles(1000);
    TEST_ASSERT_TRUE(driver.setpoints - before > 6 * 50);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(k == 5 ? DRIVE_OFFLINE : DRIVE_ENABLED, feedback[k].state);
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(k == 5 ? 0 : 1, slave.drive[k].stops);
    }
}

static void test_quick_stop_replaces_the_setpoint_that_waits(void)
{
    open_shared(4000);
    enable();
    move(MM(1) / 50, 0, 200);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    const uint32_t before = slave.drive[3].targets;
    for (int i = 0; i < 70; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 50;
        }
        (void)!cycle();
    }
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, slave.drive[k].stops);
        TEST_ASSERT_FALSE(slave.drive[k].is_enabled);
    }
    TEST_ASSERT_TRUE(slave.drive[3].targets <= before + 1);
}

static void test_quick_stop_by_broadcast_reaches_all_drives_at_once(void)
{
    open_shared(4000);
    map.is_broadcast = true;
    enable();
    move(MM(1) / 50, 0, 200);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(13); /* what is on the wire, a read, and the broadcast */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_FALSE(slave.drive[k].is_enabled);
    }
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(slave.drive[k].stops >= 2); /* and each by itself */
    }
}

static void test_setpoint_far_from_a_drive_that_hangs_is_a_fault(void)
{
    map.axis[2].following_max_q32 = MM(3);
    enable();
    slave.drive[2].is_frozen = true;
    move(MM(1) / 50, 0, 300);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_FOLLOWING, feedback[2].fault_code);
    TEST_ASSERT_EQUAL_UINT32(1, slave.drive[2].stops);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[2].state);
}

static void test_reset_of_a_drive_that_stays_faulty_ends_in_fault(void)
{
    await(DRIVE_DISABLED, 100);
    map.command[MODBUS_DRIVE_RESET].count = 0;
    slave.drive[1].is_faulty = true;
    cycles(20);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(1100);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    slave.drive[1].is_faulty = false;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state); /* nothing comes back by itself */
}

static void test_setpoint_that_does_not_fit_its_register_is_a_fault(void)
{
    map = modbus_maps_small(true);
    for (unsigned k = 0; k < AXES; k++) {
        map.axis[k].following_max_q32 = 0;
        map.axis[k].carry_q32 = 0;
    }
    open_slaves(true, true, 150);
    for (unsigned k = 0; k < AXES; k++) {
        modbus_slave_place(&slave, k, 32700);
    }
    enable();
    move(MM(1) / 10, 0, 50); /* 327.67 mm are the end of 16 bits */
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_TRUE(slave.drive[0].target <= 32767 && slave.drive[0].target >= 32700);
}

/* --- Maps --- */

static hv_status_t init_status(void)
{
    hal_modbus_t line[DRIVES_MAX];
    modbus_slave_lines(&slave, line);
    return modbus_drive_init(&driver, &map, line);
}

static void refuse(int row)
{
    map = modbus_maps_wide(false);
    switch (row) {
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
        map.feedback_timeout_us = map.period_us;
        break;
    case 4:
        map.setpoint.count = 0;
        break;
    case 5:
        map.feedback.count = 0;
        break;
    case 6:
        map.setpoint.block[0].count = 2; /* the speed is beyond it */
        break;
    case 7:
        map.setpoint.block[0].address = 65534;
        break;
    case 8:
        map.setpoint.block[0].field[1].value = MODBUS_DRIVE_STATUS;
        break;
    case 9:
        map.command[MODBUS_DRIVE_HOME].block[0].fields = 1;
        break;
    case 10:
        map.homing_done.mask = 0;
        break;
    case 11:
        map.feedback.block[0].field[0].value = MODBUS_DRIVE_ALARM; /* nothing to judge by */
        break;
    case 12:
        map.axis[3].unit = 0;
        break;
    case 13:
        map.axis[3].unit = 248;
        break;
    case 14:
        map.axis[3].line = 2; /* unit 1 is there already */
        break;
    case 15:
        map.axis[3].line = DRIVES_MAX;
        break;
    case 16:
        map.axis[3].scale.num = 0;
        break;
    case 17:
        map.axis[3].step_max_q32 = 0;
        break;
    case 18:
        map.item[0].is_checked = false; /* neither written nor looked at */
        break;
    case 19:
        map.axis[3].speed_max_q32 = 0;
        break;
    default:
        map.items = MODBUS_DRIVE_STARTUP_MAX + 1;
        break;
    }
}

static void test_init_map_that_contradicts_itself_is_refused(void)
{
    for (int row = 0; row < 21; row++) {
        refuse(row);
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, init_status(), "row");
    }
    map = modbus_maps_wide(false);
    TEST_ASSERT_EQUAL(HV_OK, init_status());
}

static void test_init_line_that_is_missing_is_refused(void)
{
    hal_modbus_t line[DRIVES_MAX];
    modbus_slave_lines(&slave, line);
    line[4].ops = NULL;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, modbus_drive_init(&driver, &map, line));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_pack_puts_words_and_halves_where_the_map_says);
    RUN_TEST(test_pack_high_half_first_and_unsigned);
    RUN_TEST(test_pack_out_of_range_changes_nothing);
    RUN_TEST(test_transaction_us_is_what_bytes_and_silence_take);
    RUN_TEST(test_round_us_is_all_drives_of_a_line_and_no_less_than_the_period);
    RUN_TEST(test_startup_writes_and_reads_back_before_a_drive_is_ready);
    RUN_TEST(test_startup_takes_torque_off_a_drive_that_was_left_with_it);
    RUN_TEST(test_startup_wrong_value_is_refused_by_name_and_taken_when_mended);
    RUN_TEST(test_startup_missing_register_is_refused_with_the_exception);
    RUN_TEST(test_startup_item_that_is_not_checked_may_read_as_it_likes);
    RUN_TEST(test_startup_drive_that_comes_late_is_found);
    RUN_TEST(test_startup_torque_off_that_was_refused_is_tried_again);
    RUN_TEST(test_startup_drive_with_an_alarm_is_never_ready);
    RUN_TEST(test_enable_with_an_old_target_in_the_register_makes_no_step);
    RUN_TEST(test_enable_one_drive_without_torque_keeps_all_waiting);
    RUN_TEST(test_enable_target_last_writes_it_after_torque_only);
    RUN_TEST(test_enable_target_last_begins_where_the_drive_is_now);
    RUN_TEST(test_enable_target_last_waits_for_torque);
    RUN_TEST(test_torque_lost_is_disabled);
    RUN_TEST(test_alarm_is_the_fault_code);
    RUN_TEST(test_slow_line_gets_the_newest_setpoint_and_no_backlog);
    RUN_TEST(test_slow_line_is_measured);
    RUN_TEST(test_slow_line_paces_all_axes_alike);
    RUN_TEST(test_pace_unlimited_where_carry_is_none);
    RUN_TEST(test_speed_register_fits_the_period_of_the_line);
    RUN_TEST(test_speed_register_keeps_below_its_limit);
    RUN_TEST(test_smoothing_takes_out_what_the_line_cannot_carry);
    RUN_TEST(test_failures_within_the_retries_are_borne);
    RUN_TEST(test_failures_beyond_the_retries_are_offline_with_their_reason);
    RUN_TEST(test_feedback_too_old_is_offline);
    RUN_TEST(test_silent_drive_on_a_shared_line_leaves_the_others_alive);
    RUN_TEST(test_quick_stop_replaces_the_setpoint_that_waits);
    RUN_TEST(test_quick_stop_by_broadcast_reaches_all_drives_at_once);
    RUN_TEST(test_setpoint_far_from_a_drive_that_hangs_is_a_fault);
    RUN_TEST(test_reset_of_a_drive_that_stays_faulty_ends_in_fault);
    RUN_TEST(test_setpoint_that_does_not_fit_its_register_is_a_fault);
    RUN_TEST(test_init_map_that_contradicts_itself_is_refused);
    RUN_TEST(test_init_line_that_is_missing_is_refused);
    return UNITY_END();
}

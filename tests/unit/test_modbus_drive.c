/* SPDX-License-Identifier: MIT
 * test_modbus_drive.c - drives on Modbus against registers written from a list alone: start-up, enabling without a step, what a
 * slow line is asked, failures within and beyond the retries, stops, maps that contradict themselves.
 */
#include "heave/modbus_drive.h"

#include <string.h>

#include "modbus_drives.h"
#include "modbus_maps.h"
#include "unity.h"

#define AXES     DRIVES_MAX
#define CYCLE_US 1000u
#define MM(x)    ((q32_t)(x)*Q32_ONE)
#define START_MM 150

static modbus_drives_t slave;
static modbus_drive_map_t map;
static modbus_drive_t driver;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];

static int32_t wide_counts(int32_t mm)
{
    return MODBUS_DRIVES_WIDE_ZERO - (mm * 10000 + 1) / 3;
}

static hv_status_t cycle(void)
{
    now_us += CYCLE_US;
    modbus_drives_step(&slave, now_us);
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
    modbus_drives_open(&slave, is_small, is_shared, transaction_us, 20000);
    for (unsigned k = 0; k < AXES; k++) {
        modbus_drives_place(&slave, k, is_small ? START_MM * 100 : wide_counts(START_MM));
    }
    modbus_drives_lines(&slave, line);
    TEST_ASSERT_EQUAL(HV_OK, modbus_drive_init(&driver, &map, line));
    hal = modbus_drive_hal(&driver);
}

/* What its registers hold from before. */
static void set_old_target(unsigned k, int32_t counts)
{
    slave.asked[k].target = counts;
    register_drive_find(&slave.twin[k], 10)->value = (uint16_t)((uint32_t)counts >> 16);
    register_drive_find(&slave.twin[k], 11)->value = (uint16_t)counts;
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

/* Of function 6 and of input registers: the other dialect. */
static void test_round_us_knows_what_is_read_and_written_how(void)
{
    const modbus_drive_timing_t line = {19200, 10, 0};
    const uint32_t bits = (16 + 8 + 5 + 2 * 2) * 10;
    const uint32_t silences_us = 2 * 35 * 1000000 / 19200;
    modbus_drive_map_t small = modbus_maps_small(true);
    TEST_ASSERT_UINT32_WITHIN(4, bits * 10000 / 192 + silences_us, modbus_drive_round_us(&small, &line, 1));
    small.setpoint.block[0].count = 2; /* two at once go by function 16 */
    TEST_ASSERT_UINT32_WITHIN(4, (bits + 50) * 10000 / 192 + silences_us, modbus_drive_round_us(&small, &line, 1));
}

/* --- Start-up --- */

static void test_startup_writes_and_reads_back_before_a_drive_is_ready(void)
{
    await(DRIVE_DISABLED, 100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT16(50, modbus_drives_register(&slave, k, 20));
    }
    TEST_ASSERT_EQUAL_STRING("ready", report_of(0).phase);
    TEST_ASSERT_EQUAL_UINT8(1, report_of(0).address);
}

static void test_startup_takes_torque_off_a_drive_that_was_left_with_it(void)
{
    modbus_drives_command(&slave, 3, MODBUS_DRIVE_ENABLE);
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_FALSE(slave.motor[3].has_torque);
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
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
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
    map.item[1] = (modbus_drive_item_t){21, 0x0999, true, false};
    slave.map.item[0].is_written = true;
    for (unsigned k = 0; k < AXES; k++) {
        register_drive_find(&slave.twin[k], 21)->is_held = true; /* it goes on with its own value */
    }
    await(DRIVE_DISABLED, 100);
}

static void test_startup_names_the_register_it_is_at(void)
{
    open_shared(4000);
    for (int i = 0; i < 500 && report_of(0).object == 0; i++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL_STRING("starting up", report_of(0).phase);
    TEST_ASSERT_EQUAL_HEX32(21 << 8, report_of(0).object);
}

static void test_startup_refused_drive_begins_again_at_once_by_a_reset_and_by_nothing_else(void)
{
    await(DRIVE_DISABLED, 100);
    map.item[1].address = 5000;
    modbus_drives_power(&slave, 2, false);
    cycles(500);
    modbus_drives_power(&slave, 2, true);
    for (int i = 0; i < 1000 && strcmp(report_of(2).phase, "refused") != 0; i++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL_STRING("refused", report_of(2).phase);
    map.item[1].address = 20;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    cycles(50);
    TEST_ASSERT_EQUAL_STRING("refused", report_of(2).phase);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 50);
}

static void test_startup_without_anything_to_switch_off_or_to_write(void)
{
    map.command[MODBUS_DRIVE_DISABLE].count = 0;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL_UINT16(50, modbus_drives_register(&slave, 3, 20));
    setUp();
    map.items = 0;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL_UINT16(0, modbus_drives_register(&slave, 3, 20));
}

static void test_startup_exceptions_have_words(void)
{
    static const struct {
        uint8_t code;
        const char *words;
    } k_rows[] = {{4, "it failed to do so"},
                  {9, "another code"},
                  {10, "the gateway in between has no path to it"},
                  {11, "the gateway in between gets no answer from it"},
                  {12, "another code"},
                  {255, "another code"}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        const sim_modbus_fault_t plan[] = {{SIM_MODBUS_EXCEPTION, 1, k_rows[i].code}};
        setUp();
        slave.line[4].plan = plan;
        slave.line[4].planned = 1;
        cycles(50);
        TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_EXCEPTION, feedback[4].fault_code);
        TEST_ASSERT_EQUAL_STRING(k_rows[i].words, report_of(4).detail);
        TEST_ASSERT_EQUAL_UINT32(k_rows[i].code, report_of(4).detail_code);
    }
}

/* Drives that refuse, or that nobody understands, are no lost line: each of them says what is wrong. */
static void test_all_that_answer_strangely_are_no_lost_line(void)
{
    static const struct {
        sim_modbus_fault_kind_t kind;
        hv_status_t status;
        uint32_t code;
    } k_rows[] = {{SIM_MODBUS_EXCEPTION, HV_OK, MODBUS_DRIVE_EXCEPTION},
                  {SIM_MODBUS_DAMAGED, HV_OK, MODBUS_DRIVE_DAMAGED},
                  {SIM_MODBUS_SILENT, HV_ERR_IO, MODBUS_DRIVE_NO_ANSWER}};
    static sim_modbus_fault_t plan[3000];
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        hv_status_t status = HV_OK;
        setUp();
        await(DRIVE_DISABLED, 100);
        for (uint32_t n = 0; n < sizeof plan / sizeof plan[0]; n++) { /* from here on all of them */
            plan[n] = (sim_modbus_fault_t){k_rows[i].kind, n + 1u, 4};
        }
        for (unsigned k = 0; k < AXES; k++) {
            slave.line[k].plan = plan;
            slave.line[k].planned = sizeof plan / sizeof plan[0];
        }
        for (unsigned n = 0; n < 600; n++) {
            status = cycle();
        }
        TEST_ASSERT_EQUAL(k_rows[i].status, status);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[k].state);
            TEST_ASSERT_EQUAL_HEX32(k_rows[i].code, feedback[k].fault_code);
        }
    }
}

static hal_modbus_ops_t odd_ops;
static uint8_t odd_count; /* of the answers of line 2; 0: as it is */
static bool is_write_lost;

static hv_status_t odd_poll(void *ctx, unsigned slot, modbus_result_t *result)
{
    const hv_status_t status = sim_modbus_hal(ctx).ops->poll(ctx, slot, result);
    if (status == HV_OK && result->status == HV_OK && ctx == &slave.line[2] && odd_count != 0 && result->count != 0) {
        result->count = odd_count;
    }
    return status;
}

static hv_status_t odd_submit(void *ctx, unsigned slot, const modbus_request_t *request)
{
    const bool is_lost = is_write_lost && modbus_is_write(request->function);
    return is_lost ? HV_OK : sim_modbus_hal(ctx).ops->submit(ctx, slot, request);
}

/* A line whose answers are too short, or that loses what is written. */
static void make_odd(void)
{
    odd_ops = (hal_modbus_ops_t){odd_submit, odd_poll};
    odd_count = 0;
    is_write_lost = false;
    for (unsigned k = 0; k < AXES; k++) {
        driver.line[k].ops = &odd_ops;
    }
}

static void test_answers_of_another_length_are_damaged(void)
{
    make_odd();
    odd_count = 2; /* of feedback */
    cycles(100);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_DAMAGED, feedback[2].fault_code);
    TEST_ASSERT_FALSE(feedback[2].has_actual);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[3].state);
    odd_count = 4; /* right for feedback, not for what is read back */
    cycles(600);
    TEST_ASSERT_TRUE(feedback[2].has_actual);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_VALUE, feedback[2].fault_code);
}

static void test_startup_drive_that_comes_late_is_found(void)
{
    modbus_drives_power(&slave, 6, false);
    cycles(1000);
    TEST_ASSERT_EQUAL_STRING("waiting for the line", report_of(6).phase);
    TEST_ASSERT_EQUAL_STRING("no answer", report_of(6).trouble);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[5].state);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT)); /* there is nothing to begin again yet */
    TEST_ASSERT_EQUAL_STRING("waiting for the line", report_of(6).phase);
    modbus_drives_power(&slave, 6, true);
    await(DRIVE_DISABLED, 1000);
}

static void test_startup_torque_off_that_was_refused_is_tried_again(void)
{
    map.command[MODBUS_DRIVE_DISABLE].block[0].address = 5000;
    modbus_drives_command(&slave, 3, MODBUS_DRIVE_ENABLE);
    cycles(100);
    TEST_ASSERT_EQUAL_STRING("refused", report_of(3).phase);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_EXCEPTION, feedback[3].fault_code);
    TEST_ASSERT_EQUAL_UINT8(0, driver.axis[3].write.failures);
    map.command[MODBUS_DRIVE_DISABLE].block[0].address = 0;
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_FALSE(slave.motor[3].has_torque);
}

static void test_startup_drive_with_an_alarm_is_never_ready(void)
{
    register_drive_fault(&slave.twin[4], MODBUS_DRIVES_ALARM);
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
        set_old_target(k, 0x70007);
    }
    enable();
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(0, slave.asked[k].largest_step);
        TEST_ASSERT_EQUAL_INT32(wide_counts(START_MM), register_drive_count(&slave.twin[k]));
    }
}

static void test_enable_one_drive_without_torque_keeps_all_waiting(void)
{
    slave.asked[4].is_weak = true;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(500);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLING));
    TEST_ASSERT_EQUAL_STRING("waits for its torque", report_of(4).phase);
    TEST_ASSERT_EQUAL_STRING("waits for all drives", report_of(3).phase);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    await(DRIVE_DISABLED, 100);
    cycles(20);
    TEST_ASSERT_FALSE(slave.motor[3].has_torque);
}

/* The register holds an old target, which must neither be touched before torque nor be the first that is written. */
static void test_enable_target_last_writes_it_after_torque_only(void)
{
    map.is_target_last = true;
    await(DRIVE_DISABLED, 100);
    for (unsigned k = 0; k < AXES; k++) {
        slave.motor[k].is_jammed = true;
        set_old_target(k, 0x70007);
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    for (int i = 0; i < 300 && !are_all(DRIVE_ENABLED); i++) {
        bool had_torque[AXES];
        for (unsigned k = 0; k < AXES; k++) {
            had_torque[k] = slave.motor[k].has_torque;
        }
        (void)!cycle();
        follow_actual();
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(had_torque[k] || modbus_drives_register(&slave, k, 11) == 7);
        }
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(wide_counts(START_MM), slave.asked[k].target);
    }
}

static void test_enable_target_last_waits_for_torque(void)
{
    map.is_target_last = true;
    slave.asked[4].is_weak = true;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(500);
    TEST_ASSERT_EQUAL_STRING("waits for its torque", report_of(4).phase);
    TEST_ASSERT_EQUAL_STRING("waits for all drives", report_of(3).phase);
    TEST_ASSERT_EQUAL_UINT16(0, modbus_drives_register(&slave, 4, 11));
}

static void test_torque_lost_is_disabled(void)
{
    enable();
    register_drive_drop(&slave.twin[2]);
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[2].state);
}

/* While it waits for the others. */
static void test_torque_lost_before_all_have_it_is_disabled(void)
{
    slave.asked[4].is_weak = true;
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(200);
    TEST_ASSERT_EQUAL_STRING("waits for all drives", report_of(3).phase);
    register_drive_drop(&slave.twin[3]);
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[3].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLING, feedback[2].state);
}

static void test_enable_again_is_for_those_that_are_not(void)
{
    enable();
    register_drive_drop(&slave.twin[2]);
    cycles(20);
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    (void)!cycle();
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[1].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLING, feedback[2].state);
    await(DRIVE_ENABLED, 200);
    TEST_ASSERT_EQUAL_INT32(0, slave.asked[2].largest_step);
}

/* Nothing to switch it on with, and nothing that tells: torque is believed of a drive that answers. */
static void test_enable_where_the_map_knows_no_torque(void)
{
    map.command[MODBUS_DRIVE_ENABLE].count = 0;
    map.enabled_when.mask = 0;
    for (unsigned k = 0; k < AXES; k++) {
        set_old_target(k, 7);
    }
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    await(DRIVE_ENABLED, 100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(wide_counts(START_MM), slave.asked[k].target);
    }
}

static void test_alarm_is_a_fault_where_no_status_tells(void)
{
    map.fault_when.mask = 0;
    enable();
    register_drive_fault(&slave.twin[2], MODBUS_DRIVES_ALARM);
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(0x0E21, feedback[2].fault_code);
}

/* A code is never 0, as that would be no fault; and a large one is still the drive's own. */
static void test_fault_code_of_the_drive_may_be_any(void)
{
    map.fault_when = (canraw_when_t){0, 0xFFFF};
    slave.twin[2].is_homed = false;
    cycles(100);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(1, feedback[2].fault_code);
    setUp();
    map.feedback.block[0].field[2] = (modbus_drive_field_t){MODBUS_DRIVE_ALARM, 2, 2, false, false};
    register_drive_fault(&slave.twin[2], MODBUS_DRIVES_ALARM);
    cycles(100);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32((uint32_t)modbus_drives_register(&slave, 2, 3) << 16 | 0x0E21, feedback[2].fault_code);
    TEST_ASSERT_EQUAL_STRING("its own alarm", report_of(2).trouble);
}

/* Whatever was to be written but a stop is forgotten with a fault. */
static void test_fault_while_being_enabled_gets_no_torque_later(void)
{
    open_shared(4000);
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    while (!slave.line[0].is_busy || slave.line[0].on_wire != 2 * 2 || driver.axis[2].phase != MODBUS_DRIVE_PLACING) {
        (void)!cycle();
    }
    register_drive_fault(&slave.twin[2], MODBUS_DRIVES_ALARM); /* its target is on the wire */
    for (int i = 0; i < 10 && driver.axis[2].phase == MODBUS_DRIVE_PLACING; i++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL_STRING("being enabled", report_of(2).phase);
    for (int i = 0; i < 100 && feedback[2].state != DRIVE_FAULT; i++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL(MODBUS_DRIVE_NO_JOB, driver.axis[2].job);
    cycles(200);
    modbus_drives_command(&slave, 2, MODBUS_DRIVE_RESET);
    cycles(200);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_FALSE(slave.motor[2].has_torque);
}

static bool has_any_torque(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        if (slave.motor[k].has_torque) {
            return true;
        }
    }
    return false;
}

/* Wherever the line is with its turns. */
static void test_fault_while_a_stop_is_on_its_way_does_not_hold_it_up(void)
{
    for (int i = 0; i < 56; i++) {
        open_shared(4000);
        enable();
        cycles(i / 2);
        for (unsigned k = 0; k < AXES; k++) {
            register_drive_fault(&slave.twin[k], MODBUS_DRIVES_ALARM);
        }
        cycles(1);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, i % 2 == 0 ? DRIVES_QUICK_STOP : DRIVES_DISABLE));
        TEST_ASSERT_TRUE(drives_is_stopping(hal));
        (void)!drives_poll(hal, now_us, feedback);
        TEST_ASSERT_TRUE(feedback[6].state == DRIVE_FAULT || strcmp(report_of(6).phase, "stopping") == 0);
        for (int n = 0; n < 600; n++) {
            (void)!cycle();
            TEST_ASSERT_TRUE(drives_is_stopping(hal) || !has_any_torque());
        }
        TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
        TEST_ASSERT_FALSE(drives_is_stopping(hal));
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL_UINT32(i % 2 == 0 ? 1 : 0, slave.asked[k].stops);
            TEST_ASSERT_FALSE(slave.motor[k].has_torque);
        }
    }
}

/* --- Whether the torque is off --- */

static unsigned energized(void)
{
    unsigned count = 0;
    for (unsigned k = 0; k < AXES; k++) {
        count += feedback[k].is_energized;
    }
    return count;
}

/* What a drive is said to be without stays off: whatever it was at when it was asked to go off. */
static void assert_off_is_off(drives_request_t request)
{
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, request));
    for (int n = 0; n < 400; n++) {
        (void)!cycle();
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(feedback[k].is_energized || !slave.motor[k].has_torque);
        }
    }
    TEST_ASSERT_EQUAL_UINT(0, energized());
    TEST_ASSERT_FALSE(has_any_torque());
}

static void test_off_is_told_once_it_is_so_whenever_it_is_asked_for(void)
{
    for (int i = 0; i < 240; i++) {
        open_shared(1000);
        map.enabled_when.mask = i % 4 < 2 ? 1 : 0; /* it says whether it has torque, or not */
        map.enabled_when.value = map.enabled_when.mask;
        map.is_target_last = i % 8 < 4;
        await(DRIVE_DISABLED, 3000);
        cycles(50);
        TEST_ASSERT_EQUAL_UINT(0, energized());
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        for (int n = 0; n < i; n++) {
            (void)!cycle();
            follow_actual();
        }
        assert_off_is_off(i % 2 == 0 ? DRIVES_DISABLE : DRIVES_QUICK_STOP);
    }
}

/* Where its line fails for longer than is borne, a drive is lost: what was heard last counts until it is back, and told again. */
static void test_off_that_is_lost_is_told_again_when_the_drive_is_back(void)
{
    for (uint32_t i = 0; i < 4; i++) {
        const bool is_refused = i >= 2; /* then it is not as it has to be */
        map.item[0].value = 0x0203;
        map.enabled_when.mask = map.enabled_when.value = i % 2;
        open_slaves(false, false, 300);
        enable();
        cycles(20);
        TEST_ASSERT_EQUAL_UINT(AXES, energized());
        slave.line[2].devices = 0; /* nothing of it arrives */
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
        cycles(300);
        TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[2].state);
        TEST_ASSERT_EQUAL_UINT(1, energized());
        TEST_ASSERT_TRUE(feedback[2].is_energized && slave.motor[2].has_torque);
        map.item[0].value = is_refused ? 0x0204 : 0x0203;
        slave.line[2].devices = 1;
        cycles(900);
        TEST_ASSERT_EQUAL(is_refused ? DRIVE_OFFLINE : DRIVE_DISABLED, feedback[2].state);
        TEST_ASSERT_EQUAL_UINT(0, energized());
        TEST_ASSERT_FALSE(slave.motor[2].has_torque);
    }
}

/* It takes what takes its torque away, and keeps it. */
static void test_off_of_a_drive_that_says_otherwise_is_never_told(void)
{
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        slave.twin[k].is_deaf = true;
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    for (int n = 0; n < 1000; n++) {
        (void)!cycle();
        TEST_ASSERT_EQUAL_UINT(AXES, energized());
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    TEST_ASSERT_FALSE(drives_is_stopping(hal));
}

/* An answer to what was asked before the drive had taken the command. */
static void test_off_is_not_told_by_an_answer_from_before(void)
{
    enable();
    cycles(20);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    while (driver.axis[2].job == MODBUS_DRIVE_JOB_COMMAND) {
        (void)!cycle();
    }
    driver.axis[2].is_energized = true;
    driver.axis[2].mark_us = now_us + 50000;
    cycles(50);
    TEST_ASSERT_EQUAL_UINT(1, energized());
    cycles(10);
    TEST_ASSERT_EQUAL_UINT(0, energized());
}

static void test_off_of_drives_that_no_command_takes_torque_from_is_not_waited_for(void)
{
    for (uint32_t can_tell = 0; can_tell < 2; can_tell++) {
        map.command[MODBUS_DRIVE_DISABLE].count = 0;
        map.enabled_when.mask = map.enabled_when.value = can_tell;
        open_slaves(false, false, 300);
        enable();
        cycles(20);
        TEST_ASSERT_EQUAL_UINT(0, energized());
    }
}

/* What it says before it has taken the command is of a torque that may still come. */
static void test_off_is_not_told_by_what_a_drive_says_before_it_has_taken_it(void)
{
    open_shared(4000);
    await(DRIVE_DISABLED, 3000);
    for (unsigned k = 0; k < AXES; k++) {
        slave.asked[k].is_weak = true;
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    while (driver.axis[6].phase != MODBUS_DRIVE_CONFIRMING) {
        (void)!cycle();
    }
    cycles(200);
    TEST_ASSERT_EQUAL_UINT(AXES, energized());
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    unsigned untold = 0;
    while (drives_is_stopping(hal)) {
        (void)!cycle();
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(feedback[k].is_energized || driver.axis[k].job != MODBUS_DRIVE_JOB_COMMAND);
        }
        untold++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(20, untold);
    cycles(200);
    TEST_ASSERT_EQUAL_UINT(0, energized());
}

/* Nor is a fault of a drive that does not say whether it has torque the end of it. */
static void test_off_after_a_fault_is_told_when_the_drive_has_taken_it(void)
{
    map.enabled_when = (canraw_when_t){0, 0};
    enable();
    register_drive_fault(&slave.twin[2], MODBUS_DRIVES_ALARM);
    cycles(50);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_TRUE(feedback[2].is_energized && slave.motor[2].has_torque);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(350);
    TEST_ASSERT_EQUAL_UINT(0, energized());
    TEST_ASSERT_FALSE(slave.motor[2].has_torque);
}

static void test_alarm_is_the_fault_code(void)
{
    enable();
    register_drive_fault(&slave.twin[2], MODBUS_DRIVES_ALARM);
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
    enable();
    move(MM(1) / 50, 0, 50);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    await(DRIVE_DISABLED, 200);
    for (unsigned k = 0; k < AXES; k++) {
        modbus_drives_place(&slave, k, register_drive_count(&slave.twin[k]) - 10000);
        slave.motor[k].is_jammed = true;
    }
    cycles(400);
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
        TEST_ASSERT_UINT32_WITHIN(4, 1000 / 56 + 0, slave.asked[k].targets);
    }
    cycles(180); /* three rounds: the mean, its turn, the way there */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_INT32_WITHIN(1, wide_counts(START_MM + 20), slave.asked[k].target);
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
    const int32_t slow = wide_counts(START_MM) - slave.asked[1].target;
    const int32_t fast = wide_counts(START_MM) - slave.asked[0].target;
    TEST_ASSERT_INT32_WITHIN(4 * 10000 / 3, slow * 12 / 8, fast); /* their proportion, but for one set-point */
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_LESS_THAN_INT32(5 * 10000 / 3, slave.asked[k].largest_step);
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
        TEST_ASSERT_UINT16_WITHIN(60, 562, slave.asked[k].speed);
    }
    cycles(200);
    TEST_ASSERT_EQUAL_UINT16(0, slave.asked[0].speed);
}

/* 50 mm/s is 500 counts: a drive that obeys its speed arrives, whatever the line. */
static void test_speed_register_lets_the_drive_arrive(void)
{
    static const struct {
        bool is_shared;
        uint32_t transaction_us;
    } k_lines[] = {{false, 300}, {false, 1100}, {false, 2500}, {true, 300}, {true, 900}, {true, 2000}};
    for (size_t i = 0; i < sizeof k_lines / sizeof k_lines[0]; i++) {
        map = modbus_maps_wide(k_lines[i].is_shared);
        map.expected_us = 14 * k_lines[i].transaction_us;
        map.feedback_timeout_us = 300000;
        open_slaves(false, k_lines[i].is_shared, k_lines[i].transaction_us);
        enable();
        move(MM(1) / 20, 0, 600);
        uint16_t low = UINT16_MAX, high = 0;
        for (unsigned n = 0; n < 400; n++) {
            move(MM(1) / 20, 0, 1);
            low = slave.asked[3].speed < low ? slave.asked[3].speed : low;
            high = slave.asked[3].speed > high ? slave.asked[3].speed : high;
        }
        TEST_ASSERT_GREATER_OR_EQUAL_UINT16(500, low);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(850, high); /* the way of three cycles, in the time of two */
    }
}

/* Position and speed in blocks of their own, in either order: they belong together, or the drive falls further and further
 * behind. */
static void test_speed_register_of_its_own_belongs_to_the_position(void)
{
    static const modbus_drive_block_t k_position = {10, 2, 1, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 2, true, false}}};
    static const modbus_drive_block_t k_speed = {12, 1, 1, 0, {0}, {{MODBUS_DRIVE_SPEED, 0, 1, false, false}}};
    static const uint32_t k_transactions_us[] = {300, 1500, 2500};
    for (unsigned i = 0; i < 6; i++) {
        map = modbus_maps_wide(false);
        map.setpoint = (modbus_drive_blocks_t){2, {i % 2 == 0 ? k_position : k_speed, i % 2 == 0 ? k_speed : k_position}};
        map.feedback_timeout_us = 300000;
        open_slaves(false, false, k_transactions_us[i / 2]);
        slave.map.setpoint = map.setpoint;
        enable();
        move(MM(1) / 20, 0, 2000);
        const int32_t travel = wide_counts(START_MM) - wide_counts(START_MM + 1); /* of a mm */
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_INT32_WITHIN(travel, slave.asked[k].target, register_drive_count(&slave.twin[k]));
        }
    }
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
        TEST_ASSERT_EQUAL_UINT16(400, slave.asked[k].speed);
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
        low = i > 200 && slave.asked[0].target < low ? slave.asked[0].target : low;
        high = i > 200 && slave.asked[0].target > high ? slave.asked[0].target : high;
    }
    TEST_ASSERT_TRUE(high - low < 10000 / 3 / 8); /* 0.5 mm from top to bottom, sampled: now less than a quarter of it */
}

/* Registers that are not neighbours: position and speed, status and alarm, each in a block of its own. */
static void test_blocks_of_a_setpoint_go_out_whole(void)
{
    map.setpoint = (modbus_drive_blocks_t){2,
                                           {{10, 2, 1, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 2, true, false}}},
                                            {12, 1, 1, 0, {0}, {{MODBUS_DRIVE_SPEED, 0, 1, false, false}}}}};
    map.feedback = (modbus_drive_blocks_t){
        2,
        {{1, 1, 1, 0, {0}, {{MODBUS_DRIVE_STATUS, 0, 1, false, false}}},
         {2, 3, 2, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 2, true, false}, {MODBUS_DRIVE_ALARM, 2, 1, false, false}}}}};
    open_slaves(false, false, 300);
    slave.map.setpoint = map.setpoint;
    enable();
    move(MM(1) / 20, 0, 400);
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_INT32_WITHIN(1, wide_counts(START_MM + 20), slave.asked[k].target);
    }
    move(MM(1) / 20, 0, 200);
    TEST_ASSERT_UINT16_WITHIN(60, 562, slave.asked[3].speed);
    register_drive_fault(&slave.twin[2], MODBUS_DRIVES_ALARM);
    cycles(20);
    TEST_ASSERT_EQUAL_HEX32(0x0E21, feedback[2].fault_code);
}

/* Of which one is constant: both in one transaction, by function 16 where single ones go by 6. */
static void test_setpoint_of_two_registers_on_drives_that_take_single_ones(void)
{
    map = modbus_maps_small(false);
    map.setpoint.block[0].count = 2;
    map.setpoint.block[0].data[1] = 1; /* torque stays on */
    open_slaves(true, false, 300);
    slave.map.setpoint = map.setpoint;
    enable();
    move(-MM(1) / 20, 0, 400);
    cycles(100);
    TEST_ASSERT_EQUAL_INT32((START_MM - 20) * 100, slave.asked[5].target);
}

/* On both sides of zero. */
static void test_mean_of_positions_below_zero(void)
{
    map = modbus_maps_small(true);
    open_slaves(true, true, 300);
    for (unsigned k = 0; k < AXES; k++) {
        modbus_drives_place(&slave, k, -1000);
    }
    enable();
    move(MM(1) / 50, 0, 1000);
    cycles(200);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(1000, slave.asked[k].target);
    }
}

/* Of a drive that counts the other way round, beyond all numbers. */
static void test_speed_that_no_number_tells_is_at_the_end_of_its_field(void)
{
    for (unsigned i = 0; i < 2; i++) {
        map = modbus_maps_wide(false);
        map.setpoint.block[0].field[1].is_signed = true;
        map.axis[3].scale = (counts_scale_t){1, 1000, MODBUS_DRIVES_WIDE_ZERO};
        map.axis[3].speed = (counts_scale_t){INT32_MIN, 1, -1};
        map.axis[3].step_max_q32 = map.axis[3].speed_max_q32 = INT64_MAX;
        map.axis[3].following_max_q32 = map.axis[3].carry_q32 = 0;
        open_slaves(false, false, 300);
        modbus_drives_place(&slave, 3, MODBUS_DRIVES_WIDE_ZERO);
        enable();
        cycles(20);
        setpoint_q32[3] = i == 0 ? MM(1 << 30) : -MM(1 << 30);
        cycles(3);
        TEST_ASSERT_EQUAL_INT16(i == 0 ? INT16_MIN : INT16_MAX, (int16_t)slave.asked[3].speed);
    }
}

/* The sign is that of the way. */
static void test_speed_with_a_sign_has_the_direction(void)
{
    map.setpoint.block[0].field[1].is_signed = true;
    open_shared(2000);
    map.setpoint.block[0].field[1].is_signed = true;
    enable();
    cycles(500);
    move(-MM(1) / 20, 0, 600);
    TEST_ASSERT_INT16_WITHIN(60, -562, (int16_t)slave.asked[3].speed);
}

/* Nobody asks for anything for a while: what comes then is taken up, and no faster than a line so slow could carry. */
static void test_setpoints_that_pause_are_taken_up_without_a_step(void)
{
    enable();
    cycles(100);
    for (int i = 0; i < 12000; i++) {
        now_us += CYCLE_US;
        modbus_drives_step(&slave, now_us);
        (void)!drives_poll(hal, now_us, feedback);
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    move(MM(1) / 2, 0, 1);
    TEST_ASSERT_TRUE(driver.paced > 0);
    cycles(500);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_INT32_WITHIN(1, wide_counts(START_MM) - 5000 / 3, slave.asked[k].target);
        TEST_ASSERT_TRUE(slave.asked[k].largest_step <= 5000 / 3 + 1);
    }
}

/* The worker loses what is written for five seconds, while the platform is ridden to and fro: the mean stays one. */
static void test_setpoints_that_nobody_takes_are_no_step_when_somebody_does(void)
{
    make_odd();
    enable();
    cycles(100);
    is_write_lost = true;
    for (int i = 0; i < 5000; i++) {
        move(i / 100 % 2 == 0 ? MM(1) / 50 : -MM(1) / 50, 0, 1);
    }
    is_write_lost = false;
    cycles(3000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_INT32_WITHIN(1, wide_counts(START_MM), slave.asked[k].target);
        TEST_ASSERT_TRUE(slave.asked[k].largest_step <= 3 * 10000 / 3);
    }
}

/* --- Homing --- */

static void home(void)
{
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    (void)!cycle();
    TEST_ASSERT_TRUE(are_all(DRIVE_HOMING));
}

static void test_homing_on_a_slow_line_ends_at_the_zero(void)
{
    open_shared(4000);
    home();
    await(DRIVE_ENABLED, 2000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(feedback[k].is_homed);
        TEST_ASSERT_EQUAL_INT32(MODBUS_DRIVES_WIDE_ZERO, slave.asked[k].target);
    }
}

/* "Done" that never was "not done" may be that of the last homing: it is believed after a while. */
static void test_homing_done_from_the_start_is_believed_after_a_while(void)
{
    map.homing_done = (canraw_when_t){0, 8}; /* a bit that is never set */
    home();
    const uint64_t begin_us = now_us;
    await(DRIVE_ENABLED, 2000);
    TEST_ASSERT_TRUE(now_us - begin_us >= 499000 && now_us - begin_us < 560000);
}

static void test_homing_failed_is_a_fault(void)
{
    map.homing_failed = (canraw_when_t){0, 4}; /* not homed */
    home();
    for (int i = 0; i < 100 && !are_all(DRIVE_FAULT); i++) {
        (void)!cycle();
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_HOMING_FAILED, feedback[0].fault_code);
    TEST_ASSERT_EQUAL_STRING("homing failed", report_of(0).trouble);
    cycles(20);
    TEST_ASSERT_TRUE(slave.twin[0].state != REGISTER_HOMING);
}

/* Without blocks for it the zero is where the drive has it: seen to begin, and over. */
static void test_homing_without_blocks_is_homed_from_the_start(void)
{
    map.command[MODBUS_DRIVE_HOME].count = 0;
    map.homing_done.mask = 0;
    open_slaves(false, false, 300);
    slave.twin[2].is_homed = false;
    enable();
    for (int i = 0; i < 4; i++) { /* just before and behind feedback that is newer */
        cycles(20 + i);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
        (void)!cycle();
        TEST_ASSERT_TRUE(are_all(DRIVE_HOMING));
        await(DRIVE_ENABLED, 100);
        TEST_ASSERT_TRUE(feedback[2].is_homed);
        TEST_ASSERT_EQUAL_INT32(wide_counts(START_MM), slave.asked[2].target);
    }
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
    modbus_drives_power(&slave, 5, false);
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
        TEST_ASSERT_EQUAL_UINT32(k == 5 ? 0 : 1, slave.asked[k].stops);
    }
}

static void test_quick_stop_replaces_the_setpoint_that_waits(void)
{
    open_shared(4000);
    enable();
    move(MM(1) / 50, 0, 200);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    const uint32_t before = slave.asked[3].targets;
    for (int i = 0; i < 70; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 50;
        }
        (void)!cycle();
    }
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, slave.asked[k].stops);
        TEST_ASSERT_FALSE(slave.motor[k].has_torque);
    }
    TEST_ASSERT_TRUE(slave.asked[3].targets <= before + 1);
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
        TEST_ASSERT_FALSE(slave.motor[k].has_torque);
    }
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(slave.asked[k].stops >= 2); /* and each by itself */
    }
}

/* Whenever it comes: also behind a set-point that is on the wire. A drive that is not there holds nobody up. */
static void test_quick_stop_by_broadcast_at_any_time(void)
{
    for (int shift = 0; shift < 30; shift++) {
        open_shared(4000);
        map.is_broadcast = true;
        enable();
        modbus_drives_power(&slave, 5, false);
        for (int i = 0; i < 2000 && feedback[5].state != DRIVE_OFFLINE; i++) {
            (void)!cycle();
        }
        move(MM(1) / 50, 0, 20 + shift);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        cycles(36); /* at worst one that waits for the drive that is gone */
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_FALSE(slave.motor[k].has_torque);
        }
        cycles(150);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(k == 5 || slave.asked[k].stops >= 2);
        }
    }
}

static void test_quick_stop_by_broadcast_goes_out_on_every_line(void)
{
    map.is_broadcast = true;
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(20);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(2, slave.asked[k].stops);
    }
}

/* A drive that knows no stop loses its torque; one that knows neither hears nothing more. */
static void test_quick_stop_where_the_map_has_none(void)
{
    for (unsigned i = 0; i < 2; i++) {
        map = modbus_maps_wide(false);
        map.is_broadcast = true;
        map.command[MODBUS_DRIVE_STOP].count = 0;
        map.command[MODBUS_DRIVE_DISABLE].count = i == 0 ? 1 : 0;
        open_slaves(false, false, 300);
        enable();
        move(MM(1) / 50, 0, 50);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        const uint32_t targets = slave.asked[3].targets;
        setpoint_q32[3] += MM(1);
        cycles(20);
        TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
        TEST_ASSERT_EQUAL(i != 0, slave.motor[3].has_torque);
        TEST_ASSERT_TRUE(slave.asked[3].targets <= targets + 1); /* what was on the wire */
        TEST_ASSERT_EQUAL_UINT32(0, slave.asked[3].stops);
    }
}

/* Drives are stopped first, and lose their torque; the reset comes behind that, and counts once it was written. */
static void test_reset_waits_for_the_stop(void)
{
    open_shared(4000);
    map.axis[2].following_max_q32 = MM(3);
    enable();
    slave.motor[2].is_jammed = true;
    for (int i = 0; i < 1000 && feedback[2].state != DRIVE_FAULT; i++) {
        move(MM(1) / 50, 0, 1);
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    bool was_reset = false;
    for (int i = 0; i < 900 && feedback[2].state == DRIVE_FAULT; i++) {
        was_reset |= driver.axis[2].job == MODBUS_DRIVE_JOB_COMMAND && driver.axis[2].command == MODBUS_DRIVE_RESET;
        TEST_ASSERT_TRUE(!was_reset || slave.asked[2].stops == 1);
        (void)!cycle();
    }
    TEST_ASSERT_TRUE(was_reset);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[2].state);
    TEST_ASSERT_FALSE(slave.motor[2].has_torque);
}

/* Until the drive has taken what stops it, and `disable` behind that, it is not enabled; a reset that waits for long is given up.
 */
static void test_stop_comes_before_torque_and_reset(void)
{
    for (int is_last = 0; is_last < 2; is_last++) {
        map.is_target_last = is_last == 1;
        open_slaves(false, false, 300);
        slave.is_holding_on_stop = true;
        slave.glide_takes_us = 4000000;
        enable();
        cycles(20);
        setpoint_q32[2] += MM(50);
        cycles(20);
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        for (int i = 0; i < 5000 && has_any_torque(); i++) {
            (void)!cycle();
            TEST_ASSERT_TRUE(drives_is_stopping(hal) || !has_any_torque());
            TEST_ASSERT_TRUE(!slave.motor[0].has_torque || drives_request_one(hal, 0, DRIVES_ENABLE) == HV_ERR_AGAIN);
        }
        TEST_ASSERT_FALSE(has_any_torque());
        cycles(50);
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    }
}

/* Without `disable` torque off does not replace the stop. */
static void test_stop_without_disable_is_not_replaced(void)
{
    open_shared(4000);
    map.command[MODBUS_DRIVE_DISABLE].count = 0;
    enable();
    cycles(20);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    cycles(200);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, slave.asked[k].stops);
    }
}

/* A position that has no place in millimetres is none. */
static void test_position_beyond_all_millimetres_is_not_taken(void)
{
    map.axis[2].scale = (counts_scale_t){1, 1, INT32_MIN};
    modbus_drives_place(&slave, 2, INT32_MAX);
    cycles(100);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[2].state);
    TEST_ASSERT_FALSE(feedback[2].has_actual);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[3].state);
}

static void test_setpoint_that_has_no_counts_is_a_fault(void)
{
    map.axis[2].scale = (counts_scale_t){INT32_MIN, 1, MODBUS_DRIVES_WIDE_ZERO};
    map.axis[2].step_max_q32 = INT64_MAX;
    map.axis[2].following_max_q32 = map.axis[2].carry_q32 = 0;
    modbus_drives_place(&slave, 2, MODBUS_DRIVES_WIDE_ZERO);
    enable();
    cycles(20);
    const int32_t target = slave.asked[2].target;
    setpoint_q32[2] = INT64_MIN;
    cycles(20);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_FOLLOWING, feedback[2].fault_code);
    TEST_ASSERT_TRUE(feedback[2].guard.jump_q32 > 0);
    TEST_ASSERT_EQUAL_INT32(target, slave.asked[2].target);
    TEST_ASSERT_EQUAL_UINT32(1, slave.asked[2].stops);
}

static void test_setpoint_far_from_a_drive_that_hangs_is_a_fault(void)
{
    map.axis[2].following_max_q32 = MM(3);
    enable();
    slave.motor[2].is_jammed = true;
    move(MM(1) / 50, 0, 300);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(MODBUS_DRIVE_FOLLOWING, feedback[2].fault_code);
    TEST_ASSERT_TRUE(feedback[2].guard.jump_q32 == 0 && feedback[2].guard.lag_q32 > MM(3));
    TEST_ASSERT_EQUAL_INT64(MM(3), feedback[2].guard.allowed_q32);
    TEST_ASSERT_EQUAL_UINT32(1, slave.asked[2].stops);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(320);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[2].state);
}

static void test_reset_of_a_drive_that_stays_faulty_ends_in_fault(void)
{
    await(DRIVE_DISABLED, 100);
    map.command[MODBUS_DRIVE_RESET].count = 0;
    register_drive_fault(&slave.twin[1], MODBUS_DRIVES_ALARM);
    cycles(20);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(1100);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    modbus_drives_command(&slave, 1, MODBUS_DRIVE_RESET);
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
        modbus_drives_place(&slave, k, 32700);
    }
    enable();
    move(MM(1) / 10, 0, 50); /* 327.67 mm are the end of 16 bits */
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_TRUE(slave.asked[0].target <= 32767 && slave.asked[0].target >= 32700);
}

/* --- Maps --- */

static hv_status_t init_status(void)
{
    hal_modbus_t line[DRIVES_MAX];
    modbus_drives_lines(&slave, line);
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
    case 20:
        map.items = MODBUS_DRIVE_STARTUP_MAX + 1;
        break;
    case 21:
        map.expected_us = 0;
        break;
    case 22:
        map.setpoint.count = MODBUS_DRIVE_BLOCKS_MAX + 1;
        break;
    case 23:
        map.setpoint.block[0].count = 0;
        map.setpoint.block[0].fields = 0;
        break;
    case 24:
        map.feedback.block[0].count = MODBUS_DRIVE_REGISTERS_MAX + 1;
        break;
    case 25:
        map.feedback.block[0].fields = MODBUS_DRIVE_FIELDS_MAX + 1;
        break;
    case 26:
        map.setpoint.block[0].field[1].registers = 3;
        map.setpoint.block[0].count = 6;
        break;
    case 27:
        map.feedback.block[0].field[0].value = MODBUS_DRIVE_SPEED;
        break;
    case 28:
        map.axis[3].speed.den = 0;
        break;
    case 29:
        map.axis[3].carry_q32 = -1;
        break;
    default:
        map.axis[3].following_max_q32 = -1;
        break;
    }
}

static void test_init_map_that_contradicts_itself_is_refused(void)
{
    for (int row = 0; row < 31; row++) {
        refuse(row);
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, init_status(), "row");
    }
    map = modbus_maps_wide(false);
    TEST_ASSERT_EQUAL(HV_OK, init_status());
    map.axis[3].unit = 255; /* of TCP */
    TEST_ASSERT_EQUAL(HV_OK, init_status());
    map.enabled_when.mask = map.fault_when.mask = map.homing_done.mask = 0; /* nothing to judge, no status */
    map.command[MODBUS_DRIVE_HOME].count = 0;
    map.feedback.block[0].field[0].value = MODBUS_DRIVE_ALARM;
    TEST_ASSERT_EQUAL(HV_OK, init_status());
}

static void test_init_line_that_is_missing_is_refused(void)
{
    hal_modbus_t line[DRIVES_MAX];
    modbus_drives_lines(&slave, line);
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
    RUN_TEST(test_round_us_knows_what_is_read_and_written_how);
    RUN_TEST(test_startup_writes_and_reads_back_before_a_drive_is_ready);
    RUN_TEST(test_startup_takes_torque_off_a_drive_that_was_left_with_it);
    RUN_TEST(test_startup_wrong_value_is_refused_by_name_and_taken_when_mended);
    RUN_TEST(test_startup_missing_register_is_refused_with_the_exception);
    RUN_TEST(test_startup_item_that_is_not_checked_may_read_as_it_likes);
    RUN_TEST(test_startup_names_the_register_it_is_at);
    RUN_TEST(test_startup_refused_drive_begins_again_at_once_by_a_reset_and_by_nothing_else);
    RUN_TEST(test_startup_without_anything_to_switch_off_or_to_write);
    RUN_TEST(test_startup_exceptions_have_words);
    RUN_TEST(test_all_that_answer_strangely_are_no_lost_line);
    RUN_TEST(test_answers_of_another_length_are_damaged);
    RUN_TEST(test_startup_drive_that_comes_late_is_found);
    RUN_TEST(test_startup_torque_off_that_was_refused_is_tried_again);
    RUN_TEST(test_startup_drive_with_an_alarm_is_never_ready);
    RUN_TEST(test_enable_with_an_old_target_in_the_register_makes_no_step);
    RUN_TEST(test_enable_one_drive_without_torque_keeps_all_waiting);
    RUN_TEST(test_enable_target_last_writes_it_after_torque_only);
    RUN_TEST(test_enable_target_last_waits_for_torque);
    RUN_TEST(test_torque_lost_is_disabled);
    RUN_TEST(test_torque_lost_before_all_have_it_is_disabled);
    RUN_TEST(test_enable_again_is_for_those_that_are_not);
    RUN_TEST(test_enable_where_the_map_knows_no_torque);
    RUN_TEST(test_alarm_is_a_fault_where_no_status_tells);
    RUN_TEST(test_fault_code_of_the_drive_may_be_any);
    RUN_TEST(test_fault_while_being_enabled_gets_no_torque_later);
    RUN_TEST(test_fault_while_a_stop_is_on_its_way_does_not_hold_it_up);
    RUN_TEST(test_off_is_told_once_it_is_so_whenever_it_is_asked_for);
    RUN_TEST(test_off_that_is_lost_is_told_again_when_the_drive_is_back);
    RUN_TEST(test_off_of_a_drive_that_says_otherwise_is_never_told);
    RUN_TEST(test_off_is_not_told_by_an_answer_from_before);
    RUN_TEST(test_off_of_drives_that_no_command_takes_torque_from_is_not_waited_for);
    RUN_TEST(test_off_is_not_told_by_what_a_drive_says_before_it_has_taken_it);
    RUN_TEST(test_off_after_a_fault_is_told_when_the_drive_has_taken_it);
    RUN_TEST(test_alarm_is_the_fault_code);
    RUN_TEST(test_enable_target_last_begins_where_the_drive_is_now);
    RUN_TEST(test_slow_line_gets_the_newest_setpoint_and_no_backlog);
    RUN_TEST(test_slow_line_is_measured);
    RUN_TEST(test_slow_line_paces_all_axes_alike);
    RUN_TEST(test_pace_unlimited_where_carry_is_none);
    RUN_TEST(test_speed_register_fits_the_period_of_the_line);
    RUN_TEST(test_speed_register_lets_the_drive_arrive);
    RUN_TEST(test_speed_register_of_its_own_belongs_to_the_position);
    RUN_TEST(test_speed_register_keeps_below_its_limit);
    RUN_TEST(test_smoothing_takes_out_what_the_line_cannot_carry);
    RUN_TEST(test_blocks_of_a_setpoint_go_out_whole);
    RUN_TEST(test_setpoint_of_two_registers_on_drives_that_take_single_ones);
    RUN_TEST(test_mean_of_positions_below_zero);
    RUN_TEST(test_speed_that_no_number_tells_is_at_the_end_of_its_field);
    RUN_TEST(test_speed_with_a_sign_has_the_direction);
    RUN_TEST(test_setpoints_that_pause_are_taken_up_without_a_step);
    RUN_TEST(test_setpoints_that_nobody_takes_are_no_step_when_somebody_does);
    RUN_TEST(test_homing_on_a_slow_line_ends_at_the_zero);
    RUN_TEST(test_homing_done_from_the_start_is_believed_after_a_while);
    RUN_TEST(test_homing_failed_is_a_fault);
    RUN_TEST(test_homing_without_blocks_is_homed_from_the_start);
    RUN_TEST(test_failures_within_the_retries_are_borne);
    RUN_TEST(test_failures_beyond_the_retries_are_offline_with_their_reason);
    RUN_TEST(test_feedback_too_old_is_offline);
    RUN_TEST(test_silent_drive_on_a_shared_line_leaves_the_others_alive);
    RUN_TEST(test_quick_stop_replaces_the_setpoint_that_waits);
    RUN_TEST(test_quick_stop_by_broadcast_reaches_all_drives_at_once);
    RUN_TEST(test_quick_stop_by_broadcast_at_any_time);
    RUN_TEST(test_quick_stop_by_broadcast_goes_out_on_every_line);
    RUN_TEST(test_quick_stop_where_the_map_has_none);
    RUN_TEST(test_reset_waits_for_the_stop);
    RUN_TEST(test_stop_comes_before_torque_and_reset);
    RUN_TEST(test_stop_without_disable_is_not_replaced);
    RUN_TEST(test_position_beyond_all_millimetres_is_not_taken);
    RUN_TEST(test_setpoint_that_has_no_counts_is_a_fault);
    RUN_TEST(test_setpoint_far_from_a_drive_that_hangs_is_a_fault);
    RUN_TEST(test_reset_of_a_drive_that_stays_faulty_ends_in_fault);
    RUN_TEST(test_setpoint_that_does_not_fit_its_register_is_a_fault);
    RUN_TEST(test_init_map_that_contradicts_itself_is_refused);
    RUN_TEST(test_init_line_that_is_missing_is_refused);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_cia402.c - CANopen drives behind drives.h, against strict simulated ones: setting up, refusals, enabling without a jump,
 * one drive that does not come along, losses and how soon they are seen, faults and their reset, homing, a bus that stalls.
 */
#include "heave/cia402.h"

#include <stdlib.h>
#include <string.h>

#include "canopen_drives.h"
#include "unity.h"

#define AXES     CANOPEN_DRIVES
#define CYCLE_US 1000u
#define PERIOD   4u /* cycles */
#define MM(x)    ((q32_t)(x)*Q32_ONE)

static sim_can_bus_t bus;
static sim_can_t node;
static canopen_drives_t twin;
static cia402_config_t config;
static cia402_t driver;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];
static unsigned absolute; /* the axis that has no zero to find */

static hv_status_t cycle(void)
{
    now_us += CYCLE_US;
    canopen_drives_step(&twin, now_us);
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

static bool is_homing(unsigned drive)
{
    return twin.drive[drive].node.drive.homing == HOMING_RUNNING;
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
                               .is_reset_wanted = true,
                               .is_support_checked = true};
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
    absolute = 6;
    sim_can_bus_init(&bus, 0, NULL, 0);
    canopen_drives_open(&twin, &bus);
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_place(&twin, k, 100000 + 1000 * (int32_t)k);
        canopen_drives_object(&twin, k, 0x60E3, 0)->value = 3; /* methods of homing: 35, 17, 37 */
        canopen_drives_object(&twin, k, 0x60E3, 2)->value = 17;
        canopen_drives_object(&twin, k, 0x60E3, 3)->value = 37;
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

/* What the driver sends, and one identifier of it that finds no room. */
#define SENT_MAX 8192u
static hal_can_ops_t spying;
static can_frame_t sent[SENT_MAX];
static unsigned sents;
static uint32_t refused_id;

static hv_status_t spy_send(void *ctx, const can_frame_t *frame)
{
    if (frame->id == refused_id) {
        return HV_ERR_AGAIN;
    }
    TEST_ASSERT_TRUE(sents < SENT_MAX);
    sent[sents++] = *frame;
    return sim_can_hal(&node).ops->send(ctx, frame);
}

static void spy(void)
{
    spying = *driver.can.ops;
    spying.send = spy_send;
    driver.can.ops = &spying;
    sents = 0;
    refused_id = UINT32_MAX;
}

static unsigned count_sent(uint32_t id, const uint8_t *data, uint8_t length)
{
    unsigned count = 0;
    for (unsigned i = 0; i < sents; i++) {
        count += sent[i].id == id && sent[i].length == length && memcmp(sent[i].data, data, length) == 0;
    }
    return count;
}

/* --- Setting up --- */

static unsigned place(unsigned drive, uint32_t object, unsigned from)
{
    const canopen_drive_t *d = &twin.drive[drive];
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
        TEST_ASSERT_EQUAL_HEX32(0x200 + k + 1, canopen_drives_object(&twin, k, 0x1400, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0x40000180 + k + 1, canopen_drives_object(&twin, k, 0x1800, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0x80000300 + k + 1, canopen_drives_object(&twin, k, 0x1401, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0xC0000280 + k + 1, canopen_drives_object(&twin, k, 0x1801, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0x607A0020, canopen_drives_object(&twin, k, 0x1600, 2)->value);
        TEST_ASSERT_EQUAL_HEX32(0x7F0096, canopen_drives_object(&twin, k, 0x1016, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(4, canopen_drives_object(&twin, k, 0x60C2, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0xFD, canopen_drives_object(&twin, k, 0x60C2, 2)->value);
        TEST_ASSERT_EQUAL_HEX32(2, canopen_drives_object(&twin, k, 0x605A, 0)->value);
        TEST_ASSERT_EQUAL_HEX32(10000, canopen_drives_object(&twin, k, 0x6065, 0)->value);
        TEST_ASSERT_EQUAL_UINT32(1, twin.drive[k].boots); /* it has just begun anew: nothing to reset */
    }
}

/* As it leaves its maker. */
static void make(unsigned drive, uint16_t index, uint8_t sub, uint32_t value)
{
    object_t *object = canopen_drives_object(&twin, drive, index, sub);
    object->value = object->fallback = value;
}

/* Any other than the first four, those too that have the numbers of a second axis elsewhere: a PDO that is on cannot be mapped.
 */
static void test_setup_pdo_with_a_high_number_is_switched_off_before_it_is_mapped(void)
{
    static const uint16_t k_numbers[] = {5, 65, 68, 129};
    for (size_t i = 0; i < sizeof k_numbers / sizeof k_numbers[0]; i++) {
        const uint16_t record = (uint16_t)(0x1400 + k_numbers[i] - 1);
        const uint32_t map = 0x200u + record;
        setUp();
        config.commands = (cia402_maps_t){.count = 1, .map = {{k_numbers[i], 2, {0x60400010, 0x607A0020}}}};
        for (unsigned k = 0; k < AXES; k++) {
            twin.drive[k].node.commands = config.commands; /* in the place of the drive's fourth */
            canopen_drives_power(&twin, k, true);
            make(k, 0x1403, 1, 0x200 + k + 1); /* on, as the maker has it */
            make(k, 0x1603, 0, 1);
            make(k, 0x1603, 2, 0);
        }
        come_up();
        TEST_ASSERT_TRUE(place(0, (uint32_t)record << 8 | 1, 0) < place(0, map << 8, 0));
        TEST_ASSERT_EQUAL_HEX32(0x201, canopen_drives_object(&twin, 0, 0x1403, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0x607A0020, canopen_drives_object(&twin, 0, 0x1603, 2)->value);
        TEST_ASSERT_EQUAL_HEX32(0x80000201, canopen_drives_object(&twin, 0, 0x1400, 1)->value); /* has the same identifier */
    }
}

static void test_setup_drives_that_are_up_already_are_reset_first(void)
{
    start();
    for (unsigned i = 0; i < 100; i++) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
    }
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(sim_can_hal(&node))); /* their boot-up messages were heard by nobody */
    await(DRIVE_DISABLED, 5000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(2, twin.drive[k].boots);
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
    canopen_drives_object(&twin, 3, 0x60C2, 1)->refusal = 0x06090030;
    const drive_report_t r = refusal_of(3);
    TEST_ASSERT_EQUAL_UINT8(4, r.address);
    TEST_ASSERT_EQUAL_STRING("refused", r.phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_TAKEN, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x60C201, r.object);
    TEST_ASSERT_EQUAL_STRING("the value is out of range", r.detail);
}

/* Alike drives, one fault of the configuration: each answers, so the bus is not lost, and each says what it does not take. */
static void test_setup_all_refused_is_no_lost_bus_and_a_reset_sets_up_again(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_object(&twin, k, 0x60C2, 1)->refusal = 0x06090030;
    }
    start();
    cycles(4000);
    TEST_ASSERT_EQUAL(HV_OK, cycle());
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_STRING("refused", report(k).phase);
        TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_TAKEN, feedback[k].fault_code);
    }
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_object(&twin, k, 0x60C2, 1)->refusal = 0;
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    for (unsigned i = 0; i < 4000 && !are_all(DRIVE_DISABLED); i++) {
        TEST_ASSERT_EQUAL(HV_OK, cycle()); /* drives that are being set up are no lost bus either */
    }
    enable();
}

/* A dip of the supply: the drives say themselves what has happened. */
static void test_loss_all_that_start_again_are_no_lost_bus(void)
{
    come_up();
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_power(&twin, k, true);
        twin.drive[k].node.boot_due_us = now_us + CYCLE_US; /* sooner than three answers are missing */
    }
    while (!are_all(DRIVE_OFFLINE)) {
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
    TEST_ASSERT_EQUAL_HEX32(CIA402_REBOOTED, feedback[0].fault_code);
    for (unsigned i = 0; i < 4000 && !are_all(DRIVE_DISABLED); i++) {
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
}

/* Somebody acknowledges, but no drive is there any more. */
static void test_loss_all_silent_is_a_lost_bus_until_one_answers(void)
{
    come_up();
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_power(&twin, k, false);
    }
    cycles(40);
    TEST_ASSERT_EQUAL(HV_ERR_IO, cycle());
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(hal, DRIVES_DISABLE));
    cycles(2000);
    TEST_ASSERT_EQUAL(HV_ERR_IO, cycle());
    canopen_drives_power(&twin, 3, true);
    cycles(2000);
    TEST_ASSERT_EQUAL(HV_OK, cycle());
}

static void test_setup_object_with_another_value_tells_both(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k].identity[0] = 0x2E5;
    }
    canopen_drives_object(&twin, 2, 0x1018, 1)->value = 0x0B0000EF; /* as large as an abort code */
    const drive_report_t r = refusal_of(2);
    TEST_ASSERT_EQUAL_STRING("it holds another value", r.detail);
    TEST_ASSERT_TRUE(r.has_found);
    TEST_ASSERT_EQUAL_HEX32(0x0B0000EF, r.found);
    TEST_ASSERT_EQUAL_HEX32(0x2E5, r.wanted);
    TEST_ASSERT_FALSE(report(1).has_found);
}

static void test_setup_object_that_can_only_be_read_is_told_as_such(void)
{
    canopen_drives_object(&twin, 3, 0x60C2, 1)->is_read_only = true;
    canopen_drives_object(&twin, 3, 0x60C2, 1)->value = 10;
    const drive_report_t r = refusal_of(3);
    TEST_ASSERT_EQUAL_HEX32(0x60C201, r.object);
    TEST_ASSERT_EQUAL_STRING("the object can only be read", r.detail);
    TEST_ASSERT_EQUAL_HEX32(0x06010002, r.detail_code);
    TEST_ASSERT_TRUE(r.has_found);
    TEST_ASSERT_EQUAL_HEX32(10, r.found);
    TEST_ASSERT_EQUAL_HEX32(PERIOD, r.wanted);
}

/* Written first, checked when all of it is written. */
static void test_setup_mapping_that_can_only_be_read_is_told_as_such(void)
{
    canopen_drives_object(&twin, 3, 0x1600, 2)->is_read_only = true;
    canopen_drives_object(&twin, 3, 0x1600, 2)->value = 0x60C10120;
    const drive_report_t r = refusal_of(3);
    TEST_ASSERT_EQUAL_HEX32(0x160002, r.object);
    TEST_ASSERT_EQUAL_STRING("the object can only be read", r.detail);
    TEST_ASSERT_EQUAL_HEX32(0x60C10120, r.found);
    TEST_ASSERT_EQUAL_HEX32(0x607A0020, r.wanted);
}

/* 6502h: bit 0 PP, 5 homing, 6 IP, 7 CSP. */
static void test_setup_mode_that_a_drive_has_not_got_is_refused_before_it_is_asked_for(void)
{
    canopen_drives_object(&twin, 2, 0x6502, 0)->value = 0x61;
    const drive_report_t r = refusal_of(2);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_SUCH_MODE, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x650200, r.object);
    TEST_ASSERT_EQUAL_HEX32(0x61, r.found);
    TEST_ASSERT_EQUAL_HEX32(0x80, r.wanted);
    TEST_ASSERT_EQUAL_STRING("a bit for each mode that it supports", r.detail);
    TEST_ASSERT_EQUAL_UINT32(0, canopen_drives_object(&twin, 2, 0x6060, 0)->value);
}

static void test_setup_homing_that_a_drive_has_not_got_is_refused_where_it_is_wanted(void)
{
    config.axis[1].homing_method = 17;
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_object(&twin, k, 0x6502, 0)->value = 0xC1;
    }
    const drive_report_t r = refusal_of(1);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_SUCH_MODE, r.code);
    TEST_ASSERT_EQUAL_HEX32(0xA0, r.wanted);
}

static void test_setup_homing_method_that_is_not_in_the_list_is_refused(void)
{
    config.axis[3].homing_method = 37;
    config.axis[4].homing_method = 18;
    const drive_report_t r = refusal_of(4);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_SUCH_HOMING, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x60E303, r.object);
    TEST_ASSERT_EQUAL_HEX32(37, r.found);
    TEST_ASSERT_EQUAL_HEX32(18, r.wanted);
    TEST_ASSERT_EQUAL_STRING("the last of the methods that it supports", r.detail);
    TEST_ASSERT_EQUAL_UINT32(0, canopen_drives_object(&twin, 4, 0x6098, 0)->value);
    TEST_ASSERT_EQUAL_UINT32(37, canopen_drives_object(&twin, 3, 0x6098, 0)->value);
}

/* No object, 0, an empty list, a list that ends early, a method of the maker, no answer, or not asked: nothing is told, and the
 * drive decides. */
static void test_setup_what_a_drive_does_not_tell_is_no_refusal(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k].homing_method = 18;
    }
    config.axis[4].homing_method = -3;
    canopen_drives_object(&twin, 0, 0x6502, 0)->is_missing = true;
    canopen_drives_object(&twin, 0, 0x60E3, 0)->is_missing = true;
    canopen_drives_object(&twin, 1, 0x6502, 0)->value = 0;
    canopen_drives_object(&twin, 1, 0x60E3, 0)->value = 0;
    canopen_drives_object(&twin, 2, 0x60E3, 2)->is_missing = true;
    canopen_drives_object(&twin, 3, 0x6502, 0)->is_silent = true;
    canopen_drives_object(&twin, 3, 0x60E3, 0)->is_silent = true;
    for (unsigned k = 5; k < AXES; k++) {
        canopen_drives_object(&twin, k, 0x60E3, 3)->value = 18;
    }
    come_up();
    TEST_ASSERT_EQUAL_UINT32(18, canopen_drives_object(&twin, 0, 0x6098, 0)->value);
}

static void test_setup_what_a_drive_tells_does_not_count_where_it_is_not_asked(void)
{
    config.is_support_checked = false;
    config.axis[4].homing_method = 18;
    canopen_drives_object(&twin, 2, 0x6502, 0)->value = 0x61;
    come_up();
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
    canopen_drives_object(&twin, 1, 0x607D, 2)->refusal = 0x06090036; /* a second line of defence: no reason to refuse a drive */
    come_up();
    TEST_ASSERT_EQUAL_INT32(-5000, (int32_t)canopen_drives_object(&twin, 1, 0x607D, 1)->value);
    TEST_ASSERT_EQUAL_INT32(0, (int32_t)canopen_drives_object(&twin, 0, 0x607D, 1)->value);
}

/* --- Start-up lists --- */

static cia402_item_t items[3];

static void give_list(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        memcpy(config.axis[k].item, items, sizeof items);
        config.axis[k].items = 3;
    }
}

static void list(void)
{
    items[0] = (cia402_item_t){
        .index = 0x2031, .bytes = 4, .value = 0xFFFFFFFE, .is_written = true, .is_checked = true, .is_last = true};
    items[1] = (cia402_item_t){.index = 0x2030, .sub = 1, .bytes = 2, .value = 50, .is_written = true, .is_checked = true};
    items[2] = (cia402_item_t){.index = 0x2032, .bytes = 1, .value = 3, .is_checked = true};
    give_list();
}

static void test_startup_list_is_written_before_and_behind_everything_else(void)
{
    list();
    come_up();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(50, canopen_drives_object(&twin, k, 0x2030, 1)->value);
        TEST_ASSERT_EQUAL_HEX32(0xFFFFFFFE, canopen_drives_object(&twin, k, 0x2031, 0)->value);
        TEST_ASSERT_TRUE(place(k, 0x203001, 0) < place(k, 0x101700, 0));
        TEST_ASSERT_TRUE(place(k, 0x203100, 0) > place(k, 0x60C201, 0));
        TEST_ASSERT_TRUE(place(k, 0x203100, 0) < place(k, 0x606000, 0));
    }
    const unsigned before = twin.drive[2].logged;
    canopen_drives_power(&twin, 2, false);
    cycles(50);
    canopen_drives_power(&twin, 2, true);
    cycles(2000);
    TEST_ASSERT_TRUE(place(2, 0x203001, before) < place(2, 0x203100, before)); /* again after each boot-up */
    enable();
}

static void test_startup_list_that_a_drive_does_not_take_names_the_object(void)
{
    list();
    canopen_drives_object(&twin, 4, 0x2030, 1)->is_missing = true;
    drive_report_t r = refusal_of(4);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_TAKEN, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x203001, r.object);
    TEST_ASSERT_EQUAL_HEX32(0x06020000, r.detail_code);

    setUp();
    list();
    canopen_drives_object(&twin, 4, 0x2031, 0)->is_read_only = true;
    r = refusal_of(4);
    TEST_ASSERT_EQUAL_HEX32(0x203100, r.object);
    TEST_ASSERT_EQUAL_HEX32(0xFFFFFFFE, r.wanted);

    setUp();
    list();
    items[0].is_checked = false; /* nothing is read back, so the refusal itself counts */
    give_list();
    canopen_drives_object(&twin, 4, 0x2031, 0)->is_read_only = true;
    TEST_ASSERT_EQUAL_HEX32(0x203100, refusal_of(4).object);

    setUp();
    list();
    canopen_drives_object(&twin, 4, 0x2032, 0)->value = 4;
    r = refusal_of(4);
    TEST_ASSERT_EQUAL_HEX32(0x203200, r.object);
    TEST_ASSERT_EQUAL_HEX32(4, r.found);
    TEST_ASSERT_EQUAL_HEX32(3, r.wanted);
}

static void test_startup_list_item_that_may_be_missing_is_passed_over(void)
{
    list();
    items[1].is_optional = true;
    give_list();
    canopen_drives_object(&twin, 4, 0x2030, 1)->is_missing = true;
    canopen_drives_object(&twin, 5, 0x2030, 1)->refusal = 0x06090030;
    come_up();
    TEST_ASSERT_EQUAL_UINT32(7, canopen_drives_object(&twin, 5, 0x2030, 1)->value);
    TEST_ASSERT_EQUAL_HEX32(0xFFFFFFFE, canopen_drives_object(&twin, 4, 0x2031, 0)->value);
}

static void test_startup_list_too_long_is_refused(void)
{
    list();
    config.axis[1].items = CIA402_ITEMS_MAX + 1;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&node)));
}

/* What can be told without a drive is what is done with one. */
static void test_wishes_are_what_is_written(void)
{
    cia402_wish_t wish = {0};
    unsigned written = 0;
    list();
    config.axis[0].homing_method = 17;
    come_up();
    const uint32_t logged = twin.drive[0].logged;
    while (cia402_next_wish(&config, 0, &wish)) {
        if (wish.is_written && canopen_drives_object(&twin, 0, wish.index, wish.sub) != NULL) {
            (void)place(0, (uint32_t)wish.index << 8 | wish.sub, 0);
            written++;
        }
        TEST_ASSERT_EQUAL(wish.index < 0x2030 || wish.index > 0x2032, wish.is_own);
        TEST_ASSERT_EQUAL(wish.is_written && wish.is_own,
                          wish.is_own && cia402_is_own_object(wish.index, wish.sub) && wish.is_written);
    }
    TEST_ASSERT_EQUAL_UINT32(logged, written);
    TEST_ASSERT_FALSE(cia402_is_own_object(0x2030, 1));
    TEST_ASSERT_TRUE(cia402_is_own_object(0x605A, 0));
}

static void test_setup_other_profile_is_refused(void)
{
    canopen_drives_object(&twin, 0, 0x1000, 0)->value = 0x00020191;
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_402, refusal_of(0).code);
}

static void test_setup_missing_guard_is_refused_unless_allowed(void)
{
    static const uint16_t k_guards[] = {0x1016, 0x6007, 0x605A, 0x605E, 0x6065};
    for (size_t i = 0; i < 5; i++) {
        const uint8_t sub = k_guards[i] == 0x1016 ? 1 : 0;
        setUp();
        canopen_drives_object(&twin, 1, k_guards[i], sub)->is_missing = true;
        const drive_report_t refused = refusal_of(1);
        TEST_ASSERT_EQUAL_HEX32(CIA402_UNGUARDED, refused.code);
        TEST_ASSERT_EQUAL_HEX32((uint32_t)k_guards[i] << 8 | sub, refused.object);
        setUp();
        canopen_drives_object(&twin, 1, k_guards[i], sub)->is_missing = true;
        config.accepted_without = CIA402_GUARDS_ALL;
        come_up();
        TEST_ASSERT_EQUAL_HEX32((uint32_t)k_guards[i] << 8 | sub, report(1).object);
        enable();
    }
}

/* Whatever it holds; all ones are no window, or no reaction. */
static void test_setup_guard_that_cannot_be_written_is_taken_where_it_is_on(void)
{
    static const struct {
        uint16_t index;
        uint8_t sub;
        uint32_t value;
        bool is_taken;
    } k_rows[] = {{0x605E, 0, 1, true},        {0x605E, 0, 0, false},        {0x605A, 0, 0xFFFF, false},
                  {0x1016, 1, 0x7F0064, true}, {0x1016, 1, 0x7E0064, false}, {0x1016, 1, 0x7F0000, false},
                  {0x1016, 1, 0x7F012C, true} /* twice of what was asked for */};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        setUp();
        object_t *row = canopen_drives_object(&twin, 1, k_rows[i].index, k_rows[i].sub);
        row->is_read_only = true;
        row->value = row->fallback = k_rows[i].value;
        if (k_rows[i].is_taken) {
            come_up();
        } else {
            TEST_ASSERT_EQUAL_HEX32(CIA402_UNGUARDED, refusal_of(1).code);
        }
    }
}

/* It is on, but the drive would go on for too long without us. */
static void test_setup_consumer_time_that_is_far_too_long_is_refused_unless_allowed(void)
{
    for (unsigned is_allowed = 0; is_allowed < 2; is_allowed++) {
        setUp();
        config.accepted_without =
            is_allowed != 0 ? 1u << CIA402_GUARD_CONSUMER : (uint8_t)(CIA402_GUARDS_ALL & ~(1u << CIA402_GUARD_CONSUMER));
        object_t *row = canopen_drives_object(&twin, 1, 0x1016, 1);
        row->is_read_only = true;
        row->value = row->fallback = 0x7F012D;
        if (is_allowed != 0) {
            come_up();
            TEST_ASSERT_EQUAL_HEX32(0x101601, report(1).object);
            continue;
        }
        const drive_report_t refused = refusal_of(1);
        TEST_ASSERT_EQUAL_HEX32(CIA402_GUARDED_LATE, refused.code);
        TEST_ASSERT_EQUAL_STRING("would stop too late by itself when the gateway is gone", refused.trouble);
        TEST_ASSERT_EQUAL_HEX32(0x101601, refused.object);
        TEST_ASSERT_EQUAL_STRING("the object can only be read", refused.detail);
        TEST_ASSERT_TRUE(refused.has_found);
        TEST_ASSERT_EQUAL_HEX32(0x7F012D, refused.found);
        TEST_ASSERT_EQUAL_HEX32(0x7F0096, refused.wanted);
    }
}

static void test_setup_without_heartbeats_is_refused(void)
{
    twin.drive[5].node.has_no_heartbeat = true;
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_HEARTBEAT, refusal_of(5).code);
}

static void test_setup_without_heartbeats_is_taken_where_allowed_and_watched_by_its_tpdos(void)
{
    twin.drive[5].node.has_no_heartbeat = true;
    config.accepted_without = 1u << CIA402_GUARD_PRODUCER;
    come_up();
    TEST_ASSERT_EQUAL_HEX32(0x101700, report(5).object);
    TEST_ASSERT_EQUAL_STRING("its guard is off, which the configuration allows", report(5).detail);
    enable();
    cycles(500);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    twin.drive[5].node.is_mute = true;
    TEST_ASSERT_TRUE(cycles_until(5, DRIVE_OFFLINE, 100) <= 4 * PERIOD + 1);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_TPDO, feedback[5].fault_code);
    TEST_ASSERT_EQUAL_STRING("", report(5).detail);
}

/* Each by itself: who accepts one that is missing does not accept another one. */
static void test_setup_guards_are_accepted_one_by_one(void)
{
    static const struct {
        uint16_t index;
        uint8_t sub;
        cia402_guard_t guard;
    } k_rows[] = {{0x1016, 1, CIA402_GUARD_CONSUMER},   {0x1017, 0, CIA402_GUARD_PRODUCER}, {0x6007, 0, CIA402_GUARD_CONNECTION},
                  {0x605A, 0, CIA402_GUARD_QUICK_STOP}, {0x605E, 0, CIA402_GUARD_FAULT},    {0x6065, 0, CIA402_GUARD_WINDOW},
                  {0x100C, 0, CIA402_GUARD_TIME},       {0x100D, 0, CIA402_GUARD_LIFE}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        const bool is_guarded = k_rows[i].index == 0x100C || k_rows[i].index == 0x100D;
        for (unsigned is_accepted = 0; is_accepted < 2; is_accepted++) {
            setUp();
            config.is_guarded = is_guarded;
            config.accepted_without =
                is_accepted != 0 ? 1u << k_rows[i].guard : (uint8_t)(CIA402_GUARDS_ALL & ~(1u << k_rows[i].guard));
            canopen_drives_object(&twin, 1, k_rows[i].index, k_rows[i].sub)->is_missing = true;
            TEST_ASSERT_EQUAL(is_accepted != 0, cia402_accepts_without(&config, k_rows[i].index));
            if (is_accepted == 0) {
                TEST_ASSERT_EQUAL_HEX32(k_rows[i].index << 8 | k_rows[i].sub, refusal_of(1).object);
            } else {
                come_up();
                TEST_ASSERT_EQUAL_HEX32(k_rows[i].index << 8 | k_rows[i].sub, report(1).object);
                TEST_ASSERT_EQUAL_STRING("its guard is off, which the configuration allows", report(1).detail);
            }
        }
    }
    TEST_ASSERT_TRUE(cia402_accepts_without(&config, 0x100D));
    TEST_ASSERT_FALSE(cia402_accepts_without(&config, 0x6040));
    config.accepted_without = 1u << CIA402_GUARD_CONNECTION;
    TEST_ASSERT_TRUE(cia402_accepts_without(&config, 0x6807)); /* of the second axis */
}

/* A drive without 1016h notices by its RPDOs that heaved has gone. */
static void test_setup_deadline_of_commands_stops_a_drive_that_watches_no_heartbeat(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        config.accepted_without = 1u << CIA402_GUARD_CONSUMER;
        config.rpdo_deadline_ms = 20;
        for (unsigned k = 0; k < AXES; k++) {
            canopen_drives_object(&twin, k, 0x1016, 1)->is_missing = true;
        }
        if (i == 1) {
            canopen_drives_object(&twin, 4, 0x1400, 5)->is_missing = true;
            TEST_ASSERT_EQUAL_HEX32(0x140005, refusal_of(4).object);
            continue;
        }
        come_up();
        enable();
        cycles(200);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        for (unsigned n = 0; n < 25; n++) { /* heaved is gone */
            now_us += CYCLE_US;
            canopen_drives_step(&twin, now_us);
        }
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(twin.drive[k].node.drive.state == TWIN_FAULT || twin.drive[k].node.drive.state == TWIN_REACTION);
        }
    }
}

/* It says that it is operational with its next heartbeat, which may take a while. */
static void test_setup_drive_whose_heartbeats_are_rare_is_waited_for(void)
{
    config.heartbeat_ms = 900;
    config.heartbeat_timeout_ms = 2700;
    start();
    await(DRIVE_DISABLED, 10000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, twin.drive[k].boots);
    }
}

/* Mapping is refused by an operational drive: it is told until its heartbeat says pre-operational. */
static void test_setup_drive_that_goes_operational_by_itself_is_told_again(void)
{
    start();
    spy();
    for (unsigned i = 0; i < 400; i++) {
        (void)!cycle();
        if (twin.drive[1].node.nmt == 0x7F && driver.axis[1].phase == CIA402_CONFIGURING) {
            twin.drive[1].node.nmt = 0x05;
        }
    }
    TEST_ASSERT_EQUAL_STRING("configuring", report(1).phase);
    TEST_ASSERT_TRUE(count_sent(0, (const uint8_t[2]){0x80, 2}, 2) >= 3);
    await(DRIVE_DISABLED, 1000);
}

static void test_setup_optional_objects_missing_is_no_trouble(void)
{
    static const uint16_t k_optional[] = {0x1006, 0x1019, 0x605B, 0x605C, 0x6066};
    for (size_t i = 0; i < 5; i++) {
        canopen_drives_object(&twin, 1, k_optional[i], 0)->is_missing = true;
        canopen_drives_object(&twin, 2, k_optional[i], 0)->is_read_only = true;
    }
    come_up();
}

static void test_setup_missing_drive_is_named_and_taken_when_it_comes(void)
{
    canopen_drives_power(&twin, 6, false);
    TEST_ASSERT_EQUAL_HEX32(CIA402_SILENT, refusal_of(6).code);
    TEST_ASSERT_EQUAL_STRING("missing", report(6).phase);
    canopen_drives_power(&twin, 6, true);
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL_HEX32(0, report(6).code);
}

/* It answers, only not when it is asked for that. */
static void test_setup_object_that_is_never_answered_is_named_and_not_tried_for_ever(void)
{
    canopen_drives_object(&twin, 2, 0x6065, 0)->is_silent = true;
    const drive_report_t r = refusal_of(2);
    TEST_ASSERT_EQUAL_STRING("refused", r.phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_ANSWER, r.code);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_ANSWER, feedback[2].fault_code);
    TEST_ASSERT_EQUAL_HEX32(0x606500, r.object);
    const uint32_t boots = twin.drive[2].boots;
    TEST_ASSERT_TRUE(boots <= 3);
    cycles(10000);
    TEST_ASSERT_EQUAL_UINT32(boots, twin.drive[2].boots);
    canopen_drives_object(&twin, 2, 0x6065, 0)->is_silent = false;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL_HEX32(0, report(2).code);
    TEST_ASSERT_EQUAL_HEX32(0, report(2).object);
}

/* While it is tried again, too: an engage would be refused for a reason. */
static void test_setup_object_without_answer_is_named_while_it_is_tried_again(void)
{
    canopen_drives_object(&twin, 2, 0x6065, 0)->is_silent = true;
    start();
    for (unsigned i = 0; i < 5000 && feedback[2].fault_code != CIA402_NO_ANSWER; i++) {
        (void)!cycle();
    }
    while (driver.axis[2].phase != CIA402_REFUSED) {
        TEST_ASSERT_EQUAL_HEX32(CIA402_NO_ANSWER, feedback[2].fault_code);
        TEST_ASSERT_EQUAL_HEX32(CIA402_NO_ANSWER, report(2).code);
        (void)!cycle();
    }
}

static void test_setup_object_that_may_be_missing_may_be_without_answer(void)
{
    canopen_drives_object(&twin, 2, 0x605B, 0)->is_silent = true;
    come_up();
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].boots);
}

static void test_setup_one_question_without_answer_is_asked_again_from_the_beginning(void)
{
    canopen_drives_object(&twin, 2, 0x6065, 0)->is_silent = true;
    start();
    for (unsigned i = 0; i < 5000 && feedback[2].fault_code != CIA402_NO_ANSWER; i++) {
        (void)!cycle();
    }
    canopen_drives_object(&twin, 2, 0x6065, 0)->is_silent = false;
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL_HEX32(0, report(2).code);
}

/* At a change of mode: lost, and then refused by name. */
static void test_enable_drive_that_does_not_answer_for_its_mode_is_named(void)
{
    come_up();
    canopen_drives_object(&twin, 4, 0x6061, 0)->is_silent = true;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(8000);
    TEST_ASSERT_EQUAL_STRING("refused", report(4).phase);
    TEST_ASSERT_EQUAL_HEX32(0x606100, report(4).object);
}

/* Every answer is given to the next question only: with the retries each object is right in the end. */
static void test_setup_answers_that_come_late_do_not_confuse(void)
{
    twin.drive[2].is_answering_late = true;
    start();
    await(DRIVE_DISABLED, 60000);
    TEST_ASSERT_EQUAL_HEX32(0x607A0020, canopen_drives_object(&twin, 2, 0x1600, 2)->value);
    TEST_ASSERT_EQUAL_HEX32(0x7F0096, canopen_drives_object(&twin, 2, 0x1016, 1)->value);
    TEST_ASSERT_EQUAL_HEX32(10000, canopen_drives_object(&twin, 2, 0x6065, 0)->value);
    twin.drive[2].is_answering_late = false;
    enable();
}

static void test_setup_refused_drive_is_tried_again_by_a_reset(void)
{
    canopen_drives_object(&twin, 3, 0x6060, 0)->refusal = 0x06090030;
    (void)refusal_of(3);
    canopen_drives_object(&twin, 3, 0x6060, 0)->refusal = 0;
    cycles(2000);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[3].state);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
}

/* "Not in this state", "not now", "under local control": may pass. */
static void test_setup_refusal_that_may_pass_is_asked_again_before_it_counts(void)
{
    static const uint32_t k_codes[] = {0x06010000, 0x08000021, 0x08000022};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        canopen_drives_object(&twin, 1, 0x60C2, 1)->refusal = k_codes[i];
        start();
        for (unsigned n = 0; n < 2000 && driver.axis[1].setup.tries < 2; n++) {
            (void)!cycle();
        }
        TEST_ASSERT_EQUAL_UINT8(2, driver.axis[1].setup.tries);
        canopen_drives_object(&twin, 1, 0x60C2, 1)->refusal = 0;
        await(DRIVE_DISABLED, 1000);
        setUp();
        canopen_drives_object(&twin, 1, 0x60C2, 1)->refusal = k_codes[i];
        const drive_report_t refused = refusal_of(1);
        TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_TAKEN, refused.code);
        TEST_ASSERT_EQUAL_HEX32(k_codes[i], refused.detail_code);
    }
}

static void test_setup_mode_may_show_late_but_not_never(void)
{
    canopen_drives_force(&twin, 1, 0x6061, 0, 3);
    start();
    cycles(3000);
    TEST_ASSERT_EQUAL_HEX32(0x606100, report(1).object);
    canopen_drives_object(&twin, 1, 0x6061, 0)->is_forced = false;
    await(DRIVE_DISABLED, 100);
    setUp();
    canopen_drives_force(&twin, 1, 0x6061, 0, 3);
    start();
    cycles(6000);
    TEST_ASSERT_EQUAL_STRING("refused", report(1).phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_MODE, report(1).code);
    TEST_ASSERT_EQUAL_HEX32(0x606100, report(1).object);
    TEST_ASSERT_EQUAL_STRING("it holds another value", report(1).detail);
}

/* --- Drives that differ from the usual ones, as real ones do --- */

static void build_all(uint32_t quirks)
{
    for (unsigned k = 0; k < AXES; k++) {
        twin.drive[k].node.drive.quirks = quirks;
    }
}

/* What heaved rides: they come up, rise, move, and stop. */
static void move_all(void)
{
    come_up();
    enable();
    for (unsigned n = 0; n < 500; n++) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 50;
        }
        (void)!cycle();
    }
    cycles(200);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_INT_WITHIN(1, 110000 + 1000 * (int32_t)k, canopen_drives_position(&twin, k));
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    await(DRIVE_DISABLED, 1000);
}

static void test_quirks_that_make_no_difference(void)
{
    static const uint32_t k_quirks[] = {QUIRK_HIDES_MODE,
                                        QUIRK_LONG_PDO,
                                        QUIRK_LENGTH_BIT,
                                        QUIRK_SENDS_CHANGES,
                                        QUIRK_BOOTS_TWICE,
                                        QUIRK_SHORT_SDO,
                                        QUIRK_SEGMENTS,
                                        QUIRK_SLOW_RESET,
                                        QUIRK_FAULT_BLOCKS,
                                        QUIRK_HIDES_MODE | QUIRK_LONG_PDO | QUIRK_LENGTH_BIT | QUIRK_SENDS_CHANGES |
                                            QUIRK_BOOTS_TWICE | QUIRK_SEGMENTS};
    for (size_t i = 0; i < sizeof k_quirks / sizeof k_quirks[0]; i++) {
        setUp();
        build_all(k_quirks[i]);
        move_all();
    }
}

/* A reset is for what is there now: a drive that comes back later is not reset by itself. */
static void test_quirk_reset_of_a_drive_that_does_not_start_is_not_kept(void)
{
    config.is_reset_wanted = false;
    for (unsigned n = 0; n < 200; n++) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
    }
    twin.drive[4].node.drive.quirks = QUIRK_FAULT_BLOCKS;
    canopen_drives_fault(&twin, 4, 0x3210);
    (void)refusal_of(4);
    twin.drive[4].node.is_cut = true;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(21000);
    twin.drive[4].node.is_cut = false;
    cycles(6000);
    TEST_ASSERT_EQUAL_STRING("refused", report(4).phase);
    TEST_ASSERT_EQUAL_UINT32(0, twin.drive[4].resets);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
}

/* Whoever answers each request after 700 ms is not missing. */
static void test_quirk_slow_answers_are_waited_for(void)
{
    config.sdo_timeout_ms = 500;
    twin.drive[3].node.sdo_us = 700000;
    start();
    for (unsigned n = 0; n < 8000 && strcmp(report(3).phase, "configuring") != 0; n++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL_STRING("configuring", report(3).phase);
    twin.drive[3].node.sdo_us = 1000;
    await(DRIVE_DISABLED, 8000);
}

/* 6061h has to show the mode once there is torque: before, and if it never does, there is no set-point. */
static void test_quirk_hidden_mode_has_to_show_with_torque(void)
{
    build_all(QUIRK_HIDES_MODE);
    config.reaction[CIA402_WATCH_MODE] = CIA402_STOP;
    come_up();
    canopen_drives_force(&twin, 2, 0x6061, 0, 0);
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    for (unsigned n = 0; n < 4000 && feedback[2].state != DRIVE_FAULT; n++) {
        (void)!cycle();
        TEST_ASSERT_FALSE(are_all(DRIVE_ENABLED));
    }
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_MODE, feedback[2].fault_code);
    canopen_drives_object(&twin, 2, 0x6061, 0)->is_forced = false;
    cycles(500);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 1000);
    enable();
    twin.drive[2].node.drive.mode = 0; /* shown before, so it counts */
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LEFT_MODE, feedback[2].fault_code);
}

/* The answers have no 6061h: then nobody could see the mode. */
static void test_quirk_hidden_mode_is_refused_where_no_answer_has_it(void)
{
    config.answers = (cia402_maps_t){.count = 1, .map = {{.number = 1, .entries = 2, .entry = {0x60410010, 0x60640020}}}};
    twin.drive[1].node.drive.quirks = QUIRK_HIDES_MODE;
    start();
    cycles(6000);
    TEST_ASSERT_EQUAL_STRING("refused", report(1).phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_MODE, report(1).code);
}

static void test_quirk_drives_that_need_bits_follow_with_them_only(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        build_all(QUIRK_NEEDS_BITS);
        config.csp_control_bits = i == 0 ? 0 : 0x70;
        if (i == 1) {
            move_all();
            continue;
        }
        come_up();
        enable();
        for (unsigned n = 0; n < 2000 && are_all(DRIVE_ENABLED); n++) {
            setpoint_q32[0] += MM(1) / 50;
            (void)!cycle();
        }
        TEST_ASSERT_EQUAL_HEX32(0x8611, feedback[0].fault_code);
    }
    config.csp_control_bits = 0x80;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&node)));
}

static void test_quirk_short_pdo_is_named(void)
{
    twin.drive[5].node.drive.quirks = QUIRK_SHORT_PDO;
    TEST_ASSERT_EQUAL_HEX32(CIA402_SHORT_TPDO, refusal_of(5).code);
    twin.drive[5].node.drive.quirks = 0;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
    enable();
    twin.drive[5].node.drive.quirks = QUIRK_SHORT_PDO;
    (void)cycles_until(5, DRIVE_OFFLINE, 6 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(CIA402_SHORT_TPDO, feedback[5].fault_code);
}

static void test_quirk_wrong_toggle_is_named_with_its_object(void)
{
    twin.drive[5].node.drive.quirks = QUIRK_WRONG_TOGGLE;
    start();
    cycles(3000);
    const drive_report_t r = report(5);
    TEST_ASSERT_EQUAL_STRING("refused", r.phase);
    TEST_ASSERT_EQUAL_HEX32(0x05030000, r.detail_code);
    TEST_ASSERT_EQUAL_HEX32(0x100000, r.object);
    twin.drive[5].node.drive.quirks = 0;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 3000);
}

static void test_quirk_fault_reset_takes_as_long_as_the_drive_needs(void)
{
    build_all(QUIRK_SLOW_RESET);
    come_up();
    enable();
    canopen_drives_fault(&twin, 2, 0x2310);
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(500);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 130);
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].resets);
    enable();
}

/* It cannot be reset by a PDO, which it has only when it is operational: the reset goes by SDO, and only when it is asked for. */
static void test_quirk_fault_that_keeps_a_drive_from_starting_is_named_and_reset(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        config.is_reset_wanted = false; /* it has had its fault for long */
        for (unsigned n = 0; n < 200; n++) {
            now_us += CYCLE_US;
            canopen_drives_step(&twin, now_us);
        }
        twin.drive[4].node.drive.quirks = QUIRK_FAULT_BLOCKS | (i == 1 ? (uint32_t)QUIRK_SLOW_RESET : 0u);
        canopen_drives_fault(&twin, 4, 0x3210);
        const drive_report_t r = refusal_of(4);
        TEST_ASSERT_EQUAL_HEX32(CIA402_NO_START, r.code);
        TEST_ASSERT_EQUAL_HEX32(0x3210, r.detail_code);
        TEST_ASSERT_EQUAL_STRING("over-voltage of the DC link", r.detail);
        TEST_ASSERT_EQUAL_UINT32(0, twin.drive[4].resets);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        await(DRIVE_DISABLED, 3000);
        TEST_ASSERT_EQUAL_UINT32(1, twin.drive[4].resets);
        enable();
    }
}

static void test_setup_drive_that_does_not_tell_its_type_is_refused(void)
{
    canopen_drives_object(&twin, 0, 0x1000, 0)->is_missing = true;
    const drive_report_t r = refusal_of(0);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_402, r.code);
    TEST_ASSERT_EQUAL_STRING("there is no such object", r.detail);
}

/* Drives that have booted while nobody listened. */
static void start_beside_drives_that_are_up(void)
{
    start();
    for (unsigned i = 0; i < 100; i++) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
    }
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(sim_can_hal(&node)));
}

static void test_setup_without_reset_takes_drives_as_they_are(void)
{
    config.is_reset_wanted = false;
    start_beside_drives_that_are_up();
    await(DRIVE_DISABLED, 5000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, twin.drive[k].boots);
    }
}

static void test_setup_drive_that_boots_without_a_word_is_asked_all_the_same(void)
{
    start_beside_drives_that_are_up();
    for (unsigned i = 0; i < 400; i++) {
        twin.drive[2].node.is_mute = i > 0 && twin.drive[2].node.nmt == 0;
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL_STRING("booting", report(2).phase);
    await(DRIVE_DISABLED, 1000);
    TEST_ASSERT_EQUAL_UINT32(2, twin.drive[2].boots);
}

static void cycles_until_phase(unsigned axis, cia402_phase_t phase)
{
    for (unsigned i = 0; i < 5000 && driver.axis[axis].phase != phase; i++) {
        (void)!cycle();
    }
    TEST_ASSERT_EQUAL(phase, driver.axis[axis].phase);
}

static void test_setup_drive_that_falls_silent_is_missing_until_it_answers(void)
{
    start();
    cycles_until_phase(1, CIA402_CONFIGURING);
    twin.drive[1].node.is_sdo_silent = true;
    cycles_until_phase(1, CIA402_MISSING);
    TEST_ASSERT_EQUAL_HEX32(CIA402_SILENT, feedback[1].fault_code);
    twin.drive[1].node.is_sdo_silent = false;
    await(DRIVE_DISABLED, 2000);
    TEST_ASSERT_EQUAL_HEX32(0, report(1).code);
}

static void test_setup_drive_that_boots_in_the_midst_begins_anew(void)
{
    static const cia402_phase_t k_phases[] = {CIA402_CONFIGURING, CIA402_STARTING};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        start();
        cycles_until_phase(1, k_phases[i]);
        canopen_drives_power(&twin, 1, true);
        for (unsigned n = 0; n < 100 && report(1).code == 0; n++) {
            (void)!cycle();
        }
        TEST_ASSERT_EQUAL_HEX32(CIA402_REBOOTED, report(1).code);
        await(DRIVE_DISABLED, 2000);
        TEST_ASSERT_EQUAL_UINT32(2, twin.drive[1].boots); /* not reset once more */
        TEST_ASSERT_EQUAL_HEX32(0, report(1).code);
    }
}

static void test_setup_refused_drive_is_tried_again_when_it_boots(void)
{
    canopen_drives_object(&twin, 3, 0x6060, 0)->refusal = 0x06090030;
    (void)refusal_of(3);
    canopen_drives_object(&twin, 3, 0x6060, 0)->refusal = 0;
    canopen_drives_power(&twin, 3, true);
    await(DRIVE_DISABLED, 3000);
}

/* A TPDO that is not what was mapped; one whose position has no place in millimetres. */
static void test_setup_drive_whose_position_cannot_be_read_is_refused(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        twin.drive[5].tpdo_cut = i == 0;
        if (i == 1) {
            config.axis[5].scale.num = 1;
            canopen_drives_place(&twin, 5, INT32_MAX);
        }
        const drive_report_t r = refusal_of(5);
        TEST_ASSERT_EQUAL_HEX32(i == 0 ? CIA402_SHORT_TPDO : CIA402_NO_START, r.code);
        TEST_ASSERT_EQUAL_HEX32(0, r.object);
        TEST_ASSERT_FALSE(feedback[5].has_actual);
        TEST_ASSERT_EQUAL_UINT32(2, twin.drive[5].boots); /* tried from the beginning twice */
        canopen_drives_power(&twin, 5, true);
        cycles(3000);
        TEST_ASSERT_EQUAL_STRING("refused", report(5).phase);
        TEST_ASSERT_EQUAL_UINT32(4, twin.drive[5].boots); /* and again when it boots */
        twin.drive[5].tpdo_cut = 0;
        canopen_drives_place(&twin, 5, 0);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        await(DRIVE_DISABLED, 3000);
    }
}

/* --- Enabling --- */

static void test_enable_all_together_without_a_jump(void)
{
    come_up();
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        const canopen_drive_t *d = &twin.drive[k];
        TEST_ASSERT_EQUAL_INT32(0, d->largest_step);
        TEST_ASSERT_EQUAL_UINT32(1, d->node.drive.enabled);
        TEST_ASSERT_TRUE(d->enabled_us - twin.drive[0].enabled_us <= 10000); /* brakes of 8 to 14 ms */
        TEST_ASSERT_EQUAL_INT32(100000 + 1000 * (int32_t)k, canopen_drives_position(&twin, k));
    }
}

static void test_enable_drives_whose_states_move_by_themselves_come_up(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        twin.drive[k].is_restless = k % 2 == 0;
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
        uint16_t status_clear;
        uint32_t code;
    } k_cases[] = {{0x21, 0, CIA402_NO_POWER},
                   {0x40, 0, CIA402_NO_POWER},
                   {0x23, 0, CIA402_NO_TORQUE},
                   {0x21, 0x0200, CIA402_REMOTE_OFF},   /* under local control */
                   {0xFFFF, 0x1000, CIA402_NO_TORQUE}}; /* operation enabled, but it does not follow */
    for (size_t i = 0; i < 5; i++) {
        setUp();
        twin.drive[4].is_stuck = true;
        twin.drive[4].stuck_at = k_cases[i].at;
        twin.drive[4].node.drive.bits_clear = k_cases[i].status_clear;
        come_up();
        follow_actual();
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        (void)cycles_until(4, DRIVE_FAULT, 2000);
        TEST_ASSERT_EQUAL_HEX32(k_cases[i].code, feedback[4].fault_code);
        cycles(50);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL(k == 4 ? DRIVE_FAULT : DRIVE_DISABLED, feedback[k].state);
            TEST_ASSERT_TRUE(k == 4 || twin.drive[k].node.drive.state == 0x40 || twin.drive[k].node.drive.state == 0x21);
        }
        twin.drive[4].is_stuck = false;
        twin.drive[4].node.drive.bits_clear = 0;
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        await(DRIVE_DISABLED, 100);
        enable();
    }
}

/* Some drives never set bit 12. */
static void test_enable_drive_that_does_not_say_that_it_follows_is_believed_after_a_while(void)
{
    config.power_timeout_ms = 1000;
    twin.drive[4].node.drive.bits_clear = 0x1000;
    come_up();
    const uint64_t begin_us = now_us;
    enable();
    TEST_ASSERT_TRUE(now_us - begin_us >= 500000 && now_us - begin_us < 700000);
    TEST_ASSERT_EQUAL_INT32(0, twin.drive[4].largest_step);
}

static void test_enable_drive_that_shows_another_mode_gets_no_set_point(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        twin.drive[4].node.drive.bits_clear = 0x0200; /* also under local control: the mode is what hinders */
        come_up();
        twin.drive[4].node.drive.bits_clear = i == 0 ? 0x0200 : 0;
        follow_actual();
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        for (unsigned n = 0; n < 8000 && feedback[4].state != DRIVE_FAULT; n++) {
            (void)!cycle();
            if (i == 0 || twin.drive[4].node.drive.state == 0x27) {
                twin.drive[4].node.drive.mode = -1; /* a maker's own */
            }
        }
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[4].state);
        TEST_ASSERT_EQUAL_HEX32(CIA402_NO_MODE, feedback[4].fault_code);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL_UINT32(i, twin.drive[k].node.drive.enabled);
            TEST_ASSERT_EQUAL_INT32(0, twin.drive[k].largest_step);
        }
    }
}

static void test_enable_drive_that_takes_no_mode_stops_all(void)
{
    come_up();
    canopen_drives_object(&twin, 4, 0x6060, 0)->refusal = 0x06090030;
    follow_actual();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    (void)cycles_until(4, DRIVE_FAULT, 200);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_TAKEN, feedback[4].fault_code);
    TEST_ASSERT_EQUAL_HEX32(0x606000, report(4).object);
    TEST_ASSERT_EQUAL_STRING("the value is out of range", report(4).detail);
    TEST_ASSERT_EQUAL_HEX32(0x06090030, report(4).detail_code);
    setUp();
    come_up();
    twin.drive[4].node.is_sdo_silent = true;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    (void)cycles_until(4, DRIVE_OFFLINE, 1000);
    TEST_ASSERT_EQUAL_HEX32(CIA402_SILENT, feedback[4].fault_code);
    cycles(50);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(0, twin.drive[k].node.drive.enabled);
        TEST_ASSERT_EQUAL(k == 4 ? DRIVE_OFFLINE : DRIVE_DISABLED, feedback[k].state);
    }
}

static void test_enable_while_enabled_changes_nothing_but_brings_back_who_fell_out(void)
{
    come_up();
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(50);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[0].node.drive.enabled);
    canopen_drives_drop(&twin, 2);
    cycles(50);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(k == 2 ? DRIVE_DISABLED : DRIVE_ENABLED, feedback[k].state); /* the gateway decides */
    }
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(2, twin.drive[k].node.drive.enabled); /* all anew, all together */
        TEST_ASSERT_EQUAL_INT32(0, twin.drive[k].largest_step);
    }
}

/* One that waits for the others with its torque, and loses it. */
static void test_enable_drive_that_loses_its_torque_meanwhile_does_not_get_it_again(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        setUp();
        const unsigned other = (k + 1) % AXES;
        twin.drive[other].is_stuck = true;
        twin.drive[other].stuck_at = TWIN_ON;
        come_up();
        follow_actual();
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        cycles(100);
        TEST_ASSERT_EQUAL(TWIN_ENABLED, twin.drive[k].node.drive.state);
        canopen_drives_drop(&twin, k);
        (void)cycles_until(k, DRIVE_FAULT, 3 * PERIOD);
        TEST_ASSERT_EQUAL_HEX32(CIA402_FELL_OUT, feedback[k].fault_code);
        cycles(500);
        TEST_ASSERT_EQUAL_UINT32(1, twin.drive[k].node.drive.enabled);
    }
}

/* Set-points begin at where a drive is, however far that is from where the last ones ended. */
static void test_enable_again_where_drives_were_moved_to(void)
{
    come_up();
    enable();
    cycles(100);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    cycles(100);
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_place(&twin, k, 150000 + 1000 * (int32_t)k);
    }
    cycles(3 * PERIOD);
    enable();
    cycles(100);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(0, twin.drive[k].largest_step);
    }
}

static void test_send_set_points_arrive_as_counts_one_set_per_period(void)
{
    come_up();
    enable();
    const uint32_t before = twin.drive[0].setpoints;
    for (int i = 0; i < 400; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 100;
        }
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
    TEST_ASSERT_UINT32_WITHIN(2, 100, twin.drive[0].setpoints - before);
    TEST_ASSERT_EQUAL_INT32(40, twin.drive[6].largest_step);
    cycles(3 * PERIOD);
    TEST_ASSERT_EQUAL_INT32(104000, canopen_drives_position(&twin, 0));
}

static void test_send_position_wraps_round_without_a_jump(void)
{
    canopen_drives_place(&twin, 6, INT32_MAX - 100);
    come_up();
    enable();
    for (int i = 0; i < 100; i++) {
        setpoint_q32[6] += MM(1) / 100;
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
    cycles(3 * PERIOD);
    TEST_ASSERT_EQUAL_INT32(INT32_MIN + 899, canopen_drives_position(&twin, 6));
    TEST_ASSERT_TRUE(feedback[6].actual_mm_q32 > MM(2147483));
}

/* A drive that answers, but does not move: 15 mm. */
static void test_send_lag_beyond_the_window_is_a_fault_unless_it_is_not_watched(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        config.axis[2].following_max_q32 = i == 0 ? MM(10) : 0;
        come_up();
        enable();
        const q32_t from_q32 = setpoint_q32[2];
        while (setpoint_q32[2] - from_q32 < MM(15) && feedback[2].state == DRIVE_ENABLED) {
            setpoint_q32[2] += MM(1) / 10;
            (void)!cycle();
            canopen_drives_place(&twin, 2, 102000);
        }
        TEST_ASSERT_EQUAL(i == 0 ? DRIVE_FAULT : DRIVE_ENABLED, feedback[2].state);
        TEST_ASSERT_EQUAL_HEX32(i == 0 ? 0x8611 : 0, feedback[2].fault_code);
        TEST_ASSERT_TRUE(i != 0 || (feedback[2].guard.jump_q32 == 0 && feedback[2].guard.lag_q32 > MM(10) &&
                                    feedback[2].guard.lag_q32 < MM(11) && feedback[2].guard.allowed_q32 == MM(10)));
        TEST_ASSERT_TRUE(i != 0 || strcmp("heaved found its set-point too far from its position, and has not sent it",
                                          report(2).trouble) == 0);
        TEST_ASSERT_INT_WITHIN(1000, i == 0 ? 10000 : 15000, twin.drive[2].last_target - 102000);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
        await(DRIVE_DISABLED, 200);
        canopen_drives_fault(&twin, 2, 0x3210); /* another one, of the drive itself */
        (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
        TEST_ASSERT_FALSE(drive_guard_is_found(&feedback[2].guard));
    }
}

static void test_send_set_point_that_has_no_counts_is_a_fault_and_not_sent(void)
{
    config.axis[2] = (cia402_axis_config_t){.node = 3, .scale = {INT32_MIN, 1, 0}, .step_max_q32 = INT64_MAX};
    config.axis[2].window_counts = 1;
    come_up();
    enable();
    const uint32_t setpoints = twin.drive[2].setpoints;
    setpoint_q32[2] = INT64_MIN;
    (void)cycles_until(2, DRIVE_FAULT, 2 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(0x8611, feedback[2].fault_code);
    TEST_ASSERT_TRUE(feedback[2].guard.jump_q32 > 0);
    TEST_ASSERT_EQUAL_HEX32(0, report(2).object);
    cycles(5 * PERIOD);
    TEST_ASSERT_INT_WITHIN(2, (int)setpoints, (int)twin.drive[2].setpoints);
    TEST_ASSERT_EQUAL_INT32(102000, canopen_drives_position(&twin, 2));
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].quick_stops);
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
        TEST_ASSERT_TRUE(k == 2 || twin.drive[k].quick_stops == 1);
    }
    return count;
}

static void test_poll_drive_silent_is_lost_after_three_syncs(void)
{
    come_up();
    enable();
    twin.drive[2].node.is_mute = true;
    TEST_ASSERT_TRUE(cycles_to_loss(CIA402_LOST_TPDO, DRIVE_OFFLINE) <= 4 * PERIOD + 1);
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].quick_stops); /* it still hears */
    twin.drive[2].node.is_mute = false;
    await(DRIVE_DISABLED, 5000);
    enable();
}

static void test_poll_two_tpdos_lost_is_no_loss(void)
{
    come_up();
    enable();
    for (int i = 0; i < 20; i++) {
        twin.drive[2].node.tpdo_drop = 2;
        cycles(4 * PERIOD);
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

static void test_poll_heartbeat_lost_is_a_loss_in_time(void)
{
    come_up();
    enable();
    twin.drive[2].node.has_no_heartbeat = true;
    TEST_ASSERT_TRUE(cycles_to_loss(CIA402_LOST_HEARTBEAT, DRIVE_OFFLINE) <= 152);
}

static void test_poll_boot_up_in_mid_run_is_a_loss_at_once(void)
{
    come_up();
    enable();
    canopen_drives_power(&twin, 2, true);
    twin.drive[2].node.boot_due_us = now_us;
    TEST_ASSERT_TRUE(cycles_to_loss(CIA402_REBOOTED, DRIVE_OFFLINE) <= 2);
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL_UINT32(2, twin.drive[2].boots); /* not reset once more */
    enable();
}

static void test_poll_node_that_leaves_operational_is_lost(void)
{
    come_up();
    enable();
    twin.drive[2].node.nmt = 0x7F;
    const unsigned count = cycles_to_loss(CIA402_LOST_TPDO, DRIVE_OFFLINE);
    TEST_ASSERT_TRUE(count <= 4 * PERIOD + 1);
}

static void test_poll_torque_gone_by_itself_is_seen_in_a_period(void)
{
    come_up();
    enable();
    canopen_drives_drop(&twin, 2);
    TEST_ASSERT_TRUE(cycles_to_loss(0, DRIVE_DISABLED) <= PERIOD + 1);
    TEST_ASSERT_EQUAL_HEX32(CIA402_FELL_OUT, report(2).code);
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].node.drive.enabled); /* nobody enables it again by itself */
}

/* One after the other, while nobody has stopped the rest yet: each is told. */
static void test_poll_torque_gone_from_several_drives_is_told_of_each(void)
{
    come_up();
    enable();
    canopen_drives_drop(&twin, 2);
    cycles(2 * PERIOD);
    canopen_drives_drop(&twin, 5);
    cycles(2 * PERIOD);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(k == 2 || k == 5 ? DRIVE_DISABLED : DRIVE_ENABLED, feedback[k].state);
    }
    TEST_ASSERT_EQUAL_HEX32(CIA402_FELL_OUT, report(5).code);
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[5].node.drive.enabled);
}

static void test_poll_fault_has_the_code_of_its_emergency(void)
{
    come_up();
    enable();
    canopen_drives_fault(&twin, 2, 0x3210);
    TEST_ASSERT_TRUE(cycles_to_loss(0x3210, DRIVE_FAULT) <= PERIOD + 1);
    TEST_ASSERT_EQUAL_STRING("over-voltage of the DC link", report(2).trouble);
}

static void test_poll_fault_without_emergency_is_looked_up(void)
{
    come_up();
    enable();
    twin.drive[2].node.is_mute = true;
    canopen_drives_fault(&twin, 2, 0x7305);
    twin.drive[2].node.is_mute = false;
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    cycles(20);
    TEST_ASSERT_EQUAL_HEX32(0x7305, feedback[2].fault_code);
}

/* Neither a question that is never answered nor an emergency of "no error" makes a fault anything else. */
static void test_poll_fault_without_any_code_is_a_fault_all_the_same(void)
{
    come_up();
    enable();
    twin.drive[2].node.is_sdo_silent = true;
    twin.drive[2].node.is_mute = true;
    canopen_drives_fault(&twin, 2, 0x7305);
    twin.drive[2].node.is_mute = false;
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    cycles(1000);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(0x1000, feedback[2].fault_code);
    twin.drive[2].node.is_sdo_silent = false;
}

static void say(uint32_t id, uint8_t length, uint16_t code)
{
    const can_frame_t frame = {.id = id, .length = length, .data = {(uint8_t)code, (uint8_t)(code >> 8)}};
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
}

static void test_poll_emergency_comes_before_what_is_looked_up(void)
{
    come_up();
    enable();
    twin.drive[2].node.is_sdo_silent = true;
    twin.drive[2].node.is_mute = true;
    canopen_drives_fault(&twin, 2, 0x7305);
    twin.drive[2].node.is_mute = false;
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    say(0x83, 2, 0x4310); /* too short */
    say(0x83, 8, 0x0000);
    cycles(2);
    TEST_ASSERT_EQUAL_HEX32(0x1000, feedback[2].fault_code);
    say(0x83, 8, 0x3210);
    say(0x83, 8, 0x0000); /* "no error" comes with a reset, and says nothing about the fault */
    cycles(2);
    TEST_ASSERT_EQUAL_HEX32(0x3210, feedback[2].fault_code);
    twin.drive[2].node.is_sdo_silent = false;
    cycles(500);
    TEST_ASSERT_EQUAL_HEX32(0x3210, feedback[2].fault_code);
}

static void test_poll_fault_during_a_change_of_mode_is_looked_up_afterwards(void)
{
    come_up();
    twin.drive[2].node.is_sdo_silent = true;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    cycles(20);
    twin.drive[2].node.is_mute = true;
    canopen_drives_fault(&twin, 2, 0x7305);
    twin.drive[2].node.is_mute = false;
    twin.drive[2].node.is_sdo_silent = false;
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    cycles(20);
    TEST_ASSERT_EQUAL_HEX32(0x7305, feedback[2].fault_code);
}

/* A drive that is still braking in its fault. */
static void test_poll_fault_reaction_is_a_fault_at_once(void)
{
    come_up();
    enable();
    twin.drive[2].node.drive.state = twin.drive[2].node.drive.next_state = TWIN_REACTION;
    TEST_ASSERT_TRUE(cycles_to_loss(0x1000, DRIVE_FAULT) <= PERIOD + 1);
    TEST_ASSERT_EQUAL_STRING("fault", report(2).phase);
    say(0x83, 8, 0x5400);
    cycles(2 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(0x5400, feedback[2].fault_code);
}

/* Bit 13; in IP it means nothing. */
static void test_poll_drive_that_cannot_follow_is_stopped(void)
{
    static const cia402_mode_t k_modes[] = {CIA402_MODE_CSP, CIA402_MODE_PP, CIA402_MODE_IP};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        config.mode = k_modes[i];
        come_up();
        enable();
        twin.drive[2].node.drive.bits_set = 0x2000;
        cycles(2 * PERIOD);
        TEST_ASSERT_EQUAL(k_modes[i] == CIA402_MODE_IP ? DRIVE_ENABLED : DRIVE_FAULT, feedback[2].state);
        TEST_ASSERT_EQUAL_HEX32(k_modes[i] == CIA402_MODE_IP ? 0 : 0x8611, feedback[2].fault_code);
        TEST_ASSERT_FALSE(drive_guard_is_found(&feedback[2].guard)); /* the drive says so itself */
        cycles(2 * PERIOD);
        TEST_ASSERT_EQUAL_UINT32(k_modes[i] == CIA402_MODE_IP ? 0 : 1, twin.drive[2].quick_stops);
    }
}

/* A drive that does not come out of its quick stop by itself. */
static void test_quick_stop_that_never_ends_ends_without_voltage(void)
{
    come_up();
    enable();
    twin.drive[2].is_stuck = true;
    twin.drive[2].stuck_at = 0x07;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(4900);
    TEST_ASSERT_EQUAL_HEX16(0x0002, canopen_drives_object(&twin, 2, 0x6040, 0)->value);
    TEST_ASSERT_EQUAL_STRING("stopping", report(2).phase);
    cycles(200);
    TEST_ASSERT_EQUAL_HEX16(0x0000, canopen_drives_object(&twin, 2, 0x6040, 0)->value);
}

static void test_request_reset_twice_is_one_edge(void)
{
    come_up();
    enable();
    canopen_drives_fault(&twin, 2, 0x2310);
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(2 * PERIOD);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    cycles(20 * PERIOD);
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].resets);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[2].state);
}

/* What went while the reset was on its way is history: the next fault has its own code. */
static void test_request_reset_of_a_fault_that_goes_by_itself(void)
{
    come_up();
    enable();
    canopen_drives_fault(&twin, 2, 0x2310);
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    canopen_drives_drop(&twin, 2);
    await(DRIVE_DISABLED, 20 * PERIOD);
    cycles(10 * PERIOD);
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    twin.drive[2].node.is_mute = true;
    canopen_drives_fault(&twin, 2, 0x7305);
    twin.drive[2].node.is_mute = false;
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    cycles(20);
    TEST_ASSERT_EQUAL_HEX32(0x7305, feedback[2].fault_code);
}

static void test_request_reset_is_one_edge_and_only_when_asked(void)
{
    come_up();
    enable();
    canopen_drives_fault(&twin, 2, 0x2310);
    (void)cycles_until(2, DRIVE_FAULT, 3 * PERIOD);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(2000);
    TEST_ASSERT_EQUAL_UINT32(0, twin.drive[2].resets);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 100);
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].resets);
    canopen_drives_fault(&twin, 2, 0x2310);
    cycles(500);
    TEST_ASSERT_EQUAL_UINT32(1, twin.drive[2].resets);
    TEST_ASSERT_EQUAL_UINT32(0, twin.drive[3].resets);
}

static void listen_to_silence(unsigned ms)
{
    while (ms-- > 0) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
    }
}

/* --- Whether the torque is off --- */

static bool has_power(unsigned k)
{
    const uint16_t status = twin.drive[k].node.drive.state;
    return status == 0x27 || status == 0x07 || status == 0x23;
}

static unsigned energized(void)
{
    unsigned count = 0;
    for (unsigned k = 0; k < AXES; k++) {
        count += feedback[k].is_energized;
    }
    return count;
}

/* What a drive is said to be without stays off, whatever it was at when it was asked to go off; and it is not said late. */
static void off_is_told_once_it_is_so(uint8_t every, unsigned step)
{
    for (unsigned i = 0; i < 260; i += step) {
        setUp();
        config.answer_every = every;
        come_up();
        cycles(5 * PERIOD);
        TEST_ASSERT_EQUAL_UINT(0, energized());
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        for (unsigned n = 0; n < i; n++) {
            (void)!cycle();
            follow_actual();
        }
        twin.drive[3].node.tpdo_drop = i / step % 3; /* its answer is late */
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, i / step % 2 == 0 ? DRIVES_DISABLE : DRIVES_QUICK_STOP));
        unsigned since = 0;
        for (unsigned n = 0; n < 400; n++) {
            (void)!cycle();
            bool is_any = false;
            for (unsigned k = 0; k < AXES; k++) {
                TEST_ASSERT_TRUE(feedback[k].is_energized || !has_power(k));
                is_any |= has_power(k);
            }
            since = is_any ? 0 : since + 1u;
            TEST_ASSERT_TRUE(since < 8 * PERIOD * every || energized() == 0);
        }
        TEST_ASSERT_EQUAL_UINT(0, energized());
    }
}

static void test_off_is_told_once_it_is_so_whenever_it_is_asked_for(void)
{
    off_is_told_once_it_is_so(1, 1);
}

static void test_off_is_told_once_it_is_so_where_answers_are_rare(void)
{
    off_is_told_once_it_is_so(3, 5);
}

/* It hears what it is told, but nobody hears it. */
static void test_off_is_not_told_of_a_drive_that_falls_silent_while_it_is_switched_on(void)
{
    for (unsigned i = 0; i < 60; i++) {
        setUp();
        come_up();
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        cycles(i);
        twin.drive[3].node.is_mute = true;
        for (unsigned n = 0; n < 500; n++) {
            (void)!cycle();
            TEST_ASSERT_TRUE(feedback[3].is_energized || !has_power(3));
        }
    }
}

/* Nobody knows of a drive that was lost; one that has started again has no torque. */
static void test_off_of_a_drive_that_is_lost_is_as_it_was_heard_last(void)
{
    start();
    cycles(1);
    TEST_ASSERT_EQUAL_UINT(0, energized());
    await(DRIVE_DISABLED, 5000);
    enable();
    twin.drive[2].node.is_mute = true;
    canopen_drives_power(&twin, 4, false);
    cycles(1000);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[2].state);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[4].state);
    TEST_ASSERT_TRUE(feedback[2].is_energized && feedback[4].is_energized);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    cycles(500);
    TEST_ASSERT_EQUAL_UINT(2, energized());
    twin.drive[2].node.is_mute = false;
    canopen_drives_power(&twin, 4, true);
    while (feedback[4].is_energized) {
        (void)!cycle();
        TEST_ASSERT_TRUE(now_us < 60000000);
    }
    TEST_ASSERT_LESS_THAN(CIA402_STARTING, driver.axis[4].phase); /* its boot-up message says so */
    await(DRIVE_DISABLED, 5000);
    cycles(5 * PERIOD);
    TEST_ASSERT_EQUAL_UINT(0, energized());
}

static void test_leave_drives_without_torque_forget_the_gateway(void)
{
    come_up();
    cia402_leave(&driver);
    listen_to_silence(1000);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(2, twin.drive[k].boots);
        TEST_ASSERT_EQUAL_HEX32(0, canopen_drives_object(&twin, k, 0x603F, 0)->value); /* no 8130h */
    }
}

static void test_leave_drives_with_torque_are_left_to_their_watchdogs(void)
{
    come_up();
    enable();
    cia402_leave(&driver);
    listen_to_silence(90); /* the last heartbeat is up to 50 ms old */
    TEST_ASSERT_EQUAL_HEX16(0x27, twin.drive[0].node.drive.state);
    listen_to_silence(70);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(1, twin.drive[k].boots);
        TEST_ASSERT_EQUAL_HEX16(0x08, twin.drive[k].node.drive.state);
    }
}

static void test_leave_says_nothing_to_drives_that_are_not_there(void)
{
    canopen_drives_power(&twin, 6, false);
    start();
    cycles(500);
    spy();
    cia402_leave(&driver);
    TEST_ASSERT_EQUAL_UINT(AXES - 1, sents);
    TEST_ASSERT_EQUAL_UINT(0, count_sent(0, (const uint8_t[2]){0x82, 7}, 2));
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
    cycles(1);
    sents = 0;
    cia402_leave(&driver);
    TEST_ASSERT_EQUAL_UINT(0, sents);
}

/* --- The bus --- */

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
    for (size_t i = 0; i < 6; i++) {
        setUp();
        come_up();
        spy();
        spying.bus_state = tell_state;
        told_state = k_rows[i].state;
        told_status = k_rows[i].status;
        TEST_ASSERT_EQUAL(k_rows[i].expected, cycle());
        TEST_ASSERT_TRUE(are_all(k_rows[i].expected == HV_OK ? DRIVE_DISABLED : DRIVE_OFFLINE));
    }
}

/* The controller came back by itself: nothing is known of what went on meanwhile. */
static void test_bus_restarted_by_itself_loses_every_drive(void)
{
    come_up();
    enable();
    sim_can_report(&node, CAN_ERROR_RESTARTED);
    TEST_ASSERT_EQUAL(HV_ERR_IO, cycle());
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_BUS, feedback[0].fault_code);
    await(DRIVE_FAULT, 5000); /* they were reset with torque on */
}

static unsigned restart_calls;
static hv_status_t restart_status;

static hv_status_t restart(void *ctx)
{
    restart_calls++;
    return restart_status == HV_OK ? sim_can_hal(&node).ops->restart(ctx) : restart_status;
}

static void test_bus_that_cannot_be_restarted_is_tried_twice_a_second(void)
{
    come_up();
    spy();
    spying.restart = restart;
    restart_calls = 0;
    restart_status = HV_ERR_AGAIN;
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
    cycles(3000);
    TEST_ASSERT_UINT_WITHIN(1, 6, restart_calls);
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_BUS, feedback[0].fault_code);
    restart_status = HV_OK;
    await(DRIVE_DISABLED, 5000);
}

/* A backend that cannot restart anything: the bus is taken back when it works again by itself, and not before. */
static void test_bus_without_restart_comes_back_when_it_works(void)
{
    come_up();
    spy();
    spying.restart = NULL;
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
    cycles(3000);
    TEST_ASSERT_EQUAL_UINT32(0, driver.restarts);
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(hal, DRIVES_DISABLE));
    sim_can_set_state(&node, HAL_CAN_ACTIVE);
    await(DRIVE_DISABLED, 5000);
    TEST_ASSERT_EQUAL_UINT32(1, driver.restarts);
}

/* Drives that watch the heartbeat for longer are left alone for longer. */
static void test_bus_off_keeps_silent_for_as_long_as_the_drives_watch(void)
{
    config.heartbeat_timeout_ms = 1000;
    come_up();
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
    cycles(1499);
    TEST_ASSERT_EQUAL_UINT32(0, driver.restarts);
    cycles(10);
    TEST_ASSERT_EQUAL_UINT32(1, driver.restarts);
}

static void test_bus_without_echoes_is_trusted(void)
{
    start();
    spy();
    spying.unconfirmed = NULL;
    await(DRIVE_DISABLED, 5000);
    enable();
    const uint32_t before = twin.drive[0].setpoints;
    cycles(400);
    TEST_ASSERT_UINT32_WITHIN(2, 100, twin.drive[0].setpoints - before);
}

/* From 1 to 5 and round; one that found no room is not counted. */
static void test_sync_counter_goes_round_without_a_gap(void)
{
    config.sync_counter = 5;
    config.is_sync_watched = true;
    come_up();
    TEST_ASSERT_EQUAL_HEX32(5, canopen_drives_object(&twin, 3, 0x1019, 0)->value);
    TEST_ASSERT_EQUAL_HEX32(PERIOD * CYCLE_US, canopen_drives_object(&twin, 3, 0x1006, 0)->value);
    enable();
    spy();
    uint8_t count = 0;
    for (unsigned i = 0; i < 200; i++) {
        refused_id = i % 17 == 0 ? 0x80 : UINT32_MAX;
        (void)!cycle();
    }
    for (unsigned i = 0; i < sents; i++) {
        if (sent[i].id == 0x80) {
            TEST_ASSERT_EQUAL_UINT8(1, sent[i].length);
            TEST_ASSERT_TRUE(count == 0 || sent[i].data[0] == count % 5 + 1);
            count = sent[i].data[0];
        }
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

/* This program stood still for some periods: SYNCs that were not sent are not made up for. */
static void test_sync_that_comes_late_begins_a_new_time(void)
{
    come_up();
    cycles(PERIOD);
    const uint32_t syncs = driver.syncs;
    now_us += 5 * PERIOD * CYCLE_US;
    (void)!cycle();
    TEST_ASSERT_EQUAL_UINT32(syncs + 1, driver.syncs);
    cycles(PERIOD - 1);
    TEST_ASSERT_EQUAL_UINT32(syncs + 1, driver.syncs);
    cycles(1);
    TEST_ASSERT_EQUAL_UINT32(syncs + 2, driver.syncs);
}

static void test_heartbeat_that_finds_no_room_is_sent_as_soon_as_there_is(void)
{
    static const uint8_t k_operational[1] = {0x05};
    come_up();
    spy();
    refused_id = 0x700 + 127;
    cycles(100);
    refused_id = UINT32_MAX;
    cycles(2);
    TEST_ASSERT_EQUAL_UINT(1, count_sent(0x700 + 127, k_operational, 1));
    cycles(100);
    TEST_ASSERT_UINT_WITHIN(1, 3, count_sent(0x700 + 127, k_operational, 1));
    TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
}

static void test_bus_that_is_unplugged_is_gone_at_once_and_comes_back(void)
{
    come_up();
    enable();
    sim_can_unplug(&node);
    TEST_ASSERT_EQUAL(HV_ERR_IO, cycle());
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    cycles(1000);
    TEST_ASSERT_TRUE(are_all(DRIVE_OFFLINE));
    sim_can_plug(&node);
    await(DRIVE_FAULT, 10000); /* by their watch over the heartbeat */
}

/* A drive is not asked for anything before it has been told to leave operational, or to reset. */
static void test_setup_waits_for_room_for_its_nmt_commands(void)
{
    start();
    spy();
    refused_id = 0;
    cycles(1000);
    TEST_ASSERT_EQUAL_UINT(0, count_sent(0x601, (const uint8_t[8]){0x40, 0x00, 0x10, 0x00}, 8));
    refused_id = UINT32_MAX;
    for (unsigned i = 0; i < 1000 && driver.axis[0].nmt_command == 0; i++) {
        (void)!cycle();
        refused_id = driver.is_preop_due ? UINT32_MAX : 0;
    }
    sents = 0;
    cycles(500);
    TEST_ASSERT_TRUE(driver.axis[0].nmt_command != 0);
    for (unsigned i = 0; i < sents; i++) {
        TEST_ASSERT_TRUE(sent[i].id != 0x601);
    }
    refused_id = UINT32_MAX;
    await(DRIVE_DISABLED, 5000);
}

/* Remote requests, and identifiers of 29 bits that look alike, are other people's; a boot-up message has one byte. */
static void test_frames_for_others_are_not_heard(void)
{
    const can_frame_t boots[] = {{.id = 0x703, .length = 1, .is_rtr = true},
                                 {.id = 0x703, .length = 1, .is_extended = true},
                                 {.id = 0x703, .length = 2},
                                 {.id = 0x283, .length = 8}};
    const hal_can_t others = sim_can_hal(&twin.node);
    sim_can_bus_init(&bus, 0, NULL, 0);
    canopen_drives_open(&twin, &bus);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, NULL, 0)); /* without filters */
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&node)));
    hal = cia402_hal(&driver);
    await(DRIVE_DISABLED, 5000);
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(others, &boots[i]));
        cycles(3);
        TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
    }
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(others, &(can_frame_t){.id = 0x703, .length = 1}));
    cycles(3);
    TEST_ASSERT_EQUAL_HEX32(CIA402_REBOOTED, feedback[2].fault_code);
}

/* What a configuration owns is all that is ever sent. */
static void test_owns_covers_every_frame_that_is_sent(void)
{
    hal_can_filter_t own[CIA402_OWNS_MAX];
    const uint32_t owns = cia402_owns(&config, own);
    TEST_ASSERT_EQUAL_UINT32(3 + 2 * AXES, owns);
    start();
    spy();
    await(DRIVE_DISABLED, 5000);
    enable();
    for (unsigned i = 0; i < sents; i++) {
        bool is_own = false;
        for (uint32_t n = 0; n < owns; n++) {
            is_own |= ((sent[i].id ^ own[n].id) & own[n].mask) == 0;
        }
        TEST_ASSERT_TRUE(is_own && !sent[i].is_extended && !sent[i].is_rtr);
    }
}

/* Whatever was on its way when the bus went: the first of them leaves in the cycle of the restart, or in the next one. */
static void test_bus_off_ended_syncs_go_on_at_their_period(void)
{
    for (unsigned phase = 0; phase < PERIOD; phase++) {
        setUp();
        come_up();
        cycles(phase);
        sim_can_set_state(&node, HAL_CAN_BUS_OFF);
        const uint32_t restarts = driver.restarts;
        const uint32_t syncs = driver.syncs;
        for (unsigned n = 0; n < 4000 && driver.restarts == restarts; n++) {
            (void)!cycle();
        }
        TEST_ASSERT_EQUAL_UINT32(restarts + 1, driver.restarts);
        cycles(1);
        TEST_ASSERT_EQUAL_UINT32(syncs + 1, driver.syncs);
        cycles(PERIOD - 2);
        for (unsigned n = 1; n <= 5; n++) {
            TEST_ASSERT_EQUAL_UINT32(syncs + n, driver.syncs);
            cycles(PERIOD);
        }
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
        TEST_ASSERT_EQUAL_HEX16(0x08, twin.drive[k].node.drive.state); /* 6007h = 1: they found out by themselves */
    }
    cycles(4000);
    TEST_ASSERT_TRUE(are_all(DRIVE_FAULT));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 200);
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_INT32(0, twin.drive[k].largest_step);
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
    come_up();
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

/* A queue that is one frame too short for a set: each begins and none is whole. */
static void test_bus_that_never_takes_a_whole_set_is_gone_after_three_periods(void)
{
    come_up();
    enable();
    spy();
    refused_id = 0x207;
    unsigned count = 0;
    while (!are_all(DRIVE_OFFLINE) && count++ < 100) {
        (void)!cycle();
    }
    TEST_ASSERT_UINT_WITHIN(PERIOD / 2, 3 * PERIOD + PERIOD / 2, count);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LOST_BUS, feedback[0].fault_code);
    refused_id = UINT32_MAX;
    await(DRIVE_FAULT, 10000); /* by their watch over the heartbeat */
}

/* No room for every eleventh frame of anybody: what found none is sent again, or asked for again. */
static void test_bus_whose_queue_is_full_now_and_then_hinders_nothing(void)
{
    static sim_can_fault_t plan[2000];
    for (uint32_t i = 0; i < 2000; i++) {
        plan[i] = (sim_can_fault_t){SIM_CAN_FULL, 11 * (i + 1), 0};
    }
    bus.plan = plan;
    bus.planned = 2000;
    come_up();
    enable();
    const uint32_t sets = driver.sets;
    for (unsigned i = 0; i < 200; i++) {
        const hv_status_t status = cycle();
        TEST_ASSERT_TRUE(status == HV_OK);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 100;
        }
    }
    TEST_ASSERT_TRUE(bus.sends < 22000 && driver.refused > 0);
    TEST_ASSERT_UINT32_WITHIN(5, 50, driver.sets - sets);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(twin.drive[k].largest_step <= 80);
        TEST_ASSERT_EQUAL_HEX32(0x607A0020, canopen_drives_object(&twin, k, 0x1600, 2)->value);
    }
}

/* Asked for behind the SYNC, before the set of that period: the set carries it, and nothing is sent twice. */
static void test_request_quick_stop_goes_with_the_set_that_is_due(void)
{
    come_up();
    enable();
    for (unsigned i = 0; i <= PERIOD && !driver.is_open; i++) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
        (void)!drives_poll(hal, now_us, feedback);
    }
    TEST_ASSERT_TRUE(driver.is_open);
    spy();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
    TEST_ASSERT_EQUAL_UINT(0, sents);
    TEST_ASSERT_EQUAL(HV_OK, drives_send(hal, now_us, setpoint_q32));
    TEST_ASSERT_EQUAL_UINT(AXES, sents);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_HEX32(0x201 + k, sent[k].id);
        TEST_ASSERT_EQUAL_HEX16(0x0002, sent[k].data[0] | sent[k].data[1] << 8);
    }
}

static void test_send_slow_bus_refuses_instead_of_queueing(void)
{
    come_up();
    enable();
    bus.frame_us = 700; /* a set takes 10 ms */
    unsigned refused = 0;
    for (int i = 0; i < 10; i++) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
        (void)!drives_poll(hal, now_us, feedback);
        refused += drives_send(hal, now_us, setpoint_q32) == HV_ERR_AGAIN;
        TEST_ASSERT_TRUE(node.tx_count <= 1 + AXES + 1);
    }
    TEST_ASSERT_TRUE(refused > 0);
}

/* A bus as it is: 1 Mbit/s, the drives at its other end, and a queue of the kernel that takes so many frames. */
#define FRAME_US 111u /* of 8 bytes, with stuff bits */
#define STEP_US  100u
#define UP       4000u /* cycles */
#define MOVING   6000u
#define STANDING 9000u
#define END      10000u

static hv_status_t cycle_of_wire(void)
{
    for (unsigned i = 0; i < CYCLE_US / STEP_US; i++) {
        now_us += STEP_US;
        canopen_drives_step(&twin, now_us);
    }
    (void)!drives_poll(hal, now_us, feedback);
    return drives_send(hal, now_us, setpoint_q32);
}

/* Three seconds of motion: each set-point arrives, and none of them late or twice. Returns how often one had to wait. */
static unsigned ride(unsigned period, uint32_t room)
{
    unsigned refused = 0;
    uint32_t before[AXES] = {0};
    setUp();
    config.period_us = period * CYCLE_US;
    bus.frame_us = FRAME_US;
    start();
    node.room = room;
    for (unsigned n = 0; n < MOVING; n++) {
        follow_actual();
        (void)!cycle_of_wire();
        if (n == UP) {
            TEST_ASSERT_TRUE(are_all(DRIVE_DISABLED));
            TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        }
    }
    for (unsigned k = 0; k < AXES; k++) {
        before[k] = twin.drive[k].setpoints;
    }
    for (unsigned n = MOVING; n < END; n++) {
        for (unsigned k = 0; k < AXES && n < STANDING; k++) {
            setpoint_q32[k] += MM(1) / 100;
        }
        refused += cycle_of_wire() != HV_OK;
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    }
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_INT_WITHIN(1, (END - MOVING) / period, twin.drive[k].setpoints - before[k]);
        TEST_ASSERT_INT_WITHIN(1, 130000 + 1000 * (int32_t)k, canopen_drives_position(&twin, k));
        TEST_ASSERT_EQUAL_INT32(10 * period, twin.drive[k].largest_step);
    }
    TEST_ASSERT_EQUAL_UINT32(0, driver.restarts);
    return refused;
}

/* 2 ms leave 17 % of the wire: SYNC is late by a cycle once, and stays so. */
static void test_bus_of_1_mbit_with_a_queue_carries_every_set_point(void)
{
    static const uint32_t k_rooms[] = {10, 16}; /* the kernel's own, and what the manual asks for */
    for (unsigned i = 0; i < 2; i++) {
        TEST_ASSERT_EQUAL_UINT(0, ride(4, k_rooms[i]));
        (void)ride(2, k_rooms[i]);
    }
}

/* --- Homing --- */

static void home(bool is_in_turn)
{
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k].homing_method = k == absolute ? 0 : 17;
        config.axis[k].homing_offset_counts = 500;
    }
    config.is_homing_in_turn = is_in_turn;
    come_up();
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(k == absolute, feedback[k].is_homed);
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
}

static void test_request_home_finds_the_zero_of_all_and_returns_without_a_jump(void)
{
    for (unsigned turn = 0; turn < 3; turn++) {
        setUp();
        absolute = turn == 2 ? 0 : 6;
        home(turn != 0);
        const uint64_t begin_us = now_us;
        await(DRIVE_ENABLED, 5000);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(feedback[k].is_homed);
            TEST_ASSERT_EQUAL_INT32(k == absolute ? 100000 + 1000 * (int32_t)k : 500, canopen_drives_position(&twin, k));
            TEST_ASSERT_EQUAL_INT32(0, twin.drive[k].largest_step);
            TEST_ASSERT_EQUAL_INT8(8, twin.drive[k].node.drive.mode);
        }
        TEST_ASSERT_TRUE(now_us - begin_us < (turn != 0 ? 1000000u : 400000u));
        TEST_ASSERT_TRUE(now_us - begin_us > (turn != 0 ? 300000u : 50000u));
    }
}

static void test_request_home_one_failure_stops_all(void)
{
    twin.drive[3].node.drive.is_homing_broken = true;
    home(false);
    (void)cycles_until(3, DRIVE_FAULT, 3000);
    TEST_ASSERT_EQUAL_HEX32(0x8613, feedback[3].fault_code);
    cycles(50);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(twin.drive[k].node.drive.state != 0x27);
    }
}

static void test_request_home_again_is_not_over_before_it_begins(void)
{
    home(false);
    await(DRIVE_ENABLED, 5000);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    await(DRIVE_DISABLED, 200);
    canopen_drives_place(&twin, 0, 7000);
    cycles(2 * PERIOD);
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    await(DRIVE_ENABLED, 5000);
    TEST_ASSERT_EQUAL_INT32(500, canopen_drives_position(&twin, 0));
}

/* "Done" that never was "not done" may be that of the last homing: it is believed after a while. */
static void test_request_home_of_a_drive_that_is_there_already_ends(void)
{
    home(false);
    await(DRIVE_ENABLED, 5000);
    twin.drive[3].node.drive.home = twin.drive[3].node.drive.motor.actual;
    twin.drive[3].node.drive.bits_set = 0x1400;
    const uint64_t begin_us = now_us;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    await(DRIVE_ENABLED, 5000);
    TEST_ASSERT_TRUE(now_us - begin_us >= 500000 && now_us - begin_us < 1000000);
}

static void test_quirk_homing_without_bit_10_ends_when_the_drive_stands(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        build_all(QUIRK_NO_BIT_10);
        home(false);
        await(DRIVE_ENABLED, 5000);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL_INT32(k == absolute ? 100000 + 1000 * (int32_t)k : 500, canopen_drives_position(&twin, k));
            TEST_ASSERT_EQUAL_INT32(0, twin.drive[k].largest_step);
        }
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
    await(DRIVE_DISABLED, 200);
    cycles(20 * PERIOD);
    twin.drive[3].node.drive.bits_set = 0x1000; /* bit 12 is left from the last homing: not done while it moves, or just waits */
    canopen_drives_place(&twin, 3, 60000);
    cycles(2 * PERIOD);
    enable();
    const uint64_t begin_us = now_us;
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    await(DRIVE_ENABLED, 12000);
    TEST_ASSERT_TRUE(now_us - begin_us >= 5000000);
    TEST_ASSERT_EQUAL_INT32(500, canopen_drives_position(&twin, 3));
}

static void test_quirk_homing_that_does_not_end_is_named(void)
{
    home(false);
    twin.drive[3].node.drive.bits_clear = 0x1400;
    (void)cycles_until(3, DRIVE_FAULT, 119000);
    TEST_ASSERT_EQUAL_HEX32(CIA402_HOMING_LATE, feedback[3].fault_code);
    cycles(50);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(twin.drive[k].node.drive.state != 0x27);
        TEST_ASSERT_EQUAL(k == 3 ? DRIVE_FAULT : DRIVE_DISABLED, feedback[k].state);
    }
}

/* The error of the last homing is still shown when the next one begins. */
static void test_request_home_after_one_that_failed(void)
{
    home(false);
    twin.drive[3].node.drive.bits_set = 0x2000;
    for (unsigned i = 0; i < 1000 && !is_homing(3); i++) {
        (void)!cycle();
    }
    TEST_ASSERT_TRUE(is_homing(3));
    twin.drive[3].node.drive.bits_set = 0;
    await(DRIVE_ENABLED, 5000);
    TEST_ASSERT_TRUE(feedback[3].is_homed);
}

static void test_power_lost_means_that_the_zero_is_lost(void)
{
    home(false);
    await(DRIVE_ENABLED, 5000);
    canopen_drives_power(&twin, 1, true);
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
            canopen_drives_fault(&twin, axis, 0x5000);
            break;
        case 1:
            canopen_drives_power(&twin, axis, true);
            break;
        case 2:
            twin.drive[axis].node.is_mute = true;
            break;
        case 3:
            canopen_drives_drop(&twin, axis);
            break;
        default:
            twin.drive[axis].node.nmt = 0x04;
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
            TEST_ASSERT_EQUAL_INT32(0, twin.drive[k].largest_step);
            TEST_ASSERT_EQUAL_INT32(100000 + 1000 * (int32_t)k, canopen_drives_position(&twin, k));
        }
    }
}

static void contradict(unsigned row)
{
    cia402_axis_config_t *axis = &config.axis[2];
    switch (row) {
    case 0:
        config.axes = 0;
        break;
    case 1:
        config.axes = DRIVES_MAX + 1;
        break;
    case 2:
        axis->node = 1; /* that of the first */
        break;
    case 3:
        axis->node = 0;
        break;
    case 4:
        axis->node = 127; /* the gateway's */
        break;
    case 5:
        axis->node = 128;
        break;
    case 6:
        config.period_us = 4050;
        break;
    case 7:
        config.sync_counter = 1;
        break;
    case 8:
        config.sync_counter = 241;
        break;
    case 9:
        config.heartbeat_ms = 0;
        break;
    case 10:
        config.heartbeat_timeout_ms = config.heartbeat_ms;
        break;
    case 11:
        config.sdo_timeout_ms = 0;
        break;
    case 12:
        config.mode = CIA402_MODE_HOMING;
        break;
    case 13:
        config.master_node = 0;
        break;
    case 14:
        config.master_node = 128;
        break;
    case 15:
        axis->scale.num = 0;
        break;
    case 16:
        axis->step_max_q32 = 0;
        break;
    default:
        axis->following_max_q32 = -1;
        break;
    }
}

static void test_init_contradictions_are_refused(void)
{
    const hal_can_t can = sim_can_hal(&twin.node);
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, can));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, cia402_init(&driver, &config, (hal_can_t){NULL, NULL}));
    for (unsigned row = 0; row < 18; row++) {
        configure();
        contradict(row);
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, can));
    }
    static const cia402_mode_t k_modes[] = {CIA402_MODE_CSP, CIA402_MODE_IP, CIA402_MODE_PP};
    static const uint8_t k_counters[] = {0, 2, 240};
    for (size_t i = 0; i < 3; i++) {
        configure();
        config.mode = k_modes[i];
        config.sync_counter = k_counters[i];
        TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, can));
    }
}

/* 60C2h: whole ms, or whole tenths, in eight bits. */
static void test_period_is_one_that_the_drives_can_hold(void)
{
    static const uint32_t k_good[] = {100, 500, 1000, 4000, 25500, 26000, 255000};
    static const uint32_t k_wrong[] = {0, 50, 4050, 25600, 256000};
    for (size_t i = 0; i < 7; i++) {
        TEST_ASSERT_TRUE(cia402_is_period(k_good[i]));
    }
    for (size_t i = 0; i < 5; i++) {
        TEST_ASSERT_FALSE(cia402_is_period(k_wrong[i]));
    }
}

/* --- What answers say beside state and position --- */

static const struct {
    cia402_watch_t watch;
    uint16_t set, clear; /* in the statusword */
    cia402_trouble_t code;
} k_watches[] = {
    {CIA402_WATCH_FOLLOWING, 0, CIA402_STATUS_BIT12, CIA402_NOT_FOLLOWING},
    {CIA402_WATCH_LOCAL, 0, CIA402_STATUS_REMOTE, CIA402_REMOTE_OFF},
    {CIA402_WATCH_VOLTAGE, 0, CIA402_STATUS_VOLTAGE, CIA402_NO_VOLTAGE},
    {CIA402_WATCH_LIMIT, CIA402_STATUS_LIMIT, 0, CIA402_LIMITED},
    {CIA402_WATCH_WARNING, CIA402_STATUS_WARNING, 0, CIA402_WARNING},
};
#define WATCHES (sizeof k_watches / sizeof k_watches[0])

static void show(unsigned drive, size_t row, bool is_shown)
{
    twin.drive[drive].node.drive.bits_set = is_shown ? k_watches[row].set : 0;
    twin.drive[drive].node.drive.bits_clear = is_shown ? k_watches[row].clear : 0;
}

static void test_watch_what_stops_is_a_fault_within_three_periods(void)
{
    for (size_t i = 0; i < WATCHES; i++) {
        setUp();
        config.reaction[k_watches[i].watch] = CIA402_STOP;
        come_up();
        enable();
        cycles(100);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        show(2, i, true);
        TEST_ASSERT_TRUE(cycles_until(2, DRIVE_FAULT, 100) <= 3 * PERIOD);
        TEST_ASSERT_EQUAL_HEX32(k_watches[i].code, feedback[2].fault_code);
        TEST_ASSERT_TRUE(report(2).trouble[0] != '\0');
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_QUICK_STOP));
        cycles(20);
        for (unsigned k = 0; k < AXES; k++) {
            TEST_ASSERT_EQUAL(k == 2 ? DRIVE_FAULT : DRIVE_DISABLED, feedback[k].state);
        }
    }
}

static void test_watch_single_answer_stops_nothing(void)
{
    for (size_t i = 0; i < WATCHES; i++) {
        setUp();
        config.reaction[k_watches[i].watch] = CIA402_STOP;
        come_up();
        enable();
        show(2, i, true);
        cycles(PERIOD);
        show(2, i, false);
        cycles(100);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        TEST_ASSERT_EQUAL_HEX32(0, report(2).notes);
    }
}

static void test_watch_what_is_told_stops_nothing_and_is_told_for_some_seconds(void)
{
    for (size_t i = 0; i < WATCHES; i++) {
        setUp();
        config.reaction[k_watches[i].watch] = CIA402_REPORT;
        come_up();
        enable();
        show(2, i, true);
        cycles(3 * PERIOD);
        show(2, i, false);
        cycles(4000);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        TEST_ASSERT_EQUAL_HEX32(1u << k_watches[i].watch, report(2).notes);
        TEST_ASSERT_EQUAL_HEX32(0, report(1).notes);
        TEST_ASSERT_TRUE(drive_note_text(k_watches[i].watch)[0] != '\0');
        cycles(1500);
        TEST_ASSERT_EQUAL_HEX32(0, report(2).notes);
    }
}

static void test_watch_what_is_ignored_is_not_told_of(void)
{
    come_up();
    enable();
    for (size_t i = 0; i < WATCHES; i++) {
        show(2, i, true);
        cycles(100);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        TEST_ASSERT_EQUAL_HEX32(0, report(2).notes);
    }
}

static void test_watch_mode_left_in_motion_is_a_fault(void)
{
    config.reaction[CIA402_WATCH_MODE] = CIA402_STOP;
    come_up();
    enable();
    twin.drive[4].node.drive.mode = 1;
    TEST_ASSERT_TRUE(cycles_until(4, DRIVE_FAULT, 100) <= 3 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LEFT_MODE, feedback[4].fault_code);
}

static void test_watch_interpolation_that_ends_is_a_fault(void)
{
    config.mode = CIA402_MODE_IP;
    config.reaction[CIA402_WATCH_FOLLOWING] = CIA402_STOP;
    come_up();
    enable();
    show(0, 0, true);
    TEST_ASSERT_TRUE(cycles_until(0, DRIVE_FAULT, 100) <= 3 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_FOLLOWING, feedback[0].fault_code);
}

/* Some never show them: they are not missed. */
static void test_watch_bits_that_a_drive_does_not_have_are_not_missed(void)
{
    config.reaction[CIA402_WATCH_FOLLOWING] = CIA402_STOP;
    config.reaction[CIA402_WATCH_VOLTAGE] = CIA402_STOP;
    config.power_timeout_ms = 900; /* without bit 12 it is believed after half a second */
    twin.drive[1].node.drive.bits_clear = CIA402_STATUS_BIT12 | CIA402_STATUS_VOLTAGE;
    come_up();
    enable();
    cycles(1000);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

static void test_watch_drive_under_local_control_is_not_enabled(void)
{
    config.reaction[CIA402_WATCH_LOCAL] = CIA402_STOP;
    show(5, 1, true);
    come_up();
    cycles(3 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(1u << CIA402_WATCH_LOCAL, report(5).notes);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
    (void)cycles_until(5, DRIVE_FAULT, 200);
    TEST_ASSERT_EQUAL_HEX32(CIA402_REMOTE_OFF, feedback[5].fault_code);
    cycles(200);
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(0, twin.drive[k].node.drive.enabled);
    }
    show(5, 1, false);
    cycles(100);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[5].state); /* never by itself */
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT));
    await(DRIVE_DISABLED, 100);
    enable();
}

/* Homing runs into a limit on purpose. */
static void test_watch_limit_while_homing_stops_nothing(void)
{
    config.reaction[CIA402_WATCH_LIMIT] = CIA402_STOP;
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k].homing_method = 17;
    }
    come_up();
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
    cycles(2);
    for (unsigned i = 0; i < 3000 && feedback[3].state == DRIVE_HOMING; i++) {
        show(3, 3, driver.stage == CIA402_STAGE_HOMING && is_homing(3));
        follow_actual();
        (void)!cycle();
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

/* --- Errors that drives tell of by themselves --- */

static void tell_error(unsigned drive, uint16_t code)
{
    const can_frame_t frame = {
        .id = 0x81u + drive, .length = 8, .data = {(uint8_t)code, (uint8_t)(code >> 8), 0x11, 1, 2, 3, 4, 5}};
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
    cycles(2);
}

static void test_emergency_is_reported_with_all_that_it_says(void)
{
    come_up();
    TEST_ASSERT_NULL(report(3).error);
    enable();
    tell_error(3, 0x4310);
    const drive_report_t r = report(3);
    TEST_ASSERT_EQUAL_HEX16(0x4310, r.emergency.code);
    TEST_ASSERT_EQUAL_HEX8(0x11, r.emergency.error_register);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){1, 2, 3, 4, 5}), r.emergency.maker, 5);
    TEST_ASSERT_EQUAL_UINT32(1, r.emergency.count);
    TEST_ASSERT_TRUE(now_us - r.emergency.at_us <= 2 * CYCLE_US && !r.emergency.is_over);
    TEST_ASSERT_EQUAL_STRING("the motor is too hot", r.error);
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    tell_error(3, 0);
    TEST_ASSERT_TRUE(report(3).emergency.is_over);
    TEST_ASSERT_EQUAL_HEX16(0x4310, report(3).emergency.code);
    TEST_ASSERT_EQUAL_UINT32(1, report(3).emergency.count);
}

static void test_emergency_is_kept_over_a_loss_and_over_with_a_boot(void)
{
    come_up();
    tell_error(2, 0x3220);
    canopen_drives_power(&twin, 2, false);
    (void)cycles_until(2, DRIVE_OFFLINE, 100);
    cycles(1000);
    TEST_ASSERT_EQUAL_HEX16(0x3220, report(2).emergency.code);
    TEST_ASSERT_FALSE(report(2).emergency.is_over);
    canopen_drives_power(&twin, 2, true);
    await(DRIVE_DISABLED, 3000);
    TEST_ASSERT_EQUAL_HEX16(0x3220, report(2).emergency.code);
    TEST_ASSERT_TRUE(report(2).emergency.is_over);
}

/* As stacks do that miss their SYNC. */
static void test_emergency_of_a_drive_that_stays_preoperational_is_the_reason(void)
{
    start();
    while (driver.axis[4].phase != CIA402_REFUSED) {
        twin.drive[4].node.nmt = twin.drive[4].node.nmt == 5 ? 0x7F : twin.drive[4].node.nmt;
        if (driver.axis[4].phase == CIA402_STARTING && (report(4).error == NULL || report(4).emergency.is_over)) {
            tell_error(4, 0x8100);
        }
        cycles(1);
    }
    const drive_report_t r = report(4);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NO_START, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x8100, r.detail_code);
    TEST_ASSERT_EQUAL_STRING(r.error, r.detail);
}

static void test_emergency_that_leaves_operational_is_the_reason(void)
{
    come_up();
    tell_error(1, 0x8100);
    twin.drive[1].node.nmt = 0x7F;
    twin.drive[1].node.beat_due_us = 0;
    (void)cycles_until(1, DRIVE_OFFLINE, 60);
    TEST_ASSERT_EQUAL_HEX32(CIA402_LEFT_OPERATIONAL, feedback[1].fault_code);
    TEST_ASSERT_EQUAL_HEX32(0x8100, report(1).detail_code);
}

/* --- Answers to every n-th SYNC --- */

static void test_rare_answers_carry_a_motion(void)
{
    config.answer_every = 4;
    come_up();
    TEST_ASSERT_EQUAL_UINT32(4, canopen_drives_object(&twin, 3, 0x1800, 2)->value);
    TEST_ASSERT_EQUAL_UINT32(0, canopen_drives_object(&twin, 3, 0x1800, 6)->value);
    enable();
    for (unsigned i = 0; i < 100; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 4;
        }
        cycles(PERIOD);
        TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
        TEST_ASSERT_TRUE(now_us - feedback[3].actual_us <= 5 * PERIOD * CYCLE_US);
    }
    TEST_ASSERT_INT_WITHIN(2000, 128000, canopen_drives_position(&twin, 3));
    TEST_ASSERT_TRUE(twin.drive[3].largest_step <= 250);
}

static void test_rare_answers_that_stay_away_are_a_loss_after_three_turns(void)
{
    config.answer_every = 4;
    come_up();
    enable();
    for (int i = 0; i < 5; i++) {
        twin.drive[2].node.tpdo_drop = 2;
        cycles(16 * PERIOD);
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
    twin.drive[2].node.is_mute = true;
    const unsigned count = cycles_to_loss(CIA402_LOST_TPDO, DRIVE_OFFLINE);
    TEST_ASSERT_TRUE(count <= 13 * PERIOD + 1 && count > 8 * PERIOD);
}

static void test_rare_answers_of_two_drives_are_told_apart(void)
{
    config.answer_every = 4;
    come_up();
    enable();
    const uint64_t begin_us = now_us;
    while (feedback[2].state != DRIVE_FAULT && now_us - begin_us < 400000) {
        const can_frame_t frame = {.id = 0x183, .length = 7, .data = {0x37, 0x12, 0xB0, 0x8E, 1, 0, 8}};
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
        cycles(4 * PERIOD);
    }
    TEST_ASSERT_EQUAL_HEX32(CIA402_TWICE, feedback[2].fault_code);
    TEST_ASSERT_TRUE(now_us - begin_us <= 3 * 4 * PERIOD * CYCLE_US);
}

/* With a counter that goes round in whole turns no SYNC is answered by more drives than need be. */
static void test_rare_answers_take_turns(void)
{
    uint32_t answers[4] = {0};
    config.answer_every = 4;
    config.sync_counter = 8;
    come_up();
    enable();
    for (unsigned k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(k % 4 + 1, canopen_drives_object(&twin, k, 0x1800, 6)->value);
    }
    for (unsigned i = 0; i < 40 * PERIOD; i++) {
        uint64_t before_us[AXES];
        for (unsigned k = 0; k < AXES; k++) {
            before_us[k] = feedback[k].actual_us;
        }
        cycles(1);
        for (unsigned k = 0; k < AXES; k++) {
            answers[k % 4] += feedback[k].actual_us != before_us[k];
            TEST_ASSERT_TRUE(feedback[k].actual_us == before_us[k] || twin.sync_number % 4 == (k + 1) % 4);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(20, answers[0]);
    TEST_ASSERT_EQUAL_UINT32(10, answers[3]);
}

static void test_rare_answers_need_1800_06_for_their_turns_only(void)
{
    config.answer_every = 4;
    config.sync_counter = 9; /* no whole turns */
    canopen_drives_object(&twin, 3, 0x1800, 6)->is_missing = true;
    come_up();
    setUp();
    config.answer_every = 4;
    config.sync_counter = 8;
    canopen_drives_object(&twin, 3, 0x1800, 6)->is_missing = true;
    TEST_ASSERT_EQUAL_HEX32(0x180006, refusal_of(3).object);
}

static void test_rare_answers_are_not_for_profile_position(void)
{
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, NULL, 0));
    config.answer_every = CIA402_ANSWER_EVERY_MAX;
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&node)));
    config.answer_every++;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&node)));
    config.mode = CIA402_MODE_PP;
    config.answer_every = 2;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&node)));
    config.answer_every = 1;
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&node)));
}

/* --- Telemetry --- */

static void tell(uint8_t values, uint8_t every)
{
    config.telemetry = values;
    config.telemetry_every = every;
    config.axis[1].scale.num = -1000;
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_force(&twin, k, 0x6077, 0, (uint16_t)(250 - 100 * (int)k));
        canopen_drives_force(&twin, k, 0x60F4, 0, 1500);
        canopen_drives_force(&twin, k, 0x60FD, 0, 0x80010005);
    }
}

static void test_telemetry_of_all_kinds_takes_two_pdos(void)
{
    tell(DRIVE_HAS_TORQUE | DRIVE_HAS_LAG | DRIVE_HAS_INPUTS, 1);
    come_up();
    cycles(3 * PERIOD);
    TEST_ASSERT_EQUAL_HEX32(0x40000284, canopen_drives_object(&twin, 3, 0x1801, 1)->value);
    TEST_ASSERT_EQUAL_UINT32(2, canopen_drives_object(&twin, 3, 0x1A01, 0)->value);
    TEST_ASSERT_EQUAL_HEX32(0x60770010, canopen_drives_object(&twin, 3, 0x1A01, 1)->value);
    TEST_ASSERT_EQUAL_HEX32(0x60F40020, canopen_drives_object(&twin, 3, 0x1A01, 2)->value);
    TEST_ASSERT_EQUAL_HEX32(0x40000384, canopen_drives_object(&twin, 3, 0x1802, 1)->value);
    TEST_ASSERT_EQUAL_HEX32(0x60FD0020, canopen_drives_object(&twin, 3, 0x1A02, 1)->value);
    const drive_telemetry_t plain = report(6).telemetry;
    TEST_ASSERT_EQUAL_UINT8(7, plain.has);
    TEST_ASSERT_EQUAL_INT32(-350, plain.torque_permille);
    TEST_ASSERT_EQUAL_INT64(MM(3) / 2, plain.lag_q32);
    TEST_ASSERT_EQUAL_HEX32(0x80010005, plain.inputs);
    TEST_ASSERT_TRUE(now_us - plain.at_us <= PERIOD * CYCLE_US);
    const drive_telemetry_t backwards = report(1).telemetry;
    TEST_ASSERT_EQUAL_INT32(-150, backwards.torque_permille);
    TEST_ASSERT_EQUAL_INT64(-MM(3) / 2, backwards.lag_q32);
}

static void test_telemetry_of_one_kind_comes_at_its_rate(void)
{
    tell(DRIVE_HAS_INPUTS, 5);
    come_up();
    TEST_ASSERT_EQUAL_UINT32(5, canopen_drives_object(&twin, 2, 0x1801, 2)->value);
    TEST_ASSERT_EQUAL_HEX32(0x60FD0020, canopen_drives_object(&twin, 2, 0x1A01, 1)->value);
    TEST_ASSERT_EQUAL_HEX32(0xC0000383, canopen_drives_object(&twin, 2, 0x1802, 1)->value);
    cycles(6 * PERIOD);
    const uint64_t first_us = report(2).telemetry.at_us;
    cycles(5 * PERIOD);
    TEST_ASSERT_EQUAL_UINT64(5 * PERIOD * CYCLE_US, report(2).telemetry.at_us - first_us);
    TEST_ASSERT_EQUAL_UINT8(DRIVE_HAS_INPUTS, report(2).telemetry.has);
    enable();
}

static void test_telemetry_that_a_drive_cannot_map_is_named(void)
{
    tell(DRIVE_HAS_TORQUE, 1);
    canopen_drives_object(&twin, 4, 0x1A01, 1)->refusal = 0x06040041;
    const drive_report_t r = refusal_of(4);
    TEST_ASSERT_EQUAL_HEX32(CIA402_NOT_TAKEN, r.code);
    TEST_ASSERT_EQUAL_HEX32(0x1A0101, r.object);
}

/* Nobody asked for it, it has another length, or another SYNC rate than there is: no telemetry, no trouble. */
static void test_telemetry_that_was_not_asked_for_counts_for_nothing(void)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    const can_frame_t frame = {.id = 0x283, .length = 4, .data = {1, 2, 3, 4}};
    TEST_ASSERT_EQUAL_UINT32(3 + 9 * AXES,
                             cia402_filters(&config, filter)); /* a master's, its RPDO of ours, and those of the nodes */
    come_up();
    TEST_ASSERT_EQUAL_HEX32(0xC0000283, canopen_drives_object(&twin, 2, 0x1801, 1)->value);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
    cycles(2);
    TEST_ASSERT_EQUAL_UINT8(0, report(2).telemetry.has);
}

static void test_telemetry_that_is_too_short_counts_for_nothing(void)
{
    const can_frame_t frame = {.id = 0x283, .length = 1, .data = {1}};
    tell(DRIVE_HAS_TORQUE, 200);
    come_up();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
    cycles(2);
    TEST_ASSERT_EQUAL_UINT8(0, report(2).telemetry.has);
}

static void test_telemetry_rate_is_checked(void)
{
    tell(DRIVE_HAS_TORQUE, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&node)));
    config.telemetry_every = 241;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, cia402_init(&driver, &config, sim_can_hal(&node)));
}

/* --- Two drives with the same node id --- */

/* The other one answers too, from somewhere else. */
static void answer_twice(unsigned drive, unsigned periods, unsigned most)
{
    uint32_t syncs = twin.syncs;
    while (periods > 0 && most-- > 0) {
        cycles(1);
        if (twin.syncs != syncs && twin.drive[drive].node.nmt == 5) {
            const can_frame_t frame = {.id = 0x181u + drive, .length = 7, .data = {0x40, 0x02, 1, 2, 3, 0, 8}};
            TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
            syncs = twin.syncs;
            periods--;
        }
    }
}

static void test_twice_in_motion_is_a_fault_within_three_periods(void)
{
    come_up();
    enable();
    for (const uint32_t syncs = twin.syncs; twin.syncs == syncs;) { /* it answers SYNC, as the drive does */
        cycles(1);
    }
    const uint64_t begin_us = now_us;
    while (feedback[2].state != DRIVE_FAULT && now_us - begin_us < 100000) {
        const can_frame_t frame = {.id = 0x183, .length = 7, .data = {0x37, 0x12, 1, 2, 3, 0, 8}};
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
        cycles(PERIOD);
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_HEX32(CIA402_TWICE, feedback[2].fault_code);
    TEST_ASSERT_TRUE(now_us - begin_us <= 3 * PERIOD * CYCLE_US);
}

static void test_twice_at_the_start_is_refused_before_anybody_is_enabled(void)
{
    start();
    answer_twice(5, 20, 3000);
    TEST_ASSERT_EQUAL_STRING("refused", report(5).phase);
    TEST_ASSERT_EQUAL_HEX32(CIA402_TWICE, report(5).code);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_RESET_FAULT)); /* the other one is gone */
    await(DRIVE_DISABLED, 3000);
}

/* A drive with another state, always behind ours: its statusword comes and goes, which is no change. */
static void test_twice_another_state_is_no_change_of_state(void)
{
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        start();
        uint32_t syncs = twin.syncs;
        unsigned most = 3000;
        while (strcmp(report(5).phase, "refused") != 0 && most-- > 0) {
            cycles(1);
            if (twin.syncs != syncs && twin.drive[5].node.nmt == 5) {
                const can_frame_t other = {.id = 0x186, .length = 7, .data = {0x31, 0x02, 1, 2, 3, 0, 8}};
                TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &other));
                syncs = twin.syncs;
            }
        }
        TEST_ASSERT_EQUAL_HEX32(CIA402_TWICE, report(5).code);
    }
}

/* CAN itself may repeat a frame that one receiver has not taken; and answers may come late. */
static void test_twice_single_repeated_or_late_answers_are_none(void)
{
    come_up();
    enable();
    for (unsigned i = 0; i < 10; i++) {
        const uint32_t position = (uint32_t)canopen_drives_position(&twin, 2);
        const can_frame_t frame = {.id = 0x183,
                                   .length = 7,
                                   .data = {0x37, 0x12, (uint8_t)position, (uint8_t)(position >> 8), (uint8_t)(position >> 16),
                                            (uint8_t)(position >> 24), 8}};
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
        cycles(2000);
        twin.drive[2].node.tpdo_drop = 2; /* two are missing, and come after all */
        cycles(2 * PERIOD);
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&twin.node), &frame));
        cycles(2000);
    }
    TEST_ASSERT_TRUE(are_all(DRIVE_ENABLED));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_setup_pdos_are_mapped_in_the_order_every_stack_accepts);
    RUN_TEST(test_setup_pdo_with_a_high_number_is_switched_off_before_it_is_mapped);
    RUN_TEST(test_setup_drives_that_are_up_already_are_reset_first);
    RUN_TEST(test_setup_object_refused_names_drive_object_and_reason);
    RUN_TEST(test_setup_all_refused_is_no_lost_bus_and_a_reset_sets_up_again);
    RUN_TEST(test_loss_all_that_start_again_are_no_lost_bus);
    RUN_TEST(test_loss_all_silent_is_a_lost_bus_until_one_answers);
    RUN_TEST(test_setup_mode_that_a_drive_has_not_got_is_refused_before_it_is_asked_for);
    RUN_TEST(test_setup_homing_that_a_drive_has_not_got_is_refused_where_it_is_wanted);
    RUN_TEST(test_setup_homing_method_that_is_not_in_the_list_is_refused);
    RUN_TEST(test_setup_what_a_drive_does_not_tell_is_no_refusal);
    RUN_TEST(test_setup_what_a_drive_tells_does_not_count_where_it_is_not_asked);
    RUN_TEST(test_rare_answers_carry_a_motion);
    RUN_TEST(test_rare_answers_that_stay_away_are_a_loss_after_three_turns);
    RUN_TEST(test_rare_answers_of_two_drives_are_told_apart);
    RUN_TEST(test_rare_answers_take_turns);
    RUN_TEST(test_rare_answers_need_1800_06_for_their_turns_only);
    RUN_TEST(test_rare_answers_are_not_for_profile_position);
    RUN_TEST(test_telemetry_of_all_kinds_takes_two_pdos);
    RUN_TEST(test_telemetry_of_one_kind_comes_at_its_rate);
    RUN_TEST(test_telemetry_that_a_drive_cannot_map_is_named);
    RUN_TEST(test_telemetry_that_was_not_asked_for_counts_for_nothing);
    RUN_TEST(test_telemetry_that_is_too_short_counts_for_nothing);
    RUN_TEST(test_telemetry_rate_is_checked);
    RUN_TEST(test_setup_wrong_identity_is_refused);
    RUN_TEST(test_setup_object_with_another_value_tells_both);
    RUN_TEST(test_setup_object_that_can_only_be_read_is_told_as_such);
    RUN_TEST(test_setup_mapping_that_can_only_be_read_is_told_as_such);
    RUN_TEST(test_setup_wrong_revision_and_serial_number_are_refused);
    RUN_TEST(test_setup_position_limits_are_written_where_wanted);
    RUN_TEST(test_startup_list_is_written_before_and_behind_everything_else);
    RUN_TEST(test_startup_list_that_a_drive_does_not_take_names_the_object);
    RUN_TEST(test_startup_list_item_that_may_be_missing_is_passed_over);
    RUN_TEST(test_startup_list_too_long_is_refused);
    RUN_TEST(test_wishes_are_what_is_written);
    RUN_TEST(test_setup_other_profile_is_refused);
    RUN_TEST(test_setup_missing_guard_is_refused_unless_allowed);
    RUN_TEST(test_setup_guard_that_cannot_be_written_is_taken_where_it_is_on);
    RUN_TEST(test_setup_consumer_time_that_is_far_too_long_is_refused_unless_allowed);
    RUN_TEST(test_setup_without_heartbeats_is_refused);
    RUN_TEST(test_setup_guards_are_accepted_one_by_one);
    RUN_TEST(test_setup_deadline_of_commands_stops_a_drive_that_watches_no_heartbeat);
    RUN_TEST(test_setup_without_heartbeats_is_taken_where_allowed_and_watched_by_its_tpdos);
    RUN_TEST(test_setup_drive_whose_heartbeats_are_rare_is_waited_for);
    RUN_TEST(test_setup_drive_that_goes_operational_by_itself_is_told_again);
    RUN_TEST(test_setup_optional_objects_missing_is_no_trouble);
    RUN_TEST(test_setup_missing_drive_is_named_and_taken_when_it_comes);
    RUN_TEST(test_setup_object_that_is_never_answered_is_named_and_not_tried_for_ever);
    RUN_TEST(test_setup_object_without_answer_is_named_while_it_is_tried_again);
    RUN_TEST(test_setup_object_that_may_be_missing_may_be_without_answer);
    RUN_TEST(test_setup_one_question_without_answer_is_asked_again_from_the_beginning);
    RUN_TEST(test_enable_drive_that_does_not_answer_for_its_mode_is_named);
    RUN_TEST(test_setup_answers_that_come_late_do_not_confuse);
    RUN_TEST(test_setup_refused_drive_is_tried_again_by_a_reset);
    RUN_TEST(test_setup_refusal_that_may_pass_is_asked_again_before_it_counts);
    RUN_TEST(test_setup_mode_may_show_late_but_not_never);
    RUN_TEST(test_setup_drive_that_does_not_tell_its_type_is_refused);
    RUN_TEST(test_setup_without_reset_takes_drives_as_they_are);
    RUN_TEST(test_setup_drive_that_boots_without_a_word_is_asked_all_the_same);
    RUN_TEST(test_setup_drive_that_falls_silent_is_missing_until_it_answers);
    RUN_TEST(test_setup_drive_that_boots_in_the_midst_begins_anew);
    RUN_TEST(test_setup_refused_drive_is_tried_again_when_it_boots);
    RUN_TEST(test_setup_drive_whose_position_cannot_be_read_is_refused);
    RUN_TEST(test_enable_all_together_without_a_jump);
    RUN_TEST(test_enable_drives_whose_states_move_by_themselves_come_up);
    RUN_TEST(test_enable_drive_that_does_not_come_along_leads_all_back);
    RUN_TEST(test_enable_drive_that_does_not_say_that_it_follows_is_believed_after_a_while);
    RUN_TEST(test_enable_drive_that_shows_another_mode_gets_no_set_point);
    RUN_TEST(test_enable_drive_that_takes_no_mode_stops_all);
    RUN_TEST(test_enable_while_enabled_changes_nothing_but_brings_back_who_fell_out);
    RUN_TEST(test_enable_drive_that_loses_its_torque_meanwhile_does_not_get_it_again);
    RUN_TEST(test_enable_again_where_drives_were_moved_to);
    RUN_TEST(test_send_set_points_arrive_as_counts_one_set_per_period);
    RUN_TEST(test_send_position_wraps_round_without_a_jump);
    RUN_TEST(test_send_lag_beyond_the_window_is_a_fault_unless_it_is_not_watched);
    RUN_TEST(test_send_set_point_that_has_no_counts_is_a_fault_and_not_sent);
    RUN_TEST(test_poll_drive_silent_is_lost_after_three_syncs);
    RUN_TEST(test_poll_two_tpdos_lost_is_no_loss);
    RUN_TEST(test_poll_heartbeat_lost_is_a_loss_in_time);
    RUN_TEST(test_poll_boot_up_in_mid_run_is_a_loss_at_once);
    RUN_TEST(test_poll_node_that_leaves_operational_is_lost);
    RUN_TEST(test_poll_torque_gone_by_itself_is_seen_in_a_period);
    RUN_TEST(test_poll_torque_gone_from_several_drives_is_told_of_each);
    RUN_TEST(test_poll_fault_has_the_code_of_its_emergency);
    RUN_TEST(test_poll_fault_without_emergency_is_looked_up);
    RUN_TEST(test_poll_fault_without_any_code_is_a_fault_all_the_same);
    RUN_TEST(test_poll_emergency_comes_before_what_is_looked_up);
    RUN_TEST(test_poll_fault_during_a_change_of_mode_is_looked_up_afterwards);
    RUN_TEST(test_poll_fault_reaction_is_a_fault_at_once);
    RUN_TEST(test_poll_drive_that_cannot_follow_is_stopped);
    RUN_TEST(test_quick_stop_that_never_ends_ends_without_voltage);
    RUN_TEST(test_request_reset_twice_is_one_edge);
    RUN_TEST(test_request_reset_of_a_fault_that_goes_by_itself);
    RUN_TEST(test_request_reset_is_one_edge_and_only_when_asked);
    RUN_TEST(test_off_is_told_once_it_is_so_whenever_it_is_asked_for);
    RUN_TEST(test_off_is_told_once_it_is_so_where_answers_are_rare);
    RUN_TEST(test_off_is_not_told_of_a_drive_that_falls_silent_while_it_is_switched_on);
    RUN_TEST(test_off_of_a_drive_that_is_lost_is_as_it_was_heard_last);
    RUN_TEST(test_leave_drives_without_torque_forget_the_gateway);
    RUN_TEST(test_leave_drives_with_torque_are_left_to_their_watchdogs);
    RUN_TEST(test_leave_says_nothing_to_drives_that_are_not_there);
    RUN_TEST(test_bus_whose_controller_is_not_on_it_is_gone_at_once);
    RUN_TEST(test_bus_restarted_by_itself_loses_every_drive);
    RUN_TEST(test_bus_that_cannot_be_restarted_is_tried_twice_a_second);
    RUN_TEST(test_bus_without_restart_comes_back_when_it_works);
    RUN_TEST(test_bus_off_keeps_silent_for_as_long_as_the_drives_watch);
    RUN_TEST(test_bus_without_echoes_is_trusted);
    RUN_TEST(test_sync_counter_goes_round_without_a_gap);
    RUN_TEST(test_sync_that_comes_late_begins_a_new_time);
    RUN_TEST(test_heartbeat_that_finds_no_room_is_sent_as_soon_as_there_is);
    RUN_TEST(test_bus_that_is_unplugged_is_gone_at_once_and_comes_back);
    RUN_TEST(test_setup_waits_for_room_for_its_nmt_commands);
    RUN_TEST(test_frames_for_others_are_not_heard);
    RUN_TEST(test_owns_covers_every_frame_that_is_sent);
    RUN_TEST(test_bus_off_ended_syncs_go_on_at_their_period);
    RUN_TEST(test_bus_off_keeps_silent_until_the_drives_have_stopped);
    RUN_TEST(test_bus_that_echoes_nothing_is_gone_after_three_periods);
    RUN_TEST(test_error_passive_is_failing_after_its_time_and_stops_nothing_here);
    RUN_TEST(test_storm_of_error_frames_is_bounded_and_stops_nothing);
    RUN_TEST(test_burst_of_error_frames_is_not_taken_for_a_bus_that_is_gone);
    RUN_TEST(test_bus_whose_queue_stays_full_is_gone_after_three_periods);
    RUN_TEST(test_bus_that_never_takes_a_whole_set_is_gone_after_three_periods);
    RUN_TEST(test_bus_whose_queue_is_full_now_and_then_hinders_nothing);
    RUN_TEST(test_request_quick_stop_goes_with_the_set_that_is_due);
    RUN_TEST(test_send_slow_bus_refuses_instead_of_queueing);
    RUN_TEST(test_bus_of_1_mbit_with_a_queue_carries_every_set_point);
    RUN_TEST(test_request_home_finds_the_zero_of_all_and_returns_without_a_jump);
    RUN_TEST(test_request_home_one_failure_stops_all);
    RUN_TEST(test_request_home_again_is_not_over_before_it_begins);
    RUN_TEST(test_request_home_of_a_drive_that_is_there_already_ends);
    RUN_TEST(test_request_home_after_one_that_failed);
    RUN_TEST(test_power_lost_means_that_the_zero_is_lost);
    RUN_TEST(test_any_trouble_at_any_time_moves_nothing);
    RUN_TEST(test_init_contradictions_are_refused);
    RUN_TEST(test_period_is_one_that_the_drives_can_hold);
    RUN_TEST(test_watch_what_stops_is_a_fault_within_three_periods);
    RUN_TEST(test_watch_single_answer_stops_nothing);
    RUN_TEST(test_watch_what_is_told_stops_nothing_and_is_told_for_some_seconds);
    RUN_TEST(test_watch_what_is_ignored_is_not_told_of);
    RUN_TEST(test_watch_mode_left_in_motion_is_a_fault);
    RUN_TEST(test_watch_interpolation_that_ends_is_a_fault);
    RUN_TEST(test_watch_bits_that_a_drive_does_not_have_are_not_missed);
    RUN_TEST(test_watch_drive_under_local_control_is_not_enabled);
    RUN_TEST(test_watch_limit_while_homing_stops_nothing);
    RUN_TEST(test_emergency_is_reported_with_all_that_it_says);
    RUN_TEST(test_emergency_is_kept_over_a_loss_and_over_with_a_boot);
    RUN_TEST(test_emergency_of_a_drive_that_stays_preoperational_is_the_reason);
    RUN_TEST(test_emergency_that_leaves_operational_is_the_reason);
    RUN_TEST(test_twice_in_motion_is_a_fault_within_three_periods);
    RUN_TEST(test_twice_at_the_start_is_refused_before_anybody_is_enabled);
    RUN_TEST(test_twice_another_state_is_no_change_of_state);
    RUN_TEST(test_quirks_that_make_no_difference);
    RUN_TEST(test_quirk_slow_answers_are_waited_for);
    RUN_TEST(test_quirk_hidden_mode_has_to_show_with_torque);
    RUN_TEST(test_quirk_hidden_mode_is_refused_where_no_answer_has_it);
    RUN_TEST(test_quirk_drives_that_need_bits_follow_with_them_only);
    RUN_TEST(test_quirk_short_pdo_is_named);
    RUN_TEST(test_quirk_wrong_toggle_is_named_with_its_object);
    RUN_TEST(test_quirk_fault_reset_takes_as_long_as_the_drive_needs);
    RUN_TEST(test_quirk_fault_that_keeps_a_drive_from_starting_is_named_and_reset);
    RUN_TEST(test_quirk_reset_of_a_drive_that_does_not_start_is_not_kept);
    RUN_TEST(test_quirk_homing_without_bit_10_ends_when_the_drive_stands);
    RUN_TEST(test_quirk_homing_that_does_not_end_is_named);
    RUN_TEST(test_twice_single_repeated_or_late_answers_are_none);
    return UNITY_END();
}

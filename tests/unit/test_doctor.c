/* SPDX-License-Identifier: MIT
 * test_doctor.c - what heaved --doctor concludes from what it has found, fault by fault: also those no test bus can have.
 */
#include <string.h>

#include "inspect/doctor_judge.h"
#include "unity.h"

static char s_text[8192];
static doctor_report_t s_report;
static config_can_t s_can;
static linux_can_link_t s_link;
static doctor_host_t s_host;
static cia402_config_t s_drives;
static doctor_node_t s_node;

void hv_assert_failed(const char *file, int line)
{
    (void)line;
    TEST_FAIL_MESSAGE(file);
}

static void set(doctor_object_t object, uint32_t value)
{
    s_node.answer[object] = DOCTOR_READ;
    s_node.value[object] = value;
}

static void refuse(doctor_object_t object)
{
    s_node.answer[object] = DOCTOR_REFUSED;
    s_node.value[object] = 0x06020000;
}

void setUp(void)
{
    memset(s_text, 0, sizeof s_text);
    s_report = (doctor_report_t){.out = fmemopen(s_text, sizeof s_text, "w")};
    s_can = (config_can_t){.interface = "can0", .bitrate_bps = 1000000};
    s_link = (linux_can_link_t){.kind = "can",
                                .driver = "peak_usb",
                                .is_can = true,
                                .is_up = true,
                                .has_echo = true,
                                .queue_length = 16,
                                .has_controller = true,
                                .state = HAL_CAN_ACTIVE,
                                .bitrate = 1000000};
    s_host = (doctor_host_t){6, 6, true, true, true, false};
    s_drives = (cia402_config_t){.axes = 1, .master_node = 127, .mode = CIA402_MODE_CSP, .period_us = 4000};
    s_drives.axis[0].node = 3;
    s_node = (doctor_node_t){.nmt = 127};
    for (unsigned object = 0; object < DOCTOR_OBJECTS; object++) {
        set(object, 1);
    }
    set(DOCTOR_TYPE, 0x20192);
    set(DOCTOR_MODES, 0xFF);
    set(DOCTOR_STATUS, 0x0240);
    set(DOCTOR_SYNC_PERIOD, 0);
    set(DOCTOR_CONSUMER, 0x7F0064);
}

void tearDown(void)
{
    (void)fclose(s_report.out);
}

static void expect(unsigned fails, unsigned warns, const char *text)
{
    (void)fflush(s_report.out);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(fails, s_report.count[DOCTOR_FAIL], s_text);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(warns, s_report.count[DOCTOR_WARN], s_text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(s_text, text), s_text);
    TEST_ASSERT_TRUE_MESSAGE(fails + warns == 0 || strstr(s_text, "-> ") != NULL, s_text);
}

static bool judge_link(void)
{
    return doctor_judge_link(&s_report, &s_can, &s_link, &s_host);
}

static void judge_node(void)
{
    doctor_judge_node(&s_report, &s_drives, 0, &s_node);
}

/* --- The interface --- */

static void test_judge_link_sound_is_one_ok(void)
{
    TEST_ASSERT_TRUE(judge_link());
    expect(0, 0, "ok    can0 is up, driver peak_usb");
    TEST_ASSERT_EQUAL_UINT(1, s_report.count[DOCTOR_OK]);
}

static void test_judge_link_not_can_cannot_be_used(void)
{
    s_link = (linux_can_link_t){.is_up = true};
    TEST_ASSERT_FALSE(judge_link());
    expect(1, 0, "not a CAN interface");
}

static void test_judge_link_down_names_the_command(void)
{
    s_link.is_up = false;
    s_link.state = HAL_CAN_DOWN;
    TEST_ASSERT_FALSE(judge_link());
    expect(1, 0, "ip link set can0 up");
}

static void test_judge_link_bitrate_names_both_and_the_command(void)
{
    s_link.bitrate = 500000;
    TEST_ASSERT_TRUE(judge_link());
    expect(1, 0, "runs at 500000 bit/s, [can] bitrate_bps = 1000000");
    TEST_ASSERT_NOT_NULL(strstr(s_text, "type can bitrate 1000000"));
}

static void test_judge_link_without_controller_has_no_bitrate_to_be_wrong(void)
{
    s_link.has_controller = false;
    s_link.bitrate = 0;
    TEST_ASSERT_TRUE(judge_link());
    expect(0, 0, "is up");
}

static void test_judge_link_restart_ms_fails(void)
{
    s_link.restart_ms = 100;
    (void)judge_link();
    expect(1, 0, "type can restart-ms 0");
}

static void test_judge_link_queue_warns(void)
{
    s_link.queue_length = 10;
    (void)judge_link();
    expect(0, 1, "txqueuelen is 10, not 16 -> ip link set can0 txqueuelen 16");
}

static void test_judge_link_no_echo_fails(void)
{
    s_link.has_echo = false;
    (void)judge_link();
    expect(1, 0, "no echo");
}

static void test_judge_link_gs_usb_warns_before_6_6_only(void)
{
    (void)snprintf(s_link.driver, sizeof s_link.driver, "gs_usb");
    (void)judge_link();
    expect(0, 0, "ok");
    s_host.kernel_minor = 5;
    (void)judge_link();
    expect(0, 1, "gs_usb of kernel 6.5");
    s_host = (doctor_host_t){5, 15, true, true, true, false};
    (void)judge_link();
    expect(0, 2, "gs_usb of kernel 5.15");
    s_host = (doctor_host_t){7, 0, true, true, true, false};
    (void)judge_link();
    expect(0, 2, "ok");
}

static void test_judge_link_bus_off_shows_counters_and_cannot_be_used(void)
{
    s_link.state = HAL_CAN_BUS_OFF;
    s_link.tx_errors = 248;
    s_link.bus_offs = 3;
    TEST_ASSERT_FALSE(judge_link());
    expect(1, 0, "bus-off (errors tx 248 rx 0, 3 times bus-off)");
}

static void test_judge_link_passive_fails_and_warning_warns(void)
{
    s_link.state = HAL_CAN_PASSIVE;
    s_link.tx_errors = 128;
    TEST_ASSERT_TRUE(judge_link());
    expect(1, 0, "error-passive (errors tx 128 rx 0)");
    s_link.state = HAL_CAN_WARNING;
    TEST_ASSERT_TRUE(judge_link());
    expect(1, 1, "warning limit");
}

static void test_judge_link_waiting_frames_are_left_alone(void)
{
    s_link.waiting = 7;
    TEST_ASSERT_FALSE(judge_link());
    expect(1, 0, "7 frames wait");
}

static void test_judge_host_warns_of_each(void)
{
    doctor_judge_host(&s_report, &s_host);
    expect(0, 0, "ok");
    s_host.is_realtime_allowed = s_host.is_memory_lock_allowed = false;
    doctor_judge_host(&s_report, &s_host);
    expect(0, 2, "LimitMEMLOCK");
    TEST_ASSERT_NOT_NULL(strstr(s_text, "LimitRTPRIO"));
    s_host = (doctor_host_t){6, 6, true, true, false, false}; /* where no self-test depends on it the date does not matter */
    doctor_judge_host(&s_report, &s_host);
    s_host.is_date_of_matter = s_host.is_clock_trusted = true;
    doctor_judge_host(&s_report, &s_host);
    expect(0, 2, "ok");
    s_host.is_clock_trusted = false;
    doctor_judge_host(&s_report, &s_host);
    expect(0, 3, "the date may be wrong");
}

/* --- Drives --- */

static void test_judge_node_sound_is_one_ok(void)
{
    judge_node();
    expect(0, 0, "ok    node 3 (drive 1)");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(s_text, "pre-operational"), s_text);
}

/* Two axes in a node: which of them, and its objects as it has them. */
static void test_judge_node_with_several_axes_names_the_axis(void)
{
    s_drives.axes = 2;
    s_drives.axis[1] = (cia402_axis_config_t){.node = 3, .channel = 1};
    refuse(DOCTOR_WINDOW);
    refuse(DOCTOR_PERIOD_VALUE);
    doctor_judge_node(&s_report, &s_drives, 1, &s_node);
    expect(2, 0, "node 3.2: 68C2h cannot be read: there is no such object");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(s_text, "node 3.2 has no watchdog 6865h"), s_text);
    set(DOCTOR_WINDOW, 1);
    set(DOCTOR_PERIOD_VALUE, 1);
    doctor_judge_node(&s_report, &s_drives, 0, &s_node);
    expect(2, 0, "ok    node 3.1 (drive 1)");
}

static void test_judge_node_silent_says_only_that(void)
{
    s_node = (doctor_node_t){.nmt = -1};
    judge_node();
    expect(1, 0, "node 3 (drive 1) does not answer");
}

static void test_judge_node_other_profile_fails(void)
{
    set(DOCTOR_TYPE, 0x191);
    judge_node();
    expect(1, 0, "no CiA 402 drive (1000h = 0x191)");
}

static void test_judge_node_identity_names_found_and_wanted(void)
{
    s_drives.axis[0].identity[0] = 0x2E5;
    set(DOCTOR_VENDOR, 0x9A);
    judge_node();
    expect(1, 0, "vendor_id is 154 (0x9A), configured 741");
}

static void test_judge_node_revision_and_serial_are_compared_where_configured(void)
{
    set(DOCTOR_REVISION, 7);
    judge_node();
    expect(0, 0, "");
    s_drives.axis[0].identity[2] = 6;
    judge_node();
    expect(1, 0, "revision_number is 7 (0x7), configured 6");
    s_drives.axis[0].identity[2] = 0;
    s_drives.axis[0].identity[3] = 5;
    judge_node();
    expect(2, 0, "configured 5");
}

static void start_anew(void)
{
    tearDown();
    setUp();
}

/* One line instead of one for each drive; anybody heard means that somebody acknowledges. */
static void test_judge_wire_nobody_acknowledges_is_named_as_such(void)
{
    static const doctor_wire_t k_alone[] = {{.unconfirmed = 1},
                                            {.is_unacknowledged = true},
                                            {.state = HAL_CAN_PASSIVE, .tx_errors = 128},
                                            {.state = HAL_CAN_BUS_OFF}};
    for (size_t i = 0; i < sizeof k_alone / sizeof k_alone[0]; i++) {
        doctor_wire_t wire = k_alone[i];
        start_anew();
        TEST_ASSERT_TRUE(doctor_judge_wire(&s_report, &s_can, &wire));
        expect(1, 0, "nobody acknowledges on can0");
        start_anew();
        wire.is_heard = true;
        TEST_ASSERT_FALSE(doctor_judge_wire(&s_report, &s_can, &wire));
        expect(0, 0, "");
    }
    start_anew();
    TEST_ASSERT_FALSE(doctor_judge_wire(&s_report, &s_can, &(doctor_wire_t){.state = HAL_CAN_WARNING}));
    expect(0, 0, "");
}

static void test_judge_node_answering_twice_fails(void)
{
    s_node.extra_answers = 1;
    judge_node();
    expect(1, 0, "two drives have this number");
}

static void test_judge_node_alternating_serials_fail(void)
{
    set(DOCTOR_SERIAL_2, 2);
    judge_node();
    expect(1, 0, "two drives have this number");
}

static void test_judge_node_mode_names_one_it_has(void)
{
    set(DOCTOR_MODES, 0x61);
    judge_node();
    expect(1, 0, "does not have mode csp (6502h = 0x61) -> [cia402] mode = ip");
    set(DOCTOR_MODES, 0x04);
    judge_node();
    expect(2, 0, "none of csp, ip and pp");
}

static void test_judge_node_without_6502h_is_not_judged_by_it(void)
{
    refuse(DOCTOR_MODES);
    judge_node();
    expect(0, 0, "ok");
}

static void test_judge_node_without_mapping_fails(void)
{
    refuse(DOCTOR_TPDO_MAP);
    judge_node();
    expect(1, 0, "1A00h cannot be read: there is no such object");
}

static void test_judge_node_period_object_is_needed_in_cyclic_modes_only(void)
{
    refuse(DOCTOR_PERIOD_VALUE);
    judge_node();
    expect(1, 0, "60C2h");
    s_drives.mode = CIA402_MODE_PP;
    judge_node();
    expect(1, 0, "ok");
}

static void without_watchdog(unsigned object, bool is_guarded, bool is_allowed)
{
    tearDown();
    setUp();
    refuse(object);
    s_drives.is_guarded = is_guarded;
    s_drives.accepted_without = is_allowed ? CIA402_GUARDS_ALL : 0;
    judge_node();
}

static void test_judge_node_each_missing_watchdog_fails_or_warns_where_allowed(void)
{
    for (unsigned object = DOCTOR_CONSUMER; object <= DOCTOR_WINDOW; object++) {
        const bool is_of_guarding = object == DOCTOR_GUARD_TIME || object == DOCTOR_LIFE_FACTOR;
        without_watchdog(object, is_of_guarding, false);
        expect(1, 0, "has no watchdog");
        without_watchdog(object, is_of_guarding, true);
        expect(0, 1, "has no watchdog");
    }
}

static void test_judge_node_needs_the_watchdogs_of_heartbeats_or_those_of_guarding(void)
{
    for (unsigned object = DOCTOR_CONSUMER; object <= DOCTOR_LIFE_FACTOR; object++) {
        without_watchdog(object, object <= DOCTOR_PRODUCER, false);
        expect(0, 0, "ok");
    }
}

static void test_judge_node_watchdogs_that_are_off_are_listed_once(void)
{
    set(DOCTOR_CONSUMER, 0x7E0064); /* watches somebody else */
    set(DOCTOR_PRODUCER, 0);
    set(DOCTOR_WINDOW, UINT32_MAX);
    judge_node();
    expect(0, 0, "watchdogs off until heaved sets them at its start: 1016h 1017h 6065h");
}

static void test_judge_node_foreign_sync_period_warns(void)
{
    set(DOCTOR_SYNC_PERIOD, 10000);
    judge_node();
    expect(0, 1, "1006h is 10000 us, [cia402] period_us = 4000");
}

static void test_judge_node_fault_has_code_and_text(void)
{
    set(DOCTOR_STATUS, 0x0218);
    set(DOCTOR_ERROR, 0x8611);
    judge_node();
    expect(1, 0, "603Fh = 8611h: following error");
}

static void test_judge_node_with_torque_fails(void)
{
    set(DOCTOR_STATUS, 0x0637);
    judge_node();
    expect(1, 0, "has torque");
}

static void test_judge_node_local_control_warns(void)
{
    set(DOCTOR_STATUS, 0x0040);
    judge_node();
    expect(0, 1, "remote is off");
}

/* --- Inventory --- */

static void inventory(const doctor_node_t *node)
{
    doctor_write_inventory(s_report.out, &s_drives, node);
    (void)fflush(s_report.out);
}

static void expect_text(const char *text)
{
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(s_text, text), s_text);
}

static void test_inventory_is_ready_for_the_configuration(void)
{
    doctor_node_t node[DRIVES_MAX];
    s_drives.axes = 3;
    for (unsigned k = 0; k < 3; k++) {
        s_drives.axis[k].node = (uint8_t)(k + 5);
        node[k] = s_node;
        node[k].value[DOCTOR_VENDOR] = 0xFB;
        node[k].value[DOCTOR_PRODUCT] = 0x60500000;
        node[k].value[DOCTOR_REVISION] = 0x01700000;
        node[k].value[DOCTOR_SERIAL] = 0x1000 + k;
        doctor_copy_name(node[k].name[DOCTOR_DEVICE], (const uint8_t *)"EPOS4 24\xFF  ", 11);
    }
    inventory(node);
    expect_text("; drive 2, node 6: EPOS4 24?, hardware (not told), software (not told), revision 0x1700000\n");
    expect_text("\nvendor_id = 0xFB\nproduct_code = 0x60500000\nserial_numbers = 0x1000, 0x1001, 0x1002\n");
}

static void test_inventory_of_drives_that_differ_or_are_missing_says_so(void)
{
    doctor_node_t node[DRIVES_MAX] = {{.nmt = -1}};
    s_drives.axes = 3;
    node[1] = node[2] = s_node;
    node[2].value[DOCTOR_PRODUCT] = 2;
    node[2].answer[DOCTOR_SERIAL] = DOCTOR_REFUSED;
    inventory(node);
    expect_text("; drive 1, node 3: not found\n");
    s_drives.axis[1].node = 3;
    s_drives.axis[1].channel = 1;
    inventory(node);
    expect_text("; drive 1, node 3.1: not found\n; drive 2, node 3.2: ");
    expect_text("\nvendor_id = 0x1\n; product_code: they differ\nserial_numbers = 0x0, 0x1, 0x0\n");
}

static void test_inventory_of_nothing_is_nothing(void)
{
    doctor_node_t node[DRIVES_MAX] = {{.nmt = -1}};
    inventory(node);
    TEST_ASSERT_EQUAL_STRING("", s_text);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_inventory_is_ready_for_the_configuration);
    RUN_TEST(test_inventory_of_drives_that_differ_or_are_missing_says_so);
    RUN_TEST(test_inventory_of_nothing_is_nothing);
    RUN_TEST(test_judge_link_sound_is_one_ok);
    RUN_TEST(test_judge_link_not_can_cannot_be_used);
    RUN_TEST(test_judge_link_down_names_the_command);
    RUN_TEST(test_judge_link_bitrate_names_both_and_the_command);
    RUN_TEST(test_judge_link_without_controller_has_no_bitrate_to_be_wrong);
    RUN_TEST(test_judge_link_restart_ms_fails);
    RUN_TEST(test_judge_link_queue_warns);
    RUN_TEST(test_judge_link_no_echo_fails);
    RUN_TEST(test_judge_link_gs_usb_warns_before_6_6_only);
    RUN_TEST(test_judge_link_bus_off_shows_counters_and_cannot_be_used);
    RUN_TEST(test_judge_link_passive_fails_and_warning_warns);
    RUN_TEST(test_judge_link_waiting_frames_are_left_alone);
    RUN_TEST(test_judge_host_warns_of_each);
    RUN_TEST(test_judge_node_sound_is_one_ok);
    RUN_TEST(test_judge_node_with_several_axes_names_the_axis);
    RUN_TEST(test_judge_node_silent_says_only_that);
    RUN_TEST(test_judge_node_other_profile_fails);
    RUN_TEST(test_judge_node_identity_names_found_and_wanted);
    RUN_TEST(test_judge_node_revision_and_serial_are_compared_where_configured);
    RUN_TEST(test_judge_wire_nobody_acknowledges_is_named_as_such);
    RUN_TEST(test_judge_node_answering_twice_fails);
    RUN_TEST(test_judge_node_alternating_serials_fail);
    RUN_TEST(test_judge_node_mode_names_one_it_has);
    RUN_TEST(test_judge_node_without_6502h_is_not_judged_by_it);
    RUN_TEST(test_judge_node_without_mapping_fails);
    RUN_TEST(test_judge_node_period_object_is_needed_in_cyclic_modes_only);
    RUN_TEST(test_judge_node_each_missing_watchdog_fails_or_warns_where_allowed);
    RUN_TEST(test_judge_node_needs_the_watchdogs_of_heartbeats_or_those_of_guarding);
    RUN_TEST(test_judge_node_watchdogs_that_are_off_are_listed_once);
    RUN_TEST(test_judge_node_foreign_sync_period_warns);
    RUN_TEST(test_judge_node_fault_has_code_and_text);
    RUN_TEST(test_judge_node_with_torque_fails);
    RUN_TEST(test_judge_node_local_control_warns);
    return UNITY_END();
}

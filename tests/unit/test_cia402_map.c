/* SPDX-License-Identifier: MIT
 * test_cia402_map.c - which PDOs a configuration of CANopen drives has, what is in them, and which do not fit; frames against
 * maps that hold more than the driver needs. No drive answers here: configurations and bytes alone.
 */
#include <string.h>

#include "../../src/canopen/cia402_map.h"
#include "../../src/canopen/cia402_pdo.h"
#include "sim_can.h"
#include "unity.h"

#define OWN_8  0x20010108u /* of a manufacturer */
#define OWN_16 0x20020010u

static cia402_config_t m_config;
static sim_can_bus_t m_bus;
static sim_can_t m_node;
static cia402_t m_driver;

/* Two drives, each a node. */
void setUp(void)
{
    m_config = (cia402_config_t){.axes = 2,
                                 .master_node = 127,
                                 .mode = CIA402_MODE_CSP,
                                 .period_us = 2000,
                                 .heartbeat_ms = 50,
                                 .heartbeat_timeout_ms = 200,
                                 .sdo_timeout_ms = 50,
                                 .boot_timeout_ms = 1000,
                                 .power_timeout_ms = 1000,
                                 .abort_option = 3};
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        m_config.axis[k] = (cia402_axis_config_t){
            .node = (uint8_t)(k + 1u), .scale = {1000, 1, 0}, .step_max_q32 = Q32_ONE, .window_counts = 100};
    }
    sim_can_bus_init(&m_bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_node, &m_bus, NULL, 0));
}

void tearDown(void)
{
    sim_can_close(&m_node);
}

static hv_status_t init(void)
{
    return cia402_init(&m_driver, &m_config, sim_can_hal(&m_node));
}

/* Both axes are of node 1. */
static void join(void)
{
    m_config.axis[1].node = 1;
    m_config.axis[1].channel = 1;
}

/* In PDOs of the whole node. */
static void share(void)
{
    join();
    m_config.commands = (cia402_maps_t){
        .count = 2, .map = {{1, 3, {CIA402_ENTRY_CONTROLWORD, CIA402_ENTRY_TARGET, OWN_16}}, {2, 2, {0x68400010, 0x687A0020}}}};
    m_config.answers = (cia402_maps_t){
        .count = 2,
        .map = {{1, 3, {CIA402_ENTRY_STATUSWORD, CIA402_ENTRY_ACTUAL, OWN_8}}, {2, 3, {0x68410010, 0x68640020, 0x68610008}}}};
}

/* As a drive may have them for good: with objects that the driver does not know. */
static void fix(void)
{
    m_config.are_maps_fixed = true;
    m_config.commands =
        (cia402_maps_t){.count = 1, .map = {{1, 4, {OWN_8, CIA402_ENTRY_CONTROLWORD, CIA402_ENTRY_TARGET, CIA402_ENTRY_MODE}}}};
    m_config.answers = (cia402_maps_t){.count = 2,
                                       .map = {{1, 3, {CIA402_ENTRY_STATUSWORD, OWN_16, CIA402_ENTRY_ACTUAL}},
                                               {2, 3, {CIA402_ENTRY_TORQUE, CIA402_ENTRY_LAG, CIA402_ENTRY_MODE_SHOWN}}}};
}

/* ---- what fits ---- */

static void check_fits(void)
{
    const char *why = "?";
    TEST_ASSERT_TRUE(cia402_pdos_fit(&m_config, &why));
    TEST_ASSERT_NULL(why);
    TEST_ASSERT_EQUAL(HV_OK, init());
}

static void check_fits_not(const char *text)
{
    const char *why = NULL;
    TEST_ASSERT_FALSE(cia402_pdos_fit(&m_config, &why));
    TEST_ASSERT_NOT_NULL_MESSAGE(why, text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, text), why);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
}

static void test_maps_that_fit_are_accepted(void)
{
    check_fits();
    join();
    check_fits();
    share();
    check_fits();
    setUp();
    fix();
    check_fits();
    setUp();
    m_config.telemetry = DRIVE_HAS_TORQUE | DRIVE_HAS_LAG | DRIVE_HAS_INPUTS;
    m_config.telemetry_every = 10;
    check_fits();
}

static void test_pdo_without_whole_bytes_or_of_too_many_does_not_fit(void)
{
    static const uint32_t k_entries[] = {CIA402_ENTRY_ACTUAL - 0x20u, 0x60640004, 0x60640040};
    for (unsigned direction = 0; direction < 2; direction++) {
        for (unsigned i = 0; i < 3; i++) { /* no bits, four, and eight bytes behind those that are there */
            setUp();
            fix();
            cia402_map_t *map = direction == 0 ? &m_config.commands.map[0] : &m_config.answers.map[1];
            map->entry[map->entries++] = k_entries[i];
            check_fits_not("1 to 8 whole bytes");
        }
        setUp();
        fix();
        (direction == 0 ? &m_config.commands : &m_config.answers)->map[0].entries = 0;
        check_fits_not("1 to 8 whole bytes");
    }
}

static void test_pdo_number_that_cannot_be_does_not_fit(void)
{
    static const uint16_t k_numbers[] = {0, CIA402_PDO_NUMBER_MAX + 1u};
    for (unsigned i = 0; i < 2; i++) {
        fix();
        m_config.answers.map[1].number = k_numbers[i];
        check_fits_not("1 to 8 whole bytes");
        m_config.answers.map[1].number = 2;
        m_config.commands.map[0].number = k_numbers[i];
        check_fits_not("1 to 8 whole bytes");
    }
    m_config.commands.map[0].number = CIA402_PDO_NUMBER_MAX;
    check_fits();
}

/* What stands behind the end of a list is never looked at. */
static void test_more_than_a_list_holds_does_not_fit(void)
{
    fix();
    m_config.commands.count = CIA402_MAPS_MAX + 1u;
    check_fits_not("1 to 8 whole bytes");
    fix();
    m_config.answers.count = 255;
    check_fits_not("1 to 8 whole bytes");
    fix();
    m_config.answers.map[1].entries = CIA402_PDO_ENTRIES + 1u;
    for (unsigned n = 0; n < CIA402_PDO_ENTRIES; n++) {
        m_config.answers.map[1].entry[n] = OWN_8;
    }
    check_fits_not("1 to 8 whole bytes");
}

static void test_controlword_and_statusword_are_needed_the_first_once(void)
{
    fix();
    m_config.commands.map[0].entry[0] = OWN_16;
    m_config.commands.map[0].entry[1] = OWN_8;
    check_fits_not("6040h");
    m_config.commands.map[0].entry[0] = m_config.commands.map[0].entry[1] = CIA402_ENTRY_CONTROLWORD;
    m_config.commands.map[0].entries = 3; /* twice */
    check_fits_not("6040h");
    fix();
    m_config.answers.map[0].entry[0] = OWN_16;
    check_fits_not("6041h");
    m_config.answers.map[0].entry[0] = m_config.answers.map[0].entry[1] = CIA402_ENTRY_STATUSWORD; /* that may be twice */
    check_fits();
    m_config.answers.map[1].entry[1] = CIA402_ENTRY_ACTUAL;
    check_fits_not("6064h");
}

static void test_node_has_four_identifiers_in_each_direction(void)
{
    join();
    fix();
    m_config.answers = (cia402_maps_t){.count = 0};
    m_config.commands =
        (cia402_maps_t){.count = 3, .map = {{1, 1, {CIA402_ENTRY_CONTROLWORD}}, {2, 1, {CIA402_ENTRY_TARGET}}, {3, 1, {OWN_8}}}};
    check_fits_not("four identifiers");
    m_config.commands.count = 2;
    check_fits();
    m_config.telemetry = DRIVE_HAS_LAG | DRIVE_HAS_INPUTS | DRIVE_HAS_TORQUE; /* two PDOs of each axis */
    m_config.telemetry_every = 2;
    check_fits_not("four identifiers");
    m_config.telemetry = DRIVE_HAS_LAG;
    check_fits();
}

static void test_pdos_of_a_channel_are_below_those_of_the_next(void)
{
    join();
    m_config.pdo_step = 4;
    m_config.commands = (cia402_maps_t){.count = 1, .map = {{5, 2, {CIA402_ENTRY_CONTROLWORD, CIA402_ENTRY_TARGET}}}};
    check_fits_not("pdo_step");
    m_config.commands.map[0].number = 4;
    check_fits();
    m_config.answers = (cia402_maps_t){.count = 1, .map = {{5, 2, {CIA402_ENTRY_STATUSWORD, CIA402_ENTRY_ACTUAL}}}};
    check_fits_not("pdo_step");
    m_config.pdo_step = 5;
    check_fits();
    m_config.pdo_step = 65; /* further than CiA 301 has them */
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
}

/* Channels without gaps, and no more than there are identifiers. */
static void test_channels_that_cannot_be_are_refused(void)
{
    join();
    m_config.axis[1].channel = 2;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
    setUp();
    m_config.axes = 5;
    for (unsigned k = 0; k < 5; k++) {
        m_config.axis[k].node = 1;
        m_config.axis[k].channel = (uint8_t)k;
    }
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
    m_config.axes = 4;
    TEST_ASSERT_EQUAL(HV_OK, init());
    m_config.axis[3].channel = 0; /* that is another's */
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
    m_config.axis[3].channel = 3;
    m_config.axis[3].step_max_q32 = 0;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
}

/* ---- which they are ---- */

/* Objects of the profile are at the distance of a channel, those of a manufacturer where they are. */
static void test_pdos_of_a_channel_have_its_objects(void)
{
    join();
    m_config.commands = (cia402_maps_t){.count = 1, .map = {{3, 3, {CIA402_ENTRY_CONTROLWORD, OWN_16, CIA402_ENTRY_TARGET}}}};
    check_fits();
    const cia402_pdo_t first = cia402_pdo(&m_config, 0, CIA402_COMMAND);
    const cia402_pdo_t second = cia402_pdo(&m_config, 1, CIA402_COMMAND);
    TEST_ASSERT_EQUAL_HEX32(CIA402_ENTRY_CONTROLWORD, first.entry[0]);
    TEST_ASSERT_EQUAL_HEX32(0x68400010, second.entry[0]);
    TEST_ASSERT_EQUAL_HEX32(OWN_16, second.entry[1]);
    TEST_ASSERT_EQUAL_HEX32(0x687A0020, second.entry[2]);
    TEST_ASSERT_EQUAL_HEX16(0x1402, first.record);
    TEST_ASSERT_EQUAL_HEX16(0x1442, second.record);
    TEST_ASSERT_EQUAL_HEX16(0x201, first.id);
    TEST_ASSERT_EQUAL_HEX16(0x301, second.id);
    TEST_ASSERT_EQUAL(8, first.bytes);
}

static void test_mode_is_told_where_the_answers_of_all_have_it(void)
{
    TEST_ASSERT_TRUE(cia402_map_has_mode(&m_config));
    fix();
    TEST_ASSERT_TRUE(cia402_map_has_mode(&m_config));
    share();
    TEST_ASSERT_FALSE(cia402_map_has_mode(&m_config)); /* of the second axis only */
}

/* ---- frames ---- */

static void receive(unsigned length, uint16_t id, const uint8_t *data)
{
    can_frame_t frame = {.id = id, .length = (uint8_t)length};
    memcpy(frame.data, data, length);
    cia402_pdo_receive(&m_driver, &frame);
}

static void test_command_has_zeros_where_the_driver_has_no_value(void)
{
    static const uint8_t k_alone[8] = {0, 0x0F, 0x00, 0x44, 0x33, 0x22, 0x11, 0x08};
    static const uint8_t k_first[8] = {0x0F, 0x00, 0x44, 0x33, 0x22, 0x11, 0, 0};
    can_frame_t frame;
    fix();
    check_fits();
    m_driver.axis[0].word = 0x0F;
    m_driver.axis[0].target_counts = 0x11223344;
    m_driver.axis[0].setup.mode = 8;
    TEST_ASSERT_TRUE(cia402_pdo_command(&m_driver, 0, 0, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x201, frame.id);
    TEST_ASSERT_EQUAL(8, frame.length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(k_alone, frame.data, 8);
    TEST_ASSERT_FALSE(cia402_pdo_command(&m_driver, 0, 1, &frame));
    share();
    m_config.axes = 1; /* the node has an axis that nobody drives */
    m_config.are_maps_fixed = true;
    check_fits();
    m_driver.axis[0].word = 0x0F;
    m_driver.axis[0].target_counts = 0x11223344;
    TEST_ASSERT_TRUE(cia402_pdo_command(&m_driver, 0, 0, &frame));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(k_first, frame.data, 8);
    TEST_ASSERT_TRUE(cia402_pdo_command(&m_driver, 0, 1, &frame));
    TEST_ASSERT_EACH_EQUAL_HEX8(0, frame.data, 6);
}

static void test_answer_is_read_past_what_the_driver_does_not_know(void)
{
    static const uint8_t k_state[8] = {0x37, 0x02, 0xAA, 0xAA, 0x10, 0x27, 0x00, 0x00};
    static const uint8_t k_beside[7] = {0x18, 0xFC, 0xF4, 0x01, 0x00, 0x00, 0x08};
    fix();
    check_fits();
    m_driver.axis[0].phase = CIA402_STARTING;
    m_driver.now_us = 1000;
    receive(8, 0x181, k_state);
    TEST_ASSERT_EQUAL_HEX16(0x0237, m_driver.axis[0].statusword);
    TEST_ASSERT_EQUAL_INT64(q32_from_int(10), m_driver.axis[0].actual_q32);
    receive(7, 0x281, k_beside); /* telemetry counts once the drive is there */
    TEST_ASSERT_EQUAL_HEX8(0, m_driver.axis[0].telemetry.has);
    TEST_ASSERT_EQUAL(8, m_driver.axis[0].mode_shown);
    m_driver.axis[0].phase = CIA402_UP;
    receive(6, 0x281, k_beside); /* another length is no answer */
    TEST_ASSERT_EQUAL_HEX8(0, m_driver.axis[0].telemetry.has);
    receive(7, 0x281, k_beside);
    TEST_ASSERT_EQUAL_HEX8(DRIVE_HAS_TORQUE | DRIVE_HAS_LAG, m_driver.axis[0].telemetry.has);
    TEST_ASSERT_EQUAL_INT32(-1000, m_driver.axis[0].telemetry.torque_permille);
    TEST_ASSERT_EQUAL_INT64(Q32_ONE / 2, m_driver.axis[0].telemetry.lag_q32);
}

/* Nor is a following error shown that no number here holds. */
static void test_lag_beyond_all_numbers_is_not_shown(void)
{
    static const uint8_t k_beside[7] = {0x18, 0xFC, 0xFF, 0xFF, 0xFF, 0x7F, 0x08};
    fix();
    m_config.axis[0].scale = (counts_scale_t){1, 1000, 0};
    check_fits();
    m_driver.axis[0].phase = CIA402_UP;
    receive(7, 0x281, k_beside);
    TEST_ASSERT_EQUAL_HEX8(DRIVE_HAS_TORQUE, m_driver.axis[0].telemetry.has);
    TEST_ASSERT_EQUAL_INT64(0, m_driver.axis[0].telemetry.lag_q32);
}

static void test_answer_of_an_axis_that_nobody_drives_counts_for_none(void)
{
    static const uint8_t k_second[7] = {0x37, 0x02, 0x10, 0x27, 0x00, 0x00, 0x08};
    share();
    m_config.axes = 1;
    m_config.are_maps_fixed = true;
    check_fits();
    m_driver.axis[0].phase = CIA402_UP;
    receive(7, 0x281, k_second);
    TEST_ASSERT_EQUAL_HEX16(0, m_driver.axis[0].statusword);
    TEST_ASSERT_FALSE(m_driver.axis[0].has_actual);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_maps_that_fit_are_accepted);
    RUN_TEST(test_pdo_without_whole_bytes_or_of_too_many_does_not_fit);
    RUN_TEST(test_pdo_number_that_cannot_be_does_not_fit);
    RUN_TEST(test_more_than_a_list_holds_does_not_fit);
    RUN_TEST(test_controlword_and_statusword_are_needed_the_first_once);
    RUN_TEST(test_node_has_four_identifiers_in_each_direction);
    RUN_TEST(test_pdos_of_a_channel_are_below_those_of_the_next);
    RUN_TEST(test_channels_that_cannot_be_are_refused);
    RUN_TEST(test_pdos_of_a_channel_have_its_objects);
    RUN_TEST(test_mode_is_told_where_the_answers_of_all_have_it);
    RUN_TEST(test_command_has_zeros_where_the_driver_has_no_value);
    RUN_TEST(test_answer_is_read_past_what_the_driver_does_not_know);
    RUN_TEST(test_lag_beyond_all_numbers_is_not_shown);
    RUN_TEST(test_answer_of_an_axis_that_nobody_drives_counts_for_none);
    return UNITY_END();
}

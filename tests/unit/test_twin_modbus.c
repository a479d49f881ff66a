/* SPDX-License-Identifier: MIT */
#include "platform/load.h"
#include "twin/modbus_side.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "heave/status.h"
#include "twin/twin_faults.h"
#include "unity.h"

#define STEP_US  1000u
#define STATUS   0x0100u /* registers of the preset */
#define TARGET   0x0200u
#define CONTROL  0x0210u
#define WATCHDOG 0x0300u

static const lines_t k_no_lines;
static config_t m_config;
static twin_settings_t m_settings;
static twin_t m_twin;
static uint64_t m_now_us;
static uint8_t m_answer[MODBUS_PDU_MAX];
static modbus_way_t m_way;

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d\n", file, line);
    abort();
}

static void run(uint64_t span_us)
{
    for (const uint64_t end_us = m_now_us + span_us; m_now_us < end_us;) {
        m_now_us += STEP_US;
        twin_advance(&m_twin, m_now_us);
    }
}

static void start(void)
{
    twin_start(&m_twin, &m_config, &m_settings, (node_out_t){NULL, NULL}, m_now_us);
    run(400000);
}

void setUp(void)
{
    m_now_us = 1000000;
    TEST_ASSERT_EQUAL(0, config_load(HEAVE_CONFIG "/modbus-tcp-hexapod.ini", &m_config, stderr));
    twin_settings_init(&m_settings, &m_config);
    m_settings.start_mm = 50;
    start();
}

void tearDown(void) {}

/* To drive 2, which has a line to itself. Returns bytes of the answer. */
static unsigned ask(const uint8_t *question, unsigned length)
{
    return modbus_side_ask(&m_twin.modbus, 1, 1, question, length, m_now_us, m_answer, &m_way);
}

/* Returns the exception; 0 = written; -1 = no answer. */
static int put(uint16_t address, const uint16_t *value, unsigned count)
{
    uint8_t question[64] = {16, (uint8_t)(address >> 8), (uint8_t)address, 0, (uint8_t)count, (uint8_t)(2 * count)};
    for (unsigned i = 0; i < count; i++) {
        question[6 + 2 * i] = (uint8_t)(value[i] >> 8);
        question[7 + 2 * i] = (uint8_t)value[i];
    }
    const unsigned length = ask(question, 6 + 2 * count);
    return length == 0 ? -1 : m_answer[0] == 16 ? 0 : m_answer[1];
}

static int put_one(uint16_t address, uint16_t value)
{
    return put(address, &value, 1);
}

static int put_target(double mm, uint16_t speed)
{
    const uint32_t counts = (uint32_t)(int32_t)(mm * 100);
    const uint16_t value[3] = {(uint16_t)(counts >> 16), (uint16_t)counts, speed};
    return put(TARGET, value, 3);
}

static unsigned get(uint16_t address)
{
    const uint8_t question[5] = {3, (uint8_t)(address >> 8), (uint8_t)address, 0, 1};
    TEST_ASSERT_EQUAL(4, ask(question, 5));
    return (unsigned)m_answer[2] << 8 | m_answer[3];
}

static void act(const char *line)
{
    char why[FAULT_WHY_MAX] = "";
    fault_t fault;
    TEST_ASSERT_TRUE_MESSAGE(fault_read(&fault, line, m_twin.drives, why), why);
    TEST_ASSERT_TRUE_MESSAGE(fault_do(&fault, &m_twin, m_now_us, why), why);
}

/* A master that goes on asking: the watchdog has nothing to say. */
static void watch(uint64_t span_us)
{
    for (uint64_t done_us = 0; done_us < span_us; done_us += 50000) {
        run(50000);
        (void)get(STATUS);
    }
}

static void test_map_read_backwards_shows_and_takes(void)
{
    TEST_ASSERT_EQUAL(0, get(STATUS));
    TEST_ASSERT_EQUAL(5000, get(STATUS + 2)); /* 50 mm */
    TEST_ASSERT_EQUAL(0, put_target(50, 100));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 1));
    TEST_ASSERT_EQUAL(1, get(STATUS));
    TEST_ASSERT_EQUAL(0, put_target(60, 100)); /* 10 mm/s */
    watch(500000);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 55, twin_position(&m_twin, 1));
    watch(350000);
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 2));
    watch(300000);
    const double stopped = twin_position(&m_twin, 1);
    watch(300000);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, stopped, twin_position(&m_twin, 1));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 0));
    TEST_ASSERT_EQUAL(0, get(STATUS));
}

static void test_old_target_moves_it_when_torque_comes(void)
{
    TEST_ASSERT_EQUAL(0, put_target(80, 200));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 1));
    run(400000);
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 58, twin_position(&m_twin, 1));
}

static void test_writes_that_the_map_lacks_are_exceptions(void)
{
    TEST_ASSERT_EQUAL(MODBUS_NO_VALUE, put_one(CONTROL, 7));
    TEST_ASSERT_EQUAL(MODBUS_NO_ADDRESS, put_one(0x0400, 7));
    TEST_ASSERT_EQUAL(MODBUS_NO_VALUE, put_one(TARGET, 7)); /* half a set-point */
    TEST_ASSERT_EQUAL(0, put_one(WATCHDOG, 250));
    TEST_ASSERT_EQUAL(250, get(WATCHDOG));
}

static void test_fault_is_shown_until_reset_or_mend(void)
{
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 1));
    act("fault 2 0x31");
    TEST_ASSERT_EQUAL(8, get(STATUS));
    TEST_ASSERT_EQUAL(0x31, get(STATUS + 3));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 1)); /* taken, and no torque comes of it */
    TEST_ASSERT_EQUAL(8, get(STATUS));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 128));
    TEST_ASSERT_EQUAL(8, get(STATUS)); /* the second half of the reset is still to come */
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 0));
    TEST_ASSERT_EQUAL(0, get(STATUS));
    act("broken 2");
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 128));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 0));
    TEST_ASSERT_EQUAL(8, get(STATUS));
    act("mend 2");
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 128));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 0));
    TEST_ASSERT_EQUAL(0, get(STATUS));
    m_twin.modbus.drive[1].is_torque_kept = true;
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 1));
    act("fault 2 0x31");
    TEST_ASSERT_EQUAL(9, get(STATUS));
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 0));
    TEST_ASSERT_EQUAL(8, get(STATUS));
}

static void test_a_map_without_a_speed_moves_at_the_usual_one(void)
{
    m_twin.modbus.map.setpoint.block[0].fields = 1;
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 1));
    TEST_ASSERT_EQUAL(0, put_target(60, 0));
    run(400000);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 60, twin_position(&m_twin, 1));
}

static void test_watchdog_stops_what_hears_nothing(void)
{
    TEST_ASSERT_EQUAL(0, put_one(CONTROL, 1));
    for (unsigned i = 0; i < 20; i++) {
        run(100000);
        TEST_ASSERT_EQUAL(1, get(STATUS));
    }
    run(3000000);
    TEST_ASSERT_EQUAL(8, get(STATUS));
    TEST_ASSERT_EQUAL(0x84, get(STATUS + 3));
}

static void test_answers_are_spoilt_so_many_times(void)
{
    const uint8_t question[5] = {3, 1, 0, 0, 1};
    act("lose 2 2");
    TEST_ASSERT_EQUAL(0, ask(question, 5));
    TEST_ASSERT_EQUAL(0, ask(question, 5));
    TEST_ASSERT_EQUAL(4, ask(question, 5));
    act("exception 2 1 4");
    TEST_ASSERT_EQUAL(2, ask(question, 5));
    TEST_ASSERT_EQUAL_HEX8(0x83, m_answer[0]);
    TEST_ASSERT_EQUAL(4, m_answer[1]);
    act("damaged 2 1");
    TEST_ASSERT_TRUE(ask(question, 5) == 4 && m_way.is_damaged);
    act("half 2 1");
    TEST_ASSERT_TRUE(ask(question, 5) == 4 && m_way.is_half && !m_way.is_damaged);
    act("late 2 20");
    TEST_ASSERT_TRUE(ask(question, 5) == 4 && m_way.late_us == 20000 && !m_way.is_half);
    act("mute 2");
    TEST_ASSERT_EQUAL(0, ask(question, 5));
    act("mend 2");
    TEST_ASSERT_TRUE(ask(question, 5) == 4 && m_way.late_us == 0);
    act("cable-out");
    TEST_ASSERT_EQUAL(0, ask(question, 5));
    act("cable-in");
    act("power-off 2");
    TEST_ASSERT_EQUAL(0, ask(question, 5));
    act("power-on 2");
    TEST_ASSERT_EQUAL(0, ask(question, 5)); /* it starts */
    run(400000);
    TEST_ASSERT_EQUAL(4, ask(question, 5));
}

static void test_register_is_held_until_mend(void)
{
    act("register 2 0x0300 7");
    TEST_ASSERT_EQUAL(0, put_one(WATCHDOG, 100));
    TEST_ASSERT_EQUAL(7, get(WATCHDOG));
    act("mend all");
    TEST_ASSERT_EQUAL(0, put_one(WATCHDOG, 100));
    TEST_ASSERT_EQUAL(100, get(WATCHDOG));
}

static void test_faults_that_these_drives_lack_are_refused(void)
{
    static const char *const k_lines[] = {"heartbeat-lost 2", "sdo-silent 2",  "down",         "bus-off",
                                          "queue-full",       "relays-silent", "emcy 2 0x1000"};
    char why[FAULT_WHY_MAX];
    fault_t fault;
    for (unsigned i = 0; i < sizeof k_lines / sizeof k_lines[0]; i++) {
        TEST_ASSERT_TRUE(fault_read(&fault, k_lines[i], 6, why));
        TEST_ASSERT_FALSE_MESSAGE(fault_do(&fault, &m_twin, m_now_us, why), k_lines[i]);
    }
    TEST_ASSERT_TRUE(fault_read(&fault, "damaged 2 1", 6, why));
    const fault_machine_t other = {.kind = TWIN_DRIVES_CIA402};
    const fault_machine_t modbus = {.kind = TWIN_DRIVES_MODBUS};
    TEST_ASSERT_FALSE(fault_suits(&fault, &other, why));
    TEST_ASSERT_TRUE(fault_suits(&fault, &modbus, why));
}

static void test_any_bytes_get_an_answer_or_none(void)
{
    uint8_t question[MODBUS_PDU_MAX];
    srand(1);
    for (unsigned i = 0; i < 200000; i++) {
        const unsigned length = (unsigned)rand() % 40;
        for (unsigned k = 0; k < length; k++) {
            question[k] = (uint8_t)(rand() % (k % 2 == 0 ? 256 : 4));
        }
        question[0] = rand() % 2 == 0 ? (uint8_t)(rand() % 17) : question[0];
        TEST_ASSERT_TRUE(ask(question, length) <= MODBUS_PDU_MAX);
        m_twin.modbus.board = (modbus_board_t){.is_there = true, .unit = 1};
        TEST_ASSERT_TRUE(modbus_side_ask(&m_twin.modbus, MODBUS_BOARD_LINE, 1, question, length, m_now_us, m_answer, &m_way) <=
                         MODBUS_PDU_MAX);
    }
}

static void test_maps_of_the_presets_can_be_shown(void)
{
    static const char *const k_files[] = {HEAVE_CONFIG "/modbus-tcp-hexapod.ini"};
    for (unsigned i = 0; i < sizeof k_files / sizeof k_files[0]; i++) {
        TEST_ASSERT_EQUAL(0, config_load(k_files[i], &m_config, stderr));
        TEST_ASSERT_NULL(twin_refusal(&m_config, &k_no_lines));
    }
    m_config.modbus.fault_when = m_config.modbus.enabled_when; /* nobody could tell one from the other */
    TEST_ASSERT_NOT_NULL(twin_refusal(&m_config, &k_no_lines));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_map_read_backwards_shows_and_takes);
    RUN_TEST(test_old_target_moves_it_when_torque_comes);
    RUN_TEST(test_writes_that_the_map_lacks_are_exceptions);
    RUN_TEST(test_fault_is_shown_until_reset_or_mend);
    RUN_TEST(test_a_map_without_a_speed_moves_at_the_usual_one);
    RUN_TEST(test_watchdog_stops_what_hears_nothing);
    RUN_TEST(test_answers_are_spoilt_so_many_times);
    RUN_TEST(test_register_is_held_until_mend);
    RUN_TEST(test_faults_that_these_drives_lack_are_refused);
    RUN_TEST(test_any_bytes_get_an_answer_or_none);
    RUN_TEST(test_maps_of_the_presets_can_be_shown);
    return UNITY_END();
}

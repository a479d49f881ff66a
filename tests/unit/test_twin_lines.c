/* SPDX-License-Identifier: MIT
 * test_twin_lines.c - which GPIO lines heave-twin makes of a configuration, where, and which faults they have. What is on them:
 * tests/system/test_twin_gpio.py.
 */
#include "platform/load.h"
#include "twin/lines.h"

#include <stdlib.h>
#include <string.h>

#include "twin/twin_faults.h"
#include "twin/script.h"
#include "unity.h"

static config_t m_config;
static lines_t m_lines;
static script_t m_script;

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d\n", file, line);
    abort();
}

void setUp(void)
{
    TEST_ASSERT_EQUAL(0, config_load(HEAVE_CONFIG "/demo-hexapod.ini", &m_config, stderr));
    memset(&m_script, 0, sizeof m_script);
}

void tearDown(void) {}

static void name(config_label_t *label, const char *text)
{
    (void)snprintf(label->text, sizeof label->text, "%s", text);
}

static void relays(const char *chip, const char *first, const char *second)
{
    m_config.relays.driver = CONFIG_RELAYS_GPIO;
    m_config.relays.lines.count = 2;
    name(&m_config.relays.chip, chip);
    name(&m_config.relays.lines.line[0], first);
    name(&m_config.relays.lines.line[1], second);
}

static void inputs(const char *chip, const char *estop, const char *reset)
{
    m_config.inputs.driver = CONFIG_INPUTS_GPIO;
    name(&m_config.inputs.chip, chip);
    name(&m_config.inputs.estop_line, estop);
    name(&m_config.inputs.reset_line, reset);
}

static void test_without_gpio_there_are_none_and_heaveds_own_drives_are_refused(void)
{
    lines_plan(&m_lines, &m_config);
    TEST_ASSERT_EQUAL(0, m_lines.count);
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, lines_due_us(&m_lines));
    TEST_ASSERT_NOT_NULL(twin_refusal(&m_config, &m_lines));
    inputs("", "ESTOP", "");
    lines_plan(&m_lines, &m_config);
    TEST_ASSERT_EQUAL(1, m_lines.count);
    TEST_ASSERT_NULL(twin_refusal(&m_config, &m_lines));
}

static void test_names_are_where_no_number_is(void)
{
    relays("board", "0", "3");
    inputs("board", "STOP", "RESET");
    m_config.healthy.driver = CONFIG_HEALTHY_GPIO;
    name(&m_config.healthy.line, "PULSE");
    lines_plan(&m_lines, &m_config);
    TEST_ASSERT_EQUAL(5, m_lines.count);
    TEST_ASSERT_EQUAL(2, m_lines.chips);
    TEST_ASSERT_EQUAL_STRING("board", m_lines.label[0]);
    TEST_ASSERT_EQUAL_STRING("heave-twin", m_lines.label[1]);
    static const unsigned k_offset[] = {0, 3, 1, 2, 0};
    for (unsigned i = 0; i < m_lines.count; i++) {
        TEST_ASSERT_EQUAL(k_offset[i], m_lines.line[i].offset);
        TEST_ASSERT_EQUAL(i >= 2, m_lines.line[i].is_named);
    }
    TEST_ASSERT_EQUAL(4, m_lines.size[0]);
    TEST_ASSERT_EQUAL(1, m_lines.size[1]);
}

static void test_a_healthy_machine_at_the_start(void)
{
    inputs("", "STOP", "RESET");
    name(&m_config.inputs.power_line, "SUPPLY");
    lines_plan(&m_lines, &m_config);
    char text[200];
    TEST_ASSERT_TRUE(lines_status(&m_lines, 0, text, sizeof text) < sizeof text);
    TEST_ASSERT_EQUAL_STRING(", \"switches\": {\"estop\": \"closed\", \"reset\": \"open\", \"power\": \"closed\"}", text);
    lines_switch(&m_lines, SWITCH_RESET, true);
    lines_switch(&m_lines, SWITCH_ENABLE, true); /* there is none */
    (void)lines_status(&m_lines, 0, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING(", \"switches\": {\"estop\": \"closed\", \"reset\": \"closed\", \"power\": \"closed\"}", text);
    for (size_t size = 1; size < sizeof text; size++) {
        memset(text, '!', sizeof text);
        (void)lines_status(&m_lines, 0, text, size);
        TEST_ASSERT_EQUAL('!', text[size]);
    }
}

static void test_a_chip_too_large_is_named(void)
{
    char why[LINES_WHY_MAX];
    relays("board", "0", "1024");
    lines_plan(&m_lines, &m_config);
    TEST_ASSERT_FALSE(lines_open(&m_lines, &m_config, 0, why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "at most 1024 lines"), why);
    lines_close(&m_lines);
}

static bool suits(const char *line, char why[FAULT_WHY_MAX])
{
    const fault_machine_t machine = {.kind = TWIN_DRIVES_NONE, .lines = &m_lines};
    fault_t fault;
    TEST_ASSERT_TRUE_MESSAGE(fault_read(&fault, line, 0, why), why);
    return fault_suits(&fault, &machine, why);
}

static void test_faults_of_lines_that_there_are(void)
{
    static const char *const k_wrong[] = {"estop", "estop ajar", "estop open now", "chip-gone", "chip-gone drives",
                                          "jam 1", "jam all"};
    char why[FAULT_WHY_MAX];
    fault_t fault;
    inputs("", "STOP", "RESET");
    lines_plan(&m_lines, &m_config);
    TEST_ASSERT_TRUE(suits("estop open", why) && suits("reset closed", why) && suits("chip-gone inputs", why));
    TEST_ASSERT_FALSE(suits("estop2 open", why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "no such GPIO line"), why);
    TEST_ASSERT_FALSE(suits("chip-back relays", why));
    TEST_ASSERT_FALSE(suits("down", why) || suits("cable-out", why));
    for (unsigned i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(fault_read(&fault, k_wrong[i], 0, why), k_wrong[i]);
    }
}

static void test_a_script_without_drives_has_no_times_after_torque(void)
{
    char why[FAULT_WHY_MAX];
    inputs("", "STOP", "RESET");
    lines_plan(&m_lines, &m_config);
    m_script.machine = (fault_machine_t){.kind = TWIN_DRIVES_NONE, .lines = &m_lines};
    TEST_ASSERT_TRUE(script_add(&m_script, "2 estop open", 0, why));
    TEST_ASSERT_FALSE(script_add(&m_script, "+2 estop open", 0, why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "time since the start"), why);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_without_gpio_there_are_none_and_heaveds_own_drives_are_refused);
    RUN_TEST(test_names_are_where_no_number_is);
    RUN_TEST(test_a_healthy_machine_at_the_start);
    RUN_TEST(test_a_chip_too_large_is_named);
    RUN_TEST(test_faults_of_lines_that_there_are);
    RUN_TEST(test_a_script_without_drives_has_no_times_after_torque);
    return UNITY_END();
}

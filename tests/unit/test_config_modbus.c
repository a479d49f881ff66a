/* SPDX-License-Identifier: MIT
 * test_config_modbus.c - the Modbus sections: the preset as a map, every message of what contradicts itself with its line, values
 * to text and back, the rate that a line carries.
 */
#define _POSIX_C_SOURCE 200809L

#include "platform/load.h"
#include "platform/modbus_section.h"
#include "inspect/report.h"

#include <stdio.h>
#include <string.h>

#include "unity.h"

#define FILE_NAME "test_config_modbus.tmp.ini"
#define PRESET    HEAVE_CONFIG_DIR "/modbus-tcp-hexapod.ini"

static config_t m_config;
static char m_text[20000];
static char m_errors[20000];

void setUp(void)
{
    FILE *file = fopen(PRESET, "rb");
    TEST_ASSERT_NOT_NULL(file);
    m_text[fread(m_text, 1, sizeof m_text - 1, file)] = '\0';
    (void)fclose(file);
    memset(&m_config, 0, sizeof m_config);
}

void tearDown(void)
{
    (void)remove(FILE_NAME);
}

static int load(const char *path)
{
    FILE *errors = tmpfile();
    TEST_ASSERT_NOT_NULL(errors);
    const int count = config_load(path, &m_config, errors);
    rewind(errors);
    m_errors[fread(m_errors, 1, sizeof m_errors - 1, errors)] = '\0';
    (void)fclose(errors);
    return count;
}

static int load_text(void)
{
    FILE *file = fopen(FILE_NAME, "wb");
    TEST_ASSERT_NOT_NULL(file);
    (void)fputs(m_text, file);
    (void)fclose(file);
    return load(FILE_NAME);
}

/* Replaces the first occurrence. */
static void put(const char *from, const char *to)
{
    static char rest[sizeof m_text];
    char *at = strstr(m_text, from);
    TEST_ASSERT_NOT_NULL_MESSAGE(at, from);
    (void)snprintf(rest, sizeof rest, "%s", at + strlen(from));
    (void)snprintf(at, sizeof m_text - (size_t)(at - m_text), "%s%s", to, rest);
}

/* Line of a key in m_text; its name is what is behind the section. */
static unsigned line_of(const char *key)
{
    char what[80];
    (void)snprintf(what, sizeof what, "\n%s = ", strchr(key, ']') + 2);
    const char *found = strstr(m_text, what);
    unsigned line = 1;
    TEST_ASSERT_NOT_NULL_MESSAGE(found, what);
    for (const char *at = m_text; at <= found; at++) {
        line += *at == '\n';
    }
    return line;
}

/* One error, at the line of this key, with these words. */
static void refuse(const char *from, const char *to, const char *key, const char *words)
{
    char start[120];
    setUp();
    put(from, to);
    const int count = load_text();
    (void)snprintf(start, sizeof start, "%s:%u: %s: ", FILE_NAME, line_of(key), key);
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, count, m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, start), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, words), m_errors);
}

static void test_preset_is_the_map_that_it_says(void)
{
    modbus_drive_map_t map;
    modbus_drive_t driver;
    static const hal_modbus_t k_none[DRIVES_MAX];
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(PRESET), m_errors);
    config_modbus_map(&m_config, &map);
    TEST_ASSERT_EQUAL_UINT8(6, map.axes);
    TEST_ASSERT_EQUAL_UINT8(6, config_modbus_lines(&m_config));
    TEST_ASSERT_EQUAL_HEX16(0x0200, map.setpoint.block[0].address);
    TEST_ASSERT_EQUAL_UINT8(3, map.setpoint.block[0].count);
    TEST_ASSERT_EQUAL_UINT8(2, map.command[MODBUS_DRIVE_RESET].count);
    TEST_ASSERT_EQUAL_HEX16(128, map.command[MODBUS_DRIVE_RESET].block[0].data[0]);
    TEST_ASSERT_EQUAL_UINT8(1, map.items);
    TEST_ASSERT_TRUE(map.item[0].is_written && map.item[0].is_checked);
    TEST_ASSERT_EQUAL_UINT32(10000, map.expected_us);
    TEST_ASSERT_EQUAL_UINT8(5, map.axis[5].line);
    TEST_ASSERT_EQUAL_UINT8(1, map.axis[5].unit);
    TEST_ASSERT_EQUAL_INT32(100, map.axis[5].scale.num);
    /* the driver's own check has nothing against it but the lines that are not there */
    TEST_ASSERT_EQUAL(HV_ERR_ARG, modbus_drive_init(&driver, &map, k_none));
}

/* By hand: 15 + 8 and 8 + 13 bytes of 11 bits at 115200 bit/s, twice 1.75 ms of silence and 2 ms of turnaround, six drives. */
static void test_serial_line_is_as_slow_as_its_bytes(void)
{
    modbus_drive_map_t map;
    put("driver = modbus-tcp", "driver = modbus-rtu");
    put("[modbus-tcp]\nhosts = 192.168.1.11, 192.168.1.12, 192.168.1.13, 192.168.1.14, 192.168.1.15, 192.168.1.16",
        "[modbus-rtu]");
    put("speed_mm_s = 300", "speed_mm_s = 60");
    put("[engage]", "[engage] ");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    config_modbus_map(&m_config, &map);
    TEST_ASSERT_EQUAL_UINT8(1, config_modbus_lines(&m_config));
    TEST_ASSERT_EQUAL_UINT8(6, map.axis[5].unit);
    TEST_ASSERT_UINT32_WITHIN(20, 6 * ((23 + 21) * 11 * 1000000 / 115200 + 2 * 3750), map.expected_us);
}

static void test_dump_reads_back_as_the_same(void)
{
    FILE *file = fopen(FILE_NAME, "wb");
    config_t first;
    put("enable = 0x0210 1", "enable = 0x0210 1 2 | 0x0300 65535\nstartup = 0x0001 is 3, 0x0002 = 9 unchecked, 0x0003 = 7");
    put("drive_timeout = 0x0300 = 100", "drive_timeout = 0x0301 = 100");
    (void)fclose(file);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    first = m_config;
    file = fopen(FILE_NAME, "wb");
    TEST_ASSERT_NOT_NULL(file);
    config_dump(&m_config, file);
    (void)fclose(file);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(FILE_NAME), m_errors);
    TEST_ASSERT_EQUAL_MEMORY(&first.modbus, &m_config.modbus, sizeof first.modbus);
    TEST_ASSERT_EQUAL_MEMORY(&first.modbus_tcp, &m_config.modbus_tcp, sizeof first.modbus_tcp);
    TEST_ASSERT_FALSE(m_config.modbus.startup.item[0].is_written);
    TEST_ASSERT_FALSE(m_config.modbus.startup.item[1].is_checked);
}

static void test_values_that_are_none_are_refused(void)
{
    refuse("setpoint = 0x0200", "setpoint = zwei", "[modbus] setpoint", "is no register to begin a block with");
    refuse("{speed:u16}", "{speed:u24}", "[modbus] setpoint", "has no type that there is");
    refuse("{speed:u16}", "{status:u16}", "[modbus] setpoint", "is no field of these blocks");
    refuse("{speed:u16}", "{position:u16}", "[modbus] setpoint", "is there twice");
    refuse("{speed:u16}", "..", "[modbus] setpoint", "only feedback can have");
    refuse("{speed:u16}", "70000", "[modbus] setpoint", "is no value of a register");
    refuse("{speed:u16}", "1 2 3 4 5 6 7 8 9 10 11 12 13 14 15", "[modbus] setpoint", "beyond the 16 registers");
    refuse("setpoint = 0x0200", "setpoint = 0xFFFE", "[modbus] setpoint", "beyond register 65535");
    refuse("setpoint = 0x0200", "setpoint = 1 | 0x0200", "[modbus] setpoint", "has a block without registers");
    refuse("{speed:u16}", "{speed:u16} |", "[modbus] setpoint", "ends where a block should begin");
    refuse("{alarm:u16}", "17", "[modbus] feedback", "is neither a field nor ..");
    refuse("drive_timeout = 0x0300 = 100", "drive_timeout = 0x0300 100", "[modbus] drive_timeout", "is no item");
    refuse("drive_timeout = 0x0300 = 100", "drive_timeout = 0x0300 = 100000", "[modbus] drive_timeout",
           "has a register or a value");
    refuse("192.168.1.16", "192.168.1.256", "[modbus-tcp] hosts", "is no IPv4 address");
    refuse("192.168.1.16", "192.168.1.16:0", "[modbus-tcp] hosts", "is no IPv4 address");
}

static void test_units_and_hosts_have_to_tell_drives_apart(void)
{
    refuse("units = 1 ", "units = 0 ", "[modbus] units", "is no unit id; allowed: 1 to 247");
    refuse("units = 1 ", "units = 248 ", "[modbus] units", "is no unit id; allowed: 1 to 247");
    refuse("units = 1 ", "units = one ", "[modbus] units", "allowed: a unit id from 1 to 247, or one for each drive");
    refuse("units = 1 ", "units = 1, 2, 3 ", "[modbus] units", "has 3 values; allowed: one, or one for each of the 6 drives");
    refuse("192.168.1.16", "192.168.1.13", "[modbus-tcp] hosts", "is of drive 3 and of drive 6");
    refuse(", 192.168.1.16", "", "[modbus-tcp] hosts", "has 5 values");
    refuse("step_mm = 5", "broadcast = yes", "[modbus] broadcast", "every drive has a line of its own");
}

static void test_units_on_one_line_are_different(void)
{
    put("hosts = 192.168.1.11, 192.168.1.12, 192.168.1.13, 192.168.1.14, 192.168.1.15, 192.168.1.16", "hosts = 192.168.1.11");
    put("units = 1 ", "units = 1, 2, 3, 4, 5, 2 ");
    TEST_ASSERT_EQUAL_INT(1, load_text());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "2 is of drive 2 and of drive 6, on one line"), m_errors);
}

static void test_numbers_have_to_fit_at_full_stroke(void)
{
    refuse("counts_per_mm = 100/1", "counts_per_mm = 10000000/1", "[modbus] counts_per_mm", "and {position} of setpoint carries");
    refuse("speed_counts_per_mm_s = 10/1", "speed_counts_per_mm_s = 1000/1", "[modbus] speed_counts_per_mm_s",
           "carries up to 65535");
    refuse("speed_counts = 1\n", "speed_counts = 70000\n", "[modbus] speed_counts", "does not fit {speed}");
    setUp();
    put("feedback = 0x0100 {status:u16} {position:i32hl}", "feedback = 0x0100 {status:u16} {position:i16}");
    put("counts_per_mm = 100/1", "counts_per_mm = 200/1");
    TEST_ASSERT_EQUAL_INT(1, load_text());
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(m_errors, "300 mm of drive 1 are 60000 counts, and {position} of feedback carries -32768"), m_errors);
}

static void test_registers_are_written_once(void)
{
    refuse("{speed:u16}", "{speed:u16} | 0x0202 1", "[modbus] setpoint", "register 0x0202 is in two blocks");
    refuse("enable = 0x0210", "enable = 0x0201", "[modbus] enable", "register 0x0201 is one of setpoint, too");
    refuse("drive_timeout = 0x0300", "drive_timeout = 0x0202", "[modbus] drive_timeout", "register 0x0202 is written by");
    refuse("step_mm = 5", "startup = 0x0200 = 1", "[modbus] startup", "register 0x0200 is written by setpoint, too");
    refuse("step_mm = 5", "startup = 0x0210 = 1", "[modbus] startup", "register 0x0210 is one of enable or home: it could give");
}

static void test_what_judges_needs_its_field(void)
{
    refuse("feedback = 0x0100 {status:u16} {position:i32hl}", "feedback = 0x0100 {status:u16} {status:u16}", "[modbus] feedback",
           "twice");
    refuse("fault_when = 0x0008/0x0008", "fault_when = 0x10000/0x10000", "[modbus] fault_when", "allowed: up to 0xFFFF");
    refuse("setpoint = 0x0200 {position:i32hl} {speed:u16}", "setpoint = 0x0200 {speed:u16}", "[modbus] setpoint",
           "has no {position}");
}

/* Nothing in Modbus stops a drive whose gateway is gone. */
static void test_drive_timeout_is_there_or_confirmed(void)
{
    refuse("drive_timeout = 0x0300 = 100", "drive_timeout = none", "[modbus] drive_timeout", "drive_timeout_confirmed = yes");
    refuse("drive_timeout = 0x0300 = 100", "drive_timeout = 0x0300 = 100 unchecked", "[modbus] drive_timeout",
           "is not read back");
    setUp();
    put("drive_timeout = 0x0300 = 100", "drive_timeout_confirmed = yes");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
}

static void test_line_too_slow_for_the_motion_is_refused(void)
{
    refuse("period_us = 10000", "period_us = 20000", "[modbus] step_mm", "the set-points are 6.000 mm apart");
    refuse("step_mm = 5", "step_mm = 2.9", "[modbus] step_mm", "allowed: at least 3.0");
    refuse("following_error_mm = 20", "following_error_mm = 8", "[modbus] following_error_mm", "allowed: at least 9.0");
    refuse("step_mm = 5", "feedback_timeout_ms = 100", "[modbus] feedback_timeout_ms", "allowed: at least 120 ms");
}

static void test_report_tells_the_rate(void)
{
    char text[400] = "";
    FILE *file = fmemopen(text, sizeof text, "w");
    TEST_ASSERT_EQUAL_INT(0, load(PRESET));
    config_modbus_report(&m_config, file);
    (void)fclose(file);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "100.0 Hz of each drive expected (10.0 ms: 1 on a line"), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "500.0 mm/s of a cylinder"), text);
}

static bool is_warned(const char *warning)
{
    static char text[40000];
    FILE *file = tmpfile();
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    (void)report_write(&m_config, 1, file);
    rewind(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    (void)fclose(file);
    return strstr(text, warning) != NULL;
}

/* 40257 of a manual is 256 on the wire. */
static void test_report_warns_of_numbers_of_manuals(void)
{
    TEST_ASSERT_FALSE(is_warned("if a manual calls it so"));
    put("feedback = 0x0100", "feedback = 40257");
    TEST_ASSERT_TRUE(is_warned("warning: [modbus] feedback has register 40257: if a manual calls it so, it is 256 here"));
    setUp();
    put("feedback = 0x0100", "feedback = 30257");
    TEST_ASSERT_FALSE(is_warned("if a manual calls it so")); /* holding registers are read here */
    put("[modbus]\n", "[modbus]\nread = input\n");
    TEST_ASSERT_TRUE(is_warned("[modbus] feedback has register 30257: if a manual calls it so, it is 256 here"));
    setUp();
    put("drive_timeout = 0x0300", "drive_timeout = 40001");
    TEST_ASSERT_TRUE(is_warned("[modbus] drive_timeout has register 40001: if a manual calls it so, it is 0 here"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_report_warns_of_numbers_of_manuals);
    RUN_TEST(test_preset_is_the_map_that_it_says);
    RUN_TEST(test_serial_line_is_as_slow_as_its_bytes);
    RUN_TEST(test_dump_reads_back_as_the_same);
    RUN_TEST(test_values_that_are_none_are_refused);
    RUN_TEST(test_units_and_hosts_have_to_tell_drives_apart);
    RUN_TEST(test_units_on_one_line_are_different);
    RUN_TEST(test_numbers_have_to_fit_at_full_stroke);
    RUN_TEST(test_registers_are_written_once);
    RUN_TEST(test_what_judges_needs_its_field);
    RUN_TEST(test_drive_timeout_is_there_or_confirmed);
    RUN_TEST(test_line_too_slow_for_the_motion_is_refused);
    RUN_TEST(test_report_tells_the_rate);
    return UNITY_END();
}

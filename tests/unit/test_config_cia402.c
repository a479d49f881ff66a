/* SPDX-License-Identifier: MIT
 * test_config_cia402.c - [cia402]: what the driver gets from the ready-made platform, and every message of what contradicts
 * itself.
 */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <string.h>

#include "platform/bus.h"
#include "platform/cia402_section.h"
#include "config/config.h"
#include "platform/load.h"
#include "config/startup.h"
#include "config/value.h"
#include "canopen_drives.h"
#include "inspect/report.h"
#include "unity.h"

#define FILE_NAME "test_config_cia402.tmp.ini"
#define PRESET    HEAVE_CONFIG_DIR "/hexapod-cia402.ini"

static config_t m_config;
static char m_text[40000];
static char m_errors[20000];

void setUp(void)
{
    FILE *file = fopen(PRESET, "rb");
    TEST_ASSERT_NOT_NULL(file);
    m_text[fread(m_text, 1, sizeof m_text - 1, file)] = '\0';
    fclose(file);
    memset(&m_config, 0, sizeof m_config);
}

void tearDown(void)
{
    remove(FILE_NAME);
}

static int load(void)
{
    FILE *file = fopen(FILE_NAME, "wb");
    FILE *errors = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_NOT_NULL(errors);
    fputs(m_text, file);
    fclose(file);
    const int count = config_load(FILE_NAME, &m_config, errors);
    rewind(errors);
    m_errors[fread(m_errors, 1, sizeof m_errors - 1, errors)] = '\0';
    fclose(errors);
    return count;
}

/* Puts a line right behind the header of a section, in place of that key's own line.
 * Returns its number. */
static unsigned put(const char *section, const char *line)
{
    static char rest[20000];
    char key[64] = "\n";
    strncat(key, line, strcspn(line, "="));
    char *at = strstr(m_text, section);
    TEST_ASSERT_NOT_NULL(at);
    at = strchr(at, '\n') + 1;
    char *old = strstr(at - 1, key);
    char *next = strstr(at, "\n[");
    if (old != NULL && (next == NULL || old < next)) {
        memmove(old + 1, strchr(old + 1, '\n') + 1, strlen(strchr(old + 1, '\n') + 1) + 1);
    }
    snprintf(rest, sizeof rest, "%s\n%s", line, at);
    memcpy(at, rest, strlen(rest) + 1);
    unsigned number = 1;
    for (const char *c = m_text; c < at; c++) {
        number += *c == '\n';
    }
    return number;
}

/* One wrong line, one error at it, with these words. */
static void refuse(const char *line, const char *words)
{
    char place[160];
    setUp();
    const unsigned number = put("[cia402]", line);
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load(), m_errors);
    sprintf(place, "%s:%u: [cia402] ", FILE_NAME, number);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, place), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, words), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "; allowed: "), m_errors);
}

static void test_load_preset_gives_what_the_driver_takes(void)
{
    cia402_config_t drives;
    cia402_t driver;
    static const hal_can_ops_t k_ops = {(hv_status_t(*)(void *, const can_frame_t *))1,
                                        (hv_status_t(*)(void *, can_frame_t *, uint64_t *))1,
                                        NULL,
                                        NULL,
                                        NULL,
                                        NULL};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_EQUAL(CONFIG_DRIVES_CIA402, m_config.drives);
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &drives, (hal_can_t){&k_ops, NULL}));
    TEST_ASSERT_EQUAL_UINT8(6, drives.axes);
    TEST_ASSERT_EQUAL(CIA402_MODE_CSP, drives.mode);
    TEST_ASSERT_EQUAL_INT16(1, drives.abort_option);
    for (unsigned k = 0; k < 6; k++) {
        TEST_ASSERT_EQUAL_UINT8(k + 1, drives.axis[k].node);
        TEST_ASSERT_EQUAL_INT32(131072, drives.axis[k].scale.num);
        TEST_ASSERT_EQUAL_INT32(10, drives.axis[k].scale.den);
        TEST_ASSERT_EQUAL_UINT32(131072, drives.axis[k].window_counts);            /* 10 mm */
        TEST_ASSERT_EQUAL_UINT32(52428800, drives.axis[k].quick_stop_accel);       /* 4000 mm/s^2 */
        TEST_ASSERT_EQUAL_INT64(q32_from_int(4) + 1, drives.axis[k].step_max_q32); /* twice 500 mm/s in 4 ms */
    }
}

/* What follows from answers that are rare: a wider window, no handshake, and all of them in one period unless they take turns. */
static void test_load_rare_answers_need_a_wider_window(void)
{
    config_bus_t bus;
    put("[cia402]", "answer_every = 4");
    put("[cia402]", "following_error_mm = 8");
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load(), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "moves in 6 periods; allowed: at least 12.0"), m_errors);
    put("[cia402]", "following_error_mm = 13");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_bus_describe(&m_config, &bus);
    const uint32_t together_ppm = config_bus_load_ppm(&bus);
    put("[cia402]", "sync_counter = 8");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_bus_describe(&m_config, &bus);
    TEST_ASSERT_TRUE(config_bus_load_ppm(&bus) + 100000 < together_ppm); /* 2 answers of 6 */
    put("[cia402]", "following_error_mm = 30");
    put("[cia402]", "mode = pp");
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load(), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "answer_every: mode = pp needs the answer to every SYNC; allowed: 1"),
                                 m_errors);
}

static void test_load_telemetry_is_in_the_load(void)
{
    config_bus_t bus;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_bus_describe(&m_config, &bus);
    const uint32_t plain_ppm = config_bus_load_ppm(&bus);
    put("[cia402]", "tell_torque = yes");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_bus_describe(&m_config, &bus);
    TEST_ASSERT_TRUE(config_bus_load_ppm(&bus) > plain_ppm + 100000);
}

static void test_load_lists_and_signs_reach_their_drives(void)
{
    cia402_config_t drives;
    put("[cia402]", "nodes = 11, 12, 13, 24, 25, 26");
    put("[cia402]", "counts_per_mm = 1000, -1000, 1000, -1000, 1000/3, 7");
    put("[cia402]", "zero_counts = 0, 500, -500, 1, 2, 3");
    put("[cia402]", "homing_method = 0, 17, -3, 35, 0, 1");
    put("[cia402]", "mode = ip");
    put("[cia402]", "when_gateway_lost = quick-stop");
    put("[cia402]", "revision_number = 3");
    put("[cia402]", "serial_numbers = 1, 2, 0, 4, 5, 4294967295");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL_UINT8(24, drives.axis[3].node);
    TEST_ASSERT_EQUAL_INT32(-1000, drives.axis[1].scale.num);
    TEST_ASSERT_EQUAL_INT32(500, drives.axis[1].scale.zero);
    TEST_ASSERT_EQUAL_INT32(3, drives.axis[4].scale.den);
    TEST_ASSERT_EQUAL_INT8(-3, drives.axis[2].homing_method);
    TEST_ASSERT_EQUAL_UINT32(10000, drives.axis[1].window_counts);
    TEST_ASSERT_EQUAL_UINT32(10000, drives.axis[1].homing_speed[0]);
    TEST_ASSERT_EQUAL_UINT32(3, drives.axis[5].identity[2]);
    TEST_ASSERT_EQUAL_UINT32(4294967295, drives.axis[5].identity[3]);
    TEST_ASSERT_EQUAL_INT32(-5000, drives.axis[0].limit_counts[0]);
    TEST_ASSERT_TRUE(drives.axis[1].has_limits && drives.axis[1].limit_counts[1] == 500 + 5000); /* it runs backwards */
    TEST_ASSERT_EQUAL(CIA402_MODE_IP, drives.mode);
    TEST_ASSERT_TRUE(drives.is_support_checked);
    put("[cia402]", "check_supported = no");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    TEST_ASSERT_FALSE(drives.is_support_checked);
    TEST_ASSERT_EQUAL_UINT8(0, drives.telemetry);
    put("[cia402]", "tell_following_error = yes");
    put("[cia402]", "tell_inputs = yes");
    put("[cia402]", "tell_every = 7");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL_UINT8(DRIVE_HAS_LAG | DRIVE_HAS_INPUTS, drives.telemetry);
    TEST_ASSERT_EQUAL_UINT8(7, drives.telemetry_every);
    TEST_ASSERT_EQUAL_INT16(3, drives.abort_option);
}

/* --- Start-up lists --- */

static void test_load_startup_list_reaches_every_drive_in_its_order(void)
{
    cia402_config_t drives;
    strcat(m_text, "\n[cia402-startup]\n0x2030:01 = 50 u16\n0x2031:0x10 = -2 i32 unchecked last   ; why\n"
                   "0x1008:0 is 0x6F4D u32 if-there\n0x2030:01 = 0xFFFF u16\n");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    for (unsigned k = 0; k < 6; k++) {
        const cia402_item_t *item = drives.axis[k].item;
        TEST_ASSERT_EQUAL_UINT8(4, drives.axis[k].items);
        TEST_ASSERT_TRUE(item[0].index == 0x2030 && item[0].sub == 1 && item[0].bytes == 2 && item[0].value == 50);
        TEST_ASSERT_TRUE(item[0].is_written && item[0].is_checked && !item[0].is_last && !item[0].is_optional);
        TEST_ASSERT_TRUE(item[1].sub == 16 && item[1].value == 0xFFFFFFFE && !item[1].is_checked && item[1].is_last);
        TEST_ASSERT_TRUE(item[2].index == 0x1008 && !item[2].is_written && item[2].is_optional);
        TEST_ASSERT_EQUAL_HEX32(0xFFFF, item[3].value);
    }
}

static void test_load_startup_list_of_a_drive_reaches_it_alone(void)
{
    cia402_config_t drives;
    strcat(m_text, "\n[cia402-startup]\n0x2030:01 = 50 u16\n0x2031:00 = 3 u8\n"
                   "[cia402-startup-2]\n0x2030:01 = 60 u16\n0x2030:02 = 1 u8\n[cia402-startup-6]\n0x2040:00 is 1 u8\n");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    for (unsigned k = 0; k < 6; k++) {
        TEST_ASSERT_EQUAL_UINT8(k == 1 || k == 5 ? 3 : 2, drives.axis[k].items);
    }
    const cia402_item_t *own = drives.axis[1].item;
    TEST_ASSERT_TRUE(own[0].index == 0x2031 && own[1].index == 0x2030 && own[1].value == 60 && own[2].sub == 2);
    TEST_ASSERT_TRUE(drives.axis[0].item[0].value == 50 && drives.axis[5].item[2].index == 0x2040);
}

/* Sub-indices are hexadecimal, as indices are, and are written back so. */
static void test_load_startup_sub_indices_have_one_base(void)
{
    cia402_config_t drives;
    char text[200];
    strcat(m_text,
           "\n[cia402-startup]\n0x2030:9 = 1 u8\n0x2030:0A = 1 u8\n0x2030:0x10 = 1 u8\n0x2030:FF = 1 u8\n0x2030:1f = 1 u8\n");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    static const uint8_t k_subs[] = {9, 10, 16, 255, 31};
    for (unsigned i = 0; i < 5; i++) {
        config_text_t written;
        config_text_clear(&written);
        TEST_ASSERT_EQUAL_UINT8(k_subs[i], drives.axis[0].item[i].sub);
        config_startup_format(&drives.axis[0].item[i], &written);
        snprintf(text, sizeof text, k_subs[i] < 10 ? "0x2030:%02X = 0x1 u8" : "0x2030:0x%02X = 0x1 u8", k_subs[i]);
        TEST_ASSERT_EQUAL_STRING(text, written.data);
    }
}

static void test_load_startup_lists_of_all_and_of_a_drive_may_be_full(void)
{
    cia402_config_t drives;
    for (unsigned i = 0; i < 2 * CONFIG_STARTUP_MAX; i++) {
        char line[40];
        if (i % CONFIG_STARTUP_MAX == 0) {
            strcat(m_text, i == 0 ? "\n[cia402-startup]\n" : "[cia402-startup-3]\n");
        }
        snprintf(line, sizeof line, "0x%04X:00 = 1 u8\n", 0x2100 + i);
        strcat(m_text, line);
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL_UINT8(CIA402_ITEMS_MAX, drives.axis[2].items);
    TEST_ASSERT_EQUAL_UINT8(CONFIG_STARTUP_MAX, drives.axis[3].items);
    strcat(m_text, "0x3000:00 = 1 u8\n");
    TEST_ASSERT_EQUAL_INT(1, load());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "[cia402-startup-3] \"0x3000:00 = 1 u8\" is one too many: a list has up to 32"),
                                 m_errors);
}

static void test_load_startup_list_of_a_drive_is_checked_as_that_of_all(void)
{
    strcat(m_text, "\n[cia402-startup-4]\n0x6040:00 = 15 u16\n0x605A:00 = 0 i16\n");
    TEST_ASSERT_EQUAL_INT(2, load());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "[cia402-startup-4] 0x6040:00"), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "[cia402-startup-4] 0x605A:00: heaved sets it itself"), m_errors);
}

static void refuse_item(const char *line, const char *why)
{
    char place[200];
    unsigned number = 1;
    setUp();
    strcat(m_text, "\n[cia402-startup]\n0x2040:00 = 1 u8\n");
    for (const char *c = m_text; *c != '\0'; c++) {
        number += *c == '\n';
    }
    strcat(m_text, line);
    strcat(m_text, "\n");
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load(), m_errors);
    sprintf(place, "%s:%u: [cia402-startup] \"", FILE_NAME, number);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, place), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, why), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "; allowed: 0x2030:01 = 50 u16"), m_errors);
}

static void test_load_startup_item_that_cannot_be_is_refused_at_its_line(void)
{
    refuse_item("0x2030 = 50 u16", "has no sub-index");
    refuse_item("2030:01 = 50 u16", "has no object such as");
    refuse_item("0x12030:01 = 50 u16", "has no object such as");
    refuse_item("0x2030:256 = 50 u16", "has no sub-index from 00 to FF");
    refuse_item("0x2030:0x100 = 50 u16", "has no sub-index from 00 to FF");
    refuse_item("0x2030: = 50 u16", "has no sub-index from 00 to FF");
    refuse_item("0x2030:10 = 50 u16", "has a sub-index that may be meant decimal");
    refuse_item("0x2030:99 = 50 u16", "has a sub-index that may be meant decimal");
    refuse_item("0x2030:01 = 50", "is no object with value and type");
    refuse_item("0x2030:01 == 50 u16", "has no type that there is");
    refuse_item("0x2030:01 = 65536 u16", "has a value that its type does not hold");
    refuse_item("0x2030:01 = -1 u16", "has a value that its type does not hold");
    refuse_item("0x2030:01 = 1.5 u16", "has a value that its type does not hold");
    refuse_item("0x2030:01 = 1 u24", "has no type that there is");
    refuse_item("0x2030:01 = 1 u8 later", "ends with a word that does not belong there");
    refuse_item("0x2030:01 = 1 u8 last last", "ends with a word that does not belong there");
    refuse_item("0x2030:01 is 1 u8 unchecked", "ends with a word that does not belong there");
    refuse_item("0x2030:01 = 1 u8 last if-there unchecked more", "is no object with value and type");
}

/* What heaved writes is not for a list; what it would write with other keys is. */
static void test_load_startup_item_that_heaved_sets_itself_is_refused_at_its_line(void)
{
    static const char *const k_own[] = {"0x605A:00 = 0 i16", "0x1800:01 = 0x80000181 u32 last", "0x6085:00 = 1 u32"};
    static const char *const k_free[] = {"0x6098:00 = 1 i8", "0x605A:00 is 2 i16", "0x60C0:00 = 0 i16"};
    char place[200];
    for (unsigned i = 0; i < 3; i++) {
        setUp();
        strcat(m_text, "\n[cia402-startup]\n0x2040:00 = 1 u8\n");
        strcat(m_text, k_own[i]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, load(), k_own[i]);
        unsigned line = 1;
        for (const char *c = m_text; *c != '\0'; c++) {
            line += *c == '\n';
        }
        sprintf(place, "%s:%u: [cia402-startup] %.9s: heaved sets it itself", FILE_NAME, line, k_own[i]);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, place), m_errors);
        setUp();
        strcat(m_text, "\n[cia402-startup]\n");
        strcat(m_text, k_free[i]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    }
    setUp();
    put("[cia402]", "quick_stop_mm_s2 = 0");
    strcat(m_text, "\n[cia402-startup]\n0x6085:00 = 1 u32\n");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
}

/* What gives torque, moves or changes the bus; where it is only looked at it may be in a list. */
static void test_load_startup_item_that_moves_or_changes_the_bus_is_refused_at_its_line(void)
{
    static const struct {
        const char *item; /* without its sign */
        const char *rest;
        const char *why;
        unsigned vendor;
    } k_items[] = {
        {"0x6040:00", "15 u16 unchecked last", "torque or move it", 0},
        {"0x6840:00", "15 u16", "torque or move it", 0}, /* of the second axis of a node */
        {"0x607A:00", "100000 i32 if-there", "torque or move it", 0},
        {"0x60C1:01", "1 i32", "torque or move it", 0},
        {"0x60FF:00", "1 i32", "torque or move it", 0},
        {"0x6071:00", "1 i16", "torque or move it", 0},
        {"0x6042:00", "1 i16", "torque or move it", 0},
        {"0x60B0:00", "1 i32", "torque or move it", 0},
        {"0x60FE:01", "1 u32", "open its brake", 0},
        {"0x1005:00", "0x40000080 u32", "changes the bus", 0},
        {"0x1014:00", "0x81 u32", "changes the bus", 0},
        {"0x1200:01", "0x601 u32", "changes the bus", 0},
        {"0x1280:03", "1 u8", "changes the bus", 0},
        {"0x1404:01", "0x300 u32", "belongs to the PDOs", 0},
        {"0x1803:02", "255 u8", "belongs to the PDOs", 0},
        {"0x1A05:01", "0x60640020 u32", "belongs to the PDOs", 0},
        {"0x1F80:00", "8 u32", "start without heaved", 0},
        {"0x1F51:01", "1 u8", "drive's program", 0},
        {"0x100B:00", "3 u32", "node id or the bit rate", 0},
        {"0x2000:00", "2 u8", "node id or the bit rate", 0xFB},
        {"0x2009:00", "2 u32", "node id or the bit rate", 0x26C},
        {"0x1010:01", "0x65766173 u32", "which wears it", 0},
        {"0x1011:01", "0x64616F6C u32", "which wears it", 0},
    };
    static const char *const k_free[] = {"0x1804:01 = 0x80000480 u32 if-there", "0x2000:00 = 2 u8", "0x6072:00 = 900 u16"};
    char line[80], place[120];
    for (size_t i = 0; i < sizeof k_items / sizeof k_items[0]; i++) {
        for (int is_looked_at = 0; is_looked_at < 2; is_looked_at++) {
            setUp();
            if (k_items[i].vendor != 0) {
                sprintf(line, "vendor_id = %u", k_items[i].vendor);
                put("[cia402]", line);
            }
            const int items = is_looked_at == 0
                                  ? (int)strlen(k_items[i].rest)
                                  : (int)strcspn(strchr(k_items[i].rest, ' ') + 1, " ") + (int)strcspn(k_items[i].rest, " ") + 1;
            sprintf(line, "\n[cia402-startup]\n%s %s %.*s\n", k_items[i].item, is_looked_at == 0 ? "=" : "is", items,
                    k_items[i].rest);
            strcat(m_text, line);
            TEST_ASSERT_EQUAL_INT_MESSAGE(is_looked_at == 0 ? 1 : 0, load(), is_looked_at == 0 ? line : m_errors);
            sprintf(place, "[cia402-startup] %s", k_items[i].item);
            TEST_ASSERT_TRUE_MESSAGE(
                is_looked_at == 1 || (strstr(m_errors, place) != NULL && strstr(m_errors, k_items[i].why) != NULL), m_errors);
        }
    }
    for (size_t i = 0; i < sizeof k_free / sizeof k_free[0]; i++) {
        setUp();
        sprintf(line, "\n[cia402-startup]\n%s\n", k_free[i]);
        strcat(m_text, line);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    }
}

/* A drive family's file, on simulated drives that have its objects: all come up, and hold what the list says. */
static void test_preset_of_a_drive_family_sets_its_drives_up(void)
{
    static const char *const k_presets[] = {"/cia402/maxon-epos4.ini", "/cia402/nanotec-c5-n5-pd4.ini"};
    static sim_can_bus_t bus;
    static sim_can_t node;
    static canopen_drives_t twin;
    static cia402_t driver;
    for (unsigned i = 0; i < 2; i++) {
        char path[300];
        cia402_config_t drives;
        hal_can_filter_t filter[CIA402_FILTERS_MAX];
        drive_feedback_t feedback[DRIVES_MAX] = {{0}};
        const q32_t setpoint_q32[DRIVES_MAX] = {0};
        sprintf(path, "%s%s", HEAVE_CONFIG_DIR, k_presets[i]);
        TEST_ASSERT_EQUAL_INT(0, config_load(path, &m_config, stderr));
        config_cia402(&m_config, &drives);
        TEST_ASSERT_TRUE(drives.axis[0].items >= 3);
        sim_can_bus_init(&bus, 0, NULL, 0);
        canopen_drives_open(&twin, &bus);
        for (unsigned k = 0; k < drives.axes; k++) {
            canopen_drives_object(&twin, k, 0x1018, 1)->value = canopen_drives_object(&twin, k, 0x1018, 1)->fallback = 0xFB;
            for (unsigned at = 0; at < drives.axis[k].items; at++) {
                const cia402_item_t *item = &drives.axis[k].item[at];
                if (canopen_drives_object(&twin, k, item->index, item->sub) == NULL) {
                    objects_add(&twin.drive[k].node.drive.od, (object_t){.index = item->index,
                                                                         .sub = item->sub,
                                                                         .bytes = item->bytes,
                                                                         .fallback = item->is_written ? 0 : item->value});
                }
            }
        }
        TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, filter, cia402_filters(&drives, filter)));
        TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &drives, sim_can_hal(&node)));
        for (uint64_t now_us = 5000000; now_us < 10000000; now_us += 1000) {
            canopen_drives_step(&twin, now_us);
            (void)!drives_poll(cia402_hal(&driver), now_us, feedback);
            (void)!drives_send(cia402_hal(&driver), now_us, setpoint_q32);
        }
        for (unsigned k = 0; k < drives.axes; k++) {
            TEST_ASSERT_EQUAL_MESSAGE(DRIVE_DISABLED, feedback[k].state, k_presets[i]);
            for (unsigned at = 0; at < drives.axis[k].items; at++) {
                const cia402_item_t *item = &drives.axis[k].item[at];
                TEST_ASSERT_EQUAL_HEX32(item->value, canopen_drives_object(&twin, k, item->index, item->sub)->value);
            }
        }
    }
}

static void test_load_startup_list_of_more_than_32_is_refused(void)
{
    strcat(m_text, "\n[cia402-startup]\n");
    for (unsigned i = 0; i < 33; i++) {
        strcat(m_text, "0x2030:01 = 50 u16\n");
    }
    TEST_ASSERT_EQUAL_INT(1, load());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "is one too many: a list has up to 32"), m_errors);
}

/* A list counts for the hash that is approved, its dump loads to the same, and in operation it stays. */
static void test_load_startup_list_is_dumped_hashed_and_needs_a_restart(void)
{
    static config_t running;
    static char text[CONFIG_TEXT_BYTES];
    char before[CONFIG_HASH_MAX];
    TEST_ASSERT_EQUAL_INT(0, load());
    strcpy(before, m_config.hash);
    strcat(m_text, "\n[cia402-startup]\n0x2030:01 = -50 i16 unchecked last\n0x2032:0 is 3 u8\n");
    TEST_ASSERT_EQUAL_INT(0, load());
    TEST_ASSERT_TRUE(strcmp(before, m_config.hash) != 0);
    running = m_config;
    FILE *file = fopen(FILE_NAME, "wb");
    config_dump(&m_config, file);
    fclose(file);
    memset(&m_config, 0, sizeof m_config);
    FILE *report = tmpfile();
    TEST_ASSERT_EQUAL_INT(0, config_load(FILE_NAME, &m_config, report));
    TEST_ASSERT_EQUAL_STRING(running.hash, m_config.hash);
    TEST_ASSERT_EQUAL_UINT8(2, m_config.cia402.startup.count);
    file = fopen(FILE_NAME, "wb");
    fputs(m_text, file);
    fputs("0x2033:0 = 1 u8\n", file);
    fclose(file);
    rewind(report);
    TEST_ASSERT_EQUAL_INT(0, config_reload(FILE_NAME, text, config_read(FILE_NAME, text), &running, report));
    rewind(report);
    m_errors[fread(m_errors, 1, sizeof m_errors - 1, report)] = '\0';
    fclose(report);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "[cia402-startup] another list needs a restart"), m_errors);
    TEST_ASSERT_EQUAL_UINT8(2, running.cia402.startup.count);
}

static void test_load_axes_of_nodes_and_modes_reach_their_drives(void)
{
    cia402_config_t drives;
    config_text_t text;
    put("[cia402]", "nodes = 1.1, 1.2, 7.2, 7.1, 3, 4");
    put("[cia402]", "mode = csp, ip, csp, csp, csp, csp");
    put("[cia402]", "pdo_step = 4");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL_UINT8(1, drives.axis[1].node);
    TEST_ASSERT_EQUAL_UINT8(1, drives.axis[1].channel);
    TEST_ASSERT_EQUAL_UINT8(7, drives.axis[2].node);
    TEST_ASSERT_EQUAL_UINT8(1, drives.axis[2].channel);
    TEST_ASSERT_EQUAL_UINT8(0, drives.axis[3].channel);
    TEST_ASSERT_EQUAL_UINT8(0, drives.axis[5].channel);
    TEST_ASSERT_EQUAL_UINT8(CIA402_MODE_IP, drives.axis[1].mode);
    TEST_ASSERT_EQUAL_UINT8(CIA402_MODE_CSP, drives.axis[5].mode);
    TEST_ASSERT_EQUAL_UINT8(4, drives.pdo_step);
    config_text_clear(&text);
    config_value_format(&config_keys[config_key_find("cia402", "nodes")], &m_config, &text);
    TEST_ASSERT_EQUAL_STRING("0x1, 0x1.2, 0x7.2, 0x7, 0x3, 0x4", text.data);
    config_text_clear(&text);
    config_value_format(&config_keys[config_key_find("cia402", "mode")], &m_config, &text);
    TEST_ASSERT_EQUAL_STRING("csp, ip, csp, csp, csp, csp", text.data);
}

static void test_load_maps_reach_the_driver_and_come_back_as_text(void)
{
    static const char k_text[] = "2: 0x6040:00/16 0x6060:00/8, 3: 0x607A:00/32";
    cia402_config_t drives;
    config_text_t text;
    put("[cia402]", "command_map = 2: 0x6040/16 0x6060/8, 3:0x607A/32");
    put("[cia402]", "answer_map = 1: 0x6041/16, 3: 0x6041/16 0x6064/32");
    put("[cia402]", "map_written = no");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_cia402(&m_config, &drives);
    TEST_ASSERT_TRUE(drives.are_maps_fixed);
    TEST_ASSERT_EQUAL_UINT8(2, drives.commands.count);
    TEST_ASSERT_EQUAL_UINT16(3, drives.commands.map[1].number);
    TEST_ASSERT_EQUAL_HEX32(0x607A0020, drives.commands.map[1].entry[0]);
    TEST_ASSERT_EQUAL_HEX32(0x60640020, drives.answers.map[1].entry[1]);
    config_text_clear(&text);
    config_value_format(&config_keys[config_key_find("cia402", "command_map")], &m_config, &text);
    TEST_ASSERT_EQUAL_STRING(k_text, text.data);
}

static void test_load_what_contradicts_itself_is_refused_at_its_line(void)
{
    refuse("nodes = 1.1, 1.1, 2, 3, 4, 5", "1 of drive 2 is that of drive 1 already");
    refuse("nodes = 1.1, 1.3, 2, 3, 4, 5", "1.3 of drive 2 is there without 1.2");
    refuse("nodes = 1.5, 1, 2, 3, 4, 5", "\"1.5\" is no node");
    refuse("nodes = 1.0, 1, 2, 3, 4, 5", "\"1.0\" is no node");
    refuse("nodes = 1, 2, 3, 4, 5, 6, 7, 8", "is one more than drives there can be");
    refuse("mode = csp, ip", "has 2 values");
    refuse("mode = csv", "\"csv\" is not allowed; allowed: csp, ip or pp; or one for each drive");
    refuse("command_map = 1: 0x6040/16", "the PDOs do not fit: the commands of each axis need 6040h");
    refuse("command_map = 0x6040/16", "does not begin with the number of a PDO and a colon");
    refuse("command_map = 1:", "has no object");
    refuse("command_map = 1: 0x6040/17 0x607A/32", "has something that is no object with whole bytes");
    refuse("command_map = 1: 0x6040/16 0x607A/32 0x60FF/32", "has more than 8 bytes");
    refuse("command_map = 1: 0x6040/16, 2: 0x607A/32, 3: 0x60FF/32, 4: 0x6071/16", "is one PDO more than there can be");
    refuse("answer_map = 1: 0x6041/16", "the PDOs do not fit: the answers of each axis need 6041h");
    refuse("pdo_step = 65", "a whole number from 1 to 64");
    refuse("answer_every = 11", "a whole number from 1 to 10");
    refuse("tell_every = 0", "a whole number from 1 to 240");
    refuse("nodes = 0", "0 of drive 1 is no node id; allowed: 1 to 127");
    refuse("nodes = 1, 2, 3, 4, 5, 128", "128 of drive 6 is no node id");
    refuse("nodes = 1, 2, 3, 4, 5, 2", "2 of drive 6 is that of drive 2 already");
    refuse("nodes = 122", "127 of drive 6 is gateway_node");
    refuse("nodes = 1, 2", "has 2 values");
    refuse("nodes = -1",
           "\"-1\" is no node; allowed: a node id from 1 to 127, such as 5, or with the axis in the node, such as 5.2");
    refuse("serial_numbers = 1, 2", "has 2 values");
    refuse("serial_numbers = 1, 2, 3, 4, 5, 4294967296", "is no such number");
    refuse("nodes = none", "missing for driver = cia402");
    refuse("counts_per_mm = none", "missing for driver = cia402");
    refuse("counts_per_mm = 1, 2", "has 2 values");
    refuse("counts_per_mm = 5400000", "400 mm of drive 1 are 2160000000 counts");
    refuse("counts_per_mm = 5000000, 1, 1, 1, 1, -5400000", "of drive 6 are -2160000000 counts");
    refuse("zero_counts = 1, 2, 3", "has 3 values");
    refuse("homing_method = 128", "128 is no method; allowed: -128 to 127");
    refuse("period_us = 4500", "is no multiple of cycle_us");
    refuse("period_us = 1000", "the bus would be loaded by");
    refuse("heartbeat_timeout_ms = 99", "allowed: at least 100 ms");
    refuse("sync_counter = 1", "allowed: 0, or 2 to 240");
    refuse("accept_without = 6007", "stop_confirmed = yes where somebody has tried it");
    refuse("accept_without = 6040", "allowed: 1016, 1017, 100C, 100D, 6007, 605A, 605E or 6065; several with commas");
    refuse("rpdo_deadline_ms = 7", "allowed: 0, or at least 16 ms");
    refuse("csp_control_bits = 08", "allowed: 0, 10, 20, 40 and their sums");
    refuse("csp_control_bits = 80", "hexadecimal 0 to 70");
    refuse("following_error_mm = 5.9", "at least 6.00");
}

static void test_load_period_that_60c2h_cannot_hold_is_refused(void)
{
    put("[platform]", "cycle_us = 650");
    const unsigned line = put("[cia402]", "period_us = 3250");
    char place[160];
    sprintf(place, "%s:%u: [cia402] period_us: 60C2h cannot hold it", FILE_NAME, line);
    TEST_ASSERT_TRUE(load() > 0);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, place), m_errors);
}

static void test_load_bus_too_slow_for_any_period_is_told_to_be_faster(void)
{
    put("[can]", "bitrate_bps = 10000");
    TEST_ASSERT_TRUE(load() > 0);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "by too much with any period; allowed: with a higher bitrate_bps"), m_errors);
}

static void test_load_section_not_in_use_may_be_anything(void)
{
    put("[cia402]", "nodes = 1, 1");
    put("[drives]", "driver = sim");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
}

/* The figures of the standard's worst-case table: SYNC 55 bits, 6 commands of 115, 6 answers of 125, per 4 ms; and what is rare.
 */
static void test_describe_bus_load_is_that_of_the_frames(void)
{
    config_bus_t bus;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    config_bus_describe(&m_config, &bus);
    const double period_bits = 55 + 6 * 115 + 6 * 125 + 7 * 65 / 12.0 + 2 * 135 / 5.0;
    TEST_ASSERT_DOUBLE_WITHIN(2e-5, period_bits / 4000.0, config_bus_load_ppm(&bus) / 1e6);
}

/* As data sheets and other masters have them. */
static void test_identity_is_read_in_hexadecimal_too(void)
{
    (void)put("[cia402]", "vendor_id = 0xBEEF");
    (void)put("[cia402]", "product_code = 0XffffffFF");
    (void)put("[cia402]", "revision_number = 65536");
    TEST_ASSERT_EQUAL_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_EQUAL_HEX32(0xBEEF, m_config.cia402.vendor_id);
    TEST_ASSERT_EQUAL_HEX32(0xFFFFFFFF, m_config.cia402.product_code);
    TEST_ASSERT_EQUAL_HEX32(0x10000, m_config.cia402.revision_number);
    static const char *const k_wrong[] = {"vendor_id = 0x", "vendor_id = 0xG", "vendor_id = 0x100000000", "gateway_node = 0x7F"};
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        setUp();
        (void)put("[cia402]", k_wrong[i]);
        TEST_ASSERT_EQUAL_MESSAGE(1, load(), k_wrong[i]);
    }
}

/* What --check offers instead has to be taken. */
static void test_period_of_no_use_is_refused_with_ones_that_the_bus_carries(void)
{
    (void)put("[cia402]", "period_us = 1900");
    TEST_ASSERT_EQUAL(1, load());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "is no multiple of cycle_us; allowed: for instance 2000 or 3000 us"), m_errors);
    (void)put("[cia402]", "period_us = 900");
    TEST_ASSERT_EQUAL(1, load());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors,
                                        "is no multiple of cycle_us, and would load the bus by 168 % at worst; allowed: "
                                        "for instance 2000 or 3000 us"),
                                 m_errors);
    (void)put("[cia402]", "period_us = 2000");
    TEST_ASSERT_EQUAL_MESSAGE(0, load(), m_errors);
}

static void test_profile_position_needs_a_window_for_its_lag(void)
{
    (void)put("[cia402]", "mode = pp");
    TEST_ASSERT_EQUAL_MESSAGE(0, load(), m_errors);
    (void)put("[cylinders]", "accel_mm_s2 = 3000");
    (void)put("[engage]", "speed_mm_s = 200"); /* 200^2 / 6000 mm, and 32 ms of it */
    TEST_ASSERT_EQUAL(1, load());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors,
                                        "[cia402] following_error_mm: less than a drive in mode pp is behind at [engage] "
                                        "speed_mm_s; allowed: at least 13.067 mm, or slower"),
                                 m_errors);
    (void)put("[cia402]", "following_error_mm = 13.1");
    TEST_ASSERT_EQUAL_MESSAGE(0, load(), m_errors);
    (void)put("[cia402]", "mode = csp");
    (void)put("[cia402]", "following_error_mm = 10");
    TEST_ASSERT_EQUAL_MESSAGE(0, load(), m_errors);
}

/* ---- From the screw ---- */

static void expect_ratio(unsigned i, int32_t num, int32_t den)
{
    const counts_scale_t scale = config_cia402_scale(&m_config, i);
    TEST_ASSERT_EQUAL_INT64((int64_t)num * scale.den, (int64_t)scale.num * den);
}

/* Puts lines into [drives], in place of counts_per_mm; returns the number of the first one. */
static unsigned put_train(const char *lines)
{
    setUp();
    (void)put("[cia402]", "counts_per_mm = none");
    return put("[drives]", lines);
}

static void test_lead_and_counts_per_turn_stand_in_place_of_counts_per_mm(void)
{
    (void)put_train("lead_mm = 10\ncounts_per_turn = 131072");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_EQUAL_INT(131072, m_config.cia402.counts_per_mm.num[0] * 10 / m_config.cia402.counts_per_mm.den[0]);
    (void)put_train("lead_mm = 5.08\ncounts_per_turn = 10000\ngear = 5/2");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    for (unsigned i = 0; i < 6; i++)
        expect_ratio(i, 2500000, 508);
    (void)put_train("lead_mm = 10, -10, 5, 20, 16/3, 10\ncounts_per_turn = 131072");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    expect_ratio(1, -131072, 10);
    expect_ratio(3, 131072, 20);
    expect_ratio(4, 131072 * 3, 16);
}

/* What the file says twice as a dump, it would say twice when it is read again. */
static void test_lead_is_dumped_as_the_counts_that_follow(void)
{
    static char text[300000];
    (void)put_train("lead_mm = 10\ncounts_per_turn = 131072\ngear = 3");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    config_dump(&m_config, file);
    rewind(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    TEST_ASSERT_NOT_NULL(strstr(text, "\ncounts_per_mm = 196608/5\n"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\nlead_mm = none\n"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\ncounts_per_turn = 131072\n"));
}

static void test_lead_that_is_not_the_whole_story_is_one_error(void)
{
    static const char *const k_rows[][2] = {
        {"lead_mm = 10", "counts_per_turn: missing beside lead_mm; allowed: "},
        {"lead_mm = 10, 10\ncounts_per_turn = 1000", "lead_mm: has 2 values; allowed: one, or one for each of the 6 drives"},
        {"lead_mm = 10\ncounts_per_turn = 1000\ngear = 1, 2", "gear: has 2 values; allowed: one, or one for each"},
        {"gear = 2", "gear: means nothing without lead_mm; allowed: "},
        {"lead_mm = 5/10000\ncounts_per_turn = none", "counts_per_turn: missing beside lead_mm; allowed: "},
        {"lead_mm = 1/2147483647\ncounts_per_turn = 2147483646",
         "lead_mm: counts_per_turn * gear / lead of drive 1 is no ratio of numbers of 32 bits; allowed: "},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        (void)put_train(k_rows[i][0]);
        const int errors = load();
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, k_rows[i][1]), m_errors);
        TEST_ASSERT_EQUAL_INT_MESSAGE(i == 3 ? 2 : 1, errors, m_errors); /* gear alone: counts_per_mm is missing too */
    }
}

static void test_lead_beside_counts_per_mm_is_an_error_that_names_the_other_line(void)
{
    char expected[160];
    setUp();
    (void)put("[drives]", "counts_per_turn = 131072\nlead_mm = 10");
    const unsigned line = put("[cia402]", "counts_per_mm = 131072/10");
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load(), m_errors);
    snprintf(expected, sizeof expected, "[drives] lead_mm: counts_per_mm of [cia402] gives the scaling already, at line %u; ",
             line);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, expected), m_errors);
}

static const char *report(void)
{
    static char text[40000];
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    (void)report_write(&m_config, 1, file);
    rewind(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    return text;
}

/* Older files accept whatever is missing; newer ones name it, and that somebody has tried what then happens. */
static void test_check_watchdogs_that_may_be_missing(void)
{
    cia402_config_t drives;
    (void)put("[cia402]", "allow_no_watchdog = yes");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(report(), "warning: [cia402] allow_no_watchdog = yes accepts drives without any watchdog"), report());
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL_HEX8(CIA402_GUARDS_ALL, drives.accepted_without);
    setUp();
    (void)put("[cia402]", "accept_without = 6007, 605E\nstop_confirmed = yes\nrpdo_deadline_ms = 20");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_NULL_MESSAGE(strstr(report(), "watchdog"), report());
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL_HEX8(1u << CIA402_GUARD_CONNECTION | 1u << CIA402_GUARD_FAULT, drives.accepted_without);
    TEST_ASSERT_EQUAL_UINT16(20, drives.rpdo_deadline_ms);
}

static void test_check_report_says_what_the_scaling_comes_to(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(report(), "stroke of 400 mm = 5,242,880 counts (0 to 5,242,880), 500 mm/s = 6,553,600 counts/s\n"), report());
    (void)put_train("lead_mm = 5\ncounts_per_turn = 10000");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(report(), "stroke of 400 mm = 800,000 counts (0 to 800,000), 500 mm/s = 6000 rpm\n"),
                                 report());
    (void)put_train("lead_mm = 5, 5, -5, 5, 5, 5\ncounts_per_turn = 10000");
    (void)put("[cia402]", "zero_counts = 100");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(), m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(report(), "  drive 3: stroke of 400 mm = -800,000 counts (100 to -799,900), 500 mm/s = -6000 rpm\n"), report());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_load_preset_gives_what_the_driver_takes);
    RUN_TEST(test_load_rare_answers_need_a_wider_window);
    RUN_TEST(test_load_telemetry_is_in_the_load);
    RUN_TEST(test_load_lists_and_signs_reach_their_drives);
    RUN_TEST(test_load_startup_list_reaches_every_drive_in_its_order);
    RUN_TEST(test_load_startup_list_of_a_drive_reaches_it_alone);
    RUN_TEST(test_load_startup_sub_indices_have_one_base);
    RUN_TEST(test_load_startup_lists_of_all_and_of_a_drive_may_be_full);
    RUN_TEST(test_load_startup_list_of_a_drive_is_checked_as_that_of_all);
    RUN_TEST(test_load_startup_item_that_cannot_be_is_refused_at_its_line);
    RUN_TEST(test_load_startup_item_that_heaved_sets_itself_is_refused_at_its_line);
    RUN_TEST(test_load_startup_item_that_moves_or_changes_the_bus_is_refused_at_its_line);
    RUN_TEST(test_preset_of_a_drive_family_sets_its_drives_up);
    RUN_TEST(test_load_startup_list_of_more_than_32_is_refused);
    RUN_TEST(test_load_startup_list_is_dumped_hashed_and_needs_a_restart);
    RUN_TEST(test_load_what_contradicts_itself_is_refused_at_its_line);
    RUN_TEST(test_load_period_that_60c2h_cannot_hold_is_refused);
    RUN_TEST(test_load_bus_too_slow_for_any_period_is_told_to_be_faster);
    RUN_TEST(test_load_section_not_in_use_may_be_anything);
    RUN_TEST(test_describe_bus_load_is_that_of_the_frames);
    RUN_TEST(test_identity_is_read_in_hexadecimal_too);
    RUN_TEST(test_period_of_no_use_is_refused_with_ones_that_the_bus_carries);
    RUN_TEST(test_profile_position_needs_a_window_for_its_lag);
    RUN_TEST(test_lead_and_counts_per_turn_stand_in_place_of_counts_per_mm);
    RUN_TEST(test_lead_is_dumped_as_the_counts_that_follow);
    RUN_TEST(test_load_axes_of_nodes_and_modes_reach_their_drives);
    RUN_TEST(test_load_maps_reach_the_driver_and_come_back_as_text);
    RUN_TEST(test_lead_that_is_not_the_whole_story_is_one_error);
    RUN_TEST(test_lead_beside_counts_per_mm_is_an_error_that_names_the_other_line);
    RUN_TEST(test_check_watchdogs_that_may_be_missing);
    RUN_TEST(test_check_report_says_what_the_scaling_comes_to);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_config_canraw.c - [can-raw]: the preset as bytes on a bus, every message of what contradicts itself, frames to text and
 * back.
 */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <string.h>

#include "canraw_drives.h"
#include "canraw_maps.h"
#include "platform/bus.h"
#include "platform/canraw_section.h"
#include "config/config.h"
#include "platform/load.h"
#include "config/value.h"
#include "unity.h"

#define FILE_NAME "test_config_canraw.tmp.ini"
#define PRESET    HEAVE_CONFIG_DIR "/can-raw-hexapod.ini"

static config_t m_config;
static char m_text[20000];
static char m_errors[20000];

void setUp(void)
{
    memset(&m_config, 0, sizeof m_config);
    m_errors[0] = '\0';
}

void tearDown(void)
{
    remove(FILE_NAME);
}

static int load(const char *path)
{
    FILE *errors = tmpfile();
    TEST_ASSERT_NOT_NULL(errors);
    const int count = config_load(path, &m_config, errors);
    rewind(errors);
    m_errors[fread(m_errors, 1, sizeof m_errors - 1, errors)] = '\0';
    fclose(errors);
    return count;
}

static void read_preset(void)
{
    FILE *file = fopen(PRESET, "rb");
    TEST_ASSERT_NOT_NULL(file);
    m_text[fread(m_text, 1, sizeof m_text - 1, file)] = '\0';
    fclose(file);
}

/* Line number of `key = ` in [can-raw] of m_text, 0 where it is not there. */
static unsigned line_of(const char *key)
{
    unsigned line = 1, found = 0;
    bool is_in = false;
    for (const char *at = m_text; *at != '\0'; at++) {
        if (at == m_text || at[-1] == '\n') {
            is_in = at[0] == '[' ? strncmp(at, "[can-raw]", 9) == 0 : is_in;
            found = is_in && strncmp(at, key, strlen(key)) == 0 && at[strlen(key)] == ' ' ? line : found;
        }
        line += *at == '\n';
    }
    return found;
}

/* Replaces the line of a key of [can-raw], or adds one behind the header. */
static void put_line(const char *key, const char *line)
{
    static char rest[sizeof m_text];
    char *at = strstr(m_text, "[can-raw]\n") + 10;
    char *end = at;
    for (char *search = at; line_of(key) != 0 && *search != '['; search++) {
        if (search[-1] == '\n' && strncmp(search, key, strlen(key)) == 0 && search[strlen(key)] == ' ') {
            at = search;
            end = strchr(search, '\n') + 1;
            break;
        }
    }
    strcpy(rest, end);
    sprintf(at, "%s\n%s", line, rest);
}

static int load_text(void)
{
    FILE *file = fopen(FILE_NAME, "wb");
    TEST_ASSERT_NOT_NULL(file);
    fputs(m_text, file);
    fclose(file);
    return load(FILE_NAME);
}

static void load_preset(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(PRESET), m_errors);
}

/* ---- The preset ---- */

static void test_preset_frames_byte_for_byte(void)
{
    static const uint8_t k_setpoint[8] = {0x01, 0x05, 0xC0, 0x27, 0x09, 0x00, 0xD0, 0x07}; /* 600000 pulses at 300 mm; 2000 */
    static const uint8_t k_home[8] = {0x01, 0x03, 0x01};
    static const uint8_t k_position[8] = {0x00, 0x15};
    static const uint8_t k_homing[8] = {0x00, 0x12};
    uint8_t out[8];
    int64_t counts = 0;
    canraw_map_t map;
    load_preset();
    config_canraw_map(&m_config, &map);
    TEST_ASSERT_EQUAL_UINT8(6, map.axes);
    for (unsigned k = 0; k < 6; k++) {
        TEST_ASSERT_EQUAL_HEX32(0x601 + k, map.axis[k].command_id);
        TEST_ASSERT_EQUAL_HEX32(0x581 + k, map.axis[k].reply_id);
        TEST_ASSERT_EQUAL(HV_OK, counts_from_units(&map.axis[k].scale, q32_from_int(300), &counts));
    }
    const int64_t value[CANRAW_VALUES] = {counts, map.speed_least};
    TEST_ASSERT_EQUAL(HV_OK, canraw_pack(&map.setpoint, value, out));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(k_setpoint, out, 8);
    TEST_ASSERT_EQUAL_UINT8(8, map.setpoint.length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(k_home, map.command[CANRAW_HOME].data, 8);
    TEST_ASSERT_EQUAL_UINT8(8, map.command[CANRAW_HOME].length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(k_position, map.position_query.data, 8);
    TEST_ASSERT_EQUAL_UINT8(2, map.position_query.length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(k_homing, map.homing_query.data, 8);
    TEST_ASSERT_EQUAL_UINT8(2, map.homing_query.length);
    TEST_ASSERT_EQUAL_INT64(0x00012345, canraw_extract(canraw_find(&map.position_reply, CANRAW_POSITION),
                                                       (const uint8_t[8]){9, 9, 0x45, 0x23, 0x01, 0x00, 9, 9}));
}

/* Drives that know the bytes alone are enabled, homed and led along by the preset. */
static void test_preset_drives_are_enabled_homed_and_led(void)
{
    static canraw_drives_t slave;
    sim_can_bus_t bus;
    sim_can_t node;
    canraw_map_t map;
    canraw_t driver;
    drive_feedback_t feedback[DRIVES_MAX];
    q32_t setpoint_q32[DRIVES_MAX] = {0};
    load_preset();
    config_canraw_map(&m_config, &map);
    TEST_ASSERT_EQUAL(CANRAW_MASTER_STOP, map.other_master);
    TEST_ASSERT_EQUAL_UINT32(100, map.listen_ms);
    map.listen_ms = 0; /* the times below are counted from the first frame */
    sim_can_bus_init(&bus, 100, NULL, 0);
    canraw_drives_open(&slave, &bus, canraw_maps_plain());
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&driver, &map, sim_can_hal(&node)));
    const drives_t hal = canraw_hal(&driver);
    for (unsigned k = 0; k < 6; k++) {
        slave.twin[k].is_homed = false;
        canraw_drives_place(&slave, k, 100000);
    }
    for (int i = 1; i < 4000; i++) {
        canraw_drives_step(&slave, i * 1000);
        (void)!drives_poll(hal, i * 1000, feedback);
        if (i == 100) {
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[0].state);
            TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        }
        if (i == 300) {
            TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
            TEST_ASSERT_FALSE(feedback[0].is_homed);
            TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_HOME));
        }
        for (unsigned k = 0; k < 6; k++) {
            setpoint_q32[k] = i < 1000 ? feedback[k].actual_mm_q32 : setpoint_q32[k] + Q32_ONE / 20;
        }
        (void)!drives_send(hal, i * 1000, setpoint_q32);
    }
    for (unsigned k = 0; k < 6; k++) {
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[k].state);
        TEST_ASSERT_TRUE(feedback[k].is_homed);
        TEST_ASSERT_INT32_WITHIN(800, 3000 * 100, frame_drive_count(&slave.twin[k])); /* 150 mm, less what is on the way */
        TEST_ASSERT_TRUE(slave.sent[k].largest_step <= 401); /* 0.05 mm per cycle, four cycles, 2000 pulses per mm */
        TEST_ASSERT_EQUAL_UINT16(2000, slave.sent[k].speed);
    }
}

static void test_preset_bus_load_is_the_sum_of_its_frames(void)
{
    config_bus_t bus;
    load_preset();
    config_bus_describe(&m_config, &bus);
    /* six set-points per period of 4 ms, and every second one six queries of two bytes and answers of six, at 1 Mbit/s */
    TEST_ASSERT_EQUAL_UINT32((6 * 135 + 3 * 75 + 3 * 115) * 250, config_bus_load_ppm(&bus));
}

static const config_key_t *key_of(const char *name)
{
    return &config_keys[config_key_find(strcmp(name, "interface") == 0 ? "can" : "can-raw", name)];
}

static void expect_same(const char *name, const char *text)
{
    config_text_t why, out;
    unsigned count = 0;
    config_text_clear(&why);
    config_text_clear(&out);
    TEST_ASSERT_TRUE_MESSAGE(config_value_parse(key_of(name), text, &m_config, &count, &why), why.data);
    config_value_format(key_of(name), &m_config, &out);
    TEST_ASSERT_EQUAL_STRING(text, out.data);
}

/* ---- What is wrong ---- */

typedef struct {
    const char *key;
    const char *line;
    const char *message; /* its start, after [can-raw] KEY: */
} spoilt_t;

#define TWO_IN_A_FRAME                                                                                                           \
    "setpoint = 00 00 00 00 00 00 00 00 {position.1:u20le@0.0} {speed.1:u12le@2.4} {position.2:u20le@4.0} {speed.2:u12le@6.4}"

static const spoilt_t k_spoilt[] = {
    {"setpoint", "setpoint = none", "missing for driver = can-raw; allowed: "},
    {"setpoint", "setpoint = 01 {speed:u16le}", "has no {position}; allowed: with one such as {position:u32le}"},
    {"setpoint", "setpoint = 01 05 06 {position:u32le} {speed:u16le}", "\"{speed:u16le}\" goes beyond the 8 bytes of a frame; "},
    {"setpoint", "setpoint = 01 05 {position:u32le} {speed:u16le} 00", "\"00\" goes beyond the 8 bytes of a frame; allowed: "},
    {"setpoint", "setpoint = 01 {position:u32le} {position:u16le}", "\"{position:u16le}\" is there twice; allowed: "},
    {"setpoint", "setpoint = 01 {position:u40le}", "\"{position:u40le}\" has no type that there is; allowed: "},
    {"setpoint", "setpoint = 01 {position:u33le@1.0}", "\"{position:u33le@1.0}\" has no type that there is; allowed: "},
    {"setpoint", "setpoint = 01 {position:i1@0.0}", "\"{position:i1@0.0}\" has no type that there is; allowed: "},
    {"setpoint", "setpoint = 01 {position:f64le}", "\"{position:f64le}\" has no type that there is; allowed: "},
    {"setpoint", "setpoint = 01 {position:u20le}", "\"{position:u20le}\" needs a place, such as @1.4 behind its type for "},
    {"setpoint", "setpoint = 01 {position:u16}", "\"{position:u16}\" needs an order of its bytes, le or be; allowed: "},
    {"setpoint", "setpoint = 01 00 {position:u4@0.6}", "\"{position:u4@0.6}\" needs an order of its bytes, le or be; "},
    {"setpoint", "setpoint = 01 {position:u8le}", "\"{position:u8le}\" has an order of bytes, but only one byte; allowed: "},
    {"setpoint", "setpoint = 00 {position:u4@0.8}", "\"{position:u4@0.8}\" has no place that there is, such as @1.4 for byte 1"},
    {"setpoint", "setpoint = 00 {position:u4@8.0}", "\"{position:u4@8.0}\" has no place that there is, such as @1.4 for byte 1"},
    {"setpoint", "setpoint = 01 {position:u20le@1.0}", "\"{position:u20le@1.0}\" covers bytes beyond the frame; write them"},
    {"setpoint", "setpoint = 01 {position:i32le} {speed:u4@4.0}", "\"{speed:u4@4.0}\" lies on bits of another field; allowed"},
    {"setpoint", "setpoint = 01 {position:u7@0.0}", "\"{position:u7@0.0}\" lies on bits that are 1; write 0 for them; allowed"},
    {"setpoint", "setpoint = 01 {position:f32le/0}", "\"{position:f32le/0}\" has no type that there is; allowed: "},
    {"setpoint", "setpoint = 01 {position:f32le/1000001}", "\"{position:f32le/1000001}\" has no type that there is; allowed: "},
    {"homing_reply", "homing_reply = 00 12 {status:f32le}", "\"{status:f32le}\" is to be whole: a type u or i; allowed: "},
    {"enable", "enable = 01 {position:u8}", "\"{position:u8}\" is no field of this frame; allowed: "},
    {"enable", "enable = 01 {crc8}", "\"{crc8}\" has no polynomial of two digits, such as {crc8:07}, or "},
    {"enable", "enable = 01 {crc8:1}", "\"{crc8:1}\" has no polynomial of two digits, such as {crc8:07}, or "},
    {"enable", "enable = 01 {crc8:1D/F}",
     "\"{crc8:1D/F}\" has no polynomial of two digits, such as {crc8:07}, or {crc8:1D/FF/00}"},
    {"enable", "enable = 01 {crc8:1D/FF/00/00}", "\"{crc8:1D/FF/00/00}\" has no polynomial of two digits, such as {crc8:07}"},
    {"enable", "enable = 01 {crc8ff:1D/FF}", "\"{crc8ff:1D/FF}\" has no polynomial of two digits, such as {crc8:07}"},
    {"enable", "enable = 01 {sum:u8}", "\"{sum:u8}\" takes no type; allowed: "},
    {"enable", "enable = 01 {sum} {xor}", "\"{xor}\" is a second check byte; allowed: "},
    {"enable", "enable = 01 02 03 04 05 06 07 08 {sum}", "\"{sum}\" goes beyond the 8 bytes of a frame; allowed: "},
    {"setpoint", "setpoint = 01 {status:u8}", "\"{status:u8}\" is no field of this frame; allowed: "},
    {"setpoint", "setpoint = 01 {position}", "\"{position}\" is no field; allowed: "},
    {"setpoint", "setpoint = 01 .. {position:u32le}", "\"..\" stands for any byte, which only replies can have; allowed: "},
    {"setpoint", "setpoint = 1 {position:u32le}", "\"1\" is no byte; allowed: "},
    {"setpoint", "setpoint = 0x01 {position:u32le}", "\"0x01\" is no byte; allowed: "},
    {"home", "home = 01 {position:u32le}", "\"{position:u32le}\" is no field of this frame; allowed: "},
    {"home", "home = 01 02 03 04 05 06 07 08 09", "\"09\" goes beyond the 8 bytes of a frame; allowed: "},
    {"command_id", "command_id = none", "missing for driver = can-raw; allowed: "},
    {"command_id", "command_id = 0x7FC", "0x800 of drive 5 has more than 11 bits; allowed: up to 0x7FF, or id_bits = 29"},
    {"command_id", "command_id = 1, 2, 3", "has 3 values; allowed: one, or one for each of the 6 drives"},
    {"command_id", "command_id = 1, 2, 3, 4, 5, 3", "0x3 of drive 6 is command_id of drive 3 already; allowed: "},
    {"command_id", "command_id = 1, 2, 3, 4, 5, 6, 7, 8", "has more than 7 values; allowed: "},
    {"reply_id", "reply_id = 0x600", "0x601 of drive 2 is command_id of drive 1 already; allowed: a different one for each"},
    {"reply_id", "reply_id = 0x20000000", "\"0x20000000\" is no identifier; allowed: "},
    {"setpoint_id", "setpoint_id = 0x601",
     "0x601 of drive 1 is command_id of drive 1 already; allowed: a different one for each"},
    {"setpoint_id", "setpoint_id = 0x581", ""}, /* reported at reply_id */
    {"setpoint_id", "setpoint_id = 0x201, 0x201, 0x202, 0x203, 0x204, 0x205",
     "0x201 of drive 2 is setpoint_id of drive 1 already; allowed: a different one for each, or fields such as "
     "{position.2:i16le} in setpoint"},
    {"setpoint", "setpoint = {position.1:u20le@0.0}", "\"{position.1:u20le@0.0}\" covers bytes beyond the frame; "},
    {"setpoint", "setpoint = {position.8:u24le}", "\"{position.8:u24le}\" has no number of a drive from 1 to 7 behind its point"},
    {"setpoint", "setpoint = {position.:u24le}", "\"{position.:u24le}\" has no number of a drive from 1 to 7 behind its point"},
    {"setpoint", "setpoint = {position.1:u24le} {position:u24le}", "\"{position:u24le}\" is there twice; allowed: "},
    {"setpoint", "setpoint = {position.1:u24le} {counter.1:u8}", "\"{counter.1:u8}\" is of the whole frame, and takes no number"},
    {"setpoint", "setpoint = {position.1:u24le} {speed.1:u16le} {position.3:u24le}\nsetpoint_id = 0x201",
     "{position.2} is missing; allowed: {position.1} to {position.3}, of the same type"},
    {"setpoint", "setpoint = {position.1:u24le} {speed:u16le} {position.2:u24le}\nsetpoint_id = 0x201",
     "{speed} is of one drive, and others share the frame; allowed: {speed.1} to {speed.2}"},
    {"setpoint", "setpoint = {position.1:u24le} {speed.1:u16le} {position.2:i24le}\nsetpoint_id = 0x201",
     "{position.2} is of another type; allowed: {position.1} to {position.2}, of the same type"},
    {"status_id", "status_id = 0x700", "there is no status_reply; allowed: only with it"},
    {"status_every", "status_every = 0", "\"0\" is out of range; allowed: "},
    {"counts_per_mm", "counts_per_mm = none", "missing for driver = can-raw; allowed: "},
    {"counts_per_mm", "counts_per_mm = 0", "\"0\" is no ratio; allowed: "},
    {"counts_per_mm", "counts_per_mm = 20000/0", "\"20000/0\" is no ratio; allowed: "},
    {"counts_per_mm", "counts_per_mm = 2000.5.1", "\"2000.5.1\" is no ratio; allowed: "},
    {"counts_per_mm", "counts_per_mm = 0x20.5", "\"0x20.5\" is no ratio; allowed: "},
    {"counts_per_mm", "counts_per_mm = 2000.", "\"2000.\" is no ratio; allowed: "},
    {"counts_per_mm", "counts_per_mm = 5/10000",
     "a stroke of 300 mm would be 0 counts of drive 1; allowed: counts per mm, not mm per count"},
    {"counts_per_mm", "counts_per_mm = 10000000",
     "300 mm of drive 1 are 3000000000 counts, and {position} of position_reply carries -2147483648 to 2147483647; allowed: "},
    {"counts_per_mm", "counts_per_mm = -2000",
     "300 mm of drive 1 are -600000 counts, and {position} of setpoint carries 0 to 4294967295; allowed: "},
    {"counts_per_mm", "counts_per_mm = 2000, 2000", "has 2 values; allowed: one, or one for each of the 6 drives"},
    {"zero_counts", "zero_counts = 1.5", "\"1.5\" is no whole number; allowed: "},
    {"speed_counts", "speed_counts = 0", "{speed} would always be 0; allowed: above 0, or speed_counts_per_mm_s"},
    {"speed_counts", "speed_counts = 65536", "does not fit {speed}; allowed: up to 65535"},
    {"speed_counts_per_mm_s", "speed_counts_per_mm_s = 1000",
     "the speed limit is 300000 counts, and {speed} carries up to 65535; allowed: a smaller ratio"},
    {"position_reply", "position_reply = .. .. ..", "has no {position}; allowed: with one such as {position:u32le}"},
    {"position_reply", "position_reply = 01 {status:u8} {fault:u8} {position:i32le}",
     "{fault} is shown only where fault_when holds, which is missing; allowed: with fault_when = value/mask"},
    {"homing_reply", "homing_reply = none", "missing for driver = can-raw; allowed: "},
    {"homing_reply", "homing_reply = 01 ..", "has no {status}; allowed: with one such as {status:u8}"},
    {"homing_done_when", "homing_done_when = none", "missing where there is home; allowed: value/mask"},
    {"homing_done_when", "homing_done_when = 0x100/0x100", "the mask has bits that {status} of homing_reply does not have; "},
    {"homing_done_when", "homing_done_when = 3/1", "\"3/1\" has a value with bits outside its mask; allowed: "},
    {"homing_done_when", "homing_done_when = 1", "\"1\" is no value/mask; allowed: "},
    {"fault_when", "fault_when = 1/1", "position_reply has no {status}; allowed: only where it has"},
    {"position_query", "position_query = none", ""}, /* reported at homing_reply, see below */
    {"period_us", "period_us = 4500", "is no multiple of cycle_us; allowed: for instance 4000 or 5000 us"},
    {"period_us", "period_us = 500",
     "is no multiple of cycle_us, and would load the bus by 276 % at worst; allowed: for instance 2000 or 3000 us"},
    {"period_us", "period_us = 1000",
     "the bus would be loaded by 138 % at worst; allowed: at most 90 %, better 60 %, which 3000 us give"},
    {"query_every", "query_every = 8", ""},
    {"offline_periods", "offline_periods = 4", "too few for query_every = 2; allowed: at least 5"},
    {"following_error_mm", "following_error_mm = 4", "less than a cylinder moves at full speed until its position is heard; "},
};

/* Every field and check byte there is, from the file into the bytes, and the dump as it stood. */
static void test_fields_and_check_bytes_reach_the_driver_as_they_are_written(void)
{
    static const char *const k_lines[] = {"setpoint = 01 {counter:u8} {position:i24be} {speed:u16le} {crc8:1D/FF/FF}",
                                          "enable = 20 {counter:u16le} {sum}", "stop = 22 {xor}",
                                          "position_reply = 30 {status:u8} {fault:u8} {counter:u8} {position:i24le} {crc8:07}"};
    static const char *const k_keys[] = {"setpoint", "enable", "stop", "position_reply"};
    canraw_map_t map;
    canraw_t driver;
    sim_can_bus_t bus;
    sim_can_t node;
    uint8_t out[8];
    read_preset();
    for (unsigned i = 0; i < 4; i++) {
        put_line(k_keys[i], k_lines[i]);
    }
    put_line("fault_when", "fault_when = 0x08/0x08"); /* without one, {fault} is an error */
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    config_canraw_map(&m_config, &map);
    sim_can_bus_init(&bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, NULL, 0));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&driver, &map, sim_can_hal(&node)));
    const int64_t value[CANRAW_VALUES] = {[CANRAW_POSITION] = -2, [CANRAW_SPEED] = 0x1234, [CANRAW_COUNTER] = 0x1FF};
    TEST_ASSERT_EQUAL(HV_OK, canraw_pack(&map.setpoint, value, out));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){0x01, 0xFF, 0xFF, 0xFF, 0xFE, 0x34, 0x12, 0x8D}), out, 8);
    TEST_ASSERT_EQUAL(HV_OK, canraw_pack(&map.command[CANRAW_ENABLE], value, out));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){0x20, 0xFF, 0x01, 0x20}), out, 4);
    TEST_ASSERT_EQUAL(HV_OK, canraw_pack(&map.command[CANRAW_STOP], value, out));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){0x22, 0x22}), out, 2);
    FILE *dump = tmpfile();
    config_dump(&m_config, dump);
    rewind(dump);
    static char text[60000];
    text[fread(text, 1, sizeof text - 1, dump)] = '\0';
    fclose(dump);
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, k_lines[i]), k_lines[i]);
    }
}

/* Bit fields and floats, from the file into the bytes. A place on whole bytes is the same as standing there. */
static void test_bit_fields_and_floats_reach_the_driver_as_they_are_written(void)
{
    static const uint8_t k_setpoint[8] = {0x10, 0xE0, 0xFF, 0x7F, 0x44, 0x9A, 0x40, 0x00}; /* -2 in 18 bits, 40h; 1234.0 */
    canraw_map_t map;
    uint8_t out[8];
    read_preset();
    put_line("setpoint", "setpoint = 10 00 00 40 00 00 00 00 {position:i18le@1.4} {speed:f32be/10@4.7}");
    put_line("position_reply", "position_reply = .. .. .. 00 {position:i20be@0.5} {status:u2@2.0}");
    put_line("counts_per_mm", "counts_per_mm = 400");
    put_line("speed_counts", "speed_counts = 12340");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    config_canraw_map(&m_config, &map);
    const int64_t value[CANRAW_VALUES] = {[CANRAW_POSITION] = -2, [CANRAW_SPEED] = 12340};
    TEST_ASSERT_EQUAL(HV_OK, canraw_pack(&map.setpoint, value, out));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(k_setpoint, out, 8);
    const uint8_t reply[8] = {0xC0 | 0x04, 0x8D, 0x05 << 2 | 2, 0x00}; /* 12345h in 6, 8 and 6 bits, whatever is above */
    TEST_ASSERT_TRUE(canraw_matches(&map.position_reply, reply, 4));
    TEST_ASSERT_EQUAL_INT64(0x12345, canraw_extract(canraw_find(&map.position_reply, CANRAW_POSITION), reply));
    TEST_ASSERT_EQUAL_INT64(2, canraw_extract(canraw_find(&map.position_reply, CANRAW_STATUS), reply));
}

static void test_a_status_of_its_own_frame_is_told_from_the_others(void)
{
    static const char *const k_cases[][3] = {
        {"30 {torque:i16le}", "0x700", "[can-raw] status_reply: has no {status}; allowed: with one such as {status:u8}"},
        {".. .. .. {status:u8}", "none", "[can-raw] status_reply: cannot be told from position_reply or homing_reply; allowed: "},
        {"30 {status.1:u8} {status.2:u8}", "none", "[can-raw] status_reply: is of 2 drives, and position_reply with the same"},
        {"30 {status.1:u8} {status.2:u8}", "0x700, 0x700, 0x700, 0x701, 0x701, 0x702",
         "[can-raw] status_id: 0x700 is that of 3 drives, and status_reply has fields for 2; allowed: up to 2 drives"},
        {"30 {status:u8}", "0x602", "[can-raw] status_id: 0x602 of drive 1 is command_id of drive 2 already; allowed: "},
        {"30 {status:u8}", "0x700, 0x700, 0x700, 0x701, 0x701, 0x701", NULL},
        {"30 {status.1:u8} {fault.1:u16le} {status.2:u8}", "0x700", "{fault} is shown only where fault_when holds"},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        char line[200];
        read_preset();
        put_line("position_reply", "position_reply = 00 15 {position:i32le}");
        put_line("homing_reply", "homing_reply = 00 12 {status:u8}");
        snprintf(line, sizeof line, "status_reply = %s", k_cases[i][0]);
        put_line("status_reply", line);
        snprintf(line, sizeof line, "status_id = %s", k_cases[i][1]);
        put_line("status_id", line);
        if (i == 1) {
            put_line("position_reply", "position_reply = .. .. {position:i32le}");
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(k_cases[i][2] != NULL, load_text(), m_errors);
        TEST_ASSERT_TRUE_MESSAGE(k_cases[i][2] == NULL || strstr(m_errors, k_cases[i][2]) != NULL, m_errors);
    }
}

/* Conditions are of the status, wherever it comes; three drives may have one. */
static void test_a_status_of_its_own_frame_reaches_the_driver(void)
{
    canraw_map_t map;
    config_bus_t bus;
    read_preset();
    put_line("status_reply", "status_reply = 30 {status:u8} {torque:i16le} {counter:u8}");
    put_line("status_id", "status_id = 0x700");
    put_line("status_every", "status_every = 25");
    put_line("enabled_when", "enabled_when = 0x01/0x01");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    config_canraw_map(&m_config, &map);
    for (unsigned k = 0; k < 6; k++) {
        TEST_ASSERT_EQUAL_HEX32(0x700 + k, map.axis[k].status_id);
        TEST_ASSERT_EQUAL_UINT8(0, map.axis[k].status_slot);
    }
    TEST_ASSERT_EQUAL_UINT32(25, map.status_every);
    TEST_ASSERT_EQUAL_UINT8(5, map.status_reply.length);
    config_bus_describe(&m_config, &bus);
    TEST_ASSERT_EQUAL_UINT32(4, bus.count);
    TEST_ASSERT_EQUAL_UINT32(6, bus.entry[3].frames);
    TEST_ASSERT_EQUAL_UINT32(25, bus.entry[3].periods);
}

static void test_steps_of_starting_up_are_read_checked_and_written_as_they_were(void)
{
    static const char *const k_cases[][3] = {
        {"startup1", "2F 10 -> 00 15 .. .. .. ..",
         "[can-raw] startup1: its answer cannot be told from position_reply, homing_reply or status_reply"},
        {"startup2", "2F 10", "[can-raw] startup2: there is no startup1; allowed: one after the other from startup1"},
        {"startup1", "2F .. -> 60", "\"..\" stands for any byte, which only replies can have; allowed: "},
        {"startup1", "2F -> {position:u8}", "\"{position:u8}\" is no field of this frame; allowed: "},
        {"startup1", "2F wait 20000", "\"wait 20000\" is no time; allowed: at its end, wait and milliseconds up to 10000"},
        {"startup1", "-> 60", "\"\" is no frame; allowed: "},
        {"startup1", "2F ->", "\"\" is no frame; allowed: "},
        {"startup1", "2F 10 -> 00 15 .. ..", NULL}, /* shorter than a position */
        {"startup1", "01 03 01 00 00 00 00 00", "[can-raw] startup1: a drive could take it for enable, home or setpoint, and"},
        {"startup1", "01 05 00 00 00 00 00 00", "[can-raw] startup1: a drive could take it for enable, home or setpoint, and"},
        {"startup1", "01 03 02 00 00 00 00 00", NULL},
        {"startup1", "2F 10 {counter:u8} {xor} -> 60 .. {sum} wait 50", NULL},
    };
    canraw_map_t map;
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        char line[200];
        read_preset();
        put_line("position_reply", "position_reply = 00 15 {position:i32le}");
        put_line("homing_reply", "homing_reply = 00 12 {status:u8}");
        snprintf(line, sizeof line, "%s = %s", k_cases[i][0], k_cases[i][1]);
        put_line(k_cases[i][0], line);
        TEST_ASSERT_EQUAL_INT_MESSAGE(k_cases[i][2] != NULL, load_text(), m_errors);
        TEST_ASSERT_TRUE_MESSAGE(k_cases[i][2] == NULL || strstr(m_errors, k_cases[i][2]) != NULL, m_errors);
    }
    config_canraw_map(&m_config, &map);
    TEST_ASSERT_EQUAL_UINT8(4, map.step[0].frame.length);
    TEST_ASSERT_EQUAL_UINT8(3, map.step[0].answer.length);
    TEST_ASSERT_EQUAL_UINT32(50000, map.step[0].wait_us);
    TEST_ASSERT_EQUAL_UINT8(0, map.step[1].frame.length);
    expect_same("startup1", "2F 10 {counter:u8} {xor} -> 60 .. {sum} wait 50");
    expect_same("startup8", "2F");
    expect_same("startup2", "2F wait 7");
    expect_same("startup2", "2F -> ..");
    expect_same("startup1", "none");
}

static void test_identifiers_of_too_many_drives_are_named(void)
{
    static const char *const k_cases[][2] = {
        {"setpoint_id = 0x201, 0x201, 0x201, 0x203, 0x204, 0x205",
         "[can-raw] setpoint_id: 0x201 is that of 3 drives, and setpoint has fields for 2; allowed: up to 2 drives with the "
         "same"},
        {"setpoint_id = 0x7FE", "[can-raw] setpoint_id: 0x800 of drive 5 has more than 11 bits; allowed: up to 0x7FF"},
        {"setpoint_id = none",
         "[can-raw] setpoint_id: missing where setpoint has fields of several drives; allowed: the identifier"},
        {"setpoint_id = 0x201, 0x202", "[can-raw] setpoint_id: has 2 values; allowed: one, or one for each of the 6 drives"},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        read_preset();
        put_line("setpoint", TWO_IN_A_FRAME);
        put_line("setpoint_id", k_cases[i][0]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_text(), m_errors);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, k_cases[i][1]), m_errors);
    }
}

/* One identifier for two drives each, or a list; who has which field. */
static void test_drives_that_share_frames_have_their_identifiers_and_fields(void)
{
    canraw_map_t map;
    config_bus_t bus;
    read_preset();
    put_line("setpoint", TWO_IN_A_FRAME);
    put_line("setpoint_id", "setpoint_id = 0x201");
    put_line("reply_id", "reply_id = 0x301, 0x302, 0x301, 0x302, 0x303, 0x303");
    put_line("position_reply", "position_reply = 00 15 {position.1:i24le} {position.2:i24le}");
    put_line("homing_reply", "homing_reply = 00 12 {status:u8}");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    config_canraw_map(&m_config, &map);
    for (unsigned k = 0; k < 6; k++) {
        static const uint32_t k_replies[] = {0x301, 0x302, 0x301, 0x302, 0x303, 0x303};
        static const uint8_t k_slots[] = {1, 1, 2, 2, 1, 2};
        TEST_ASSERT_EQUAL_HEX32(0x601 + k, map.axis[k].command_id);
        TEST_ASSERT_EQUAL_HEX32(0x201 + k / 2, map.axis[k].setpoint_id);
        TEST_ASSERT_EQUAL_UINT8(1 + k % 2, map.axis[k].setpoint_slot);
        TEST_ASSERT_EQUAL_HEX32(k_replies[k], map.axis[k].reply_id);
        TEST_ASSERT_EQUAL_UINT8(k_slots[k], map.axis[k].reply_slot);
    }
    config_bus_describe(&m_config, &bus);
    TEST_ASSERT_EQUAL_UINT32(3, bus.entry[0].frames); /* of set-points */
    put_line("startup1", "startup1 = 2F 10");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    put_line("startup1", "startup1 = 2F 10 -> 60 10");
    TEST_ASSERT_EQUAL_INT(1, load_text());
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(m_errors, "startup1: drives that share reply_id cannot be told apart by an answer; allowed: "), m_errors);
}

static void test_spoilt_lines_are_one_error_at_the_key_they_concern(void)
{
    for (size_t i = 0; i < sizeof k_spoilt / sizeof k_spoilt[0]; i++) {
        char expected[400];
        read_preset();
        put_line(k_spoilt[i].key, k_spoilt[i].line);
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_text(), k_spoilt[i].line);
        snprintf(expected, sizeof expected, "%s:%u: [can-raw] %s: %s", FILE_NAME, line_of(k_spoilt[i].key), k_spoilt[i].key,
                 k_spoilt[i].message);
        if (k_spoilt[i].message[0] != '\0' && strncmp(expected, m_errors, strlen(expected)) != 0) {
            TEST_ASSERT_EQUAL_STRING(expected, m_errors);
        }
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "; allowed: "), m_errors);
    }
}

/* The bus has a section of its own. */
static void test_spoilt_bus_is_reported_where_it_is_wrong(void)
{
    static const char *const k_lines[][2] = {
        {"interface = can 0", "[can] interface: \"can 0\" is no name of an interface; allowed: "},
        {"interface = abcdefghijklmnop", "[can] interface: \"abcdefghijklmnop\" is no name of an interface; allowed: "},
        {"bitrate_bps = 1000001", "[can] bitrate_bps: \"1000001\" is out of range; allowed: "},
        {"bitrate_bps = 125000", "[can-raw] period_us: the bus would be loaded by 276 % at worst; allowed: "},
    };
    for (size_t i = 0; i < sizeof k_lines / sizeof k_lines[0]; i++) {
        read_preset();
        char *section = strstr(m_text, "[can]\n");
        section[0] = ';'; /* the section that was there */
        memcpy(strstr(section, "interface"), ";nterface", 9);
        memcpy(strstr(section, "bitrate"), ";itrate", 7);
        sprintf(m_text + strlen(m_text), "\n[can]\n%s\n", k_lines[i][0]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_text(), k_lines[i][0]);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, k_lines[i][1]), m_errors);
    }
}

/* The section of drives that are not in use is read, dumped, and not asked for anything. */
static void test_section_not_in_use_is_kept_and_not_checked(void)
{
    read_preset();
    memcpy(strstr(m_text, "driver = can-raw"), "driver = sim    ", 16);
    put_line("home", "home = none");
    put_line("setpoint", "setpoint = none");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(), m_errors);
    TEST_ASSERT_EQUAL_UINT8(2, m_config.can_raw.position_query.length);
}

/* ---- Text and back ---- */

static void test_values_are_written_as_they_were_read(void)
{
    static const char *const k_types[] = {"u8", "i8", "u16le", "u16be", "i16le", "i16be", "u32le", "u32be", "i32le", "i32be"};
    for (unsigned i = 0; i < 10; i++) {
        char text[80];
        snprintf(text, sizeof text, "0A .. {status:%s} .. {position:u16be}", k_types[i]);
        expect_same("position_reply", i < 6 ? text : "{position:i32le} {status:u32be}");
        snprintf(text, sizeof text, "{position:%s} 00 FF", k_types[i]);
        expect_same("setpoint", text);
    }
    expect_same("position_reply", "00 .. 05 {position:i12le@0.4} {status:u4@0.0}");
    expect_same("setpoint", "01 80 00 00 {position:u20be@1.6} {speed:u3@3.0}");
    expect_same("setpoint", "01 {position:f32be/65536} 00 00 {speed:i12le@5.0}");
    expect_same("setpoint", "{position:f32le} {speed:f32be/1000}");
    expect_same("setpoint", &TWO_IN_A_FRAME[strlen("setpoint = ")]);
    expect_same("position_reply", "{position.1:i16le} {position.2:i16le} {status:u8} 00 {fault.1:u4@5.0} {fault.2:u4@5.4}");
    expect_same("setpoint_id", "0x200");
    expect_same("home", "01 {crc8:9B/FF}");
    expect_same("home", "01 {crc8:07/00/55}");
    expect_same("home", "none");
    expect_same("command_id", "0x601, 0x1FFFFFFF");
    expect_same("counts_per_mm", "20000/10, -3, 2147483647/2147483647");
    expect_same("zero_counts", "-5, 0, 7, 1, 2, 3");
    expect_same("fault_when", "0x8/0x4F");
    expect_same("fault_when", "none");
    expect_same("interface", "vcan0.1-a_b");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_preset_frames_byte_for_byte);
    RUN_TEST(test_preset_drives_are_enabled_homed_and_led);
    RUN_TEST(test_preset_bus_load_is_the_sum_of_its_frames);
    RUN_TEST(test_fields_and_check_bytes_reach_the_driver_as_they_are_written);
    RUN_TEST(test_bit_fields_and_floats_reach_the_driver_as_they_are_written);
    RUN_TEST(test_drives_that_share_frames_have_their_identifiers_and_fields);
    RUN_TEST(test_a_status_of_its_own_frame_is_told_from_the_others);
    RUN_TEST(test_a_status_of_its_own_frame_reaches_the_driver);
    RUN_TEST(test_steps_of_starting_up_are_read_checked_and_written_as_they_were);
    RUN_TEST(test_identifiers_of_too_many_drives_are_named);
    RUN_TEST(test_spoilt_lines_are_one_error_at_the_key_they_concern);
    RUN_TEST(test_spoilt_bus_is_reported_where_it_is_wrong);
    RUN_TEST(test_section_not_in_use_is_kept_and_not_checked);
    RUN_TEST(test_values_are_written_as_they_were_read);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_config.c - the configuration file: every key of a good file is spoilt in every way, and the message has to name file, line
 * and key; whole messages are compared with ones written by hand; what loads has to survive being dumped and loaded again; random
 * files never break anything; the ready-made platforms do what their comments say, by a double-precision model of its own.
 */
#define _POSIX_C_SOURCE 200809L

#include "config/config.h"
#include "platform/load.h"
#include "config/hash.h"
#include "config/keys.h"
#include "config/config_text.h"
#include "config/value.h"
#include "inspect/report.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "heave/kin.h"
#include "heave/number.h"
#include "random.h"
#include "unity.h"

#define FILE_NAME "test_config.tmp.ini"
#define TEXT_MAX  131072u
#define LINES_MAX 1200u

static const char *const k_platforms[] = {"demo-hexapod.ini", "hexapod-400.ini",     "hexapod-435-300.ini",
                                          "tripod.ini",       "tripod-rotation.ini", "can-raw-hexapod.ini"};

static config_t m_config;
static char m_errors[200000];
static char m_text[TEXT_MAX];
static char m_line[LINES_MAX][256];
static unsigned m_lines;

void setUp(void)
{
    memset(&m_config, 0, sizeof m_config);
    m_errors[0] = '\0';
    m_lines = 0;
    random_begin(RANDOM_SEED);
}

void tearDown(void)
{
    remove(FILE_NAME);
}

/* ---- Files ---- */

static size_t read_all(const char *path, char *text, size_t capacity)
{
    FILE *file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    const size_t length = fread(text, 1, capacity - 1, file);
    fclose(file);
    text[length] = '\0';
    return length;
}

static void write_bytes(const char *bytes, size_t length)
{
    FILE *file = fopen(FILE_NAME, "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_UINT(length, fwrite(bytes, 1, length, file));
    fclose(file);
}

static int load_path(const char *path)
{
    FILE *errors = tmpfile();
    TEST_ASSERT_NOT_NULL(errors);
    const int count = config_load(path, &m_config, errors);
    rewind(errors);
    m_errors[fread(m_errors, 1, sizeof m_errors - 1, errors)] = '\0';
    fclose(errors);
    return count;
}

static int load_bytes(const char *bytes, size_t length)
{
    write_bytes(bytes, length);
    return load_path(FILE_NAME);
}

static int load_text(const char *text)
{
    return load_bytes(text, strlen(text));
}

static const char *platform_path(const char *name)
{
    static char path[512];
    snprintf(path, sizeof path, "%s/%s", HEAVE_CONFIG_DIR, name);
    return path;
}

static void load_platform(const char *name)
{
    const int count = load_path(platform_path(name));
    TEST_ASSERT_EQUAL_STRING("", m_errors);
    TEST_ASSERT_EQUAL_INT(0, count);
}

static void dump(const config_t *config, char *text, size_t capacity)
{
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    config_dump(config, file);
    rewind(file);
    text[fread(text, 1, capacity - 1, file)] = '\0';
    fclose(file);
}

/* ---- A good file as lines that a test spoils ---- */

static void take_lines(const char *text)
{
    for (m_lines = 0; *text != '\0'; m_lines++) {
        const size_t length = strcspn(text, "\n");
        TEST_ASSERT_LESS_THAN(LINES_MAX, m_lines);
        snprintf(m_line[m_lines], sizeof m_line[0], "%.*s", (int)length, text);
        text += length + (text[length] == '\n');
    }
}

/* Every key of a platform that has them all. */
static void take_good_file(void)
{
    load_platform("demo-hexapod.ini");
    dump(&m_config, m_text, sizeof m_text);
    take_lines(m_text);
}

static int load_lines(void)
{
    m_text[0] = '\0';
    size_t length = 0;
    for (unsigned i = 0; i < m_lines; i++)
        length += (size_t)snprintf(m_text + length, sizeof m_text - length, "%s\n", m_line[i]);
    TEST_ASSERT_LESS_THAN(sizeof m_text - 1, length);
    return load_text(m_text);
}

static void delete_line(unsigned at)
{
    memmove(m_line[at], m_line[at + 1], (m_lines - at - 1) * sizeof m_line[0]);
    m_lines--;
}

static void insert_line(unsigned at, const char *text)
{
    memmove(m_line[at + 1], m_line[at], (m_lines - at) * sizeof m_line[0]);
    snprintf(m_line[at], sizeof m_line[0], "%s", text);
    m_lines++;
}

/* Index of `[section]`. */
static unsigned find_section(const char *section)
{
    char header[64];
    snprintf(header, sizeof header, "[%s]", section);
    for (unsigned i = 0; i < m_lines; i++) {
        if (strcmp(m_line[i], header) == 0)
            return i;
    }
    TEST_FAIL_MESSAGE(section);
    return 0;
}

/* Index of `key = ...` in a section. */
static unsigned find_key(const char *section, const char *key)
{
    for (unsigned i = find_section(section) + 1; i < m_lines && m_line[i][0] != '['; i++) {
        const size_t length = strlen(key);
        if (strncmp(m_line[i], key, length) == 0 && m_line[i][length] == ' ')
            return i;
    }
    TEST_FAIL_MESSAGE(key);
    return 0;
}

static void set_key(const char *section, const char *key, const char *value)
{
    const unsigned at = find_key(section, key);
    snprintf(m_line[at], sizeof m_line[0], "%s = %s", key, value);
}

/* As a running platform reads it again. */
static int reload_file(config_t *running, FILE *report)
{
    static char text[CONFIG_TEXT_BYTES];
    const ssize_t length = config_read(FILE_NAME, text);
    return config_reload(FILE_NAME, text, length, running, report);
}

/* Errors go where those of load_lines() do. */
static int reload(config_t *running)
{
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    const int errors = reload_file(running, file);
    rewind(file);
    m_errors[fread(m_errors, 1, sizeof m_errors - 1, file)] = '\0';
    fclose(file);
    return errors;
}

/* "test_config.tmp.ini:12: [roll] min_deg: " */
static const char *prefix(unsigned line, const char *section, const char *key)
{
    static char text[200];
    snprintf(text, sizeof text, "%s:%u: [%s] %s: ", FILE_NAME, line, section, key);
    return text;
}

static void expect_start(const char *expected)
{
    if (strncmp(m_errors, expected, strlen(expected)) != 0)
        TEST_ASSERT_EQUAL_STRING(expected, m_errors);
}

static void expect_contains(const char *expected)
{
    if (strstr(m_errors, expected) == NULL)
        TEST_ASSERT_EQUAL_STRING(expected, m_errors);
}

/* ---- Every key, spoilt ---- */

static void test_load_every_key_with_wrong_type_is_one_error_at_its_line(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        take_good_file();
        set_key(key->section, key->name, "abc!");
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), key->name);
        expect_start(prefix(find_key(key->section, key->name) + 1, key->section, key->name));
        if (key->type != &config_type_decimal || key->count == 1) /* a vector is short of values first */
            expect_contains("\"abc!\"");
        expect_contains("; allowed: ");
    }
}

static void test_load_every_key_without_value_is_one_error_at_its_line(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        take_good_file();
        set_key(key->section, key->name, "");
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), key->name);
        expect_start(prefix(find_key(key->section, key->name) + 1, key->section, key->name));
    }
}

static bool has_range(const config_key_t *key)
{
    return key->type == &config_type_integer || key->type == &config_type_per_cylinder || key->type == &config_type_decimal;
}

/* `value` thousandths as text, as many times as the key has values, the last one being the one that counts. */
static void repeat_milli(const config_key_t *key, int64_t value_milli, char *text, size_t capacity)
{
    const unsigned count = key->type == &config_type_decimal ? key->count : 1;
    size_t length = 0;
    for (unsigned i = 1; i < count; i++)
        length += (size_t)snprintf(text + length, capacity - length, "0, ");
    snprintf(text + length, capacity - length, "%s%lld.%03lld", value_milli < 0 ? "-" : "", llabs(value_milli) / 1000,
             llabs(value_milli) % 1000);
    if (key->type == &config_type_integer)
        *strrchr(text, '.') = '\0';
}

static void expect_out_of_range(const config_key_t *key, int64_t value_milli)
{
    char value[128];
    take_good_file();
    repeat_milli(key, value_milli, value, sizeof value);
    set_key(key->section, key->name, value);
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), key->name);
    expect_start(prefix(find_key(key->section, key->name) + 1, key->section, key->name));
    expect_contains("is out of range; allowed: ");
}

static void test_load_every_number_outside_its_range_is_one_error_at_its_line(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        const int64_t step = key->type == &config_type_integer ? 1000 : 1;
        if (!has_range(key))
            continue;
        expect_out_of_range(key, key->low_milli - step);
        expect_out_of_range(key, key->high_milli + step);
    }
}

static void test_value_parse_every_number_at_the_ends_of_its_range_is_taken(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        char value[128];
        config_text_t why;
        unsigned count;
        if (!has_range(key))
            continue;
        config_text_clear(&why);
        repeat_milli(key, key->low_milli, value, sizeof value);
        TEST_ASSERT_TRUE_MESSAGE(config_value_parse(key, value, &m_config, &count, &why), why.data);
        repeat_milli(key, key->high_milli, value, sizeof value);
        TEST_ASSERT_TRUE_MESSAGE(config_value_parse(key, value, &m_config, &count, &why), why.data);
    }
}

static void test_load_every_required_key_left_out_is_missing_at_its_section(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        take_good_file();
        delete_line(find_key(key->section, key->name));
        const int count = load_lines();
        if (key->fallback != NULL) {
            if (strcmp(key->name, "present") != 0) /* without it the rest of [angle] means nothing */
                TEST_ASSERT_EQUAL_INT_MESSAGE(0, count, m_errors);
            continue;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, count, m_errors);
        expect_start(prefix(find_section(key->section) + 1, key->section, key->name));
        expect_contains("missing; allowed: ");
    }
}

static void test_load_every_key_given_twice_names_the_first_line(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        char first[64];
        take_good_file();
        const unsigned at = find_key(key->section, key->name);
        char line[256];
        memcpy(line, m_line[at], sizeof line);
        insert_line(at + 1, line);
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), key->name);
        expect_start(prefix(at + 2, key->section, key->name));
        snprintf(first, sizeof first, "given again; allowed: once, and it is at line %u\n", at + 1);
        expect_contains(first);
    }
}

static void test_load_every_key_misspelt_suggests_the_right_one(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        char name[64], expected[320];
        take_good_file();
        const unsigned at = find_key(key->section, key->name);
        char *value = strchr(m_line[at], '=');
        snprintf(name, sizeof name, "%cq%s", key->name[0], key->name + 1);
        snprintf(expected, sizeof expected, "%sunknown key; did you mean %s?\n", prefix(at + 1, key->section, name), key->name);
        char line[256];
        snprintf(line, sizeof line, "%s %s", name, value);
        memcpy(m_line[at], line, sizeof line);
        const int count = load_lines();
        TEST_ASSERT_GREATER_OR_EQUAL_INT(1, count);
        expect_start(expected);
        if (strcmp(key->name, "present") != 0)
            TEST_ASSERT_EQUAL_INT_MESSAGE(key->fallback == NULL ? 2 : 1, count, m_errors);
    }
}

static void test_load_every_section_left_out_reports_its_required_keys_at_the_end(void)
{
    for (size_t i = 0; i < config_section_count; i++) {
        const char *section = config_sections[i].name;
        int required = 0;
        if (strcmp(section, "platform") == 0 || strcmp(section, "angle") == 0)
            continue; /* what the others need depends on these */
        take_good_file();
        unsigned at = find_section(section);
        do {
            delete_line(at);
        } while (at < m_lines && m_line[at][0] != '[');
        for (size_t k = 0; k < config_key_count; k++)
            required += strcmp(config_keys[k].section, section) == 0 && config_keys[k].fallback == NULL;
        const int count = load_lines();
        TEST_ASSERT_EQUAL_INT_MESSAGE(strcmp(section, "relays") == 0 ? 0 : required, count, m_errors);
        char expected[64];
        snprintf(expected, sizeof expected, "%s:%u: [%s] ", FILE_NAME, m_lines, section);
        if (required > 0)
            expect_start(expected);
    }
}

/* ---- Whole messages, written by hand ---- */

/* A change of one key's line in the good file, and all that is said about it (after FILE:LINE: ). */
typedef struct {
    const char *section;
    const char *key;
    const char *line;
    const char *message;
} spoilt_t;

static const spoilt_t k_spoilt[] = {
    {"platform", "kind", "kind = octopod", "[platform] kind: \"octopod\" is not known; allowed: hexapod | tripod | tripod-3rps"},
    {"platform", "kind", "kind = Hexapod", "[platform] kind: \"Hexapod\" is not known; allowed: hexapod | tripod | tripod-3rps"},
    {"platform", "cycle_us", "cycle_us = 1000.0",
     "[platform] cycle_us: \"1000.0\" is not a whole number; allowed: a whole number from 500 to 10000 us"},
    {"platform", "cycle_us", "cycle_us = 99999999999999999999",
     "[platform] cycle_us: \"99999999999999999999\" is not a whole number; allowed: a whole number from 500 to 10000 us"},
    {"geometry", "base1_mm", "base1_mm = 1, 2",
     "[geometry] base1_mm: has 2 values; allowed: 3 numbers from -4000 to 4000 mm, separated by commas"},
    {"geometry", "base1_mm", "base1_mm = 1,5, 2, 3",
     "[geometry] base1_mm: \"1,5, 2, 3\" has a comma where a decimal point belongs; allowed: 3 numbers from -4000 to 4000 mm, "
     "separated by commas"},
    {"geometry", "base1_mm", "base1_mm = 1, , 3",
     "[geometry] base1_mm: \"\" has no number; allowed: 3 numbers from -4000 to 4000 mm, separated by commas"},
    {"geometry", "stroke_mm", "stroke_mm = 200, 200",
     "[geometry] stroke_mm: has 2 values; allowed: a number from 0.001 to 4000 mm, or one for each cylinder"},
    {"geometry", "stroke_mm", "stroke_mm = 200, 200, 200",
     "[geometry] stroke_mm: has 3 values; allowed: one, or one for each of the 6 cylinders"},
    {"geometry", "stroke_mm", "stroke_mm = 200 mm",
     "[geometry] stroke_mm: \"200 mm\" has its unit behind it; write the number alone; allowed: a number from 0.001 to 4000 mm, "
     "or one for each cylinder"},
    {"geometry", "zero_height_mm", "zero_height_mm = 300",
     "[geometry] zero_height_mm: pose zero needs an extension of -108.749 mm of cylinder 1; allowed: about 438 to 662 mm"},
    {"pose", "neutral", "neutral = 0, 0, 0, 0, 0, 120", "[pose] neutral: z of 120; allowed: -98 to 105 mm (min and max of [z])"},
    {"pose", "settled_extension_mm", "settled_extension_mm = 0.5",
     "[pose] settled_extension_mm: 0.5 mm is outside the usable stroke; allowed: 1 to 199 mm (stroke less margins)"},
    {"roll", "sign", "sign = 0", "[roll] sign: \"0\" is not a sign; allowed: 1 or -1"},
    {"roll", "min_deg", "min_deg = nan",
     "[roll] min_deg: \"nan\" is not a number; allowed: a number from -90 to 90 deg, or suggested"},
    {"roll", "min_deg", "min_deg = 1e9",
     "[roll] min_deg: \"1e9\" is out of range; allowed: a number from -90 to 90 deg, or suggested"},
    {"roll", "min_deg", "min_deg = -0x10",
     "[roll] min_deg: \"-0x10\" is not a number; allowed: a number from -90 to 90 deg, or suggested"},
    {"roll", "max_deg", "max_deg = -19.5", "[roll] max_deg: not above min_deg; allowed: more than -19.5 deg"},
    {"angle", "present", "present = maybe", "[angle] present: \"maybe\" is neither yes nor no; allowed: yes | no"},
    {"angle", "wrap", "wrap = short", "[angle] wrap: \"short\" is not known; allowed: as-sent | shortest"},
    {"cylinders", "margin_mm", "margin_mm = 100",
     "[cylinders] margin_mm: the margins leave nothing of the stroke; allowed: below 100 mm"},
    {"engage", "speed_mm_s", "speed_mm_s = 300.5",
     "[engage] speed_mm_s: 300.5 is above speed_mm_s of [cylinders]; allowed: at most 300"},
    {"engage", "accel_mm_s2", "accel_mm_s2 = 3001",
     "[engage] accel_mm_s2: 3001 is above accel_mm_s2 of [cylinders]; allowed: at most 3000"},
    {"udp", "bind", "bind = localhost", "[udp] bind: \"localhost\" is not an address; allowed: a numeric IPv4 or IPv6 address"},
    {"udp", "bind", "bind = 239.1.2.3",
     "[udp] bind: \"239.1.2.3\" is a multicast group, to be joined; write bind = 0.0.0.0 and group = 239.1.2.3%eth0 (the network "
     "card on which)"},
    {"udp", "bind", "bind = ff15::7",
     "[udp] bind: \"ff15::7\" is a multicast group, to be joined; write bind = :: and group = ff15::7%eth0 (the network card on "
     "which)"},
    {"udp", "group", "group = eth0",
     "[udp] group: \"eth0\" is not an address; allowed: none, or a multicast address and its network card, such as "
     "239.1.2.3%eth0 or ff15::9800%eth0"},
    {"udp", "group", "group = 192.168.7.5%eth0",
     "[udp] group: \"192.168.7.5%eth0\" is not the address of a multicast group; allowed: none, or a multicast address and its "
     "network card, such as "
     "239.1.2.3%eth0 or ff15::9800%eth0"},
    {"udp", "group", "group = 239.1.2.3",
     "[udp] group: \"239.1.2.3\" does not name a network card; allowed: none, or a multicast address and its network card, such "
     "as "
     "239.1.2.3%eth0 or ff15::9800%eth0"},
    {"udp", "group", "group = ff02::1%",
     "[udp] group: \"ff02::1%\" does not name a network card; allowed: none, or a multicast address and its network card, such "
     "as "
     "239.1.2.3%eth0 or ff15::9800%eth0"},
    {"udp", "group", "group = 239.1.2.3%sixteen-letters-x",
     "[udp] group: \"239.1.2.3%sixteen-letters-x\" does not name a network card; allowed: none, or a multicast address and its "
     "network card, such as "
     "239.1.2.3%eth0 or ff15::9800%eth0"},
    {"udp", "group", "group = 239.1.2.3%eth0", "[udp] group: is not heard where bind is 127.0.0.1; allowed: bind = 0.0.0.0"},
    {"udp", "group", "group = ff15::7%eth0", "[udp] group: is not heard where bind is 127.0.0.1; allowed: bind = ::"},
    {"udp", "port", "port = 0", "[udp] port: \"0\" is out of range; allowed: a whole number from 1 to 65535"},
    {"udp", "allow", "allow = 192.168.7.5/24",
     "[udp] allow: \"192.168.7.5/24\" has bits set behind its prefix; allowed: any, or up to 16 addresses or networks such as "
     "192.168.7.0/24"},
    {"udp", "allow", "allow = 10.0.0.1, fd00::/129",
     "[udp] allow: \"fd00::/129\" has no prefix from 0 to 128; allowed: any, or up to 16 addresses or networks such as "
     "192.168.7.0/24"},
    {"udp", "allow", "allow = 10.0.0.1/31",
     "[udp] allow: \"10.0.0.1/31\" has bits set behind its prefix; allowed: any, or up to 16 addresses or networks such as "
     "192.168.7.0/24"},
    {"udp", "allow", "allow = 10.0.0.1, any",
     "[udp] allow: \"any\" is not an address; allowed: any, or up to 16 addresses or networks such as 192.168.7.0/24"},
    {"udp", "allow",
     "allow = 1.1.1.1,1.1.1.2,1.1.1.3,1.1.1.4,1.1.1.5,1.1.1.6,1.1.1.7,1.1.1.8,1.1.1.9,1.1.2.1,1.1.2.2,1.1.2.3,"
     "1.1.2.4,1.1.2.5,1.1.2.6,1.1.2.7,1.1.2.8",
     "[udp] allow: has 17 values; allowed: any, or up to 16 addresses or networks such as 192.168.7.0/24"},
    {"udp", "silence_neutral_ms", "silence_neutral_ms = 1000",
     "[udp] silence_neutral_ms: not after silence_hold_ms; allowed: 0, or more than 10000 ms"},
    {"udp", "silence_settle_ms", "silence_settle_ms = 900",
     "[udp] silence_settle_ms: not after silence_hold_ms; allowed: 0, or more than 10000 ms"},
    {"udp", "silence_hold_ms", "silence_hold_ms = -1",
     "[udp] silence_hold_ms: \"-1\" is out of range; allowed: a whole number from 0 to 3600000 ms"},
    {"control", "socket", "socket = heaved.sock",
     "[control] socket: \"heaved.sock\" is not an absolute path; allowed: an absolute path of at most 107 characters"},
    {"black-box", "directory", "directory = incidents",
     "[black-box] directory: \"incidents\" is not an absolute path; allowed: none, or an absolute path of at most 107 "
     "characters"},
    {"black-box", "incidents", "incidents = 0",
     "[black-box] incidents: \"0\" is out of range; allowed: a whole number from 1 to 100"},
    {"drives", "driver", "driver = cia",
     "[drives] driver: \"cia\" is not known; allowed: sim | cia402 | can-raw | modbus-tcp | modbus-rtu"},
    {"sim", "start_extension_mm", "start_extension_mm = 200.5",
     "[sim] start_extension_mm: 200.5 mm is above the stroke; allowed: 0 to 200 mm, or settled"},
    {"sim", "start_extension_mm", "start_extension_mm = up",
     "[sim] start_extension_mm: \"up\" is not a number; allowed: a number from 0 to 4000 mm, or settled"},
    {"relays", "lines", "lines = 1, 2, 1",
     "[relays] lines: \"1\" is listed twice; allowed: none, or up to 12 different lines, by name or number"},
    {"relays", "lines", "lines = 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13",
     "[relays] lines: has 13 values; allowed: none, or up to 12 different lines, by name or number"},
    {"relays", "lines", "lines = a, none",
     "[relays] lines: \"none\" is no line; allowed: none, or up to 12 different lines, by name or number"},
    {"relays", "lines", "lines = a,, b",
     "[relays] lines: \"\" has no name; allowed: none, or up to 12 different lines, by name or number"},
    {"relays", "max_on_ms", "max_on_ms = 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13",
     "[relays] max_on_ms: has 13 values; allowed: a whole number from 0 to 86400000 ms, or one for each relay"},
    {"relays", "max_on_ms", "max_on_ms = 5, 6",
     "[relays] max_on_ms: has 2 values; allowed: one, or one for each of the 12 relays in lines"},
    {"relays", "min_toggle_ms", "min_toggle_ms = 60001",
     "[relays] min_toggle_ms: \"60001\" is out of range; allowed: a whole number from 0 to 60000 ms, or one for each relay"},
    {"relays", "safe_mask", "safe_mask = 1000", "[relays] safe_mask: \"1000\" is out of range; allowed: hexadecimal 0 to FFF"},
    {"relays", "safe_mask", "safe_mask = 0x", "[relays] safe_mask: \"0x\" is not a mask; allowed: hexadecimal 0 to FFF"},
    {"inputs", "estop", "estop = A name that is longer than any line's",
     "[inputs] estop: \"A name that is longer than any line's\" is too long; allowed: none, or a name of at most 31 characters"},
    {"geometry", "zero_height_mm", "zero_height_mm = 600,5",
     "[geometry] zero_height_mm: \"600,5\" has a comma where a decimal point belongs; allowed: a number from 0 to 8000 mm, or "
     "mid-stroke"},
    {"geometry", "stroke_mm", "stroke_mm = 200,5",
     "[geometry] stroke_mm: \"200,5\" has a comma where a decimal point belongs; allowed: a number from 0.001 to 4000 mm, or one "
     "for "
     "each cylinder"},
    {"platform", "cycle_us", "cycle_us = 1,000",
     "[platform] cycle_us: \"1,000\" has a comma where a decimal point belongs; allowed: a whole number from 500 to 10000 us"},
    {"geometry", "base1_mm", "base1_mm = 1,5, 2,5, 0",
     "[geometry] base1_mm: \"1,5, 2,5, 0\" has a comma where a decimal point belongs; allowed: 3 numbers from -4000 to 4000 mm, "
     "separated by commas"},
    {"geometry", "base1_mm", "base1_mm = 1,5",
     "[geometry] base1_mm: has 2 values; allowed: 3 numbers from -4000 to 4000 mm, separated by commas"},
    {"geometry", "base1_mm", "base1_mm = 600 -3 0",
     "[geometry] base1_mm: \"600 -3 0\" lacks commas between its numbers; allowed: 3 numbers from -4000 to 4000 mm, separated by "
     "commas"},
    {"geometry", "base1_mm", "base1_mm = 600\xEF\xBC\x8C-3, 0",
     "[geometry] base1_mm: \"600\xEF\xBC\x8C-3, 0\" has a full-width comma; write a plain one; allowed: 3 numbers from -4000 to "
     "4000 "
     "mm, separated by commas"},
    {"roll", "max_deg", "max_deg = 14.5\xC2\xB0",
     "[roll] max_deg: \"14.5\xC2\xB0\" has a degree sign; write the number alone; allowed: a number from -90 to 90 deg, or "
     "suggested"},
    {"roll", "max_deg", "max_deg = \xEF\xBC\x91\xEF\xBC\x94",
     "[roll] max_deg: \"\xEF\xBC\x91\xEF\xBC\x94\" has full-width digits; write plain ones; allowed: a number from -90 to 90 "
     "deg, or suggested"},
    {"roll", "min_deg",
     "min_deg = \xE2\x88\x92"
     "14",
     "[roll] min_deg: \"\\xE2\\x88\\x92"
     "14\" has a typographic minus; write a plain -; allowed: a number from -90 to 90 deg, or suggested"},
    {"roll", "max_deg", "max_deg = 14 deg",
     "[roll] max_deg: \"14 deg\" has its unit behind it; write the number alone; allowed: a number from -90 to 90 deg, or "
     "suggested"},
    {"cylinders", "speed_mm_s", "speed_mm_s = 250mm/s",
     "[cylinders] speed_mm_s: \"250mm/s\" has its unit behind it; write the number alone; allowed: a number from 0.001 to 10000 "
     "mm/s"},
    {"cylinders", "speed_mm_s", "speed_mm_s = 250 # fast",
     "[cylinders] speed_mm_s: \"250 # fast\" has a # comment behind it; write it with a semicolon; allowed: a number from 0.001 "
     "to "
     "10000 mm/s"},
    {"inputs", "estop", "estop = \xC2\xB5",
     "[inputs] estop: \"\\xC2\\xB5\" is no name; allowed: none, or a name of at most 31 characters"},
    /* lines that are no pair */
    {"roll", "scale", "scale 1", "stray text \"scale 1\"; allowed: key = value, [section], ; comment"},
    {"roll", "scale", "scale ; = 1", "stray text \"scale\"; allowed: key = value, [section], ; comment"},
    {"roll", "scale", "  scale = 1", "indented line; allowed: sections and keys in the first column, values on one line"},
    {"roll", "scale", "\tscale = 1", "indented line; allowed: sections and keys in the first column, values on one line"},
    {"roll", "scale", "scale = 1\rsign = -1", "control character \\x0D; allowed: plain text (UTF-8)"},
    {"roll", "scale", "sc\xD0\xB0le = 1", "[roll] sc\\xD0\\xB0le: unknown key; did you mean scale?"},
    {"roll", "scale", "= 1",
     "[roll] : unknown key; [roll] takes sign scale offset_deg min_deg max_deg speed_deg_s accel_deg_s2 "
     "jerk_deg_s3 wrap"},
    {"roll", "scale", "margin_mm = 1", "[roll] margin_mm: unknown key; it belongs to [cylinders]"},
    {"roll", "scale", "[roll", "malformed section header; allowed: [name] and nothing behind it but a ; comment"},
};

static void test_load_spoilt_line_says_exactly_what_is_wrong(void)
{
    for (size_t i = 0; i < sizeof k_spoilt / sizeof k_spoilt[0]; i++) {
        const spoilt_t *spoilt = &k_spoilt[i];
        char expected[400];
        take_good_file();
        const unsigned at = find_key(spoilt->section, spoilt->key);
        snprintf(m_line[at], sizeof m_line[0], "%s", spoilt->line);
        const int count = load_lines();
        snprintf(expected, sizeof expected, "%s:%u: %s\n", FILE_NAME, at + 1, spoilt->message);
        if (spoilt->line[0] == '[') { /* the keys behind a refused header are skipped */
            TEST_ASSERT_GREATER_OR_EQUAL_INT(1, count);
            expect_start(expected);
            continue;
        }
        TEST_ASSERT_EQUAL_STRING(expected, m_errors);
        TEST_ASSERT_EQUAL_INT(1, count);
    }
}

static void test_load_all_errors_are_reported_at_once(void)
{
    take_good_file();
    set_key("roll", "min_deg", "x");
    set_key("udp", "port", "99999");
    set_key("drives", "driver", "modbus");
    delete_line(find_key("pose", "settled_extension_mm"));
    set_key("engage", "speed_mm_s", "9000");
    TEST_ASSERT_EQUAL_INT(5, load_lines());
    expect_contains(prefix(find_key("roll", "min_deg") + 1, "roll", "min_deg"));
    expect_contains(prefix(find_key("udp", "port") + 1, "udp", "port"));
    expect_contains(prefix(find_key("drives", "driver") + 1, "drives", "driver"));
    expect_contains(prefix(find_section("pose") + 1, "pose", "settled_extension_mm"));
    expect_contains(prefix(find_key("engage", "speed_mm_s") + 1, "engage", "speed_mm_s"));
}

static void test_load_unknown_section_suggests_and_its_keys_are_skipped(void)
{
    char expected[200];
    take_good_file();
    insert_line(m_lines, "[gometry]");
    insert_line(m_lines, "min_deg = nonsense");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    snprintf(expected, sizeof expected, "%s:%u: [gometry]: unknown section; did you mean [geometry]?\n", FILE_NAME, m_lines - 1);
    TEST_ASSERT_EQUAL_STRING(expected, m_errors);
    take_good_file();
    snprintf(m_line[find_section("can")], sizeof m_line[0], "[CAN]");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[CAN]: unknown section; did you mean [can]?\n");
}

static void test_load_section_without_keys_is_checked_too(void)
{
    take_good_file();
    insert_line(m_lines, "[no-such-section-anywhere]");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[no-such-section-anywhere]: unknown section; allowed: platform geometry pose roll");
}

static void test_load_section_name_beyond_inih_limit_is_unknown(void)
{
    take_good_file();
    insert_line(m_lines, "[drivesdrivesdrivesdrivesdrivesdrivesdrivesdrivesdrivesdrivesdrives]");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("]: unknown section; allowed: ");
}

static void test_load_section_given_again_names_the_first_line(void)
{
    char expected[200];
    take_good_file();
    insert_line(m_lines, "[roll] ; again");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    snprintf(expected, sizeof expected, "%s:%u: [roll]: section given again; allowed: once, and it is at line %u\n", FILE_NAME,
             m_lines, find_section("roll") + 1);
    TEST_ASSERT_EQUAL_STRING(expected, m_errors);
}

static void test_load_text_behind_a_section_header_is_an_error(void)
{
    take_good_file();
    snprintf(m_line[find_section("inputs")], sizeof m_line[0], "[inputs] estop = 5");
    TEST_ASSERT_GREATER_OR_EQUAL_INT(1, load_lines());
    expect_contains("malformed section header");
}

static void test_load_key_before_any_section_is_an_error(void)
{
    take_good_file();
    insert_line(0, "kind = hexapod");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    TEST_ASSERT_EQUAL_STRING(FILE_NAME ":1: a key before any section; allowed: [section] first\n", m_errors);
}

static void test_load_line_longer_than_inih_takes_is_an_error(void)
{
    char expected[200];
    for (unsigned length = 195; length < 205; length++) {
        take_good_file();
        const unsigned at = find_key("udp", "port");
        snprintf(m_line[at], sizeof m_line[0], "port =%*d", (int)length - 6, 1234);
        const int count = load_lines();
        TEST_ASSERT_EQUAL_INT(length > 197 ? 1 : 0, count);
        snprintf(expected, sizeof expected, "%s:%u: line of %u bytes; allowed: at most 197\n", FILE_NAME, at + 1u, length);
        TEST_ASSERT_EQUAL_STRING(length > 197 ? expected : "", m_errors);
    }
}

/* A line of Chinese has three bytes a character. */
static void test_load_comments_may_be_longer(void)
{
    char line[256];
    for (unsigned length = 195; length < 250; length++) {
        take_good_file();
        memset(line, 'x', sizeof line);
        line[0] = length % 2u == 0 ? ';' : '#';
        line[length] = '\0';
        insert_line(3, line);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
    }
}

static void test_load_line_of_exactly_the_limit_keeps_its_value(void)
{
    take_good_file();
    const unsigned at = find_key("udp", "port");
    snprintf(m_line[at], sizeof m_line[0], "port =%*d", 197 - 6, 1234);
    TEST_ASSERT_EQUAL_UINT(197, strlen(m_line[at]));
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    TEST_ASSERT_EQUAL_UINT16(1234, m_config.udp.port);
}

static void test_load_comments_blanks_crlf_and_bom_are_taken(void)
{
    config_t plain;
    take_good_file();
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    plain = m_config;
    static char text[TEXT_MAX * 3];
    size_t length = (size_t)snprintf(text, sizeof text, "\xEF\xBB\xBF");
    for (unsigned i = 0; i < m_lines; i++)
        length += (size_t)snprintf(text + length, sizeof text - length, "%s%s\r\n  ; indented comment\r\n\t\r\n# hash\r\n",
                                   m_line[i], m_line[i][0] == '\0' ? "" : "  ; a comment");
    const int bytes_errors = load_bytes(text, length);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, bytes_errors, m_errors);
    TEST_ASSERT_EQUAL_MEMORY(&plain, &m_config, sizeof plain);
}

static void test_load_last_line_without_newline_is_taken(void)
{
    take_good_file();
    (void)load_lines();
    m_text[strlen(m_text) - 1] = '\0';
    TEST_ASSERT_EQUAL_INT(0, load_text(m_text));
    strcat(m_text, "!");
    TEST_ASSERT_EQUAL_INT(1, load_text(m_text));
}

static void test_load_utf16_is_refused_once(void)
{
    TEST_ASSERT_EQUAL_INT(1, load_bytes("\xFF\xFE[\0p\0]\0\n\0a\0=\0b\0\n\0", 18));
    TEST_ASSERT_EQUAL_STRING(FILE_NAME ":1: the file is UTF-16; allowed: plain text (UTF-8)\n", m_errors);
}

static void test_load_missing_file_or_directory_is_one_error(void)
{
    TEST_ASSERT_EQUAL_INT(1, load_path("no/such/file.ini"));
    TEST_ASSERT_EQUAL_STRING("no/such/file.ini: cannot be opened: No such file or directory; allowed: a readable text file\n",
                             m_errors);
    TEST_ASSERT_EQUAL_INT(1, load_path("."));
    expect_start(".: cannot be read: ");
}

static void test_load_empty_file_reports_what_is_missing(void)
{
    TEST_ASSERT_GREATER_THAN_INT(10, load_text(""));
    expect_start(FILE_NAME ":1: [platform] kind: missing; allowed: hexapod | tripod | tripod-3rps\n");
    TEST_ASSERT_NULL_MESSAGE(strstr(m_errors, "base4_mm"), "asks for a hexapod's joints although the kind is unknown");
}

static void test_load_error_leaves_the_configuration_alone(void)
{
    config_t before;
    take_good_file();
    memset(&m_config, 0x5A, sizeof m_config);
    before = m_config;
    set_key("inputs", "reset", "x!");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    TEST_ASSERT_EQUAL_MEMORY(&before, &m_config, sizeof before);
}

/* ---- Keys that a platform does not have ---- */

static void test_load_axis_section_of_a_tripod_is_an_error(void)
{
    static const char *const sections[] = {"yaw", "x", "y"};
    for (unsigned i = 0; i < 3; i++) {
        char expected[200], header[16];
        read_all(platform_path("tripod.ini"), m_text, sizeof m_text);
        take_lines(m_text);
        snprintf(header, sizeof header, "[%s]", sections[i]);
        insert_line(m_lines, header);
        insert_line(m_lines, "sign = 1");
        TEST_ASSERT_EQUAL_INT(1, load_lines());
        snprintf(expected, sizeof expected,
                 "%s:%u: [%s]: a tripod has no such axis or cylinder; allowed: with kind = hexapod only\n", FILE_NAME,
                 m_lines - 1, sections[i]);
        TEST_ASSERT_EQUAL_STRING(expected, m_errors);
    }
}

static void test_load_fourth_joint_of_a_tripod_is_an_error(void)
{
    read_all(platform_path("tripod.ini"), m_text, sizeof m_text);
    take_lines(m_text);
    const unsigned at = find_section("geometry") + 1;
    insert_line(at, "base4_mm = 1, 2, 3");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    TEST_ASSERT_EQUAL_INT(
        0, strncmp(m_errors, prefix(at + 1, "geometry", "base4_mm"), strlen(prefix(at + 1, "geometry", "base4_mm"))));
    expect_contains("means nothing on this platform; allowed: with kind = hexapod only");
}

static void test_load_angle_keys_without_motor_are_errors(void)
{
    take_good_file();
    set_key("angle", "present", "no");
    TEST_ASSERT_EQUAL_INT(9 + 4 + 8 + 1 + 5, load_lines()); /* [angle], [can-raw], [cia402], the section of its list, [modbus] */
    expect_contains(prefix(find_key("angle", "speed_deg_s") + 1, "angle", "speed_deg_s"));
    expect_contains("means nothing on this platform; allowed: with [angle] present = yes only");
}

static void test_load_neutral_yaw_of_a_tripod_is_an_error(void)
{
    read_all(platform_path("tripod.ini"), m_text, sizeof m_text);
    take_lines(m_text);
    set_key("pose", "neutral", "0, 0, 2.5, 0, 0, 0");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[pose] neutral: yaw of 2.5 on a tripod; allowed: 0\n");
}

static void test_load_neutral_out_of_reach_is_an_error(void)
{
    take_good_file();
    set_key("pose", "neutral", "15, 15, 0, 0, 0, -60");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_start(prefix(find_key("pose", "neutral") + 1, "pose", "neutral"));
    expect_contains("allowed: within stroke and margin");
}

static void test_load_settled_extension_without_a_pose_is_an_error(void)
{
    read_all(platform_path("tripod.ini"), m_text, sizeof m_text);
    take_lines(m_text);
    set_key("geometry", "retracted_length_mm", "10"); /* with 6 mm more: shorter than the 30 mm between the circles of joints */
    set_key("geometry", "stroke_mm", "900");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_start(prefix(find_key("pose", "settled_extension_mm") + 1, "pose", "settled_extension_mm"));
    expect_contains("no pose of the plate has this extension; allowed: joints and lengths that fit together\n");
}

static void test_load_jerk_below_what_a_ramp_takes_names_the_least(void)
{
    char value[16];
    int least = 0;
    take_good_file();
    set_key("roll", "jerk_deg_s3", "2");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_start(prefix(find_key("roll", "jerk_deg_s3") + 1, "roll", "jerk_deg_s3"));
    const char *allowed = strstr(m_errors, "too small for this speed and a cycle of 1000 us; allowed: at least ");
    TEST_ASSERT_NOT_NULL_MESSAGE(allowed, m_errors);
    TEST_ASSERT_EQUAL_INT(1, sscanf(strstr(allowed, "at least "), "at least %d", &least));
    snprintf(value, sizeof value, "%d", least);
    set_key("roll", "jerk_deg_s3", value);
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    snprintf(value, sizeof value, "%d", least - 1);
    set_key("roll", "jerk_deg_s3", value);
    TEST_ASSERT_EQUAL_INT(1, load_lines());
}

static void test_load_neutral_counts_the_stroke_of_each_cylinder(void)
{
    take_good_file();
    set_key("pose", "neutral", "0, 0, 0, 0, 0, 100");
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    set_key("geometry", "stroke_mm", "200, 200, 200, 150, 200, 200");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[pose] neutral: needs an extension of ");
    expect_contains(" mm of cylinder 4; allowed: within stroke and margin\n");
}

static void test_load_hinges_that_do_not_fit_are_an_error(void)
{
    read_all(platform_path("tripod-rotation.ini"), m_text, sizeof m_text);
    take_lines(m_text);
    set_key("geometry", "plate2_mm", "-170, 200, 0");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[platform] kind: these joints do not make a tripod-3rps; allowed: joints at 0, 120 and 240 deg");
}

static void test_load_safe_mask_above_the_relays_is_an_error(void)
{
    take_good_file();
    set_key("relays", "lines", "7, 9");
    set_key("relays", "safe_mask", "7");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[relays] safe_mask: names relays above the 2 in lines; allowed: 0 to 3\n");
}

static void test_load_gpio_relays_need_lines_that_a_chip_can_be_found_by(void)
{
    static const struct {
        const char *chip, *lines, *error;
    } k_cases[] = {
        {"none", "GPIO17, GPIO27", ""},
        {"pinctrl-bcm2711", "17, 27, GPIO22", ""},
        {"none", "GPIO17, 27", "[relays] lines: 27 alone is no line; allowed: the name of a line, or its number with chip\n"},
        {"none", "none", "[relays] lines: driver gpio switches none; allowed: the lines of 1 to 12 relays\n"},
        {"a chip", "7, 07", "[relays] lines: 07 is relay 1 already; allowed: a line of its own for each\n"},
        {"gpiochip0", "7, 9",
         "[relays] chip: gpiochip0 is a number that changes; allowed: the chip's label (gpiodetect shows it)\n"},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        take_good_file();
        set_key("relays", "driver", "gpio");
        set_key("relays", "safe_mask", "0");
        set_key("relays", "chip", k_cases[i].chip);
        set_key("relays", "lines", k_cases[i].lines);
        TEST_ASSERT_EQUAL_INT_MESSAGE(k_cases[i].error[0] != '\0', load_lines(), m_errors);
        expect_contains(k_cases[i].error);
    }
}

static void test_load_healthy_pulse_needs_an_output_of_its_own(void)
{
    static const struct {
        const char *driver, *chip, *line, *relay, *toggle_ms, *relays, *error;
    } k_cases[] = {
        {"none", "none", "none", "0", "10", "gpio", ""},
        {"gpio", "none", "GPIO17", "0", "10", "gpio", ""},
        {"gpio", "another", "7", "0", "10", "gpio", ""},
        {"relay", "none", "none", "1", "10", "gpio", ""},
        {"relay", "none", "none", "1", "100", "modbus", ""},
        {"gpio", "none", "none", "0", "10", "gpio", "[healthy] line: missing; allowed: the output line of the pulse\n"},
        {"gpio", "none", "17", "0", "10", "gpio",
         "[healthy] line: 17 alone is no line; allowed: the name of a line, or its number with chip\n"},
        {"gpio", "a chip", "9", "0", "10", "gpio",
         "[healthy] line: line 9 is relay 2 already; allowed: a line of its own, or none\n"},
        {"gpio", "a chip", "12", "0", "10", "gpio",
         "[healthy] line: line 12 is [inputs] estop already; allowed: a line of its own\n"},
        {"gpio", "gpiochip1", "9", "0", "10", "gpio",
         "[healthy] chip: gpiochip1 is a number that changes; allowed: the chip's label (gpiodetect shows it)\n"},
        {"gpio", "none", "GPIO17", "1", "10", "gpio", "[healthy] relay: 1 is for driver = relay; allowed here: 0\n"},
        {"relay", "none", "none", "0", "10", "gpio",
         "[healthy] relay: 0 is none of the 2 in [relays] lines; allowed: the relay of the pulse\n"},
        {"relay", "none", "none", "3", "10", "gpio",
         "[healthy] relay: 3 is none of the 2 in [relays] lines; allowed: the relay of the pulse\n"},
        {"relay", "none", "none", "2", "10", "gpio",
         "[healthy] relay: 2 is closed by [relays] safe_mask; allowed: a relay that is not\n"},
        {"relay", "none", "none", "1", "99", "modbus",
         "[healthy] toggle_ms: 99 ms is too quick for a coil of a Modbus board; allowed: 100 to 1000 ms\n"},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        const bool is_modbus = strcmp(k_cases[i].relays, "modbus") == 0;
        take_good_file();
        set_key("relays", "driver", k_cases[i].relays);
        set_key("relays", "safe_mask", "2");
        set_key("relays", "chip", "a chip");
        set_key("relays", "lines", is_modbus ? "7, 8" : "7, 9");
        set_key("relays-modbus", "host", is_modbus ? "192.168.1.9" : "none");
        set_key("inputs", "driver", "gpio");
        set_key("inputs", "chip", "a chip");
        set_key("inputs", "estop", "12");
        set_key("healthy", "driver", k_cases[i].driver);
        set_key("healthy", "chip", k_cases[i].chip);
        set_key("healthy", "line", k_cases[i].line);
        set_key("healthy", "relay", k_cases[i].relay);
        set_key("healthy", "toggle_ms", k_cases[i].toggle_ms);
        TEST_ASSERT_EQUAL_INT_MESSAGE(k_cases[i].error[0] != '\0', load_lines(), m_errors);
        expect_contains(k_cases[i].error);
    }
}

static void test_load_relay_times_that_contradict_each_other_are_errors(void)
{
    take_good_file();
    set_key("relays", "lines", "7, 9");
    set_key("relays", "safe_mask", "2");
    set_key("relays", "max_on_ms", "400, 500");
    set_key("relays", "min_toggle_ms", "500, 0");
    TEST_ASSERT_EQUAL_INT(2, load_lines());
    expect_contains("[relays] max_on_ms: 400 ms is below min_toggle_ms of relay 1; allowed: 0, or at least 500 ms\n");
    expect_contains("[relays] max_on_ms: relay 2 is closed by safe_mask; allowed: 0 for it\n");
}

static void test_load_input_line_used_twice_is_an_error(void)
{
    take_good_file();
    set_key("inputs", "estop", "3");
    set_key("inputs", "reset", "3");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[inputs] reset: line 3 is estop already; allowed: a line of its own, or none\n");
}

static void test_load_gpio_inputs_need_lines_of_their_own_that_a_chip_can_be_found_by(void)
{
    static const struct {
        const char *chip, *estop, *enable, *reset, *engage, *error;
    } k_cases[] = {
        {"none", "GPIO17", "GPIO27", "none", "manual", ""},
        {"none", "none", "none", "GPIO17", "auto", ""},
        {"a chip", "17", "none", "GPIO27", "auto", ""},
        {"another", "9", "none", "7", "auto", ""},
        {"none", "17", "none", "none", "auto",
         "[inputs] estop: 17 alone is no line; allowed: the name of a line, or its number with chip\n"},
        {"none", "none", "none", "none", "auto",
         "[inputs] estop: driver gpio reads none; allowed: a line for estop, enable, reset or power\n"},
        {"a chip", "17", "none", "017", "auto",
         "[inputs] reset: line 017 is estop already; allowed: a line of its own, or none\n"},
        {"a chip", "17", "none", "09", "auto",
         "[inputs] reset: line 09 is relay 2 already; allowed: a line of its own, or none\n"},
        {"/dev/gpiochip0", "17", "none", "none", "auto",
         "[inputs] chip: /dev/gpiochip0 is a number that changes; allowed: the chip's label (gpiodetect shows it)\n"},
        {"a chip", "17", "18", "none", "auto",
         "[inputs] enable: engage = auto does not wait for a key; allowed: none, or engage = manual\n"},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        take_good_file();
        set_key("relays", "driver", "gpio");
        set_key("relays", "safe_mask", "0");
        set_key("relays", "chip", "a chip");
        set_key("relays", "lines", "7, 9");
        set_key("platform", "engage", k_cases[i].engage);
        set_key("inputs", "driver", "gpio");
        set_key("inputs", "chip", k_cases[i].chip);
        set_key("inputs", "estop", k_cases[i].estop);
        set_key("inputs", "enable", k_cases[i].enable);
        set_key("inputs", "reset", k_cases[i].reset);
        TEST_ASSERT_EQUAL_INT_MESSAGE(k_cases[i].error[0] != '\0', load_lines(), m_errors);
        expect_contains(k_cases[i].error);
    }
}

static void test_load_inputs_of_channels_and_supply_that_contradict_themselves_are_errors(void)
{
    static const struct {
        const char *estop, *estop2, *power, *engage, *error;
    } k_cases[] = {
        {"GPIO1", "GPIO2", "GPIO3", "manual", ""},
        {"none", "none", "GPIO3", "manual", ""},
        {"GPIO1", "GPIO2", "none", "auto", ""},
        {"none", "GPIO2", "none", "manual",
         "[inputs] estop2: there is no first channel; allowed: none, or a line for estop as well\n"},
        {"GPIO1", "GPIO1", "none", "manual",
         "[inputs] estop2: line GPIO1 is estop already; allowed: a line of its own, or none\n"},
        {"GPIO1", "GPIO2", "GPIO2", "manual",
         "[inputs] power: line GPIO2 is estop2 already; allowed: a line of its own, or none\n"},
        {"GPIO1", "none", "GPIO3", "auto",
         "[inputs] power: engage = auto does not wait for the supply; allowed: none, or engage = manual\n"},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        take_good_file();
        set_key("platform", "engage", k_cases[i].engage);
        set_key("inputs", "driver", "gpio");
        set_key("inputs", "estop", k_cases[i].estop);
        set_key("inputs", "estop2", k_cases[i].estop2);
        set_key("inputs", "power", k_cases[i].power);
        TEST_ASSERT_EQUAL_INT_MESSAGE(k_cases[i].error[0] != '\0', load_lines(), m_errors);
        expect_contains(k_cases[i].error);
    }
}

/* ---- Values ---- */

static void test_load_values_arrive_where_they_belong(void)
{
    take_good_file();
    set_key("platform", "cycle_us", "2000");
    set_key("geometry", "base2_mm", "415.913, 58.5, -1.25");
    set_key("geometry", "stroke_mm", "200, 201, 202, 203, 204, 205.5");
    set_key("roll", "sign", "-1");
    set_key("pitch", "scale", ".5");
    set_key("yaw", "offset_deg", "1.5e-3");
    set_key("y", "max_mm", "89.99999");
    set_key("z", "jerk_mm_s3", "2147483647");
    set_key("angle", "wrap", "shortest");
    set_key("udp", "bind", "::");
    set_key("udp", "group", "239.1.2.3%enp0s31f6.7");
    set_key("udp", "allow", "10.1.2.3, 192.168.7.0/24, fd00:1::/32");
    set_key("udp", "dialect", "lenient");
    set_key("udp", "stream", "balanced");
    set_key("udp", "silence_settle_ms", "3600000");
    set_key("control", "socket", "/tmp/h.sock");
    set_key("black-box", "directory", "/var/lib/heave");
    set_key("sim", "start_extension_mm", "12.5");
    set_key("sim", "homed", "no");
    set_key("relays", "lines", "17, GPIO27 , RELAY 3");
    set_key("relays", "active_low", "yes");
    set_key("relays", "safe_mask", "0x3");
    set_key("relays", "max_on_ms", "0, 0, 7000");
    set_key("relays", "min_toggle_ms", "250");
    set_key("inputs", "estop", "[E-STOP]");
    set_key("yaw", "wrap", "shortest");
    set_key("udp", "mask", "always");
    const int count = load_lines();
    TEST_ASSERT_EQUAL_STRING("", m_errors);
    TEST_ASSERT_EQUAL_INT(0, count);

    const settings_t *settings = &m_config.settings;
    TEST_ASSERT_EQUAL_UINT32(2000, settings->cycle_us);
    TEST_ASSERT_EQUAL_INT(ENGAGE_AUTO, settings->engage);
    TEST_ASSERT_EQUAL_INT32(27257274, settings->geometry.base_mm_q16[1][0]); /* 415.913 * 65536 = 27257274.4 */
    TEST_ASSERT_EQUAL_INT32(58 * 65536 + 32768, settings->geometry.base_mm_q16[1][1]);
    TEST_ASSERT_EQUAL_INT32(-81920, settings->geometry.base_mm_q16[1][2]);
    TEST_ASSERT_EQUAL_INT32(205 * 65536 + 32768, settings->stroke_mm_q16[5]);
    TEST_ASSERT_EQUAL_INT32(520 * 65536, settings->geometry.retracted_mm_q16[5]);
    TEST_ASSERT_EQUAL_INT8(-1, settings->axis[AXIS_ROLL].sign);
    TEST_ASSERT_EQUAL_INT8(1, settings->axis[AXIS_PITCH].sign);
    TEST_ASSERT_EQUAL_INT32(32768, settings->axis[AXIS_PITCH].scale_q16);
    TEST_ASSERT_EQUAL_INT32(98, settings->axis[AXIS_YAW].offset_q16); /* 98.304 */
    TEST_ASSERT_EQUAL_INT32(5898239, settings->axis[AXIS_Y].max_q16); /* 5898239.34 */
    TEST_ASSERT_EQUAL_INT32(2147483647, settings->axis[AXIS_Z].jerk);
    TEST_ASSERT_TRUE(settings->has_angle);
    TEST_ASSERT_EQUAL_INT(ANGLE_SHORTEST, settings->axis[AXIS_ANGLE].wrap);
    TEST_ASSERT_EQUAL_INT(ANGLE_AS_SENT, settings->axis[AXIS_ROLL].wrap);
    TEST_ASSERT_EQUAL_INT(ANGLE_SHORTEST, settings->axis[AXIS_YAW].wrap);
    TEST_ASSERT_EQUAL_INT(MASK_ALWAYS, settings->mask_policy);
    TEST_ASSERT_EQUAL_INT(FRAME_LENIENT, settings->dialect);
    TEST_ASSERT_EQUAL_INT(STREAM_BALANCED, settings->stream_style);
    TEST_ASSERT_EQUAL_UINT32(10000, settings->silence_hold_ms);
    TEST_ASSERT_EQUAL_UINT32(3600000, settings->silence_settle_ms);
    TEST_ASSERT_EQUAL_UINT8(3, settings->relays.count);
    TEST_ASSERT_EQUAL_HEX16(3, settings->relay_safe_mask);

    static const uint8_t v6[16] = {0xFD, 0, 0, 1};
    static const uint8_t v4[16] = {192, 168, 7, 0};
    TEST_ASSERT_EQUAL_STRING("::", m_config.udp.bind);
    TEST_ASSERT_EQUAL_STRING("239.1.2.3%enp0s31f6.7", m_config.udp.group);
    TEST_ASSERT_EQUAL_UINT8(3, m_config.udp.allow.count);
    TEST_ASSERT_EQUAL_UINT8(32, m_config.udp.allow.network[0].prefix);
    TEST_ASSERT_EQUAL_UINT8(24, m_config.udp.allow.network[1].prefix);
    TEST_ASSERT_EQUAL_MEMORY(v4, m_config.udp.allow.network[1].address, 16);
    TEST_ASSERT_FALSE(m_config.udp.allow.network[1].is_ipv6);
    TEST_ASSERT_TRUE(m_config.udp.allow.network[2].is_ipv6);
    TEST_ASSERT_EQUAL_MEMORY(v6, m_config.udp.allow.network[2].address, 16);
    TEST_ASSERT_EQUAL_STRING("/tmp/h.sock", m_config.control_socket);
    TEST_ASSERT_EQUAL_STRING("/var/lib/heave", m_config.black_box.directory);
    TEST_ASSERT_EQUAL_INT32(12 * 65536 + 32768, m_config.sim.start_extension_mm_q16);
    TEST_ASSERT_FALSE(m_config.sim.is_homed);
    TEST_ASSERT_EQUAL_STRING("RELAY 3", m_config.relays.lines.line[2].text);
    TEST_ASSERT_EQUAL_UINT32(0, settings->relays.max_on_ms[1]);
    TEST_ASSERT_EQUAL_UINT32(7000, settings->relays.max_on_ms[2]);
    TEST_ASSERT_EQUAL_UINT32(250, settings->relays.min_toggle_ms[2]);
    TEST_ASSERT_TRUE(m_config.relays.is_active_low);
    TEST_ASSERT_EQUAL_STRING("[E-STOP]", m_config.inputs.estop_line.text);
    TEST_ASSERT_EQUAL_STRING("", m_config.inputs.reset_line.text);
}

static void test_load_every_field_is_written_by_one_key_only(void)
{
    for (size_t i = 0; i < config_key_count; i++) {
        for (size_t k = i + 1; k < config_key_count; k++) {
            const config_key_t *a = &config_keys[i];
            const config_key_t *b = &config_keys[k];
            TEST_ASSERT_TRUE_MESSAGE(a->offset + a->size <= b->offset || b->offset + b->size <= a->offset, a->name);
            TEST_ASSERT_FALSE(strcmp(a->section, b->section) == 0 && strcmp(a->name, b->name) == 0);
        }
        TEST_ASSERT_GREATER_OR_EQUAL_INT(0, config_section_find(config_keys[i].section));
    }
}

static void test_load_defaults_stand_where_keys_are_left_out(void)
{
    read_all(platform_path("tripod.ini"), m_text, sizeof m_text);
    take_lines(m_text);
    delete_line(find_key("platform", "cycle_us"));
    delete_line(find_key("udp", "port"));
    delete_line(find_key("cylinders", "margin_mm"));
    delete_line(find_key("relays", "lines"));
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    TEST_ASSERT_EQUAL_UINT32(1000, m_config.settings.cycle_us);
    TEST_ASSERT_EQUAL_UINT16(9800, m_config.udp.port);
    TEST_ASSERT_EQUAL_INT32(2 * 65536, m_config.settings.margin_mm_q16);
    TEST_ASSERT_EQUAL_UINT8(0, m_config.settings.relays.count);
    TEST_ASSERT_EQUAL_INT(ENGAGE_MANUAL, m_config.settings.engage);
    TEST_ASSERT_EQUAL_STRING("/run/heave/heaved.sock", m_config.control_socket);
    TEST_ASSERT_EQUAL_INT32(CONFIG_NONE, m_config.sim.start_extension_mm_q16);
    TEST_ASSERT_TRUE(m_config.sim.is_homed);
    TEST_ASSERT_FALSE(m_config.settings.has_angle);
    TEST_ASSERT_EQUAL_INT32(0, m_config.settings.stroke_mm_q16[3]);
}

static void test_text_q16_reads_back_as_the_same_value(void)
{
    for (unsigned i = 0; i < 20000; i++) {
        const q16_t value_q16 =
            i < 2 ? (i == 0 ? INT32_MAX : INT32_MIN) : (q16_t)(random_below(UINT32_MAX) >> (random_below(20u)));
        config_text_t text;
        q16_t back_q16 = 0;
        config_text_clear(&text);
        config_text_add_q16(&text, value_q16);
        TEST_ASSERT_EQUAL_INT_MESSAGE(NUMBER_OK, number_parse(text.data, text.length, &back_q16), text.data);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(value_q16, back_q16, text.data);
        TEST_ASSERT_LESS_OR_EQUAL_UINT(13, text.length);
    }
}

static void test_text_add_beyond_its_room_is_cut(void)
{
    config_text_t text;
    config_text_clear(&text);
    for (unsigned i = 0; i < 100; i++)
        config_text_add(&text, "0123456789");
    TEST_ASSERT_EQUAL_UINT(sizeof text.data - 1, text.length);
    TEST_ASSERT_EQUAL_UINT(text.length, strlen(text.data));
}

/* ---- Dump ---- */

/* The dump of m_config loads to the same bytes. */
static void expect_round_trip(const char *what)
{
    static char text[TEXT_MAX];
    const config_t before = m_config;
    dump(&before, text, sizeof text);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(text), m_errors);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&before, &m_config, sizeof before, what);
}

static void test_dump_of_every_platform_loads_to_the_same(void)
{
    for (size_t i = 0; i < sizeof k_platforms / sizeof k_platforms[0]; i++) {
        load_platform(k_platforms[i]);
        expect_round_trip(k_platforms[i]);
    }
}

static void test_dump_of_unusual_values_loads_to_the_same(void)
{
    take_good_file();
    set_key("geometry", "retracted_length_mm", "520.00002, 519.9999, 520, 520, 520, 520.3333333");
    set_key("geometry", "mrp_mm", "-0.00002, 1e-3, 12.345678");
    set_key("roll", "scale", "0.333333");
    set_key("x", "sign", "-1");
    set_key("udp", "allow", "::1,0.0.0.0/0,fe80::/10,fd00::/32,10.0.0.0/8,2001:db8:0:0:0:0:0:1");
    set_key("udp", "silence_hold_ms", "0");
    set_key("sim", "start_extension_mm", "0");
    set_key("relays", "lines", "7, a b, P9_12");
    set_key("relays", "max_on_ms", "1, 2, 3");
    set_key("relays", "min_toggle_ms", "1");
    set_key("inputs", "enable", "0");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
    expect_round_trip("unusual values");
}

/* ---- What a configuration is recognised by ---- */

static void test_hash_is_of_the_values_and_of_nothing_else(void)
{
    char first[CONFIG_HASH_MAX];
    take_good_file();
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    memcpy(first, m_config.hash, sizeof first);
    TEST_ASSERT_EQUAL_UINT(CONFIG_HASH_MAX - 1u, strspn(first, "0123456789abcdef"));
    load_platform("demo-hexapod.ini"); /* the same with comments, without what is a default */
    TEST_ASSERT_EQUAL_STRING(first, m_config.hash);
    take_good_file();
    set_key("platform", "cycle_us", "1000 ; the same");
    set_key("platform", "engage", "manual");
    set_key("platform", "approved", "0123456789abcdef");
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    TEST_ASSERT_NOT_EQUAL(0, strcmp(first, m_config.hash)); /* engage */
    TEST_ASSERT_TRUE(config_is_unapproved(&m_config));
    memcpy(first, m_config.hash, sizeof first);
    memcpy(m_config.approved.text, first, sizeof first);
    config_hash(&m_config);
    TEST_ASSERT_EQUAL_STRING(first, m_config.hash); /* what was approved is no part of it */
    TEST_ASSERT_FALSE(config_is_unapproved(&m_config));
}

/* What somebody sees when it rises is of the machine; senders, limits and tuning are not. */
static void test_hash_of_the_machine_is_of_what_is_built(void)
{
    static const struct {
        const char *section, *key, *value;
        bool is_of_machine;
    } k_rows[] = {{"geometry", "stroke_mm", "201", true},
                  {"geometry", "base1_mm", "160.1, 40, 0", true},
                  {"inputs", "estop", "7", true},
                  {"cylinders", "speed_mm_s", "99", false},
                  {"udp", "port", "9801", false},
                  {"z", "max_mm", "9", false},
                  {"platform", "late_hold_cycles", "9", false},
                  {"service", "jog_mm_s", "4", false}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        char whole[CONFIG_HASH_MAX], machine[CONFIG_HASH_MAX];
        take_good_file();
        (void)load_lines();
        memcpy(whole, m_config.hash, sizeof whole);
        memcpy(machine, m_config.machine_hash, sizeof machine);
        set_key(k_rows[i].section, k_rows[i].key, k_rows[i].value);
        (void)load_lines();
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].is_of_machine, strcmp(machine, m_config.machine_hash) != 0, k_rows[i].key);
        TEST_ASSERT_NOT_EQUAL_MESSAGE(0, strcmp(whole, m_config.hash), k_rows[i].key);
    }
}

/* A default that is written in another way than its value is formatted would count: a key that a later version adds would then
 * change every machine. */
static void test_hash_of_the_machine_knows_every_default(void)
{
    static config_t config;
    take_good_file();
    (void)load_lines();
    config = m_config;
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        const config_section_t *section = &config_sections[config_section_find(key->section)];
        config_text_t text, why;
        unsigned count = 0;
        config_text_clear(&why);
        if (!section->is_of_machine || key->fallback == NULL) {
            continue;
        }
        TEST_ASSERT_TRUE_MESSAGE(config_value_parse(key, key->fallback, &config, &count, &why), why.data);
        config_text_clear(&text);
        config_value_format(key, &config, &text);
        const bool is_old = strcmp(key->name, "nodes") == 0 || strcmp(key->name, "units") == 0; /* hexadecimal, and always so */
        TEST_ASSERT_EQUAL_MESSAGE(!is_old, strcmp(key->fallback, text.data) == 0, key->name);
    }
}

static void test_hash_changes_with_every_number(void)
{
    unsigned numbers = 0;
    load_platform("demo-hexapod.ini");
    const config_t good = m_config;
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *key = &config_keys[i];
        const bool is_number =
            key->type == &config_type_decimal || key->type == &config_type_integer || key->type == &config_type_mask;
        if (is_number && config_is_applicable(key->needs, &good)) {
            m_config = good;
            ((uint8_t *)&m_config)[key->offset] ^= 1;
            config_hash(&m_config);
            TEST_ASSERT_NOT_EQUAL_MESSAGE(0, strcmp(good.hash, m_config.hash), key->name);
            numbers++;
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(100, numbers);
}

static void test_load_approved_has_to_be_a_hash_and_somebody_to_wait_for(void)
{
    take_good_file();
    set_key("platform", "approved", "0123456789ABCDEF");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[platform] approved: 0123456789ABCDEF is no hash; allowed: none, or the 16 digits that --check shows\n");
    take_good_file();
    set_key("platform", "approved", "0123456789abcdef");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[platform] approved: engage = auto waits for nobody to look at it; allowed: none, or engage = manual\n");
}

static void test_load_daily_selftest_has_to_have_somebody_to_make_it(void)
{
    take_good_file();
    set_key("platform", "engage", "manual");
    set_key("service", "selftest", "daily");
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    take_good_file();
    set_key("service", "selftest", "daily");
    TEST_ASSERT_EQUAL_INT(1, load_lines());
    expect_contains("[service] selftest: engage = auto waits for nobody to make it; allowed: none, or engage = manual\n");
}

static void test_reload_of_another_configuration_than_the_approved_one_is_refused(void)
{
    char line[128];
    take_good_file();
    set_key("platform", "engage", "manual");
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    snprintf(line, sizeof line, "%s", m_config.hash);
    set_key("platform", "approved", line);
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    config_t running = m_config;
    TEST_ASSERT_EQUAL_INT(0, reload_file(&running, stderr));
    set_key("udp", "silence_hold_ms", "777");
    TEST_ASSERT_EQUAL_INT(0, load_lines()); /* it may be loaded, to be looked at */
    TEST_ASSERT_EQUAL_INT(1, reload(&running));
    snprintf(line, sizeof line, " is not this configuration; allowed: %s, once somebody has approved it\n", m_config.hash);
    expect_contains(line);
    TEST_ASSERT_TRUE(running.settings.silence_hold_ms != 777);
    snprintf(line, sizeof line, "%s", m_config.hash);
    set_key("platform", "approved", line);
    TEST_ASSERT_EQUAL_INT(0, load_lines());
    TEST_ASSERT_EQUAL_INT(0, reload(&running));
    TEST_ASSERT_EQUAL_UINT32(777, running.settings.silence_hold_ms);
    TEST_ASSERT_EQUAL_STRING(m_config.hash, running.hash);
    TEST_ASSERT_FALSE(config_is_unapproved(&running));
}

static void test_dump_names_every_key_with_unit_range_and_help(void)
{
    static char text[TEXT_MAX];
    load_platform("tripod.ini");
    dump(&m_config, text, sizeof text);
    for (size_t i = 0; i < config_key_count; i++) {
        config_text_t allowed;
        config_text_clear(&allowed);
        config_value_allowed(&config_keys[i], &allowed);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, config_keys[i].name), config_keys[i].name);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, config_keys[i].help), config_keys[i].name);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, allowed.data), config_keys[i].name);
    }
}

static void test_write_reference_has_a_row_for_every_key(void)
{
    static char text[TEXT_MAX];
    unsigned rows = 0;
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    config_write_reference(file);
    rewind(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    for (const char *at = text; (at = strstr(at, "\n| `")) != NULL; at++)
        rows++;
    TEST_ASSERT_EQUAL_UINT(config_key_count, rows);
}

/* ---- Random files ---- */

/* One line per error, each with the file's name; what loads survives its dump. */
static void expect_sane(int count)
{
    int lines = 0;
    for (const char *at = m_errors; *at != '\0'; at = strchr(at, '\n') + 1) {
        TEST_ASSERT_EQUAL_INT(0, strncmp(at, FILE_NAME ":", strlen(FILE_NAME) + 1));
        lines++;
    }
    TEST_ASSERT_EQUAL_INT(count, lines);
    if (count == 0)
        expect_round_trip("random file");
}

static void test_load_random_bytes_only_give_errors(void)
{
    static const char letters[] = "[]=:;#, \t\r\n\"0123456789.-eabcdefghijklmnopqrstuvwxyz_";
    static char bytes[1500];
    for (unsigned run = 0; run < 400; run++) {
        const size_t length = random_below(sizeof bytes);
        for (size_t i = 0; i < length; i++)
            bytes[i] = run % 2 == 0 ? (char)random_below(UINT32_MAX) : letters[random_below(sizeof letters - 1)];
        const int count = load_bytes(bytes, length);
        TEST_ASSERT_GREATER_THAN_INT(0, count);
        expect_sane(count);
    }
}

static void test_load_good_files_with_random_damage_give_errors_or_load(void)
{
    static char good[TEXT_MAX];
    static char text[TEXT_MAX + 64];
    unsigned loaded = 0;
    for (unsigned run = 0; run < 600; run++) {
        const size_t length = read_all(platform_path(k_platforms[run % 5u]), good, sizeof good);
        memcpy(text, good, length);
        for (unsigned hits = random_below(4u) + 1u; hits > 0; hits--) {
            const size_t at = random_below((uint32_t)length);
            const size_t from = random_below((uint32_t)length);
            const size_t size = random_below(30u);
            switch (random_below(3u)) {
            case 0:
                text[at] = (char)random_below(UINT32_MAX);
                break;
            case 1:
                text[at] = good[from];
                break;
            case 2:
                memmove(text + at, good + from, size < length - at && size < length - from ? size : 0);
                break;
            }
        }
        const int count = load_bytes(text, length);
        loaded += count == 0;
        expect_sane(count);
    }
    TEST_ASSERT_GREATER_THAN(0, loaded); /* damage in a comment */
    TEST_ASSERT_LESS_THAN(600, loaded);
}

/* ---- The ready-made platforms, by a model of their own ---- */

static double from_q16(q16_t value_q16)
{
    return value_q16 / 65536.0;
}

/* Extension of a cylinder in double precision, by the definition; hexapods and tripods with a guide. */
static double model_extension(const settings_t *settings, const double pose[6], unsigned cylinder)
{
    const double to_rad = acos(-1.0) / 180.0;
    const double cr = cos(pose[0] * to_rad), sr = sin(pose[0] * to_rad), cp = cos(pose[1] * to_rad), sp = sin(pose[1] * to_rad);
    const double cy = cos(pose[2] * to_rad), sy = sin(pose[2] * to_rad);
    const double rotation[3][3] = {{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
                                   {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr},
                                   {-sp, cp * sr, cp * cr}};
    double sum = 0;
    for (unsigned row = 0; row < 3; row++) {
        const kin_geometry_t *geometry = &settings->geometry;
        double joint =
            pose[3 + row] + from_q16(geometry->mrp_mm_q16[row]) + (row == 2 ? from_q16(geometry->zero_height_mm_q16) : 0);
        for (unsigned i = 0; i < 3; i++)
            joint += rotation[row][i] * (from_q16(geometry->plate_mm_q16[cylinder][i]) - from_q16(geometry->mrp_mm_q16[i]));
        const double difference = joint - from_q16(geometry->base_mm_q16[cylinder][row]);
        sum += difference * difference;
    }
    return sqrt(sum) - from_q16(settings->geometry.retracted_mm_q16[cylinder]);
}

/* The examples of the vendor's document as poses. */
static const double k_examples[][6] = {
    {5.5, 3, 0, 0, 0, 20},   {12.3, 2.5, 0, 0, 0, 50}, {12, 2, 0, 0, 0, 3},
    {5, 6, 0, 5.5, 3.0, 20}, {2.5, 3.5, 6, 10, 5, 40}, {3.5, 1.5, 12, 8, 5, 30},
};

static void expect_reachable(const double pose[6], unsigned cylinders, double tolerance_mm)
{
    const settings_t *settings = &m_config.settings;
    for (unsigned axis = 0; axis < 6; axis++) {
        const bool is_free = cylinders == 6 || axis == AXIS_ROLL || axis == AXIS_PITCH || axis == AXIS_Z;
        if (is_free &&
            (pose[axis] < from_q16(settings->axis[axis].min_q16) || pose[axis] > from_q16(settings->axis[axis].max_q16)))
            TEST_FAIL_MESSAGE("outside the limits of an axis");
    }
    for (unsigned i = 0; i < cylinders; i++) {
        const double extension = model_extension(settings, pose, i);
        TEST_ASSERT_TRUE(extension >= from_q16(settings->margin_mm_q16) - tolerance_mm);
        TEST_ASSERT_TRUE(extension <= from_q16(settings->stroke_mm_q16[i]) - from_q16(settings->margin_mm_q16) + tolerance_mm);
    }
}

static void test_platforms_reach_the_examples_of_the_document(void)
{
    load_platform("demo-hexapod.ini");
    for (unsigned i = 0; i < 6; i++)
        expect_reachable(k_examples[i], 6, 0);
    load_platform("tripod.ini");
    for (unsigned i = 0; i < 3; i++)
        expect_reachable(k_examples[i], 3, 0);
}

static void test_demo_hexapod_takes_the_cylinder_examples_of_the_document(void)
{
    static const double examples[][6] = {{55, 33, 25, 20, 20, 50}, {12.5, 3.5, 16, 10, 15, 40}, {3.5, 1.5, 12, 8, 5, 30}};
    kin_t kin;
    load_platform("demo-hexapod.ini");
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&kin, &m_config.settings.geometry));
    for (unsigned i = 0; i < 3; i++) {
        const pose_t guess = {{0}};
        pose_t pose;
        q32_t extension_q32[6];
        double values[6];
        for (unsigned c = 0; c < 6; c++)
            extension_q32[c] = (q32_t)(examples[i][c] * 4294967296.0);
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&kin, extension_q32, &guess, &pose, NULL));
        for (unsigned axis = 0; axis < 6; axis++)
            values[axis] = (double)pose.axis_q32[axis] / 4294967296.0;
        expect_reachable(values, 6, 0);
    }
}

static void test_demo_hexapod_has_what_every_frame_needs(void)
{
    load_platform("demo-hexapod.ini");
    TEST_ASSERT_EQUAL_INT(KIN_HEXAPOD, m_config.settings.geometry.kind);
    TEST_ASSERT_TRUE(m_config.settings.has_angle);
    TEST_ASSERT_EQUAL_INT(ENGAGE_AUTO, m_config.settings.engage);
    TEST_ASSERT_EQUAL_UINT8(12, m_config.settings.relays.count);
    TEST_ASSERT_EQUAL_UINT16(9800, m_config.udp.port);
    TEST_ASSERT_EQUAL_STRING("127.0.0.1", m_config.udp.bind);
    TEST_ASSERT_EQUAL_STRING("", m_config.udp.group);
}

static void test_hexapod_435_puts_the_senders_lowest_and_centre_where_it_says(void)
{
    const double lowest[6] = {0, 0, 0, 0, 0, -100}, centre[6] = {0};
    load_platform("hexapod-435-300.ini");
    const axis_settings_t *z = &m_config.settings.axis[AXIS_Z];
    TEST_ASSERT_EQUAL_INT32(-100 * 65536, z->offset_q16); /* sent 0 is the lowest, sent 100 is pose zero */
    TEST_ASSERT_EQUAL_INT32(-100 * 65536, z->min_q16);
    expect_reachable(lowest, 6, 0);
    expect_reachable(centre, 6, 0);
    for (unsigned i = 0; i < 6; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.5, from_q16(m_config.settings.settled_extension_mm_q16),
                                  model_extension(&m_config.settings, lowest, i));
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 435.0,
                                  hypot(from_q16(m_config.settings.geometry.plate_mm_q16[i][0]),
                                        from_q16(m_config.settings.geometry.plate_mm_q16[i][1])));
    }
}

/* ---- Report ---- */

static int report(char *text, size_t capacity)
{
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    const int warnings = report_write(&m_config, 12345, file);
    rewind(file);
    text[fread(text, 1, capacity - 1, file)] = '\0';
    fclose(file);
    return warnings;
}

static void test_check_report_of_every_platform_has_no_warning(void)
{
    static char text[TEXT_MAX];
    for (size_t i = 0; i < sizeof k_platforms / sizeof k_platforms[0]; i++) {
        load_platform(k_platforms[i]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, report(text, sizeof text), text);
        TEST_ASSERT_NULL(strstr(text, "warning"));
        TEST_ASSERT_NOT_NULL(strstr(text, "12345 bytes"));
    }
}

static void expect_seen_from(const char *expected)
{
    static char text[TEXT_MAX];
    (void)report(text, sizeof text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, expected), text);
}

/* A drawing of hexapod-400 has cylinders 1 and 2 at the front, 8 degrees to each side, and then clockwise by 60 degrees. */
static void test_check_report_says_where_the_cylinders_are(void)
{
    load_platform("hexapod-400.ini");
    expect_seen_from("front between 1 and 2, right at cylinder 3, rear between 4 and 5, left at cylinder 6\n");
    for (unsigned i = 0; i < 6; i++) { /* a quarter turn: what was at the front is at the right */
        q16_t *const joint[] = {m_config.settings.geometry.base_mm_q16[i], m_config.settings.geometry.plate_mm_q16[i]};
        for (unsigned k = 0; k < 2; k++) {
            const q16_t x_q16 = joint[k][0];
            joint[k][0] = -joint[k][1];
            joint[k][1] = x_q16;
        }
    }
    expect_seen_from("front at cylinder 6, right between 1 and 2, rear at cylinder 3, left between 4 and 5\n");
    load_platform("tripod.ini");
    expect_seen_from("front at cylinder 1, right between 1 and 2, rear between 2 and 3, left between 1 and 3\n");
}

static void test_check_report_notes_what_is_easily_forgotten(void)
{
    static char text[TEXT_MAX];
    static const char k_local[] = "note: [udp] bind: heaved hears senders on this machine only";
    static const char k_estop[] = "note: [inputs] estop: heaved reads no e-stop";
    load_platform("hexapod-cia402.ini");
    TEST_ASSERT_EQUAL_INT(0, report(text, sizeof text));
    TEST_ASSERT_NOT_NULL(strstr(text, k_local));
    TEST_ASSERT_NOT_NULL(strstr(text, k_estop));
    strcpy(m_config.inputs.estop_line.text, "17");
    strcpy(m_config.udp.bind, "192.168.1.5");
    (void)report(text, sizeof text);
    TEST_ASSERT_NULL(strstr(text, "note:"));
    load_platform("hexapod-400.ini"); /* nothing moves */
    TEST_ASSERT_EQUAL_INT(0, report(text, sizeof text));
    TEST_ASSERT_NULL(strstr(text, k_estop));
}

/* Where the report says that a cylinder ends an axis, the model has that cylinder at an end of its stroke. */
static void expect_edge(unsigned axis, double value, unsigned cylinder)
{
    double pose[6] = {0};
    pose[axis] = value;
    const double extension = model_extension(&m_config.settings, pose, cylinder - 1);
    const double margin = from_q16(m_config.settings.margin_mm_q16);
    const double top = from_q16(m_config.settings.stroke_mm_q16[cylinder - 1]) - margin;
    TEST_ASSERT_TRUE(fabs(extension - margin) < 0.02 || fabs(extension - top) < 0.02);
    expect_reachable(pose, 6, 0.02); /* and no other one is beyond */
}

static void test_check_report_reach_is_where_a_cylinder_ends(void)
{
    static const char *const limits[][2] = {{"-60", "60"},   {"-60", "60"},   {"-90", "90"},
                                            {"-400", "400"}, {"-400", "400"}, {"-400", "400"}};
    static char text[TEXT_MAX];
    take_good_file();
    for (unsigned axis = 0; axis < 6; axis++) {
        set_key(config_axis_section[axis], axis < 3 ? "min_deg" : "min_mm", limits[axis][0]);
        set_key(config_axis_section[axis], axis < 3 ? "max_deg" : "max_mm", limits[axis][1]);
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
    TEST_ASSERT_EQUAL_INT_MESSAGE(6, report(text, sizeof text), text); /* one warning for each axis */
    for (unsigned axis = 0; axis < 6; axis++) {
        char start[16];
        double low = 0, high = 0;
        unsigned low_cylinder = 0, high_cylinder = 0;
        snprintf(start, sizeof start, "\n  %-6s ", config_axis_section[axis]);
        const char *row = strstr(text, start);
        TEST_ASSERT_NOT_NULL_MESSAGE(row, start);
        TEST_ASSERT_EQUAL_INT_MESSAGE(4,
                                      sscanf(row + strlen(start), "%lf to %lf %*s ends at cylinder %u and cylinder %u", &low,
                                             &high, &low_cylinder, &high_cylinder),
                                      row);
        expect_edge(axis, low, low_cylinder);
        expect_edge(axis, high, high_cylinder);
    }
}

static void test_check_report_worst_cylinder_speed_is_not_below_that_at_neutral(void)
{
    static char text[TEXT_MAX];
    load_platform("demo-hexapod.ini");
    (void)report(text, sizeof text);
    double worst_sum = 0;
    for (unsigned i = 0; i < 6; i++) {
        double sum = 0;
        for (unsigned axis = 0; axis < 6; axis++) {
            double above[6] = {0}, below[6] = {0};
            above[axis] = 1e-4;
            below[axis] = -1e-4;
            sum += fabs(model_extension(&m_config.settings, above, i) - model_extension(&m_config.settings, below, i)) / 2e-4 *
                   from_q16(m_config.settings.axis[axis].speed_q16);
        }
        worst_sum = sum > worst_sum ? sum : worst_sum;
    }
    double reported = 0;
    const char *row = strstr(text, "worst cylinder speed");
    TEST_ASSERT_NOT_NULL(row);
    TEST_ASSERT_EQUAL_INT(1, sscanf(row, "worst cylinder speed %lf", &reported));
    TEST_ASSERT_TRUE(reported >= worst_sum - 0.1);
    TEST_ASSERT_TRUE(reported <= 2 * worst_sum);
}

static void test_check_report_warns_of_what_the_limits_do_not_allow(void)
{
    static char text[TEXT_MAX];
    take_good_file();
    set_key("roll", "accel_deg_s2", "2000");
    set_key("pitch", "speed_deg_s", "90");
    set_key("yaw", "min_deg", "-120"); /* one end beyond the reach is enough */
    set_key("udp", "bind", "0.0.0.0");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
    TEST_ASSERT_EQUAL_INT_MESSAGE(4, report(text, sizeof text), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "warning: [roll] the acceleration in force is 489.9 of 2000.0 deg/s^2"),
                                 text); /* sqrt(40 * 6000) */
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "warning: [pitch] its speed alone asks a cylinder for "), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "warning: [yaw] limits -120.000 to 25.000 deg go beyond the reach"), text);
    TEST_ASSERT_NOT_NULL(strstr(text, "warning: [udp] bind and allow let every machine of the network move the platform"));
}

/* ---- Sizes in place of joints ---- */

/* The good file with its joints taken out. */
static void take_file_without_joints(const char *platform, unsigned cylinders)
{
    load_platform(platform);
    dump(&m_config, m_text, sizeof m_text);
    take_lines(m_text);
    for (unsigned i = 1; i <= cylinders; i++) {
        char key[20];
        snprintf(key, sizeof key, "base%u_mm", i);
        delete_line(find_key("geometry", key));
        snprintf(key, sizeof key, "plate%u_mm", i);
        delete_line(find_key("geometry", key));
    }
}

static void expect_joints(const kin_geometry_t *expected, unsigned cylinders, double tolerance_mm)
{
    const kin_geometry_t *found = &m_config.settings.geometry;
    for (unsigned i = 0; i < cylinders; i++) {
        for (unsigned k = 0; k < 3; k++) {
            TEST_ASSERT_DOUBLE_WITHIN(tolerance_mm, from_q16(expected->base_mm_q16[i][k]), from_q16(found->base_mm_q16[i][k]));
            TEST_ASSERT_DOUBLE_WITHIN(tolerance_mm, from_q16(expected->plate_mm_q16[i][k]), from_q16(found->plate_mm_q16[i][k]));
        }
    }
}

/* The ready-made platforms were written by somebody else, joint by joint, from the sizes in their comments. */
static void test_load_sizes_give_the_joints_of_the_ready_made_platforms(void)
{
    static const struct {
        const char *platform;
        unsigned cylinders;
        const char *base, *base_spread, *plate, *plate_spread;
    } k_rows[] = {
        {"hexapod-400.ini", 6, "1100", "16", "900", "18"},        {"demo-hexapod.ini", 6, "420", "16", "300", "20"},
        {"hexapod-435-300.ini", 6, "435", "20", "435", "20"},     {"tripod.ini", 3, "330", "none", "300", "none"},
        {"tripod-rotation.ini", 3, "380", "none", "340", "none"},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        take_file_without_joints(k_rows[i].platform, k_rows[i].cylinders);
        const kin_geometry_t expected = m_config.settings.geometry;
        set_key("geometry", "base_radius_mm", k_rows[i].base);
        set_key("geometry", "plate_radius_mm", k_rows[i].plate);
        if (k_rows[i].cylinders == 6) {
            set_key("geometry", "base_spread_deg", k_rows[i].base_spread);
            set_key("geometry", "plate_spread_deg", k_rows[i].plate_spread);
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
        expect_joints(&expected, k_rows[i].cylinders, 0.006);
    }
}

/* By a double-precision model, at any turn and spread; and the dump has joints alone, which load to the same. */
static void test_load_sizes_agree_with_a_model_and_are_dumped_as_joints(void)
{
    for (unsigned run = 0; run < 60; run++) {
        const double turn = (int)(random_below(3600)) / 10.0 - 180, spread = 4 + random_below(40);
        char text[20];
        take_file_without_joints("hexapod-400.ini", 6);
        set_key("platform", "kind", "hexapod");
        set_key("geometry", "base_radius_mm", "1100");
        set_key("geometry", "base_spread_deg", "16");
        set_key("geometry", "plate_radius_mm", "900");
        snprintf(text, sizeof text, "%.1f", turn);
        set_key("geometry", "base_turn_deg", text);
        set_key("geometry", "plate_turn_deg", text);
        snprintf(text, sizeof text, "%.0f", spread);
        set_key("geometry", "plate_spread_deg", text);
        set_key("geometry", "zero_height_mm", "mid-stroke");
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
        for (unsigned i = 0; i < 6; i++) {
            const double base = turn + 120.0 * (i / 2) + (i % 2 == 0 ? -8 : 8);
            const double plate = turn - 60 + 120.0 * ((i + 1) / 2) + ((i + 1) % 2 == 0 ? -spread / 2 : spread / 2);
            const kin_geometry_t *found = &m_config.settings.geometry;
            TEST_ASSERT_DOUBLE_WITHIN(0.0005, 1100 * cos(base * 3.14159265358979 / 180), from_q16(found->base_mm_q16[i][0]));
            TEST_ASSERT_DOUBLE_WITHIN(0.0005, 1100 * sin(base * 3.14159265358979 / 180), from_q16(found->base_mm_q16[i][1]));
            TEST_ASSERT_DOUBLE_WITHIN(0.0005, 900 * cos(plate * 3.14159265358979 / 180), from_q16(found->plate_mm_q16[i][0]));
            TEST_ASSERT_DOUBLE_WITHIN(0.0005, 900 * sin(plate * 3.14159265358979 / 180), from_q16(found->plate_mm_q16[i][1]));
            TEST_ASSERT_DOUBLE_WITHIN(0.001, from_q16(m_config.settings.stroke_mm_q16[i]) / 2,
                                      model_extension(&m_config.settings, (const double[6]){0}, i));
        }
        const kin_geometry_t before = m_config.settings.geometry;
        dump(&m_config, m_text, sizeof m_text);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_text(m_text), m_errors);
        expect_joints(&before, 6, 0);
    }
}

static void expect_sizes_error(const char *key, const char *line, const char *message)
{
    take_file_without_joints("hexapod-400.ini", 6);
    set_key("geometry", "base_radius_mm", "1100");
    set_key("geometry", "base_spread_deg", "16");
    set_key("geometry", "plate_radius_mm", "900");
    set_key("geometry", "plate_spread_deg", "18");
    insert_line(find_key("geometry", key) + 1, line);
    if (strncmp(line, key, strlen(key)) == 0)
        delete_line(find_key("geometry", key));
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), m_errors);
    expect_contains(message);
}

static void test_load_sizes_that_say_too_much_or_too_little_are_one_error(void)
{
    char message[160];
    expect_sizes_error(
        "base_spread_deg", "base_spread_deg = none",
        "[geometry] base_spread_deg: missing beside base_radius_mm; allowed: the angle between the two joints of a pair");
    expect_sizes_error("base_radius_mm", "base_radius_mm = 4001",
                       "[geometry] base_radius_mm: \"4001\" is out of range; allowed: ");
    expect_sizes_error("plate_turn_deg", "plate_turn_deg = right",
                       "[geometry] plate_turn_deg: \"right\" is not a number; allowed: ");
    take_file_without_joints("hexapod-400.ini", 6);
    set_key("geometry", "base_radius_mm", "1100");
    set_key("geometry", "base_spread_deg", "16");
    set_key("geometry", "plate_radius_mm", "900");
    set_key("geometry", "plate_spread_deg", "18");
    insert_line(find_key("geometry", "base_radius_mm"), "plate3_mm = 322.531, 840.222, 0");
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), m_errors);
    snprintf(message, sizeof message,
             "[geometry] plate_radius_mm: plate3_mm says where joints are, at line %u; allowed: joints or sizes, not both",
             find_key("geometry", "plate3_mm") + 1);
    expect_contains(message);
    take_good_file();
    set_key("geometry", "zero_height_mm", "mid-stroke");
    set_key("geometry", "retracted_length_mm", "11");
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), m_errors);
    expect_contains("[geometry] zero_height_mm: at no height are the cylinders half way out; allowed: ");
    take_good_file();
    set_key("geometry", "plate_turn_deg", "5");
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, load_lines(), m_errors);
    expect_contains("[geometry] plate_turn_deg: means nothing without plate_radius_mm; allowed: with it");
}

/* ---- A file to fill in ---- */

/* What a person would write behind a key that has no value yet. */
static const char *answer_of(const char *key)
{
    static const char *const k_answers[][2] = {
        {"base_radius_mm", "420"},
        {"base_spread_deg", "16"},
        {"plate_radius_mm", "300"},
        {"plate_spread_deg", "20"},
        {"retracted_length_mm", "520"},
        {"stroke_mm", "200"},
        {"settled_extension_mm", "5"},
        {"speed_mm_s", "300"},
        {"accel_mm_s2", "2000"},
        {"jerk_mm_s3", "40000"},
        {"lead_mm", "5"},
        {"counts_per_turn", "10000"},
        {"command_id", "0x601"},
        {"hosts", "192.168.7.11"},
    };
    for (size_t i = 0; i < sizeof k_answers / sizeof k_answers[0]; i++) {
        if (strcmp(k_answers[i][0], key) == 0)
            return k_answers[i][1];
    }
    return "none"; /* frames and registers are the drive's */
}

/* Fills in the template; returns the errors that are left. */
static int load_filled_template(const char *kind, const char *driver)
{
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_NULL(config_write_template(kind, driver, file));
    rewind(file);
    m_text[fread(m_text, 1, sizeof m_text - 1, file)] = '\0';
    fclose(file);
    take_lines(m_text);
    for (unsigned i = 0; i < m_lines; i++) {
        const size_t length = strlen(m_line[i]);
        if (length > 2 && strcmp(&m_line[i][length - 2], " =") == 0 && m_line[i][0] != ';') {
            char key[64];
            snprintf(key, sizeof key, "%.*s", (int)length - 2, m_line[i]);
            snprintf(m_line[i], sizeof m_line[0], "%s = %s", key, answer_of(key));
        }
    }
    return load_lines();
}

static void test_template_filled_in_is_a_platform(void)
{
    static const char *const k_kinds[] = {"hexapod", "tripod", "tripod-3rps"};
    for (unsigned k = 0; k < 3; k++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_filled_template(k_kinds[k], "sim"), m_errors);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_filled_template(k_kinds[k], "cia402"), m_errors);
        TEST_ASSERT_EQUAL_INT32(2000, m_config.cia402.counts_per_mm.num[0] / m_config.cia402.counts_per_mm.den[0]);
        TEST_ASSERT_GREATER_THAN_INT(0,
                                     load_filled_template(k_kinds[k], "can-raw")); /* its frames are missing, and nothing else */
        expect_contains("[can-raw] setpoint: ");
        TEST_ASSERT_NULL_MESSAGE(strstr(m_errors, "[geometry]"), m_errors);
        TEST_ASSERT_NULL_MESSAGE(strstr(m_errors, "counts_per_mm"), m_errors);
        TEST_ASSERT_GREATER_THAN_INT(0, load_filled_template(k_kinds[k], "modbus-tcp"));
        expect_contains("[modbus] setpoint: ");
        TEST_ASSERT_GREATER_THAN_INT(0, load_filled_template(k_kinds[k], "modbus-rtu"));
        expect_contains("[modbus] setpoint: ");
    }
}

/* As it is written, every key without a value is one error, and there are no others. */
static void test_template_as_it_is_names_what_to_fill_in(void)
{
    unsigned blanks = 0;
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_NULL(config_write_template("hexapod", "cia402", file));
    rewind(file);
    m_text[fread(m_text, 1, sizeof m_text - 1, file)] = '\0';
    fclose(file);
    take_lines(m_text);
    for (unsigned i = 0; i < m_lines; i++)
        blanks += m_line[i][0] != ';' && m_line[i][0] != '\0' && m_line[i][strlen(m_line[i]) - 1] == '=';
    TEST_ASSERT_EQUAL_UINT(12, blanks);
    TEST_ASSERT_EQUAL_INT_MESSAGE((int)blanks, load_lines(), m_errors);
    TEST_ASSERT_EQUAL_STRING("hexapod|tripod|tripod-3rps", config_write_template("hexa", "cia402", stderr));
    TEST_ASSERT_NOT_NULL(config_write_template("", "cia402", stderr));
    TEST_ASSERT_NOT_NULL(config_write_template("tripod", "cia40", stderr));
}

/* ---- Limits that the file leaves out ---- */

static void expect_limits(unsigned axis, const char *unit)
{
    const axis_settings_t *limits = &m_config.settings.axis[axis];
    TEST_ASSERT_TRUE_MESSAGE(limits->min_q16 < limits->max_q16 && limits->min_q16 > -INT32_MAX, unit);
    TEST_ASSERT_GREATER_THAN_INT32(0, limits->speed_q16);
    TEST_ASSERT_GREATER_THAN_INT32(0, limits->accel_q16);
    TEST_ASSERT_GREATER_THAN_INT32(0, limits->jerk);
}

/* What is left out is what --check suggests; what is given stays as it is. */
static void test_load_limits_left_out_are_the_suggested_ones(void)
{
    static const char *const k_axes[] = {"roll", "pitch", "yaw", "x", "y", "z"};
    static const char *const k_keys[] = {"min", "max", "speed", "accel", "jerk"};
    static char report[60000];
    take_good_file();
    set_key("z", "max_mm", "12.5");
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned k = 0; k < 5; k++) {
            char key[20];
            snprintf(key, sizeof key, "%s_%s%s", k_keys[k], i < 3 ? "deg" : "mm",
                     k == 2   ? "_s"
                     : k == 3 ? "_s2"
                     : k == 4 ? "_s3"
                              : "");
            if (i != 5 || k != 1)
                delete_line(find_key(k_axes[i], key));
        }
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
    for (unsigned i = 0; i < 6; i++)
        expect_limits(i, k_axes[i]);
    TEST_ASSERT_EQUAL_INT32(12.5 * 65536, m_config.settings.axis[AXIS_Z].max_q16);
    FILE *file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_INT(0, report_write(&m_config, 1, file)); /* no warning: the cylinders can serve them */
    rewind(file);
    report[fread(report, 1, sizeof report - 1, file)] = '\0';
    fclose(file);
    for (unsigned i = 0; i < 5; i++) {
        const axis_settings_t *limits = &m_config.settings.axis[i];
        const char *unit = i < 3 ? "deg" : "mm";
        char expected[200];
        snprintf(expected, sizeof expected, "  %-6s min_%s %.6g  max_%s %.6g  speed_%s_s %.6g", k_axes[i], unit,
                 round(from_q16(limits->min_q16) * 1000) / 1000, unit, round(from_q16(limits->max_q16) * 1000) / 1000, unit,
                 round(from_q16(limits->speed_q16) * 1000) / 1000);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(report, expected), expected);
    }
}

static void test_load_limits_left_out_survive_a_dump_and_do_not_change_in_operation(void)
{
    take_good_file();
    delete_line(find_key("roll", "speed_deg_s"));
    delete_line(find_key("x", "min_mm"));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load_lines(), m_errors);
    config_t running = m_config;
    dump(&m_config, m_text, sizeof m_text);
    TEST_ASSERT_NULL(strstr(m_text, "= suggested"));
    take_good_file();
    delete_line(find_key("roll", "speed_deg_s"));
    delete_line(find_key("x", "min_mm"));
    (void)load_lines();
    TEST_ASSERT_EQUAL_INT(0, reload(&running));
    TEST_ASSERT_EQUAL_STRING("", m_errors);
}

static void test_load_limits_left_out_of_a_tripod_leave_other_axes_alone(void)
{
    load_platform("tripod.ini");
    TEST_ASSERT_EQUAL_INT32(0, m_config.settings.axis[AXIS_X].min_q16);
    TEST_ASSERT_EQUAL_INT32(0, m_config.settings.axis[AXIS_YAW].jerk);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_load_every_key_with_wrong_type_is_one_error_at_its_line);
    RUN_TEST(test_load_every_key_without_value_is_one_error_at_its_line);
    RUN_TEST(test_load_every_number_outside_its_range_is_one_error_at_its_line);
    RUN_TEST(test_value_parse_every_number_at_the_ends_of_its_range_is_taken);
    RUN_TEST(test_load_every_required_key_left_out_is_missing_at_its_section);
    RUN_TEST(test_load_every_key_given_twice_names_the_first_line);
    RUN_TEST(test_load_every_key_misspelt_suggests_the_right_one);
    RUN_TEST(test_load_every_section_left_out_reports_its_required_keys_at_the_end);
    RUN_TEST(test_load_spoilt_line_says_exactly_what_is_wrong);
    RUN_TEST(test_load_all_errors_are_reported_at_once);
    RUN_TEST(test_load_unknown_section_suggests_and_its_keys_are_skipped);
    RUN_TEST(test_load_section_without_keys_is_checked_too);
    RUN_TEST(test_load_section_name_beyond_inih_limit_is_unknown);
    RUN_TEST(test_load_section_given_again_names_the_first_line);
    RUN_TEST(test_load_text_behind_a_section_header_is_an_error);
    RUN_TEST(test_load_key_before_any_section_is_an_error);
    RUN_TEST(test_load_line_longer_than_inih_takes_is_an_error);
    RUN_TEST(test_load_comments_may_be_longer);
    RUN_TEST(test_load_line_of_exactly_the_limit_keeps_its_value);
    RUN_TEST(test_load_comments_blanks_crlf_and_bom_are_taken);
    RUN_TEST(test_load_last_line_without_newline_is_taken);
    RUN_TEST(test_load_utf16_is_refused_once);
    RUN_TEST(test_load_missing_file_or_directory_is_one_error);
    RUN_TEST(test_load_empty_file_reports_what_is_missing);
    RUN_TEST(test_load_error_leaves_the_configuration_alone);
    RUN_TEST(test_load_axis_section_of_a_tripod_is_an_error);
    RUN_TEST(test_load_fourth_joint_of_a_tripod_is_an_error);
    RUN_TEST(test_load_angle_keys_without_motor_are_errors);
    RUN_TEST(test_load_neutral_yaw_of_a_tripod_is_an_error);
    RUN_TEST(test_load_neutral_out_of_reach_is_an_error);
    RUN_TEST(test_load_settled_extension_without_a_pose_is_an_error);
    RUN_TEST(test_load_jerk_below_what_a_ramp_takes_names_the_least);
    RUN_TEST(test_load_neutral_counts_the_stroke_of_each_cylinder);
    RUN_TEST(test_load_hinges_that_do_not_fit_are_an_error);
    RUN_TEST(test_load_safe_mask_above_the_relays_is_an_error);
    RUN_TEST(test_load_gpio_relays_need_lines_that_a_chip_can_be_found_by);
    RUN_TEST(test_load_healthy_pulse_needs_an_output_of_its_own);
    RUN_TEST(test_load_gpio_inputs_need_lines_of_their_own_that_a_chip_can_be_found_by);
    RUN_TEST(test_load_inputs_of_channels_and_supply_that_contradict_themselves_are_errors);
    RUN_TEST(test_load_relay_times_that_contradict_each_other_are_errors);
    RUN_TEST(test_load_input_line_used_twice_is_an_error);
    RUN_TEST(test_load_values_arrive_where_they_belong);
    RUN_TEST(test_load_every_field_is_written_by_one_key_only);
    RUN_TEST(test_load_defaults_stand_where_keys_are_left_out);
    RUN_TEST(test_text_q16_reads_back_as_the_same_value);
    RUN_TEST(test_text_add_beyond_its_room_is_cut);
    RUN_TEST(test_dump_of_every_platform_loads_to_the_same);
    RUN_TEST(test_dump_of_unusual_values_loads_to_the_same);
    RUN_TEST(test_dump_names_every_key_with_unit_range_and_help);
    RUN_TEST(test_hash_is_of_the_values_and_of_nothing_else);
    RUN_TEST(test_hash_of_the_machine_is_of_what_is_built);
    RUN_TEST(test_hash_of_the_machine_knows_every_default);
    RUN_TEST(test_hash_changes_with_every_number);
    RUN_TEST(test_load_approved_has_to_be_a_hash_and_somebody_to_wait_for);
    RUN_TEST(test_load_daily_selftest_has_to_have_somebody_to_make_it);
    RUN_TEST(test_reload_of_another_configuration_than_the_approved_one_is_refused);
    RUN_TEST(test_write_reference_has_a_row_for_every_key);
    RUN_TEST(test_load_random_bytes_only_give_errors);
    RUN_TEST(test_load_good_files_with_random_damage_give_errors_or_load);
    RUN_TEST(test_platforms_reach_the_examples_of_the_document);
    RUN_TEST(test_demo_hexapod_takes_the_cylinder_examples_of_the_document);
    RUN_TEST(test_demo_hexapod_has_what_every_frame_needs);
    RUN_TEST(test_hexapod_435_puts_the_senders_lowest_and_centre_where_it_says);
    RUN_TEST(test_load_sizes_give_the_joints_of_the_ready_made_platforms);
    RUN_TEST(test_load_sizes_agree_with_a_model_and_are_dumped_as_joints);
    RUN_TEST(test_load_sizes_that_say_too_much_or_too_little_are_one_error);
    RUN_TEST(test_template_filled_in_is_a_platform);
    RUN_TEST(test_template_as_it_is_names_what_to_fill_in);
    RUN_TEST(test_load_limits_left_out_are_the_suggested_ones);
    RUN_TEST(test_load_limits_left_out_survive_a_dump_and_do_not_change_in_operation);
    RUN_TEST(test_load_limits_left_out_of_a_tripod_leave_other_axes_alone);
    RUN_TEST(test_check_report_of_every_platform_has_no_warning);
    RUN_TEST(test_check_report_says_where_the_cylinders_are);
    RUN_TEST(test_check_report_notes_what_is_easily_forgotten);
    RUN_TEST(test_check_report_reach_is_where_a_cylinder_ends);
    RUN_TEST(test_check_report_worst_cylinder_speed_is_not_below_that_at_neutral);
    RUN_TEST(test_check_report_warns_of_what_the_limits_do_not_allow);
    return UNITY_END();
}

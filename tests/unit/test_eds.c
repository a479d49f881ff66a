/* SPDX-License-Identifier: MIT
 * test_eds.c - a drive's EDS against what heaved sets up: a file with everything, each object missing, of another size, read only
 * or with narrower limits.
 */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <string.h>

#include "platform/cia402_section.h"
#include "config/config.h"
#include "platform/load.h"
#include "inspect/eds_judge.h"
#include "unity.h"

#define PRESET HEAVE_CONFIG_DIR "/hexapod-cia402.ini"

static config_t m_config;
static cia402_config_t m_drives;
static eds_t m_eds;
static char m_text[60000];
static char m_out[20000];

/* An entry of a complete file. */
static void put_object(unsigned index, unsigned sub, unsigned bytes, const char *access, const char *more)
{
    static const unsigned k_types[] = {0, 5, 6, 0, 7};
    const bool is_position = index == 0x6064 || index == 0x607A;
    char text[300];
    snprintf(text, sizeof text,
             "[%04X%s%s%.0X]\nParameterName=an object\nObjectType=0x7\nDataType=0x%04X\nAccessType=%s\nPDOMapping=1\n%s\n", index,
             sub == 0 ? "" : "s", sub == 0 ? "" : "ub", sub, is_position && bytes == 4 ? 4 : k_types[bytes], access, more);
    strcat(m_text, text);
}

/* What every drive of the preset needs, once each; spoiled: the object that is to be another. */
static void put_all(unsigned spoiled, const char *access, unsigned bytes, const char *more)
{
    cia402_wish_t wish = {0};
    unsigned done[200];
    unsigned count = 0;
    strcpy(m_text,
           "; a comment\n[FileInfo]\nFileName=all.eds\n\n[DeviceInfo]\nVendorNumber=0xFB\nProductNumber=17\nBaudRate_500=1\n"
           "BaudRate_1000=1\n\n");
    put_object(0x6040, 0, 2, "rww", "");
    put_object(0x6041, 0, 2, "ro", "");
    put_object(0x6064, 0, 4, "ro", "");
    put_object(0x607A, 0, 4, "rww", "");
    while (cia402_next_wish(&m_drives, 0, &wish)) {
        const unsigned object = (unsigned)wish.index << 8 | wish.sub;
        bool is_done = false;
        for (unsigned i = 0; i < count; i++) {
            is_done |= done[i] == object;
        }
        if (!is_done && object != spoiled) {
            put_object(wish.index, wish.sub, wish.bytes, wish.is_written ? "rw" : "ro", "DefaultValue=$NODEID+1");
        } else if (!is_done && access != NULL) {
            put_object(wish.index, wish.sub, bytes != 0 ? bytes : wish.bytes, access, more);
        }
        done[count++] = object;
    }
}

void setUp(void)
{
    m_eds = (eds_t){.object = NULL};
    TEST_ASSERT_EQUAL_INT(0, config_load(PRESET, &m_config, stderr));
    config_cia402(&m_config, &m_drives);
    put_all(0, NULL, 0, "");
}

void tearDown(void)
{
    eds_free(&m_eds);
}

static void take_out(FILE *out)
{
    rewind(out);
    m_out[fread(m_out, 1, sizeof m_out - 1, out)] = '\0';
    fclose(out);
}

static bool read_text(void)
{
    FILE *in = tmpfile();
    FILE *out = tmpfile();
    fputs(m_text, in);
    rewind(in);
    eds_free(&m_eds);
    const bool is_read = eds_read(&m_eds, in, "a.eds", out);
    fclose(in);
    take_out(out);
    return is_read;
}

static bool judge(void)
{
    FILE *out = tmpfile();
    TEST_ASSERT_TRUE_MESSAGE(read_text(), m_out);
    const bool is_usable = eds_judge(&m_eds, &m_config, out);
    take_out(out);
    return is_usable;
}

static void expect(const char *text)
{
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_out, text), m_out);
}

/* --- Whether a drive can be used --- */

static void test_judge_file_with_everything_is_fine(void)
{
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    expect("all that heaved needs is there");
    expect("1 ok, 0 to look at, 0 wrong");
}

/* As Windows editors save it. */
static void test_read_mark_of_utf_8_is_passed_over_and_utf_16_refused(void)
{
    memmove(m_text + 3, m_text, strlen(m_text) + 1);
    memcpy(m_text, "\xEF\xBB\xBF", 3);
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    memcpy(m_text, "\xFF\xFE;", 3);
    TEST_ASSERT_FALSE(read_text());
    expect("a.eds:1: the file is UTF-16: allowed: plain text (UTF-8)");
}

static void test_judge_each_object_that_is_missing_is_named(void)
{
    cia402_wish_t wish = {0};
    while (cia402_next_wish(&m_drives, 0, &wish)) {
        const unsigned object = (unsigned)wish.index << 8 | wish.sub;
        char named[40];
        snprintf(named, sizeof named, "%04Xh:%02X", wish.index, wish.sub);
        const bool is_first_row_optional = object == 0x606000; /* written twice, the second time it is needed */
        put_all(object, NULL, 0, "");
        TEST_ASSERT_EQUAL_MESSAGE(wish.need == CIA402_WISH_IF_THERE && !is_first_row_optional, judge(), m_out);
        expect(named);
    }
}

static void test_judge_guard_that_is_missing_may_be_allowed(void)
{
    put_all(0x600700, NULL, 0, "");
    TEST_ASSERT_FALSE(judge());
    expect("FAIL  6007h:00 is not in it");
    expect("accept_without where it has been tried that the drive stops without it");
    m_config.cia402.accepted_without = 1u << CIA402_GUARD_FAULT;
    TEST_ASSERT_FALSE(judge());
    m_config.cia402.accepted_without |= 1u << CIA402_GUARD_CONNECTION;
    TEST_ASSERT_TRUE(judge());
    expect("warn  6007h:00 is not in it");
    m_config.cia402.accepted_without = 0;
    m_config.cia402.is_no_watchdog_allowed = true; /* an older file */
    TEST_ASSERT_TRUE(judge());
    expect("warn  6007h:00 is not in it");
}

static void test_judge_object_that_can_only_be_read_has_to_hold_the_value(void)
{
    put_all(0x60C202, "const", 0, "DefaultValue=-4");
    TEST_ASSERT_FALSE(judge());
    expect("60C2h:02");
    expect("can only be read and holds -4, heaved sets 253");
    put_all(0x60C202, "const", 0, "DefaultValue=0xFD");
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
}

/* -3 of an i8 and 0xFD of a u8 are the same. */
static void test_judge_values_are_compared_as_the_drive_has_them(void)
{
    put_all(0x60C202, "const", 0, "DefaultValue=-3");
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    put_all(0x60C202, "const", 0, "DefaultValue=0xFFFFFFFD");
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
}

static void test_judge_limits_that_are_none(void)
{
    put_all(0x606500, "rw", 0, "LowLimit=0\nHighLimit=0");
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    put_all(0x101601, "rw", 0, "LowLimit=0\nHighLimit=0xFFFF"); /* of the time: the node is above it */
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
}

/* An array has the type of its entries, which then have none. */
static void test_judge_types_of_entries_that_stand_in_their_array(void)
{
    put_all(0x101601, NULL, 0, "");
    strcat(m_text, "[1016]\nParameterName=a\nObjectType=0x8\nDataType=0x7\nAccessType=rw\nSubNumber=2\n"
                   "[1016sub0]\nParameterName=n\nAccessType=ro\n[1016sub1]\nParameterName=b\n");
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    TEST_ASSERT_EQUAL_UINT8(1, eds_bytes(eds_find(&m_eds, 0x1016, 0)));
    TEST_ASSERT_EQUAL_UINT8(4, eds_bytes(eds_find(&m_eds, 0x1016, 1)));
    put_all(0x101601, NULL, 0, "");
    strcat(m_text, "[1016]\nParameterName=a\nDataType=0x6\nAccessType=rw\nSubNumber=2\nObjectType=0x8\n"
                   "[1016sub0]\nParameterName=n\nAccessType=ro\n[1016sub1]\nParameterName=b\n");
    TEST_ASSERT_FALSE(judge());
    expect("1016h:01");
    expect("is no value of 4 bytes");
}

/* CompactPDO: the file leaves out what every PDO has. */
static void test_judge_pdos_that_the_file_leaves_out(void)
{
    char text[sizeof m_text];
    for (unsigned i = 0; i < 2; i++) {
        put_all(0, NULL, 0, "");
        strcpy(text, m_text);
        char *device = strstr(text, "[DeviceInfo]\n") + strlen("[DeviceInfo]\n");
        size_t used = (size_t)(device - text);
        memcpy(m_text, text, used);
        used += (size_t)sprintf(m_text + used, "CompactPDO=0x%X\nNrOfRXPDO=%u\nNrOfTXPDO=4\n", 1, i == 0 ? 4 : 0);
        for (char *at = device; at != NULL && *at != '\0';) { /* without 1400h to 1BFFh */
            char *next = strstr(at + 1, "\n[");
            const bool is_pdo = at[0] == '[' && at[1] == '1' && at[2] >= '4' && strchr("468A", at[2]) != NULL;
            const size_t length = next == NULL ? strlen(at) : (size_t)(next + 1 - at);
            memcpy(m_text + used, at, is_pdo ? 0 : length);
            used += is_pdo ? 0 : length;
            at = next == NULL ? NULL : next + 1;
        }
        m_text[used] = '\0';
        TEST_ASSERT_NULL(strstr(m_text, "[1400"));
        TEST_ASSERT_EQUAL_MESSAGE(i == 0, judge(), m_out);
    }
    expect("1400h:01 is not in it");
}

/* What would not have gone into the PDOs, or not come out of them. */
/* A fraction of a drive is set by its bits. */
static void test_judge_fraction_of_a_start_up_list(void)
{
    m_config.cia402.startup = (config_startup_t){
        .count = 1, .item = {{.index = 0x21F5, .bytes = 4, .value = 0x41A00000, .is_written = true, .is_checked = true}}};
    put_all(0, NULL, 0, "");
    strcat(m_text, "[21F5]\nParameterName=a\nObjectType=0x7\nDataType=0x0008\nAccessType=rw\n");
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    m_config.cia402.startup.item[0].bytes = 2;
    TEST_ASSERT_FALSE(judge());
    expect("21F5h:00");
}

static void test_judge_what_is_mapped_has_its_size_sign_and_access(void)
{
    static const struct {
        const char *section;
        const char *was;
        const char *is;
        bool is_usable;
        const char *says;
    } k_rows[] = {{"[6041]", "DataType=0x0006", "DataType=0x0007", false, "6041h:00 has another size than heaved maps"},
                  {"[6064]", "DataType=0x0004", "DataType=0x0003", false, "6064h:00 has another size than heaved maps"},
                  {"[6064]", "ObjectType=0x7", "ObjectType=0x8", false, "6064h:00 is not in it"},
                  {"[6041]", "AccessType=ro", "AccessType=wo", false, "6041h:00 can only be written, and heaved needs its value"},
                  {"[607A]", "AccessType=rww", "AccessType=ro ", false, "607Ah:00 can only be read, and heaved commands it"},
                  {"[6064]", "DataType=0x0004", "DataType=0x0007", true, "has no sign"}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        put_all(0, NULL, 0, "");
        char *at = strstr(strstr(m_text, k_rows[i].section), k_rows[i].was);
        TEST_ASSERT_NOT_NULL(at);
        memcpy(at, k_rows[i].is, strlen(k_rows[i].is));
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].is_usable, judge(), m_out);
        expect(k_rows[i].says);
    }
    put_all(0x606500, "wo", 0, "");
    TEST_ASSERT_FALSE(judge());
    expect("can only be written, heaved reads it");
}

static void test_read_long_lines_are_comments_or_wrong(void)
{
    char comment[4000];
    memset(comment, 'x', sizeof comment);
    comment[0] = ';';
    strcpy(comment + sizeof comment - 3, "=\n");
    memmove(m_text + sizeof comment - 1, m_text, strlen(m_text) + 1);
    memcpy(m_text, comment, sizeof comment - 1);
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    m_text[0] = 'x';
    TEST_ASSERT_FALSE(read_text());
    expect("a.eds:1: ");
}

static void test_judge_value_outside_the_limits_names_key_and_line(void)
{
    char line[60];
    put_all(0x606500, "rw", 0, "LowLimit=0\nHighLimit=131071");
    unsigned number = 1;
    for (const char *c = m_text; c < strstr(m_text, "[6065]"); c++) {
        number += *c == '\n';
    }
    TEST_ASSERT_FALSE(judge());
    snprintf(line, sizeof line, "6065h:00 (line %u) takes at most 131071, heaved sets 131072", number);
    expect(line);
    expect("[cia402] following_error_mm");
    put_all(0x606500, "rw", 0, "LowLimit=0\nHighLimit=131072");
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
    put_all(0x60C201, "rw", 0, "LowLimit=5");
    TEST_ASSERT_FALSE(judge());
    expect("60C2h:01");
    expect("takes at least 5, heaved sets 4");
}

static void test_judge_other_size_is_found(void)
{
    put_all(0x608500, "rw", 2, "");
    TEST_ASSERT_FALSE(judge());
    expect("6085h:00");
    expect("is no value of 4 bytes");
}

static void test_judge_what_cannot_be_mapped_is_found(void)
{
    char *at = strstr(m_text, "[6064]");
    at = strstr(at, "PDOMapping=1");
    at[11] = '0';
    TEST_ASSERT_FALSE(judge());
    expect("6064h:00 cannot be mapped into a PDO");
}

static void test_judge_other_device_and_bit_rate_are_found(void)
{
    m_config.cia402.vendor_id = 0xFC;
    m_config.can.bitrate_bps = 250000;
    TEST_ASSERT_FALSE(judge());
    expect("it is the file of another device: 0xFB -> the right file, or [cia402] vendor_id");
    expect("no 250 kbit/s (BaudRate_250) -> [can] bitrate_bps");
}

static void test_judge_mode_that_is_not_named_is_worth_a_word(void)
{
    put_object(0x6502, 0, 4, "ro", "DefaultValue=0x41");
    TEST_ASSERT_TRUE(judge());
    expect("does not name mode csp (0x41)");
}

static void test_judge_items_of_the_start_up_list_count(void)
{
    m_config.cia402.startup.count = 1;
    m_config.cia402.startup.item[0] =
        (cia402_item_t){.index = 0x2030, .sub = 1, .bytes = 2, .value = 70, .is_written = true, .is_checked = true};
    TEST_ASSERT_FALSE(judge());
    expect("2030h:01 is not in it, and is in [cia402-startup]");
    put_object(0x2030, 1, 2, "rw", "HighLimit=60");
    TEST_ASSERT_FALSE(judge());
    expect("takes at most 60, heaved sets 70 -> [cia402-startup]");
    m_config.cia402.startup.item[0].value = 60;
    TEST_ASSERT_TRUE_MESSAGE(judge(), m_out);
}

/* --- Files --- */

static void test_read_what_is_no_such_file_is_refused_at_its_line(void)
{
    static const struct {
        const char *text;
        const char *why;
    } k_cases[] = {{"\n[1000\n", "a.eds:2: [1000: a section without ]"},
                   {"hello\n", "a.eds:1: hello: neither a section nor key=value"},
                   {"[1000]\nDataType=zero\n", "a.eds:2: zero: no DataType that there is"},
                   {"[1000]\nDataType=7\nAccessType=maybe\n", "a.eds:3: maybe: no AccessType that there is"},
                   {"[FileInfo]\nFileName=x\n", "no object in it"},
                   {"", "no object in it"}};
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        strcpy(m_text, k_cases[i].text);
        TEST_ASSERT_FALSE(read_text());
        expect(k_cases[i].why);
    }
    memset(m_text, 'x', 2000);
    m_text[2000] = '\0';
    TEST_ASSERT_FALSE(read_text());
    expect("the line is too long");
}

static void test_read_arrays_written_in_short_have_their_entries(void)
{
    strcpy(m_text, "[1016]\r\nDataType=0x7\r\nAccessType=rw\r\nCompactSubObj=2\r\nDefaultValue=0x10 ; and a comment\r\n");
    TEST_ASSERT_TRUE(read_text());
    TEST_ASSERT_NOT_NULL(eds_find(&m_eds, 0x1016, 1));
    TEST_ASSERT_EQUAL_INT64(16, eds_find(&m_eds, 0x1016, 2)->fallback.value);
    TEST_ASSERT_NULL(eds_find(&m_eds, 0x1016, 3));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_judge_file_with_everything_is_fine);
    RUN_TEST(test_read_mark_of_utf_8_is_passed_over_and_utf_16_refused);
    RUN_TEST(test_judge_each_object_that_is_missing_is_named);
    RUN_TEST(test_judge_guard_that_is_missing_may_be_allowed);
    RUN_TEST(test_judge_object_that_can_only_be_read_has_to_hold_the_value);
    RUN_TEST(test_judge_values_are_compared_as_the_drive_has_them);
    RUN_TEST(test_judge_limits_that_are_none);
    RUN_TEST(test_judge_types_of_entries_that_stand_in_their_array);
    RUN_TEST(test_judge_pdos_that_the_file_leaves_out);
    RUN_TEST(test_judge_fraction_of_a_start_up_list);
    RUN_TEST(test_judge_what_is_mapped_has_its_size_sign_and_access);
    RUN_TEST(test_read_long_lines_are_comments_or_wrong);
    RUN_TEST(test_judge_value_outside_the_limits_names_key_and_line);
    RUN_TEST(test_judge_other_size_is_found);
    RUN_TEST(test_judge_what_cannot_be_mapped_is_found);
    RUN_TEST(test_judge_other_device_and_bit_rate_are_found);
    RUN_TEST(test_judge_mode_that_is_not_named_is_worth_a_word);
    RUN_TEST(test_judge_items_of_the_start_up_list_count);
    RUN_TEST(test_read_what_is_no_such_file_is_refused_at_its_line);
    RUN_TEST(test_read_arrays_written_in_short_have_their_entries);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_dcf.c - files of makers' programs as start-up lists: what a drive was set to is in a list, in a comment, or at its
 * default; never in a list of drives that it does not belong to.
 */
#define _POSIX_C_SOURCE 200809L

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "platform/cia402_section.h"
#include "config/config.h"
#include "platform/load.h"
#include "inspect/dcf_startup.h"
#include "random.h"
#include "unity.h"

#define PRESET    HEAVE_CONFIG_DIR "/hexapod-cia402.ini"
#define FILE_NAME "test_dcf.tmp.ini"
#define FILES     6u
#define RANDOM    2000u

static config_t m_config;
static eds_t m_file[FILES];
static char m_text[60000];
static char m_out[60000];
static char m_errors[4000];

void setUp(void)
{
    strcpy(m_text, "");
}

void tearDown(void)
{
    for (unsigned i = 0; i < FILES; i++) {
        eds_free(&m_file[i]);
    }
    remove(FILE_NAME);
}

static void put(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const size_t length = strlen(m_text);
    (void)vsnprintf(m_text + length, sizeof m_text - length, format, arguments);
    va_end(arguments);
}

static void put_object(const char *place, unsigned type, const char *access, const char *more)
{
    put("[%s]\nObjectType=7\nDataType=%u\nAccessType=%s\n%s\n", place, type, access, more);
}

/* What was put becomes file i. */
static void read_file(unsigned i)
{
    FILE *in = tmpfile();
    fputs(m_text, in);
    rewind(in);
    eds_free(&m_file[i]);
    TEST_ASSERT_TRUE_MESSAGE(eds_read(&m_file[i], in, "a.dcf", stderr), m_text);
    fclose(in);
    strcpy(m_text, "");
}

static void take(FILE *out, char *text, size_t capacity)
{
    rewind(out);
    text[fread(text, 1, capacity - 1, out)] = '\0';
    fclose(out);
}

static unsigned import(unsigned files, const char *section)
{
    static const char *const k_names[FILES] = {"1.dcf", "2.dcf", "3.dcf", "4.dcf", "5.dcf", "6.dcf"};
    FILE *out = tmpfile();
    FILE *errors = tmpfile();
    const unsigned left = dcf_write_startup(m_file, k_names, files, section, out, errors);
    take(out, m_out, sizeof m_out);
    take(errors, m_errors, sizeof m_errors);
    return left;
}

/* What came out, behind a platform. */
static void load(void)
{
    FILE *preset = fopen(PRESET, "rb");
    FILE *file = fopen(FILE_NAME, "wb");
    size_t length = 0;
    char piece[1024];
    while ((length = fread(piece, 1, sizeof piece, preset)) > 0) {
        fwrite(piece, 1, length, file);
    }
    fprintf(file, "\n%s", m_out);
    fclose(file);
    fclose(preset);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, config_load(FILE_NAME, &m_config, stderr), m_out);
}

static void expect(const char *part)
{
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_out, part), m_out);
}

/* --- One file --- */

static void test_import_of_a_dcf_loads_as_it_is_written(void)
{
    put_object("2030", 6, "rw", "DefaultValue=5\nParameterValue=70");
    put_object("2031sub1", 5, "rw", "DefaultValue=5\nParameterValue=5");
    put_object("2032sub2", 7, "rww", "ParameterValue=0xFFFFFFFF");
    put_object("2033", 7, "ro", "ParameterValue=1");
    put_object("605A", 3, "rw", "ParameterValue=0");
    put_object("2036", 3, "wo", "ParameterValue=-7");
    put_object("2037", 3, "rw", "ParameterValue=0xFFF9");
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(0, import(1, "cia402-startup-3"));
    TEST_ASSERT_EQUAL_STRING("", m_errors);
    expect("[cia402-startup-3]\n0x2030:00 = 70 u16\n");
    expect("\n0x2032:02 = 4294967295 u32\n");
    expect("\n0x2036:00 = -7 i16 unchecked\n0x2037:00 = -7 i16\n");
    expect("; 0x2033:00 (line 18) can only be read\n");
    expect("; 0x605A:00 (line 23) is set by heaved itself, by the keys of [cia402]\n");
    expect("; 1 more hold their defaults\n");
    load();
    TEST_ASSERT_EQUAL_UINT8(0, m_config.cia402.startup.count);
    TEST_ASSERT_EQUAL_UINT8(4, m_config.cia402.drive_startup[2].count);
    TEST_ASSERT_EQUAL_HEX32(0xFFF9, m_config.cia402.drive_startup[2].item[2].value);
}

static void test_import_names_what_no_list_may_write(void)
{
    put("[DeviceInfo]\nVendorNumber=0xFB\n");
    put_object("2000", 5, "rw", "DefaultValue=1\nParameterValue=2"); /* the node id of this maker */
    put_object("6040", 6, "rw", "ParameterValue=15");
    put_object("607A", 4, "rw", "ParameterValue=100000");
    put_object("1010sub1", 7, "rw", "ParameterValue=1");
    put_object("1405sub2", 5, "rw", "ParameterValue=1");
    put_object("6071", 3, "rw", "DefaultValue=0\nParameterValue=0"); /* as every drive has it */
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(5, import(1, "cia402-startup"));
    TEST_ASSERT_EQUAL_STRING("1.dcf: left out, each with a comment in the list: 0 that keys of [cia402] decide, 0 of the node, "
                             "5 that no list may write, 0 that no list can hold, 0 too many\n",
                             m_errors);
    expect("; 0x2000:00 (line 3) is the node id or the bit rate; set it by the maker's program\n");
    expect("; 0x6040:00 (line 9) can give a drive torque or move it, which nothing but engaging may do\n");
    expect("; 0x607A:00 ");
    expect("; 0x1010:01 (line 19) would write the drive's memory");
    expect("; 0x1405:02 (line 24) belongs to the PDOs");
    expect("; 1 more hold their defaults\n");
    load();
}

static void test_import_names_what_depends_on_the_node(void)
{
    static const char k_cob[] = "DefaultValue=$NODEID+0x280\nParameterValue=0x280 + $NodeID";
    put("[DeviceComissioning]\nNodeID=3\n");
    put_object("2100", 7, "rw", k_cob);                                              /* both alike */
    put_object("2101", 7, "rw", "DefaultValue=$NODEID+0x280\nParameterValue=0x283"); /* alike for node 3 */
    put_object("2102", 7, "rw", "ParameterValue=0x280+$NODEID");                     /* behind the number */
    put_object("2103", 7, "rw", "ParameterValue=$NODEID");
    put_object("2104", 7, "rw", "DefaultValue=$NODEID+0x280\nParameterValue=0x300"); /* for this drive alone */
    put_object("2105", 5, "rw", "ParameterName=CAN Node-ID\nParameterValue=3");
    put("[2106]\nParameterName=CAN baud rate\n");
    put_object("2106sub1", 5, "rw", "ParameterName=value\nParameterValue=4");
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(4, import(1, "cia402-startup-3"));
    expect("; 0x2102:00 (line 15) depends on the node\n; 0x2103:00 (line 20) depends on the node\n0x2104:00 = 768 u32\n");
    expect("; 0x2105:00 (line 31) is, by its name, the node id or the bit rate\n");
    expect("; 0x2106:01 (line 39) is, by its name, the node id or the bit rate\n");
    expect("; 2 more hold their defaults\n");
    load();
    TEST_ASSERT_EQUAL_UINT(5, import(1, "cia402-startup"));
    expect("; 0x2104:00 (line 25) depends on the node\n");
    TEST_ASSERT_NULL_MESSAGE(strstr(m_out, "\n0x"), m_out);
}

static void test_import_names_what_no_list_can_hold(void)
{
    put_object("2200", 8, "rw", "ParameterValue=1.5");
    put_object("2201", 8, "rw", "ParameterValue=0x3FC00000");
    put_object("2202", 9, "rw", "DefaultValue=axis\nParameterValue=left axis");
    put_object("2203", 9, "rw", "DefaultValue=axis\nParameterValue=axis");
    put_object("2204", 5, "rw", "ParameterValue=300");
    put_object("2205", 2, "rw", "ParameterValue=-129");
    put_object("2206", 27, "rw", "ParameterValue=0xFFFFFFFFFFFFFFFF");
    put_object("2207", 7, "rw", "ParameterValue=10h");
    put_object("2208", 7, "rw", "ParameterValue=1+2");
    put_object("2209", 7, "rw", "ParameterValue=$NODEID+$NODEID");
    put("[220A]\nObjectType=7\nAccessType=rw\nParameterValue=1\n");
    put("[220B]\nObjectType=7\nDataType=7\nParameterValue=1\n");
    put_object("220C", 7, "rw", "ParameterValue=1");
    put_object("220C", 7, "rw", "ParameterValue=2");
    put_object("220D", 7, "rw", "CompactSubObj=3\nParameterValue=2");
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(13, import(1, "cia402-startup-1"));
    for (unsigned i = 0; i < 10; i++) {
        char line[80];
        snprintf(line, sizeof line, "; 0x220%u:00 (line %u) is no whole number of up to 32 bits that its type holds\n", i,
                 i == 0 ? 1 : 5 * i + 1 + (i > 2) + (i > 3));
        TEST_ASSERT_EQUAL_MESSAGE(i != 3, strstr(m_out, line) != NULL, line);
    }
    expect("; 0x220A:00 (line 53) has no DataType in the file\n");
    expect("; 0x220B:00 (line 57) has no AccessType in the file\n");
    expect("0x220C:00 = 1 u32\n; 0x220C:00 (line 66) is in the file a second time\n");
    expect("; 0x220D:00 (line 71) is one value for several sub-indices; a list needs each of them\n");
    expect("; 1 more hold their defaults\n");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, " 13 that no list can hold, 0 too many\n"), m_errors);
    load();
}

static void test_import_takes_the_values_of_arrays_written_in_short(void)
{
    put_object("2300", 6, "rw", "CompactSubObj=4\nDefaultValue=7");
    put("[2300Name]\nNrOfEntries=1\n1=a name\n[2300Value]\nNrOfEntries=3\n1=7\n2=8\n4=0x10\n");
    put("[2301Value]\n1=8\n");
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(1, import(1, "cia402-startup-1"));
    expect("[cia402-startup-1]\n0x2300:02 = 8 u16\n0x2300:04 = 16 u16\n; 0x2301:01 (line 16) has no DataType in the file\n"
           "; 1 more hold their defaults\n");
    TEST_ASSERT_EQUAL_INT64(7, eds_find(&m_file[0], 0x2300, 3)->fallback.value);
}

static void test_import_longer_than_a_list_names_the_rest(void)
{
    for (unsigned i = 0; i < 34; i++) {
        char place[8];
        snprintf(place, sizeof place, "%04X", 0x2100 + i);
        put_object(place, 6, "rw", "ParameterValue=1");
    }
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(2, import(1, "cia402-startup"));
    expect("\n0x211F:00 = 1 u16\n; 0x2120:00 (line 161) is one too many");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, " 0 that no list can hold, 2 too many\n"), m_errors);
    load();
    TEST_ASSERT_EQUAL_UINT8(CONFIG_STARTUP_MAX, m_config.cia402.startup.count);
}

static void test_import_counts_what_keys_decide(void)
{
    put_object("6085", 7, "rw", "ParameterValue=24000"); /* only with quick_stop_mm_s2 */
    put_object("6098", 2, "rw", "ParameterValue=35");    /* only where it homes */
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(2, import(1, "cia402-startup"));
    expect(
        "; 0x6085:00 (line 1) is set by heaved with some keys of [cia402]; set them, or write a line for it where they do not\n");
    expect("; 0x6098:00 (line 6) is set by heaved with some keys of [cia402]");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, " 2 that keys of [cia402] decide, 0 of the node"), m_errors);
}

static void test_import_counts_values_of_no_object(void)
{
    put("[ 2400 ]\nDataType=7\nAccessType=rw\nParameterValue=4\n");
    put("[2401sub001]\nDataType=7\nAccessType=rw\nParameterValue=4\n[0x2402]\nParameterValue=5\n");
    put_object("2403", 7, "rw", "ParameterValue=5\nParameterValue=6");
    put_object("2404", 7, "rw", "ParameterValue=5;6");
    put_object("2405", 7, "rw", "ParameterValue=7 ; seven");
    put_object("2406", 15, "rw", "DownloadFile=params.bin");
    put_object("2407", 6, "rw", "CompactSubObj=4\nDefaultValue=7");
    put("[2407Value]\nNrOfEntries=3\n0=1\n256=2\nsub1=3\n1=9\n");
    read_file(0);
    TEST_ASSERT_EQUAL_UINT(8, import(1, "cia402-startup-1"));
    expect("[cia402-startup-1]\n0x2400:00 = 4 u32\n0x2403:00 = 6 u32\n; 0x2404:00 (line 17) is no whole number of up to 32 bits "
           "that its "
           "type holds\n0x2405:00 = 7 u32\n; 0x2406:00 (line 27) is no whole number");
    expect("\n0x2407:01 = 9 u16\n; 6 values are of no object, or stand twice in its section; the first in line 8\n");
}

/* --- Files of several drives --- */

static void test_import_of_several_files_keeps_apart_what_is_one_drives_own(void)
{
    cia402_config_t drives;
    for (unsigned i = 0; i < 3; i++) {
        char own[40];
        put_object("3000", 6, "rw", "ParameterValue=50");
        snprintf(own, sizeof own, "ParameterValue=%u", 100 + i);
        put_object("3001sub1", 7, "rw", own); /* its motor's calibration */
        if (i == 1) {
            put_object("3002", 5, "rw", "ParameterValue=1");
        }
        put_object("3003", i == 2 ? 5 : 6, "rw", "ParameterValue=1"); /* other firmware */
        put_object("3004", 7, "rw", "DefaultValue=$NODEID+1\nParameterValue=9");
        put_object("6040", 6, "rw", "ParameterValue=15");
        read_file(i);
    }
    TEST_ASSERT_EQUAL_UINT(3, import(3, NULL));
    TEST_ASSERT_EQUAL_STRING_LEN("[cia402-startup]\n0x3000:00 = 50 u16\n\n[cia402-startup-1]\n0x3001:01 = 100 u32\n"
                                 "0x3003:00 = 1 u16\n0x3004:00 = 9 u32\n; 0x6040:00 ",
                                 m_out, 120);
    expect("\n[cia402-startup-2]\n0x3001:01 = 101 u32\n0x3002:00 = 1 u8\n0x3003:00 = 1 u16\n0x3004:00 = 9 u32\n; 0x6040:00 ");
    expect("\n[cia402-startup-3]\n0x3001:01 = 102 u32\n0x3003:00 = 1 u8\n0x3004:00 = 9 u32\n; 0x6040:00 ");
    load();
    config_cia402(&m_config, &drives);
    TEST_ASSERT_EQUAL_UINT8(4, drives.axis[0].items);
    TEST_ASSERT_EQUAL_UINT8(5, drives.axis[1].items);
    TEST_ASSERT_EQUAL_UINT8(1, drives.axis[5].items);
    TEST_ASSERT_EQUAL_UINT32(101, drives.axis[1].item[1].value);
}

/* --- Files that nobody has written --- */

static unsigned put_random_file(void)
{
    static const char *const k_values[] = {"0",
                                           "1",
                                           "0xF",
                                           "-1",
                                           "300",
                                           "70000",
                                           "0x80000000",
                                           "1.5",
                                           "words",
                                           "$NODEID",
                                           "2+3",
                                           "$NODEID+0x2",
                                           "0x2+$NODEID",
                                           "-2147483648",
                                           "1e3",
                                           "0xFFFFFFFFFFFFFFFF",
                                           "4294967295",
                                           "0x1FFFFFFFF",
                                           "0b1",
                                           "$NODEI",
                                           "+"};
    static const char *const k_access[] = {"rw", "ro", "wo", "rwr", "rww", "const"};
    static const unsigned k_index[] = {0x1005, 0x1007, 0x1014, 0x1017, 0x1400, 0x1800, 0x1A00, 0x2000, 0x2001, 0x2005, 0x3000,
                                       0x3001, 0x6040, 0x6060, 0x605A, 0x6071, 0x607A, 0x6083, 0x60C1, 0x60FE, 0x60FF, 0x6840};
    static const unsigned k_types[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 15, 21, 27};
    const unsigned values = sizeof k_values / sizeof k_values[0];
    unsigned settings = 0;
    put("[DeviceInfo]\nVendorNumber=%u\n", random_below(2) == 0 ? 0xFB : 1);
    for (unsigned i = 1 + random_below(40); i > 0; i--) {
        char place[16];
        char more[120] = "";
        snprintf(place, sizeof place, random_below(2) == 0 ? "%04X" : "%04Xsub%X",
                 k_index[random_below(sizeof k_index / sizeof k_index[0])] + random_below(2), random_below(3));
        if (random_below(3) > 0) {
            snprintf(more, sizeof more, "DefaultValue=%s\n", k_values[random_below(values)]);
        }
        if (random_below(4) > 0) {
            snprintf(more + strlen(more), sizeof more - strlen(more), "ParameterValue=%s\n", k_values[random_below(values)]);
            settings++;
        }
        put_object(place, k_types[random_below(sizeof k_types / sizeof k_types[0])], k_access[random_below(6)], more);
    }
    return settings;
}

static unsigned count_lines(const char *start)
{
    unsigned count = 0;
    for (const char *line = m_out; line != NULL; line = strchr(line, '\n')) {
        line += line != m_out;
        count += strncmp(line, start, strlen(start)) == 0;
    }
    return count;
}

/* Each setting is in a list, in a comment, or at its default; what is in a list is one that heaved takes. */
static void test_import_of_any_file_loses_nothing_and_loads(void)
{
    for (unsigned i = 0; i < RANDOM; i++) {
        random_begin(i + 1);
        const unsigned settings = put_random_file();
        unsigned defaults = 0;
        read_file(0);
        (void)import(1, random_below(2) == 0 ? "cia402-startup" : "cia402-startup-6");
        const char *same = strstr(m_out, " more hold their defaults");
        if (same != NULL) {
            while (same[-1] != ' ') {
                same--;
            }
            (void)sscanf(same, "%u", &defaults);
        }
        const unsigned told = count_lines("0x") + count_lines("; 0x") + defaults;
        TEST_ASSERT_EQUAL_UINT_MESSAGE(settings, told, m_out);
        load();
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_import_of_a_dcf_loads_as_it_is_written);
    RUN_TEST(test_import_names_what_no_list_may_write);
    RUN_TEST(test_import_names_what_depends_on_the_node);
    RUN_TEST(test_import_names_what_no_list_can_hold);
    RUN_TEST(test_import_takes_the_values_of_arrays_written_in_short);
    RUN_TEST(test_import_counts_what_keys_decide);
    RUN_TEST(test_import_counts_values_of_no_object);
    RUN_TEST(test_import_longer_than_a_list_names_the_rest);
    RUN_TEST(test_import_of_several_files_keeps_apart_what_is_one_drives_own);
    RUN_TEST(test_import_of_any_file_loses_nothing_and_loads);
    return UNITY_END();
}

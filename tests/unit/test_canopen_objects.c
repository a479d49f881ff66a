/* SPDX-License-Identifier: MIT
 * test_canopen_objects.c - common objects by name, values of any object between text and bytes, and what they mean.
 */
#include "common/canopen_objects.h"

#include <string.h>

#include "heave/status.h"
#include "unity.h"

void setUp(void) {}

void tearDown(void) {}

static void test_table_has_each_object_once(void)
{
    for (const canopen_object_t *row = canopen_objects; row->name != NULL; row++) {
        TEST_ASSERT_TRUE(row->sub <= row->last && row->type < CANOPEN_TYPES && row->name[0] != '\0');
        TEST_ASSERT_EQUAL_PTR(row, canopen_object_find(row->index, row->sub));
        TEST_ASSERT_EQUAL_PTR(row, canopen_object_find(row->index, row->last));
        TEST_ASSERT_TRUE((row->use & CANOPEN_SETTING) == 0 || row->type != CANOPEN_TEXT);
    }
    TEST_ASSERT_NULL(canopen_object_find(0x2000, 0));
    TEST_ASSERT_NULL(canopen_object_find(0x1018, 5));
}

static void assert_meaning(const char *wanted, uint16_t index, uint8_t sub, int64_t value)
{
    char text[160];
    canopen_object_meaning(index, sub, value, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING(wanted, text);
    for (size_t room = 1; room < 20; room++) { /* cut to fit, and never further */
        memset(text, '#', sizeof text);
        canopen_object_meaning(index, sub, value, text, room);
        TEST_ASSERT_TRUE(memchr(text, '\0', room) != NULL && text[room] == '#');
    }
}

/* 800h further, for each axis beyond the first: the same names, types and meanings. */
static void test_objects_of_the_other_axes_of_a_node(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x6041, canopen_index_of_axis(0x6041, 0));
    TEST_ASSERT_EQUAL_HEX16(0x6841, canopen_index_of_axis(0x6041, 1));
    TEST_ASSERT_EQUAL_HEX16(0x7841, canopen_index_of_axis(0x6041, 3));
    TEST_ASSERT_EQUAL_HEX16(0x1018, canopen_index_of_axis(0x1018, 1));
    TEST_ASSERT_EQUAL_HEX16(0x2041, canopen_index_of_axis(0x2041, 1));
    TEST_ASSERT_EQUAL_PTR(canopen_object_find(0x6041, 0), canopen_object_find(0x6841, 0));
    TEST_ASSERT_EQUAL_PTR(canopen_object_find(0x607D, 2), canopen_object_find(0x787D, 2));
    TEST_ASSERT_NULL(canopen_object_find(0x8041, 0));
    assert_meaning("switch on disabled; under remote control", 0x6841, 0, 0x0240);
    assert_meaning("cyclic synchronous position", 0x7061, 0, 8);
}

static void test_places(void)
{
    static const struct {
        const char *text;
        uint16_t index;
        uint8_t sub;
    } k_good[] = {
        {"6041", 0x6041, 0}, {"6041:00", 0x6041, 0}, {"0x1a00:0A", 0x1A00, 10}, {"1018:4", 0x1018, 4}, {"ffff:FF", 0xFFFF, 255}};
    static const char *const k_bad[] = {"",     "604", "60411", "6041:",    "6041:123", "6041:00 ", "6041.1",
                                        "60g1", ":1",  "0x",    "6041:0x1", "-041",     "6041::1"};
    uint16_t index = 0;
    uint8_t sub = 0;
    for (size_t i = 0; i < sizeof k_good / sizeof k_good[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(canopen_place_read(k_good[i].text, &index, &sub), k_good[i].text);
        TEST_ASSERT_EQUAL_HEX16(k_good[i].index, index);
        TEST_ASSERT_EQUAL_HEX8(k_good[i].sub, sub);
    }
    for (size_t i = 0; i < sizeof k_bad / sizeof k_bad[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(canopen_place_read(k_bad[i], &index, &sub), k_bad[i]);
    }
}

static void test_values_fit_their_types_or_are_refused(void)
{
    static const struct {
        canopen_type_t type;
        const char *text;
        bool is_good;
        int64_t value;
    } k_rows[] = {
        {CANOPEN_U8, "255", true, 255},
        {CANOPEN_U8, "256", false, 0},
        {CANOPEN_U8, "-1", false, 0},
        {CANOPEN_I8, "-128", true, -128},
        {CANOPEN_I8, "128", false, 0},
        {CANOPEN_I16, "0x7FFF", true, 32767},
        {CANOPEN_I16, "0x8000", false, 0},
        {CANOPEN_U32, "4294967295", true, UINT32_MAX},
        {CANOPEN_I32, "-2147483648", true, INT32_MIN},
        {CANOPEN_U32, "4294967296", false, 0},
        {CANOPEN_U32, "1.5", false, 0},
        {CANOPEN_U32, "", false, 0},
        {CANOPEN_U32, "12abc", false, 0},
        {CANOPEN_U32, "0x", false, 0},
        {CANOPEN_U32, "99999999999999999999", false, 0},
        {CANOPEN_TEXT, "5", false, 0},
        {CANOPEN_U16, "010", true, 10},
        {CANOPEN_U16, "--5", false, 0},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        int64_t value = 0;
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].is_good, canopen_value_read(k_rows[i].type, k_rows[i].text, &value), k_rows[i].text);
        if (k_rows[i].is_good) {
            TEST_ASSERT_EQUAL_INT64(k_rows[i].value, value);
        }
    }
    const uint8_t bytes[4] = {0xFE, 0xFF, 0xFF, 0xFF};
    TEST_ASSERT_EQUAL_INT64(-2, canopen_value(CANOPEN_I32, bytes, 4));
    TEST_ASSERT_EQUAL_INT64(-2, canopen_value(CANOPEN_I16, bytes, 2));
    TEST_ASSERT_EQUAL_INT64(254, canopen_value(CANOPEN_U8, bytes, 1));
    TEST_ASSERT_EQUAL_INT64(0, canopen_value(CANOPEN_I8, bytes, 0));
    for (unsigned type = 0; type < CANOPEN_TEXT; type++) {
        canopen_type_t found = CANOPEN_TEXT;
        TEST_ASSERT_TRUE(canopen_type_find(canopen_type_name((canopen_type_t)type), &found));
        TEST_ASSERT_EQUAL(type, found);
    }
}

static void test_meanings(void)
{
    assert_meaning("switch on disabled; under remote control", 0x6041, 0, 0x0240);
    assert_meaning("operation enabled; voltage, warning, under remote control, at a limit of its own", 0x6041, 0, 0x0AB7);
    assert_meaning("following error", 0x603F, 0, 0x8611);
    assert_meaning("none", 0x603F, 0, 0);
    assert_meaning("following error", 0x1003, 1, 0x12348611);
    assert_meaning("", 0x1003, 0, 2);
    assert_meaning("cyclic synchronous position", 0x6061, 0, 8);
    assert_meaning("of the drive's maker", 0x6061, 0, -3);
    assert_meaning("", 0x6061, 0, 5);
    assert_meaning("negative limit, home", 0x60FD, 0, 5);
    assert_meaning("current, temperature", 0x1001, 0, 0x0A);
    assert_meaning("pp, hm, ip, csp", 0x6502, 0, 0xE1);
    assert_meaning("CiA 402 drive", 0x1000, 0, 0x20192);
    assert_meaning("", 0x2000, 0, 7);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_table_has_each_object_once);
    RUN_TEST(test_objects_of_the_other_axes_of_a_node);
    RUN_TEST(test_places);
    RUN_TEST(test_values_fit_their_types_or_are_refused);
    RUN_TEST(test_meanings);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_json.c - the JSON writer: structure, escapes, numbers, and what does not fit.
 */
#include "common/json.h"

#include <string.h>

#include "unity.h"

static char m_buffer[256];
static json_t m_json;

void setUp(void)
{
    memset(m_buffer, 'Z', sizeof m_buffer);
    json_start(&m_json, m_buffer, sizeof m_buffer);
}

void tearDown(void) {}

static void expect(const char *expected)
{
    TEST_ASSERT_FALSE(m_json.is_cut);
    TEST_ASSERT_EQUAL_UINT(strlen(expected), m_json.length);
    TEST_ASSERT_EQUAL_MEMORY(expected, m_buffer, m_json.length);
}

static void test_json_nested_objects_and_arrays_have_their_commas(void)
{
    json_open(&m_json, NULL, '{');
    json_bool(&m_json, "a", true);
    json_open(&m_json, "b", '[');
    json_number(&m_json, NULL, 1);
    json_number(&m_json, NULL, 18446744073709551615u);
    json_open(&m_json, NULL, '{');
    json_close(&m_json, '}');
    json_open(&m_json, NULL, '{');
    json_null(&m_json, "c");
    json_close(&m_json, '}');
    json_close(&m_json, ']');
    json_bool(&m_json, "d", false);
    json_close(&m_json, '}');
    json_newline(&m_json);
    expect("{\"a\":true,\"b\":[1,18446744073709551615,{},{\"c\":null}],\"d\":false}\n");
}

static void test_json_lines_follow_each_other_without_comma(void)
{
    json_open(&m_json, NULL, '{');
    json_close(&m_json, '}');
    json_newline(&m_json);
    json_open(&m_json, NULL, '{');
    json_close(&m_json, '}');
    expect("{}\n{}");
}

static void test_json_text_escapes_what_json_does_not_allow(void)
{
    json_text(&m_json, NULL, "a\"b\\c\n\x01\x7f\xe9");
    expect("\"a\\\"b\\\\c\\u000A\\u0001\\u007F\\u00E9\"");
}

static void test_json_text_of_other_scripts_stays_as_it_is(void)
{
    json_text(&m_json, NULL,
              "\xe7\x94\xb5\xe6\xba\x90, 20 \xc2\xb0"
              "C, \xf0\x9f\x99\x82");
    expect("\"\xe7\x94\xb5\xe6\xba\x90, 20 \xc2\xb0"
           "C, \xf0\x9f\x99\x82\"");
}

static void test_json_bytes_that_are_no_utf8_are_escaped_one_by_one(void)
{
    json_text(&m_json, NULL, "\xe7\x94|\xc0\xaf|\xe0\x9f\xbf|\xed\xa0\x80|\xf4\x90\x80\x80|\xf5|\x80|\xe7");
    expect("\"\\u00E7\\u0094|\\u00C0\\u00AF|\\u00E0\\u009F\\u00BF|\\u00ED\\u00A0\\u0080|\\u00F4\\u0090\\u0080\\u0080|\\u00F5|"
           "\\u0080|\\u00E7\"");
}

static void test_json_numbers(void)
{
    json_open(&m_json, NULL, '[');
    json_q32(&m_json, NULL, -Q32_ONE / 2);
    json_q32(&m_json, NULL, -1);
    json_ms(&m_json, NULL, 1234567);
    json_close(&m_json, ']');
    expect("[-0.500000,0.000000,1234.567]");
}

static void test_json_what_does_not_fit_is_cut_and_nothing_is_overwritten(void)
{
    for (size_t capacity = 0; capacity < 40; capacity++) {
        setUp();
        json_start(&m_json, m_buffer, capacity);
        json_open(&m_json, NULL, '{');
        json_text(&m_json, "key", "some value that is too long");
        json_close(&m_json, '}');
        TEST_ASSERT_EQUAL(capacity < 37, m_json.is_cut);
        TEST_ASSERT_LESS_OR_EQUAL_UINT(capacity, m_json.length);
        TEST_ASSERT_EQUAL_INT('Z', m_buffer[capacity]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_json_nested_objects_and_arrays_have_their_commas);
    RUN_TEST(test_json_lines_follow_each_other_without_comma);
    RUN_TEST(test_json_text_escapes_what_json_does_not_allow);
    RUN_TEST(test_json_text_of_other_scripts_stays_as_it_is);
    RUN_TEST(test_json_bytes_that_are_no_utf8_are_escaped_one_by_one);
    RUN_TEST(test_json_numbers);
    RUN_TEST(test_json_what_does_not_fit_is_cut_and_nothing_is_overwritten);
    return UNITY_END();
}

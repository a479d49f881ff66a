/* SPDX-License-Identifier: MIT
 * test_trace.c - numbers as text against the C library with long double, and whole rows of a trace.
 */
#include "record/trace.h"

#include <float.h>
#include <stdio.h>
#include <string.h>

#include "common/decimal.h"
#include "heave/motion.h"
#include "random.h"
#include "unity.h"

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

/* Half away from zero: the C library rounds the exact value half to even, so exact ties are pushed outwards first. */
static void expect_q32(q32_t value_q32, unsigned places)
{
    static const long double k_scale[] = {1.0L, 1e1L, 1e2L, 1e3L, 1e4L, 1e5L, 1e6L, 1e7L, 1e8L, 1e9L};
    char expected[64];
    char got[64];
    const size_t length = decimal_put_q32(got, value_q32, places);
    const uint64_t magnitude = value_q32 < 0 ? 0 - (uint64_t)value_q32 : (uint64_t)value_q32;
    const uint64_t part = (magnitude & 0xFFFFFFFFu) * (uint64_t)k_scale[places];
    const bool is_tie = (part & 0xFFFFFFFFu) == 0x80000000u;
    const long double value = (long double)magnitude / 4294967296.0L + (is_tie ? 0.4L / k_scale[places] : 0.0L);
    snprintf(expected, sizeof expected, "%.*Lf", (int)places, value);
    if (value_q32 < 0 && strspn(expected, "0.") != strlen(expected)) {
        snprintf(expected, sizeof expected, "-%.*Lf", (int)places, value);
    }
    got[length] = '\0';
    TEST_ASSERT_LESS_OR_EQUAL_UINT(DECIMAL_Q32_MAX, length);
    TEST_ASSERT_EQUAL_STRING(expected, got);
}

static void test_decimal_put_q32_corner_values(void)
{
    static const q32_t k_values[] = {
        0,          1,           -1,          2,           -2,           3,         -3,        Q32_ONE,
        -Q32_ONE,   Q32_ONE - 1, 1 - Q32_ONE, Q32_ONE / 2, -Q32_ONE / 2, INT64_MAX, INT64_MIN, INT64_MIN + 1,
        4294967295, 4294967294,  42949672955};
    for (size_t i = 0; i < sizeof k_values / sizeof k_values[0]; i++) {
        for (unsigned places = 1; places <= 9; places++) {
            expect_q32(k_values[i], places);
        }
    }
}

static void test_decimal_put_q32_random_values_agree_with_long_double(void)
{
#if LDBL_MANT_DIG < 64
    TEST_IGNORE_MESSAGE("long double is too short here to be exact");
#endif
    for (unsigned i = 0; i < 300000; i++) {
        const uint64_t bits = random_bits();
        expect_q32((q32_t)bits >> (i % 60), i % 9 + 1);
        expect_q32((q32_t)(bits << 23 >> (i % 3 * 8)), 9); /* few bits: many exact ties at fewer places */
    }
}

static void test_decimal_put_q32_ties_go_away_from_zero(void)
{
    char text[DECIMAL_Q32_MAX];
    TEST_ASSERT_EQUAL_UINT(3, decimal_put_q32(text, Q32_ONE / 4, 1));
    TEST_ASSERT_EQUAL_MEMORY("0.3", text, 3);
    TEST_ASSERT_EQUAL_UINT(4, decimal_put_q32(text, -Q32_ONE / 4, 1));
    TEST_ASSERT_EQUAL_MEMORY("-0.3", text, 4);
}

static void test_decimal_put_ms_random_values_agree(void)
{
    for (unsigned i = 0; i < 10000; i++) {
        char expected[64], got[64];
        const uint64_t us = random_bits() >> (i % 64);
        got[decimal_put_ms(got, us)] = '\0';
        snprintf(expected, sizeof expected, "%llu.%03llu", (unsigned long long)(us / 1000), (unsigned long long)(us % 1000));
        TEST_ASSERT_EQUAL_STRING(expected, got);
    }
}

static snapshot_t busy_snapshot(void)
{
    snapshot_t s = {.state = STATE_ENGAGED, .cylinders = 6, .has_angle = true, .relay_mask = 0x0F0A, .now_us = 99};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        s.sent.axis_q32[i] = q32_from_int((int32_t)i + 1);
        s.extension_mm_q32[i] = -q32_from_int((int32_t)i + 11);
    }
    s.angle_deg_q32 = Q32_ONE / 2;
    return s;
}

static const char *row_text(const snapshot_t *s, uint64_t t_us, bool is_late)
{
    static char text[TRACE_LINE_MAX + 1];
    trace_row_t row;
    trace_fill(&row, s, t_us, is_late, false);
    text[trace_format(&row, text)] = '\0';
    return text;
}

static void test_trace_header_is_the_contract(void)
{
    char text[TRACE_LINE_MAX + 1];
    text[trace_header(text)] = '\0';
    TEST_ASSERT_EQUAL_STRING("t_ms,state,roll_deg,pitch_deg,yaw_deg,x_mm,y_mm,z_mm,angle_deg,"
                             "c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm,relays,flags\n",
                             text);
}

static void test_trace_format_row_has_every_column(void)
{
    const snapshot_t s = busy_snapshot();
    TEST_ASSERT_EQUAL_STRING("12.345,ENGAGED,1.000000000,2.000000000,3.000000000,4.000000000,5.000000000,6.000000000,0.500000000,"
                             "-11.000000000,-12.000000000,-13.000000000,-14.000000000,-15.000000000,-16.000000000,0F0A,\n",
                             row_text(&s, 12345, false));
}

static void test_trace_format_absent_cylinders_and_motor_are_zero(void)
{
    snapshot_t s = busy_snapshot();
    s.cylinders = 3;
    s.has_angle = false;
    TEST_ASSERT_EQUAL_STRING("0.000,ENGAGED,1.000000000,2.000000000,3.000000000,4.000000000,5.000000000,6.000000000,0.000000000,"
                             "-11.000000000,-12.000000000,-13.000000000,0.000000000,0.000000000,0.000000000,0F0A,\n",
                             row_text(&s, 0, false));
}

static void expect_flags(const snapshot_t *s, bool is_late, const char *expected)
{
    const char *row = row_text(s, 0, is_late);
    TEST_ASSERT_EQUAL_STRING_LEN(expected, strrchr(row, ',') + 1, strlen(expected));
    TEST_ASSERT_EQUAL_STRING("\n", strrchr(row, ',') + 1 + strlen(expected));
}

static void test_trace_format_flags_are_words(void)
{
    snapshot_t s = busy_snapshot();
    s.flags = 0xFF;
    expect_flags(&s, false, "clamped|speed|accel|stretched|takeover|cylinders|off-path|no-pose");
    s.is_held_by_silence = true;
    s.state = STATE_FAULT;
    s.is_estop_active = true;
    expect_flags(&s, true, "clamped|speed|accel|stretched|takeover|cylinders|off-path|no-pose|fault|estop|silent|late");
    s = busy_snapshot();
    s.flags = MOTION_SPEED;
    expect_flags(&s, true, "speed|late");
    s.state = STATE_ESTOP;
    expect_flags(&s, false, "speed|estop");
}

static void test_trace_format_longest_row_fits(void)
{
    trace_row_t row = {.t_us = UINT64_MAX, .relay_mask = 0xFFFF, .flags = 0xFFFF, .state = STATE_SETTLING};
    char text[TRACE_LINE_MAX];
    for (unsigned i = 0; i < TRACE_VALUES; i++) {
        row.value_q32[i] = INT64_MIN;
    }
    TEST_ASSERT_LESS_THAN_UINT(TRACE_LINE_MAX, trace_format(&row, text));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_decimal_put_q32_corner_values);
    RUN_TEST(test_decimal_put_q32_random_values_agree_with_long_double);
    RUN_TEST(test_decimal_put_q32_ties_go_away_from_zero);
    RUN_TEST(test_decimal_put_ms_random_values_agree);
    RUN_TEST(test_trace_header_is_the_contract);
    RUN_TEST(test_trace_format_row_has_every_column);
    RUN_TEST(test_trace_format_absent_cylinders_and_motor_are_zero);
    RUN_TEST(test_trace_format_flags_are_words);
    RUN_TEST(test_trace_format_longest_row_fits);
    return UNITY_END();
}

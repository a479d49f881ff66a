/* SPDX-License-Identifier: MIT
 * test_text.c - lines of text in buffers of fixed size: what does not fit is left out, and what cannot be printed is escaped.
 */
#include "heave/text.h"

#include <string.h>

#include "unity.h"

static char m_buffer[64];
static text_t m_text;

void setUp(void)
{
    memset(m_buffer, '!', sizeof m_buffer);
    m_text = text_start(m_buffer, sizeof m_buffer);
}

void tearDown(void) {}

static void test_text_is_empty_at_first(void)
{
    TEST_ASSERT_EQUAL_STRING("", m_buffer);
}

static void test_what_does_not_fit_is_left_out(void)
{
    m_text = text_start(m_buffer, 5);
    text_put(&m_text, "abc");
    text_put_u32(&m_text, 123);
    TEST_ASSERT_EQUAL_STRING("abc1", m_buffer);
    TEST_ASSERT_EQUAL('!', m_buffer[5]);
    m_text = text_start(m_buffer, 1);
    text_put(&m_text, "abc");
    TEST_ASSERT_EQUAL_STRING("", m_buffer);
}

static void test_numbers(void)
{
    text_put_u32(&m_text, 0);
    text_put(&m_text, " ");
    text_put_u32(&m_text, UINT32_MAX);
    text_put(&m_text, " ");
    text_put_hex(&m_text, 0x1A, 4);
    text_put(&m_text, " ");
    text_put_hex(&m_text, 0xDEADBEEF, 1);
    text_put(&m_text, " ");
    text_put_hex(&m_text, 0, 1);
    TEST_ASSERT_EQUAL_STRING("0 4294967295 001A DEADBEEF 0", m_buffer);
}

/* Rounded to the nearest, halves away from zero. */
static void test_fractions(void)
{
    text_put_q32(&m_text, -Q32_ONE * 5 / 2, 0);
    text_put(&m_text, " ");
    text_put_q32(&m_text, -Q32_ONE * 5 / 2, 2);
    text_put(&m_text, " ");
    text_put_q32(&m_text, Q32_ONE * 1999 / 1000, 1);
    text_put(&m_text, " ");
    text_put_q32(&m_text, Q32_ONE / 128, 3);
    TEST_ASSERT_EQUAL_STRING("-3 -2.50 2.0 0.008", m_buffer);
}

/* A line of the log stays one line, and tells each byte apart. */
static void test_bytes_that_cannot_be_printed_are_escaped(void)
{
    static const uint8_t k_bytes[] = {'A', ' ', '~', '\\', '\r', '\n', '\t', 0x00, 0x1F, 0x7F, 0xFF};
    text_put_escaped(&m_text, k_bytes, sizeof k_bytes);
    TEST_ASSERT_EQUAL_STRING("A ~\\\\\\r\\n\\x09\\x00\\x1F\\x7F\\xFF", m_buffer);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_text_is_empty_at_first);
    RUN_TEST(test_what_does_not_fit_is_left_out);
    RUN_TEST(test_numbers);
    RUN_TEST(test_fractions);
    RUN_TEST(test_bytes_that_cannot_be_printed_are_escaped);
    return UNITY_END();
}

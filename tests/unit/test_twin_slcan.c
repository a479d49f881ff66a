/* SPDX-License-Identifier: MIT
 * test_twin_slcan.c - the serial CAN adapter of heave-twin, byte by byte.
 */
#include "twin/slcan.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unity.h"

static slcan_t m_slcan;
static can_frame_t m_heard;
static unsigned m_count;

void setUp(void)
{
    m_slcan = (slcan_t){.end = -1, .terminal = -1, .bitrate_bps = 1000000, .path = "here"};
    m_count = 0;
}

void tearDown(void) {}

static void hear(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    m_heard = *frame;
    m_count++;
}

static void tell(const char *text, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        slcan_receive(&m_slcan, text[i], hear, NULL);
    }
}

/* What it answers to a text. */
static const char *ask(const char *text)
{
    static char said[SLCAN_OUT_MAX + 1];
    m_slcan.waiting = 0;
    tell(text, strlen(text));
    memcpy(said, m_slcan.out, m_slcan.waiting);
    said[m_slcan.waiting] = '\0';
    return said;
}

static const char *shown(can_frame_t frame)
{
    m_slcan.waiting = 0;
    slcan_put(&m_slcan, &frame);
    return ask("");
}

static void test_frames_go_both_ways_once_it_is_open(void)
{
    TEST_ASSERT_EQUAL_STRING("\a", ask("t1232AB07\r"));
    TEST_ASSERT_EQUAL_STRING("\r\r\r", ask("\r\rC\rS8\rO\r"));
    TEST_ASSERT_EQUAL_STRING("z\r", ask("t1232Ab07\r"));
    TEST_ASSERT_EQUAL(1, m_count);
    TEST_ASSERT_EQUAL_HEX(0x123, m_heard.id);
    TEST_ASSERT_EQUAL(2, m_heard.length);
    TEST_ASSERT_EQUAL_HEX8(0xAB, m_heard.data[0]);
    TEST_ASSERT_EQUAL_HEX8(0x07, m_heard.data[1]);
    TEST_ASSERT_EQUAL_STRING("Z\r", ask("T18FF010180011223344556677\r"));
    TEST_ASSERT_TRUE(m_heard.is_extended);
    TEST_ASSERT_EQUAL_HEX(0x18FF0101, m_heard.id);
    TEST_ASSERT_EQUAL(8, m_heard.length);
    TEST_ASSERT_EQUAL_HEX8(0x77, m_heard.data[7]);
    TEST_ASSERT_EQUAL_STRING("z\r", ask("r1238\r"));
    TEST_ASSERT_TRUE(m_heard.is_rtr);
    TEST_ASSERT_EQUAL(3, m_count);
    m_slcan.waiting = 0;
    const can_frame_t frame = {.id = 0x81, .length = 3, .data = {0x0A, 0, 0xFF}};
    slcan_put(&m_slcan, &frame);
    TEST_ASSERT_EQUAL_STRING_LEN("t08130A00FF\r", m_slcan.out, m_slcan.waiting);
    m_slcan.waiting = 0;
    const can_frame_t wide = {.id = 0x123, .is_extended = true, .length = 0};
    slcan_put(&m_slcan, &wide);
    TEST_ASSERT_EQUAL_STRING_LEN("T000001230\r", m_slcan.out, m_slcan.waiting);
    TEST_ASSERT_EQUAL_STRING("\r", ask("C\r"));
    TEST_ASSERT_EQUAL_STRING("", shown(frame));
}

static void test_what_is_no_command_gets_bell_and_no_frame_leaves(void)
{
    static const char *const k_wrong[] = {"t123",   "t1239", "t12G0", "t1232AB",  "t1231ABC", "t8000",   "T200000000", "T1234567",
                                          "t",      "x",     "S9",    "O1",       "O",        "S8",      "Z1",         "t12318",
                                          "r12381", "Z",     "s1234", "\x80\xFF", "t1231A\t", "t1231 1", "C1",         "L"};
    TEST_ASSERT_EQUAL_STRING("\r", ask("O\r"));
    for (unsigned i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        char line[40];
        (void)snprintf(line, sizeof line, "%s\r", k_wrong[i]);
        m_slcan.is_open = true;
        TEST_ASSERT_EQUAL_STRING_MESSAGE("\a", ask(line), k_wrong[i]);
    }
    TEST_ASSERT_EQUAL(0, m_count);
}

static void test_a_wrong_rate_lets_nothing_pass(void)
{
    const can_frame_t frame = {.id = 0x81, .length = 0};
    TEST_ASSERT_EQUAL_STRING("\r\r", ask("S6\rO\r"));
    TEST_ASSERT_EQUAL_STRING("\a", ask("t1230\r"));
    TEST_ASSERT_EQUAL_STRING("", shown(frame));
    TEST_ASSERT_EQUAL_STRING("\r\r\r", ask("C\rS8\rO\r"));
    TEST_ASSERT_EQUAL_STRING("z\r", ask("t1230\r"));
}

static void test_a_listener_sends_nothing(void)
{
    TEST_ASSERT_EQUAL_STRING("\r", ask("L\r"));
    TEST_ASSERT_EQUAL_STRING("\a", ask("t1230\r"));
    m_slcan.waiting = 0;
    slcan_put(&m_slcan, &(can_frame_t){.id = 0x81, .length = 0});
    TEST_ASSERT_EQUAL(6, m_slcan.waiting);
}

static void test_a_slow_reader_loses_whole_frames(void)
{
    TEST_ASSERT_EQUAL_STRING("\r", ask("O\r"));
    m_slcan.waiting = 0;
    const can_frame_t frame = {.id = 0x81, .length = 8};
    for (unsigned i = 0; i < 1000; i++) {
        slcan_put(&m_slcan, &frame);
    }
    TEST_ASSERT_EQUAL(0, m_slcan.waiting % 22);
    TEST_ASSERT_EQUAL(1000 - SLCAN_OUT_MAX / 22, m_slcan.lost);
}

static void test_any_bytes_do_no_harm(void)
{
    static const char k_likely[] = "tTrRSOLCVNFZXsmMW0123456789ABCDEFabcdef\r\r\r\r";
    srand(7);
    for (unsigned i = 0; i < 2000000; i++) {
        const char byte = rand() % 8 == 0 ? (char)(rand() % 256) : k_likely[(unsigned)rand() % (sizeof k_likely - 1)];
        if (rand() % 16 == 0) {
            tell("\rT000001231", 11);
        }
        slcan_receive(&m_slcan, byte, hear, NULL);
        TEST_ASSERT_TRUE(m_slcan.length <= SLCAN_LINE_MAX && m_slcan.waiting <= SLCAN_OUT_MAX);
        m_slcan.waiting = i % 1000 == 0 ? 0 : m_slcan.waiting;
        m_slcan.set_bps = 0;
        m_slcan.is_open = m_slcan.is_open || i % 100 == 0;
    }
    TEST_ASSERT_TRUE(m_count > 0);
    TEST_ASSERT_TRUE(m_heard.length <= 8 && m_heard.id <= CAN_ID_EXTENDED_MAX);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frames_go_both_ways_once_it_is_open);
    RUN_TEST(test_what_is_no_command_gets_bell_and_no_frame_leaves);
    RUN_TEST(test_a_wrong_rate_lets_nothing_pass);
    RUN_TEST(test_a_listener_sends_nothing);
    RUN_TEST(test_a_slow_reader_loses_whole_frames);
    RUN_TEST(test_any_bytes_do_no_harm);
    return UNITY_END();
}

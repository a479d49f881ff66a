/* SPDX-License-Identifier: MIT
 * test_sdo.c - the SDO client frame by frame, against the bytes of CiA 301: expedited, segments, toggles, aborts, time-outs,
 * answers that come late, twice, or about something else.
 */
#include "heave/sdo.h"

#include <string.h>

#include "heave/canopen_text.h"
#include "unity.h"

#define TIMEOUT_US 1000u

static sdo_t sdo;
static uint64_t now_us;
static can_frame_t request;

void setUp(void)
{
    now_us = 1000;
    sdo_init(&sdo, 5, TIMEOUT_US);
}

void tearDown(void) {}

/* The client's next frame, taken by the bus. */
static void expect(const char *bytes)
{
    TEST_ASSERT_TRUE(sdo_step(&sdo, now_us, &request));
    sdo_sent(&sdo, now_us);
    TEST_ASSERT_EQUAL_HEX32(0x605, request.id);
    TEST_ASSERT_EQUAL_UINT8(8, request.length);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, request.data, 8);
}

static void expect_nothing(void)
{
    TEST_ASSERT_FALSE(sdo_step(&sdo, now_us, &request));
}

static void answer(const char *bytes)
{
    can_frame_t frame = {.id = 0x585, .length = 8};
    memcpy(frame.data, bytes, 8);
    sdo_receive(&sdo, &frame);
}

static void wait(void)
{
    now_us += TIMEOUT_US;
}

static void test_read_expedited_every_size_gives_the_value(void)
{
    static const struct {
        const char *bytes;
        uint8_t size;
        uint32_t value;
    } k_answers[] = {{"\x43\x64\x60\x00\x01\x02\x03\x84", 4, 0x84030201},
                     {"\x47\x64\x60\x00\x01\x02\x03\xEE", 3, 0x030201},
                     {"\x4B\x64\x60\x00\x01\x02\xEE\xEE", 2, 0x0201},
                     {"\x4F\x64\x60\x00\x01\xEE\xEE\xEE", 1, 0x01},
                     {"\x42\x64\x60\x00\x01\x02\x03\x04", 4, 0x04030201}};
    for (size_t i = 0; i < 5; i++) {
        sdo_read(&sdo, 0x6064, 0, 3);
        expect("\x40\x64\x60\x00\0\0\0\0");
        answer(k_answers[i].bytes);
        TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
        TEST_ASSERT_EQUAL_UINT8(k_answers[i].size, sdo.size);
        TEST_ASSERT_EQUAL_HEX32(k_answers[i].value, sdo_value_u32(&sdo));
        expect_nothing();
    }
}

static void test_write_expedited_every_size_has_its_command(void)
{
    static const char *const k_requests[] = {"\x2F\x60\x60\x02\xA1\0\0\0", "\x2B\x60\x60\x02\xA1\xA2\0\0",
                                             "\x27\x60\x60\x02\xA1\xA2\xA3\0", "\x23\x60\x60\x02\xA1\xA2\xA3\xA4"};
    for (uint8_t size = 1; size <= 4; size++) {
        sdo_write(&sdo, 0x6060, 2, (const uint8_t *)"\xA1\xA2\xA3\xA4", size, 1);
        expect(k_requests[size - 1]);
        TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
        answer("\x60\x60\x60\x02\0\0\0\0");
        TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
    }
}

static void test_read_segments_are_put_together(void)
{
    sdo_read(&sdo, 0x1008, 0, 1);
    expect("\x40\x08\x10\x00\0\0\0\0");
    answer("\x41\x08\x10\x00\x10\0\0\0");
    expect("\x60\0\0\0\0\0\0\0");
    answer("\x00"
           "ABCDEFG");
    expect("\x70\0\0\0\0\0\0\0");
    answer("\x10"
           "HIJKLMN");
    expect("\x60\0\0\0\0\0\0\0");
    answer("\x0B"
           "OP\0\0\0\0\0");
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
    TEST_ASSERT_EQUAL_UINT8(16, sdo.size);
    TEST_ASSERT_EQUAL_MEMORY("ABCDEFGHIJKLMNOP", sdo.value, 16);
    TEST_ASSERT_EQUAL_HEX32(0x44434241, sdo_value_u32(&sdo)); /* of a longer value the first four bytes */
}

static void test_write_segments_are_taken_apart(void)
{
    sdo_write(&sdo, 0x2000, 1, (const uint8_t *)"abcdefghij", 10, 1);
    expect("\x21\x00\x20\x01\x0A\0\0\0");
    answer("\x60\x00\x20\x01\0\0\0\0");
    expect("\x00"
           "abcdefg");
    answer("\x20\0\0\0\0\0\0\0");
    expect("\x19"
           "hij\0\0\0\0");
    answer("\x30\0\0\0\0\0\0\0");
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
}

static void test_receive_repeated_segment_is_dropped(void)
{
    sdo_read(&sdo, 0x1008, 0, 1);
    expect("\x40\x08\x10\x00\0\0\0\0");
    answer("\x41\x08\x10\x00\x0A\0\0\0");
    expect("\x60\0\0\0\0\0\0\0");
    answer("\x00"
           "ABCDEFG");
    expect("\x70\0\0\0\0\0\0\0");
    answer("\x00"
           "ABCDEFG");
    expect_nothing();
    answer("\x19"
           "HIJ\0\0\0\0");
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
    TEST_ASSERT_EQUAL_MEMORY("ABCDEFGHIJ", sdo.value, 10);
}

static void test_receive_toggle_wrong_for_good_is_named(void)
{
    sdo_write(&sdo, 0x2000, 1, (const uint8_t *)"abcdefghij", 10, 1);
    expect("\x21\x00\x20\x01\x0A\0\0\0");
    answer("\x60\x00\x20\x01\0\0\0\0");
    expect("\x00"
           "abcdefg");
    answer("\x30\0\0\0\0\0\0\0");
    expect_nothing();
    wait();
    expect("\x80\x00\x20\x01\x00\x00\x04\x05");
    wait();
    expect_nothing();
    TEST_ASSERT_EQUAL(SDO_ABORTED, sdo.state);
    TEST_ASSERT_EQUAL_HEX32(0x05030000, sdo.abort_code);
}

/* Some servers send the bytes in use only. */
static void test_receive_short_answers_count_if_they_are_whole(void)
{
    static const struct {
        can_frame_t frame;
        uint8_t size;
        uint32_t value;
    } k_rows[] = {{{.length = 5, .data = {0x4F, 0x64, 0x60, 0, 7}}, 1, 7},
                  {{.length = 6, .data = {0x4B, 0x64, 0x60, 0, 7, 8}}, 2, 0x807},
                  {{.length = 6, .data = {0x42, 0x64, 0x60, 0, 7, 8}}, 2, 0x807},
                  {{.length = 6, .data = {0x43, 0x64, 0x60, 0, 7, 8}}, 0, 0},
                  {{.length = 4, .data = {0x4F, 0x64, 0x60, 0, 7}}, 0, 0},
                  {{.length = 4, .data = {0x42, 0x64, 0x60, 0, 7}}, 0, 0},
                  {{.length = 3, .data = {0x4F, 0x64, 0x60, 0, 7}}, 0, 0},
                  {{.length = 12, .data = {0x4F, 0x64, 0x60, 0, 7}}, 0, 0}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        sdo_read(&sdo, 0x6064, 0, 1);
        expect("\x40\x64\x60\x00\0\0\0\0");
        sdo_receive(&sdo, &k_rows[i].frame);
        TEST_ASSERT_EQUAL(k_rows[i].size != 0 ? SDO_DONE : SDO_BUSY, sdo.state);
        if (k_rows[i].size != 0) {
            TEST_ASSERT_EQUAL_UINT8(k_rows[i].size, sdo.size);
            TEST_ASSERT_EQUAL_HEX32(k_rows[i].value, sdo_value_u32(&sdo));
        }
    }
    sdo_write(&sdo, 0x6060, 0, (const uint8_t *)"\x08", 1, 1);
    expect("\x2F\x60\x60\x00\x08\0\0\0");
    sdo_receive(&sdo, &(can_frame_t){.length = 4, .data = {0x60, 0x60, 0x60, 0}});
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
    sdo_read(&sdo, 0x6064, 0, 1);
    expect("\x40\x64\x60\x00\0\0\0\0");
    sdo_receive(&sdo, &(can_frame_t){.length = 4, .data = {0x80, 0x64, 0x60, 0}});
    TEST_ASSERT_EQUAL(SDO_ABORTED, sdo.state);
    TEST_ASSERT_EQUAL_HEX32(0x08000000, sdo.abort_code);
    sdo_read(&sdo, 0x1008, 0, 1);
    expect("\x40\x08\x10\x00\0\0\0\0");
    sdo_receive(&sdo, &(can_frame_t){.length = 4, .data = {0x40, 0x08, 0x10, 0}}); /* segments, and no size */
    expect("\x60\0\0\0\0\0\0\0");
    sdo_receive(&sdo, &(can_frame_t){.length = 2, .data = {0x0B, 'A'}}); /* says that there are two */
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
    sdo_receive(&sdo, &(can_frame_t){.length = 3, .data = {0x0B, 'A', 'B'}});
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
    TEST_ASSERT_EQUAL_MEMORY("AB", sdo.value, 2);
}

/* What cannot be used is said when nothing better has come; nothing at all is silence. */
static void test_step_answers_that_cannot_be_used_are_named(void)
{
    static const struct {
        can_frame_t frame;
        uint32_t code;
    } k_rows[] = {{{.length = 6, .data = {0x43, 0x64, 0x60, 0, 7, 8}}, 0x06070010},
                  {{.length = 8, .data = {0x60, 0x64, 0x60, 0}}, 0x05040001},
                  {{.length = 8, .data = {0x43, 0x65, 0x60, 0}}, 0}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        sdo_read(&sdo, 0x6064, 0, 1);
        expect("\x40\x64\x60\x00\0\0\0\0");
        sdo_receive(&sdo, &k_rows[i].frame);
        wait();
        expect("\x80\x64\x60\x00\x00\x00\x04\x05");
        wait();
        expect_nothing();
        TEST_ASSERT_EQUAL(k_rows[i].code != 0 ? SDO_ABORTED : SDO_SILENT, sdo.state);
        TEST_ASSERT_EQUAL_HEX32(k_rows[i].code, sdo.abort_code);
    }
}

static void test_read_more_than_there_is_room_for_is_refused(void)
{
    sdo_read(&sdo, 0x1008, 0, 1);
    expect("\x40\x08\x10\x00\0\0\0\0");
    answer("\x41\x08\x10\x00\x41\0\0\0");
    TEST_ASSERT_EQUAL(SDO_ABORTED, sdo.state);
    expect("\x80\x08\x10\x00\x12\x00\x07\x06");
    sdo_read(&sdo, 0x1008, 0, 1);
    expect("\x40\x08\x10\x00\0\0\0\0");
    answer("\x40\x08\x10\x00\0\0\0\0"); /* the size is not told */
    for (int i = 0; i < 9; i++) {
        expect(i % 2 ? "\x70\0\0\0\0\0\0\0" : "\x60\0\0\0\0\0\0\0");
        answer(i % 2 ? "\x10"
                       "1234567"
                     : "\x00"
                       "1234567");
    }
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
    expect("\x70\0\0\0\0\0\0\0");
    answer("\x10"
           "1234567");
    TEST_ASSERT_EQUAL(SDO_ABORTED, sdo.state);
    TEST_ASSERT_EQUAL_HEX32(0x06070012, sdo.abort_code);
    expect("\x80\x08\x10\x00\x12\x00\x07\x06");
}

static void test_receive_abort_ends_the_transfer_with_its_code(void)
{
    sdo_read(&sdo, 0x1F80, 0, 3);
    expect("\x40\x80\x1F\x00\0\0\0\0");
    answer("\x80\x80\x1F\x00\x00\x00\x02\x06");
    TEST_ASSERT_EQUAL(SDO_ABORTED, sdo.state);
    TEST_ASSERT_EQUAL_HEX32(0x06020000, sdo.abort_code);
    TEST_ASSERT_EQUAL_STRING("there is no such object", canopen_abort_text(sdo.abort_code));
    expect_nothing();
}

static void test_receive_about_something_else_is_dropped(void)
{
    static const char *const k_strangers[] = {"\x43\x65\x60\x00\x01\x02\x03\x04", "\x43\x64\x60\x01\x01\x02\x03\x04",
                                              "\x43\x64\x61\x00\x01\x02\x03\x04", "\x80\x65\x60\x00\x00\x00\x02\x06",
                                              "\x60\x64\x60\x00\0\0\0\0",         "\x00\x64\x60\x00\0\0\0\0"};
    sdo_read(&sdo, 0x6064, 0, 3);
    expect("\x40\x64\x60\x00\0\0\0\0");
    for (size_t i = 0; i < 6; i++) {
        answer(k_strangers[i]);
        TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
    }
    sdo_receive(&sdo, &(can_frame_t){.id = 0x585, .length = 4, .data = {0x43, 0x64, 0x60, 0}});
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
    answer("\x4F\x64\x60\x00\x07\0\0\0");
    TEST_ASSERT_EQUAL_HEX32(7, sdo_value_u32(&sdo));
}

static void test_receive_before_the_question_has_gone_is_dropped(void)
{
    sdo_read(&sdo, 0x6064, 0, 1);
    answer("\x4F\x64\x60\x00\x07\0\0\0");
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
    expect("\x40\x64\x60\x00\0\0\0\0");
    answer("\x4F\x64\x60\x00\x08\0\0\0");
    TEST_ASSERT_EQUAL_HEX32(8, sdo_value_u32(&sdo));
    answer("\x4F\x64\x60\x00\x09\0\0\0"); /* nor when it was answered */
    TEST_ASSERT_EQUAL_HEX32(8, sdo_value_u32(&sdo));
}

static void test_receive_remote_frame_is_dropped(void)
{
    sdo_read(&sdo, 0x6064, 0, 1);
    expect("\x40\x64\x60\x00\0\0\0\0");
    sdo_receive(&sdo, &(can_frame_t){.id = 0x585, .is_rtr = true, .length = 8, .data = {0x4F, 0x64, 0x60, 0}});
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
}

/* Between segments the answer to the first question once more is no segment; an abort counts, whatever object it names. */
static void test_receive_between_segments_segments_and_aborts_alone_count(void)
{
    sdo_read(&sdo, 0x1008, 0, 1);
    expect("\x40\x08\x10\x00\0\0\0\0");
    answer("\x41\x08\x10\x00\x0A\0\0\0");
    expect("\x60\0\0\0\0\0\0\0");
    answer("\x41\x08\x10\x00\x0A\0\0\0");
    expect_nothing();
    answer("\x00"
           "ABCDEFG");
    expect("\x70\0\0\0\0\0\0\0");
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
    answer("\x80\0\0\0\x00\x00\x00\x08");
    TEST_ASSERT_EQUAL(SDO_ABORTED, sdo.state);
    TEST_ASSERT_EQUAL_HEX32(0x08000000, sdo.abort_code);
    expect_nothing();
}

static void test_step_no_answer_aborts_waits_and_tries_again(void)
{
    sdo_read(&sdo, 0x6064, 0, 3);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
        expect("\x40\x64\x60\x00\0\0\0\0");
        now_us += TIMEOUT_US - 1;
        expect_nothing();
        now_us += 1;
        expect("\x80\x64\x60\x00\x00\x00\x04\x05");
        now_us += TIMEOUT_US - 1;
        expect_nothing();
        now_us += 1;
    }
    expect_nothing();
    TEST_ASSERT_EQUAL(SDO_SILENT, sdo.state);
}

/* Late, but what was asked for; of segments there would be more to ask. */
static void test_receive_in_the_pause_whole_answers_count(void)
{
    sdo_read(&sdo, 0x6064, 0, 3);
    expect("\x40\x64\x60\x00\0\0\0\0");
    wait();
    expect("\x80\x64\x60\x00\x00\x00\x04\x05");
    answer("\x43\x64\x60\x00\x01\x02\x03\x04");
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
    sdo_write(&sdo, 0x6060, 0, (const uint8_t *)"\x08", 1, 3);
    expect("\x2F\x60\x60\x00\x08\0\0\0");
    wait();
    expect("\x80\x60\x60\x00\x00\x00\x04\x05");
    answer("\x60\x60\x60\x00\0\0\0\0");
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
    sdo_read(&sdo, 0x1008, 0, 3);
    expect("\x40\x08\x10\x00\0\0\0\0");
    wait();
    expect("\x80\x08\x10\x00\x00\x00\x04\x05");
    answer("\x41\x08\x10\x00\x0A\0\0\0");
    expect_nothing();
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
    wait();
    expect("\x40\x08\x10\x00\0\0\0\0");
    answer("\x41\x08\x10\x00\x0A\0\0\0");
    expect("\x60\0\0\0\0\0\0\0");
    wait();
    expect("\x80\x08\x10\x00\x00\x00\x04\x05");
    answer("\x09"
           "ABC\0\0\0\0");
    TEST_ASSERT_EQUAL(SDO_BUSY, sdo.state);
}

static void test_step_second_attempt_that_is_answered_is_as_good(void)
{
    sdo_write(&sdo, 0x2000, 1, (const uint8_t *)"abcdefghij", 10, 2);
    expect("\x21\x00\x20\x01\x0A\0\0\0");
    answer("\x60\x00\x20\x01\0\0\0\0");
    expect("\x00"
           "abcdefg");
    wait();
    expect("\x80\x00\x20\x01\x00\x00\x04\x05");
    wait();
    expect("\x21\x00\x20\x01\x0A\0\0\0");
    answer("\x60\x00\x20\x01\0\0\0\0");
    expect("\x00"
           "abcdefg");
    answer("\x20\0\0\0\0\0\0\0");
    expect("\x19"
           "hij\0\0\0\0");
    answer("\x30\0\0\0\0\0\0\0");
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
}

static void test_step_bus_that_takes_nothing_is_offered_the_same_again(void)
{
    sdo_read(&sdo, 0x6064, 0, 1);
    for (int i = 0; i < 5; i++) {
        wait();
        TEST_ASSERT_TRUE(sdo_step(&sdo, now_us, &request));
        TEST_ASSERT_EQUAL_HEX8(0x40, request.data[0]);
    }
    sdo_sent(&sdo, now_us);
    answer("\x4F\x64\x60\x00\x07\0\0\0");
    TEST_ASSERT_EQUAL(SDO_DONE, sdo.state);
}

static void test_texts_every_number_has_words(void)
{
    TEST_ASSERT_EQUAL_STRING("unknown abort code", canopen_abort_text(0x12345678));
    TEST_ASSERT_EQUAL_STRING("continuous over-current", canopen_error_text(0x2310));
    TEST_ASSERT_EQUAL_STRING("current", canopen_error_text(0x2330));
    TEST_ASSERT_EQUAL_STRING("following error", canopen_error_text(0x8611));
    for (uint32_t code = 0; code <= 0xFFFF; code++) {
        TEST_ASSERT_TRUE(canopen_error_text((uint16_t)code)[0] != '\0');
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_read_expedited_every_size_gives_the_value);
    RUN_TEST(test_write_expedited_every_size_has_its_command);
    RUN_TEST(test_read_segments_are_put_together);
    RUN_TEST(test_write_segments_are_taken_apart);
    RUN_TEST(test_receive_repeated_segment_is_dropped);
    RUN_TEST(test_receive_toggle_wrong_for_good_is_named);
    RUN_TEST(test_receive_short_answers_count_if_they_are_whole);
    RUN_TEST(test_step_answers_that_cannot_be_used_are_named);
    RUN_TEST(test_receive_in_the_pause_whole_answers_count);
    RUN_TEST(test_read_more_than_there_is_room_for_is_refused);
    RUN_TEST(test_receive_abort_ends_the_transfer_with_its_code);
    RUN_TEST(test_receive_about_something_else_is_dropped);
    RUN_TEST(test_receive_before_the_question_has_gone_is_dropped);
    RUN_TEST(test_receive_remote_frame_is_dropped);
    RUN_TEST(test_receive_between_segments_segments_and_aborts_alone_count);
    RUN_TEST(test_step_no_answer_aborts_waits_and_tries_again);
    RUN_TEST(test_step_second_attempt_that_is_answered_is_as_good);
    RUN_TEST(test_step_bus_that_takes_nothing_is_offered_the_same_again);
    RUN_TEST(test_texts_every_number_has_words);
    return UNITY_END();
}

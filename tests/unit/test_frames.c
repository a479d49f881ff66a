/* SPDX-License-Identifier: MIT
 * test_frames.c - files of frames: every form of a line, every way it can be wrong, whole files, and what a recording writes.
 */
#include "record/frames.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "record/record.h"
#include "unity.h"

static char m_text[512];
static frames_line_t m_line;
static bool m_is_empty;
static const char *m_why;
static char m_path[] = "/tmp/heave_frames_XXXXXX";
static char m_errors[1024];

void setUp(void)
{
    m_line = (frames_line_t){.line = 7};
    m_is_empty = false;
    m_why = NULL;
    strcpy(m_path, "/tmp/heave_frames_XXXXXX");
    close(mkstemp(m_path));
}

void tearDown(void)
{
    unlink(m_path);
}

static bool parse_bytes(const char *text, size_t length)
{
    memcpy(m_text, text, length);
    return frames_parse_line(m_text, length, &m_line, &m_is_empty, &m_why);
}

static bool parse(const char *text)
{
    return parse_bytes(text, strlen(text));
}

static void expect_datagram(const char *text, uint64_t t_us, const char *bytes, size_t length)
{
    TEST_ASSERT_TRUE_MESSAGE(parse(text), text);
    TEST_ASSERT_FALSE_MESSAGE(m_is_empty, text);
    TEST_ASSERT_EQUAL_INT_MESSAGE(FRAMES_DATAGRAM, m_line.kind, text);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(t_us, m_line.t_us, text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(length, m_line.length, text);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(bytes, m_line.text, length, text);
}

static void expect_wrong(const char *text, const char *part)
{
    TEST_ASSERT_FALSE_MESSAGE(parse(text), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_why, part), m_why);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_why, "; "), "says what is allowed");
}

static int load(const char *content, size_t length, frames_t *frames)
{
    FILE *file = fopen(m_path, "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_UINT(length, fwrite(content, 1, length, file));
    TEST_ASSERT_EQUAL_INT(0, fclose(file));
    memset(m_errors, 0, sizeof m_errors);
    FILE *errors = fmemopen(m_errors, sizeof m_errors - 1, "w");
    const int bad = frames_load(frames, m_path, errors);
    fclose(errors);
    return bad;
}

static void test_frames_parse_line_time_is_exact(void)
{
    expect_datagram("0 a", 0, "a", 1);
    expect_datagram("1 a", 1000, "a", 1);
    expect_datagram("1.5 a", 1500, "a", 1);
    expect_datagram("1.05 a", 1050, "a", 1);
    expect_datagram("1.005 a", 1005, "a", 1);
    expect_datagram("0012.340 a", 12340, "a", 1);
    expect_datagram(" \t7 a", 7000, "a", 1);
    expect_datagram("4294967295.999 a", 4294967295999u, "a", 1);
}

static void test_frames_parse_line_text_keeps_blanks_inside_and_behind(void)
{
    expect_datagram("1 \t @A6: 1, 2#  ", 1000, "@A6: 1, 2#  ", 12);
    expect_datagram("1 @A6:1#\r", 1000, "@A6:1#", 6);
    expect_datagram("1 ;x", 1000, ";x", 2);
}

static void test_frames_parse_line_escapes_become_bytes(void)
{
    expect_datagram("1 \\n\\r\\t\\0\\\\\\\"", 1000, "\n\r\t\0\\\"", 6);
    expect_datagram("1 \\x00\\xfF\\x21engage", 1000, "\0\xff!engage", 9);
    expect_datagram("1 a\\0b", 1000, "a\0b", 3);
}

static void test_frames_parse_line_raw_bytes_stay(void)
{
    TEST_ASSERT_TRUE(parse_bytes("1 \xd0\x90\0b", 6));
    TEST_ASSERT_EQUAL_UINT32(4, m_line.length);
    TEST_ASSERT_EQUAL_MEMORY("\xd0\x90\0b", m_line.text, 4);
}

static void test_frames_parse_line_empty_and_comment_are_nothing(void)
{
    static const char *const k_lines[] = {"", "   ", "\r", "\t\r", ";", "; 1 a", "  ;x"};
    for (size_t i = 0; i < sizeof k_lines / sizeof k_lines[0]; i++) {
        m_is_empty = false;
        TEST_ASSERT_TRUE(parse(k_lines[i]));
        TEST_ASSERT_TRUE_MESSAGE(m_is_empty, k_lines[i]);
    }
}

static void test_frames_parse_line_requests(void)
{
    static const struct {
        const char *text;
        event_t event;
    } k_requests[] = {{"1 !engage", EVENT_ENGAGE}, {"1 !hold", EVENT_HOLD},   {"1 !resume", EVENT_RESUME},
                      {"1 !park ", EVENT_PARK},    {"1 !reset", EVENT_RESET}, {"1 !shutdown\r", EVENT_SHUTDOWN}};
    for (size_t i = 0; i < sizeof k_requests / sizeof k_requests[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(parse(k_requests[i].text), k_requests[i].text);
        TEST_ASSERT_EQUAL_INT(FRAMES_REQUEST, m_line.kind);
        TEST_ASSERT_EQUAL_INT(k_requests[i].event, m_line.request);
    }
}

static void test_frames_parse_line_intensity(void)
{
    TEST_ASSERT_TRUE(parse("1 !intensity 50"));
    TEST_ASSERT_EQUAL_INT(FRAMES_INTENSITY, m_line.kind);
    TEST_ASSERT_EQUAL_UINT32(50, m_line.number);
    expect_wrong("1 !intensity", "!intensity without its percent");
    expect_wrong("1 !intensity -1", "!intensity without its percent");
    expect_wrong("1 !intensity 1000", "!intensity without its percent");
    expect_wrong("1 !intensity 50 %", "more on the line");
}

static void test_frames_parse_line_estop_and_late(void)
{
    TEST_ASSERT_TRUE(parse("1 !estop on"));
    TEST_ASSERT_EQUAL_INT(FRAMES_ESTOP, m_line.kind);
    TEST_ASSERT_EQUAL_UINT32(1, m_line.number);
    TEST_ASSERT_TRUE(parse("1 !estop  off"));
    TEST_ASSERT_EQUAL_UINT32(0, m_line.number);
    TEST_ASSERT_TRUE(parse("1 !late 4294967295"));
    TEST_ASSERT_EQUAL_INT(FRAMES_LATE, m_line.kind);
    TEST_ASSERT_EQUAL_UINT32(4294967295u, m_line.number);
}

static void test_frames_parse_line_faults_and_the_end(void)
{
    TEST_ASSERT_TRUE(parse("1 !fault following-error 3"));
    TEST_ASSERT_EQUAL_INT(FRAMES_FAULT, m_line.kind);
    TEST_ASSERT_EQUAL_INT(FAULT_FOLLOWING, m_line.fault);
    TEST_ASSERT_EQUAL_UINT8(3, m_line.drive);
    TEST_ASSERT_TRUE(parse("1 !fault bus-lost"));
    TEST_ASSERT_EQUAL_INT(FAULT_BUS, m_line.fault);
    TEST_ASSERT_EQUAL_UINT8(0, m_line.drive);
    TEST_ASSERT_TRUE(parse("1 !end"));
    TEST_ASSERT_EQUAL_INT(FRAMES_END, m_line.kind);
}

static void test_frames_parse_line_bad_time_is_refused(void)
{
    expect_wrong("@A6:1#", "no time");
    expect_wrong("-1 a", "no time");
    expect_wrong("+1 a", "no time");
    expect_wrong(".5 a", "no time");
    expect_wrong("1e3 a", "no time");
    expect_wrong("1,5 a", "no time");
    expect_wrong("1:2 a", "no time");
    expect_wrong("1. a", "three decimals");
    expect_wrong("1.2345 a", "three decimals");
    expect_wrong("1.0000 a", "three decimals");
    expect_wrong("4294967296 a", "out of range");
    expect_wrong("99999999999999999999999999 a", "out of range");
    expect_wrong("5", "nothing after");
    expect_wrong("5   ", "nothing after");
}

static void test_frames_parse_line_bad_text_is_refused(void)
{
    expect_wrong("1 \\", "escape");
    expect_wrong("1 a\\q", "escape");
    expect_wrong("1 \\x4", "escape");
    expect_wrong("1 \\xg0", "escape");
    expect_wrong("1 \\x0g", "escape");
    expect_wrong("1 \\X41", "escape");
    expect_wrong("1 \\1", "escape");
    expect_wrong("1 \\012", "octal");
}

static void test_frames_parse_line_bad_request_is_refused(void)
{
    static const struct {
        const char *line, *why;
    } k_wrong[] = {{"1 !", "unknown request; !engage"},
                   {"1 !Engage", "unknown request"},
                   {"1 !engaged", "unknown request"},
                   {"1 ! engage", "unknown request"},
                   {"1 !engage now", "more on the line"},
                   {"1 !estop", "!estop without"},
                   {"1 !estop maybe", "!estop without"},
                   {"1 !estop on off", "more on the line"},
                   {"1 !late", "!late without"},
                   {"1 !late -1", "!late without"},
                   {"1 !late 4294967296", "!late without"},
                   {"1 !late 1x", "more on the line"},
                   {"1 !from", "!from without a numeric address"},
                   {"1 !from somewhere", "!from without a numeric address"},
                   {"1 !drive 0 back", "!drive without"},
                   {"1 !drive 8 back", "!drive without"},
                   {"1 !drive 1", "!drive without"},
                   {"1 !drive 1 fault", "!drive without"},
                   {"1 !drive 1 gone", "!drive without"},
                   {"1 !drive 1 fault 123456789", "more on the line"},
                   {"1 !fault", "!fault without its code"},
                   {"1 !fault none", "!fault without its code"},
                   {"1 !fault bus", "!fault without its code"},
                   {"1 !fault drive-dropped", "!fault without its code"},
                   {"1 !fault drive-dropped 0", "!fault without its code"},
                   {"1 !fault drive-dropped 8", "!fault without its code"},
                   {"1 !fault bus-lost 1", "more on the line"},
                   {"1 !end now", "more on the line"}};
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        expect_wrong(k_wrong[i].line, k_wrong[i].why);
    }
}

static void test_frames_load_file_without_last_newline(void)
{
    static const char k_file[] = "\xEF\xBB\xBF; head\r\n\r\n1 a\r\n1 b\n2.5 !hold";
    frames_t frames;
    TEST_ASSERT_EQUAL_INT(0, load(k_file, sizeof k_file - 1, &frames));
    TEST_ASSERT_EQUAL_UINT(3, frames.count);
    TEST_ASSERT_EQUAL_UINT32(3, frames.line[0].line);
    TEST_ASSERT_EQUAL_UINT32(4, frames.line[1].line);
    TEST_ASSERT_EQUAL_UINT32(5, frames.line[2].line);
    TEST_ASSERT_EQUAL_INT(FRAMES_REQUEST, frames.line[2].kind);
    frames_free(&frames);
}

static void test_frames_load_utf_16_is_refused_by_its_name(void)
{
    static const char *const k_marks[] = {"\xFF\xFE", "\xFE\xFF"};
    for (unsigned i = 0; i < 2; i++) {
        char file[8] = "xx1 a\n";
        frames_t frames;
        memcpy(file, k_marks[i], 2);
        TEST_ASSERT_EQUAL_INT(1, load(file, 6, &frames));
        TEST_ASSERT_NOT_NULL(strstr(m_errors, ":1: the file is UTF-16; allowed: plain text (UTF-8)\n"));
        frames_free(&frames);
    }
}

static void test_frames_load_all_bad_lines_are_reported(void)
{
    static const char k_file[] = "5 a\nx\n4.999 b\n6 \\q\n7 c\n";
    frames_t frames;
    TEST_ASSERT_EQUAL_INT(3, load(k_file, sizeof k_file - 1, &frames));
    TEST_ASSERT_NOT_NULL(strstr(m_errors, ":2: no time"));
    TEST_ASSERT_NOT_NULL(strstr(m_errors, ":3: 4.999 ms is before the 5.000 ms of line 1; times must not decrease\n"));
    TEST_ASSERT_NOT_NULL(strstr(m_errors, ":4: unknown escape"));
    TEST_ASSERT_EQUAL_PTR(m_errors, strstr(m_errors, m_path));
    frames_free(&frames);
}

static void test_frames_load_datagrams_and_requests_are_in_order_each_for_themselves(void)
{
    static const char k_file[] = "5 !hold\n4.2 a\n4.9 b\n6 !resume\n5.999 !hold\n4.8 c\n";
    frames_t frames;
    TEST_ASSERT_EQUAL_INT(2, load(k_file, sizeof k_file - 1, &frames));
    TEST_ASSERT_NOT_NULL(strstr(m_errors, ":5: 5.999 ms is before the 6.000 ms of line 4; times must not decrease\n"));
    TEST_ASSERT_NOT_NULL(strstr(m_errors, ":6: 4.800 ms is before the 4.900 ms of line 3; times must not decrease\n"));
    frames_free(&frames);
}

static void test_frames_load_empty_file_holds_nothing(void)
{
    frames_t frames;
    TEST_ASSERT_EQUAL_INT(0, load("", 0, &frames));
    TEST_ASSERT_EQUAL_UINT(0, frames.count);
    frames_free(&frames);
}

static void test_frames_load_many_lines_all_arrive(void)
{
    enum { LINES = 20000 };
    char *content = malloc(LINES * 16);
    size_t length = 0;
    frames_t frames;
    for (unsigned i = 0; i < LINES; i++) {
        length += (size_t)sprintf(&content[length], "%u.%03u x%u\n", i / 7, i % 7, i);
    }
    TEST_ASSERT_EQUAL_INT(0, load(content, length, &frames));
    TEST_ASSERT_EQUAL_UINT(LINES, frames.count);
    for (unsigned i = 0; i < LINES; i++) {
        char expected[16];
        TEST_ASSERT_EQUAL_UINT64((uint64_t)(i / 7) * 1000 + i % 7, frames.line[i].t_us);
        TEST_ASSERT_EQUAL_UINT32((uint32_t)sprintf(expected, "x%u", i), frames.line[i].length);
        TEST_ASSERT_EQUAL_MEMORY(expected, frames.line[i].text, frames.line[i].length);
    }
    frames_free(&frames);
    free(content);
}

static void test_frames_load_missing_file_is_an_error(void)
{
    frames_t frames;
    TEST_ASSERT_EQUAL_INT(-1, frames_load(&frames, "/nonexistent/frames", stderr));
    frames_free(&frames);
}

/* --- Recordings: what the writer writes, the reader reads --- */

static const hal_udp_peer_t k_here = {.address = {127, 0, 0, 1}};

static record_writer_t started_writer(void)
{
    record_writer_t writer;
    char line[RECORD_LINE_MAX];
    const record_t zero = {
        .head = {.t_us = 5000, .value = record_zero(STATE_SETTLED, 0, MOTION_RISE_PERCENT_MAX), .kind = RECORD_ZERO}};
    record_writer_init(&writer, &(settings_t){.cycle_us = 1000}, false);
    TEST_ASSERT_GREATER_THAN_UINT(0, record_writer_line(&writer, &zero, 0, line));
    return writer;
}

/* Parses a line of the writer, its newline taken off. */
static void read_back(char *line, size_t length)
{
    TEST_ASSERT_EQUAL_INT('\n', line[length - 1]);
    TEST_ASSERT_NULL(memchr(line, '\n', length - 1));
    const bool is_read = frames_parse_line(line, length - 1, &m_line, &m_is_empty, &m_why);
    TEST_ASSERT_TRUE_MESSAGE(is_read, m_why);
    TEST_ASSERT_FALSE(m_is_empty);
}

static void test_record_writer_every_datagram_reads_back(void)
{
    record_writer_t writer = started_writer();
    char line[RECORD_LINE_MAX];
    uint32_t random = 1;
    for (unsigned round = 0; round < 20000; round++) {
        record_t record = {.head = {.from = k_here, .t_us = 5000 + round * 37, .kind = RECORD_DATAGRAM}};
        random = random * 1664525u + 1013904223u;
        const size_t length = round % 100 == 0 ? GATEWAY_DATAGRAM_MAX : 1 + (random >> 20) % 40;
        for (size_t i = 0; i < length; i++) {
            random = random * 1664525u + 1013904223u;
            record.bytes[i] = (uint8_t)((random >> 28) < 8 ? " !\\;\t0\nx"[(random >> 24) % 8] : (int)(random >> 16));
        }
        read_back(line, record_writer_line(&writer, &record, length, line));
        TEST_ASSERT_EQUAL_INT(FRAMES_DATAGRAM, m_line.kind);
        TEST_ASSERT_EQUAL_UINT64(round * 37, m_line.t_us);
        TEST_ASSERT_EQUAL_UINT32(length, m_line.length);
        TEST_ASSERT_EQUAL_MEMORY(record.bytes, m_line.text, length);
    }
}

static void test_record_writer_requests_read_back(void)
{
    static const event_t k_events[] = {EVENT_ENGAGE, EVENT_HOLD, EVENT_RESUME, EVENT_PARK, EVENT_RESET, EVENT_SHUTDOWN};
    record_writer_t writer = started_writer();
    char line[RECORD_LINE_MAX];
    for (size_t i = 0; i < sizeof k_events / sizeof k_events[0]; i++) {
        const record_t record = {.head = {.t_us = 6000, .value = (uint32_t)k_events[i], .kind = RECORD_REQUEST}};
        read_back(line, record_writer_line(&writer, &record, 0, line));
        TEST_ASSERT_EQUAL_INT(FRAMES_REQUEST, m_line.kind);
        TEST_ASSERT_EQUAL_INT(k_events[i], m_line.request);
        TEST_ASSERT_EQUAL_UINT64(1000, m_line.t_us);
    }
}

static void test_record_writer_estop_and_late_read_back(void)
{
    record_writer_t writer = started_writer();
    char line[RECORD_LINE_MAX];
    record_t record = {.head = {.t_us = 6000, .value = 1, .kind = RECORD_ESTOP}};
    read_back(line, record_writer_line(&writer, &record, 0, line));
    TEST_ASSERT_EQUAL_INT(FRAMES_ESTOP, m_line.kind);
    TEST_ASSERT_EQUAL_UINT32(1, m_line.number);
    record.head.value = 12;
    record.head.kind = RECORD_LATE;
    read_back(line, record_writer_line(&writer, &record, 0, line));
    TEST_ASSERT_EQUAL_INT(FRAMES_LATE, m_line.kind);
    TEST_ASSERT_EQUAL_UINT32(12, m_line.number);
}

/* Reads what the writer wrote as a file and tells the sender of its only datagram. */
static void expect_sender(const char *lines, size_t length, const hal_udp_peer_t *from)
{
    char path[] = "/tmp/heave-frames-XXXXXX";
    const int fd = mkstemp(path);
    TEST_ASSERT_EQUAL_INT((int)length, (int)write(fd, lines, length));
    (void)close(fd);
    frames_t frames;
    TEST_ASSERT_EQUAL_INT(0, frames_load(&frames, path, stderr));
    TEST_ASSERT_EQUAL_UINT(1, frames.count);
    TEST_ASSERT_TRUE(hal_udp_is_same_host(from, &frames.line[0].from));
    frames_free(&frames);
    (void)remove(path);
}

static void test_record_writer_another_sender_reads_back(void)
{
    static const hal_udp_peer_t k_from[] = {
        {.address = {192, 168, 1, 5}, .port = 4000},
        {.address = {0xfe, 0x80, [15] = 7}, .scope_id = 3, .is_ipv6 = true},
        {.address = {0x20, 1, 0xd, 0xb8, [15] = 1}, .is_ipv6 = true},
    };
    for (size_t i = 0; i < sizeof k_from / sizeof k_from[0]; i++) {
        record_writer_t writer = started_writer();
        char line[RECORD_LINE_MAX];
        const record_t record = {.head = {.from = k_from[i], .t_us = 6000, .kind = RECORD_DATAGRAM}, .bytes = "@A6:1#"};
        expect_sender(line, record_writer_line(&writer, &record, 6, line), &k_from[i]);
        read_back(line, record_writer_line(&writer, &record, 6, line)); /* the same one again: no more lines than one */
        TEST_ASSERT_EQUAL_INT(FRAMES_DATAGRAM, m_line.kind);
    }
}

/* What stands before time zero is a comment. */
static void test_record_writer_before_zero_writes_comments(void)
{
    record_writer_t writer;
    char line[RECORD_LINE_MAX];
    record_t record = {.head = {.t_us = 1500, .kind = RECORD_DATAGRAM}, .bytes = "@A6:1#"};
    record_writer_init(&writer, &(settings_t){.cycle_us = 1000}, false);
    const size_t length = record_writer_line(&writer, &record, 6, line);
    TEST_ASSERT_EQUAL_UINT(strlen("; 1.500 @A6:1#\n"), length);
    TEST_ASSERT_EQUAL_MEMORY("; 1.500 @A6:1#\n", line, length);
}

static void expect_zero(engage_policy_t engage, state_t goal, const char *expected)
{
    record_writer_t writer;
    char line[RECORD_LINE_MAX];
    const record_t zero = {.head = {.t_us = 5000, .value = record_zero(goal, 0, MOTION_RISE_PERCENT_MAX), .kind = RECORD_ZERO}};
    record_writer_init(&writer, &(settings_t){.cycle_us = 500}, engage == ENGAGE_AUTO);
    const size_t length = record_writer_line(&writer, &zero, 0, line);
    line[length] = '\0';
    TEST_ASSERT_EQUAL_STRING(expected, line);
}

static void test_record_writer_zero_brings_an_offline_run_to_the_same_intensity(void)
{
    const settings_t settings = {.cycle_us = 500, .intensity_start_percent = 70};
    record_writer_t writer;
    char line[RECORD_LINE_MAX];
    record_t zero = {
        .head = {.t_us = 5000, .value = record_zero(STATE_ENGAGED, 40, MOTION_RISE_PERCENT_MAX), .kind = RECORD_ZERO}};
    record_writer_init(&writer, &settings, false);
    line[record_writer_line(&writer, &zero, 0, line)] = '\0';
    TEST_ASSERT_EQUAL_STRING("; time zero: SETTLED\n0.500 !intensity 40\n0.500 !engage\n", line);
    zero.head.value = record_zero(STATE_SETTLED, 70, MOTION_RISE_PERCENT_MAX);
    line[record_writer_line(&writer, &zero, 0, line)] = '\0';
    TEST_ASSERT_EQUAL_STRING("; time zero: SETTLED\n", line);
}

static void test_record_writer_zero_brings_an_offline_run_to_the_same_rise(void)
{
    record_writer_t writer;
    char line[RECORD_LINE_MAX];
    const record_t zero = {.head = {.t_us = 5000, .value = record_zero(STATE_ENGAGED, 70, 10), .kind = RECORD_ZERO}};
    record_writer_init(&writer, &(settings_t){.cycle_us = 500, .intensity_start_percent = 70}, false);
    line[record_writer_line(&writer, &zero, 0, line)] = '\0';
    TEST_ASSERT_EQUAL_STRING("; time zero: SETTLED\n0.500 !rise 10\n0.500 !engage\n", line);
}

static void test_record_writer_rise_reads_back(void)
{
    record_writer_t writer = started_writer();
    char line[RECORD_LINE_MAX];
    const record_t record = {.head = {.t_us = 6000, .value = 10, .kind = RECORD_RISE}};
    read_back(line, record_writer_line(&writer, &record, 0, line));
    TEST_ASSERT_EQUAL_INT(FRAMES_RISE, m_line.kind);
    TEST_ASSERT_EQUAL_UINT32(10, m_line.number);
    expect_wrong("1 !rise", "!rise without its percent");
    expect_wrong("1 !rise 1000", "!rise without its percent");
}

static void test_record_writer_intensity_reads_back(void)
{
    record_writer_t writer = started_writer();
    char line[RECORD_LINE_MAX];
    const record_t record = {.head = {.t_us = 6000, .value = 45, .kind = RECORD_INTENSITY}};
    read_back(line, record_writer_line(&writer, &record, 0, line));
    TEST_ASSERT_EQUAL_INT(FRAMES_INTENSITY, m_line.kind);
    TEST_ASSERT_EQUAL_UINT32(45, m_line.number);
}

static void test_record_writer_zero_brings_an_offline_run_to_the_same_goal(void)
{
    expect_zero(ENGAGE_MANUAL, STATE_SETTLED, "; time zero: SETTLED\n");
    expect_zero(ENGAGE_MANUAL, STATE_ENGAGED, "; time zero: SETTLED\n0.500 !engage\n");
    expect_zero(ENGAGE_MANUAL, STATE_OFF, "; time zero: SETTLED\n0.500 !shutdown\n");
    expect_zero(ENGAGE_AUTO, STATE_ENGAGED, "; time zero: SETTLED\n");
    expect_zero(ENGAGE_AUTO, STATE_SETTLED, "; time zero: SETTLED\n0.500 !park\n");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frames_parse_line_time_is_exact);
    RUN_TEST(test_frames_parse_line_text_keeps_blanks_inside_and_behind);
    RUN_TEST(test_frames_parse_line_escapes_become_bytes);
    RUN_TEST(test_frames_parse_line_raw_bytes_stay);
    RUN_TEST(test_frames_parse_line_empty_and_comment_are_nothing);
    RUN_TEST(test_frames_parse_line_requests);
    RUN_TEST(test_frames_parse_line_intensity);
    RUN_TEST(test_frames_parse_line_estop_and_late);
    RUN_TEST(test_frames_parse_line_faults_and_the_end);
    RUN_TEST(test_frames_parse_line_bad_time_is_refused);
    RUN_TEST(test_frames_parse_line_bad_text_is_refused);
    RUN_TEST(test_frames_parse_line_bad_request_is_refused);
    RUN_TEST(test_frames_load_file_without_last_newline);
    RUN_TEST(test_frames_load_utf_16_is_refused_by_its_name);
    RUN_TEST(test_frames_load_all_bad_lines_are_reported);
    RUN_TEST(test_frames_load_datagrams_and_requests_are_in_order_each_for_themselves);
    RUN_TEST(test_frames_load_empty_file_holds_nothing);
    RUN_TEST(test_frames_load_many_lines_all_arrive);
    RUN_TEST(test_frames_load_missing_file_is_an_error);
    RUN_TEST(test_record_writer_every_datagram_reads_back);
    RUN_TEST(test_record_writer_requests_read_back);
    RUN_TEST(test_record_writer_estop_and_late_read_back);
    RUN_TEST(test_record_writer_another_sender_reads_back);
    RUN_TEST(test_record_writer_before_zero_writes_comments);
    RUN_TEST(test_record_writer_zero_brings_an_offline_run_to_the_same_goal);
    RUN_TEST(test_record_writer_zero_brings_an_offline_run_to_the_same_intensity);
    RUN_TEST(test_record_writer_intensity_reads_back);
    RUN_TEST(test_record_writer_zero_brings_an_offline_run_to_the_same_rise);
    RUN_TEST(test_record_writer_rise_reads_back);
    return UNITY_END();
}

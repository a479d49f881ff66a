/* SPDX-License-Identifier: MIT
 * test_frame.c - frames in, commands or reasons out: the vendor's examples, every reason with its place, and hostile input.
 * What a datagram leads to is written as one line: `A6 327680 ... mask=240; !count@23/0` (command, Q16.16 values, then mask, time
 * or nomask; `!reason@offset/field`). The oracle is a second scanner that works on whole texts and on the schoolbook number
 * model.
 */
#include "heave/frame.h"
#include "frame_oracle.h"
#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EVENTS_MAX 2000
#define UNTOUCHED  0x5A

static uint64_t s_random;

void setUp(void)
{
    s_random = UINT64_C(0x9E3779B97F4A7C15);
}
void tearDown(void) {}

/* xorshift64*: the same sequence everywhere. */
static uint64_t next_random(void)
{
    s_random ^= s_random >> 12;
    s_random ^= s_random << 25;
    s_random ^= s_random >> 27;
    return s_random * UINT64_C(2685821657736338717) >> 11;
}

static unsigned below(unsigned end)
{
    return (unsigned)(next_random() % end);
}

/* ---- events as text ---- */

static void add_frame(line_t *line, const frame_t *frame)
{
    line_add(line, "%s%s%s", line->length > 0 ? "; " : "", frame_command_name(frame->command), frame->is_timed ? "T" : "");
    TEST_ASSERT_EQUAL_UINT(frame_value_count(frame->command), frame->count);
    for (unsigned i = 0; i < frame->count; i++) {
        line_add(line, " %d", (int)frame->value_q16[i]);
    }
    for (unsigned i = frame->count; i < FRAME_VALUES_MAX; i++) {
        TEST_ASSERT_EQUAL_INT32(0, frame->value_q16[i]);
    }
    if (frame->is_timed) {
        TEST_ASSERT_FALSE(frame->has_mask);
        line_add(line, " time=%u", (unsigned)frame->time_ms);
    } else if (frame->has_mask) {
        line_add(line, " mask=%u", (unsigned)frame->relay_mask);
    } else {
        line_add(line, " nomask");
    }
}

static void add_reject(line_t *line, const frame_reject_t *reject)
{
    line_add(line, "%s!%s@%u/%u", line->length > 0 ? "; " : "", frame_error_name(reject->error), (unsigned)reject->offset,
             (unsigned)reject->field);
}

/* Only what an event announces may be written. */
static void check_untouched(const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        TEST_ASSERT_EQUAL_HEX8(UNTOUCHED, ((const uint8_t *)bytes)[i]);
    }
}

static void add_event(line_t *line, frame_event_t event, const frame_t *frame, const frame_reject_t *reject)
{
    if (event == FRAME_EVENT_FRAME) {
        add_frame(line, frame);
    } else {
        check_untouched(frame, sizeof *frame);
    }
    if (event == FRAME_EVENT_REJECT) {
        add_reject(line, reject);
    } else {
        check_untouched(reject, sizeof *reject);
    }
}

/* Reads a datagram with frame_next. The bytes are copied to the heap, so that a sanitizer sees any read beyond them. */
static void scan(line_t *line, frame_dialect_t dialect, const char *text, size_t length)
{
    uint8_t *const datagram = malloc(length > 0 ? length : 1);
    TEST_ASSERT_NOT_NULL(datagram);
    memcpy(datagram, text, length);
    frame_scanner_t scanner;
    frame_scanner_init(&scanner, dialect);
    size_t position = 0;
    line->length = 0;
    line->text[0] = '\0';
    for (unsigned events = 0;; events++) {
        frame_t frame;
        frame_reject_t reject;
        memset(&frame, UNTOUCHED, sizeof frame);
        memset(&reject, UNTOUCHED, sizeof reject);
        TEST_ASSERT_LESS_THAN_UINT(EVENTS_MAX, events);
        const frame_event_t event = frame_next(&scanner, datagram, length, &position, &frame, &reject);
        add_event(line, event, &frame, &reject);
        if (event == FRAME_EVENT_NONE) {
            break;
        }
    }
    free(datagram);
}

/* The same byte by byte, as a serial line is read, with a scanner that has read other text before. */
static void scan_bytes(line_t *line, frame_dialect_t dialect, const char *text, size_t length)
{
    frame_scanner_t scanner;
    frame_t frame;
    frame_reject_t reject;
    frame_scanner_init(&scanner, dialect);
    for (const char *before = "@A6:1,2,nan"; *before != '\0'; before++) {
        frame_scanner_feed(&scanner, (uint8_t)*before, (uint8_t)before[1], &frame, &reject);
    }
    TEST_ASSERT_EQUAL_INT(FRAME_EVENT_REJECT, frame_scanner_end(&scanner, &reject));
    line->length = 0;
    line->text[0] = '\0';
    for (size_t i = 0; i <= length; i++) {
        memset(&frame, UNTOUCHED, sizeof frame);
        memset(&reject, UNTOUCHED, sizeof reject);
        const frame_event_t event = i < length ? frame_scanner_feed(&scanner, (uint8_t)text[i],
                                                                    i + 1 < length ? (uint8_t)text[i + 1] : 0, &frame, &reject)
                                               : frame_scanner_end(&scanner, &reject);
        add_event(line, event, &frame, &reject);
    }
}

static line_t s_line, s_other, s_expected;

static void check_length(frame_dialect_t dialect, const char *expected, const char *text, size_t length)
{
    scan(&s_line, dialect, text, length);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(expected, s_line.text, text);
    scan_bytes(&s_other, dialect, text, length);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(expected, s_other.text, text);
}

static void check_v3(const char *expected, const char *text)
{
    check_length(FRAME_V3, expected, text, strlen(text));
}

static void check_lenient(const char *expected, const char *text)
{
    check_length(FRAME_LENIENT, expected, text, strlen(text));
}

/* The one reject of a V3 text. */
static frame_reject_t reject_of(const char *text)
{
    frame_scanner_t scanner;
    frame_t frame;
    frame_reject_t reject;
    size_t position = 0;
    frame_scanner_init(&scanner, FRAME_V3);
    TEST_ASSERT_EQUAL_INT_MESSAGE(FRAME_EVENT_REJECT,
                                  frame_next(&scanner, (const uint8_t *)text, strlen(text), &position, &frame, &reject), text);
    return reject;
}

/* ---- the reference rows ---- */

/* Takes one CSV column, quoted or not; returns where the next one starts. */
static const char *column(const char *at, char *text)
{
    const bool is_quoted = *at == '"';
    size_t length = 0;
    for (at += is_quoted; is_quoted ? *at != '"' : *at != ',' && *at != '\n' && *at != '\0'; at++) {
        text[length++] = *at;
    }
    text[length] = '\0';
    at += is_quoted;
    return at + (*at == ',' || *at == '\n');
}

static void test_next_reference_rows_lead_to_the_stated_events(void)
{
    FILE *file = fopen(HEAVE_TEST_DATA "/frames.csv", "r");
    TEST_ASSERT_NOT_NULL(file);
    char row[1024], columns[7][512];
    unsigned rows = 0;
    TEST_ASSERT_NOT_NULL(fgets(row, sizeof row, file));
    while (fgets(row, sizeof row, file) != NULL) {
        const char *at = row;
        for (unsigned i = 0; i < 7; i++) {
            at = column(at, columns[i]);
        }
        check_v3(columns[5], columns[1]);
        check_lenient(columns[6], columns[1]);
        rows++;
    }
    fclose(file);
    TEST_ASSERT_EQUAL_UINT(50, rows);
}

/* ---- frames ---- */

static void test_next_blanks_around_values_mask_and_time_are_skipped(void)
{
    check_v3("A3 65536 131072 -98304 mask=15", "@A3: 1\t,\t2 , -1.5 , \t0F #");
    check_v3("A3T 65536 131072 196608 time=40", "@A3T:1,2,3,\t40 #");
    check_v3("A3 65536 131072 196608 mask=15", "@A3:1,2,3, 0x0f\t#");
    check_v3("!value_syntax@7/1", "@A3:1  2,2,3,0F#");
    check_v3("!mask@12/4", "@A3:1,2,3,F F#");
    check_v3("!mask@12/4", "@A3:1,2,3,0 x1#");
    check_v3("!command@1/0", "@ A3:1,2,3,0#");
    check_v3("!separator@3/0", "@A3 :1,2,3,0#");
}

static void test_next_line_breaks_around_values_mask_and_time_are_skipped(void)
{
    check_v3("A7T 327680 393216 0 360448 196608 1310720 -1966080 time=3000", "@A7T:5,6,0,\n5.5,3.0,20,\n-30,3000#\n");
    check_v3("A6 327680 393216 0 360448 196608 1310720 mask=240", "@A6:5,6,0,\r\n5.5,3.0\r\n,20,F0\r\n#\r\n");
    check_v3("A6 327680 393216 0 360448 196608 1310720 mask=240", "@A6:\n5,6,0,5.5,3.0,20,\r\nF0#");
    check_v3("A3T 65536 131072 196608 time=40; C3 65536 131072 196608 mask=1", "@A3T:1\n,\n2\n,3,40\n#\r\n@C3:1,2,\n3,1#");
    check_v3("!value_syntax@7/1", "@A3:1\n 2,2,3,0F#");
    check_v3("!value_syntax@5/1", "@A3:-\n1,2,3,0F#");
    check_v3("!mask@12/4", "@A3:1,2,3,F\nF#");
    check_v3("!command@1/0", "@\nA3:1,2,3,0#");
    check_v3("!command@2/0", "@A\n3:1,2,3,0#");
    check_v3("!separator@3/0", "@A3\r\n:1,2,3,0#");
    check_v3("!unfinished@12/0; A3 65536 131072 196608 mask=0", "@A3:1,2,3,1\n@A3:1,2,3,0#");
}

static void test_next_masks_of_one_to_four_digits_keep_their_low_twelve_bits(void)
{
    static const struct {
        const char *text;
        const char *expected;
    } k_rows[] = {{"0", "mask=0"},    {"000A", "mask=10"},    {"a", "mask=10"},
                  {"0xF", "mask=15"}, {"0XfF0", "mask=4080"}, {"0xFFFF", "mask=4095"},
                  {"F000", "mask=0"}, {"1fff", "mask=4095"},  {"0100", "mask=256"}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        char text[64], expected[64];
        sprintf(text, "@C3:1,2,3,%s#", k_rows[i].text);
        sprintf(expected, "C3 65536 131072 196608 %s", k_rows[i].expected);
        check_v3(expected, text);
    }
    check_v3("!mask@12/4", "@C3:1,2,3,0x#");
    check_v3("!mask@14/4", "@C3:1,2,3,00000#");
    check_v3("!mask@16/4", "@C3:1,2,3,0x00000#");
    check_v3("!mask@10/4", "@C3:1,2,3,x1#");
    check_v3("!mask@11/4", "@C3:1,2,3,1x1#");
    check_v3("!mask@12/4", "@C3:1,2,3,00x1#");
    check_v3("!mask@12/4", "@C3:1,2,3,0xx1#");
    check_v3("!mask@13/4", "@C3:1,2,3,0x 1#");
    check_v3("!mask@10/4", "@C3:1,2,3,-1#");
    check_v3("!mask@11/4", "@C3:1,2,3,1.0#");
    check_v3("!mask@11/4", "@C3:1,2,3,0h#");
    check_v3("!mask@11/4", "@C3:1,2,3, #");
}

static void test_next_missing_mask_is_accepted_but_missing_time_is_not(void)
{
    check_v3("A3 65536 131072 196608 nomask", "@A3:1,2,3#");
    check_v3("C7 0 0 0 0 0 0 0 nomask", "@C7:0,0,0,0,0,0,0#");
    check_v3("!time@10/4", "@A3T:1,2,3#");
    check_v3("!time@11/4", "@A3T:1,2,3,#");
    check_v3("!time@13/4", "@A3T:1,2,3, \t#");
}

static void test_next_times_are_rounded_and_bounded(void)
{
    check_v3("A3T 0 0 0 time=0", "@A3T:0,0,0,0#");
    check_v3("A3T 0 0 0 time=0", "@A3T:0,0,0,-0#");
    check_v3("A3T 0 0 0 time=17", "@A3T:0,0,0,16.667#");
    check_v3("A3T 0 0 0 time=16", "@A3T:0,0,0,16.5#");
    check_v3("A3T 0 0 0 time=18", "@A3T:0,0,0,17.5#");
    check_v3("A3T 0 0 0 time=3000", "@A3T:0,0,0,3E3#");
    check_v3("A3T 0 0 0 time=3600000", "@A3T:0,0,0,3600000#");
    check_v3("A3T 0 0 0 time=3600000", "@A3T:0,0,0,3600000.4999999999999999999999#");
    check_v3("!time_range@12/4", "@A3T:0,0,0, 3600000.51#");
    check_v3("!time_range@11/4", "@A3T:0,0,0,3600001#");
    check_v3("!time_range@11/4", "@A3T:0,0,0,1e300#");
    check_v3("!time@12/4", "@A3T:0,0,0, -0.001#");
    check_v3("!time@11/4", "@A3T:0,0,0,-1e300#");
    check_v3("!time@11/4", "@A3T:0,0,0,F0#");
    check_v3("!time@13/4", "@A3T:0,0,0,1e#");
    check_v3("!time@11/4", "@A3T:0,0,0,nan#");
}

static void test_next_datagram_of_several_frames_delivers_each(void)
{
    check_v3("A3 65536 131072 196608 mask=0; C3T 0 0 0 time=7; A3 0 0 0 nomask", "@A3:1,2,3,0#@C3T:0,0,0,7#\r\n @A3:0,0,0#");
    check_length(FRAME_V3, "A3 0 0 0 mask=1", "@A3:0,0,0,1#\r\n\0\0 \t\0", 19);
    check_length(FRAME_V3, "A3 0 0 0 mask=1", "\r\n\0\t @A3:0,0,0,1#", 17);
}

static void test_next_frame_is_over_at_a_nul_and_with_its_datagram(void)
{
    check_length(FRAME_V3, "!unfinished@14/0; A3 65536 131072 196608 mask=1", "@A6:1,2,3,4,5,\0006,0#@A3:1,2,3,1#", 31);
    check_length(FRAME_V3, "!unfinished@12/0", "@A3:0,0,0,F0\0\0", 14);
    check_v3("!unfinished@14/0", "@A3:0,0,0,F0\r\n");
    check_v3("!unfinished@3/0", "@A3");
}

static void test_next_head_inside_an_unfinished_frame_starts_a_new_one(void)
{
    check_v3("!unfinished@2/0; A3 0 0 0 mask=0", "@A@A3:0,0,0,0#");
    check_v3("!unfinished@3/0; A3 0 0 0 mask=0", "@A3@A3:0,0,0,0#");
    check_v3("!unfinished@11/0; A3 0 0 0 mask=0", "@A3:0,0,0,0@A3:0,0,0,0#");
    check_v3("!value_syntax@6/2; A3 0 0 0 mask=0", "@A3:0,x@A3:0,0,0,0#");
    check_v3("!unfinished@1/0; !unfinished@2/0; !unfinished@3/0; !unfinished@4/0", "@@@@");
}

static void test_next_bad_frame_does_not_spoil_its_neighbours(void)
{
    check_v3("A3 0 0 0 mask=1; !value_syntax@16/1; A3 0 0 0 mask=2; !no_head@36/0", "@A3:0,0,0,1#@A3:nan,0,0#@A3:0,0,0,2#zzz");
    check_v3("!no_head@0/0; A3 0 0 0 mask=1; !no_head@17/0; A3 0 0 0 mask=2", "stray@A3:0,0,0,1#A3:0#@A3:0,0,0,2#");
    check_v3("!no_head@0/0; A3 0 0 0 mask=1", "\xEF\xBB\xBF@A3:0,0,0,1#");
}

static void test_next_text_without_any_frame_is_counted(void)
{
    check_v3("!no_head@0/0", "");
    check_v3("!no_head@0/0", "\r\n");
    check_v3("!no_head@0/0", "hello");
    check_v3("!no_head@0/0; !no_head@1/0", "##");
}

/* What Microsoft's C runtime prints for what is no number, whole and rounded, in any place: its `#` ends no frame. */
static void test_next_windows_nan_and_infinity_are_no_numbers(void)
{
    static const char *const k_nans[] = {"1.#QNAN",  "1.#SNAN", "1.#IND", "1.#INF", "1.#IND00",
                                         "1.#INF00", "1.#QN",   "1.#J",   "1.#R",   "1.#qnan"};
    static const char *const k_signs[] = {"", "-", "+", "00", "-00", " "};
    for (unsigned nan = 0; nan < sizeof k_nans / sizeof k_nans[0]; nan++) {
        for (unsigned sign = 0; sign < sizeof k_signs / sizeof k_signs[0]; sign++) {
            for (unsigned place = 1; place <= 6; place++) {
                char text[100] = "@A6:", expected[100];
                for (unsigned value = 1; value <= 6; value++) {
                    const bool is_place = value == place;
                    snprintf(text + strlen(text), 20, "%s%s,", is_place ? k_signs[sign] : "0", is_place ? k_nans[nan] : "");
                }
                strcat(text, "0F#");
                const unsigned hash = (unsigned)(strchr(text, '#') - text);
                snprintf(expected, sizeof expected, "!value_syntax@%u/%u; !no_head@%u/0", hash, place, hash + 1);
                check_v3(expected, text);
                TEST_ASSERT_TRUE(reject_of(text).is_nan);
            }
        }
    }
    check_v3("!value_syntax@10/3; !no_head@11/0", "@A3:0,0,1.#INF#");
    check_v3("!time@13/4; !no_head@14/0", "@A3T:0,0,0,1.#INF#");
    check_v3("!mask@12/4; !no_head@14/0", "@A3:0,0,10,1.#QNAN#");
    check_lenient("!value_syntax@10/3; !no_head@11/0; A3 0 0 0 mask=2", "#A3:0,0,1.#QNAN,0F#A3:0,0,0,2#");
}

static void test_next_one_and_a_point_is_a_number(void)
{
    check_v3("A3 0 0 65536 nomask", "@A3:0,0,1.#");
    check_v3("A3 0 0 -65536 nomask", "@A3:0,0,-1.# \r\n");
    check_v3("A3 0 0 65536 nomask; A3 0 0 0 mask=2", "@A3:0,0,1.#@A3:0,0,0,2#");
    check_length(FRAME_V3, "A3 0 0 65536 nomask", "@A3:0,0,1.#\0", 12);
    check_v3("A3 0 0 65536 nomask; !no_head@12/0", "@A3:0,0,1.# QNAN,0F#");
    check_v3("A3 0 0 65536 nomask; !no_head@12/0", "@A3:0,0,1. #QNAN,0F#");
    check_v3("A3 0 0 131072 nomask; !no_head@11/0", "@A3:0,0,2.#QNAN,0F#");
    check_v3("A3 0 0 65536 nomask; !no_head@12/0", "@A3:0,0,1.0#QNAN,0F#");
    check_v3("A3 0 0 65536 nomask; !no_head@11/0", "@A3:0,0,1.##");
    check_v3("A3T 0 0 0 time=1", "@A3T:0,0,0,1.#");
    check_lenient("A3 0 0 65536 nomask; A3 0 0 0 mask=2", "#A3:0,0,1.##A3:0,0,0,2#");
}

/* ---- rejections ---- */

static void test_next_too_many_values_are_a_count_error_whatever_the_mask_looks_like(void)
{
    check_v3("!count@24/0", "@A6:5,6,0,5.5,3.0,20,-30,F0#");     /* A7's values sent as A6 */
    check_v3("!count@17/0", "@A6:5,5,6,5,0,0,5,5,3,0,20,0,F0#"); /* decimal commas */
    check_v3("!count@15/0", "@A3T:1,2,3,3000,F0#");
    check_v3("!count@14/0", "@A3T:1,2,3,nan,0#");
    check_v3("!count@20/0", "@A3T:1,2,3,999999999,0#");
    TEST_ASSERT_EQUAL_UINT8(8, reject_of("@A6:5,6,0,5.5,3.0,20,-30,F0#").found);
    TEST_ASSERT_EQUAL_UINT8(13, reject_of("@A6:5,5,6,5,0,0,5,5,3,0,20,0,F0#").found);
}

static void test_next_count_found_stops_at_255(void)
{
    char text[1024] = "@A3:1";
    for (unsigned i = 0; i < 300; i++) {
        strcat(text, ",1");
    }
    strcat(text, "#");
    TEST_ASSERT_EQUAL_UINT8(255, reject_of(text).found);
}

static void test_next_first_error_of_a_frame_is_the_one_reported(void)
{
    check_v3("!value_syntax@4/1", "@A6:x,nan,,1e9,1,2,3,4,5,6#");
    check_v3("!value_empty@6/2", "@A6:1,,nan#");
    check_v3("!value_overflow@4/1", "@A6:40000,nan#");
    check_v3("!value_overflow@6/1", "@A6:  -32768.1 \t,nan#");
    check_v3("!value_syntax@6/1", "@A6:1e,2#");
    check_v3("!value_syntax@5/1", "@A6:-#");
    check_v3("!value_empty@8/3", "@A6:1,2,#");
    check_v3("!count@7/0", "@A6:1,2#");
    check_v3("!count@6/0", "@A6: \t#");
    check_v3("!separator@3/0", "@A66:1,2#");
    check_v3("!separator@4/0", "@A6TT:1,2#");
    check_v3("!separator@3/0", "@A6#");
    check_v3("!separator@4/0", "@A6T#");
    check_v3("!separator@3/0", "@A6t:1#");
    check_v3("!command@2/0", "@A#");
    check_v3("!command@2/0", "@C4:1#");
    check_v3("!command@1/0", "@X6:1#");
}

static void check_reject(const char *text, const frame_reject_t *expected)
{
    const frame_reject_t reject = reject_of(text);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(frame_error_name(expected->error), frame_error_name(reject.error), text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(expected->offset, reject.offset, text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(expected->start, reject.start, text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(expected->end, reject.end, text);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->field, reject.field, text);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->expected, reject.expected, text);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->found, reject.found, text);
    TEST_ASSERT_EQUAL_HEX8_MESSAGE(expected->byte, reject.byte, text);
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(expected->look_alike, reject.look_alike, text);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected->command, reject.command, text);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected->is_timed, reject.is_timed, text);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected->is_nan, reject.is_nan, text);
}

static void test_next_rejections_say_where_and_what(void)
{
    static const struct {
        const char *text;
        frame_reject_t
            reject; /* error, offset, start, end, field, expected, found, byte, look_alike, command, is_timed, is_nan */
    } k_rows[] = {
        {" abc@A3:0,0,0#", {FRAME_ERR_NO_HEAD, 1, 1, 4, 0, 0, 0, 'a', 0, FRAME_COMMANDS, false, false}},
        {"A3:0,0,0#@A3", {FRAME_ERR_NO_HEAD, 0, 0, 9, 0, 0, 0, 'A', 0, FRAME_COMMANDS, false, false}},
        {"\r\n", {FRAME_ERR_NO_HEAD, 0, 0, 2, 0, 0, 0, 0, 0, FRAME_COMMANDS, false, false}},
        {"@A3:0,0@A3", {FRAME_ERR_UNFINISHED, 7, 0, 7, 0, 0, 0, 0, 0, FRAME_A3, false, false}},
        {" @C7T:0", {FRAME_ERR_UNFINISHED, 7, 1, 7, 0, 0, 0, 0, 0, FRAME_C7, true, false}},
        {"@A5:1,2#", {FRAME_ERR_COMMAND, 2, 0, 8, 0, 0, 0, '5', 0, FRAME_COMMANDS, false, false}},
        {"@A6 1,2#", {FRAME_ERR_SEPARATOR, 3, 0, 8, 0, 0, 0, ' ', 0, FRAME_A6, false, false}},
        {"@A6:1,2#", {FRAME_ERR_COUNT, 7, 0, 8, 0, 6, 2, '#', 0, FRAME_A6, false, false}},
        {"@A3:1,2,3,F,5,6#", {FRAME_ERR_COUNT, 11, 0, 16, 0, 3, 6, ',', 0, FRAME_A3, false, false}},
        {"@A6T:1,,3#", {FRAME_ERR_VALUE_EMPTY, 7, 0, 10, 2, 0, 0, ',', 0, FRAME_A6, true, false}},
        {"@A6:1,2x,3#", {FRAME_ERR_VALUE_SYNTAX, 7, 0, 11, 2, 0, 0, 'x', 0, FRAME_A6, false, false}},
        {"@A6:1, 1e5 ,3#", {FRAME_ERR_VALUE_OVERFLOW, 7, 0, 14, 2, 0, 0, 0, 0, FRAME_A6, false, false}},
        {"@A3:1,2,-1.#IND,0#", {FRAME_ERR_VALUE_SYNTAX, 11, 0, 12, 3, 0, 0, '#', 0, FRAME_A3, false, true}},
        {"@A3:1,2,3,G#", {FRAME_ERR_MASK, 10, 0, 12, 4, 0, 0, 'G', 0, FRAME_A3, false, false}},
        {"@A3T:1,2,3, -1#", {FRAME_ERR_TIME, 12, 0, 15, 4, 0, 0, 0, 0, FRAME_A3, true, false}},
        {"@A3T:1,2,3,9999999#", {FRAME_ERR_TIME_RANGE, 11, 0, 19, 4, 0, 0, 0, 0, FRAME_A3, true, false}},
        {"@\xD0\x90"
         "3:1#",
         {FRAME_ERR_COMMAND, 1, 0, 7, 0, 0, 0, 0xD0, 0x410, FRAME_COMMANDS, false, false}},
        {"@A3\xEF\xBC\x9A"
         "1#",
         {FRAME_ERR_SEPARATOR, 3, 0, 8, 0, 0, 0, 0xEF, 0xFF1A, FRAME_A3, false, false}},
        {"@A3:1,2,3,0\xEF\xBC\x83", {FRAME_ERR_MASK, 11, 0, 14, 4, 0, 0, 0xEF, 0xFF03, FRAME_A3, false, false}},
        {"@A3:1,\xF0\x9F\x98\x80,3#", {FRAME_ERR_VALUE_SYNTAX, 6, 0, 13, 2, 0, 0, 0xF0, 0x1F600, FRAME_A3, false, false}},
        {"@A3\xA3\xBA"
         "1#",
         {FRAME_ERR_SEPARATOR, 3, 0, 7, 0, 0, 0, 0xA3, 0, FRAME_A3, false, false}}, /* GBK */
        {"@A3\xEF\xBC"
         "1#",
         {FRAME_ERR_SEPARATOR, 3, 0, 7, 0, 0, 0, 0xEF, 0, FRAME_A3, false, false}},                         /* cut short */
        {"@A3\xE0\x80\xBA#", {FRAME_ERR_SEPARATOR, 3, 0, 7, 0, 0, 0, 0xE0, 0, FRAME_A3, false, false}},     /* overlong */
        {"@A3\xED\xA0\x80#", {FRAME_ERR_SEPARATOR, 3, 0, 7, 0, 0, 0, 0xED, 0, FRAME_A3, false, false}},     /* surrogate */
        {"@A3\xF4\x90\x80\x80#", {FRAME_ERR_SEPARATOR, 3, 0, 8, 0, 0, 0, 0xF4, 0, FRAME_A3, false, false}}, /* beyond Unicode */
        {"@A3\xEF\xBC", {FRAME_ERR_SEPARATOR, 3, 0, 5, 0, 0, 0, 0xEF, 0, FRAME_A3, false, false}},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        check_reject(k_rows[i].text, &k_rows[i].reject);
    }
}

/* ---- the lenient dialect ---- */

static void test_next_lenient_takes_the_first_version_s_head(void)
{
    check_lenient("A3 65536 131072 196608 mask=0", "#A3:1,2,3,0#");
    check_lenient("A3 0 0 0 mask=1; A3 0 0 0 mask=2; A3 0 0 0 mask=3", "#A3:0,0,0,1##A3:0,0,0,2#@A3:0,0,0,3#");
    check_lenient("A3 0 0 0 mask=1; A3 0 0 0 mask=2", "@A3:0,0,0,1#\r\n#A3:0,0,0,2#\r\n");
    check_v3("!no_head@0/0; !no_head@1/0", "#A3:1,2,3,0#");
}

static void test_next_lenient_takes_no_head_at_the_start_only(void)
{
    check_lenient("A3 0 0 0 mask=1", "A3:0,0,0,1#");
    check_lenient("C3T 0 0 0 time=1; A3 0 0 0 mask=2", "c3t:0,0,0,1#@a3:0,0,0,2#");
    check_lenient("A3 0 0 0 mask=1; !no_head@12/0", "@A3:0,0,0,1#A3:0,0,0,2#");
    check_lenient("!no_head@1/0", " A3:0,0,0,1#");
    check_lenient("!unfinished@2/0", "A3");
    check_lenient("!no_head@0/0", "hello#");
    check_lenient("!no_head@1/0", "A5:0#");
    check_lenient("!separator@2/0", "A3x#");
}

static void test_next_lenient_bad_text_does_not_spoil_the_frame_behind_it(void)
{
    check_lenient("!value_syntax@4/1; A3 0 0 0 mask=2", "#A3:nan,0,0,1##A3:0,0,0,2#");
    check_lenient("!count@7/0; A3 0 0 0 mask=2", "#A3:1,2#A3:0,0,0,2#");
    check_lenient("!no_head@0/0; A3 0 0 0 mask=2", "stray#A3:0,0,0,2#");
    check_lenient("!command@1/0; A3 0 0 0 mask=2", "##A3:0,0,0,2#");
    check_lenient("!no_head@0/0; !no_head@6/0; A3 0 0 0 mask=2", "stray#more#A3:0,0,0,2#");
    check_lenient("!value_syntax@4/1; !no_head@15/0", "@A3:nan,0,0,1# A3:0,0,0,2#");
    check_lenient("!unfinished@5/0; A3 0 0 0 mask=2", "#A3:1@A3:0,0,0,2#");
}

/* ---- serial lines ---- */

/* Feeds text over and over; returns how many events of a kind came. */
static unsigned feed(frame_scanner_t *scanner, const char *text, unsigned repeats, frame_event_t kind, frame_reject_t *reject)
{
    unsigned count = 0;
    frame_t frame;
    for (unsigned i = 0; i < repeats; i++) {
        for (const char *at = text; *at != '\0'; at++) {
            count += frame_scanner_feed(scanner, (uint8_t)*at, (uint8_t)at[1], &frame, reject) == kind;
        }
    }
    return count;
}

static void test_feed_serial_line_without_tails_counts_its_rejects(void)
{
    frame_scanner_t scanner;
    frame_reject_t reject;
    frame_scanner_init(&scanner, FRAME_V3);
    TEST_ASSERT_EQUAL_UINT(0, feed(&scanner, "x", FRAME_LENGTH_MAX - 1, FRAME_EVENT_REJECT, &reject));
    TEST_ASSERT_EQUAL_UINT(1, feed(&scanner, "x", 1, FRAME_EVENT_REJECT, &reject));
    TEST_ASSERT_EQUAL_INT(FRAME_ERR_NO_HEAD, reject.error);
    TEST_ASSERT_EQUAL_UINT32(FRAME_LENGTH_MAX, reject.end);
    TEST_ASSERT_EQUAL_UINT(0, feed(&scanner, "@A3:", 1, FRAME_EVENT_REJECT, &reject));
    TEST_ASSERT_EQUAL_UINT(1, feed(&scanner, "0", FRAME_LENGTH_MAX, FRAME_EVENT_REJECT, &reject));
    TEST_ASSERT_EQUAL_INT(FRAME_ERR_UNFINISHED, reject.error);
    TEST_ASSERT_EQUAL_UINT32(FRAME_LENGTH_MAX, reject.start);
    TEST_ASSERT_EQUAL_UINT32(2 * FRAME_LENGTH_MAX, reject.end);
    TEST_ASSERT_EQUAL_UINT(1, feed(&scanner, "@A3:0,0,0,0#", 1, FRAME_EVENT_FRAME, &reject));
    TEST_ASSERT_EQUAL_UINT(0, feed(&scanner, " \r\n", FRAME_LENGTH_MAX, FRAME_EVENT_REJECT, &reject));
    TEST_ASSERT_EQUAL_UINT(10, feed(&scanner, "@A3:0,0,0,0#", 10, FRAME_EVENT_FRAME, &reject));
}

static void test_next_values_of_thousands_of_digits_are_legal(void)
{
    static char text[60000];
    size_t length = (size_t)sprintf(text, "@A3:");
    for (unsigned i = 0; i < 3; i++) {
        memset(text + length, '0', 19000);
        length += 19000;
        length += (size_t)sprintf(text + length, "%u.5,", i);
    }
    strcpy(text + length, "1#");
    check_v3("A3 32768 98304 163840 mask=1", text);
}

/* ---- against the oracle ---- */

/* The frames among the events, without the rejects. */
static void frames_only(const line_t *events, line_t *frames)
{
    frames->length = 0;
    frames->text[0] = '\0';
    for (const char *at = events->text; *at != '\0';) {
        const size_t length = strcspn(at, ";");
        if (*at != '!') {
            line_add(frames, "%s%.*s", frames->length > 0 ? "; " : "", (int)length, at);
        }
        at += length + (at[length] == ';' ? 2 : 0);
    }
}

static void check_against_oracle(frame_dialect_t dialect, const char *bytes, size_t length)
{
    static line_t frames;
    scan(&s_line, dialect, bytes, length);
    scan_bytes(&s_other, dialect, bytes, length);
    TEST_ASSERT_EQUAL_STRING(s_line.text, s_other.text);
    frames_only(&s_line, &frames);
    frame_oracle(&s_expected, dialect, bytes, length);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(s_expected.text, frames.text, bytes);
}

/* ---- properties ---- */

/* Prints number / 10^decimals, and its nearest Q16.16 by binary long division, ties to even. */
static int random_value(char *text)
{
    static const uint32_t k_unit[] = {1, 10, 100, 1000, 10000, 100000, 1000000};
    const unsigned decimals = below(7);
    const uint64_t unit = k_unit[decimals];
    const uint64_t number = next_random() % ((32767 * unit >> below(20)) + 1);
    const bool is_negative = below(2);
    uint64_t value = number / unit;
    uint64_t rest = number % unit;
    for (unsigned bit = 0; bit < 16; bit++) {
        rest *= 2;
        value = 2 * value + (rest >= unit);
        rest -= rest >= unit ? unit : 0;
    }
    value += 2 * rest > unit || (2 * rest == unit && value % 2 == 1);
    const char *const sign = is_negative ? "-" : below(4) == 0 ? "+" : "";
    if (below(3) == 0) {
        sprintf(text, "%s%lluE-%02u", sign, (unsigned long long)number, decimals);
    } else if (decimals == 0) {
        sprintf(text, "%s%llu%s", sign, (unsigned long long)number, below(3) == 0 ? "." : "");
    } else {
        sprintf(text, "%s%llu.%0*llu", sign, (unsigned long long)(number / unit), (int)decimals,
                (unsigned long long)(number % unit));
    }
    return is_negative ? -(int)value : (int)value;
}

static const char *blanks(void)
{
    return (const char *[]){"", "", "", "", " ", "\t", "  ", "\n", "\r\n"}[below(9)];
}

static void random_tail(char *text, bool is_timed, line_t *expected)
{
    const unsigned number = below(is_timed ? 3600001 : 65536);
    if (is_timed) {
        sprintf(text + strlen(text), ",%s%u%s#", blanks(), number, blanks());
        line_add(expected, " time=%u", number);
    } else if (below(5) == 0) {
        strcat(text, "#");
        line_add(expected, " nomask");
    } else {
        static const char *const k_forms[] = {",%s%X%s#", ",%s%04x%s#", ",%s0x%X%s#", ",%s%02X%s#"};
        sprintf(text + strlen(text), k_forms[below(4)], blanks(), number, blanks());
        line_add(expected, " mask=%u", number & 4095);
    }
}

/* Appends a frame with a head to text, and what it must lead to. */
static void random_frame(char *text, line_t *expected, const char *head)
{
    static const char *const k_names[] = {"A3", "A4", "A6", "A7", "C3", "C6", "C7"};
    const char *const name = k_names[below(7)];
    const bool is_timed = below(3) == 0;
    sprintf(text + strlen(text), "%s%s%s:", head, name, is_timed ? "T" : "");
    line_add(expected, "%s%s%s", expected->length > 0 ? "; " : "", name, is_timed ? "T" : "");
    for (int i = 0; i < name[1] - '0'; i++) {
        char number[64];
        line_add(expected, " %d", random_value(number));
        sprintf(text + strlen(text), "%s%s%s%s", i > 0 ? "," : "", blanks(), number, blanks());
    }
    random_tail(text, is_timed, expected);
}

static void test_next_random_frames_come_back_exactly(void)
{
    for (unsigned round = 0; round < 20000; round++) {
        char text[ORACLE_DATAGRAM_MAX] = "";
        line_t *const expected = &s_expected;
        expected->length = 0;
        random_frame(text, expected, "@");
        scan(&s_line, FRAME_V3, text, strlen(text));
        TEST_ASSERT_EQUAL_STRING_MESSAGE(expected->text, s_line.text, text);
        text[0] = '#';
        scan(&s_line, FRAME_LENIENT, text, strlen(text));
        TEST_ASSERT_EQUAL_STRING_MESSAGE(expected->text, s_line.text, text);
        scan(&s_line, FRAME_LENIENT, text + 1, strlen(text + 1));
        TEST_ASSERT_EQUAL_STRING_MESSAGE(expected->text, s_line.text, text);
    }
}

/* Text that is no frame, and that no frame can follow from when a head comes next. */
static const char *const k_bad[] = {"",
                                    "",
                                    "@",
                                    "@A6",
                                    "@A6:",
                                    "@A6:1,2,3,4,5,6,0",
                                    "@A6:1,2,3,4,5,6,G#",
                                    "@A3:nan,0,0,0#",
                                    "@A3:1,2#",
                                    "@A3:1,2,3,4,5#",
                                    "@A3T:1,2,3#",
                                    "@C5:1#",
                                    "junk",
                                    "junk#",
                                    "\xEF\xBB\xBF",
                                    "\r\n",
                                    ("@A3\xEF\xBC\x9A"
                                     "1,2,3,0#"),
                                    "A3:1,2,3,G#",
                                    "@A3:1e9,2,3,0#"};

static void test_next_good_frames_among_bad_text_are_all_delivered(void)
{
    static line_t frames;
    for (unsigned round = 0; round < 5000; round++) {
        char text[ORACLE_DATAGRAM_MAX] = "";
        s_expected.length = 0;
        s_expected.text[0] = '\0';
        for (unsigned i = 0; i < 4; i++) {
            strcat(text, k_bad[below(sizeof k_bad / sizeof k_bad[0])]);
            random_frame(text, &s_expected, "@");
        }
        strcat(text, k_bad[below(sizeof k_bad / sizeof k_bad[0])]);
        for (int dialect = FRAME_V3; dialect <= FRAME_LENIENT; dialect++) {
            scan(&s_line, (frame_dialect_t)dialect, text, strlen(text));
            frames_only(&s_line, &frames);
            TEST_ASSERT_EQUAL_STRING_MESSAGE(s_expected.text, frames.text, text);
        }
    }
}

/* Changes, drops, doubles or inserts a few bytes. */
static size_t mutate(char *text, size_t length)
{
    static const char k_bytes[] = "@#:,;.-+eExXTAC036 \t\r\n\0\xD0\x90\xEF\xBC\x9A";
    for (unsigned i = 1 + below(4); i > 0 && length > 2; i--) {
        const size_t at = below((unsigned)length);
        const char byte = below(2) ? k_bytes[below(sizeof k_bytes)] : (char)below(256);
        switch (below(4)) {
        case 0:
            text[at] = (char)(text[at] ^ 1 << below(8));
            break;
        case 1:
            text[at] = byte;
            break;
        case 2:
            memmove(text + at, text + at + 1, length - at - 1);
            length--;
            break;
        default:
            memmove(text + at + 1, text + at, length - at);
            text[at] = byte;
            length++;
            break;
        }
    }
    text[length] = '\0';
    return length;
}

static void test_next_damaged_frames_deliver_what_the_oracle_delivers(void)
{
    static const char *const k_heads[] = {"@", "#", ""};
    for (unsigned round = 0; round < 30000; round++) {
        char text[ORACLE_DATAGRAM_MAX] = "";
        const frame_dialect_t dialect = below(2) ? FRAME_V3 : FRAME_LENIENT;
        for (unsigned i = 1 + below(3); i > 0; i--) {
            s_expected.length = 0;
            random_frame(text, &s_expected, k_heads[dialect == FRAME_V3 ? 0 : below(3)]);
        }
        check_against_oracle(dialect, text, mutate(text, strlen(text)));
    }
}

static void test_next_random_text_of_frame_characters_matches_the_oracle(void)
{
    static const char *const k_pieces[] = {"@", "#", "A3", "C3",    "a3", "T", ":", ",",        "1",  "0x1",
                                           "F", " ", "\n", "1,2,3", "-",  ".", "e", "A3:1,2,3", "1.#"};
    for (unsigned round = 0; round < 50000; round++) {
        char text[ORACLE_DATAGRAM_MAX] = "";
        for (unsigned i = below(14); i > 0; i--) {
            strcat(text, k_pieces[below(sizeof k_pieces / sizeof k_pieces[0])]);
        }
        check_against_oracle(round % 2 ? FRAME_V3 : FRAME_LENIENT, text, strlen(text));
    }
}

/* Every byte of a datagram without white space belongs to exactly one frame or one reject, and the offset lies in its text. */
static void test_next_rejects_cover_what_no_frame_does(void)
{
    for (unsigned round = 0; round < 20000; round++) {
        char text[ORACLE_DATAGRAM_MAX] = "";
        s_expected.length = 0;
        random_frame(text, &s_expected, "@");
        random_frame(text, &s_expected, "@");
        const size_t length = mutate(text, strlen(text));
        frame_scanner_t scanner;
        frame_scanner_init(&scanner, FRAME_V3);
        size_t position = 0, last = 0;
        frame_t frame;
        frame_reject_t reject;
        for (;;) {
            const frame_event_t event = frame_next(&scanner, (const uint8_t *)text, length, &position, &frame, &reject);
            if (event == FRAME_EVENT_NONE) {
                break;
            }
            if (event == FRAME_EVENT_REJECT) {
                TEST_ASSERT_TRUE(reject.start >= last && reject.start <= reject.offset);
                TEST_ASSERT_TRUE(reject.offset <= reject.end && reject.end <= length);
            }
            last = event == FRAME_EVENT_REJECT ? reject.end : position;
        }
        while (last < length && strchr(" \t\r\n", text[last]) != NULL) {
            last++;
        }
        TEST_ASSERT_EQUAL_UINT(length, last);
        TEST_ASSERT_EQUAL_UINT(length + 1, position);
    }
}

/* ---- in words ---- */

static void check_words(const char *text, const char *expected)
{
    char words[256];
    const frame_reject_t reject = reject_of(text);
    const size_t length = frame_reject_describe(&reject, words, sizeof words);
    TEST_ASSERT_EQUAL_STRING(expected, words);
    TEST_ASSERT_EQUAL_UINT(strlen(expected), length);
}

static void test_describe_says_what_would_be_right(void)
{
    check_words("@A6:5,6,0,5.5,3.0,20,F0,1#",
                "byte 23: A6 takes 6 values and a mask, found 8; a decimal comma counts as a separator");
    check_words("@A6T:5,6,0#", "byte 10: A6T takes 6 values and a time, found 3");
    check_words("@A6:5,6,nan,0,0,0,0#",
                "byte 8: value 3 of A6 (yaw) is not a decimal number; write it as 5, -5.5 or 1E-05; found 'n'");
    check_words("@A6:0,0,0,0,0,1.#QNAN,0F#",
                "byte 16: value 6 of A6 (z) is not a decimal number; write it as 5, -5.5 or 1E-05; 1.# and a "
                "letter is a Windows program's NaN or infinity");
    check_words("@C7:1,2,3,4,5,6,1e9,0#", "byte 16: value 7 of C7 (angle) is outside -32768 to 32767.9999");
    check_words("@A6:,6,0,0,0,0,0#", "byte 4: value 1 of A6 (roll) is empty; write 0");
    check_words("@A3:1,2,3,12345#", "byte 14: the relay mask is 1 to 4 hexadecimal digits, as in F0; found '5'");
    check_words("@A3T:1,2,3#", "byte 10: A3T ends with its time, a number of ms from 0 to 3600000; found '#'");
    check_words("@A3T:1,2,3,1e7#", "byte 11: A3T has a time above 3600000 ms");
    check_words("@A6 1#", "byte 3: A6 must be followed by ':'; found a blank");
    check_words("@A6:1\n2#", "byte 6: value 1 of A6 (roll) is not a decimal number; write it as 5, -5.5 or 1E-05; found '2'");
    check_words("@A6:1.E\n#",
                "byte 7: value 1 of A6 (roll) is not a decimal number; write it as 5, -5.5 or 1E-05; found a line break");
    check_words("@A6\r\n:1#", "byte 3: A6 must be followed by ':'; found a line break");
    check_words("@a6:1#", "byte 1: not a command; right are A3 A4 A6 A7 C3 C6 C7, and T behind them for a timed move"
                          "; lower case needs dialect = lenient; found 'a'");
    check_words("A6:1#", "byte 0: outside a frame; a frame starts with '@', as in @A6:0,0,0,0,0,0,0#; found 'A'");
    check_words("@A6:1", "byte 5: the frame from byte 0 on has no '#' at its end; a frame must be whole within one datagram");
    check_words("@A6:1\x07,#",
                "byte 5: value 1 of A6 (roll) is not a decimal number; write it as 5, -5.5 or 1E-05; found byte 0x07");
    check_words("", "byte 0: no frame in this datagram; a frame starts with '@', as in @A6:0,0,0,0,0,0,0#");
    check_words("@A6\xA3\xBA#", "byte 3: A6 must be followed by ':'; found byte 0xA3, neither ASCII nor UTF-8");
}

static void test_describe_platform_names_the_command(void)
{
    char words[128];
    frame_reject_describe(&(frame_reject_t){.error = FRAME_ERR_PLATFORM, .command = FRAME_A7, .is_timed = true}, words,
                          sizeof words);
    TEST_ASSERT_EQUAL_STRING("byte 0: A7T asks for an axis that this platform does not have", words);
}

static void test_describe_names_look_alikes(void)
{
    static const struct {
        const char *text;
        const char *words;
    } k_rows[] = {
        {"@\xD0\x90"
         "6:1#",
         "U+0410 CYRILLIC CAPITAL LETTER A looks like A; type the ASCII letter"},
        {"@\xD0\xA1"
         "6:1#",
         "U+0421 CYRILLIC CAPITAL LETTER ES looks like C; type the ASCII letter"},
        {"@A6\xE2\x80\xA2"
         "1#",
         "U+2022 BULLET looks like :; type the ASCII character"},
        {"@A6\xEF\xBC\x9A"
         "1#",
         "U+FF1A FULLWIDTH COLON looks like :; type the ASCII character"},
        {"@A6:1\xEF\xBC\x8C"
         "1#",
         "U+FF0C FULLWIDTH COMMA looks like ,; type the ASCII character"},
        {"@A3:1,2,3,0\xEF\xBC\x83", "U+FF03 FULLWIDTH NUMBER SIGN looks like #; type the ASCII character"},
        {"\xEF\xBC\xA0"
         "A3:1,2,3,0#",
         "U+FF20 FULLWIDTH COMMERCIAL AT looks like @; type the ASCII character"},
        {"@A3:1,2,3,\xD0\xB0#", "U+0430 CYRILLIC SMALL LETTER A looks like a; type the ASCII letter"},
        {"@A3:\xEF\xBC\x95,2,3,0#", "U+FF15 FULLWIDTH DIGIT looks like 5; type the ASCII digit"},
        {"@\xEF\xBC\xA1"
         "3:1#",
         "U+FF21 FULLWIDTH LATIN CAPITAL LETTER looks like A; type the ASCII letter"},
        {"@A3:\xE2\x88\x92"
         "5,2,3,0#",
         "U+2212 MINUS SIGN looks like -; type the ASCII character"},
        {"@A3:1,\xC2\xA0"
         "2,3,0#",
         "U+00A0 NO-BREAK SPACE looks like a blank; type the ASCII character"},
        {"\xEF\xBB\xBF@A3:1,2,3,0#", "U+FEFF BYTE ORDER MARK is invisible; leave it out"},
        {"@A3\xE4\xB8\xAD:1#", "U+4E2D is not ASCII"},
        {"@A3\xF0\x9F\x98\x80:1#", "U+1F600 is not ASCII"},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        char words[256];
        const frame_reject_t reject = reject_of(k_rows[i].text);
        frame_reject_describe(&reject, words, sizeof words);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(words, k_rows[i].words), words);
    }
}

static void test_describe_any_reject_is_one_printable_line_cut_to_fit(void)
{
    for (unsigned round = 0; round < 50000; round++) {
        char words[300], cut[300];
        const frame_reject_t reject = {.error = (frame_error_t)below(FRAME_ERRORS),
                                       .offset = (uint32_t)next_random(),
                                       .start = (uint32_t)next_random(),
                                       .field = (uint8_t)below(256),
                                       .expected = (uint8_t)below(256),
                                       .found = (uint8_t)below(256),
                                       .byte = (uint8_t)below(256),
                                       .look_alike = below(2) ? 0 : below(0x110000),
                                       .command = (frame_command_t)below(FRAME_COMMANDS + 1),
                                       .is_timed = below(2)};
        const size_t length = frame_reject_describe(&reject, words, sizeof words);
        TEST_ASSERT_TRUE(length > 20 && length < sizeof words - 1 && strlen(words) == length);
        for (size_t i = 0; i < length; i++) {
            TEST_ASSERT_TRUE(words[i] >= ' ' && words[i] <= '~');
        }
        const size_t capacity = 1 + below(sizeof cut);
        memset(cut, UNTOUCHED, sizeof cut);
        const size_t cut_length = frame_reject_describe(&reject, cut, capacity);
        TEST_ASSERT_EQUAL_UINT(length < capacity ? length : capacity - 1, cut_length);
        TEST_ASSERT_EQUAL_INT(0, memcmp(words, cut, cut_length));
        TEST_ASSERT_EQUAL_INT(0, cut[cut_length]);
        check_untouched(cut + cut_length + 1, sizeof cut - cut_length - 1);
    }
}

static void test_error_name_every_reason_has_its_own(void)
{
    for (int error = 0; error < FRAME_ERRORS; error++) {
        for (int other = 0; other < error; other++) {
            TEST_ASSERT_NOT_EQUAL(0, strcmp(frame_error_name((frame_error_t)error), frame_error_name((frame_error_t)other)));
        }
    }
    TEST_ASSERT_EQUAL_STRING("value_overflow", frame_error_name(FRAME_ERR_VALUE_OVERFLOW));
}

/* By division, where digits / unit is below 2^15 and digits below 2^46. */
static int64_t nearest_q16(uint64_t digits, uint64_t unit)
{
    const uint64_t floor_halves = (digits << 17) / unit;
    const bool is_above_half = (floor_halves & 1) != 0 && (digits << 17) % unit != 0;
    const bool is_tie_to_odd = (floor_halves & 3) == 3;
    return (int64_t)((floor_halves >> 1) + (is_above_half || is_tie_to_odd));
}

static void test_next_values_of_every_number_of_decimals_are_rounded_to_the_nearest(void)
{
    uint64_t unit = 1;
    for (unsigned decimals = 0; decimals <= 12; decimals++, unit *= 10) {
        for (unsigned n = 0; n < 3000; n++) {
            /* beside or on the middle between two values of Q16.16 */
            const uint64_t end = unit < 1000000 ? (UINT64_C(32767) << 17) : UINT64_C(9000000000000000000) / unit;
            const uint64_t middle = next_random() % end | 1u;
            const uint64_t digits = (middle * unit >> 17) % (UINT64_C(32767) * unit) % UINT64_C(9999999999999) + below(2);
            const bool is_negative = below(2) != 0;
            char text[80];
            (void)snprintf(text, sizeof text, "@C3:%s%llu", is_negative ? "-" : "", (unsigned long long)(digits / unit));
            if (decimals > 0) {
                const size_t length = strlen(text);
                (void)snprintf(text + length, sizeof text - length, ".%0*llu", (int)decimals,
                               (unsigned long long)(digits % unit));
            }
            (void)strcat(text, ",1.5,2,F0#");
            frame_scanner_t scanner;
            frame_t frame = {.count = 0};
            frame_reject_t reject;
            size_t position = 0;
            frame_scanner_init(&scanner, FRAME_V3);
            TEST_ASSERT_EQUAL_INT_MESSAGE(
                FRAME_EVENT_FRAME, frame_next(&scanner, (const uint8_t *)text, strlen(text), &position, &frame, &reject), text);
            const int64_t nearest = nearest_q16(digits, unit);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(is_negative ? -nearest : nearest, frame.value_q16[0], text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(Q16_ONE * 3 / 2, frame.value_q16[1], text);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_next_reference_rows_lead_to_the_stated_events);
    RUN_TEST(test_next_blanks_around_values_mask_and_time_are_skipped);
    RUN_TEST(test_next_line_breaks_around_values_mask_and_time_are_skipped);
    RUN_TEST(test_next_masks_of_one_to_four_digits_keep_their_low_twelve_bits);
    RUN_TEST(test_next_missing_mask_is_accepted_but_missing_time_is_not);
    RUN_TEST(test_next_times_are_rounded_and_bounded);
    RUN_TEST(test_next_datagram_of_several_frames_delivers_each);
    RUN_TEST(test_next_frame_is_over_at_a_nul_and_with_its_datagram);
    RUN_TEST(test_next_head_inside_an_unfinished_frame_starts_a_new_one);
    RUN_TEST(test_next_bad_frame_does_not_spoil_its_neighbours);
    RUN_TEST(test_next_text_without_any_frame_is_counted);
    RUN_TEST(test_next_windows_nan_and_infinity_are_no_numbers);
    RUN_TEST(test_next_one_and_a_point_is_a_number);
    RUN_TEST(test_next_too_many_values_are_a_count_error_whatever_the_mask_looks_like);
    RUN_TEST(test_next_count_found_stops_at_255);
    RUN_TEST(test_next_first_error_of_a_frame_is_the_one_reported);
    RUN_TEST(test_next_rejections_say_where_and_what);
    RUN_TEST(test_next_lenient_takes_the_first_version_s_head);
    RUN_TEST(test_next_lenient_takes_no_head_at_the_start_only);
    RUN_TEST(test_next_lenient_bad_text_does_not_spoil_the_frame_behind_it);
    RUN_TEST(test_feed_serial_line_without_tails_counts_its_rejects);
    RUN_TEST(test_next_values_of_thousands_of_digits_are_legal);
    RUN_TEST(test_next_values_of_every_number_of_decimals_are_rounded_to_the_nearest);
    RUN_TEST(test_next_random_frames_come_back_exactly);
    RUN_TEST(test_next_good_frames_among_bad_text_are_all_delivered);
    RUN_TEST(test_next_damaged_frames_deliver_what_the_oracle_delivers);
    RUN_TEST(test_next_random_text_of_frame_characters_matches_the_oracle);
    RUN_TEST(test_next_rejects_cover_what_no_frame_does);
    RUN_TEST(test_describe_says_what_would_be_right);
    RUN_TEST(test_describe_platform_names_the_command);
    RUN_TEST(test_describe_names_look_alikes);
    RUN_TEST(test_describe_any_reject_is_one_printable_line_cut_to_fit);
    RUN_TEST(test_error_name_every_reason_has_its_own);
    return UNITY_END();
}

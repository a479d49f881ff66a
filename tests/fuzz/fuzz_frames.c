/* SPDX-License-Identifier: MIT
 * fuzz_frames.c - datagrams through the frame scanner. Input: dialect, then the datagram.
 * What must hold: the frames are those that an independent reader finds; bytes one by one give the same events as in place; a
 * printed frame parses to itself; a reject tells where within the datagram, in printable words, and leaves nothing behind.
 */
#include <string.h>

#include "frame_oracle.h"
#include "frame_print.h"
#include "fuzz.h"

#define DATAGRAM_MAX 1024u /* longer than any that is taken; the oracle's numbers have as many digits */
#define EVENTS_MAX   (DATAGRAM_MAX + 2u)
#define CANARY       0xA5

typedef struct {
    frame_event_t event;
    frame_t frame;
    frame_reject_t reject;
} event_record_t;

static void check_print(const frame_t *frame, frame_dialect_t dialect)
{
    char text[FRAME_PRINT_MAX];
    frame_t again = {0};
    frame_reject_t reject;
    frame_scanner_t scanner;
    size_t position = 0;
    const size_t length = frame_print(frame, text);
    frame_scanner_init(&scanner, dialect);
    FUZZ_REQUIRE(frame_next(&scanner, (const uint8_t *)text, length, &position, &again, &reject) == FRAME_EVENT_FRAME);
    FUZZ_REQUIRE(frame_print_is_same(frame, &again));
    FUZZ_REQUIRE(frame_next(&scanner, (const uint8_t *)text, length, &position, &again, &reject) == FRAME_EVENT_NONE);
}

/* --- One event --- */

static void check_frame(const frame_t *frame, frame_dialect_t dialect)
{
    FUZZ_REQUIRE(frame->command < FRAME_COMMANDS && frame->count == frame_value_count(frame->command));
    FUZZ_REQUIRE(frame->time_ms <= FRAME_TIME_MAX_MS && frame->relay_mask <= FRAME_RELAY_MASK);
    FUZZ_REQUIRE(!(frame->is_timed && frame->has_mask));
    for (unsigned i = frame->count; i < FRAME_VALUES_MAX; i++) {
        FUZZ_REQUIRE(frame->value_q16[i] == 0);
    }
    check_print(frame, dialect);
}

static void check_reject(const frame_reject_t *reject, size_t size)
{
    char line[512], cut[40];
    FUZZ_REQUIRE(reject->error < FRAME_ERR_PLATFORM && frame_error_name(reject->error)[0] != '\0');
    FUZZ_REQUIRE(reject->start <= reject->offset && reject->offset <= reject->end + 1u && reject->end <= size);
    FUZZ_REQUIRE(reject->field <= FRAME_VALUES_MAX + 1u || reject->error == FRAME_ERR_COUNT);
    FUZZ_REQUIRE((reject->error == FRAME_ERR_COUNT) == (reject->expected != 0));
    const size_t length = frame_reject_describe(reject, line, sizeof line);
    FUZZ_REQUIRE(length == strlen(line) && length > 0 && length < sizeof line - 1);
    for (size_t i = 0; i < length; i++) {
        FUZZ_REQUIRE(line[i] >= ' ' && line[i] <= '~');
    }
    const size_t cut_length = frame_reject_describe(reject, cut, sizeof cut);
    FUZZ_REQUIRE(cut_length == strlen(cut) && cut_length < sizeof cut && memcmp(cut, line, cut_length) == 0);
}

/* What is not handed over stays as it was. */
static void check_untouched(const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        FUZZ_REQUIRE(((const uint8_t *)bytes)[i] == CANARY);
    }
}

/* --- A datagram --- */

static size_t scan_in_place(frame_scanner_t *scanner, const uint8_t *bytes, size_t size, event_record_t *to)
{
    size_t position = 0, count = 0;
    for (;; count++) {
        FUZZ_REQUIRE(count < EVENTS_MAX);
        memset(&to[count], CANARY, sizeof to[count]);
        const frame_event_t event = frame_next(scanner, bytes, size, &position, &to[count].frame, &to[count].reject);
        if (event != FRAME_EVENT_FRAME) {
            check_untouched(&to[count].frame, sizeof to[count].frame);
        }
        if (event != FRAME_EVENT_REJECT) {
            check_untouched(&to[count].reject, sizeof to[count].reject);
        }
        to[count].event = event;
        if (event == FRAME_EVENT_NONE) {
            FUZZ_REQUIRE(position == size + 1u);
            return count;
        }
    }
}

static bool is_same_reject(const frame_reject_t *a, const frame_reject_t *b)
{
    return a->error == b->error && a->offset == b->offset && a->start == b->start && a->end == b->end && a->field == b->field &&
           a->expected == b->expected && a->found == b->found && a->byte == b->byte && a->look_alike == b->look_alike &&
           a->command == b->command && a->is_timed == b->is_timed && a->is_nan == b->is_nan;
}

static void require_event(const event_record_t *expected, frame_event_t event, const frame_t *frame, const frame_reject_t *reject)
{
    FUZZ_REQUIRE(event == expected->event);
    FUZZ_REQUIRE(event != FRAME_EVENT_FRAME || frame_print_is_same(frame, &expected->frame));
    FUZZ_REQUIRE(event != FRAME_EVENT_REJECT || is_same_reject(reject, &expected->reject));
}

static void check_bytes(frame_dialect_t dialect, const uint8_t *bytes, size_t size, const event_record_t *expected, size_t count)
{
    frame_scanner_t scanner;
    frame_t frame;
    frame_reject_t reject;
    size_t seen = 0;
    frame_scanner_init(&scanner, dialect);
    for (size_t i = 0; i <= size; i++) {
        const frame_event_t event = i < size
                                        ? frame_scanner_feed(&scanner, bytes[i], i + 1 < size ? bytes[i + 1] : 0, &frame, &reject)
                                        : frame_scanner_end(&scanner, &reject);
        if (event != FRAME_EVENT_NONE) {
            FUZZ_REQUIRE(seen < count);
            require_event(&expected[seen++], event, &frame, &reject);
        }
    }
    FUZZ_REQUIRE(seen == count);
}

/* The frames alone, as the oracle writes them. */
static void write_frames(line_t *line, const event_record_t *record, size_t count)
{
    line->length = 0;
    line->text[0] = '\0';
    for (size_t k = 0; k < count; k++) {
        const frame_t *frame = &record[k].frame;
        if (record[k].event != FRAME_EVENT_FRAME) {
            continue;
        }
        line_add(line, "%s%s%s", line->length > 0 ? "; " : "", frame_command_name(frame->command), frame->is_timed ? "T" : "");
        for (unsigned i = 0; i < frame->count; i++) {
            line_add(line, " %d", (int)frame->value_q16[i]);
        }
        if (frame->is_timed) {
            line_add(line, " time=%u", (unsigned)frame->time_ms);
        } else if (frame->has_mask) {
            line_add(line, " mask=%u", (unsigned)frame->relay_mask);
        } else {
            line_add(line, " nomask");
        }
    }
}

/* Whatever the last datagram was, a good frame is read and nothing else. */
static void check_ready(frame_scanner_t *scanner)
{
    static const char k_good[] = "@A3:1,-2,3.5,F#";
    static event_record_t record[EVENTS_MAX];
    FUZZ_REQUIRE(scan_in_place(scanner, (const uint8_t *)k_good, sizeof k_good - 1, record) == 1);
    FUZZ_REQUIRE(record[0].event == FRAME_EVENT_FRAME && record[0].frame.value_q16[2] == 0x38000);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static event_record_t record[EVENTS_MAX];
    static line_t found, expected;
    if (size < 1 || size - 1 > DATAGRAM_MAX) {
        return 0;
    }
    const frame_dialect_t dialect = (data[0] & 1) != 0 ? FRAME_LENIENT : FRAME_V3;
    frame_scanner_t scanner;
    data++;
    size--;
    frame_scanner_init(&scanner, dialect);
    const size_t count = scan_in_place(&scanner, data, size, record);
    FUZZ_REQUIRE(count > 0); /* each datagram leads to something */
    for (size_t i = 0; i < count; i++) {
        if (record[i].event == FRAME_EVENT_FRAME) {
            check_frame(&record[i].frame, dialect);
        } else {
            check_reject(&record[i].reject, size);
        }
    }
    check_bytes(dialect, data, size, record, count);
    write_frames(&found, record, count);
    frame_oracle(&expected, dialect, (const char *)data, size);
    FUZZ_REQUIRE(strcmp(found.text, expected.text) == 0);
    check_ready(&scanner);
    return 0;
}

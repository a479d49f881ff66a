/* SPDX-License-Identifier: MIT
 * parser.c - the entry points of tools/proof into src/protocol: whatever is fed, in whatever order.
 * A buffer stands at the end of its memory, so that one byte read or written too far is out of bounds.
 */
#include "any.h"

#include "frame_quick.h"
#include "heave/frame.h"
#include "heave/text.h"

#define DATAGRAM_MAX 65507u

static uint8_t bytes[DATAGRAM_MAX];
static frame_scanner_t scanner;

/* Any bytes without an end, in datagrams of any lengths, byte by byte. The hints say where bounds are, they are not taken on
 * trust. */
void proof_scanner(void)
{
    frame_t frame;
    frame_reject_t reject;
    frame_scanner_init(&scanner, ANY_BOOL() ? FRAME_LENIENT : FRAME_V3);
    /*@ loop widen_hints scanner.number.point, -1000000000000000000, 1000000000000000000;
        loop widen_hints scanner.number.exponent, 1000000000000000009;
        loop widen_hints scanner.number.lead_count, 19;
        loop widen_hints scanner.number.tail_count, 3;
        loop widen_hints scanner.number.phase, 9;
        loop widen_hints scanner.frame.command, 7;
        loop widen_hints scanner.frame.count, 7;
        loop widen_hints scanner.value, 6;
        loop widen_hints scanner.mask_digits, 4; */
    while (ANY_BOOL()) {
        if (ANY_BOOL()) {
            frame_scanner_feed(&scanner, ANY_U8(), ANY_U8(), &frame, &reject);
        } else {
            frame_scanner_end(&scanner, &reject);
        }
    }
}

/* A text of any length. */
void proof_quick(void)
{
    frame_t frame;
    ANY_BYTES(bytes);
    frame_quick(bytes + ANY_OF(0, DATAGRAM_MAX - 1), bytes + DATAGRAM_MAX, &frame);
}

static void read_datagram(size_t length)
{
    frame_t frame;
    frame_reject_t reject;
    size_t position = ANY_U64();
    ANY_BYTES(bytes);
    frame_scanner_init(&scanner, ANY_BOOL() ? FRAME_LENIENT : FRAME_V3);
    while (frame_next(&scanner, bytes + DATAGRAM_MAX - length, length, &position, &frame, &reject) != FRAME_EVENT_NONE) {}
}

/* The loop over a datagram, by the contracts of what it calls. Nothing in it depends on how long the datagram is. */
void proof_next(void)
{
    read_datagram(0);
    read_datagram(1);
    read_datagram(2);
    read_datagram(1472);
    read_datagram(DATAGRAM_MAX);
}

/* A text of its own is a number too, however long. */
void proof_number(void)
{
    q16_t value_q16;
    const size_t length = (size_t)ANY_OF(0, DATAGRAM_MAX);
    ANY_BYTES(bytes);
    //@ widen_hints global:"all", -1000000000000000000, 1000000000000000000, 1000000000000000009, 3, 9, 19;
    (void)number_parse((const char *)bytes, length, &value_q16);
}

/* Any reject in words, by the contracts of text.h; in small buffers too. */
void proof_words(void)
{
    char line[200];
    frame_reject_t reject;
    ANY_BYTES(reject);
    reject.error = (frame_error_t)ANY_OF(0, FRAME_ERRORS - 1);
    reject.command = (frame_command_t)ANY_OF(0, FRAME_COMMANDS);
    reject.is_timed = ANY_BOOL();
    reject.is_nan = ANY_BOOL();
    //@ split reject.command;
    frame_reject_describe(&reject, line, sizeof line);
    frame_reject_describe(&reject, line + sizeof line - 1, 1);
    frame_error_name(reject.error);
}

static void write_line(char *line, size_t capacity)
{
    text_t text = text_start(line, capacity);
    while (ANY_BOOL()) {
        text_put_char(&text, (char)ANY_U8());
        text_put(&text, ANY_BOOL() ? "" : "some words");
        text_put_u32(&text, ANY_U32());
        text_put_hex(&text, ANY_U32(), (unsigned)ANY_OF(0, 8));
        text_put_q32(&text, ANY_I64(), (unsigned)ANY_OF(0, 3));
        text_put_escaped(&text, bytes + ANY_OF(0, 9), (size_t)ANY_OF(0, DATAGRAM_MAX - 9));
    }
}

/* Whatever is written to a line, in any order. */
void proof_text(void)
{
    char line[200];
    ANY_BYTES(bytes);
    write_line(line, sizeof line);
    write_line(line + sizeof line - 2, 2);
    write_line(line + sizeof line - 1, 1);
}

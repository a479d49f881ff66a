/* SPDX-License-Identifier: MIT
 * frame_quick.c - the short way through a frame as nearly all senders write it: loops over the digits of a field instead of a
 * step of the scanner for every byte. Whatever is not as simple as that is left to the scanner, which accepts more and can say
 * what is wrong.
 */
#include "frame_quick.h"

enum { DIGITS_MAX = NUMBER_SHORT_DIGITS, MASK_DIGITS_MAX = 4, TIME_DIGITS_MAX = 7 };

typedef struct {
    const uint8_t *at;
    const uint8_t *end;
} reader_t;

/* Takes the byte if it is the next one. */
static bool take(reader_t *reader, uint8_t byte)
{
    const bool is_next = reader->at < reader->end && *reader->at == byte;
    reader->at += is_next;
    return is_next;
}

/* Appends all digits that follow to the number; it wraps where there are too many. Returns how many. */
static size_t take_digits(reader_t *reader, uint64_t *number)
{
    const uint8_t *at = reader->at;
    uint64_t sum = *number;
    for (; at < reader->end && (uint8_t)(*at - '0') <= 9; at++) {
        sum = sum * 10u + (uint8_t)(*at - '0');
    }
    const size_t count = (size_t)(at - reader->at);
    reader->at = at;
    *number = sum;
    return count;
}

static bool take_value(reader_t *reader, q16_t *value_q16)
{
    uint64_t digits = 0;
    const bool is_negative = take(reader, '-');
    const size_t integer = take_digits(reader, &digits);
    const bool has_point = take(reader, '.');
    const size_t fraction = has_point ? take_digits(reader, &digits) : 0;
    if (integer == 0 || (has_point && fraction == 0) || integer + fraction > DIGITS_MAX) {
        return false;
    }
    return number_short(digits, (unsigned)fraction, is_negative, value_q16) == NUMBER_OK;
}

/* 0 to 15, or 16 where the byte is no hex digit. */
static unsigned hex_value(uint8_t byte)
{
    const unsigned digit = (uint8_t)(byte - '0');
    const unsigned letter = (uint8_t)((byte | 0x20u) - 'a');
    return digit <= 9 ? digit : letter < 6 ? letter + 10u : 16u;
}

static bool take_mask(reader_t *reader, frame_t *frame)
{
    unsigned mask = 0;
    unsigned count = 0;
    for (; reader->at < reader->end && hex_value(*reader->at) < 16 && count <= MASK_DIGITS_MAX; count++) {
        mask = mask << 4 | hex_value(*reader->at++);
    }
    frame->relay_mask = (uint16_t)(mask & FRAME_RELAY_MASK);
    frame->has_mask = true;
    return count > 0 && count <= MASK_DIGITS_MAX;
}

static bool take_time(reader_t *reader, frame_t *frame)
{
    uint64_t time_ms = 0;
    const size_t count = take_digits(reader, &time_ms);
    if (count == 0 || count > TIME_DIGITS_MAX || time_ms > FRAME_TIME_MAX_MS) {
        return false;
    }
    frame->time_ms = (uint32_t)time_ms;
    return true;
}

/* Head, command, T and colon. */
static bool take_command(reader_t *reader, frame_t *frame)
{
    if (reader->end - reader->at < 3 || reader->at[0] != '@') {
        return false;
    }
    frame->command = frame_find_command((char)reader->at[1], reader->at[2]);
    reader->at += 3;
    frame->is_timed = take(reader, 'T');
    return frame->command < FRAME_COMMANDS && take(reader, ':');
}

/* A comma and what belongs behind the values, or in the untimed form nothing at all. */
static bool take_last_field(reader_t *reader, frame_t *frame)
{
    const bool has_field = take(reader, ',');
    if (frame->is_timed) {
        return has_field && take_time(reader, frame);
    }
    return !has_field || take_mask(reader, frame);
}

size_t frame_quick(const uint8_t *text, size_t length, frame_t *frame)
{
    frame_t plain = {.command = FRAME_COMMANDS};
    reader_t reader = {text, text + length};
    if (!take_command(&reader, &plain)) {
        return 0;
    }
    plain.count = (uint8_t)frame_value_count(plain.command);
    for (unsigned i = 0; i < plain.count; i++) {
        if ((i > 0 && !take(&reader, ',')) || !take_value(&reader, &plain.value_q16[i])) {
            return 0;
        }
    }
    if (!take_last_field(&reader, &plain) || !take(&reader, '#') || reader.at - text > (ptrdiff_t)FRAME_LENGTH_MAX) {
        return 0;
    }
    *frame = plain;
    return (size_t)(reader.at - text);
}

/* SPDX-License-Identifier: MIT
 * frame_quick.c - the short way through a frame as nearly all senders write it: loops over the digits of a field instead of a
 * step of the scanner for every byte. Whatever is not as simple as that is left to the scanner, which accepts more and can say
 * what is wrong.
 */
#include "frame_quick.h"

#include "frame_command.h"

enum { DIGITS_MAX = 13, MASK_DIGITS_MAX = 4, TIME_DIGITS_MAX = 7 };

/* By powers of ten from 1, for up to 12 decimals: 2^(63 + shift) / power, rounded up and of 64 bits. What it is too large by,
 * less than the power in all, times a value below 10^13 * 2^17 stays below 2^(63 + shift), so the quotient of such a value is
 * exact. */
static const struct {
    uint64_t reciprocal;
    uint8_t shift;
} k_tens[DIGITS_MAX] = {
    {UINT64_C(0x8000000000000000), 0},  {UINT64_C(0xCCCCCCCCCCCCCCCD), 4},  {UINT64_C(0xA3D70A3D70A3D70B), 7},
    {UINT64_C(0x83126E978D4FDF3C), 10}, {UINT64_C(0xD1B71758E219652C), 14}, {UINT64_C(0xA7C5AC471B478424), 17},
    {UINT64_C(0x8637BD05AF6C69B6), 20}, {UINT64_C(0xD6BF94D5E57A42BD), 24}, {UINT64_C(0xABCC77118461CEFD), 27},
    {UINT64_C(0x89705F4136B4A598), 30}, {UINT64_C(0xDBE6FECEBDEDD5BF), 34}, {UINT64_C(0xAFEBFF0BCB24AAFF), 37},
    {UINT64_C(0x8CBCCC096F5088CC), 40},
};

/* digits / 10^fraction in Q16, to the nearest. There is no tie to decide: the middle between two values has 17 decimals. */
static inline uint64_t rounded_q16(uint64_t digits, size_t fraction)
{
    const fx_u128_t product = FX_WIDE_PRODUCT(digits << 18, k_tens[fraction].reciprocal);
    const uint64_t floor_halves = product.hi >> k_tens[fraction].shift;
    return (floor_halves + 1) >> 1;
}

/* What is left to read. end is never read. */
typedef struct {
    const uint8_t *at;
    const uint8_t *end;
} reader_t;

/* Takes the byte if it is the next one. */
static inline bool read_byte(reader_t *reader, uint8_t byte)
{
    const bool is_next = reader->at < reader->end && *reader->at == byte;
    reader->at += is_next;
    return is_next;
}

/* Appends all digits that follow to the number; it wraps where there are too many. */
HV_WRAPS static inline uint64_t read_digits(reader_t *reader, uint64_t number)
{
    const uint8_t *at = reader->at;
    for (; at < reader->end; at++) {
        const unsigned digit = *at - (unsigned)'0';
        if (digit > 9) {
            break;
        }
        number = number * 10u + digit;
    }
    reader->at = at;
    return number;
}

/* false where digits are missing or too many, or Q16.16 cannot hold the value. */
static inline bool read_value(reader_t *reader, q16_t *value_q16)
{
    const bool is_negative = read_byte(reader, '-');
    const uint8_t *const start = reader->at;
    uint64_t digits = read_digits(reader, 0);
    uint64_t value = digits << 16;
    const size_t count = (size_t)(reader->at - start);
    if (count == 0 || count > DIGITS_MAX) {
        return false;
    }
    if (read_byte(reader, '.')) {
        const uint8_t *const point = reader->at;
        digits = read_digits(reader, digits);
        const size_t fraction = (size_t)(reader->at - point);
        if (fraction == 0 || fraction > DIGITS_MAX - count) {
            return false;
        }
        value = rounded_q16(digits, fraction);
    }
    if (value > (uint64_t)INT32_MAX + is_negative) {
        return false;
    }
    *value_q16 = (q16_t)(is_negative ? -(int64_t)value : (int64_t)value);
    return true;
}

/* 0 to 15, or more where the byte is no hex digit. */
HV_WRAPS static inline unsigned hex_value(uint8_t byte)
{
    const unsigned digit = byte - (unsigned)'0';
    const unsigned letter = (byte | 0x20u) - 'a';
    return digit <= 9 ? digit : letter < 6 ? letter + 10u : 16u;
}

static inline bool read_mask(reader_t *reader, frame_t *frame)
{
    const uint8_t *const start = reader->at;
    unsigned mask = 0;
    for (; reader->at < reader->end; reader->at++) {
        const unsigned digit = hex_value(*reader->at);
        if (digit > 15) {
            break;
        }
        mask = mask << 4 | digit;
    }
    frame->relay_mask = (uint16_t)(mask & FRAME_RELAY_MASK);
    frame->has_mask = true;
    return reader->at > start && reader->at - start <= MASK_DIGITS_MAX;
}

static inline bool read_time(reader_t *reader, frame_t *frame)
{
    const uint8_t *const start = reader->at;
    const uint64_t time_ms = read_digits(reader, 0);
    if (reader->at == start || reader->at - start > TIME_DIGITS_MAX || time_ms > FRAME_TIME_MAX_MS) {
        return false;
    }
    frame->time_ms = (uint32_t)time_ms;
    return true;
}

/* Head, command, T and colon. */
static inline bool read_command(reader_t *reader, frame_t *frame)
{
    if (reader->end - reader->at < 3) {
        return false;
    }
    const frame_command_t command = frame_find_command((char)reader->at[1], reader->at[2]);
    if (command == FRAME_COMMANDS) {
        return false;
    }
    reader->at += 3;
    frame->command = command;
    frame->is_timed = read_byte(reader, 'T');
    return read_byte(reader, ':');
}

/* A comma and what belongs behind the values, or in the untimed form nothing at all. */
static inline bool read_last_field(reader_t *reader, frame_t *frame)
{
    const bool has_field = read_byte(reader, ',');
    if (frame->is_timed) {
        return has_field && read_time(reader, frame);
    }
    return !has_field || read_mask(reader, frame);
}

size_t frame_quick(const uint8_t *text, const uint8_t *end, frame_t *frame)
{
    frame_t plain = {.count = 0};
    reader_t reader = {text, end};
    if (!read_command(&reader, &plain)) {
        return 0;
    }
    plain.count = (uint8_t)frame_value_count(plain.command);
    for (unsigned i = 0; i < plain.count; i++) {
        if ((i > 0 && !read_byte(&reader, ',')) || !read_value(&reader, &plain.value_q16[i])) {
            return 0;
        }
    }
    if (!read_last_field(&reader, &plain) || !read_byte(&reader, '#')) {
        return 0;
    }
    *frame = plain;
    return (size_t)(reader.at - text);
}

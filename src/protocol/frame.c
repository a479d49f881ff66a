/* SPDX-License-Identifier: MIT
 * frame.c - the vendor's frames, one byte at a time.
 * Outside a frame: idle, or in text to be rejected. Inside: command, colon, values, mask or time. The first error sends the frame
 * to FRAME_PHASE_REJECTED, where its remaining bytes are skipped up to its `#`, the next head or the end.
 *
 * In the lenient dialect `#` is head and tail. Inside a frame or rejected text it is the tail, elsewhere a head. The `#` that
 * ends rejected text may have been meant as a head, so a command may follow it directly: bad text never spoils the good frame
 * behind it.
 */
#include "heave/frame.h"
#include "frame_command.h"
#include "frame_quick.h"
#include "frame_reject.h"

enum { MASK_DIGITS_MAX = 4 };

/* Line breaks are blanks: people and their tools wrap long frames. */
static bool is_blank(uint8_t byte)
{
    return byte == ' ' || byte == '\t' || byte == '\r' || byte == '\n';
}

/* 0 to 15, or 16 where the byte is no hex digit. */
static unsigned hex_value(uint8_t byte)
{
    const unsigned lower = byte | 0x20u;
    if (byte >= '0' && byte <= '9') {
        return byte - (unsigned)'0';
    }
    return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10u : 16u;
}

/* Letters of a command: the lenient dialect takes lower case. */
static uint8_t command_byte(const frame_scanner_t *self, uint8_t byte)
{
    return self->dialect == FRAME_LENIENT && byte >= 'a' && byte <= 'z' ? (uint8_t)(byte - 'a' + 'A') : byte;
}

/* No command starts so: without a head of its own it was no frame at all. */
static void fail_command(frame_scanner_t *self, uint8_t byte)
{
    frame_reject_byte(self, self->is_headless ? FRAME_ERR_NO_HEAD : FRAME_ERR_COMMAND, byte, 0);
}

static void begin_frame(frame_scanner_t *self, bool is_headless)
{
    self->frame = (frame_t){.command = FRAME_COMMANDS};
    self->start = self->offset;
    self->is_headless = is_headless;
    self->may_be_headless = false;
    self->phase = FRAME_PHASE_LETTER;
}

/* What a value is in messages: values count from 1 there. */
static uint8_t value_field(const frame_scanner_t *self)
{
    return (uint8_t)(self->value + 1);
}

/* The mask or the time. */
static uint8_t last_field(const frame_scanner_t *self)
{
    return (uint8_t)(self->frame.count + 1);
}

/* Starts a value, or what belongs behind the values, behind the separator being read. */
static void begin_field(frame_scanner_t *self, unsigned value)
{
    self->field_start = self->offset + 1;
    if (value < self->frame.count) {
        self->value = (uint8_t)value;
        self->phase = FRAME_PHASE_VALUE;
        number_init(&self->number);
    } else if (self->frame.is_timed) {
        self->phase = FRAME_PHASE_TIME;
        number_init(&self->number);
    } else {
        self->phase = FRAME_PHASE_MASK;
        self->frame.relay_mask = 0;
        self->mask_digits = 0;
        self->is_mask_prefixed = false;
        self->is_mask_ended = false;
    }
}

static void scan_letter(frame_scanner_t *self, uint8_t byte)
{
    self->letter = (char)command_byte(self, byte);
    if (self->letter == 'A' || self->letter == 'C') {
        self->phase = FRAME_PHASE_DIGIT;
    } else {
        fail_command(self, byte);
    }
}

static void scan_digit(frame_scanner_t *self, uint8_t byte)
{
    const frame_command_t command = frame_find_command(self->letter, byte);
    if (command == FRAME_COMMANDS) {
        fail_command(self, byte);
        return;
    }
    self->frame.command = command;
    self->frame.count = (uint8_t)frame_value_count(command);
    self->phase = FRAME_PHASE_SUFFIX;
}

static void scan_suffix(frame_scanner_t *self, uint8_t byte)
{
    if (byte == ':') {
        begin_field(self, 0);
    } else if (self->phase == FRAME_PHASE_SUFFIX && command_byte(self, byte) == 'T') {
        self->frame.is_timed = true;
        self->phase = FRAME_PHASE_COLON;
    } else {
        frame_reject_byte(self, FRAME_ERR_SEPARATOR, byte, 0);
    }
}

/* The separator behind a value came. */
static void finish_value(frame_scanner_t *self, uint8_t separator)
{
    switch (number_finish(&self->number, &self->frame.value_q16[self->value])) {
    case NUMBER_OK:
        break;
    case NUMBER_EMPTY:
        frame_reject_byte(self, FRAME_ERR_VALUE_EMPTY, separator, value_field(self));
        break;
    case NUMBER_SYNTAX:
        frame_reject_byte(self, FRAME_ERR_VALUE_SYNTAX, separator, value_field(self));
        break;
    case NUMBER_OVERFLOW:
        frame_reject_at(self, FRAME_ERR_VALUE_OVERFLOW, self->field_start, value_field(self));
        break;
    }
}

static void scan_value(frame_scanner_t *self, uint8_t byte)
{
    if (byte == ',') {
        finish_value(self, byte);
        if (self->phase != FRAME_PHASE_REJECTED) {
            begin_field(self, self->value + 1u);
        }
    } else if (number_feed(&self->number, byte) != NUMBER_OK) {
        frame_reject_byte(self, FRAME_ERR_VALUE_SYNTAX, byte, value_field(self));
    }
}

static void scan_mask_digit(frame_scanner_t *self, uint8_t byte)
{
    const unsigned digit = hex_value(byte);
    const bool is_prefix =
        (byte | 0x20u) == 'x' && !self->is_mask_prefixed && self->mask_digits == 1 && self->frame.relay_mask == 0;
    if (self->is_mask_ended || (digit > 15 && !is_prefix) || self->mask_digits == MASK_DIGITS_MAX) {
        frame_reject_byte(self, FRAME_ERR_MASK, byte, last_field(self));
    } else if (is_prefix) {
        self->is_mask_prefixed = true;
        self->mask_digits = 0;
    } else {
        self->frame.relay_mask = (uint16_t)((unsigned)self->frame.relay_mask << 4 | digit);
        self->mask_digits++;
    }
}

static void scan_mask(frame_scanner_t *self, uint8_t byte)
{
    if (byte == ',') {
        frame_reject_count(self, byte, self->frame.count + 2u);
    } else if (is_blank(byte)) {
        self->is_mask_ended = self->mask_digits > 0 || self->is_mask_prefixed;
    } else {
        scan_mask_digit(self, byte);
    }
}

static void finish_mask(frame_scanner_t *self, uint8_t tail)
{
    if (self->mask_digits == 0) {
        frame_reject_byte(self, FRAME_ERR_MASK, tail, last_field(self));
        return;
    }
    self->frame.relay_mask &= FRAME_RELAY_MASK;
    self->frame.has_mask = true;
}

static void scan_time(frame_scanner_t *self, uint8_t byte)
{
    if (byte == ',') {
        frame_reject_count(self, byte, self->frame.count + 2u);
    } else if (number_feed(&self->number, byte) != NUMBER_OK) {
        frame_reject_byte(self, FRAME_ERR_TIME, byte, last_field(self));
    }
}

static void finish_time(frame_scanner_t *self, uint8_t tail)
{
    const number_error_t error = number_finish_natural(&self->number, &self->frame.time_ms);
    if (error == NUMBER_EMPTY || error == NUMBER_SYNTAX) {
        frame_reject_byte(self, FRAME_ERR_TIME, tail, last_field(self));
    } else if (error == NUMBER_OVERFLOW && self->number.is_negative) {
        frame_reject_at(self, FRAME_ERR_TIME, self->field_start, last_field(self));
    } else if (error == NUMBER_OVERFLOW || self->frame.time_ms > FRAME_TIME_MAX_MS) {
        frame_reject_at(self, FRAME_ERR_TIME_RANGE, self->field_start, last_field(self));
    }
}

/* A comma in a rejected frame: behind the last field it says that there are too many, whatever that field looked like. */
static void count_rejected(frame_scanner_t *self)
{
    const frame_error_t error = self->reject.error;
    if (error == FRAME_ERR_COUNT) {
        self->reject.found = (uint8_t)(self->reject.found + (self->reject.found < UINT8_MAX));
    } else if (error == FRAME_ERR_MASK || error == FRAME_ERR_TIME) {
        frame_reject_count(self, ',', self->frame.count + 2u);
    }
}

static void scan_rejected(frame_scanner_t *self, uint8_t byte)
{
    if (self->utf8_left > 0) {
        frame_reject_add_byte(self, byte);
    }
    if (byte == ',') {
        count_rejected(self);
    }
}

static void scan_idle(frame_scanner_t *self, uint8_t byte)
{
    const bool may_be_headless = self->may_be_headless;
    self->may_be_headless = false;
    if (is_blank(byte) || byte == '\0') {
        return;
    }
    begin_frame(self, true);
    if (may_be_headless) {
        scan_letter(self, byte);
    } else {
        frame_reject_byte(self, FRAME_ERR_NO_HEAD, byte, 0);
    }
}

/* Any byte but a head or a tail. */
typedef void scan_t(frame_scanner_t *self, uint8_t byte);

static scan_t *const k_scan[] = {
    [FRAME_PHASE_IDLE] = scan_idle,     [FRAME_PHASE_LETTER] = scan_letter, [FRAME_PHASE_DIGIT] = scan_digit,
    [FRAME_PHASE_SUFFIX] = scan_suffix, [FRAME_PHASE_COLON] = scan_suffix,  [FRAME_PHASE_VALUE] = scan_value,
    [FRAME_PHASE_MASK] = scan_mask,     [FRAME_PHASE_TIME] = scan_time,     [FRAME_PHASE_REJECTED] = scan_rejected,
};

/* `#` behind a value: all must be there but the mask. */
static void finish_at_value(frame_scanner_t *self, uint8_t tail)
{
    q16_t ignored;
    if (self->value == 0 && number_finish(&self->number, &ignored) == NUMBER_EMPTY) {
        frame_reject_count(self, tail, 0);
        return;
    }
    finish_value(self, tail);
    if (self->phase == FRAME_PHASE_REJECTED) {
        return;
    }
    if (value_field(self) < self->frame.count) {
        frame_reject_count(self, tail, value_field(self));
    } else if (self->frame.is_timed) {
        frame_reject_byte(self, FRAME_ERR_TIME, tail, last_field(self));
    }
}

/* Whether the `#` being read belongs to `1.#QNAN`, `-1.#IND00` or the like instead of ending the frame. */
static bool is_nan(const frame_scanner_t *self, uint8_t next)
{
    const uint8_t lower = next | 0x20u;
    return (self->phase == FRAME_PHASE_VALUE || self->phase == FRAME_PHASE_TIME) && lower >= 'a' && lower <= 'z' &&
           number_is_one_and_point(&self->number);
}

static void fail_nan(frame_scanner_t *self)
{
    const bool is_value = self->phase == FRAME_PHASE_VALUE;
    frame_reject_byte(self, is_value ? FRAME_ERR_VALUE_SYNTAX : FRAME_ERR_TIME, '#',
                      is_value ? value_field(self) : last_field(self));
    self->reject.is_nan = true;
}

/* `#` inside a frame: the checks of its last field. */
static void finish(frame_scanner_t *self, uint8_t tail)
{
    switch ((frame_phase_t)self->phase) {
    case FRAME_PHASE_LETTER:
    case FRAME_PHASE_DIGIT:
        fail_command(self, tail);
        break;
    case FRAME_PHASE_SUFFIX:
    case FRAME_PHASE_COLON:
        frame_reject_byte(self, FRAME_ERR_SEPARATOR, tail, 0);
        break;
    case FRAME_PHASE_VALUE:
        finish_at_value(self, tail);
        break;
    case FRAME_PHASE_MASK:
        finish_mask(self, tail);
        break;
    case FRAME_PHASE_TIME:
        finish_time(self, tail);
        break;
    case FRAME_PHASE_IDLE:
    case FRAME_PHASE_REJECTED:
        break;
    }
}

static frame_event_t scan_at(frame_scanner_t *self, frame_reject_t *reject)
{
    const frame_event_t event =
        self->phase == FRAME_PHASE_IDLE ? FRAME_EVENT_NONE : frame_reject_unfinished(self, self->offset, reject);
    begin_frame(self, false);
    return event;
}

static frame_event_t scan_hash(frame_scanner_t *self, uint8_t next, frame_t *frame, frame_reject_t *reject)
{
    if (self->phase == FRAME_PHASE_IDLE && self->dialect == FRAME_LENIENT) {
        begin_frame(self, false);
        return FRAME_EVENT_NONE;
    }
    if (self->phase == FRAME_PHASE_IDLE) {
        scan_idle(self, '#');
    }
    if (is_nan(self, next)) {
        fail_nan(self);
    } else {
        finish(self, '#');
    }
    if (self->phase == FRAME_PHASE_REJECTED) {
        self->may_be_headless = self->dialect == FRAME_LENIENT;
        return frame_reject_report(self, self->offset + 1, reject);
    }
    *frame = self->frame;
    self->phase = FRAME_PHASE_IDLE;
    self->has_event = true;
    return FRAME_EVENT_FRAME;
}

/* Blanks and NUL: a NUL ends the text, and a field starts behind its leading blanks. */
static void scan_white(frame_scanner_t *self, uint8_t byte)
{
    if (byte == '\0' && self->phase != FRAME_PHASE_IDLE && self->phase != FRAME_PHASE_REJECTED) {
        frame_reject_byte(self, FRAME_ERR_UNFINISHED, byte, 0);
        return;
    }
    self->field_start += self->field_start == self->offset;
    k_scan[self->phase](self, byte);
}

static frame_event_t scan_other(frame_scanner_t *self, uint8_t byte, frame_reject_t *reject)
{
    if (byte <= ' ') {
        scan_white(self, byte);
    } else {
        k_scan[self->phase](self, byte);
    }
    if (self->offset - self->start >= FRAME_LENGTH_MAX - 1 && self->phase != FRAME_PHASE_IDLE) {
        return frame_reject_unfinished(self, self->offset + 1, reject);
    }
    return FRAME_EVENT_NONE;
}

void frame_scanner_init(frame_scanner_t *self, frame_dialect_t dialect)
{
    /* copied, as clearing so many bytes is slow on some CPUs: `rep stos` takes a quarter of the time of a short frame */
    static const frame_scanner_t k_start[] = {
        [FRAME_V3] = {.dialect = FRAME_V3, .phase = FRAME_PHASE_IDLE},
        [FRAME_LENIENT] = {.dialect = FRAME_LENIENT, .phase = FRAME_PHASE_IDLE, .may_be_headless = true},
    };
    *self = k_start[dialect];
}

frame_event_t frame_scanner_feed(frame_scanner_t *self, uint8_t byte, uint8_t next, frame_t *frame, frame_reject_t *reject)
{
    frame_event_t event = FRAME_EVENT_NONE;
    if (byte == '@') {
        event = scan_at(self, reject);
    } else if (byte == '#') {
        event = scan_hash(self, next, frame, reject);
    } else {
        event = scan_other(self, byte, reject);
    }
    self->offset++;
    return event;
}

frame_event_t frame_scanner_end(frame_scanner_t *self, frame_reject_t *reject)
{
    frame_event_t event = FRAME_EVENT_NONE;
    if (self->phase == FRAME_PHASE_IDLE && !self->has_event) {
        self->frame.command = FRAME_COMMANDS;
        frame_reject_at(self, FRAME_ERR_NO_HEAD, 0, 0);
    }
    if (self->phase != FRAME_PHASE_IDLE) {
        event = frame_reject_unfinished(self, self->offset, reject);
    }
    frame_scanner_init(self, self->dialect);
    return event;
}

/* A plain frame where the scanner stands between frames; returns its bytes, 0: no such frame. */
static size_t scan_plain_frame(frame_scanner_t *self, const uint8_t *text, const uint8_t *end, frame_t *frame)
{
    const size_t used = self->phase == FRAME_PHASE_IDLE && text[0] == '@' ? frame_quick(text, end, frame) : 0;
    if (used > 0) {
        self->start = self->offset;
        self->offset += (uint32_t)used;
        self->may_be_headless = false;
        self->has_event = true;
    }
    return used;
}

frame_event_t frame_next(frame_scanner_t *self, const uint8_t *datagram, size_t length, size_t *position, frame_t *frame,
                         frame_reject_t *reject)
{
    for (size_t i = *position; i < length; i++) {
        const size_t used = scan_plain_frame(self, datagram + i, datagram + length, frame);
        if (used > 0) {
            *position = i + used;
            return FRAME_EVENT_FRAME;
        }
        const uint8_t next = i + 1 < length ? datagram[i + 1] : 0;
        const frame_event_t event = frame_scanner_feed(self, datagram[i], next, frame, reject);
        if (event != FRAME_EVENT_NONE) {
            *position = i + 1;
            return event;
        }
    }
    const bool is_at_end = *position <= length;
    *position = length + 1;
    return is_at_end ? frame_scanner_end(self, reject) : FRAME_EVENT_NONE;
}

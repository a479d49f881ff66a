/* SPDX-License-Identifier: MIT
 * frame.h - the vendor's ASCII frames (`@A6:5,6,0,5.5,3.0,20,F0#`): bytes in, commands or reasons out.
 * A byte-fed state machine: the same code reads datagrams in place and serial lines. No allocation, no copy, no locale,
 * bounded time per byte. A frame with an error delivers nothing but its reason.
 */
#ifndef HEAVE_FRAME_H
#define HEAVE_FRAME_H

#include "heave/fx.h"
#include "heave/number.h"

/** Commands; the T forms are the same command with is_timed. */
typedef enum {
    FRAME_A3, /**< roll, pitch [deg], z [mm] */
    FRAME_A4, /**< roll, pitch, z, angle [deg] */
    FRAME_A6, /**< roll, pitch, yaw [deg], x, y, z [mm] */
    FRAME_A7, /**< roll, pitch, yaw, x, y, z, angle [deg] */
    FRAME_C3, /**< extension of cylinders 1-3 [mm] */
    FRAME_C6, /**< extension of cylinders 1-6 [mm] */
    FRAME_C7, /**< extension of cylinders 1-6 [mm], angle [deg] */
    FRAME_COMMANDS
} frame_command_t;

#define FRAME_VALUES_MAX  7u
#define FRAME_TIME_MAX_MS 3600000u
#define FRAME_RELAY_MASK  0x0FFFu

/** Longest frame. It is longer than any UDP datagram: the limit only matters on a serial line that sends no heads and tails. */
#define FRAME_LENGTH_MAX 65536u

/** Accepted forms beside V3.0. In the lenient dialect, the `#` after rejected text is both its tail and the head of a frame that
 * may follow directly, so that bad text never spoils a good frame. The `#` of a good frame is only its tail. */
typedef enum {
    FRAME_V3,     /**< head `@` only */
    FRAME_LENIENT /**< also V1.0's `#` head, no head at the start of a datagram, lower-case commands */
} frame_dialect_t;

/** One accepted frame. */
typedef struct {
    frame_command_t command;
    bool is_timed;                     /**< T form: time_ms is valid and the relays stay as they are */
    bool has_mask;                     /**< relay_mask is valid; false in the T form and where the mask was missing */
    uint16_t relay_mask;               /**< bits 0-11: relays 1-12, 1 = closed */
    uint32_t time_ms;                  /**< [0, FRAME_TIME_MAX_MS]; fractions rounded to the nearest ms, ties to even */
    uint8_t count;                     /**< values, without mask or time */
    q16_t value_q16[FRAME_VALUES_MAX]; /**< deg or mm, in frame order; 0 beyond count */
} frame_t;

/** Why a frame was rejected; also the index of its counter. */
typedef enum {
    FRAME_ERR_NO_HEAD,    /**< bytes outside any frame, or a datagram that holds none */
    FRAME_ERR_UNFINISHED, /**< the datagram ended, or a NUL or a new head came, before `#` */
    FRAME_ERR_COMMAND,    /**< not one of the commands (look-alike letters are named) */
    FRAME_ERR_SEPARATOR,  /**< no `:` after the command */
    FRAME_ERR_COUNT,      /**< too few or too many values */
    FRAME_ERR_VALUE_EMPTY,
    FRAME_ERR_VALUE_SYNTAX,
    FRAME_ERR_VALUE_OVERFLOW, /**< Q16.16 cannot hold it */
    FRAME_ERR_MASK,           /**< not 1 to 4 hex digits */
    FRAME_ERR_TIME,           /**< T form without time, or a time that is negative or not a number */
    FRAME_ERR_TIME_RANGE,     /**< above FRAME_TIME_MAX_MS after rounding */
    FRAME_ERR_PLATFORM,       /**< well formed, but this platform has no such axis (set by the gateway) */
    FRAME_ERR_MASK_FORM, /**< well formed, but with a mask where its sender sends none, or without one (set by the gateway) */
    FRAME_ERRORS
} frame_error_t;

/** Place and reason of the first error of the frame. Exception: too many values are reported as COUNT, whatever they look like.
 *  Offsets count bytes from the start of the datagram (or since the last reset of a serial feed, modulo 2^32). */
typedef struct {
    frame_error_t error;
    uint32_t offset;         /**< of the first byte that is not allowed there, or of the start of a value out of range */
    uint32_t start;          /**< of the frame's head (or of the first stray byte) */
    uint32_t end;            /**< one past the last byte that belongs to the rejected text */
    uint8_t field;           /**< index of the value concerned, from 1; mask or time is the last; 0: none */
    uint8_t expected;        /**< FRAME_ERR_COUNT: values the command takes before mask or time, else 0 */
    uint8_t found;           /**< FRAME_ERR_COUNT: values seen, any mask or time included, else 0; stops at 255 */
    uint8_t byte;            /**< the byte at offset if this byte is the error; else 0 */
    uint32_t look_alike;     /**< code point of a non-ASCII character (UTF-8) at offset; 0: it is ASCII or not UTF-8 */
    frame_command_t command; /**< FRAME_COMMANDS: none was recognised */
    bool is_timed;           /**< the T form of command */
    bool is_nan;             /**< VALUE_SYNTAX, TIME: `1.#` and a letter, as a Windows program prints what is no number */
} frame_reject_t;

/** Result of a byte. Stray bytes before a head are reported at that head, a frame at its `#`. */
typedef enum { FRAME_EVENT_NONE, FRAME_EVENT_FRAME, FRAME_EVENT_REJECT } frame_event_t;

/** Scanner state; members are private to src/protocol. */
typedef struct {
    frame_dialect_t dialect;
    uint8_t phase;
    uint8_t value;     /**< being read, or read last; from 0 */
    uint8_t utf8_left; /**< bytes still to come of reject.look_alike */
    char letter;       /**< first of the command */
    uint8_t mask_digits;
    bool is_mask_prefixed; /**< `0x` was read */
    bool is_mask_ended;    /**< a blank after the mask was read */
    bool is_headless;      /**< the frame being read began without a head (`@`) */
    bool may_be_headless;  /**< lenient dialect: a frame without a head may begin here */
    bool has_event;        /**< this datagram has led to an event */
    uint32_t offset;       /**< of the next byte */
    uint32_t start;        /**< of the frame or stray text being read */
    uint32_t field_start;  /**< of the field being read, after leading blanks */
    number_t number;
    frame_t frame;
    frame_reject_t reject;
} frame_scanner_t;

/** Starts scanning: at the start of every datagram, or when a serial line opens. */
void frame_scanner_init(frame_scanner_t *self, frame_dialect_t dialect);

/** Takes one byte; at most one event a byte.
 *  @param next   the byte that follows, 0 where none does or none is known: a letter makes `1.#` no number instead of 1 and a
 * tail
 *  @param frame  out: valid on FRAME_EVENT_FRAME, else unchanged
 *  @param reject out: valid on FRAME_EVENT_REJECT, else unchanged */
/*@ requires \valid(self) && \valid(frame) && \valid(reject);
    assigns *self, *frame, *reject, \result; */
frame_event_t frame_scanner_feed(frame_scanner_t *self, uint8_t byte, uint8_t next, frame_t *frame, frame_reject_t *reject);

/** Ends a datagram: an unfinished frame, stray bytes, or a datagram that led to no event at all become a reject.
 *  The scanner is then ready for the next datagram. */
/*@ requires \valid(self) && \valid(reject);
    assigns *self, *reject, \result; */
frame_event_t frame_scanner_end(frame_scanner_t *self, frame_reject_t *reject);

/** Reads a datagram in place, its end included: call until FRAME_EVENT_NONE. The scanner is then ready for the next one.
 *  @param position in/out: 0 at first; length + 1 once the end has been read. The scanner must have been initialised. */
/*@ requires length == 0 || \valid_read(datagram + (0 .. length - 1));
    requires \valid(self) && \valid(position) && \valid(frame) && \valid(reject); */
frame_event_t frame_next(frame_scanner_t *self, const uint8_t *datagram, size_t length, size_t *position, frame_t *frame,
                         frame_reject_t *reject);

/** Values a command takes before mask or time: 3, 4, 6 or 7. */
unsigned frame_value_count(frame_command_t command);

/** "A6", "C3"...: constant text. */
const char *frame_command_name(frame_command_t command);

/** Short constant identifier of a reason for counters and JSON: "no_head", "unfinished", ... */
const char *frame_error_name(frame_error_t error);

/** One line for the log: the byte (from 0), the error, what is allowed, and look-alikes by name; printable ASCII, no newline.
 *  @param capacity bytes at text, at least 1; the line is cut to fit and always ends in NUL
 *  @return length without NUL */
size_t frame_reject_describe(const frame_reject_t *reject, char *text, size_t capacity);

#endif

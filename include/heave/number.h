/* SPDX-License-Identifier: MIT
 * number.h - decimal text to Q16.16, correctly rounded, fed a byte at a time.
 * Accepts the usual text of a single-precision float (sign, digits, point, exponent); refuses nan, inf, hex, blanks inside.
 * Pure state machine: no locale, no allocation, bounded time per byte, any digit count and any exponent.
 */
#ifndef HEAVE_NUMBER_H
#define HEAVE_NUMBER_H

#include "heave/fx.h"

/** Why a text is not a number. */
typedef enum {
    NUMBER_OK = 0,
    NUMBER_EMPTY,   /**< nothing but blanks */
    NUMBER_SYNTAX,  /**< not a decimal number */
    NUMBER_OVERFLOW /**< a magnitude the result cannot hold after rounding */
} number_error_t;

/** Largest result of number_finish_natural. */
#define NUMBER_NATURAL_MAX 999999999u

/** Parser state; members are private to src/protocol. The text so far is 0.lead tail * 10^(point + exponent). */
typedef struct {
    uint64_t lead;        /**< the first 19 significant digits */
    int64_t point;        /**< digits before the decimal point, counted from the first significant one; can be negative */
    int64_t exponent;     /**< magnitude of the exponent as written, saturated */
    uint16_t tail;        /**< the next 3 digits */
    uint8_t lead_count;   /**< digits in lead */
    uint8_t tail_count;   /**< digits in tail */
    uint8_t phase;        /**< where in the grammar the text stands */
    bool has_more_digits; /**< a non-zero digit beyond those kept */
    bool is_negative;
    bool is_exponent_negative;
} number_t;

/** Starts a number. */
void number_init(number_t *self);

/** Takes the next byte of the text; blanks (space, tab, CR, LF) around the number are allowed.
 *  @return NUMBER_OK, or NUMBER_SYNTAX at the first byte that cannot be part of a number (the state is then dead). */
number_error_t number_feed(number_t *self, uint8_t byte);

/** Ends the number: the nearest Q16.16, ties to even.
 *  @param value_q16 out; unchanged on error. */
number_error_t number_finish(const number_t *self, q16_t *value_q16);

/** Ends the number: the nearest whole number, ties to even.
 *  @param value out, [0, NUMBER_NATURAL_MAX]; unchanged on error.
 *  @return NUMBER_OVERFLOW also for any value below zero, even one that would round to zero; -0 is zero. */
number_error_t number_finish_natural(const number_t *self, uint32_t *value);

/** Whether the text so far is the value 1 or -1 and ends in its point, as in `1.`: before `#` and a letter that is how
 * Microsoft's C runtime begins what is no number (`1.#QNAN`, `-1.#IND`, `1.#INF`, rounded `1.#J`). */
bool number_is_one_and_point(const number_t *self);

/** number_init, number_feed and number_finish over a text of known length. */
number_error_t number_parse(const char *text, size_t length, q16_t *value_q16);

#endif

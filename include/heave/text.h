/* SPDX-License-Identifier: MIT
 * text.h - builds a line of text in a buffer of fixed size; what does not fit is cut off. For log lines of the core, which has no
 * printf. No locale, no allocation, always ends in NUL.
 */
#ifndef HEAVE_TEXT_H
#define HEAVE_TEXT_H

#include "heave/fx.h"

/** A line being built in the caller's buffer. */
typedef struct {
    char *at;
    size_t capacity; /**< bytes at `at`, at least 1 */
    size_t length;   /**< without NUL */
} text_t;

/** Starts an empty line. */
text_t text_start(char *buffer, size_t capacity);

/** Appends a character, a string, a decimal number, a hexadecimal number with at least so many digits (1 to 8). */
/*@ requires \valid(self);
    assigns *self \from *self; */
void text_put_char(text_t *self, char c);
/*@ requires \valid(self) && \valid_read(string);
    assigns *self \from *self; */
void text_put(text_t *self, const char *string);
/*@ requires \valid(self);
    assigns *self \from *self; */
void text_put_u32(text_t *self, uint32_t number);
/*@ requires \valid(self);
    assigns *self \from *self; */
void text_put_hex(text_t *self, uint32_t number, unsigned digits_min);

/** Appends a value with decimals, to the nearest.
 *  @param decimals at most 3 */
void text_put_q32(text_t *self, q32_t value_q32, unsigned decimals);

/** Appends bytes that came from outside: printable ASCII as it is, the rest (and the backslash) as C escapes. */
void text_put_escaped(text_t *self, const uint8_t *bytes, size_t length);

#endif

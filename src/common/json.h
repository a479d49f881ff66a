/* SPDX-License-Identifier: MIT
 * json.h - writes JSON into a buffer of fixed size. No allocation, no locale. What does not fit sets is_cut: then the text is
 * no JSON and must not be sent.
 * By hand: the libraries that write JSON (cJSON among them, which heavectl reads it with) allocate, and nothing in heaved may
 * once it runs.
 */
#ifndef HEAVE_COMMON_JSON_H
#define HEAVE_COMMON_JSON_H

#include "heave/fx.h"

/** A text being written. */
typedef struct {
    char *at;
    size_t capacity;
    size_t length;
    bool is_comma_due;
    bool is_cut;
} json_t;

/** Starts an empty text in the caller's buffer; not ended by a NUL. */
void json_start(json_t *self, char *buffer, size_t capacity);

/** Opens an object `{` or an array `[`, closes it with `}` or `]`. In an array, and at the top, key is NULL; so below. */
void json_open(json_t *self, const char *key, char bracket);
void json_close(json_t *self, char bracket);

void json_text(json_t *self, const char *key, const char *text);
void json_number(json_t *self, const char *key, uint64_t number);
/** With six decimals. */
void json_q32(json_t *self, const char *key, q32_t value_q32);
/** Microseconds as milliseconds with three decimals. */
void json_ms(json_t *self, const char *key, uint64_t value_us);
void json_bool(json_t *self, const char *key, bool value);
void json_null(json_t *self, const char *key);

/** Ends the line. */
void json_newline(json_t *self);

#endif

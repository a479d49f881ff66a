/* SPDX-License-Identifier: MIT
 * config_text.h - bounded text building for messages and dumps: what does not fit is cut off, never written past the end.
 */
#ifndef HEAVE_CONFIG_CONFIG_TEXT_H
#define HEAVE_CONFIG_CONFIG_TEXT_H

#include "heave/fx.h"

/** Columns of what stands before the values of a report, with the blanks behind it. */
#define CONFIG_LABEL_COLUMNS 26u

/** A text that grows; always ends with a NUL. */
typedef struct {
    size_t length;
    char data[640];
} config_text_t;

#if defined(__GNUC__)
#define CONFIG_PRINTF(text_index, first) __attribute__((format(printf, text_index, first)))
#else
#define CONFIG_PRINTF(text_index, first)
#endif

/** Empties the text. */
void config_text_clear(config_text_t *self);

/** Appends as printf does. */
void config_text_add(config_text_t *self, const char *format, ...) CONFIG_PRINTF(2, 3);

/** Appends a piece of the file: bytes that do not print, or look like others, as \xNN, cut after 40 bytes. */
void config_text_add_escaped(config_text_t *self, const char *text, size_t length);

/** The same in quotes. */
void config_text_add_quoted(config_text_t *self, const char *text, size_t length);

/** Appends thousandths as a decimal without trailing zeros: 1500 gives 1.5. */
void config_text_add_milli(config_text_t *self, int64_t value_milli);

/** Appends the shortest decimal that reads back as the same Q16.16. */
void config_text_add_q16(config_text_t *self, q16_t value_q16);

#endif

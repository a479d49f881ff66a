/* SPDX-License-Identifier: MIT
 * columns.h - how wide texts are on a terminal: a Chinese character takes two columns. By the C library's wcwidth(), in the
 * LC_CTYPE that translate_begin() has set. No allocation.
 */
#ifndef HEAVE_COMMON_COLUMNS_H
#define HEAVE_COMMON_COLUMNS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/** A character of a text. */
typedef struct {
    size_t bytes;     /**< at least 1; 0 at the end of the text */
    unsigned columns; /**< 0 to 2 */
} glyph_t;

/** The character that begins here; a byte that is none counts as one column. */
glyph_t columns_glyph(const char *text);

/** Columns of a text. */
unsigned columns_of(const char *text);

/** Blanks that a text lacks to be so wide, for `%s%*s` with "". */
int columns_lacking(const char *text, unsigned columns);

/** Writes a text and blanks up to so many columns. */
void columns_put(FILE *out, const char *text, unsigned columns);

/** Whether a text begins with a mark that no line begins with. */
bool columns_is_closing(const char *text);

/** Whether a line may end between what ends before `text` and what begins with it: between Chinese characters, but not in front
 *  of a closing mark nor behind an opening one. Blanks are the caller's.
 *  @param previous the character before, NULL at the beginning */
bool columns_may_break(const char *previous, const char *text);

#endif

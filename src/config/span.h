/* SPDX-License-Identifier: MIT
 * span.h - pieces of the configuration file's text: items of lists, words, whole numbers. Copies and allocates nothing.
 */
#ifndef HEAVE_CONFIG_SPAN_H
#define HEAVE_CONFIG_SPAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** A piece of text that no NUL ends. */
typedef struct {
    const char *at;
    size_t length;
} span_t;

/** Without blanks at both ends. */
span_t span_trimmed(span_t span);

/** Takes the next item off a list with commas, without blanks around it; *rest becomes NULL with the last one. */
span_t span_next_item(const char **rest);

/** The same, copied: what is longer than the buffer is cut.
 *  @return item */
const char *span_copy_item(const char **rest, char *item, size_t bytes);

/** Items of a list with commas; an empty text is one. */
unsigned span_count_items(const char *text);

bool span_is_word(span_t span, const char *word);

/** Index of a word in a list separated by `|`; -1 where it is not there, or words is NULL. */
int span_find_word(const char *words, span_t asked);

/** Reads digits with an optional sign.
 *  @return false: something else, or more than twelve digits */
bool span_read_whole(span_t item, int64_t *value);

#endif

/* SPDX-License-Identifier: MIT
 * span.c - pieces of the configuration file's text; see span.h.
 */
#include "config/span.h"

#include <stdio.h>
#include <string.h>

#define WHOLE_DIGITS_MAX 12u /* more than any range needs */

static bool is_blank(char byte)
{
    return byte == ' ' || byte == '\t';
}

span_t span_trimmed(span_t span)
{
    while (span.length > 0 && is_blank(span.at[0])) {
        span.at++;
        span.length--;
    }
    while (span.length > 0 && is_blank(span.at[span.length - 1u])) {
        span.length--;
    }
    return span;
}

span_t span_next_item(const char **rest)
{
    const char *comma = strchr(*rest, ',');
    const span_t item = {*rest, comma == NULL ? strlen(*rest) : (size_t)(comma - *rest)};
    *rest = comma == NULL ? NULL : comma + 1;
    return span_trimmed(item);
}

const char *span_copy_item(const char **rest, char *item, size_t bytes)
{
    const span_t next = span_next_item(rest);
    (void)snprintf(item, bytes, "%.*s", (int)next.length, next.at);
    return item;
}

unsigned span_count_items(const char *text)
{
    unsigned count = 1;
    for (; *text != '\0'; text++) {
        count += *text == ',';
    }
    return count;
}

bool span_is_word(span_t span, const char *word)
{
    return span.length == strlen(word) && memcmp(span.at, word, span.length) == 0;
}

int span_find_word(const char *words, span_t asked)
{
    for (int index = 0; words != NULL; index++) {
        const char *bar = strchr(words, '|');
        const size_t length = bar == NULL ? strlen(words) : (size_t)(bar - words);
        if (asked.length == length && memcmp(asked.at, words, length) == 0) {
            return index;
        }
        words = bar == NULL ? NULL : bar + 1;
    }
    return -1;
}

bool span_read_whole(span_t item, int64_t *value)
{
    const bool is_negative = item.length > 0 && item.at[0] == '-';
    const size_t start = item.length > 0 && (is_negative || item.at[0] == '+') ? 1u : 0u;
    int64_t sum = 0;
    if (item.length == start || item.length - start > WHOLE_DIGITS_MAX) {
        return false;
    }
    for (size_t i = start; i < item.length; i++) {
        if (item.at[i] < '0' || item.at[i] > '9') {
            return false;
        }
        sum = sum * 10 + (item.at[i] - '0');
    }
    *value = is_negative ? -sum : sum;
    return true;
}

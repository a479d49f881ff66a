/* SPDX-License-Identifier: MIT
 * sentence.c - see sentence.h.
 */
#include "common/sentence.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "common/translate.h"

#define ARGUMENTS_MAX 12u
#define DEPTH_MAX     6u
#define LITERAL_MIN   4u /* bytes of its own that a format has at least: "%s: %s" fits everything */

/** A piece of the English sentence. */
typedef struct {
    const char *at;
    size_t length;
    char conversion;
} argument_t;

typedef struct {
    argument_t argument[ARGUMENTS_MAX];
    unsigned count;
} match_t;

/** A conversion of a format. */
typedef struct {
    size_t length;   /* with its % */
    unsigned number; /* of `%2$s`; 0: the next one */
    char conversion;
} conversion_t;

static conversion_t conversion_at(const char *format)
{
    conversion_t found = {.length = 1};
    const size_t digits = strspn(&format[1], "0123456789");
    if (format[1 + digits] == '$') {
        for (size_t i = 1; i <= digits; i++) {
            found.number = found.number * 10u + (unsigned)(format[i] - '0');
        }
        found.length += digits + 1u;
    }
    found.length += strspn(&format[found.length], "-+ #0123456789.*lz");
    found.conversion = format[found.length];
    found.length += found.conversion != '\0' ? 1u : 0u;
    return found;
}

/* Bytes that an argument takes at most, where it is no text. */
static size_t length_of_number(const char *text, char conversion)
{
    const char *digits = conversion == 'x' || conversion == 'X'                        ? "0123456789abcdefABCDEF"
                         : conversion == 'd' || conversion == 'u' || conversion == 'i' ? "0123456789"
                                                                                       : "0123456789.e+-";
    const size_t sign = text[0] == '-' && conversion != 'x' && conversion != 'X' && conversion != 'u' ? 1u : 0u;
    const size_t length = strspn(&text[sign], digits);
    return length > 0 ? sign + length : 0;
}

/* Whether a sentence is this format with arguments. Texts are as short as they can be. */
static bool fits(const char *format, const char *text, match_t *match)
{
    while (*format != '\0' && *format != '%') {
        if (*format++ != *text++) {
            return false;
        }
    }
    if (*format == '\0') {
        return *text == '\0';
    }
    const conversion_t found = conversion_at(format);
    format += found.length;
    if (found.conversion == '%') {
        return *text == '%' && fits(format, text + 1, match);
    }
    if (match->count == ARGUMENTS_MAX) {
        return false;
    }
    argument_t *argument = &match->argument[match->count++];
    *argument = (argument_t){text, 0, found.conversion};
    if (found.conversion != 's') {
        argument->length = length_of_number(text, found.conversion);
        return argument->length > 0 && fits(format, text + argument->length, match);
    }
    const unsigned count = match->count;
    for (;; argument->length++) {
        match->count = count;
        if (fits(format, text + argument->length, match)) {
            return true;
        }
        if (text[argument->length] == '\0') {
            return false;
        }
    }
}

/* Bytes of a format that are its own. */
static size_t literal_of(const char *format)
{
    size_t literal = 0;
    while (*format != '\0') {
        const size_t length = *format == '%' ? conversion_at(format).length : 1u;
        literal += *format != '%' ? 1u : 0u;
        format += length;
    }
    return literal;
}

static bool translated(const char *english, char *out, size_t size, unsigned depth);

static size_t add(char *out, size_t size, size_t at, const char *text, size_t length)
{
    const size_t room = size - 1u - at;
    const size_t taken = length < room ? length : room;
    memcpy(&out[at], text, taken);
    out[at + taken] = '\0';
    return at + taken;
}

/* Adds an argument; a text in its own translation. */
static size_t add_argument(char *out, size_t size, size_t at, const argument_t *argument, unsigned depth)
{
    char english[SENTENCE_MAX], own[SENTENCE_MAX];
    if (argument->conversion != 's' || argument->length >= sizeof english) {
        return add(out, size, at, argument->at, argument->length);
    }
    (void)snprintf(english, sizeof english, "%.*s", (int)argument->length, argument->at);
    const bool is_known = translated(english, own, sizeof own, depth);
    return add(out, size, at, is_known ? own : english, strlen(is_known ? own : english));
}

static void fill(const char *format, const match_t *match, char *out, size_t size, unsigned depth)
{
    size_t at = 0;
    unsigned next = 0;
    out[0] = '\0';
    while (*format != '\0') {
        if (*format != '%') {
            at = add(out, size, at, format++, 1);
            continue;
        }
        const conversion_t found = conversion_at(format);
        const unsigned which = found.number > 0 ? found.number - 1u : next;
        format += found.length;
        if (found.conversion == '%') {
            at = add(out, size, at, "%", 1);
        } else if (which < match->count) {
            at = add_argument(out, size, at, &match->argument[which], depth);
            next++;
        }
    }
}

/* The format that says most itself. */
static bool fill_format(const char *english, char *out, size_t size, unsigned depth)
{
    const catalogue_t *catalogue = translate_catalogue();
    const char *best = NULL;
    size_t most = LITERAL_MIN - 1u;
    match_t match, found = {.count = 0};
    for (uint32_t i = 0; i < catalogue->count; i++) {
        const char *format = catalogue_original(catalogue, i);
        const size_t literal = strchr(format, '%') != NULL ? literal_of(format) : 0;
        match.count = 0;
        if (literal > most && fits(format, english, &match)) {
            best = catalogue_translation(catalogue, i);
            most = literal;
            found = match;
        }
    }
    if (best == NULL || best[0] == '\0') {
        return false;
    }
    fill(best, &found, out, size, depth + 1u);
    return true;
}

/* A part beside a mark: in its translation, or as it is; a single word in front of it is a name. Returns whether it was
 * translated. */
static bool translate_part(const char *at, size_t length, char *out, size_t size, unsigned depth)
{
    char part[SENTENCE_MAX];
    (void)snprintf(part, sizeof part, "%.*s", (int)length, at);
    const bool is_known = (at[length] == ',' || strchr(part, ' ') != NULL) && translated(part, out, size, depth + 1u);
    if (!is_known) {
        (void)snprintf(out, size, "%s", part);
    }
    return is_known;
}

/* Where a text begins that has its mark in front of it, as "; ..." has. */
static const char *find_joined(const char *english)
{
    const char *at = strpbrk(english, ";:,");
    while (at != NULL && catalogue_find(translate_catalogue(), at) == NULL) {
        at = strpbrk(at + 1, ";:,");
    }
    return at;
}

/* Two sentences that a mark joins, as `NAME: reason`. */
static bool fill_parts(const char *english, char *out, size_t size, unsigned depth)
{
    char before[SENTENCE_MAX], behind[SENTENCE_MAX];
    const char *joined = find_joined(english), *colon = strstr(english, ": "), *semicolon = strstr(english, "; ");
    const char *at = joined != NULL ? joined : colon != NULL && (semicolon == NULL || colon < semicolon) ? colon : semicolon;
    at = at != NULL ? at : strstr(english, ", "); /* a list of words */
    if (at == NULL) {
        return false;
    }
    const char *mark = joined != NULL ? "" : at == colon ? _(": ") : at == semicolon ? _("; ") : _(", ");
    const char *rest = joined != NULL ? at : at + 2;
    const bool is_before_known = translate_part(english, (size_t)(at - english), before, sizeof before, depth);
    const bool is_known = translated(rest, behind, sizeof behind, depth + 1u);
    (void)snprintf(out, size, "%s%s%s", before, mark, is_known ? behind : rest);
    return is_known || is_before_known;
}

static bool translated(const char *english, char *out, size_t size, unsigned depth)
{
    const char *found = catalogue_find(translate_catalogue(), english);
    if (found != NULL) {
        (void)snprintf(out, size, "%s", found);
        return true;
    }
    return depth < DEPTH_MAX && strchr(english, ' ') != NULL &&
           (fill_format(english, out, size, depth) || fill_parts(english, out, size, depth));
}

const char *sentence(const char *english, char *out, size_t size)
{
    return translated(english, out, size, 0) ? out : english;
}

/* SPDX-License-Identifier: MIT
 * frame_oracle.c - what frames a datagram holds, from whole texts: finds head and tail, then splits and reads what is between.
 * Shares nothing with the scanner; numbers are those of number_model.c. Says nothing about why a text is no frame.
 */
#include "frame_oracle.h"

#include "number_model.h"
#include "unity.h"

#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void line_add(line_t *line, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    line->length += (size_t)vsnprintf(line->text + line->length, sizeof line->text - line->length, format, arguments);
    va_end(arguments);
    TEST_ASSERT_LESS_THAN_UINT(sizeof line->text, line->length);
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

/* Cuts blanks off both ends, in place. */
static char *trimmed(char *text)
{
    while (is_blank(*text)) {
        text++;
    }
    for (size_t length = strlen(text); length > 0 && is_blank(text[length - 1]); length--) {
        text[length - 1] = '\0';
    }
    return text;
}

static bool oracle_mask(char *text, line_t *line)
{
    text = trimmed(text);
    text += text[0] == '0' && (text[1] == 'x' || text[1] == 'X') ? 2 : 0;
    const size_t digits = strspn(text, "0123456789abcdefABCDEF");
    if (digits < 1 || digits > 4 || text[digits] != '\0') {
        return false;
    }
    line_add(line, " mask=%u", (unsigned)strtoul(text, NULL, 16) % 4096);
    return true;
}

static bool oracle_last(char *text, bool is_timed, line_t *line)
{
    uint32_t time_ms;
    if (!is_timed && text == NULL) {
        line_add(line, " nomask");
        return true;
    }
    if (!is_timed) {
        return oracle_mask(text, line);
    }
    if (text == NULL || model_natural(text, &time_ms) != NUMBER_OK || time_ms > 3600000) {
        return false;
    }
    line_add(line, " time=%u", (unsigned)time_ms);
    return true;
}

/* Splits at the next comma; NULL where nothing is left. */
static char *split(char **rest)
{
    char *const field = *rest;
    char *const comma = field == NULL ? NULL : strchr(field, ',');
    *rest = comma == NULL ? NULL : comma + 1;
    if (comma != NULL) {
        *comma = '\0';
    }
    return field;
}

/* The values of a command, then its mask or time. */
static bool oracle_values(char *rest, unsigned count, bool is_timed, line_t *line)
{
    for (unsigned i = 0; i < count; i++) {
        q16_t value;
        const char *const field = split(&rest);
        if (field == NULL || model_q16(field, &value) != NUMBER_OK) {
            return false;
        }
        line_add(line, " %d", (int)value);
    }
    char *const last = split(&rest);
    return rest == NULL && oracle_last(last, is_timed, line);
}

/* A frame without head and tail; appends it where it is right. */
static bool oracle_frame(const char *bytes, size_t length, frame_dialect_t dialect, line_t *line)
{
    static char text[ORACLE_DATAGRAM_MAX + 1];
    const size_t before = line->length;
    memcpy(text, bytes, length);
    text[length] = '\0';
    for (char *c = text; dialect == FRAME_LENIENT && *c != '\0' && *c != ':'; c++) {
        *c = (char)toupper((unsigned char)*c);
    }
    const bool is_timed = length > 2 && text[2] == 'T';
    const bool is_command =
        length > 2 && strchr("AC", text[0]) != NULL && strchr(text[0] == 'A' ? "3467" : "367", text[1]) != NULL;
    if (!is_command || text[2 + is_timed] != ':' || memchr(bytes, '\0', length) != NULL) {
        return false;
    }
    line_add(line, "%s%.2s%s", line->length > 0 ? "; " : "", text, is_timed ? "T" : "");
    if (oracle_values(text + 3 + is_timed, (unsigned)(text[1] - '0'), is_timed, line)) {
        return true;
    }
    line->length = before;
    line->text[before] = '\0';
    return false;
}

/* Whether text, up to a `#`, and what follows it are a Microsoft runtime's NaN or infinity: a last field of 1 and a point, then a
 * letter. */
static bool ends_in_nan(const char *bytes, size_t length, char after)
{
    size_t start = length;
    while (start > 0 && strchr(",:", bytes[start - 1]) == NULL) {
        start--;
    }
    while (start < length && is_blank(bytes[start])) {
        start++;
    }
    start += start < length && strchr("+-", bytes[start]) != NULL;
    while (start < length && bytes[start] == '0') {
        start++;
    }
    return length - start == 2 && memcmp(bytes + start, "1.", 2) == 0 && isalpha((unsigned char)after) &&
           (unsigned char)after < 128;
}

/* All right frames of a datagram, in order. */
void frame_oracle(line_t *line, frame_dialect_t dialect, const char *bytes, size_t length)
{
    bool may_be_headless = dialect == FRAME_LENIENT;
    line->length = 0;
    line->text[0] = '\0';
    for (size_t i = 0; i < length;) {
        const bool has_head = bytes[i] == '@' || (bytes[i] == '#' && dialect == FRAME_LENIENT);
        if (is_blank(bytes[i]) || bytes[i] == '\0') {
            may_be_headless = false;
            i++;
            continue;
        }
        const size_t begin = i + has_head;
        size_t end = begin;
        while (end < length && bytes[end] != '@' && bytes[end] != '#') {
            end++;
        }
        const bool is_finished = end < length && bytes[end] == '#';
        const bool is_good = is_finished && (has_head || may_be_headless) &&
                             !ends_in_nan(bytes + begin, end - begin, end + 1 < length ? bytes[end + 1] : '\0') &&
                             oracle_frame(bytes + begin, end - begin, dialect, line);
        may_be_headless = dialect == FRAME_LENIENT && is_finished && !is_good;
        i = is_finished ? end + 1 : end;
    }
}

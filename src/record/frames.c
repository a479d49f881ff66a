/* SPDX-License-Identifier: MIT
 * frames.c - files of frames; see frames.h.
 */
#include "record/frames.h"

#include "common/encoding.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define READ_BYTES      65536u
#define FRAMES_LINE_MAX (1u << 20) /* the longest text with all its bytes as escapes, or a !state, several times over */
#define FRAMES_FILE_MAX (1u << 30) /* a day of frames at 60 Hz is a third of it */

/* A device or a pipe may never end: what cannot be a file of frames is not read on.
 * Returns false: errno is EFBIG for too much of it, EMSGSIZE for a line that does not end; or what the system says. */
static bool read_whole(FILE *file, char **bytes, size_t *length)
{
    size_t capacity = 0;
    size_t line = 0; /* where the newest one begins */
    for (;;) {
        if (*length > FRAMES_FILE_MAX || *length - line > FRAMES_LINE_MAX) {
            errno = *length - line > FRAMES_LINE_MAX ? EMSGSIZE : EFBIG;
            return false;
        }
        if (capacity - *length < READ_BYTES) {
            capacity = capacity * 2 + 2 * READ_BYTES;
            char *more = realloc(*bytes, capacity);
            if (more == NULL) {
                return false;
            }
            *bytes = more;
        }
        const size_t taken = fread(*bytes + *length, 1, READ_BYTES, file);
        const char *newline = memrchr(*bytes + *length, '\n', taken);
        line = newline != NULL ? (size_t)(newline + 1 - *bytes) : line;
        *length += taken;
        if (taken == 0) {
            return ferror(file) == 0;
        }
    }
}

static bool read_file(const char *path, char **bytes, size_t *length)
{
    FILE *file = strcmp(path, "-") == 0 ? stdin : fopen(path, "rb");
    if (file == NULL) {
        return false;
    }
    const bool is_read = read_whole(file, bytes, length);
    const int error = errno;
    if (file != stdin) {
        (void)fclose(file);
    }
    errno = error;
    return is_read;
}

static bool append(frames_t *self, const frames_line_t *line)
{
    if (self->count == self->capacity) {
        const size_t capacity = self->capacity * 2 + 256;
        frames_line_t *more = realloc(self->line, capacity * sizeof *more);
        if (more == NULL) {
            return false;
        }
        self->line = more;
        self->capacity = capacity;
    }
    self->line[self->count++] = *line;
    return true;
}

static int report(FILE *errors, const char *path, uint32_t line, const char *why)
{
    fprintf(errors, "%s:%u: %s\n", path, (unsigned)line, why);
    return 1;
}

/* A line whose time is before the one in front of it. */
static int report_order(FILE *errors, const char *path, const frames_line_t *line, const frames_line_t *before)
{
    fprintf(errors, "%s:%u: %llu.%03u ms is before the %llu.%03u ms of line %u; times must not decrease\n", path,
            (unsigned)line->line, (unsigned long long)(line->t_us / 1000), (unsigned)(line->t_us % 1000),
            (unsigned long long)(before->t_us / 1000), (unsigned)(before->t_us % 1000), (unsigned)before->line);
    return 1;
}

/* One line into the list.
 * Returns the number of errors, or -1 where memory ran out. */
static int parse_line(frames_t *self, char *text, size_t length, uint32_t number, const char *path, FILE *errors)
{
    frames_line_t line = {.line = number};
    bool is_empty = false;
    const char *why = NULL;
    if (!frames_parse_line(text, length, &line, &is_empty, &why)) {
        return report(errors, path, number, why);
    }
    if (is_empty) {
        return 0;
    }
    frames_line_t *before = &self->newest[line.kind == FRAMES_DATAGRAM];
    if (line.t_us < before->t_us) {
        return report_order(errors, path, &line, before);
    }
    *before = line;
    if (line.kind == FRAMES_STATE && self->count > 0) {
        return report(errors, path, number, "!state is not the first line; a run can only begin with one");
    }
    if (line.kind == FRAMES_FROM) {
        self->from = line.from;
        return 0;
    }
    line.from = self->from;
    return append(self, &line) ? 0 : -1;
}

int frames_load(frames_t *self, const char *path, FILE *errors)
{
    size_t length = 0;
    uint32_t number = 0;
    int bad = 0;
    *self = (frames_t){.from = {.address = {127, 0, 0, 1}, .port = 9}};
    if (!read_file(path, &self->bytes, &length)) {
        return -1;
    }
    if (encoding_is_utf16(self->bytes, length)) {
        return report(errors, path, 1, "the file is UTF-16; allowed: plain text (UTF-8)");
    }
    for (size_t at = encoding_mark(self->bytes, length); at < length;) {
        char *const start = &self->bytes[at];
        const char *const newline = memchr(start, '\n', length - at);
        const size_t line_length = newline != NULL ? (size_t)(newline - start) : length - at;
        const int result = parse_line(self, start, line_length, ++number, path, errors);
        if (result < 0) {
            return -1;
        }
        bad += result;
        at += line_length + 1;
    }
    return bad;
}

void frames_free(frames_t *self)
{
    free(self->line);
    free(self->bytes);
    *self = (frames_t){.line = NULL};
}

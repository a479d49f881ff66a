/* SPDX-License-Identifier: MIT
 * roff.c - text as a manual page has it; see roff.h.
 */
#include "common/roff.h"

#include <ctype.h>
#include <stdbool.h>
#include <string.h>

#include "common/columns.h"

#define LINE_WIDTH 72u

/** A line that is being written. */
typedef struct {
    FILE *out;
    size_t column;
    bool is_bold;
} roff_line_t;

static void put_char(roff_line_t *self, char character)
{
    if (character == '`') {
        self->is_bold = !self->is_bold;
        fputs(self->is_bold ? "\\fB" : "\\fR", self->out);
        self->column += 3;
        return;
    }
    if (self->column == 0 && (character == '.' || character == '\'')) {
        fputs("\\&", self->out); /* would be a macro */
    }
    if (character == '-' || character == '\\') {
        fputs(character == '-' ? "\\-" : "\\e", self->out);
    } else {
        fputc(character, self->out);
    }
    self->column++;
}

static void put_word(roff_line_t *self, const char *word, size_t length)
{
    const char *previous = NULL;
    if (self->column > 0) {
        const bool is_full = self->column + length >= LINE_WIDTH;
        fputc(is_full ? '\n' : ' ', self->out);
        self->column = is_full ? 0 : self->column + 1;
    }
    for (size_t i = 0; i < length;) {
        if (columns_may_break(previous, &word[i])) {
            fputs("\\:", self->out); /* troff breaks lines at blanks, which Chinese has not */
        }
        previous = &word[i];
        for (glyph_t glyph = columns_glyph(&word[i]); glyph.bytes > 0; glyph.bytes--) {
            put_char(self, word[i++]);
        }
    }
}

static void put_words(const char *text, size_t length, FILE *out)
{
    roff_line_t line = {.out = out};
    for (size_t at = 0; at < length;) {
        size_t end = at;
        while (end < length && isspace((unsigned char)text[end]) == 0) {
            end++;
        }
        if (end > at) {
            put_word(&line, &text[at], end - at);
        }
        at = end + 1;
    }
    fputc('\n', out);
}

/* A line as it is. */
static void put_line(const char *text, size_t length, FILE *out)
{
    roff_line_t line = {.out = out};
    for (size_t i = 0; i < length; i++) {
        put_char(&line, text[i]);
    }
    fputc('\n', out);
}

static void put_upper(const char *text, FILE *out)
{
    for (; *text != '\0'; text++) {
        const bool is_lower = *text >= 'a' && *text <= 'z';
        fputc(is_lower ? *text - 'a' + 'A' : *text, out);
    }
}

void roff_title(const char *name, const char *section, const char *date, const char *version, FILE *out)
{
    fputs(".\\\" SPDX-License-Identifier: MIT\n.\\\" Written by the build from the tables of its programs.\n.TH ", out);
    put_upper(name, out);
    fprintf(out, " %s %s \"Heave %s\"\n.nh\n.ad l\n", section, date, version);
}

void roff_heading(const char *title, FILE *out)
{
    fprintf(out, ".SH %s\n", title);
}

void roff_text(const char *text, FILE *out)
{
    put_words(text, strlen(text), out);
}

void roff_bold(const char *text, FILE *out)
{
    fputs("\\fB", out);
    for (; *text != '\0'; text++) {
        fputs(*text == '-' ? "\\-" : (const char[]){*text, '\0'}, out);
    }
    fputs("\\fR\n", out);
}

void roff_item(const char *text, FILE *out)
{
    fputs(".TP\n", out);
    roff_bold(text, out);
}

/* Lines that begin with a blank; returns what follows them. */
static const char *put_example(const char *text, bool is_first, FILE *out)
{
    fprintf(out, "%s.nf\n.RS 4\n", is_first ? "" : ".PP\n");
    while (*text == ' ') {
        const size_t length = strcspn(text, "\n");
        put_line(text + 1, length - 1, out);
        text += length + (text[length] == '\n' ? 1 : 0);
    }
    fputs(".RE\n.fi\n", out);
    return text;
}

void roff_paragraphs(const char *text, FILE *out)
{
    bool is_first = true;
    while (*text != '\0') {
        if (*text == ' ') {
            text = put_example(text, is_first, out);
        } else if (*text == '\n') {
            text++;
        } else {
            const char *end = strstr(text, "\n\n");
            const char *example = strstr(text, "\n ");
            end = example != NULL && (end == NULL || example < end) ? example : end;
            const size_t length = end != NULL ? (size_t)(end - text) : strlen(text);
            fputs(is_first ? "" : ".PP\n", out);
            put_words(text, length, out);
            text += length;
        }
        is_first = false;
    }
}

/* SPDX-License-Identifier: MIT
 * view_lines.c - a text drawn line by line; see view_lines.h.
 */
#include "heavectl/view_lines.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "common/columns.h"
#include "common/translate.h"

#define LABEL_COLUMNS  9
#define LINE_BYTES_MAX (LINE_COLUMNS_MAX * 4u)

const cJSON *view_member(const cJSON *object, const char *name)
{
    return cJSON_GetObjectItemCaseSensitive(object, name);
}

/* What would be shown as -0.000 is 0. */
double view_number(const cJSON *object, const char *name)
{
    const cJSON *item = view_member(object, name);
    const double value = cJSON_IsNumber(item) ? item->valuedouble : 0.0;
    return value < 0.0 && value > -0.0005 ? 0.0 : value;
}

const char *view_word(const cJSON *object, const char *name)
{
    const cJSON *item = view_member(object, name);
    return cJSON_IsString(item) ? item->valuestring : "?";
}

const char *view_text(const cJSON *object, const char *name)
{
    return translate(view_word(object, name));
}

/* --- Lines --- */

/* Adds a character, as far as the line is wide. */
static void put_glyph(view_t *self, const char *bytes, glyph_t glyph)
{
    if (self->columns + glyph.columns <= self->style->columns && self->at + glyph.bytes < sizeof self->line) {
        memcpy(&self->line[self->at], bytes, glyph.bytes);
        self->at += glyph.bytes;
        self->columns += glyph.columns;
    }
}

void view_put_column(view_t *self, const char *bytes)
{
    put_glyph(self, bytes, (glyph_t){strlen(bytes), 1});
}

static void put_clipped(view_t *self, const char *text)
{
    for (glyph_t glyph = columns_glyph(text); glyph.bytes > 0; glyph = columns_glyph(text)) {
        put_glyph(self, text, glyph);
        text += glyph.bytes;
    }
}

void view_put(view_t *self, const char *format, ...)
{
    char piece[LINE_BYTES_MAX];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(piece, sizeof piece, translate(format), arguments);
    va_end(arguments);
    put_clipped(self, piece);
}

void view_put_padded(view_t *self, const char *text, unsigned columns)
{
    const unsigned until = self->columns + columns;
    put_clipped(self, text);
    while (self->columns < until && self->columns < self->style->columns) {
        view_put_column(self, " ");
    }
}

void view_put_right(view_t *self, const char *text, unsigned columns)
{
    view_put(self, "%*s", columns_lacking(text, columns), "");
    put_clipped(self, text);
}

void view_put_label(view_t *self, const char *label)
{
    view_put_padded(self, label, LABEL_COLUMNS);
}

/* A colour takes no column. */
void view_put_colour(view_t *self, const char *sequence)
{
    const size_t length = strlen(sequence);
    if (self->style->is_coloured && self->at + length < sizeof self->line) {
        memcpy(&self->line[self->at], sequence, length);
        self->at += length;
    }
}

void view_end_line(view_t *self)
{
    if (self->rows < VIEW_LINES_MAX && self->length + self->at <= sizeof self->body) {
        self->lines[self->rows++] =
            (view_line_t){.start = self->length, .length = self->at, .entry = self->entry, .worth = self->worth};
        memcpy(&self->body[self->length], self->line, self->at);
        self->length += self->at;
    }
    self->at = 0;
    self->columns = 0;
}

/* --- The whole text --- */

void view_start(view_t *self, const ctl_view_style_t *style)
{
    self->style = style;
    self->length = 0;
    self->rows = 0;
    self->entry = 0;
    self->worth = VIEW_NEEDED;
    self->at = 0;
    self->columns = 0;
}

void view_entry(view_t *self, view_worth_t worth)
{
    self->entry++;
    self->worth = worth;
}

/* Leaves out the last one of the entries that are worth least. Returns false where only needed ones are left. */
static bool leave_out(view_t *self)
{
    view_worth_t least = VIEW_NEEDED;
    unsigned entry = 0;
    unsigned kept = 0;
    for (unsigned i = 0; i < self->rows; i++) {
        if (self->lines[i].worth >= least) {
            least = self->lines[i].worth;
            entry = self->lines[i].entry;
        }
    }
    for (unsigned i = 0; i < self->rows && least != VIEW_NEEDED; i++) {
        if (self->lines[i].entry != entry) {
            self->lines[kept++] = self->lines[i];
        }
    }
    self->rows = least != VIEW_NEEDED ? kept : self->rows;
    return least != VIEW_NEEDED;
}

static void fit(view_t *self)
{
    const unsigned all = self->rows;
    const unsigned high = self->style->rows;
    if (high == 0 || all <= high) {
        return;
    }
    while (self->rows >= high && leave_out(self)) {}
    self->rows = self->rows >= high ? high - 1u : self->rows;
    view_put(self, "%u lines more in a higher window, or with heavectl status", all - self->rows);
    view_end_line(self);
}

size_t view_end(view_t *self, char text[CTL_VIEW_BYTES])
{
    size_t length = 0;
    fit(self);
    for (unsigned i = 0; i < self->rows; i++) {
        const view_line_t *line = &self->lines[i];
        const bool is_last = i + 1u == self->style->rows; /* what ended it would scroll the first one away */
        const char *line_end = is_last ? "" : self->style->line_end;
        const size_t end = strlen(line_end);
        if (length + line->length + end + 1u > CTL_VIEW_BYTES) {
            break;
        }
        memcpy(&text[length], &self->body[line->start], line->length);
        memcpy(&text[length + line->length], line_end, end);
        length += line->length + end;
    }
    text[length] = '\0';
    return length;
}

/* --- Lines that go on in the next one --- */

/* Goes on in the next line, under what stands behind a label. */
static void wrap(view_t *self)
{
    view_end_line(self);
    view_put(self, "%*s", LABEL_COLUMNS, "");
}

/* Columns up to where a line may end next. */
static unsigned columns_of_word(const char *text)
{
    const char *previous = NULL;
    unsigned columns = 0;
    for (glyph_t glyph = columns_glyph(text); glyph.bytes > 0 && text[0] != ' ' && !columns_may_break(previous, text);
         glyph = columns_glyph(text)) {
        columns += glyph.columns;
        previous = text;
        text += glyph.bytes;
    }
    return columns;
}

void view_put_prose(view_t *self, const char *text)
{
    const char *previous = NULL;
    for (glyph_t glyph = columns_glyph(text); glyph.bytes > 0; glyph = columns_glyph(text)) {
        const bool is_start = text[0] != ' ' && (previous == NULL || previous[0] == ' ' || columns_may_break(previous, text));
        const unsigned word = is_start ? columns_of_word(text) : glyph.columns;
        const bool is_too_long = self->columns + word > self->style->columns && word + LABEL_COLUMNS <= self->style->columns;
        if (is_too_long || self->columns + glyph.columns > self->style->columns) {
            wrap(self);
        }
        put_glyph(self, text, glyph);
        previous = text;
        text += glyph.bytes;
    }
}

void view_put_words(view_t *self, const cJSON *object, const char *name)
{
    char own[32];
    (void)snprintf(own, sizeof own, "%s_%.2s", name, translate_language());
    view_put_prose(self, view_member(object, own) != NULL ? view_word(object, own) : view_text(object, name));
}

void view_put_piece(view_t *self, const char *format, ...)
{
    char piece[LINE_BYTES_MAX];
    const char *rest = piece;
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(piece, sizeof piece, translate(format), arguments);
    va_end(arguments);
    if (self->columns + columns_of(piece) > self->style->columns) {
        if (columns_is_closing(piece)) { /* the mark that joins it stays where it is */
            const glyph_t mark = columns_glyph(piece);
            put_glyph(self, piece, mark);
            rest += mark.bytes + strspn(&piece[mark.bytes], " ");
        }
        wrap(self);
    }
    view_put_prose(self, rest);
}

/* SPDX-License-Identifier: MIT
 * view_lines.h - a text drawn line by line, as wide and as high as its window; and what an answer holds.
 */
#ifndef HEAVE_HEAVECTL_VIEW_LINES_H
#define HEAVE_HEAVECTL_VIEW_LINES_H

#include "heavectl/view.h"

#define LINE_COLUMNS_MAX 512u
#define VIEW_BOLD        "\x1b[1m"
#define VIEW_RED         "\x1b[1;31m"
#define VIEW_GREEN       "\x1b[1;32m"
#define VIEW_YELLOW      "\x1b[1;33m"
#define VIEW_PLAIN       "\x1b[0m"

#define VIEW_LINES_MAX 256u

/** What an entry is worth where the window is too low for all: the others make room for it. */
typedef enum {
    VIEW_NEEDED, /**< state, fault, drives, bus, sender: what a person looks for first */
    VIEW_HELPS,  /**< what led there, and what to do */
    VIEW_ASKED,  /**< what was asked of the platform */
    VIEW_DETAIL, /**< of a drive */
    VIEW_EXTRA,
    VIEW_WORTHS
} view_worth_t;

/** A line of the text. */
typedef struct {
    size_t start;
    size_t length;
    unsigned entry; /**< lines of one entry are shown together or not at all */
    view_worth_t worth;
} view_line_t;

/** A text being drawn, line by line; private. */
typedef struct {
    const ctl_view_style_t *style;
    char body[CTL_VIEW_BYTES]; /* lines without their ends */
    size_t length;
    view_line_t lines[VIEW_LINES_MAX];
    unsigned rows;
    unsigned entry;
    view_worth_t worth;
    char line[LINE_COLUMNS_MAX * 4];
    size_t at;        /* bytes of the line */
    unsigned columns; /* of the line, used */
} view_t;

/** Begins a text. */
void view_start(view_t *self, const ctl_view_style_t *style);

/** Begins an entry: the lines up to the next one. */
void view_entry(view_t *self, view_worth_t worth);

/** Ends the text: what the window has no room for is left out, the least worth first and from below, and a last line says how
 *  many lines that are.
 *  @return length without NUL */
size_t view_end(view_t *self, char text[CTL_VIEW_BYTES]);

/** A member of an object; NULL where it lacks it. */
const cJSON *view_member(const cJSON *object, const char *name);

/** A member that is a number, else 0. What would be shown as -0.000 is 0. */
double view_number(const cJSON *object, const char *name);

/** A member that is a text, else "?". */
const char *view_word(const cJSON *object, const char *name);

/** The same, translated. */
const char *view_text(const cJSON *object, const char *name);

/** Adds a character of one column, as far as the line is wide. */
void view_put_column(view_t *self, const char *bytes);

/** A colour takes no column. */
void view_put_colour(view_t *self, const char *sequence);

/** Adds words and blanks up to so many columns. */
void view_put_padded(view_t *self, const char *text, unsigned columns);

/** Adds blanks and words, so many columns together. */
void view_put_right(view_t *self, const char *text, unsigned columns);

/** Adds what a line begins with. */
void view_put_label(view_t *self, const char *label);

/** Adds what belongs together, its format translated, in the next line where this one does not hold it. */
__attribute__((format(printf, 2, 3))) void view_put_piece(view_t *self, const char *format, ...);

/** Adds words; what a line does not hold goes on in the next one, below what stands behind the label. */
void view_put_prose(view_t *self, const char *text);

/** Adds a member's words in the language of the view. */
void view_put_words(view_t *self, const cJSON *object, const char *name);

/** Adds text, its format translated, as far as the line is wide. */
__attribute__((format(printf, 2, 3))) void view_put(view_t *self, const char *format, ...);

/** Ends the line. */
void view_end_line(view_t *self);

#endif

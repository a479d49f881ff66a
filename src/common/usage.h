/* SPDX-License-Identifier: MIT
 * usage.h - what a program takes and says of itself: one table from which the command line is read, --help printed and the manual
 * page written.
 */
#ifndef HEAVE_COMMON_USAGE_H
#define HEAVE_COMMON_USAGE_H

#include <getopt.h>
#include <stdbool.h>
#include <stdio.h>

#define USAGE_OPTIONS_MAX 32u

/** An option, a command, or a way to call the program. */
typedef struct {
    const char *name;     /**< without dashes; of a way to call: NULL */
    const char *argument; /**< what follows the name; NULL where nothing does */
    const char *help;     /**< one line; NULL where there is nothing to say */
    int value;            /**< of an option: what getopt_long() gives */
} usage_row_t;

/** An exit code and what it means. */
typedef struct {
    int code;
    const char *meaning;
} usage_exit_t;

/** A section of the manual page that --help does not have. Paragraphs end in an empty line; lines that begin with a blank are
 * printed as they are. */
typedef struct {
    const char *title;
    const char *text;
} usage_section_t;

/** A program. Lists end with a row that is all zero. */
typedef struct {
    const char *program;
    const char *manual_section;
    const char *summary;
    const char *common;          /**< options of every form, as in `heavectl [--json] ...`; NULL where there are none */
    const usage_row_t *forms;    /**< argument and help */
    const usage_row_t *commands; /**< NULL where there are none */
    const usage_row_t *options;  /**< at most USAGE_OPTIONS_MAX */
    const char *notes;           /**< said at the end; NULL: nothing */
    const usage_exit_t *exits;
    const usage_section_t *manual; /**< of the page */
    const char *see_also;
} usage_t;

extern const usage_t heaved_usage;
extern const usage_t heavectl_usage;

/** True for the row that ends a list. */
bool usage_is_end(const usage_row_t *row);

/** Prints --help. */
void usage_print(const usage_t *self, FILE *out);

/** The options for getopt_long(). */
void usage_options(const usage_t *self, struct option out[USAGE_OPTIONS_MAX + 1]);

#endif

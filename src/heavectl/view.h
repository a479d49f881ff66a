/* SPDX-License-Identifier: MIT
 * view.h - the status of a platform as text for people: a table, or one line.
 */
#ifndef HEAVE_HEAVECTL_VIEW_H
#define HEAVE_HEAVECTL_VIEW_H

#include <cJSON.h>
#include <stdbool.h>
#include <stddef.h>

#define CTL_VIEW_BYTES 16384u

/** How to draw; in what language, translate.h knows. */
typedef struct {
    unsigned columns;     /**< lines are cut there */
    unsigned rows;        /**< so many lines are drawn, the last one without its end; 0 = all */
    bool is_utf8;         /**< blocks for bars, else ASCII */
    bool is_coloured;     /**< the state and a fault in colours of a terminal */
    const char *line_end; /**< "\n", or what clears the rest of the line as well */
} ctl_view_style_t;

/** Draws the table of a status.
 *  @return length without NUL */
size_t ctl_view_table(const cJSON *status, const ctl_view_style_t *style, char text[CTL_VIEW_BYTES]);

/** One line without its end: state, pose, cylinders, relays, counts. */
size_t ctl_view_line(const cJSON *status, char text[CTL_VIEW_BYTES]);

#endif

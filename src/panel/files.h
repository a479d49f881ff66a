/* SPDX-License-Identifier: MIT
 * files.h - what a platform has written: the files of its incidents, its operator log. Only names of the black box's own form,
 * and only its own files, in the folder that heaved has handed over; never along a link.
 */
#ifndef HEAVE_PANEL_FILES_H
#define HEAVE_PANEL_FILES_H

#include <stdbool.h>
#include <stddef.h>

#include "panel/upstream.h"

/** A file to read from. */
typedef struct {
    int fd; /**< -1: none */
    size_t length;
} opened_t;

/** Opens a file of an incident. @return fd -1: there is none, or why */
opened_t files_open_incident(const upstream_t *upstream, const char *name, const char *file, char *why, size_t size);

/** The newest lines of the operator log, the oldest first, the last of its older files with them.
 *  @return NULL, and why; else text to be freed */
char *files_read_log(const upstream_t *upstream, size_t *length, char *why, size_t size);

#endif

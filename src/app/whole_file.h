/* SPDX-License-Identifier: MIT
 * whole_file.h - a file that is there as a whole or not at all: written beside its place and renamed when all of it is on the
 * disk. What is not a file (a pipe, a terminal, /dev/null; "-" is standard output) is written as it comes.
 */
#ifndef HEAVE_APP_WHOLE_FILE_H
#define HEAVE_APP_WHOLE_FILE_H

#include <limits.h>
#include <stdbool.h>
#include <stdio.h>

/** A file in the making. */
typedef struct {
    FILE *stream;        /**< to write to */
    char path[PATH_MAX]; /**< of the result, links followed */
    char part[PATH_MAX]; /**< of what is written until then; empty: the result itself */
} whole_file_t;

/** Opens a file for writing; an old one of that name stays until the end.
 *  @return false: errno says why */
bool whole_file_open(whole_file_t *self, const char *path);

/** Ends it: all of it is there, or nothing has changed.
 *  @return false: errno says why */
bool whole_file_close(whole_file_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * atomic_file.h - a file that is there as a whole or not at all: written beside its place and renamed when all of it is on the
 * disk. What is not a file (a pipe, a terminal, /dev/null; "-" is standard output) is written as it comes.
 */
#ifndef HEAVE_COMMON_ATOMIC_FILE_H
#define HEAVE_COMMON_ATOMIC_FILE_H

#include <limits.h>
#include <stdbool.h>
#include <stdio.h>

/** A file in the making. */
typedef struct {
    FILE *stream;        /**< to write to */
    char path[PATH_MAX]; /**< of the result, links followed */
    char part[PATH_MAX]; /**< of what is written until then; empty: the result itself */
} atomic_file_t;

/** Opens a file for writing; an old one of that name stays until the end.
 *  @return false: errno says why */
bool atomic_file_open(atomic_file_t *self, const char *path);

/** Ends it: all of it is there, or nothing has changed.
 *  @return false: errno says why */
bool atomic_file_close(atomic_file_t *self);

#endif

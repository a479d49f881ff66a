/* SPDX-License-Identifier: MIT
 * atomic_file.h - a file that exists completely or not at all. It is written under another name in the same folder, and renamed
 * when all of it is on the disk. A path that is not a regular file (a pipe, a terminal, /dev/null; "-": standard output) is
 * written directly.
 */
#ifndef HEAVE_COMMON_ATOMIC_FILE_H
#define HEAVE_COMMON_ATOMIC_FILE_H

#include <limits.h>
#include <stdbool.h>
#include <stdio.h>

/** A file that is being written. */
typedef struct {
    FILE *stream;        /**< the caller writes here */
    char path[PATH_MAX]; /**< of the finished file, with symbolic links resolved */
    char part[PATH_MAX]; /**< of the file while it is written; empty: `path` is written directly */
} atomic_file_t;

/** Opens a file for writing. An old file of this name stays until atomic_file_close().
 *  @return false: errno says why */
bool atomic_file_open(atomic_file_t *self, const char *path);

/** Closes the file. Afterwards the new file is complete, or the old one is unchanged.
 *  @return false: errno says why */
bool atomic_file_close(atomic_file_t *self);

#endif

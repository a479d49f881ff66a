/* SPDX-License-Identifier: MIT
 * state_file.h - a small file of a program's own, which the power may not tear: written beside its place, then renamed, so that
 * the old one is there until the new one is whole. Blocks until the disk has it; allocates nothing.
 */
#ifndef HEAVE_COMMON_STATE_FILE_H
#define HEAVE_COMMON_STATE_FILE_H

#include <stddef.h>

/** Longest path, with its end. */
#define STATE_FILE_PATH_MAX 300u

/** @param text   out: what is in the file, with a NUL behind it; of a longer one so much as fits
 *  @param length out: without the NUL; 0 after an error
 *  @return 0; or an errno, of a file that is not there ENOENT */
int state_file_read(const char *path, char *text, size_t size, size_t *length);

/** @return 0; or an errno, and the old file is unchanged */
int state_file_write(const char *path, const char *text, size_t length);

#endif

/* SPDX-License-Identifier: MIT
 * state_path.h - where a program keeps what outlives it.
 */
#ifndef HEAVE_COMMON_STATE_PATH_H
#define HEAVE_COMMON_STATE_PATH_H

#include <stdbool.h>
#include <stddef.h>

/** What is configured; else a file in the directory that a service manager gives (STATE_DIRECTORY, the first of a list); else "".
 *  @param path       out; its capacity in bytes
 *  @param configured "none": nothing is
 *  @param name       of the file, with the `/` before it; "": the directory itself
 *  @return false: the path is longer than that, and cut */
bool state_path(char *path, size_t capacity, const char *configured, const char *name);

#endif

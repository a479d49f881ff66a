/* SPDX-License-Identifier: MIT
 * presets.h - platforms that come with the programs: configuration files in a folder of the system, by name.
 */
#ifndef HEAVE_COMMON_PRESETS_H
#define HEAVE_COMMON_PRESETS_H

#include <stdbool.h>
#include <stdio.h>

/** The folder; the environment's HEAVE_PRESETS says another one. */
const char *presets_directory(void);

/** The file of a preset.
 *  @param name without folder and ending
 *  @param path out: its path
 *  @return false where the name is none, or the path is too long; whether the file is there is the reader's to see */
bool presets_path(const char *name, char *path, size_t size);

/** Writes the names, one a line, with what the first line of each file says of it.
 *  @return their number, or -1: errno says why there is no such folder */
int presets_list(FILE *out);

#endif

/* SPDX-License-Identifier: MIT
 * presets.h - ready-made platforms that are installed with the programs: configuration files in one folder, found by name.
 */
#ifndef HEAVE_COMMON_PRESETS_H
#define HEAVE_COMMON_PRESETS_H

#include <stdbool.h>
#include <stdio.h>

/** The folder: HEAVE_PRESETS of the environment, else share/heave/presets beside the folder of the program, else where it is
 * installed. One thread at a time. */
const char *presets_directory(void);

/** Makes the path of a preset's file.
 *  @param name without folder and ending
 *  @param path out: its path
 *  @return false: the name is not valid, or the path is too long. Does not check whether the file exists */
bool presets_path(const char *name, char *path, size_t size);

/** Writes one line per preset: its name, and the description in the first line of its file.
 *  @return number of presets; -1: the folder cannot be read, errno says why */
int presets_list(FILE *out);

#endif

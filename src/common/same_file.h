/* SPDX-License-Identifier: MIT
 * same_file.h - whether two paths lead to one file, through links of both sorts, also where it is not there yet. At the start;
 * opens nothing.
 */
#ifndef HEAVE_COMMON_SAME_FILE_H
#define HEAVE_COMMON_SAME_FILE_H

#include <stdbool.h>

/** A path that is written to; "-" is standard output.
 *  @param other is read from, or written to as well
 *  @return false for what holds nothing: devices, and pipes that are read */
bool same_file(const char *output, const char *other, bool is_other_output);

#endif

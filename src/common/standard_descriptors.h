/* SPDX-License-Identifier: MIT
 * standard_descriptors.h - the descriptors 0, 1 and 2, which whoever starts a program may have left closed: the next files that
 * it opens would get their numbers, and log lines would end in a trace. First of all, by the one thread there is.
 */
#ifndef HEAVE_COMMON_STANDARD_DESCRIPTORS_H
#define HEAVE_COMMON_STANDARD_DESCRIPTORS_H

#include <stdbool.h>

/** Puts the null device where one is closed. What is read from it, or written to standard output, fails there as it would have.
 *  @return false: that cannot be done, errno says why; nothing else may be opened */
bool standard_descriptors_open(void);

#endif

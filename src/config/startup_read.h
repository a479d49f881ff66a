/* SPDX-License-Identifier: MIT
 * startup_read.h - start-up lists of CANopen drives from a file, with an error for each line that cannot be.
 */
#ifndef HEAVE_CONFIG_STARTUP_READ_H
#define HEAVE_CONFIG_STARTUP_READ_H

#include "config/source.h"

/** Reads a line of the section that the reader is in, cut in two at its first = or :. */
void config_startup_parse(config_source_t *self, const char *before, const char *behind);

/** Which lists of a file differ from those of a platform that runs, which keeps its own.
 *  @param report says it; NULL: nothing is said
 *  @return how many do */
unsigned config_startup_compare(const config_source_t *self, const config_t *running, FILE *report);

#endif

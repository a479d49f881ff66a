/* SPDX-License-Identifier: MIT
 * report.h - what --check says of a configuration: what follows from it, and what looks wrong.
 */
#ifndef HEAVE_INSPECT_REPORT_H
#define HEAVE_INSPECT_REPORT_H

#include <stdio.h>

#include "config/config.h"

/** Writes what follows from a loaded configuration: reach of each axis, extensions at pose zero and at neutral, worst cylinder
 *  speed, cycle, memory; then warnings.
 *  @param ram_bytes of the gateway, as the program has it
 *  @return the number of warnings */
int report_write(const config_t *config, size_t ram_bytes, FILE *out);

#endif

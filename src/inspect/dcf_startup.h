/* SPDX-License-Identifier: MIT
 * dcf_startup.h - what a drive was set to by its maker's program (DCF, CiA 306), as start-up lists.
 */
#ifndef HEAVE_INSPECT_DCF_STARTUP_H
#define HEAVE_INSPECT_DCF_STARTUP_H

#include <stdio.h>

#include "common/eds.h"

/** Writes lists, with a comment for each setting that is left out.
 *  @param files    of one drive; or of the drives 1, 2, ... in their order: what is alike in all of them goes into
 *                  [cia402-startup], the rest into [cia402-startup-1], ...
 *  @param names    of the files, for `errors`
 *  @param section  where the settings of a single file go; NULL where there are several
 *  @param errors   gets a line for each file of which something is left out that the drive may need
 *  @return how many such settings there are: they depend on the node, no list may write them, or none can hold them. Settings
 * that are at their default, can only be read, or are heaved's own do not count */
unsigned dcf_write_startup(const eds_t *files, const char *const *names, unsigned count, const char *section, FILE *out,
                           FILE *errors);

#endif

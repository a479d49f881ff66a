/* SPDX-License-Identifier: MIT
 * configuration.h - `heavectl config`: the configuration in force, or another one in its place.
 */
#ifndef HEAVE_HEAVECTL_CONFIGURATION_H
#define HEAVE_HEAVECTL_CONFIGURATION_H

#include "heavectl/ctl.h"

/** Without an argument prints the text in force; else applies that file ("-": standard input), as heaved judges it.
 *  @return exit code; what is wrong was said */
int configuration_run(ctl_t *self);

#endif

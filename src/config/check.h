/* SPDX-License-Identifier: MIT
 * check.h - what the values of a file mean together: the checks of all sections, one after the other.
 */
#ifndef HEAVE_CONFIG_CHECK_H
#define HEAVE_CONFIG_CHECK_H

#include "config/source.h"

/** Checks; reports into self. Fills in what follows from the values (relay count). */
void config_check(config_source_t *self);

#endif

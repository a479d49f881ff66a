/* SPDX-License-Identifier: MIT
 * check.h - what the values of a file mean together: the checks of all sections, one after the other.
 */
#ifndef HEAVE_PLATFORM_CHECK_H
#define HEAVE_PLATFORM_CHECK_H

#include "config/source.h"

/** Checks; reports into self. Fills in what follows from the values (relay count). */
void config_check(config_source_t *self);

/** Rejects items of start-up lists that heaved sets itself for this configuration, or that nobody may set. */
void config_startup_check(config_source_t *self);

/** Reads and checks a configuration, whole or with errors. Allocates nothing. */
void config_source_load(config_source_t *self, const config_text_source_t *from, config_t *config, FILE *errors);

#endif

/* SPDX-License-Identifier: MIT
 * configure.h - values of the configuration in the making, for steps that need them.
 */
#ifndef HEAVE_SETUP_CONFIGURE_H
#define HEAVE_SETUP_CONFIGURE_H

#include "setup/setup.h"

/** Of a cylinder, from 1: as answered, or as the file has it. */
double configure_retracted(const setup_t *self, unsigned cylinder);
double configure_stroke(const setup_t *self, unsigned cylinder);

/** How many relays, and whether a switch is connected. */
unsigned configure_relays(const setup_t *self);
bool configure_has_switch(const setup_t *self, const char *key);

#endif

/* SPDX-License-Identifier: MIT
 * distances.h - the distances that a person has measured, from the answers.
 */
#ifndef HEAVE_SETUP_DISTANCES_H
#define HEAVE_SETUP_DISTANCES_H

#include "setup/setup.h"

/** "1-2", of a pair of lengths.h. */
void distances_name(unsigned pair, char name[8]);

/** The distances of "base" or "plate". @return false: not all are there */
bool distances_get(const setup_t *self, const char *set, double distance_mm[15]);

#endif

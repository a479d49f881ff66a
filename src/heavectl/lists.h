/* SPDX-License-Identifier: MIT
 * lists.h - answers of heaved that are lists, as lines on standard output.
 */
#ifndef HEAVE_HEAVECTL_LISTS_H
#define HEAVE_HEAVECTL_LISTS_H

#include <cjson/cJSON.h>

/** One line for each incident. */
void lists_show_incidents(const cJSON *incidents);

/** One line for each drive of the answer to `counts`. */
void lists_show_counts(const cJSON *answer);

#endif

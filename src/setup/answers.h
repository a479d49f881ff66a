/* SPDX-License-Identifier: MIT
 * answers.h - looking up, taking and dropping answers, for the steps.
 */
#ifndef HEAVE_SETUP_ANSWERS_H
#define HEAVE_SETUP_ANSWERS_H

#include "setup/setup.h"

/** "legs.moved", 3: "legs.moved.3". */
const char *answers_get_nth(const setup_t *self, const char *key, unsigned index);

/** 0 where there is none. */
double answers_number(const setup_t *self, const char *key, unsigned index);

bool answers_is(const setup_t *self, const char *key, const char *text);

/** Adds, or replaces where there is one. @return false: no room */
bool answers_set(setup_t *self, const char *key, const char *text);

/** Drops all whose key begins so. */
void answers_drop(setup_t *self, const char *beginning);

/** What the report is to say: what was found and mended. */
void answers_note(setup_t *self, const char *text);

/** A list of numbers, separated by commas. @return how many */
unsigned answers_list(const char *text, double *number, unsigned most);

#endif

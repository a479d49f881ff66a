/* SPDX-License-Identifier: MIT
 * status_word.h - the status of a drive, made from the conditions by which a map reads it.
 */
#ifndef HEAVE_TWIN_STATUS_WORD_H
#define HEAVE_TWIN_STATUS_WORD_H

#include "heave/canraw.h"

/** Conditions of a map; one with a mask of 0 does not exist. */
typedef struct {
    canraw_when_t done, failed, enabled, fault;
} status_conditions_t;

/** Those that shall hold, by bit. */
enum { STATUS_DONE = 1, STATUS_FAILED = 2, STATUS_ENABLED = 4, STATUS_FAULT = 8 };

/** A status for which those hold that shall, and the others do not, as far as there is one. */
uint32_t status_word(const status_conditions_t *conditions, unsigned wanted);

/** Whether there is such a status for each state that a drive can have. */
bool status_word_is_distinct(const status_conditions_t *conditions);

#endif

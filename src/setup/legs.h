/* SPDX-License-Identifier: MIT
 * legs.h - which drive moves which cylinder, which way and how far, from what a person saw when each drive was moved alone. Pure.
 */
#ifndef HEAVE_SETUP_LEGS_H
#define HEAVE_SETUP_LEGS_H

#include <stdbool.h>
#include <stddef.h>

#define LEGS_MAX      6u
#define LEGS_TEXT_MAX 1024u

/** What was seen when a drive was moved out. */
typedef struct {
    unsigned leg;       /**< the cylinder that moved, from 1; 0: none */
    bool is_shorter;    /**< it went in */
    double asked_mm;    /**< above 0: how far it was sent, as the configuration has it */
    double measured_mm; /**< at least 0: how far it went */
} legs_seen_t;

/** Why nothing follows. */
typedef enum {
    LEGS_FOUND,
    LEGS_NO_SUCH, /**< a number that no cylinder has */
    LEGS_NONE_MOVED,
    LEGS_TWICE,    /**< two drives are said to move one cylinder */
    LEGS_TOO_ROUGH /**< the way is neither the asked one nor a simple multiple or part of it that only one ratio explains */
} legs_status_t;

/** What follows; by cylinder, from 0. */
typedef struct {
    unsigned drive[LEGS_MAX]; /**< that moves it, from 0 */
    bool is_reversed[LEGS_MAX];
    unsigned times[LEGS_MAX], parts[LEGS_MAX]; /**< it moves times / parts of the asked way */
    bool is_as_given;                          /**< nothing is to be changed */
} legs_found_t;

/** @param seen  by drive
 *  @param count 1 to LEGS_MAX
 *  @param out   written where LEGS_FOUND is returned
 *  @param text  what is wrong, a line for each mistake, each ended by a line feed; "" where nothing is */
legs_status_t legs_identify(const legs_seen_t *seen, unsigned count, legs_found_t *out, char text[LEGS_TEXT_MAX]);

#endif

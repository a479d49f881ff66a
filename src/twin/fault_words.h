/* SPDX-License-Identifier: MIT
 * fault_words.h - the words of a fault's line: drives, objects, numbers. Where one is wrong, why says what would be right.
 */
#ifndef HEAVE_TWIN_FAULT_WORDS_H
#define HEAVE_TWIN_FAULT_WORDS_H

#include "twin/twin_faults.h"

#define FAULT_WORD_MAX 32u

/** The next word of a line, which at moves behind. False where there is none, or it is too long. */
bool fault_next_word(const char **at, char word[FAULT_WORD_MAX]);

/** `3`, `2,5` or `all`, by bit. */
bool fault_read_drives(const char *word, unsigned drives, uint32_t *out, char why[FAULT_WHY_MAX]);

/** `6065` or `1016:1`, of an object that these drives have. */
bool fault_read_object(const char *word, uint32_t *out, char why[FAULT_WHY_MAX]);

/** A name of quirks.h; its bit. */
bool fault_read_quirk(const char *word, double *out, char why[FAULT_WHY_MAX]);

/** From 0 to most, decimal or as 0x10. */
bool fault_read_number(const char *word, double most, double *out, char why[FAULT_WHY_MAX]);

#endif

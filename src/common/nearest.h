/* SPDX-License-Identifier: MIT
 * nearest.h - what somebody has meant who mistyped a word.
 */
#ifndef HEAVE_COMMON_NEAREST_H
#define HEAVE_COMMON_NEAREST_H

#include <stdbool.h>

/** Slips between two words: letters left out, typed too many, mistyped, or two neighbours exchanged (the optimal string alignment
 *  distance of Damerau and Levenshtein). ASCII; words of more than 31 letters are no slip of each other.
 *  @return their number; at most 31 */
unsigned nearest_slips(const char *one, const char *other);

/** Whether so many slips leave it likely that a word was meant: at most a third of its letters, and at most two. */
bool nearest_is_likely(unsigned slips, const char *word);

#endif

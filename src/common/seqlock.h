/* SPDX-License-Identifier: MIT
 * seqlock.h - hand-over of the newest value of a struct: the writer never waits, a reader gets a whole value or tries again.
 * One writer, any number of readers. The value is words of 64 bits in memory given at the start.
 */
#ifndef HEAVE_COMMON_SEQLOCK_H
#define HEAVE_COMMON_SEQLOCK_H

#include "heave/status.h"

/** A hand-over; members are private to seqlock.c. */
typedef struct {
    uint64_t *word;
    size_t words;
    uint32_t sequence; /**< odd while the writer is at work; 0 before the first value */
} seqlock_t;

/** @param word kept; holds the value */
void seqlock_init(seqlock_t *self, uint64_t *word, size_t words);

/** Makes value the newest. */
void seqlock_write(seqlock_t *self, const uint64_t *value);

/** Copies the newest value.
 *  @return false: there is none yet, or the writer kept coming in between (out is then undefined) */
bool seqlock_read(const seqlock_t *self, uint64_t *out);

#endif

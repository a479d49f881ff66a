/* SPDX-License-Identifier: MIT
 * mutate.h - what the custom mutators share. Only in builds with libFuzzer.
 */
#ifndef MUTATE_H
#define MUTATE_H

#include <stddef.h>
#include <stdint.h>

/** libFuzzer's own mutation, and what it calls in its place. */
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max_size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed);

/** A source of numbers that follow from the seed alone. */
typedef struct {
    uint64_t state;
} mutate_t;

mutate_t mutate_start(unsigned seed);

/** [0, limit), limit > 0. */
size_t mutate_below(mutate_t *self, size_t limit);

/** Puts bytes in at a place, or leaves data as it is where there is no room.
 *  @return the new size */
size_t mutate_insert(uint8_t *data, size_t size, size_t max_size, size_t at, const uint8_t *bytes, size_t count);

/** Takes bytes out, as many as there are.
 *  @return the new size */
size_t mutate_remove(uint8_t *data, size_t size, size_t at, size_t count);

#endif

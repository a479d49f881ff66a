/* SPDX-License-Identifier: MIT
 * ring.h - hand-over of records from one thread to another: bounded, lock-free, in order, in memory given at the start.
 * One thread pushes, one pops. Neither ever waits; a record that does not fit is dropped whole and counted.
 */
#ifndef HEAVE_COMMON_RING_H
#define HEAVE_COMMON_RING_H

#include "heave/status.h"

/** A ring; members are private to ring.c. The counts wrap; each has its own cache line, so that the threads do not slow each
 * other. */
typedef struct {
    uint8_t *bytes;
    uint32_t size;
    uint32_t written __attribute__((aligned(64))); /**< bytes pushed so far; only the pushing thread stores it */
    uint32_t dropped;                              /**< likewise */
    uint32_t taken __attribute__((aligned(64)));   /**< bytes popped so far; only the popping thread stores it */
} ring_t;

/** Starts empty.
 *  @param memory kept
 *  @param size   bytes at memory, a power of two, at most 2^30 */
void ring_init(ring_t *self, void *memory, uint32_t size);

/** Hands over a record made of two pieces (the second may be empty). Never blocks.
 *  @return false: no room, dropped and counted */
bool ring_push(ring_t *self, const void *head, size_t head_length, const void *tail, size_t tail_length);

/** Takes the oldest record. Never blocks.
 *  @param capacity at least the longest record pushed
 *  @return its length; 0: none waits */
size_t ring_pop(ring_t *self, void *to, size_t capacity);

/** True where no record waits. The popping thread. */
bool ring_is_empty(const ring_t *self);

/** Records dropped so far. Any thread. */
uint32_t ring_dropped(const ring_t *self);

#endif

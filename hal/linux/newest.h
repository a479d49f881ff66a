/* SPDX-License-Identifier: MIT
 * newest.h - hand-over of the newest value from one thread to another, by three buffers: neither side ever waits, a value that
 * was not taken is replaced, and one that is being read is never written to. Only the numbers of the buffers live here; the
 * values are the caller's, three of each. One thread puts, one takes.
 */
#ifndef LINUX_NEWEST_H
#define LINUX_NEWEST_H

#include <stdbool.h>
#include <stdint.h>

/** Buffers of a value. */
#define NEWEST_BUFFERS 3u

/** Whose buffer is which; private. */
typedef struct {
    uint8_t back;   /**< the putting thread's: filled next */
    uint8_t front;  /**< the taking thread's: read until the next take */
    uint8_t middle; /**< on the way from one to the other, with NEWEST_FRESH */
} newest_t;

#define NEWEST_FRESH 4u /* the middle buffer has not been taken yet */

/** Starts empty. */
static inline newest_t newest_start(void)
{
    return (newest_t){.back = 0, .front = 1, .middle = 2};
}

/** Buffer to fill before newest_put(). */
static inline unsigned newest_back(const newest_t *self)
{
    return self->back;
}

/** Hands over what the back buffer holds.
 *  @return true: it replaced a value that nobody took */
static inline bool newest_put(newest_t *self)
{
    const unsigned old = __atomic_exchange_n(&self->middle, (uint8_t)(self->back | NEWEST_FRESH), __ATOMIC_ACQ_REL);
    self->back = (uint8_t)(old & ~NEWEST_FRESH);
    return (old & NEWEST_FRESH) != 0;
}

/** Takes the newest value, once.
 *  @return false: there is nothing new; true: it is in newest_front() until the next take */
static inline bool newest_pop(newest_t *self)
{
    if ((__atomic_load_n(&self->middle, __ATOMIC_RELAXED) & NEWEST_FRESH) == 0) {
        return false;
    }
    self->front = (uint8_t)(__atomic_exchange_n(&self->middle, self->front, __ATOMIC_ACQ_REL) & ~NEWEST_FRESH);
    return true;
}

/** Buffer that the last take brought. */
static inline unsigned newest_front(const newest_t *self)
{
    return self->front;
}

#endif

/* SPDX-License-Identifier: MIT
 * clock.h - contract of the monotonic clock: read it, sleep to a deadline.
 * Only the program's main loop (and worker loops beside it) reads a clock; everything else takes time as an argument.
 * Every op may be called from any thread.
 */
#ifndef HEAVE_HAL_CLOCK_H
#define HEAVE_HAL_CLOCK_H

#include "heave/status.h"

/** Every op is mandatory. */
typedef struct {
    uint64_t (*now_us)(void *ctx);
    hv_status_t (*sleep_until_us)(void *ctx, uint64_t deadline_us);
} hal_clock_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const hal_clock_ops_t *ops;
    void *ctx;
} hal_clock_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool hal_clock_valid(hal_clock_t clock)
{
    return clock.ops != NULL && clock.ops->now_us != NULL && clock.ops->sleep_until_us != NULL;
}

/** Time since some fixed moment, in us; never decreases, never wraps, not touched by changes of the wall clock. <= 5 us.
 *  Cannot fail. */
static inline uint64_t hal_clock_now_us(hal_clock_t clock)
{
    return clock.ops->now_us(clock.ctx);
}

/** Blocks until the deadline, never shorter; returns at once if it has passed. The scheduler may make it later. Signals do not
 * end it.
 *  @return HV_OK: hal_clock_now_us() is at least deadline_us; HV_ERR_IO: the system refuses to sleep, the caller must stop.
 *          */
static inline HV_MUST_CHECK hv_status_t hal_clock_sleep_until_us(hal_clock_t clock, uint64_t deadline_us)
{
    return clock.ops->sleep_until_us(clock.ctx, deadline_us);
}

#endif

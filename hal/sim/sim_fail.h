/* SPDX-License-Identifier: MIT
 * sim_fail.h - the simplest fault plan: the n-th call of an op fails, and the ones after it for a while.
 * For simulated backends whose only failure is "the call did not work". Plain data, no clock.
 */
#ifndef SIM_FAIL_H
#define SIM_FAIL_H

#include "heave/status.h"

/** Calls are numbered from 1. */
typedef struct {
    uint32_t first; /**< number of the first call that fails; 0 = none */
    uint32_t count; /**< how many calls fail from there on */
    uint32_t calls; /**< out: calls made so far */
} sim_fail_t;

/** Counts a call and tells whether it fails. */
static inline bool sim_fail_now(sim_fail_t *self)
{
    self->calls++;
    return self->first != 0 && self->calls >= self->first && self->calls - self->first < self->count;
}

#endif

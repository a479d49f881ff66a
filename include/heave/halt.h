/* SPDX-License-Identifier: MIT
 * halt.h - the quickest stop of several axes together: one trapezoid of acceleration for all of them, in whole cycles.
 * Every axis changes its acceleration to its own plateau, holds it and takes it back in the same cycles as the others, so that
 * the body keeps its direction while it slows down. Integer only; no clock.
 */
#ifndef HEAVE_HALT_H
#define HEAVE_HALT_H

#include "heave/axes.h"
#include "heave/ramp.h"

/** Cycles of change, hold and take-back of the acceleration. */
typedef struct {
    int64_t change, hold, back;
} halt_times_t;

/** A stop of up to AXES_MAX axes. */
typedef struct {
    unsigned axes;
    int64_t cycles; /**< of the slowest axis */
    int64_t elapsed;
    halt_times_t times[AXES_MAX]; /**< an axis apart, or near a limit, takes its own */
    ramp_state_t start[AXES_MAX];
    ramp_state_t now[AXES_MAX];
    q32_t rest_q32[AXES_MAX]; /**< where it ends */
} halt_t;

/** Plans the quickest stop within acceleration and jerk limits.
 *  @param start may be self->start
 *  @param together so many axes, from the first on, take the same cycles, except one that this would carry out of its bounds or
 *                  beyond its speed; that one and the axes behind take their own */
void halt_plan(halt_t *self, unsigned axes, unsigned together, const ramp_state_t *start, const ramp_limits_t *const *limits);

/** Where such a stop of axes that all go together would end, without planning it. */
void halt_rests(unsigned axes, const ramp_state_t *start, const ramp_limits_t *const *limits, q32_t *rest_q32);

/** References of the next cycle. Past the end: at rest. */
void halt_step(halt_t *self, ramp_ref_t *ref);

static inline bool halt_is_done(const halt_t *self)
{
    return self->elapsed >= self->cycles;
}

#endif

/* SPDX-License-Identifier: MIT
 * sync_stop.h - plans the quickest stop of several axes together, with one trapezoidal acceleration profile in whole cycles.
 * All axes change, hold and remove their acceleration in the same cycles, each with its own plateau. So the platform keeps its
 * direction while it slows down. Integer only; no clock.
 */
#ifndef HEAVE_SYNC_STOP_H
#define HEAVE_SYNC_STOP_H

#include "heave/axes.h"
#include "heave/ramp.h"

/** Cycles in which the acceleration changes, is held, and is removed. */
typedef struct {
    int64_t change, hold, back;
} sync_stop_times_t;

/** A stop of up to AXES_MAX axes. */
typedef struct {
    unsigned axes;
    int64_t cycles; /**< of the slowest axis */
    int64_t elapsed;
    sync_stop_times_t times[AXES_MAX]; /**< equal, except for an axis near a limit or planned separately */
    ramp_state_t start[AXES_MAX];
    ramp_state_t now[AXES_MAX];
    q32_t rest_q32[AXES_MAX]; /**< end position */
} sync_stop_t;

/** Cylinders that move with pose axes and have limits of their own. */
typedef struct {
    unsigned count;
    const ramp_state_t *state[CYLINDERS_MAX];
    const ramp_limits_t *limits[CYLINDERS_MAX];
} sync_stop_riders_t;

/** Plans the quickest stop within acceleration and jerk limits.
 *  @param start may be self->start
 *  @param together number of axes, from the first on, that stop in the same cycles. An axis that would leave its bounds or
 * exceed its speed, and the axes after `together`, get their own times
 *  @param riders   their acceleration and jerk limits are kept too, as far as they move in proportion to the axes; NULL: none
 */
void sync_stop_plan(sync_stop_t *self, unsigned axes, unsigned together, const ramp_state_t *start,
                    const ramp_limits_t *const *limits, const sync_stop_riders_t *riders);

/** End positions of such a stop of all axes together, without planning it. */
void sync_stop_rests(unsigned axes, const ramp_state_t *start, const ramp_limits_t *const *limits, q32_t *rest_q32);

/** Velocity of an axis in a cycle of the stop, by the same profile as sync_stop_step(), without rounding errors of sums.
 *  @param cycle at least 1; past the end: 0 */
q32_t sync_stop_velocity(const sync_stop_t *self, unsigned axis, int64_t cycle);

/** References of the next cycle. Past the end: at rest. */
void sync_stop_step(sync_stop_t *self, ramp_ref_t *ref);

static inline bool sync_stop_is_done(const sync_stop_t *self)
{
    return self->elapsed >= self->cycles;
}

#endif

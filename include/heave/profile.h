/* SPDX-License-Identifier: MIT
 * profile.h - planned moves: quintic polynomials (timed moves) and S-curves in whole cycles (moves from rest).
 * All axes of a move share one duration, so they start and end together. Integer only; no clock.
 */
#ifndef HEAVE_PROFILE_H
#define HEAVE_PROFILE_H

#include "heave/axes.h"
#include "heave/ramp.h"

/** The last reference. Used to calculate the backward differences of the next one. */
typedef ramp_state_t history_t;

/** The reference for the next position; the history then ends in it. */
static inline ramp_ref_t history_advance(history_t *self, q32_t pos_q32)
{
    const q32_t vel_q32 = pos_q32 - self->pos_q32;
    const q32_t acc_q32 = vel_q32 - self->vel_per_cycle_q32;
    const ramp_ref_t ref = {pos_q32, vel_q32, acc_q32, acc_q32 - self->acc_per_cycle2_q32};
    *self = (history_t){pos_q32, vel_q32, acc_q32};
    return ref;
}

/** One fifth-order polynomial per axis over a common number of cycles. */
typedef struct {
    unsigned axes;
    int64_t cycles;
    int64_t elapsed;
    q32_t start_q32[AXES_MAX];
    q32_t target_q32[AXES_MAX];
    q32_t coefficient_q32[AXES_MAX][5]; /**< of t, t^2 ... t^5, t from 0 to 1 */
    history_t history[AXES_MAX];
} quintic_t;

/** Plans from states in motion to rest on targets.
 *  @param cycles at least 1
 *  @return HV_OK; HV_ERR_RANGE where the polynomial does not fit its number format (far too long for a start in motion). */
hv_status_t quintic_plan(quintic_t *self, unsigned axes, const ramp_state_t *start, const q32_t *target_q32,
                         int64_t cycles) HV_MUST_CHECK;

/** True if every axis stays within its limits (checked at 33 points with 1/64 to spare). */
bool quintic_is_feasible(const quintic_t *self, const ramp_limits_t *const *limits);

/** Position of an axis at t, 0 to 1. */
q32_t quintic_position(const quintic_t *self, unsigned axis, q62_t t_q62);

/** References of the next cycle. Past the end: at rest on the targets. */
void quintic_step(quintic_t *self, ramp_ref_t *ref);

static inline bool quintic_is_done(const quintic_t *self)
{
    return self->elapsed >= self->cycles;
}

/** A jerk-limited move of a path from 0 to 1 in whole cycles: jerk +, 0, -, 0, -, 0, + for nj, na, nj, nv, nj, na, nj cycles. */
typedef struct {
    int64_t nj, na, nv;
    int64_t elapsed;
    int64_t acc, vel, pos; /**< running sums of the jerk pattern: exact */
    int64_t total;         /**< pos at the end */
} scurve_t;

/** Limits of a path: speed, acceleration, jerk in paths per cycle^k, Q62. */
typedef struct {
    int64_t vel_q62, acc_q62, jerk_q62;
} path_limits_t;

/** No limit at all: start of a minimum over axes. */
path_limits_t path_limits_none(void);

/** Narrows path limits so that an axis that travels distance keeps its own, with 1/64 to spare for its ramp. */
void path_limits_narrow(path_limits_t *self, q32_t distance_q32, const ramp_limits_t *limits);

/** Plans the shortest move within the limits that takes at least so many cycles. */
void scurve_plan(scurve_t *self, const path_limits_t *limits, int64_t least_cycles);

/** Advances one cycle. */
void scurve_step(scurve_t *self);

/** Goes to the end of the path. */
void scurve_end(scurve_t *self);

/** The present position of the path between two values. */
q32_t scurve_between(const scurve_t *self, q32_t from_q32, q32_t to_q32);

static inline int64_t scurve_cycles(const scurve_t *self)
{
    return 4 * self->nj + 2 * self->na + self->nv;
}

static inline bool scurve_is_done(const scurve_t *self)
{
    return self->elapsed >= scurve_cycles(self);
}

#endif

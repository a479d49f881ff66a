/* SPDX-License-Identifier: MIT
 * path.h - a planned path of several axes at once: a stop, a straight line along an S-curve, a stop with a straight line that
 * goes on from it, or a quintic. Whoever plans it fills it in (src/motion/plan.h, jog.h, motion.c); it is stepped here. Integer
 * only; no clock. Sources of the formulas: profile.h, sync_stop.h.
 */
#ifndef HEAVE_PATH_H
#define HEAVE_PATH_H

#include "heave/axes.h"
#include "heave/profile.h"
#include "heave/sync_stop.h"

typedef enum {
    PATH_STOP,              /**< stop */
    PATH_STRAIGHT,          /**< way.straight; at its end: at rest there */
    PATH_STOP_AND_STRAIGHT, /**< stop, and way.straight from where it ends, which may begin before that */
    PATH_QUINTIC            /**< way.quintic; at its end: at rest there */
} path_kind_t;

/** A straight line along an S-curve. */
typedef struct {
    scurve_t curve;
    q32_t from_q32[AXES_MAX];
    q32_t to_q32[AXES_MAX];
    history_t history[AXES_MAX]; /**< last references */
} straight_t;

/** A planned path; members are private to src/motion. */
typedef struct {
    path_kind_t kind;
    unsigned axes;          /**< number of axes that follow it, from the first on */
    sync_stop_t stop;       /**< kept while a straight line that comes after it is planned */
    int64_t straight_after; /**< PATH_STOP_AND_STRAIGHT: cycles of the stop before the straight line begins */
    union {
        straight_t straight;
        quintic_t quintic;
    } way;
} path_t;

/** References of the next cycle, of the axes that follow the path. */
void path_step(path_t *self, ramp_ref_t ref[AXES_MAX]);

/** True when the references have come to rest at the end. Not of a quintic. */
bool path_is_done(const path_t *self);

/** Where the axes rest at the end. Not of a stop, which has stop.rest_q32. */
const q32_t *path_end(const path_t *self);

/** True while a straight line moves at one speed. */
bool path_is_cruising(const path_t *self);

#endif

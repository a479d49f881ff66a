/* SPDX-License-Identifier: MIT
 * stop.c - the stop before every change of source, and what comes after it; motion.c carries that out.
 */
#include "heave/motion.h"

#include "jog.h"

/* All cylinders and the rotation motor slow down together over the same time. */
static void plan_stop(motion_t *self)
{
    path_t *path = &self->plan.path;
    const ramp_limits_t *limits[AXES_MAX];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_t *ramp = jog_limiter(&self->jog, &self->platform, i);
        path->stop.start[i] = ramp->state;
        limits[i] = &ramp->limits;
    }
    sync_stop_plan(&path->stop, AXES_MAX, CYLINDERS_MAX, path->stop.start, limits, NULL);
    path->kind = PATH_STOP;
    path->axes = AXES_MAX;
    self->source = MOTION_STOPPING;
    self->targets.angle_deg_q32 = path->stop.rest_q32[AXIS_ANGLE];
}

/* Slows all cylinders and the rotation motor down, unless they do already. */
static void begin_stop(motion_t *self, motion_next_t next)
{
    self->next = next;
    self->followed.phase = next == MOTION_THEN_FOLLOW ? FOLLOW_AWAITED : FOLLOW_NOBODY;
    self->has_pending = false;
    self->timed.end_us = 0;
    self->timed.is_stretched = false;
    if (self->source != MOTION_STOPPING) {
        plan_stop(self);
    }
}

void motion_stop(motion_t *self)
{
    begin_stop(self, MOTION_THEN_REST);
}

void motion_settle(motion_t *self)
{
    begin_stop(self, MOTION_THEN_SETTLE);
}

void motion_rise(motion_t *self)
{
    begin_stop(self, MOTION_THEN_RISE);
}

void motion_follow(motion_t *self)
{
    begin_stop(self, MOTION_THEN_FOLLOW);
    self->fade_in.is_return = false;
}

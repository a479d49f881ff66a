/* SPDX-License-Identifier: MIT
 * stop.c - the stop before every change of purpose; see stop.h.
 */
#include "stop.h"

#include "heave/sync_stop.h"
#include "jog_limits.h"

bool motion_is_at_rest(const motion_t *self)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        if (!ramp_is_at_rest(&self->cylinder[i])) {
            return false;
        }
    }
    return ramp_is_at_rest(&self->axis[AXIS_ANGLE]);
}

/* All cylinders and the rotation motor slow down together over the same time. */
static void plan_stop(motion_t *self)
{
    sync_stop_t *halt = &self->halt;
    const ramp_limits_t *limits[AXES_MAX];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_t *ramp = jog_limiter(self, i);
        halt->start[i] = ramp->state;
        limits[i] = &ramp->limits;
    }
    sync_stop_plan(halt, AXES_MAX, CYLINDERS_MAX, halt->start, limits, NULL);
    self->source = MOTION_STOPPING;
    self->angle_target_deg_q32 = halt->rest_q32[AXIS_ANGLE];
}

void stop_begin(motion_t *self, motion_next_t next)
{
    self->next = next;
    self->is_taking_over = false;
    self->is_fading = false;
    self->has_pending = false;
    self->timed_end_us = 0;
    self->is_stretched = false;
    if (self->source != MOTION_STOPPING) {
        plan_stop(self);
    }
}

void motion_stop(motion_t *self)
{
    self->is_following = false;
    stop_begin(self, MOTION_THEN_REST);
}

void motion_follow(motion_t *self)
{
    self->is_following = true;
    stop_begin(self, MOTION_THEN_FOLLOW);
    self->is_taking_over = true;
    self->is_fading = false;
    self->is_return = false;
}

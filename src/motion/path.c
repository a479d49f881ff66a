/* SPDX-License-Identifier: MIT
 * path.c - the cycles of a planned path; see heave/path.h.
 */
#include "heave/path.h"

static void step_straight(path_t *self, ramp_ref_t ref[AXES_MAX])
{
    straight_t *line = &self->way.straight;
    const bool was_done = scurve_is_done(&line->curve);
    scurve_step(&line->curve);
    for (unsigned i = 0; i < self->axes; i++) {
        const ramp_ref_t rest = {.pos_q32 = line->to_q32[i]};
        const q32_t pos_q32 = scurve_between(&line->curve, line->from_q32[i], line->to_q32[i]);
        ref[i] = was_done ? rest : history_advance(&line->history[i], pos_q32);
    }
}

/* A stop, and the straight line that begins during it. */
static void step_stop_and_straight(path_t *self, ramp_ref_t ref[AXES_MAX])
{
    straight_t *line = &self->way.straight;
    const bool was_done = path_is_done(self);
    HV_ASSERT(self->stop.axes == self->axes);
    sync_stop_step(&self->stop, ref);
    if (self->stop.elapsed > self->straight_after) {
        scurve_step(&line->curve);
    }
    for (unsigned i = 0; i < self->axes; i++) {
        const ramp_ref_t rest = {.pos_q32 = line->to_q32[i]};
        const q32_t gone_q32 = scurve_between(&line->curve, line->from_q32[i], line->to_q32[i]) - line->from_q32[i];
        ref[i] = was_done ? rest : history_advance(&line->history[i], ref[i].pos_q32 + gone_q32);
    }
}

void path_step(path_t *self, ramp_ref_t ref[AXES_MAX])
{
    HV_ASSERT(self->axes >= 1 && self->axes <= AXES_MAX);
    switch (self->kind) {
    case PATH_STOP:
        sync_stop_step(&self->stop, ref);
        break;
    case PATH_STRAIGHT:
        step_straight(self, ref);
        break;
    case PATH_STOP_AND_STRAIGHT:
        step_stop_and_straight(self, ref);
        break;
    case PATH_QUINTIC:
        quintic_step(&self->way.quintic, ref);
        break;
    }
}

bool path_is_done(const path_t *self)
{
    return (self->kind == PATH_STRAIGHT || sync_stop_is_done(&self->stop)) &&
           (self->kind == PATH_STOP || scurve_is_done(&self->way.straight.curve));
}

const q32_t *path_end(const path_t *self)
{
    return self->kind == PATH_QUINTIC ? self->way.quintic.target_q32 : self->way.straight.to_q32;
}

bool path_is_cruising(const path_t *self)
{
    const scurve_t *curve = &self->way.straight.curve;
    return self->kind == PATH_STRAIGHT && curve->acc == 0 && curve->vel != 0;
}

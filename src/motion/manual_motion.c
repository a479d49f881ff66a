/* SPDX-License-Identifier: MIT
 * manual_motion.c - manual operation of the platform: jogs and test signals as a source of motion; see heave/jog.h.
 */
#include "jog.h"

void motion_serve(motion_t *self)
{
    self->jog.is_serving = true;
    self->jog.is_posed = false;
    self->jog.moved = 0;
}

void motion_place_axis(motion_t *self, unsigned axis, q32_t position_q32)
{
    platform_t *platform = &self->platform;
    const ramp_state_t at = {.pos_q32 = position_q32};
    platform->is_pose_stale = platform->is_pose_stale || platform_limiter(platform, axis)->state.pos_q32 != position_q32;
    self->jog.moved &= ~(1u << axis);
    self->plan.path.way.straight.to_q32[axis] = position_q32;
    if (axis == AXIS_ANGLE) {
        platform->axis[AXIS_ANGLE].state = at;
        self->targets.angle_deg_q32 = position_q32;
    } else {
        platform->cylinder[axis].state = at;
        platform->reference[axis] = at;
    }
}

static bool is_ready(const motion_t *self)
{
    return self->jog.is_serving && self->source == MOTION_RESTING && motion_is_at_rest(self);
}

static hv_status_t begin(motion_t *self, hv_status_t status)
{
    self->source = status == HV_OK ? MOTION_JOGGED : self->source;
    return status;
}

hv_status_t motion_jog_axis(motion_t *self, unsigned axis, q16_t speed_q16, q16_t way_q16)
{
    straight_t *line = &self->plan.path.way.straight;
    return is_ready(self) ? begin(self, jog_begin_axis(&self->jog, &self->platform, line, axis, speed_q16, way_q16))
                          : HV_ERR_STATE;
}

hv_status_t motion_jog_pose(motion_t *self, unsigned axis, q16_t speed_q16, q16_t way_q16)
{
    straight_t *line = &self->plan.path.way.straight;
    return is_ready(self) ? begin(self, jog_begin_pose(&self->jog, &self->platform, line, axis, speed_q16, way_q16))
                          : HV_ERR_STATE;
}

hv_status_t motion_excite_axis(motion_t *self, unsigned axis, const excitation_request_t *request)
{
    straight_t *line = &self->plan.path.way.straight;
    return is_ready(self) ? begin(self, jog_excite_axis(&self->jog, &self->platform, line, axis, request)) : HV_ERR_STATE;
}

hv_status_t motion_excite_pose(motion_t *self, unsigned axis, const excitation_request_t *request)
{
    straight_t *line = &self->plan.path.way.straight;
    return is_ready(self) ? begin(self, jog_excite_pose(&self->jog, &self->platform, line, axis, request)) : HV_ERR_STATE;
}

/* SPDX-License-Identifier: MIT
 * jog_signal.c - test signals on a motion led by hand; see heave/jog.h.
 * A signal is a share of its amplitude in each cycle. What the whole width asks of the cylinders, or of the axis, is looked at
 * before: the shares keep to that. A limiter with the limits of a ride, but slower, has the last word.
 */
#include "jog.h"
#include "path_check.h"

/* The limits of a ride, but not as fast, and as wide as to where the axis is. */
static hv_status_t shape_axis(motion_t *self, unsigned axis)
{
    const ramp_t *own = jog_own_ramp(self, axis);
    ramp_limits_t limits = own->limits;
    const q32_t here_q32 = own->state.pos_q32;
    const q32_t most_q32 = axis == AXIS_ANGLE ? self->jog_limits.deg_per_cycle_q32 : self->jog_limits.signal_mm_per_cycle_q32;
    limits.vel_per_cycle_q32 = most_q32 < limits.vel_per_cycle_q32 ? most_q32 : limits.vel_per_cycle_q32;
    limits.pos_min_q32 = here_q32 < limits.pos_min_q32 ? here_q32 : limits.pos_min_q32;
    limits.pos_max_q32 = here_q32 > limits.pos_max_q32 ? here_q32 : limits.pos_max_q32;
    return ramp_init(&self->jog.ramp[axis], &limits, here_q32);
}

static bool is_too_wide(const motion_t *self, q32_t amplitude_q32, bool is_rotation)
{
    return amplitude_q32 > (is_rotation ? self->jog_limits.signal_deg_q32 : self->jog_limits.signal_mm_q32);
}

static hv_status_t begin(motion_t *self, uint32_t led, bool is_posed, const excitation_request_t *request,
                         const path_limits_t *limits)
{
    const hv_status_t status = excitation_init(&self->jog.signal, request, limits, self->cycle_us);
    if (status == HV_OK) {
        jog_begin(self, led, is_posed, limits);
        self->jog.is_excited = true;
    }
    return status;
}

hv_status_t motion_excite_axis(motion_t *self, unsigned axis, const excitation_request_t *request)
{
    motion_straight_t *way = &self->plan.straight;
    const ramp_t *own = jog_own_ramp(self, axis);
    const q32_t amplitude_q32 = q32_from_q16(request->amplitude_q16);
    const q32_t here_q32 = own->state.pos_q32;
    path_limits_t limits = path_limits_none();
    if (!jog_is_ready(self)) {
        return HV_ERR_STATE;
    }
    if (is_too_wide(self, amplitude_q32, axis == AXIS_ANGLE)) {
        return HV_ERR_FORMAT;
    }
    if (fx_add_sat(here_q32, amplitude_q32) > own->limits.pos_max_q32 ||
        fx_sub_sat(here_q32, amplitude_q32) < own->limits.pos_min_q32 || shape_axis(self, axis) != HV_OK) {
        return HV_ERR_RANGE;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        way->from_q32[i] = jog_own_ramp(self, i < CYLINDERS_MAX ? i : AXIS_ANGLE)->state.pos_q32;
        way->to_q32[i] = way->from_q32[i];
    }
    way->to_q32[axis] += amplitude_q32;
    path_limits_narrow(&limits, amplitude_q32, &self->jog.ramp[axis].limits);
    return begin(self, 1u << axis, false, request, &limits);
}

/* Limits of a whole way, for half of it. */
static path_limits_t of_half(const path_limits_t *whole)
{
    const int64_t most_q62 = Q62_ONE / 2;
    return (path_limits_t){2 * fx_clamp(whole->vel_q62, 0, most_q62), 2 * fx_clamp(whole->acc_q62, 0, most_q62),
                           2 * fx_clamp(whole->jerk_q62, 0, most_q62)};
}

/* Whether the platform reaches both ends, where it is led by the limits of a signal then, and what these allow on the way. */
static bool look_at_width(motion_t *self, unsigned axis, const q32_t from_q32[POSE_AXES], q32_t amplitude_q32,
                          path_limits_t *limits)
{
    pose_t end[2];
    for (unsigned side = 0; side < 2; side++) {
        for (unsigned i = 0; i < POSE_AXES; i++) {
            end[side].axis_q32[i] = from_q32[i];
        }
        end[side].axis_q32[axis] += side == 0 ? -amplitude_q32 : amplitude_q32;
        kin_constrain(&self->kin, &end[side]);
        if (!jog_is_reached(self, &end[side])) {
            return false;
        }
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        if (shape_axis(self, i) != HV_OK) {
            return false;
        }
    }
    *limits = path_limits_none();
    self->jog.led = (1u << self->cylinders) - 1u; /* their limits are those of the way */
    path_limits_narrow(limits, 2 * amplitude_q32, &self->axis[axis].limits);
    path_check_narrow(self, end[0].axis_q32, end[1].axis_q32, limits);
    *limits = of_half(limits);
    return true;
}

hv_status_t motion_excite_pose(motion_t *self, unsigned axis, const excitation_request_t *request)
{
    motion_straight_t *way = &self->plan.straight;
    const ramp_limits_t *own = &self->axis[axis].limits;
    const q32_t amplitude_q32 = q32_from_q16(request->amplitude_q16);
    path_limits_t limits;
    q32_t from_q32[POSE_AXES];
    if (!jog_is_ready(self)) {
        return HV_ERR_STATE;
    }
    if (!self->is_axis_moved[axis]) {
        return HV_ERR_NOSUP;
    }
    if (!jog_find_here(self, from_q32)) {
        return HV_ERR_ARG;
    }
    if (is_too_wide(self, amplitude_q32, axis < AXIS_X)) {
        return HV_ERR_FORMAT;
    }
    if (fx_add_sat(from_q32[axis], amplitude_q32) > own->pos_max_q32 ||
        fx_sub_sat(from_q32[axis], amplitude_q32) < own->pos_min_q32 ||
        !look_at_width(self, axis, from_q32, amplitude_q32, &limits)) {
        self->jog.led = 0;
        return HV_ERR_RANGE;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        way->from_q32[i] = from_q32[i];
        way->to_q32[i] = from_q32[i];
    }
    way->to_q32[axis] += amplitude_q32;
    way->from_q32[AXIS_ANGLE] = way->to_q32[AXIS_ANGLE] = self->axis[AXIS_ANGLE].state.pos_q32;
    const hv_status_t status = begin(self, self->jog.led, true, request, &limits);
    self->jog.led = status == HV_OK ? self->jog.led : 0;
    return status;
}

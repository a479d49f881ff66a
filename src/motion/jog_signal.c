/* SPDX-License-Identifier: MIT
 * jog_signal.c - test signals in manual motion; see heave/jog.h.
 * A signal is a share of its amplitude in each cycle. What the whole width asks of the cylinders, or of the axis, is looked at
 * before: the shares keep to that. A limiter with the limits of a ride, but slower, comes last.
 */
#include "jog.h"
#include "path_check.h"

/* The limits of a ride, but not as fast, and as wide as to where the axis is. */
static hv_status_t shape_axis(jog_t *self, const platform_t *platform, unsigned axis)
{
    const ramp_t *own = platform_limiter(platform, axis);
    ramp_limits_t limits = own->limits;
    const q32_t here_q32 = own->state.pos_q32;
    const q32_t most_q32 = axis == AXIS_ANGLE ? self->limits.deg_per_cycle_q32 : self->limits.signal_mm_per_cycle_q32;
    limits.vel_per_cycle_q32 = most_q32 < limits.vel_per_cycle_q32 ? most_q32 : limits.vel_per_cycle_q32;
    limits.pos_min_q32 = here_q32 < limits.pos_min_q32 ? here_q32 : limits.pos_min_q32;
    limits.pos_max_q32 = here_q32 > limits.pos_max_q32 ? here_q32 : limits.pos_max_q32;
    return ramp_init(&self->ramp[axis], &limits, here_q32);
}

static bool is_too_wide(const jog_t *self, q32_t amplitude_q32, bool is_rotation)
{
    return amplitude_q32 > (is_rotation ? self->limits.signal_deg_q32 : self->limits.signal_mm_q32);
}

/* A line whose ends are set, made by the signal. */
static void begin(jog_t *self, const platform_t *platform, straight_t *line, uint32_t moved, bool is_posed,
                  const path_limits_t *limits)
{
    jog_plan(self, platform, line, moved, is_posed, limits);
    self->is_excited = true;
}

hv_status_t jog_excite_axis(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis,
                            const excitation_request_t *request)
{
    const ramp_t *own = platform_limiter(platform, axis);
    const q32_t amplitude_q32 = q32_from_q16(request->amplitude_q16);
    const q32_t here_q32 = own->state.pos_q32;
    path_limits_t limits = path_limits_none();
    if (is_too_wide(self, amplitude_q32, axis == AXIS_ANGLE)) {
        return HV_ERR_FORMAT;
    }
    if (fx_add_sat(here_q32, amplitude_q32) > own->limits.pos_max_q32 ||
        fx_sub_sat(here_q32, amplitude_q32) < own->limits.pos_min_q32 || shape_axis(self, platform, axis) != HV_OK) {
        return HV_ERR_RANGE;
    }
    path_limits_narrow(&limits, amplitude_q32, &self->ramp[axis].limits);
    const hv_status_t status = excitation_init(&self->signal, request, &limits, platform->cycle_us);
    for (unsigned i = 0; i < AXES_MAX && status == HV_OK; i++) {
        line->from_q32[i] = platform_limiter(platform, i < CYLINDERS_MAX ? i : AXIS_ANGLE)->state.pos_q32;
        line->to_q32[i] = line->from_q32[i] + (i == axis ? amplitude_q32 : 0);
    }
    if (status == HV_OK) {
        begin(self, platform, line, 1u << axis, false, &limits);
    }
    return status;
}

/* Limits of a whole way, for half of it. */
static path_limits_t of_half(const path_limits_t *whole)
{
    const int64_t most_q62 = Q62_ONE / 2;
    return (path_limits_t){2 * fx_clamp(whole->vel_q62, 0, most_q62), 2 * fx_clamp(whole->acc_q62, 0, most_q62),
                           2 * fx_clamp(whole->jerk_q62, 0, most_q62)};
}

/* Whether the platform reaches both ends, and what the limits of a signal allow on the way. */
static bool look_at_width(jog_t *self, const platform_t *platform, unsigned axis, const pose_t *here, q32_t amplitude_q32,
                          path_limits_t *limits)
{
    pose_t end[2];
    for (unsigned side = 0; side < 2; side++) {
        end[side] = *here;
        end[side].axis_q32[axis] += side == 0 ? -amplitude_q32 : amplitude_q32;
        kin_constrain(&platform->kin, &end[side]);
        if (!jog_is_reached(platform, &end[side])) {
            return false;
        }
    }
    for (unsigned i = 0; i < platform->cylinders; i++) {
        if (shape_axis(self, platform, i) != HV_OK) {
            return false;
        }
    }
    *limits = path_limits_none();
    path_limits_narrow(limits, 2 * amplitude_q32, &platform->axis[axis].limits);
    path_check_narrow(platform, self->ramp, end[0].axis_q32, end[1].axis_q32, limits);
    *limits = of_half(limits);
    return true;
}

hv_status_t jog_excite_pose(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis,
                            const excitation_request_t *request)
{
    const ramp_limits_t *own = &platform->axis[axis].limits;
    const q32_t amplitude_q32 = q32_from_q16(request->amplitude_q16);
    path_limits_t limits;
    pose_t here;
    if (!platform->is_axis_moved[axis]) {
        return HV_ERR_NOSUP;
    }
    if (!platform_find_pose(platform, &here)) {
        return HV_ERR_ARG;
    }
    if (is_too_wide(self, amplitude_q32, axis < AXIS_X)) {
        return HV_ERR_FORMAT;
    }
    if (fx_add_sat(here.axis_q32[axis], amplitude_q32) > own->pos_max_q32 ||
        fx_sub_sat(here.axis_q32[axis], amplitude_q32) < own->pos_min_q32 ||
        !look_at_width(self, platform, axis, &here, amplitude_q32, &limits)) {
        return HV_ERR_RANGE;
    }
    const hv_status_t status = excitation_init(&self->signal, request, &limits, platform->cycle_us);
    for (unsigned i = 0; i < POSE_AXES && status == HV_OK; i++) {
        line->from_q32[i] = here.axis_q32[i];
        line->to_q32[i] = here.axis_q32[i] + (i == axis ? amplitude_q32 : 0);
    }
    if (status == HV_OK) {
        line->from_q32[AXIS_ANGLE] = line->to_q32[AXIS_ANGLE] = platform->axis[AXIS_ANGLE].state.pos_q32;
        begin(self, platform, line, (1u << platform->cylinders) - 1u, true, &limits);
    }
    return status;
}

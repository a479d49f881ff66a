/* SPDX-License-Identifier: MIT
 * platform.c - see platform.h.
 */
#include "platform.h"

#include "workspace.h"

/* Extensions of a pose, inside the stroke with its margins. */
static bool reaches(const platform_t *self, const pose_t *pose, q32_t extension_mm_q32[CYLINDERS_MAX])
{
    pose_t kept = *pose;
    return workspace_pull_in(self, &kept, extension_mm_q32, NULL) == 0;
}

static hv_status_t init_cylinders(platform_t *self, const settings_t *s)
{
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const unsigned source = i < self->cylinders ? i : 0;
        ramp_limits_t limits;
        hv_status_t status =
            ramp_limits_from_units(s->margin_mm_q16, s->stroke_mm_q16[source] - s->margin_mm_q16, s->cylinder_speed_mm_s_q16,
                                   s->cylinder_accel_mm_s2_q16, s->cylinder_jerk_mm_s3, s->cycle_us, &limits);
        self->settled_mm_q32[i] = q32_from_q16(s->settled_extension_mm_q16);
        status = status == HV_OK ? ramp_init(&self->cylinder[i], &limits, self->settled_mm_q32[i]) : status;
        if (status != HV_OK) {
            return status;
        }
    }
    return ramp_limits_from_units(0, s->stroke_mm_q16[0], s->engage_speed_mm_s_q16, s->engage_accel_mm_s2_q16,
                                  s->cylinder_jerk_mm_s3, s->cycle_us, &self->engage_limits);
}

/* What an axis has that the platform does not move: nothing limits it, and nothing is ever asked of it. */
static const axis_settings_t k_absent_axis = {
    .min_q16 = -INT16_MAX * Q16_ONE, .max_q16 = INT16_MAX * Q16_ONE, .speed_q16 = Q16_ONE, .accel_q16 = Q16_ONE, .jerk = 1000000};

static bool is_axis_moved(const platform_t *self, const settings_t *s, unsigned axis)
{
    if (axis == AXIS_ANGLE) {
        return s->has_angle;
    }
    return self->cylinders == CYLINDERS_MAX || axis == AXIS_ROLL || axis == AXIS_PITCH || axis == AXIS_Z;
}

static hv_status_t init_axes(platform_t *self, const settings_t *s)
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->is_axis_moved[i] = is_axis_moved(self, s, i);
        const axis_settings_t *a = self->is_axis_moved[i] ? &s->axis[i] : &k_absent_axis;
        ramp_limits_t limits;
        hv_status_t status =
            ramp_limits_from_units(a->min_q16, a->max_q16, a->speed_q16, a->accel_q16, a->jerk, s->cycle_us, &limits);
        const q32_t start_q32 = i < POSE_AXES ? q32_from_q16(s->neutral_q16[i]) : 0;
        status = status == HV_OK ? ramp_init(&self->axis[i], &limits, start_q32) : status;
        if (status != HV_OK) {
            return status;
        }
    }
    return HV_OK;
}

void platform_note_known_pose(platform_t *self, const q32_t *extension_mm_q32)
{
    bool is_settled = true;
    bool is_neutral = true;
    for (unsigned i = 0; i < self->cylinders; i++) {
        is_settled &= extension_mm_q32[i] == self->settled_mm_q32[i];
        is_neutral &= extension_mm_q32[i] == self->neutral_mm_q32[i];
    }
    if (is_settled || is_neutral) {
        self->pose = is_settled ? self->settled_pose : self->neutral;
        self->is_pose_stale = false;
    }
}

hv_status_t platform_init(platform_t *self, const settings_t *settings)
{
    self->cycle_us = settings->cycle_us;
    hv_status_t status = kin_init(&self->kin, &settings->geometry);
    self->cylinders = status == HV_OK ? kin_cylinders(&self->kin) : 0;
    status = status == HV_OK ? init_cylinders(self, settings) : status;
    status = status == HV_OK ? init_axes(self, settings) : status;
    if (status != HV_OK) {
        return status;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->neutral.axis_q32[i] = q32_from_q16(settings->neutral_q16[i]);
    }
    kin_constrain(&self->kin, &self->neutral);
    if (!reaches(self, &self->neutral, self->neutral_mm_q32)) {
        return HV_ERR_RANGE;
    }
    platform_place(self, self->settled_mm_q32, 0);
    status = kin_forward(&self->kin, self->settled_mm_q32, &self->neutral, &self->settled_pose, NULL);
    platform_note_known_pose(self, self->settled_mm_q32);
    return status;
}

void platform_place(platform_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], q32_t angle_deg_q32)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        self->cylinder[i].state = (ramp_state_t){.pos_q32 = extension_mm_q32[i]};
        self->reference[i] = self->cylinder[i].state;
    }
    self->axis[AXIS_ANGLE].state = (ramp_state_t){.pos_q32 = angle_deg_q32};
    self->is_pose_stale = true;
    platform_note_known_pose(self, extension_mm_q32);
}

bool platform_are_cylinders_moving(const platform_t *self)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        if (self->cylinder[i].state.vel_per_cycle_q32 != 0) {
            return true;
        }
    }
    return false;
}

bool platform_is_at_rest(const platform_t *self)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        if (!ramp_is_at_rest(&self->cylinder[i])) {
            return false;
        }
    }
    return ramp_is_at_rest(&self->axis[AXIS_ANGLE]);
}

HV_OWN_FRAME bool platform_find_pose(const platform_t *self, pose_t *pose)
{
    q32_t extension_mm_q32[CYLINDERS_MAX];
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        extension_mm_q32[i] = self->cylinder[i].state.pos_q32;
    }
    return kin_forward(&self->kin, extension_mm_q32, &self->pose, pose, NULL) == HV_OK;
}

/* The poses of the cylinders' last three positions, the newest first. */
static hv_status_t last_poses(const platform_t *self, pose_t pose[3])
{
    const pose_t *guess = &self->pose;
    for (unsigned age = 0; age < 3; age++) {
        q32_t extension_mm_q32[CYLINDERS_MAX];
        for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
            const ramp_state_t *s = &self->cylinder[i].state;
            const q32_t back_q32 = age == 0   ? 0
                                   : age == 1 ? s->vel_per_cycle_q32
                                              : 2 * s->vel_per_cycle_q32 - s->acc_per_cycle2_q32;
            extension_mm_q32[i] = s->pos_q32 - back_q32;
        }
        if (kin_forward(&self->kin, extension_mm_q32, guess, &pose[age], NULL) != HV_OK) {
            return HV_ERR_RANGE;
        }
        guess = &pose[age];
    }
    return HV_OK;
}

/* Position, velocity and acceleration of an axis. */
static ramp_state_t state_from(const pose_t pose[3], unsigned axis)
{
    const q32_t now_q32 = pose[0].axis_q32[axis];
    const q32_t vel_q32 = now_q32 - pose[1].axis_q32[axis];
    return (ramp_state_t){now_q32, vel_q32, vel_q32 - (pose[1].axis_q32[axis] - pose[2].axis_q32[axis])};
}

bool platform_adopt_pose(platform_t *self)
{
    pose_t pose[3];
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->reference[i] = self->cylinder[i].state;
    }
    if (last_poses(self, pose) != HV_OK) {
        return false;
    }
    const bool is_resting = platform_is_at_rest(self);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t state = state_from(pose, i);
        const ramp_state_t at_rest = {.pos_q32 = self->is_axis_moved[i] ? state.pos_q32 : 0};
        ramp_adopt(&self->axis[i], is_resting || !self->is_axis_moved[i] ? &at_rest : &state);
    }
    return true;
}

/* SPDX-License-Identifier: MIT
 * axis_targets.c - a sender's target as one value for each followed axis; see axis_targets.h.
 */
#include "axis_targets.h"

#include "assembly.h"
#include "workspace.h"

#define VALUE_MAX_Q32 q32_from_int(32768) /* no limit is beyond it */

static q32_t clamp_to(const ramp_limits_t *limits, q32_t value_q32)
{
    return fx_clamp(value_q32, limits->pos_min_q32, limits->pos_max_q32);
}

/* Whether intensity scales an axis: all that a platform moves but the rotation motor, which may be turns away from its zero. */
static bool is_scaled(const axis_scale_t *scale, unsigned i)
{
    const platform_t *platform = scale->platform;
    return i != AXIS_ANGLE && (scale->space == MOTION_POSE ? platform->is_axis_moved[i] : i < platform->cylinders);
}

/* What intensity scales about. */
static q32_t centre_of(const axis_scale_t *scale, unsigned i)
{
    return scale->space == MOTION_POSE ? scale->platform->neutral.axis_q32[i] : scale->platform->neutral_mm_q32[i];
}

bool axis_targets_can_assemble(const axis_scale_t *scale, bool is_beginning, const motion_target_t *target)
{
    const platform_t *platform = scale->platform;
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    for (unsigned i = 0; i < platform->cylinders; i++) {
        const q32_t scaled_q32 = intensity_scaled(scale->intensity, platform->neutral_mm_q32[i], target->value_q32[i]);
        extension_mm_q32[i] = clamp_to(&platform->cylinder[i].limits, scaled_q32);
    }
    return assembly_is_held(platform, is_beginning, extension_mm_q32);
}

/* A sender's value, before intensity, so that what it is scaled to is inside the limits. */
static q32_t value_within(axis_targets_t *self, const axis_scale_t *scale, unsigned i, const ramp_limits_t *limits,
                          q32_t asked_q32)
{
    const q32_t centre_q32 = centre_of(scale, i);
    const q32_t value_q32 = fx_clamp(asked_q32, -VALUE_MAX_Q32, VALUE_MAX_Q32);
    const q32_t scaled_q32 = is_scaled(scale, i) ? intensity_scaled(scale->intensity, centre_q32, value_q32) : value_q32;
    const q32_t kept_q32 = clamp_to(limits, scaled_q32);
    self->is_clamped |= kept_q32 != scaled_q32 || value_q32 != asked_q32;
    if (kept_q32 == scaled_q32) {
        return value_q32;
    }
    return is_scaled(scale, i) ? intensity_unscaled(scale->intensity, centre_q32, kept_q32) : kept_q32;
}

void axis_targets_scale(const axis_scale_t *scale, const q32_t value_q32[AXES_MAX], q32_t scaled_q32[AXES_MAX])
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        scaled_q32[i] =
            is_scaled(scale, i) ? intensity_scaled(scale->intensity, centre_of(scale, i), value_q32[i]) : value_q32[i];
    }
}

/* Pulls the whole pose into the workspace; the share of the way from neutral that is left holds before intensity too. */
static void pull_values_in(axis_targets_t *self, const axis_scale_t *scale)
{
    q32_t scaled_q32[AXES_MAX];
    q32_t extension_mm_q32[CYLINDERS_MAX];
    pose_t pose;
    q62_t share_q62 = Q62_ONE;
    axis_targets_scale(scale, self->value_q32, scaled_q32);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = scaled_q32[i];
    }
    self->limiting_cylinder = (uint8_t)workspace_pull_in(scale->platform, &pose, extension_mm_q32, &share_q62);
    for (unsigned i = 0; self->limiting_cylinder != 0 && i < POSE_AXES; i++) {
        const q32_t neutral_q32 = scale->platform->neutral.axis_q32[i];
        self->value_q32[i] = neutral_q32 + fx_mul_shift(self->value_q32[i] - neutral_q32, share_q62, 62);
    }
    self->is_clamped |= self->limiting_cylinder != 0;
}

void axis_targets_accept(axis_targets_t *self, const axis_scale_t *scale, const motion_target_t *target)
{
    const platform_t *platform = scale->platform;
    const bool is_posed = scale->space == MOTION_POSE;
    if (target->has_angle) {
        self->angle_deg_q32 = clamp_to(&platform->axis[AXIS_ANGLE].limits, target->angle_deg_q32);
    }
    self->is_clamped = target->has_angle && self->angle_deg_q32 != target->angle_deg_q32;
    self->limiting_cylinder = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const bool is_used = is_posed || i < platform->cylinders;
        const ramp_limits_t *limits = is_posed ? &platform->axis[i].limits : &platform->cylinder[i].limits;
        const q32_t value_q32 =
            is_used ? value_within(self, scale, i, limits, target->value_q32[i]) : platform->cylinder[i].state.pos_q32;
        self->value_q32[i] = is_posed && !platform->is_axis_moved[i] ? 0 : value_q32;
    }
    self->value_q32[AXIS_ANGLE] = self->angle_deg_q32;
    if (is_posed) {
        pull_values_in(self, scale);
    }
}

/* From neutral to the value of an axis, before intensity. */
static q32_t whole_way(const axis_scale_t *scale, unsigned i, q32_t value_q32)
{
    return is_scaled(scale, i) ? value_q32 - centre_of(scale, i) : 0;
}

void axis_targets_plan(axis_targets_t *self, const axis_scale_t *scale)
{
    self->planned_share_q46 = scale->intensity->share_q46[0];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->planned_way_q32[i] = whole_way(scale, i, self->value_q32[i]);
    }
}

bool axis_targets_is_planned(const axis_targets_t *self, const axis_scale_t *scale, unsigned axes)
{
    bool is_planned = true;
    for (unsigned i = 0; i < axes; i++) {
        is_planned &= self->planned_way_q32[i] == whole_way(scale, i, self->value_q32[i]);
    }
    return is_planned;
}

void axis_targets_unscale(const axis_scale_t *scale, history_t now[AXES_MAX])
{
    const int64_t share_q46 = scale->intensity->share_q46[0];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        if (is_scaled(scale, i)) {
            now[i].pos_q32 = intensity_unscaled(scale->intensity, centre_of(scale, i), now[i].pos_q32);
            now[i].vel_per_cycle_q32 = share_q46 > 0 ? fx_mul_div(now[i].vel_per_cycle_q32, INTENSITY_FULL, share_q46) : 0;
            now[i].acc_per_cycle2_q32 = share_q46 > 0 ? fx_mul_div(now[i].acc_per_cycle2_q32, INTENSITY_FULL, share_q46) : 0;
        }
    }
}

void axis_targets_scale_refs(const axis_scale_t *scale, ramp_ref_t ref[AXES_MAX])
{
    if (intensity_is_still(scale->intensity, INTENSITY_FULL)) {
        return; /* what has always been whole is not changed by a bit */
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        if (is_scaled(scale, i)) {
            ref[i] = intensity_scale(scale->intensity, centre_of(scale, i), &ref[i]);
        }
    }
}

void axis_targets_shift_refs(const axis_targets_t *self, const intensity_t *intensity, ramp_ref_t ref[AXES_MAX])
{
    if (intensity_is_still(intensity, self->planned_share_q46)) {
        return;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_ref_t by = intensity_shift(intensity, self->planned_share_q46, self->planned_way_q32[i]);
        ref[i].pos_q32 += by.pos_q32;
        ref[i].vel_per_cycle_q32 += by.vel_per_cycle_q32;
        ref[i].acc_per_cycle2_q32 += by.acc_per_cycle2_q32;
        ref[i].jerk_per_cycle3_q32 += by.jerk_per_cycle3_q32;
    }
}

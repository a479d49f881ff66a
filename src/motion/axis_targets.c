/* SPDX-License-Identifier: MIT
 * axis_targets.c - a sender's targets as one value per slot of the space that is followed in; see axis_targets.h.
 */
#include "axis_targets.h"

#include "assembly.h"
#include "workspace.h"
#include "active_axis.h"

#define SLOT_MAX_Q32 q32_from_int(32768) /* no limit is beyond it */

static q32_t clamp_to(const ramp_limits_t *limits, q32_t value_q32)
{
    return fx_clamp(value_q32, limits->pos_min_q32, limits->pos_max_q32);
}

/* Whether intensity scales a slot: all that a platform moves but the rotation motor, which may be turns away from its zero. */
static bool is_scaled(const motion_t *self, motion_space_t space, unsigned i)
{
    return i != AXIS_ANGLE && (space == MOTION_POSE ? self->is_axis_moved[i] : i < self->cylinders);
}

/* What intensity scales about. */
static q32_t centre_of(const motion_t *self, motion_space_t space, unsigned i)
{
    return space == MOTION_POSE ? self->neutral.axis_q32[i] : self->neutral_mm_q32[i];
}

bool axis_targets_can_assemble(const motion_t *self, const motion_target_t *target)
{
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t scaled_q32 = intensity_scaled(&self->intensity, self->neutral_mm_q32[i], target->value_q32[i]);
        extension_mm_q32[i] = clamp_to(&self->cylinder[i].limits, scaled_q32);
    }
    return assembly_is_held(self, extension_mm_q32);
}

/* A sender's value, before intensity, so that what it is scaled to is inside the limits. */
static q32_t slot_within(motion_t *self, motion_space_t space, unsigned i, const ramp_limits_t *limits, q32_t asked_q32)
{
    const q32_t centre_q32 = centre_of(self, space, i);
    const q32_t value_q32 = fx_clamp(asked_q32, -SLOT_MAX_Q32, SLOT_MAX_Q32);
    const q32_t scaled_q32 = is_scaled(self, space, i) ? intensity_scaled(&self->intensity, centre_q32, value_q32) : value_q32;
    const q32_t kept_q32 = clamp_to(limits, scaled_q32);
    self->is_clamped |= kept_q32 != scaled_q32 || value_q32 != asked_q32;
    if (kept_q32 == scaled_q32) {
        return value_q32;
    }
    return is_scaled(self, space, i) ? intensity_unscaled(&self->intensity, centre_q32, kept_q32) : kept_q32;
}

void axis_targets_scale(const motion_t *self, motion_space_t space, const q32_t slot_q32[AXES_MAX], q32_t scaled_q32[AXES_MAX])
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        scaled_q32[i] =
            is_scaled(self, space, i) ? intensity_scaled(&self->intensity, centre_of(self, space, i), slot_q32[i]) : slot_q32[i];
    }
}

/* Pulls the whole pose into the workspace; the share of the way from neutral that is left holds before intensity too. */
static void pull_slots_in(motion_t *self, q32_t slot_q32[AXES_MAX], const q32_t scaled_q32[AXES_MAX],
                          q32_t extension_mm_q32[CYLINDERS_MAX])
{
    pose_t pose;
    q62_t share_q62 = Q62_ONE;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = scaled_q32[i];
    }
    self->limiting_cylinder = (uint8_t)workspace_pull_in(self, &pose, extension_mm_q32, &share_q62);
    for (unsigned i = 0; self->limiting_cylinder != 0 && i < POSE_AXES; i++) {
        const q32_t neutral_q32 = self->neutral.axis_q32[i];
        slot_q32[i] = neutral_q32 + fx_mul_shift(slot_q32[i] - neutral_q32, share_q62, 62);
    }
}

void axis_targets_accept(motion_t *self, const motion_target_t *target, q32_t slot_q32[AXES_MAX],
                         q32_t extension_mm_q32[CYLINDERS_MAX])
{
    q32_t scaled_q32[AXES_MAX];
    if (target->has_angle) {
        self->angle_target_deg_q32 = clamp_to(&self->axis[AXIS_ANGLE].limits, target->angle_deg_q32);
    }
    self->is_clamped = target->has_angle && self->angle_target_deg_q32 != target->angle_deg_q32;
    self->limiting_cylinder = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const bool is_used = target->space == MOTION_POSE || i < self->cylinders;
        const ramp_limits_t *limits = target->space == MOTION_POSE ? &self->axis[i].limits : &self->cylinder[i].limits;
        slot_q32[i] =
            is_used ? slot_within(self, target->space, i, limits, target->value_q32[i]) : self->cylinder[i].state.pos_q32;
    }
    for (unsigned i = 0; target->space == MOTION_POSE && i < POSE_AXES; i++) {
        slot_q32[i] = self->is_axis_moved[i] ? slot_q32[i] : 0;
    }
    slot_q32[AXIS_ANGLE] = self->angle_target_deg_q32;
    axis_targets_scale(self, target->space, slot_q32, scaled_q32);
    if (target->space == MOTION_POSE) {
        pull_slots_in(self, slot_q32, scaled_q32, extension_mm_q32);
    } else {
        for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
            extension_mm_q32[i] = scaled_q32[i];
        }
    }
    self->is_clamped |= self->limiting_cylinder != 0;
}

/* From neutral to where a slot is, before intensity. */
static q32_t whole_way(const motion_t *self, unsigned slot, q32_t slot_q32)
{
    return is_scaled(self, self->space, slot) ? slot_q32 - centre_of(self, self->space, slot) : 0;
}

void axis_targets_plan(motion_t *self, const q32_t slot_q32[AXES_MAX])
{
    self->timed_share_q46 = self->intensity.share_q46[0];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->timed_way_q32[i] = whole_way(self, i, slot_q32[i]);
    }
}

bool axis_targets_is_planned(const motion_t *self, const q32_t slot_q32[AXES_MAX])
{
    bool is_planned = true;
    for (unsigned i = 0; i < self->planned_slots; i++) {
        is_planned &= self->timed_way_q32[i] == whole_way(self, i, slot_q32[i]);
    }
    return is_planned;
}

void axis_targets_unscaled_states(const motion_t *self, history_t now[AXES_MAX])
{
    const int64_t share_q46 = self->intensity.share_q46[0];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        now[i] = *active_axis_state(self, i);
        if (is_scaled(self, self->space, i)) {
            now[i].pos_q32 = intensity_unscaled(&self->intensity, centre_of(self, self->space, i), now[i].pos_q32);
            now[i].vel_per_cycle_q32 = share_q46 > 0 ? fx_mul_div(now[i].vel_per_cycle_q32, INTENSITY_FULL, share_q46) : 0;
            now[i].acc_per_cycle2_q32 = share_q46 > 0 ? fx_mul_div(now[i].acc_per_cycle2_q32, INTENSITY_FULL, share_q46) : 0;
        }
    }
}

void axis_targets_scale_refs(const motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    if (intensity_is_still(&self->intensity, INTENSITY_FULL)) {
        return; /* what has always been whole is not changed by a bit */
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        if (is_scaled(self, self->space, i)) {
            ref[i] = intensity_scale(&self->intensity, centre_of(self, self->space, i), &ref[i]);
        }
    }
}

void axis_targets_shift_refs(const motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    if (intensity_is_still(&self->intensity, self->timed_share_q46)) {
        return;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_ref_t by = intensity_shift(&self->intensity, self->timed_share_q46, self->timed_way_q32[i]);
        ref[i].pos_q32 += by.pos_q32;
        ref[i].vel_per_cycle_q32 += by.vel_per_cycle_q32;
        ref[i].acc_per_cycle2_q32 += by.acc_per_cycle2_q32;
        ref[i].jerk_per_cycle3_q32 += by.jerk_per_cycle3_q32;
    }
}

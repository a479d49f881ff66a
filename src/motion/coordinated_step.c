/* SPDX-License-Identifier: MIT
 * coordinated_step.c - one cycle of all pose axes together; see coordinated_step.h.
 *
 * In a cycle, the jerk of a cylinder is linear in the jerks of the axes: what they change is below a thousandth of a millimetre.
 * So two poses are enough to know the jerk of every cylinder for every share between them.
 */
#include "coordinated_step.h"

#include "brake.h"
#include "workspace.h"

#define SHARE_SHIFT 30
#define SHARE_FULL  (INT64_C(1) << SHARE_SHIFT)
#define GAIN_MOST   (Q16_ONE / 16)   /* of the common brake, per cycle: that of a soft ramp */
#define GAIN_LEAST  (Q16_ONE / 4096) /* less is no brake */

/* A cylinder's reference in the next cycle, at this extension. */
static ramp_ref_t reference_at(const history_t *from, q32_t extension_mm_q32)
{
    const q32_t vel_q32 = extension_mm_q32 - from->pos_q32;
    const q32_t acc_q32 = vel_q32 - from->vel_per_cycle_q32;
    return (ramp_ref_t){extension_mm_q32, vel_q32, acc_q32, acc_q32 - from->acc_per_cycle2_q32};
}

/* Where the platform is after a cycle with these accelerations of the axes. */
static void next_position(const platform_t *self, const q32_t acc_q32[POSE_AXES], coordinated_step_t *to)
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t *at = &self->axis[i].state;
        to->pose.axis_q32[i] = at->pos_q32 + at->vel_per_cycle_q32 + acc_q32[i];
    }
    kin_constrain(&self->kin, &to->pose);
    to->limiting_cylinder = workspace_pull_in(self, &to->pose, to->extension_mm_q32, NULL);
}

static bool can_follow(const ramp_t *cylinder, const ramp_ref_t *ref)
{
    const ramp_limits_t *limits = &cylinder->limits;
    const q32_t acc_q32 = fx_abs(ref->acc_per_cycle2_q32);
    const q32_t towards_q32 = ref->acc_per_cycle2_q32 < 0 ? -ref->vel_per_cycle_q32 : ref->vel_per_cycle_q32;
    return fx_abs(ref->jerk_per_cycle3_q32) <= limits->jerk_per_cycle3_q32 && acc_q32 <= cylinder->acc_safe_q32 &&
           brake_keeps_velocity(cylinder, towards_q32, acc_q32, limits->vel_per_cycle_q32);
}

static bool can_all_follow(const platform_t *self, const coordinated_step_t *to)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        const ramp_ref_t ref = reference_at(&self->reference[i], to->extension_mm_q32[i]);
        if (!can_follow(&self->cylinder[i], &ref)) {
            return false;
        }
    }
    return true;
}

/* The gain of the brake jerk = -g^2 vel - 2 g acc, two poles at -g: as large as one axis or cylinder bears, with seven eighths of
 * its jerk, and without more than its acceleration on the way (from an even speed g vel / e at most). */
static int64_t gain_borne(const ramp_t *ramp, const ramp_state_t *at, int64_t gain_q16)
{
    const q32_t jerk_q32 = ramp->limits.jerk_per_cycle3_q32;
    const q32_t vel_q32 = fx_abs(at->vel_per_cycle_q32);
    const q32_t acc_q32 = fx_abs(at->acc_per_cycle2_q32);
    while (gain_q16 > GAIN_LEAST &&
           (fx_mul_shift(vel_q32, gain_q16, 16) > 2 * ramp->acc_safe_q32 ||
            fx_mul_shift(vel_q32, gain_q16 * gain_q16, 32) + fx_mul_shift(acc_q32, 2 * gain_q16, 16) > jerk_q32 - jerk_q32 / 8)) {
        gain_q16 = gain_q16 * 181 / 256;
    }
    return gain_q16;
}

/* The accelerations with which all axes brake together. */
static void brake_together(platform_t *self, q32_t acc_q32[POSE_AXES])
{
    int64_t gain_q16 = GAIN_MOST;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        gain_q16 = gain_borne(&self->axis[i], &self->axis[i].state, gain_q16);
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        gain_q16 = gain_borne(&self->cylinder[i], &self->reference[i], gain_q16);
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t *at = &self->axis[i].state;
        const q32_t jerk_q32 = -fx_mul_shift(at->vel_per_cycle_q32, gain_q16 * gain_q16, 32) -
                               fx_mul_shift(at->acc_per_cycle2_q32, 2 * gain_q16, 16);
        acc_q32[i] = ramp_allowed(&self->axis[i], at->acc_per_cycle2_q32 + jerk_q32);
    }
}

/* The largest jerk of a cylinder to one side, less a little for rounding; what it could brake alone, it may not together. */
static q32_t most_jerk(const ramp_t *cylinder, const history_t *from, int sign)
{
    const ramp_limits_t *limits = &cylinder->limits;
    const q32_t acc_q32 = sign * from->acc_per_cycle2_q32;
    const q32_t room_q32 = fx_clamp(limits->vel_per_cycle_q32 - sign * from->vel_per_cycle_q32, 0, 2 * limits->vel_per_cycle_q32);
    const q32_t jerk_q32 = limits->jerk_per_cycle3_q32;
    const q32_t by_speed_q32 = brake_acc_for_velocity_room(cylinder, room_q32 / 8 * 5);
    const q32_t most_q32 = fx_clamp(by_speed_q32, 0, cylinder->acc_safe_q32) - jerk_q32 / 64;
    return fx_clamp(most_q32 - acc_q32, -jerk_q32, jerk_q32 - jerk_q32 / 64);
}

/* The share of the way from the brake to what is wanted that a cylinder can follow, at most the one given. */
static int64_t share_followed(const ramp_t *cylinder, const history_t *from, q32_t braked_q32, q32_t wanted_q32, int64_t share)
{
    const int sign = wanted_q32 < braked_q32 ? -1 : 1;
    const q32_t room_q32 = most_jerk(cylinder, from, sign) - sign * reference_at(from, braked_q32).jerk_per_cycle3_q32;
    const q32_t way_q32 = sign * (wanted_q32 - braked_q32);
    if (way_q32 <= room_q32) {
        return share;
    }
    const int64_t own = room_q32 <= 0 ? 0 : fx_mul_div(room_q32, SHARE_FULL, way_q32);
    return own < share ? own : share;
}

/* Cuts what the axes want, all by one share. */
static void cut(platform_t *self, q32_t acc_q32[POSE_AXES], coordinated_step_t *to)
{
    q32_t braked_q32[POSE_AXES];
    coordinated_step_t braked;
    int64_t share = SHARE_FULL;
    brake_together(self, braked_q32);
    next_position(self, braked_q32, &braked);
    if (braked.limiting_cylinder != 0) {
        return;
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        share =
            share_followed(&self->cylinder[i], &self->reference[i], braked.extension_mm_q32[i], to->extension_mm_q32[i], share);
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        acc_q32[i] = braked_q32[i] + fx_mul_shift(acc_q32[i] - braked_q32[i], share, SHARE_SHIFT);
    }
    next_position(self, acc_q32, to);
}

unsigned coordinated_step(platform_t *self, const ramp_ref_t ref[POSE_AXES], ramp_bandwidth_t bandwidth, coordinated_step_t *to)
{
    q32_t acc_q32[POSE_AXES];
    unsigned flags = ramp_aim_all(self->axis, POSE_AXES, ref, bandwidth, acc_q32);
    next_position(self, acc_q32, to);
    if (to->limiting_cylinder == 0 && !can_all_follow(self, to)) {
        flags |= RAMP_ACCEL;
        cut(self, acc_q32, to);
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        (void)ramp_advance(&self->axis[i], acc_q32[i]);
    }
    if (to->limiting_cylinder != 0) {
        kin_constrain(&self->kin, &to->pose); /* the parasitic axes are not on the straight line along which it was pulled in */
    }
    return flags;
}

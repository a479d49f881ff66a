/* SPDX-License-Identifier: MIT
 * follow.c - following a sender.
 *
 * Poses: references of the pose axes, scaled by intensity -> ramps -> workspace -> inverse kinematics -> references of cylinders.
 * Extensions go to the cylinders as they are. When the space changes, forward kinematics of the last three set-points gives the
 * pose axes their position, velocity and acceleration. The references of a sender that begins are faded in (fade.h) before the
 * ramps.
 */
#include "follow.h"

#include "axis_targets.h"
#include "coordinated_step.h"
#include "fade_in.h"
#include "followed.h"
#include "jump.h"
#include "plan.h"
#include "platform.h"
#include "target_times.h"

#define RETURN_GAP_US 1000000 /* whatever a sender sends after that may be another program's */

bool follow_is_moving(const motion_t *self)
{
    return self->source == MOTION_STREAMED || self->source == MOTION_PLANNED;
}

/* What targets are scaled by, in the space that is followed. */
static axis_scale_t scale_of(const motion_t *self)
{
    return (axis_scale_t){&self->platform, &self->intensity, self->followed.space};
}

/* The mechanism, where poses are followed. */
static const kin_t *kin_followed(const motion_t *self)
{
    return self->followed.space == MOTION_POSE ? &self->platform.kin : NULL;
}

/* The first references of another space are those of the present set-points. */
static void enter_space(followed_t *self, platform_t *platform)
{
    const bool is_posed = self->space == MOTION_POSE;
    self->is_new = false;
    if (is_posed && !platform_adopt_pose(platform)) {
        return;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->past[i] = is_posed ? platform->axis[i].state : platform->cylinder[i].state;
    }
}

/* What a ramp can follow. */
static governor_limits_t limits_of(const ramp_t *ramp)
{
    return (governor_limits_t){ramp->limits.vel_per_cycle_q32, ramp->acc_safe_q32, ramp->limits.jerk_per_cycle3_q32};
}

/* Targets are given in another space from now on. */
static void change_space(motion_t *self, motion_space_t space)
{
    const platform_t *platform = &self->platform;
    const governor_limits_t none = {0};
    const bool is_posed = space == MOTION_POSE;
    self->followed.space = space;
    self->followed.is_new = true;
    self->source = MOTION_STREAMED;
    self->is_jumping = false;
    target_times_reset(&self->times);
    spike_filter_reset(&self->gate);
    stream_reset(&self->stream);
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const bool is_used = is_posed || i == AXIS_ANGLE || i < platform->cylinders;
        const governor_limits_t limits = is_used ? limits_of(followed_ramp(&self->followed, platform, i)) : none;
        stream_set_limits(&self->stream, i, &limits);
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const governor_limits_t limits = is_posed && i < platform->cylinders ? limits_of(&platform->cylinder[i]) : none;
        stream_set_cylinder_limits(&self->stream, i, &limits);
    }
}

/* True if a pose of a stream is withheld until the next one confirms it. */
static bool is_withheld(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    const uint32_t period_us = stream_is_live(&self->stream, now_us) ? stream_period_us(&self->stream) : 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        spike_filter_set_quantum(&self->gate, i, stream_quantum_q32(&self->stream, i));
    }
    if (target->space != MOTION_POSE || spike_filter_passes(&self->gate, now_us, period_us, target->value_q32)) {
        return false;
    }
    self->withheld = *target;
    return true;
}

/* Whether this sample of a stream goes on from a step that the gate has held back. */
static bool has_jumped(const motion_t *self, bool is_sample)
{
    return is_sample && self->gate.is_step && self->followed.space == MOTION_POSE && self->source == MOTION_STREAMED &&
           !followed_is_beginning(&self->followed) && stream_phase(&self->stream) == STREAM_RUNNING;
}

HV_OWN_FRAME static void accept_jump(motion_t *self, const axis_scale_t *scale, const motion_target_t *target)
{
    q32_t step_q32[POSE_AXES];
    const jump_in_t in = {scale, &self->followed, self->targets.value_q32, step_q32};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        step_q32[i] = target->value_q32[i] - self->withheld.value_q32[i];
    }
    self->is_jumping = jump_accept(&self->plan.jump, self->is_jumping, &in, &self->stream);
}

/* The stream goes on from where the axes are. */
HV_OWN_FRAME static void place_stream(motion_t *self, const axis_scale_t *scale)
{
    history_t now[AXES_MAX];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        now[i] = *followed_state(&self->followed, &self->platform, i);
    }
    axis_targets_unscale(scale, now);
    stream_place(&self->stream, now);
}

/* A sample, or a target by itself. */
static void accept_target(motion_t *self, const motion_target_t *target, bool is_sample, uint32_t hint_us, uint64_t now_us)
{
    const uint32_t cycle_us = self->platform.cycle_us;
    const axis_scale_t scale = scale_of(self);
    axis_targets_accept(&self->targets, &scale, target);
    self->pending = *target; /* has_pending is set if it has to wait for a stop */
    self->asked_cycles = is_sample ? 0 : ((int64_t)target->time_ms * 1000 + cycle_us / 2) / cycle_us;
    self->timed.end_us = is_sample ? 0 : now_us + (uint64_t)self->asked_cycles * cycle_us;
    self->timed.is_stretched = false;
    if (!is_sample) {
        stream_reset(&self->stream);
        spike_filter_reset(&self->gate);
    }
    if (self->source != MOTION_STREAMED && !self->followed.is_new) {
        place_stream(self, &scale);
    }
    if (has_jumped(self, is_sample)) {
        accept_jump(self, &scale, target);
    }
    stream_hide_start(&self->stream, fade_in_is_hidden(&self->fade_in, self->followed.phase));
    stream_hint_period(&self->stream, hint_us);
    stream_push(&self->stream, now_us, kin_followed(self), self->targets.value_q32);
    self->due = !is_sample ? DUE_TIMED : stream_phase(&self->stream) == STREAM_RUNNING ? DUE_STREAM : DUE_STEP;
}

/* The timed move that is under way once more: planned anew with each frame of a sender that repeats itself it would never arrive,
 * and swing where the limits stretch it. */
static bool is_under_way(const motion_t *self, const motion_target_t *target)
{
    const motion_target_t *last = &self->pending;
    bool is_same = self->source == MOTION_PLANNED && self->due == DUE_NOTHING && last->is_timed &&
                   target->time_ms == last->time_ms && target->has_angle == last->has_angle &&
                   (!target->has_angle || target->angle_deg_q32 == last->angle_deg_q32);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        is_same = is_same && target->value_q32[i] == last->value_q32[i];
    }
    return is_same;
}

/* Stops if moving, and fades the sender in from there, with the pending target. */
static void fade_in_again(motion_t *self)
{
    self->due = DUE_NOTHING;
    motion_follow(self);
    self->has_pending = true;
}

void follow_target(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    if (target->space != self->followed.space || !follow_is_moving(self)) {
        change_space(self, target->space);
    }
    const bool is_sample = target_times_is_sample(&self->times, &self->stream, target, now_us);
    /* a move that states its time is as quick as it says */
    const bool may_return = is_sample || now_us - self->times.last_us >= RETURN_GAP_US;
    if (may_return && !followed_is_beginning(&self->followed) &&
        stream_returns_elsewhere(&self->stream, now_us, target->value_q32)) {
        self->pending = *target;
        fade_in_again(self);
        self->fade_in.is_return = true;
        return;
    }
    const uint32_t hint_us = target_times_hint_us(&self->times, &self->stream, target, now_us);
    target_times_note(&self->times, target, now_us);
    if (!is_sample && is_under_way(self, target)) {
        return;
    }
    if (!is_sample || !is_withheld(self, target, now_us)) {
        accept_target(self, target, is_sample, hint_us, now_us);
    }
}

void follow_begin(motion_t *self, uint64_t now_us)
{
    self->followed.phase = FOLLOW_AWAITED;
    if (self->has_pending) {
        self->has_pending = false;
        follow_target(self, &self->pending, now_us);
    }
}

/* A stream whose last sample was withheld ends at this sample. */
static void accept_withheld(motion_t *self, uint64_t now_us)
{
    if (spike_filter_is_overdue(&self->gate, now_us)) {
        spike_filter_reset(&self->gate);
        self->gate.is_step = true;
        accept_target(self, &self->withheld, true, 0, now_us);
    }
}

/* A step to the end of the present path. */
static bool is_on_the_way(const motion_t *self)
{
    const path_t *path = &self->plan.path;
    const axis_scale_t scale = scale_of(self);
    unsigned i = 0;
    if (self->source != MOTION_PLANNED || path->kind == PATH_STOP_AND_STRAIGHT) {
        return false;
    }
    while (i < path->axes && path_end(path)[i] == self->targets.goal_q32[i]) {
        i++;
    }
    return i == path->axes && axis_targets_is_planned(&self->targets, &scale, path->axes);
}

/* Before the plan: the axes of its space, and a sender that is still to be faded in. */
static void prepare_plan(motion_t *self, motion_due_t due, bool is_first)
{
    followed_t *followed = &self->followed;
    if (followed->is_new) {
        enter_space(followed, &self->platform);
    }
    const axis_scale_t scale = scale_of(self);
    axis_targets_scale(&scale, self->targets.value_q32, self->targets.goal_q32);
    if (is_first) {
        fade_in_begin(&self->fade_in, &self->platform, followed->space);
        followed->phase = FOLLOW_FADING_IN;
    }
    if (followed->phase == FOLLOW_FADING_IN) {
        fade_in_aim(&self->fade_in, &self->platform, followed->space, due != DUE_STREAM ? self->targets.goal_q32 : NULL);
    }
}

static void plan_move(motion_t *self, bool is_first, uint64_t now_us)
{
    const plan_in_t in = {&self->platform, &self->followed, &self->targets, &self->intensity};
    const int64_t asked = self->asked_cycles;
    const int64_t planned = plan_timed(&in, asked > 0 ? asked : 1, &self->plan.path);
    const int64_t faded = is_first ? fade_cycles(&self->fade_in.fade, &self->fade_in.limits) : 0;
    const int64_t cycles = faded > planned ? faded : planned;
    self->source = MOTION_PLANNED;
    self->timed.is_stretched = asked > 0 && cycles > asked;
    self->timed.stretched_count += self->timed.is_stretched;
    self->timed.end_us = now_us + (uint64_t)cycles * self->platform.cycle_us;
}

static void plan_lone_step(motion_t *self)
{
    const plan_in_t in = {&self->platform, &self->followed, &self->targets, &self->intensity};
    path_t *path = &self->plan.path;
    if (!plan_step(&in, path)) {
        self->source = MOTION_STREAMED; /* a lone sample: each axis by its own ramp */
        return;
    }
    self->source = MOTION_PLANNED;
    if (path->kind == PATH_STRAIGHT && fade_in_is_hidden(&self->fade_in, self->followed.phase)) {
        scurve_end(&path->way.straight.curve); /* fading is the move */
    }
}

/* Makes the plan for the targets of this cycle. */
static void plan_what_is_due(motion_t *self, uint64_t now_us)
{
    const motion_due_t due = self->due;
    const bool is_first = self->followed.phase == FOLLOW_AWAITED;
    if ((due == DUE_TIMED || due == DUE_STEP) && fade_in_is_beyond_limits(&self->platform, &self->followed)) {
        fade_in_again(self);
        return;
    }
    self->due = DUE_NOTHING;
    if (due == DUE_NOTHING) {
        return;
    }
    prepare_plan(self, due, is_first);
    if (due == DUE_STREAM) {
        self->source = MOTION_STREAMED;
    } else if (due == DUE_TIMED || is_first || !is_on_the_way(self)) {
        const axis_scale_t scale = scale_of(self);
        axis_targets_plan(&self->targets, &scale);
        if (due == DUE_TIMED) {
            plan_move(self, is_first, now_us);
        } else {
            plan_lone_step(self);
        }
    }
}

void follow_plan(motion_t *self, uint64_t now_us)
{
    accept_withheld(self, now_us);
    plan_what_is_due(self, now_us);
}

/* A stream's references. */
static void step_stream(motion_t *self, uint64_t now_us, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    const axis_scale_t scale = scale_of(self);
    stream_set_scale(&self->stream, intensity_largest_q16(&self->intensity));
    (void)stream_step(&self->stream, now_us, kin_followed(self), ref);
    self->is_jumping = self->is_jumping && jump_step(&self->plan.jump, ref);
    axis_targets_scale_refs(&scale, ref);
    out->flags |= (stream_is_smoothed(&self->stream) ? MOTION_ACCEL : 0) | (stream_is_slowed(&self->stream) ? MOTION_SPEED : 0);
}

/* The references of a planned path. Axes that do not follow it go to their targets by themselves. */
static void step_planned(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    path_t *path = &self->plan.path;
    self->is_jumping = false;
    path_step(path, ref);
    for (unsigned i = path->axes; i < AXES_MAX; i++) {
        ref[i] = (ramp_ref_t){.pos_q32 = self->targets.value_q32[i]};
    }
    axis_targets_shift_refs(&self->targets, &self->intensity, ref);
    out->flags |= path_is_cruising(path) && path->axes == POSE_AXES ? MOTION_SPEED : 0;
}

/* Pose axes through their ramps, into the workspace, to cylinders. */
static void step_pose(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    const ramp_bandwidth_t bandwidth = self->source == MOTION_STREAMED ? RAMP_SOFT : RAMP_FIRM;
    coordinated_step_t to;
    const unsigned flags = coordinated_step(&self->platform, ref, bandwidth, &to);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        out->asked.axis_q32[i] = ref[i].pos_q32;
    }
    out->sent = to.pose;
    out->limiting_cylinder = to.limiting_cylinder != 0 ? (uint8_t)to.limiting_cylinder : self->targets.limiting_cylinder;
    for (unsigned i = 0; i < self->platform.cylinders; i++) {
        ref[i] = history_advance(&self->platform.reference[i], to.extension_mm_q32[i]);
    }
    out->flags |= ((flags & RAMP_CLAMPED) ? MOTION_CLAMPED : 0) | ((flags & RAMP_SPEED) ? MOTION_SPEED : 0) |
                  ((flags & RAMP_ACCEL) ? MOTION_ACCEL : 0) | (to.limiting_cylinder != 0 ? MOTION_CLAMPED : 0);
}

/* From the references of the followed axes to those of the cylinders. */
static void step_axes(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    followed_t *followed = &self->followed;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        followed->past[i] = (history_t){ref[i].pos_q32, ref[i].vel_per_cycle_q32, ref[i].acc_per_cycle2_q32};
    }
    if (followed->phase == FOLLOW_FADING_IN) {
        const bool is_fading = fade_in_step(&self->fade_in, &self->platform, followed->space, ref);
        followed->phase = is_fading ? FOLLOW_FADING_IN : FOLLOW_FULLY;
        out->flags |= MOTION_TAKEOVER;
    }
    if (followed->space == MOTION_POSE) {
        step_pose(self, ref, out);
    } else {
        out->flags |= MOTION_IN_CYLINDERS;
    }
}

void follow_step(motion_t *self, uint64_t now_us, ramp_ref_t cylinder_ref[AXES_MAX], motion_output_t *out)
{
    ramp_t *angle = &self->platform.axis[AXIS_ANGLE];
    out->flags |= self->timed.is_stretched ? MOTION_STRETCHED : 0;
    if (self->source == MOTION_STREAMED) {
        step_stream(self, now_us, cylinder_ref, out);
    } else {
        step_planned(self, cylinder_ref, out);
    }
    step_axes(self, cylinder_ref, out);
    out->angle_deg_q32 = ramp_step(angle, &cylinder_ref[AXIS_ANGLE], RAMP_FIRM);
    out->flags |= self->targets.is_clamped ? MOTION_CLAMPED : 0;
}

/* SPDX-License-Identifier: MIT
 * follow.c - following a sender.
 *
 * Poses: references of the pose axes, scaled by intensity -> ramps -> workspace -> inverse kinematics -> references of cylinders.
 * Extensions go to the cylinders as they are. When the space changes, forward kinematics of the last three set-points gives the
 * pose axes their position, velocity and acceleration. At a take-over the references are faded in (fade.h) before the ramps.
 */
#include "follow.h"

#include "ref_history.h"
#include "plan.h"
#include "jump.h"
#include "fade_in.h"
#include "coordinated_step.h"
#include "active_axis.h"
#include "axis_targets.h"

#define INSTANT_MS     5       /* no move is this short: frames with such a T ... */
#define INSTANT_GAP_US 20000   /* ... that follow each other so closely are a stream like frames without T */
#define RETURN_GAP_US  1000000 /* whatever a sender sends after that may be another program's */
#define PERIODS_STATED 5       /* so many periods a streaming sender may write as T, and more if it does not mean T */

bool follow_is_moving(const motion_t *self)
{
    return self->source >= MOTION_STREAMED;
}

/* The poses of the cylinders' last three positions, the newest first. */
static hv_status_t last_poses(const motion_t *self, pose_t pose[3])
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

static void adopt_pose(motion_t *self)
{
    pose_t pose[3];
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->reference[i] = self->cylinder[i].state;
    }
    if (last_poses(self, pose) != HV_OK) {
        return;
    }
    const bool is_resting = motion_is_at_rest(self);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t state = state_from(pose, i);
        const ramp_state_t at_rest = {.pos_q32 = self->is_axis_moved[i] ? state.pos_q32 : 0};
        ramp_adopt(&self->axis[i], is_resting || !self->is_axis_moved[i] ? &at_rest : &state);
        self->led[i] = self->axis[i].state;
    }
}

/* Changes to another space. It starts from the set-points of the present one. */
static void enter_space(motion_t *self)
{
    self->is_space_new = false;
    if (self->space == MOTION_POSE) {
        adopt_pose(self);
        return;
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->led[i] = self->cylinder[i].state;
    }
}

/* The time of a target that could be a stream's period, else 0. */
static uint32_t period_stated(const motion_target_t *target)
{
    return target->is_timed && target->time_ms <= STREAM_HINT_MAX_US / 1000 ? target->time_ms * 1000 : 0;
}

/* Two times are about the same if neither is more than 2.5 times the other. */
static bool is_about(uint64_t time_us, uint64_t other_us)
{
    return time_us * 2 <= other_us * 5 && other_us * 2 <= time_us * 5;
}

/* A target without a time, or with one too short for a move, after so short a gap that it is none, or where a stream runs that is
 * so quick: a frame of it may be late or lost. */
static bool is_instant(const motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    const uint64_t period_us = stream_goes_on(&self->stream, now_us) ? stream_frame_us(&self->stream) : now_us - self->last_us;
    return !target->is_timed ||
           (target->time_ms <= INSTANT_MS && (now_us - self->last_us <= INSTANT_GAP_US || period_us <= INSTANT_GAP_US));
}

/* Targets that follow each other as quickly and as evenly as those of a stream, whatever time they state. */
static bool is_in_a_row(const motion_t *self, uint64_t gap_us)
{
    return self->last_gap_us > 0 && gap_us <= STREAM_QUIET_US && is_about(gap_us, self->last_gap_us);
}

/* A timed target is a sample of a stream if its time is about the period of the one that runs, or if it comes at that one's pace
 * and its time is some periods, or not meant; or if targets follow each other in the time that both state, or three evenly. */
static bool is_stream_sample(const motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    const uint32_t stated_us = period_stated(target);
    const uint64_t gap_us = now_us - self->last_us;
    if (is_instant(self, target, now_us)) {
        return true;
    }
    if (stated_us == 0) {
        return false;
    }
    if (stream_goes_on(&self->stream, now_us)) {
        const uint32_t period_us = stream_period_us(&self->stream);
        const uint32_t interval_us = stream_frame_us(&self->stream);
        return is_about(stated_us, period_us) || is_about(stated_us, interval_us) ||
               (gap_us * 2 <= interval_us * 5 && (stated_us <= PERIODS_STATED * period_us || self->is_time_idle));
    }
    return is_in_a_row(self, gap_us) || (is_about(gap_us, stated_us) && is_about(gap_us, self->last_stated_us));
}

/* What a target says of the sender's period: a time that is not about the interval is a wish of another kind. The first interval
 * may be that of a late frame. */
static uint32_t period_hinted(const motion_t *self, const motion_target_t *target, uint64_t gap_us)
{
    const uint32_t stated_us = period_stated(target);
    const uint64_t period_us = stream_period_us(&self->stream);
    if (self->stream.phase == STREAM_EMPTY || self->last_stated_us == 0) {
        return stated_us;
    }
    if (self->stream.phase == STREAM_LONE) {
        return is_about(stated_us, gap_us) ? stated_us : 0;
    }
    return stated_us * 2 <= period_us * 3 && period_us * 2 <= stated_us * 3 ? stated_us : 0;
}

/* What a ramp can follow. */
static governor_limits_t limits_of(const ramp_t *ramp)
{
    return (governor_limits_t){ramp->limits.vel_per_cycle_q32, ramp->acc_safe_q32, ramp->limits.jerk_per_cycle3_q32};
}

/* The mechanism, where poses are followed. */
static const kin_t *kin_followed(const motion_t *self)
{
    return self->space == MOTION_POSE ? &self->kin : NULL;
}

governor_limits_t follow_axis_limits(const motion_t *self, unsigned i)
{
    const bool is_used = self->space == MOTION_POSE || i == AXIS_ANGLE || i < self->cylinders;
    return is_used ? limits_of(active_axis_ramp(self, i)) : (governor_limits_t){0};
}

governor_limits_t follow_cylinder_limits(const motion_t *self, unsigned i)
{
    return self->space == MOTION_POSE && i < self->cylinders ? limits_of(&self->cylinder[i]) : (governor_limits_t){0};
}

/* The slots are those of a space from now on. */
static void change_space(motion_t *self, motion_space_t space)
{
    self->space = space;
    self->is_space_new = true;
    self->last_stated_us = 0;
    self->last_gap_us = 0;
    self->is_time_idle = false;
    self->source = MOTION_STREAMED;
    stream_reset(&self->stream);
    self->is_jumping = false;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const governor_limits_t limits = follow_axis_limits(self, i);
        stream_set_limits(&self->stream, i, &limits);
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const governor_limits_t limits = follow_cylinder_limits(self, i);
        stream_set_cylinder_limits(&self->stream, i, &limits);
    }
    spike_filter_reset(&self->gate);
}

/* True if a pose of a stream is withheld until the next one confirms it. */
static bool is_withheld(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    const uint32_t period_us = stream_is_live(&self->stream, now_us) ? stream_period_us(&self->stream) : 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        spike_filter_set_quantum(&self->gate, i, self->stream.curve.quantum[i].quantum_q32);
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
    return is_sample && self->gate.is_step && self->space == MOTION_POSE && self->source == MOTION_STREAMED &&
           !self->is_taking_over && self->stream.phase == STREAM_RUNNING;
}

static void accept_jump(motion_t *self, const motion_target_t *target)
{
    q32_t step_q32[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        step_q32[i] = target->value_q32[i] - self->withheld.value_q32[i];
    }
    jump_accept(self, step_q32);
}

/* A sample, or a target by itself. */
static void accept_target(motion_t *self, const motion_target_t *target, bool is_sample, uint32_t hint_us, uint64_t now_us)
{
    axis_targets_accept(self, target, self->slot_q32, self->slot_extension_mm_q32);
    self->pending = *target; /* has_pending is set if it has to wait for a stop */
    self->asked_cycles = is_sample ? 0 : ((int64_t)target->time_ms * 1000 + self->cycle_us / 2) / self->cycle_us;
    self->timed_end_us = is_sample ? 0 : now_us + (uint64_t)self->asked_cycles * self->cycle_us;
    self->is_stretched = false;
    if (!is_sample) {
        stream_reset(&self->stream);
        spike_filter_reset(&self->gate);
    }
    if (self->source != MOTION_STREAMED && !self->is_space_new) {
        history_t now[AXES_MAX];
        axis_targets_unscaled_states(self, now);
        stream_place(&self->stream, now);
    }
    if (has_jumped(self, is_sample)) {
        accept_jump(self, target);
    }
    stream_hide_start(&self->stream, fade_in_is_hidden(self));
    stream_hint_period(&self->stream, hint_us);
    stream_push(&self->stream, now_us, kin_followed(self), self->slot_q32);
    self->due = !is_sample ? DUE_TIMED : self->stream.phase == STREAM_RUNNING ? DUE_STREAM : DUE_STEP;
}

/* The timed move that is under way once more: planned anew with each frame of a sender that repeats itself it would never arrive,
 * and swing where the limits stretch it. */
static bool is_under_way(const motion_t *self, const motion_target_t *target)
{
    const motion_target_t *last = &self->pending;
    bool is_same = self->source > MOTION_STREAMED && self->due == DUE_NOTHING && last->is_timed &&
                   target->time_ms == last->time_ms && target->has_angle == last->has_angle &&
                   (!target->has_angle || target->angle_deg_q32 == last->angle_deg_q32);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        is_same = is_same && target->value_q32[i] == last->value_q32[i];
    }
    return is_same;
}

/* What a sender says of the time between its frames, and what it keeps of that. */
static void note_times(motion_t *self, const motion_target_t *target, uint64_t gap_us, uint64_t now_us)
{
    /* a sender that does not wait for the time it states does not mean it */
    self->is_time_idle = gap_us <= STREAM_HINT_MAX_US && (self->is_time_idle || gap_us * 5 < self->last_stated_us * UINT64_C(2));
    const bool is_short = target->is_timed && target->time_ms <= STREAM_HINT_MAX_US / 1000;
    self->last_gap_us = is_short && gap_us <= STREAM_QUIET_US ? (uint32_t)gap_us : 0;
    self->last_us = now_us;
    self->last_stated_us = period_stated(target);
}

void follow_target(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    if (target->space != self->space || !follow_is_moving(self)) {
        change_space(self, target->space);
    }
    const bool is_sample = is_stream_sample(self, target, now_us);
    /* a move that states its time is as quick as it says */
    const bool may_return = is_sample || now_us - self->last_us >= RETURN_GAP_US;
    if (may_return && !self->is_taking_over && stream_returns_elsewhere(&self->stream, now_us, target->value_q32)) {
        self->pending = *target;
        fade_in_again(self);
        self->is_return = true;
        return;
    }
    const uint64_t gap_us = now_us - self->last_us;
    const uint32_t hint_us = period_hinted(self, target, gap_us);
    note_times(self, target, gap_us, now_us);
    if (!is_sample && is_under_way(self, target)) {
        return;
    }
    if (!is_sample || !is_withheld(self, target, now_us)) {
        accept_target(self, target, is_sample, hint_us, now_us);
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

/* A step to the end of the present plan. */
static bool is_on_the_way(const motion_t *self)
{
    const q32_t *to_q32 = self->source == MOTION_TIMED ? self->plan.quintic.target_q32 : self->plan.straight.to_q32;
    unsigned i = 0;
    if (self->source != MOTION_TIMED && self->source != MOTION_STRAIGHT) {
        return false;
    }
    while (i < self->planned_slots && to_q32[i] == self->goal_q32[i]) {
        i++;
    }
    return i == self->planned_slots && axis_targets_is_planned(self, self->slot_q32);
}

/* Before the plan: the axes of its space, and a sender that is still to be faded in. */
static void prepare_plan(motion_t *self, motion_due_t due, bool is_first)
{
    if (self->is_space_new) {
        enter_space(self);
    }
    axis_targets_scale(self, self->space, self->slot_q32, self->goal_q32);
    if (is_first) {
        fade_in_begin(self);
    }
    if (self->is_fading) {
        fade_in_aim(self, due != DUE_STREAM);
    }
}

/* Makes the plan for the targets of this cycle. */
static void plan_what_is_due(motion_t *self, uint64_t now_us)
{
    const motion_due_t due = self->due;
    const bool is_first = self->is_taking_over && !self->is_fading;
    if ((due == DUE_TIMED || due == DUE_STEP) && fade_in_is_led_beyond(self)) {
        fade_in_again(self);
        return;
    }
    self->due = DUE_NOTHING;
    if (due != DUE_NOTHING) {
        prepare_plan(self, due, is_first);
    }
    if (due == DUE_TIMED) {
        plan_timed(self, self->asked_cycles, is_first, now_us);
    } else if (due == DUE_STEP && (is_first || !is_on_the_way(self))) {
        plan_step(self);
    } else if (due == DUE_STREAM) {
        self->source = MOTION_STREAMED;
    }
}

void follow_begin(motion_t *self, uint64_t now_us)
{
    self->is_taking_over = true;
    self->is_fading = false;
    if (self->has_pending) {
        self->has_pending = false;
        follow_target(self, &self->pending, now_us);
    }
}

/* A stop, and the straight move that begins during it. */
static void step_stop_and_straight(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    motion_straight_t *way = &self->plan.straight;
    const bool was_done = sync_stop_is_done(&self->halt) && scurve_is_done(&way->path);
    sync_stop_step(&self->halt, ref);
    if (self->halt.elapsed > self->straight_after) {
        scurve_step(&way->path);
    }
    for (unsigned i = 0; i < self->planned_slots; i++) {
        const ramp_ref_t rest = {.pos_q32 = way->to_q32[i]};
        const q32_t gone_q32 = scurve_between(&way->path, way->from_q32[i], way->to_q32[i]) - way->from_q32[i];
        ref[i] = was_done ? rest : history_advance(&way->history[i], ref[i].pos_q32 + gone_q32);
    }
}

/* The references of the slots along a plan. */
static void step_source(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    if (self->source == MOTION_TIMED) {
        quintic_step(&self->plan.quintic, ref);
    } else if (self->source == MOTION_HALTING) {
        step_stop_and_straight(self, ref);
    } else {
        motion_straight_t *way = &self->plan.straight;
        const bool was_done = scurve_is_done(&way->path);
        scurve_step(&way->path);
        for (unsigned i = 0; i < AXES_MAX; i++) {
            const ramp_ref_t rest = {.pos_q32 = way->to_q32[i]};
            const q32_t pos_q32 = scurve_between(&way->path, way->from_q32[i], way->to_q32[i]);
            ref[i] = was_done ? rest : history_advance(&way->history[i], pos_q32);
        }
    }
    for (unsigned i = self->planned_slots; i < AXES_MAX; i++) {
        ref[i] = (ramp_ref_t){.pos_q32 = self->slot_q32[i]};
    }
    axis_targets_shift_refs(self, ref);
}

/* Pose axes through their ramps, into the workspace, to cylinders. */
static void step_pose(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    const ramp_bandwidth_t bandwidth = self->source == MOTION_STREAMED ? RAMP_SOFT : RAMP_FIRM;
    coordinated_step_t to;
    const unsigned flags = coordinated_step(self, ref, bandwidth, &to);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        out->asked.axis_q32[i] = ref[i].pos_q32;
    }
    out->sent = to.pose;
    out->limiting_cylinder = to.limiting_cylinder != 0 ? (uint8_t)to.limiting_cylinder : self->limiting_cylinder;
    for (unsigned i = 0; i < self->cylinders; i++) {
        ref[i] = history_advance(&self->reference[i], to.extension_mm_q32[i]);
    }
    out->flags |= ((flags & RAMP_CLAMPED) ? MOTION_CLAMPED : 0) | ((flags & RAMP_SPEED) ? MOTION_SPEED : 0) |
                  ((flags & RAMP_ACCEL) ? MOTION_ACCEL : 0) | (to.limiting_cylinder != 0 ? MOTION_CLAMPED : 0);
}

/* From the slots' references to the cylinders'. */
static void step_slots(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->led[i] = (history_t){ref[i].pos_q32, ref[i].vel_per_cycle_q32, ref[i].acc_per_cycle2_q32};
    }
    fade_in_step(self, ref, out);
    if (self->space == MOTION_POSE) {
        step_pose(self, ref, out);
    } else {
        out->flags |= MOTION_IN_CYLINDERS;
    }
}

/* A step in progress at a speed limit. */
static bool is_step_cruising(const motion_t *self)
{
    const scurve_t *path = &self->plan.straight.path;
    return self->source == MOTION_STRAIGHT && self->planned_slots == POSE_AXES && path->acc == 0 && path->vel != 0;
}

void follow_plan(motion_t *self, uint64_t now_us)
{
    accept_withheld(self, now_us);
    plan_what_is_due(self, now_us);
}

/* A stream's references. */
static void step_stream(motion_t *self, uint64_t now_us, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    stream_set_scale(&self->stream, intensity_largest_q16(&self->intensity));
    (void)stream_step(&self->stream, now_us, kin_followed(self), ref);
    jump_step(self, ref);
    axis_targets_scale_refs(self, ref);
    out->flags |= (self->stream.curve.governor.strength_q32 >= 2 * Q32_ONE ? MOTION_ACCEL : 0) |
                  (self->stream.curve.governor.is_slowed ? MOTION_SPEED : 0);
}

void follow_step(motion_t *self, uint64_t now_us, ramp_ref_t cylinder_ref[AXES_MAX], motion_output_t *out)
{
    out->flags |= self->is_stretched ? MOTION_STRETCHED : 0;
    if (self->source == MOTION_STREAMED) {
        step_stream(self, now_us, cylinder_ref, out);
    } else {
        self->is_jumping = false;
        step_source(self, cylinder_ref);
        out->flags |= is_step_cruising(self) ? MOTION_SPEED : 0;
    }
    step_slots(self, cylinder_ref, out);
    out->angle_deg_q32 = ramp_step(&self->axis[AXIS_ANGLE], &cylinder_ref[AXIS_ANGLE], RAMP_FIRM);
    out->flags |= self->is_clamped ? MOTION_CLAMPED : 0;
}

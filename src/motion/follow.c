/* SPDX-License-Identifier: MIT
 * follow.c - following a sender.
 *
 * Poses: references of the pose axes, scaled by intensity -> ramps -> workspace -> inverse kinematics -> references of the
 * cylinders. Extensions: the references go to the cylinders as they are. When the space changes, forward kinematics of the last
 * three set-points gives the pose axes their position, velocity and acceleration, so that nothing jumps. Take-over: reference =
 * from + share (wanted - from), the share rising from 0 to 1 along an S-curve whose largest speed is engage speed.
 */
#include "follow.h"

#include "join.h"
#include "past.h"
#include "plan.h"
#include "reach.h"
#include "slot.h"
#include "slots.h"

#define TAKEOVER_LEAST_US 250000
#define INSTANT_MS        5     /* no move is as short: frames with such a T ... */
#define INSTANT_GAP_US    20000 /* ... that follow each other so closely are a stream like frames without T */

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

void follow_adopt_pose(motion_t *self)
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
        ramp_take_over(&self->axis[i], is_resting || !self->is_axis_moved[i] ? &at_rest : &state);
        self->led[i] = self->axis[i].state;
    }
}

/* Goes over to a space; the other one's set-points are where it starts. */
static void enter_space(motion_t *self)
{
    self->is_space_new = false;
    self->join = JOIN_DUE;
    if (self->space == MOTION_POSE) {
        follow_adopt_pose(self);
        return;
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->led[i] = self->cylinder[i].state;
    }
}

/* The first target after a rest: its way at engage speed, or slower where a timed move gives it longer. The axes stand on the
 * target at once, as it is the blend that moves the platform there. */
HV_OWN_FRAME static void plan_blend(motion_t *self)
{
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < self->cylinders; i++) {
        const q32_t to_q32 = self->slot_extension_mm_q32[i];
        self->blend_from_q32[i] = self->cylinder[i].state.pos_q32;
        path_limits_narrow(&limits, to_q32 - self->blend_from_q32[i], &self->engage_limits);
        self->reference[i] = (history_t){.pos_q32 = to_q32};
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->led[i] = (history_t){.pos_q32 = self->goal_q32[i]};
        if (self->space == MOTION_POSE) {
            self->axis[i].state = self->led[i];
        }
    }
    const int64_t least = TAKEOVER_LEAST_US / (int64_t)self->cycle_us;
    scurve_plan(&self->blend, &limits, self->asked_cycles > least ? self->asked_cycles : least);
    self->blend_share[0] = self->blend_share[1] = self->blend_share[2] = 0;
    self->blend_rest = 0;
    self->is_blend_planned = true;
}

/* The time of a target that could be a stream's period, else 0. */
static uint32_t period_stated(const motion_target_t *target)
{
    return target->is_timed && target->time_ms <= STREAM_HINT_MAX_US / 1000 ? target->time_ms * 1000 : 0;
}

/* Two times are about the same if neither is more than 2.5 times the other. */
static bool is_about(uint64_t a_us, uint64_t b_us)
{
    return a_us * 2 <= b_us * 5 && b_us * 2 <= a_us * 5;
}

/* A target without a time, or with one too short for a move, after so short a gap that it is none, or where a stream runs that is
 * so quick: a frame of it may be late or lost. */
static bool is_instant(const motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    const uint64_t period_us = stream_goes_on(&self->stream, now_us) ? stream_frame_us(&self->stream) : now_us - self->last_us;
    return !target->is_timed ||
           (target->time_ms <= INSTANT_MS && (now_us - self->last_us <= INSTANT_GAP_US || period_us <= INSTANT_GAP_US));
}

/* A timed target is a sample of a stream if its time is about the period of the one that runs, or two follow each other in about
 * the time of both. */
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
    return stream_goes_on(&self->stream, now_us)
               ? is_about(stated_us, stream_period_us(&self->stream)) || is_about(stated_us, stream_frame_us(&self->stream))
               : is_about(gap_us, stated_us) && is_about(gap_us, self->last_stated_us);
}

/* The slots are those of a space from now on. */
static void change_space(motion_t *self, motion_space_t space)
{
    self->space = space;
    self->is_space_new = true;
    self->last_stated_us = 0;
    self->source = MOTION_STREAMED;
    self->join = JOIN_NONE; /* the last stream's way is gone */
    stream_reset(&self->stream);
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_limits_t *limits = slot_limits(self, i);
        stream_set_stop(&self->stream, i, (stream_stop_t){limits->acc_per_cycle2_q32, limits->jerk_per_cycle3_q32});
    }
    gate_reset(&self->gate);
}

/* True if the sample of a stream of poses is held back for the next one to confirm. */
static bool is_withheld(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    const uint32_t period_us = stream_is_live(&self->stream, now_us) ? stream_period_us(&self->stream) : 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        gate_set_grain(&self->gate, i, self->stream.curve.grain[i].grain_q32);
    }
    if (target->space != MOTION_POSE || gate_passes(&self->gate, now_us, period_us, target->value_q32)) {
        return false;
    }
    self->withheld = *target;
    return true;
}

/* A sample, or a target by itself. */
static void take_target(motion_t *self, const motion_target_t *target, bool is_sample, uint64_t now_us)
{
    slots_take(self, target, self->slot_q32, self->slot_extension_mm_q32);
    self->pending = *target; /* has_pending: where it has to wait for a stop after all */
    self->asked_cycles = is_sample ? 0 : ((int64_t)target->time_ms * 1000 + self->cycle_us / 2) / self->cycle_us;
    self->timed_end_us = is_sample ? 0 : now_us + (uint64_t)self->asked_cycles * self->cycle_us;
    self->is_stretched = false;
    if (!is_sample) {
        stream_reset(&self->stream);
        gate_reset(&self->gate);
    }
    stream_hint_period(&self->stream, period_stated(target));
    stream_push(&self->stream, now_us, self->slot_q32);
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

void follow_target(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    if (target->space != self->space || !follow_is_moving(self)) {
        change_space(self, target->space);
    }
    const bool is_sample = is_stream_sample(self, target, now_us);
    self->last_us = now_us;
    self->last_stated_us = period_stated(target);
    if (!is_sample && is_under_way(self, target)) {
        return;
    }
    if (!is_sample || !is_withheld(self, target, now_us)) {
        take_target(self, target, is_sample, now_us);
    }
}

/* A stream that ended with a sample that is withheld rests there. */
static void take_last_word(motion_t *self, uint64_t now_us)
{
    if (gate_is_overdue(&self->gate, now_us)) {
        gate_reset(&self->gate);
        take_target(self, &self->withheld, true, now_us);
    }
}

/* A step to where the plan leads anyway. */
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
    return i == self->planned_slots && slots_is_planned(self, self->slot_q32);
}

/* During a take-over nothing but the blend bounds what extensions ask for: a stream of jumps is far beyond what the cylinders can
 * do, and a plan that went on from there would take hours to come back. A little more than the limits is only rounding. */
static bool is_led_beyond(const motion_t *self)
{
    if (!self->is_taking_over || !self->is_blend_planned || self->space != MOTION_CYLINDERS) {
        return false;
    }
    bool is_beyond = false;
    for (unsigned i = 0; i < self->cylinders; i++) {
        const ramp_limits_t *limits = &self->cylinder[i].limits;
        is_beyond = is_beyond || fx_abs(self->led[i].vel_per_cycle_q32) > 2 * limits->vel_per_cycle_q32 ||
                    fx_abs(self->led[i].acc_per_cycle2_q32) > 2 * limits->acc_per_cycle2_q32;
    }
    return is_beyond;
}

/* The take-over begins anew, from where the cylinders are. */
static void take_over_again(motion_t *self)
{
    self->due = DUE_NOTHING;
    motion_follow(self);
    self->has_pending = true;
}

/* Plans what the targets of this cycle ask for. */
static void plan_what_is_due(motion_t *self, uint64_t now_us)
{
    const motion_due_t due = self->due;
    const bool is_first = self->is_taking_over && !self->is_blend_planned;
    if ((due == DUE_TIMED || due == DUE_STEP) && is_led_beyond(self)) {
        take_over_again(self);
        return;
    }
    self->due = DUE_NOTHING;
    if (due != DUE_NOTHING && self->is_space_new) {
        enter_space(self);
    }
    if (due != DUE_NOTHING) {
        slots_scale(self, self->space, self->slot_q32, self->goal_q32);
    }
    if (due != DUE_NOTHING && is_first) {
        plan_blend(self);
    }
    if (due == DUE_TIMED) {
        plan_timed(self, self->asked_cycles, is_first, now_us);
    } else if (due == DUE_STEP && (is_first || !is_on_the_way(self))) {
        plan_step(self);
    } else if (due == DUE_STREAM && self->source != MOTION_STREAMED) {
        self->source = MOTION_STREAMED;
        join_begin(self);
    } else if (due == DUE_STREAM) {
        join_sample(self);
    }
}

void follow_begin(motion_t *self, uint64_t now_us)
{
    self->is_taking_over = true;
    self->is_blend_planned = false;
    if (self->has_pending) {
        self->has_pending = false;
        follow_target(self, &self->pending, now_us);
    }
}

/* The references of the slots along a plan. */
static void step_source(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    if (self->source == MOTION_TIMED) {
        quintic_step(&self->plan.quintic, ref);
    } else if (self->source == MOTION_HALTING) {
        halt_step(&self->aside.halt, ref);
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
    slots_shift_refs(self, ref);
}

/* One cylinder's reference on the way from where the take-over began: the same blend of its last four positions, so that the
 * differences of a step's reference stay what they are. */
static ramp_ref_t blended(const motion_t *self, unsigned i, const ramp_ref_t *ref)
{
    const q32_t from_q32 = self->blend_from_q32[i];
    const int64_t share[PAST] = {self->blend.pos, self->blend_share[0], self->blend_share[1], self->blend_share[2]};
    q32_t at_q32[PAST];
    past_of(ref, at_q32);
    for (unsigned age = 0; age < PAST; age++) {
        at_q32[age] = from_q32 + fx_mul_div(at_q32[age] - from_q32, share[age], self->blend.total);
    }
    return past_ref(at_q32);
}

/* Leads the cylinders to the sender's motion at engage speed. */
static void take_over(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    if (!self->is_taking_over) {
        return;
    }
    const int64_t before = self->blend.pos;
    scurve_step(&self->blend);
    for (unsigned i = 0; i < self->cylinders; i++) {
        ref[i] = blended(self, i, &ref[i]);
    }
    self->blend_share[2] = self->blend_share[1];
    self->blend_share[1] = self->blend_share[0];
    self->blend_share[0] = self->blend.pos;
    out->flags |= MOTION_TAKEOVER;
    if (before == self->blend.total) {
        self->blend_rest++;
    }
    self->is_taking_over = self->blend_rest < 3;
}

/* Pose axes through their ramps, into the workspace, to cylinders. True if the pose had to be pulled in. */
static bool step_pose(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    const ramp_grip_t grip = self->source == MOTION_STREAMED ? RAMP_SOFT : RAMP_FIRM;
    q32_t extension_mm_q32[CYLINDERS_MAX];
    pose_t *planned = &out->sent;
    const unsigned flags = ramp_step_all(self->axis, POSE_AXES, ref, grip, planned->axis_q32);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        out->asked.axis_q32[i] = ref[i].pos_q32;
    }
    kin_constrain(&self->kin, planned);
    const unsigned cylinder = reach_pull_in(self, planned, extension_mm_q32, NULL);
    kin_constrain(&self->kin, planned); /* what is parasitic is not on the straight way the pose was pulled along */
    out->limiting_cylinder = cylinder != 0 ? (uint8_t)cylinder : self->limiting_cylinder;
    for (unsigned i = 0; i < self->cylinders; i++) {
        ref[i] = history_advance(&self->reference[i], extension_mm_q32[i]);
    }
    out->flags |= ((flags & RAMP_CLAMPED) ? MOTION_CLAMPED : 0) | ((flags & RAMP_SPEED) ? MOTION_SPEED : 0) |
                  ((flags & RAMP_ACCEL) ? MOTION_ACCEL : 0) | (cylinder != 0 ? MOTION_CLAMPED : 0);
    return cylinder != 0;
}

/* From the slots' references to the cylinders'. True if the pose had to be pulled in. */
static bool step_slots(motion_t *self, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->led[i] = (history_t){ref[i].pos_q32, ref[i].vel_per_cycle_q32, ref[i].acc_per_cycle2_q32};
    }
    if (self->space == MOTION_POSE) {
        return step_pose(self, ref, out);
    }
    out->flags |= MOTION_IN_CYLINDERS;
    return false;
}

/* Takes back what a cycle has changed on the way from the slots' references to the cylinders': their differences tell all of
 * it but the accelerations of the axes. */
static void go_back(motion_t *self, const q32_t acc_q32[POSE_AXES], const ramp_ref_t ref[AXES_MAX])
{
    for (unsigned i = 0; self->space == MOTION_POSE && i < POSE_AXES; i++) {
        ramp_state_t *state = &self->axis[i].state;
        state->pos_q32 -= state->vel_per_cycle_q32;
        state->vel_per_cycle_q32 -= state->acc_per_cycle2_q32;
        state->acc_per_cycle2_q32 = acc_q32[i];
    }
    for (unsigned i = 0; self->space == MOTION_POSE && i < self->cylinders; i++) {
        self->reference[i] = past_state(&ref[i]);
    }
}

/* From the stream's references to the cylinders', as planned. False where a cylinder could not follow them and another plan may
 * help, unless this is the last one: then it is as if nothing had been tried. */
HV_OWN_FRAME static bool try_cycle(motion_t *self, bool is_last, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    ramp_ref_t curve[AXES_MAX];
    q32_t acc_q32[POSE_AXES];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        curve[i] = ref[i];
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        acc_q32[i] = self->axis[i].state.acc_per_cycle2_q32;
    }
    join_step(self, curve, ref);
    const bool is_beyond = !is_last && join_are_slots_beyond(self, ref);
    if (!step_slots(self, ref, out) && !is_last && (is_beyond || join_are_cylinders_beyond(self, ref))) {
        go_back(self, acc_q32, ref);
        for (unsigned i = 0; i < AXES_MAX; i++) {
            ref[i] = curve[i];
        }
        return false;
    }
    out->flags |= join_flags(self, curve);
    return true;
}

/* A stream's references, as one body: where a cylinder could not follow them the cycle is planned anew for all. */
static void step_stream(motion_t *self, uint64_t now_us, ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    (void)stream_step(&self->stream, now_us, ref);
    slots_scale_refs(self, ref);
    join_plan(self, ref);
    if (!try_cycle(self, false, ref, out)) {
        join_plan_again(self, ref);
        (void)try_cycle(self, true, ref, out);
    }
}

/* A step on its way at a speed limit. */
static bool is_step_cruising(const motion_t *self)
{
    const scurve_t *path = &self->plan.straight.path;
    return self->source == MOTION_STRAIGHT && self->planned_slots == POSE_AXES && path->acc == 0 && path->vel != 0;
}

void follow_plan(motion_t *self, uint64_t now_us)
{
    take_last_word(self, now_us);
    plan_what_is_due(self, now_us);
}

void follow_step(motion_t *self, uint64_t now_us, ramp_ref_t cylinder_ref[AXES_MAX], motion_output_t *out)
{
    out->flags |= self->is_stretched ? MOTION_STRETCHED : 0;
    if (self->source == MOTION_STREAMED) {
        step_stream(self, now_us, cylinder_ref, out);
    } else {
        step_source(self, cylinder_ref);
        (void)step_slots(self, cylinder_ref, out);
        out->flags |= is_step_cruising(self) ? MOTION_SPEED : 0;
    }
    out->angle_deg_q32 = ramp_step(&self->axis[AXIS_ANGLE], &cylinder_ref[AXIS_ANGLE], RAMP_FIRM);
    take_over(self, cylinder_ref, out);
    out->flags |= self->is_clamped ? MOTION_CLAMPED : 0;
}

void follow_end_cycle(motion_t *self)
{
    if (self->source == MOTION_HALTING && halt_is_done(&self->aside.halt) && slot_all_at_rest(self, self->planned_slots)) {
        slots_scale(self, self->space, self->slot_q32, self->goal_q32);
        plan_straight(self, self->planned_slots, self->straight_cycles);
    }
}

/* SPDX-License-Identifier: MIT
 * follow.c - following a sender.
 *
 * Poses: references of the pose axes, scaled by intensity -> ramps -> workspace -> inverse kinematics -> references of the
 * cylinders. Extensions: the references go to the cylinders as they are. When the space changes, forward kinematics of the last
 * three set-points gives the pose axes their position, velocity and acceleration, so that nothing jumps. Take-over: reference =
 * from + share (wanted - from), the share rising from 0 to 1 along an S-curve whose largest speed is engage speed.
 */
#include "follow.h"

#include "past.h"
#include "reach.h"
#include "slots.h"
#include "way.h"

#define TAKEOVER_LEAST_US 250000

/* The ramp that stands for slot i of the space that is followed in. */
static ramp_t *slot_ramp(motion_t *self, unsigned i)
{
    return self->space == MOTION_POSE || i == AXIS_ANGLE ? &self->axis[i] : &self->cylinder[i];
}

bool follow_is_moving(const motion_t *self)
{
    return self->source >= MOTION_STREAMED;
}

/* Position, velocity and acceleration of the plate from the cylinders' last three positions. */
static hv_status_t pose_states(const motion_t *self, ramp_state_t state[POSE_AXES])
{
    pose_t pose[3];
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
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q32_t now_q32 = pose[0].axis_q32[i];
        const q32_t vel_q32 = now_q32 - pose[1].axis_q32[i];
        state[i] = (ramp_state_t){now_q32, vel_q32, vel_q32 - (pose[1].axis_q32[i] - pose[2].axis_q32[i])};
    }
    return HV_OK;
}

/* Goes over to a space; the other one's set-points are where it starts. */
static void enter_space(motion_t *self, motion_space_t space)
{
    self->space = space;
    stream_reset(&self->stream);
    self->last_timed_us = 0;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->reference[i] = self->cylinder[i].state;
    }
    ramp_state_t state[POSE_AXES];
    if (space != MOTION_POSE || pose_states(self, state) != HV_OK) {
        return;
    }
    const bool is_resting = motion_is_at_rest(self);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t at_rest = {.pos_q32 = self->is_axis_moved[i] ? state[i].pos_q32 : 0};
        ramp_take_over(&self->axis[i], is_resting || !self->is_axis_moved[i] ? &at_rest : &state[i]);
    }
}

/* The first target after a rest: its way at engage speed, or slower where a timed move gives it longer. The axes stand on the
 * target at once, as it is the blend that moves the platform there. */
static void plan_blend(motion_t *self, const q32_t slot_q32[AXES_MAX], const q32_t extension_mm_q32[CYLINDERS_MAX],
                       int64_t cycles)
{
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < self->cylinders; i++) {
        self->blend_from_q32[i] = self->cylinder[i].state.pos_q32;
        path_limits_narrow(&limits, extension_mm_q32[i] - self->blend_from_q32[i], &self->engage_limits);
        self->reference[i] = (history_t){.pos_q32 = extension_mm_q32[i]};
    }
    for (unsigned i = 0; self->space == MOTION_POSE && i < POSE_AXES; i++) {
        self->axis[i].state = (ramp_state_t){.pos_q32 = slot_q32[i]};
    }
    const int64_t least = TAKEOVER_LEAST_US / (int64_t)self->cycle_us;
    scurve_plan(&self->blend, &limits, cycles > least ? cycles : least);
    self->blend_share[0] = self->blend_share[1] = self->blend_share[2] = 0;
    self->blend_rest = 0;
    self->is_blend_planned = true;
}

/* The state a plan starts from: the ramp's, less what the intensity moves by itself. */
static ramp_state_t planned_start(motion_t *self, unsigned i)
{
    ramp_state_t state = slot_ramp(self, i)->state;
    const ramp_ref_t shift = intensity_shift(&self->intensity, self->timed_share_q46, self->timed_way_q32[i]);
    state.vel_per_cycle_q32 -= shift.vel_per_cycle_q32;
    state.acc_per_cycle2_q32 -= shift.acc_per_cycle2_q32;
    return state;
}

static void plan_straight(motion_t *self, const q32_t slot_q32[AXES_MAX], int64_t cycles)
{
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_t *ramp = slot_ramp(self, i);
        self->path_from_q32[i] = ramp->state.pos_q32;
        self->path_to_q32[i] = slot_q32[i];
        self->path_history[i] = ramp->state;
        path_limits_narrow(&limits, slot_q32[i] - ramp->state.pos_q32, &ramp->limits);
    }
    if (self->space == MOTION_POSE) {
        way_narrow(self, self->path_from_q32, slot_q32, &limits);
    }
    scurve_plan(&self->path, &limits, cycles);
    self->source = MOTION_STRAIGHT;
}

static bool are_slots_at_rest(motion_t *self)
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        if (!ramp_is_at_rest(slot_ramp(self, i))) {
            return false;
        }
    }
    return true;
}

/* A stop first, then the straight way, where the time asked for has room for both. */
static bool plan_stop_then_straight(motion_t *self, const ramp_state_t *start, const ramp_limits_t *const *limits,
                                    const q32_t slot_q32[AXES_MAX], int64_t cycles)
{
    halt_plan(&self->halt, AXES_MAX, POSE_AXES, start, limits);
    path_limits_t path = path_limits_none();
    for (unsigned i = 0; i < AXES_MAX; i++) {
        path_limits_narrow(&path, slot_q32[i] - self->halt.rest_q32[i], limits[i]);
        self->path_to_q32[i] = slot_q32[i];
    }
    if (self->space == MOTION_POSE) {
        way_narrow(self, self->halt.rest_q32, slot_q32, &path);
    }
    scurve_plan(&self->path, &path, 1);
    self->straight_cycles = cycles - self->halt.cycles - 1;
    return scurve_cycles(&self->path) <= self->straight_cycles;
}

/* Plans the quintic; false where an axis or a cylinder would break its limits. */
static bool is_quintic_feasible(motion_t *self, const ramp_state_t *start, const ramp_limits_t *const *limits,
                                const q32_t slot_q32[AXES_MAX], int64_t cycles)
{
    return quintic_plan(&self->quintic, AXES_MAX, start, slot_q32, cycles) == HV_OK &&
           quintic_is_feasible(&self->quintic, limits) && (self->space != MOTION_POSE || way_is_feasible(self, &self->quintic));
}

/* Timed moves, best first: a quintic; from rest an S-curve, longer than asked if need be; a stop and an S-curve; else the step
 * law. */
static void plan_timed(motion_t *self, const q32_t slot_q32[AXES_MAX], int64_t asked, bool is_first, uint64_t now_us)
{
    ramp_state_t start[AXES_MAX];
    const ramp_limits_t *limits[AXES_MAX];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        start[i] = is_first && i != AXIS_ANGLE ? (ramp_state_t){.pos_q32 = slot_q32[i]} : planned_start(self, i);
        limits[i] = &slot_ramp(self, i)->limits;
    }
    int64_t cycles = asked > 0 ? asked : 1;
    self->is_stretched = false;
    self->source = MOTION_TIMED;
    if (is_quintic_feasible(self, start, limits, slot_q32, cycles)) {
        /* planned as it is */
    } else if (are_slots_at_rest(self)) {
        plan_straight(self, slot_q32, cycles);
        cycles = scurve_cycles(&self->path);
        self->is_stretched = asked > 0 && cycles > asked;
    } else if (plan_stop_then_straight(self, start, limits, slot_q32, cycles)) {
        self->source = MOTION_HALTING;
    } else {
        self->source = MOTION_STREAMED; /* the lone sample that follow_target pushed: a step */
        self->is_stretched = asked > 0;
    }
    if (is_first && scurve_cycles(&self->blend) > cycles) {
        cycles = scurve_cycles(&self->blend);
        self->is_stretched = asked > 0;
    }
    self->stretched_count += self->is_stretched;
    self->timed_end_us = now_us + (uint64_t)cycles * self->cycle_us;
}

/* A timed target is a sample of a stream if its time is about the time between targets. */
static bool is_stream_sample(const motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    if (!target->is_timed) {
        return true;
    }
    const uint64_t time_us = (uint64_t)target->time_ms * 1000;
    const uint64_t gap_us = now_us - self->last_timed_us;
    return self->last_timed_us != 0 && time_us != 0 && time_us <= STREAM_PERIOD_MAX_US && gap_us <= STREAM_PERIOD_MAX_US &&
           gap_us * 2 <= time_us * 5 && time_us * 2 <= gap_us * 5;
}

void follow_target(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    q32_t slot_q32[AXES_MAX];
    q32_t scaled_q32[AXES_MAX];
    q32_t extension_mm_q32[CYLINDERS_MAX];
    if (target->space != self->space || !follow_is_moving(self)) {
        enter_space(self, target->space);
    }
    slots_take(self, target, slot_q32, extension_mm_q32);
    slots_scale(self, target->space, slot_q32, scaled_q32);
    const bool is_sample = is_stream_sample(self, target, now_us);
    const int64_t cycles = is_sample ? 0 : ((int64_t)target->time_ms * 1000 + self->cycle_us / 2) / self->cycle_us;
    const bool is_first = self->is_taking_over && !self->is_blend_planned;
    if (is_first) {
        plan_blend(self, scaled_q32, extension_mm_q32, cycles);
    }
    self->last_timed_us = target->is_timed ? now_us : 0;
    if (!is_sample) {
        stream_reset(&self->stream);
    }
    stream_push(&self->stream, now_us, slot_q32);
    self->timed_end_us = 0;
    self->is_stretched = false;
    if (is_sample) {
        self->source = MOTION_STREAMED;
    } else {
        slots_plan(self, slot_q32);
        plan_timed(self, scaled_q32, cycles, is_first, now_us);
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

/* The references of a move along a straight way. */
static void step_straight(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    const bool was_done = scurve_is_done(&self->path);
    scurve_step(&self->path);
    for (unsigned i = 0; i < AXES_MAX; i++) {
        ref[i] = was_done ? (ramp_ref_t){.pos_q32 = self->path_to_q32[i]}
                          : history_advance(&self->path_history[i],
                                            scurve_between(&self->path, self->path_from_q32[i], self->path_to_q32[i]));
    }
}

/* The references of the slots from whatever source there is. */
static void step_source(motion_t *self, uint64_t now_us, ramp_ref_t ref[AXES_MAX])
{
    if (self->source == MOTION_STREAMED) {
        (void)stream_step(&self->stream, now_us, ref);
        slots_scale_refs(self, ref);
        return;
    }
    if (self->source == MOTION_TIMED) {
        quintic_step(&self->quintic, ref);
    } else if (self->source == MOTION_HALTING) {
        halt_step(&self->halt, ref);
    } else {
        step_straight(self, ref);
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

/* Pose axes through their ramps, into the workspace, to cylinders. */
static void step_pose(motion_t *self, ramp_ref_t ref[AXES_MAX], pose_t *planned, motion_output_t *out)
{
    const ramp_grip_t grip = self->source == MOTION_STREAMED ? RAMP_SOFT : RAMP_FIRM;
    q32_t extension_mm_q32[CYLINDERS_MAX];
    unsigned flags = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        out->asked.axis_q32[i] = ref[i].pos_q32;
        planned->axis_q32[i] = ramp_step(&self->axis[i], &ref[i], grip);
        flags |= self->axis[i].flags;
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
}

void follow_step(motion_t *self, uint64_t now_us, ramp_ref_t ref[AXES_MAX], pose_t *planned, motion_output_t *out)
{
    step_source(self, now_us, ref);
    out->angle_deg_q32 = ramp_step(&self->axis[AXIS_ANGLE], &ref[AXIS_ANGLE], RAMP_FIRM);
    if (self->space == MOTION_POSE) {
        step_pose(self, ref, planned, out);
    } else {
        out->flags |= MOTION_IN_CYLINDERS;
    }
    take_over(self, ref, out);
    out->flags |= self->is_clamped ? MOTION_CLAMPED : 0;
}

void follow_end_cycle(motion_t *self)
{
    if (self->source == MOTION_HALTING && halt_is_done(&self->halt) && are_slots_at_rest(self)) {
        q32_t target_q32[AXES_MAX];
        for (unsigned i = 0; i < AXES_MAX; i++) {
            const ramp_ref_t by = intensity_shift(&self->intensity, self->timed_share_q46, self->timed_way_q32[i]);
            target_q32[i] = self->path_to_q32[i] + by.pos_q32;
        }
        self->timed_share_q46 = self->intensity.share_q46[0];
        plan_straight(self, target_q32, self->straight_cycles);
    }
}

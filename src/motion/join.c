/* SPDX-License-Identifier: MIT
 * join.c - one body follows a stream.
 *
 * While the stream keeps within the limits its curve is the reference. Where an axis or a cylinder is thrown off it, the whole
 * body leaves the curve and joins it again: the difference to the curve fades out along a quintic, the same time for all axes,
 * while the stream moves on. Where the curve itself is beyond the limits, or no such quintic keeps them, the body heads for the
 * newest sample, planned anew with every sample, until the curve can be joined.
 */
#include "join.h"

#include "brake.h"
#include "follow.h"
#include "past.h"
#include "plan.h"
#include "slot.h"
#include "slots.h"
#include "stream_curve.h"

#define LEAST_CYCLES     4  /* between plans because of limits */
#define JERK_FACTOR      4  /* a lost sample may take so much more jerk than there is for a moment: the ramps absorb it ... */
#define JERK_FACTOR_FAST 16 /* ... and so the steps of a quadratic curve's acceleration, of a cycle or two each */
#define OVERSHOOT_DIV    8  /* a stop goes beyond the samples if it does by this share of its way ... */
#define RETRY_CYCLES     16 /* between attempts to leave a sample for the curve */

#define OVERSHOOT_LEAST_Q32 (Q32_ONE / 100) /* ... and by that much */

/* On its reference as far as the soft grip works without using all of the jerk (see ramp.c). */
static bool is_near(const ramp_state_t *state, const history_t *reference, q32_t jerk_q32)
{
    return fx_abs(state->pos_q32 - reference->pos_q32) <= 4096 * jerk_q32 &&
           fx_abs(state->vel_per_cycle_q32 - reference->vel_per_cycle_q32) <= 178 * jerk_q32 &&
           fx_abs(state->acc_per_cycle2_q32 - reference->acc_per_cycle2_q32) <= 11 * jerk_q32;
}

static bool are_cylinders_off(const motion_t *self)
{
    if (self->space != MOTION_POSE || self->is_taking_over) {
        return false;
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        const ramp_t *ramp = &self->cylinder[i];
        if (!is_near(&ramp->state, &self->reference[i], ramp->limits.jerk_per_cycle3_q32)) {
            return true;
        }
    }
    return false;
}

static bool is_slot_near(const motion_t *self, unsigned i, const ramp_state_t *reference)
{
    return is_near(slot_state(self, i), reference, slot_limits(self, i)->jerk_per_cycle3_q32);
}

/* Near what they were last led to. */
static bool are_slots_near(const motion_t *self)
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        if (!is_slot_near(self, i, &self->led[i])) {
            return false;
        }
    }
    return true;
}

static bool is_within_limits(const motion_t *self, const ramp_ref_t *ref)
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_limits_t *limits = slot_limits(self, i);
        if (fx_abs(ref[i].vel_per_cycle_q32) > limits->vel_per_cycle_q32 ||
            fx_abs(ref[i].acc_per_cycle2_q32) > ramp_safe_acceleration(limits)) {
            return false;
        }
    }
    return true;
}

/* Near where the curve was in the cycle before. */
static bool is_on_curve(const motion_t *self, const ramp_ref_t *ref)
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t curve = past_state(&ref[i]);
        if (!is_slot_near(self, i, &curve)) {
            return false;
        }
    }
    return true;
}

static int64_t cycles_left(const motion_t *self)
{
    return self->plan.quintic.cycles - self->plan.quintic.elapsed;
}

/* The newest sample, as it is followed. */
static void find_newest(const motion_t *self, q32_t newest_q32[AXES_MAX])
{
    slots_scale(self, self->space, self->stream.curve.last_q32, newest_q32);
}

/* Plans the way to the newest sample, or at least a stop. */
static motion_join_t head_for_sample(motion_t *self)
{
    q32_t newest_q32[AXES_MAX];
    find_newest(self, newest_q32);
    if (plan_shortest(self, newest_q32)) {
        return JOIN_SAMPLE;
    }
    plan_halt(self);
    return JOIN_HALT;
}

/* True if a quintic leads there already. */
static bool is_heading_for(const motion_t *self, const q32_t target_q32[AXES_MAX])
{
    bool is_same = self->join == JOIN_SAMPLE;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        is_same &= self->plan.quintic.target_q32[i] == target_q32[i];
    }
    return is_same;
}

/* Plans a stop where the samples stand and even the quickest one goes beyond them: a quintic that comes back would go further.
 * What cylinders cannot follow is no such stop: of a quintic that is known beforehand. */
static bool has_to_overshoot(motion_t *self)
{
    q32_t newest_q32[AXES_MAX];
    find_newest(self, newest_q32);
    if (!stream_curve_is_standing(&self->stream.curve) || is_heading_for(self, newest_q32)) {
        return false;
    }
    plan_halt(self);
    bool is_beyond = false;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t *start = slot_state(self, i);
        const int sign = start->vel_per_cycle_q32 < 0 ? -1 : 1;
        const q32_t way_q32 = sign * (self->aside.halt.rest_q32[i] - start->pos_q32);
        const q32_t beyond_q32 = sign * (self->aside.halt.rest_q32[i] - newest_q32[i]);
        is_beyond |= start->vel_per_cycle_q32 != 0 && beyond_q32 > way_q32 / OVERSHOOT_DIV + OVERSHOOT_LEAST_Q32;
    }
    return is_beyond;
}

/* Plans anew from where the body is. */
static void replan(motion_t *self, const ramp_ref_t *ref, bool is_curve_beyond, bool may_stop)
{
    self->join_cycles = 0;
    if (may_stop && has_to_overshoot(self)) {
        self->join = JOIN_HALT;
    } else if (is_curve_beyond || !is_within_limits(self, ref)) {
        self->join = head_for_sample(self);
    } else if (is_on_curve(self, ref)) {
        self->join = JOIN_NONE;
    } else {
        self->join = plan_join(self, ref) ? JOIN_CURVE : head_for_sample(self);
    }
}

/* On the way to the curve: plans anew only where that makes the way a good deal shorter. */
static void shorten(motion_t *self, const ramp_ref_t *ref)
{
    const int64_t left = cycles_left(self);
    self->aside.kept = self->plan.quintic;
    if (!is_within_limits(self, ref) || !plan_join(self, ref) || self->plan.quintic.cycles * 8 > left * 7) {
        self->plan.quintic = self->aside.kept;
    }
}

void join_begin(motion_t *self)
{
    self->join = JOIN_DUE;
}

void join_sample(motion_t *self)
{
    self->has_new_sample = true;
}

static bool is_off_curve(const motion_t *self)
{
    return self->join == JOIN_SAMPLE || self->join == JOIN_HALT;
}

void join_plan(motion_t *self, const ramp_ref_t curve[AXES_MAX])
{
    const bool is_off = are_cylinders_off(self);
    if (is_off) {
        follow_adopt_pose(self);
    }
    if (is_off || self->join == JOIN_DUE || !are_slots_near(self) ||
        (is_off_curve(self) && (self->has_new_sample || self->join_cycles >= RETRY_CYCLES))) {
        replan(self, curve, false, !is_off);
    } else if (self->join == JOIN_CURVE && self->has_new_sample && cycles_left(self) > RETRY_CYCLES) {
        shorten(self, curve);
    }
    self->has_new_sample = false;
}

static ramp_ref_t sum(const ramp_ref_t *a, const ramp_ref_t *b)
{
    return (ramp_ref_t){a->pos_q32 + b->pos_q32, a->vel_per_cycle_q32 + b->vel_per_cycle_q32,
                        a->acc_per_cycle2_q32 + b->acc_per_cycle2_q32, a->jerk_per_cycle3_q32 + b->jerk_per_cycle3_q32};
}

/* One cycle along the plan. */
static void step_plan(motion_t *self, const ramp_ref_t *curve, ramp_ref_t *ref)
{
    self->join_cycles++;
    if (self->join == JOIN_HALT) {
        halt_step(&self->aside.halt, ref);
    } else {
        quintic_step(&self->plan.quintic, ref);
    }
    for (unsigned i = 0; self->join == JOIN_CURVE && i < POSE_AXES; i++) {
        ref[i] = sum(&curve[i], &ref[i]);
    }
    if (self->join == JOIN_CURVE && quintic_is_done(&self->plan.quintic)) {
        self->join = JOIN_NONE;
    }
}

void join_plan_again(motion_t *self, const ramp_ref_t curve[AXES_MAX])
{
    replan(self, curve, true, self->join != JOIN_HALT);
}

void join_step(motion_t *self, const ramp_ref_t curve[AXES_MAX], ramp_ref_t ref[AXES_MAX])
{
    if (self->join != JOIN_NONE) {
        step_plan(self, curve, ref);
    }
}

/* True if after this reference speed and acceleration can still be kept, and its jerk is not far beyond what can be absorbed. */
static bool is_viable(const ramp_t *ramp, const ramp_ref_t *ref, int jerk_factor)
{
    const int sign = ref->acc_per_cycle2_q32 < 0 ? -1 : 1;
    const q32_t acc_q32 = sign * ref->acc_per_cycle2_q32;
    const q32_t vel_q32 = sign * ref->vel_per_cycle_q32;
    return acc_q32 <= ramp->acc_safe_q32 && vel_q32 >= -ramp->limits.vel_per_cycle_q32 &&
           brake_keeps_velocity(ramp, vel_q32, acc_q32, ramp->limits.vel_per_cycle_q32) &&
           fx_abs(ref->jerk_per_cycle3_q32) < jerk_factor * (ramp->limits.jerk_per_cycle3_q32 + 1);
}

/* A plan is given a few cycles before the next one, and a take-over goes its own way. */
static bool is_new_plan_due(const motion_t *self)
{
    return !self->is_taking_over && (self->join == JOIN_NONE || self->join_cycles >= LEAST_CYCLES);
}

/* True if one of these ramps could not follow its reference. */
static bool is_any_beyond(const motion_t *self, const ramp_t *ramps, unsigned count, const ramp_ref_t *ref)
{
    const int jerk_factor = self->stream.style == STREAM_FAST ? JERK_FACTOR_FAST : JERK_FACTOR;
    unsigned i = 0;
    while (i < count && is_viable(&ramps[i], &ref[i], jerk_factor)) {
        i++;
    }
    return i < count;
}

bool join_are_slots_beyond(const motion_t *self, const ramp_ref_t ref[AXES_MAX])
{
    return self->space == MOTION_POSE && is_new_plan_due(self) && is_any_beyond(self, self->axis, POSE_AXES, ref);
}

bool join_are_cylinders_beyond(const motion_t *self, const ramp_ref_t ref[AXES_MAX])
{
    return is_new_plan_due(self) && is_any_beyond(self, self->cylinder, self->cylinders, ref);
}

unsigned join_flags(const motion_t *self, const ramp_ref_t curve[AXES_MAX])
{
    if (self->join == JOIN_NONE) {
        return 0;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        if (fx_abs(curve[i].vel_per_cycle_q32) > slot_limits(self, i)->vel_per_cycle_q32) {
            return MOTION_SPEED;
        }
    }
    return MOTION_ACCEL;
}

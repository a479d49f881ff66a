/* SPDX-License-Identifier: MIT
 * plan.c - ways to a target that all slots go together.
 */
#include "plan.h"

#include "ref_history.h"
#include "active_axis.h"
#include "axis_targets.h"
#include "path_check.h"
#include "fade_in.h"

#define BLEND_PARTS     8 /* of a stop, after which the way behind it may begin */
#define SMALL_WAY_Q32   (Q32_ONE / 16)
#define START_SLACK_Q32 (Q32_ONE / 1000) /* rounding of a quintic's first points */

/* What a quintic is looked for. Where it starts and what limits it are worked out where they are needed: they would lie on the
 * stack under everything that an attempt calls. */
typedef struct {
    unsigned slots;
    bool is_shifted; /* the intensity moves slots by itself, which is not for the plan to do */
    const q32_t *target_q32;
} task_t;

/* A state of the cycle before, less what something else adds to the plan: its reference is that of this cycle already. */
static ramp_state_t seen_from(const ramp_state_t *state, const ramp_ref_t *ref)
{
    const ramp_state_t base = ref_history_state(ref);
    return (ramp_state_t){state->pos_q32 - base.pos_q32, state->vel_per_cycle_q32 - base.vel_per_cycle_q32,
                          state->acc_per_cycle2_q32 - base.acc_per_cycle2_q32};
}

/* Where a slot starts. */
static ramp_state_t start_of(const motion_t *self, const task_t *task, unsigned i)
{
    ramp_state_t start = *active_axis_state(self, i);
    if (task->is_shifted) {
        const ramp_ref_t shift = intensity_shift(&self->intensity, self->timed_share_q46, self->timed_way_q32[i]);
        start = seen_from(&start, &shift);
    }
    return start;
}

/* Where cylinders led beyond an axis' range, the way back begins there. */
static void include_start(ramp_limits_t *limits, q32_t start_q32)
{
    limits->pos_min_q32 = fx_clamp(start_q32 - START_SLACK_Q32, INT64_MIN, limits->pos_min_q32);
    limits->pos_max_q32 = fx_clamp(start_q32 + START_SLACK_Q32, limits->pos_max_q32, INT64_MAX);
}

/* The limits of a slot. */
static ramp_limits_t limits_of(const motion_t *self, const task_t *task, unsigned i)
{
    ramp_limits_t limits = *active_axis_limits(self, i);
    include_start(&limits, start_of(self, task, i).pos_q32);
    return limits;
}

/* The limits of all slots. */
typedef struct {
    ramp_limits_t own[AXES_MAX];
    const ramp_limits_t *list[AXES_MAX];
} limits_t;

static void set_limits(const motion_t *self, const task_t *task, limits_t *limits)
{
    for (unsigned i = 0; i < task->slots; i++) {
        limits->own[i] = limits_of(self, task, i);
        limits->list[i] = &limits->own[i];
    }
}

HV_OWN_FRAME static bool plan_slots(motion_t *self, const task_t *task, int64_t cycles)
{
    ramp_state_t start[AXES_MAX];
    for (unsigned i = 0; i < task->slots; i++) {
        start[i] = start_of(self, task, i);
    }
    return quintic_plan(&self->plan.quintic, task->slots, start, task->target_q32, cycles) == HV_OK;
}

/* Whether every slot keeps its limits along self->plan.quintic. */
HV_OWN_FRAME static bool keeps_limits(const motion_t *self, const task_t *task)
{
    limits_t limits;
    set_limits(self, task, &limits);
    return quintic_is_feasible(&self->plan.quintic, limits.list);
}

/* Plans self->plan.quintic; false where an axis or a cylinder would break its limits, with what its target moves with. */
static bool try_quintic(motion_t *self, const task_t *task, int64_t cycles)
{
    if (!plan_slots(self, task, cycles)) {
        return false;
    }
    return keeps_limits(self, task) && (self->space != MOTION_POSE || path_check_is_feasible(self, &self->plan.quintic));
}

/* A stop of all slots together from where a task starts, which the cylinders can go along with. */
HV_OWN_FRAME static void sync_stop_slots(motion_t *self, const task_t *task)
{
    const ramp_limits_t *limits[AXES_MAX];
    sync_stop_t *halt = &self->halt;
    sync_stop_riders_t riders = {.count = self->space == MOTION_POSE ? self->cylinders : 0};
    for (unsigned i = 0; i < riders.count; i++) {
        riders.state[i] = &self->cylinder[i].state;
        riders.limits[i] = &self->cylinder[i].limits;
    }
    for (unsigned i = 0; i < task->slots; i++) {
        limits[i] = active_axis_limits(self, i);
        halt->start[i] = start_of(self, task, i);
    }
    sync_stop_plan(halt, task->slots, POSE_AXES, halt->start, limits, &riders);
}

path_limits_t plan_limits_of_straight(const motion_t *self, unsigned slots, const q32_t *from_q32, const q32_t *to_q32)
{
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < slots; i++) {
        path_limits_narrow(&limits, to_q32[i] - from_q32[i], active_axis_limits(self, i));
    }
    if (self->space == MOTION_POSE) {
        path_check_narrow(self, from_q32, to_q32, &limits);
    }
    return limits;
}

void plan_straight(motion_t *self, unsigned slots, int64_t least_cycles)
{
    self->timed_share_q46 = self->intensity.share_q46[0];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->plan.straight.history[i] = *active_axis_state(self, i);
        self->plan.straight.from_q32[i] = self->plan.straight.history[i].pos_q32;
        self->plan.straight.to_q32[i] = self->goal_q32[i];
    }
    const path_limits_t limits = plan_limits_of_straight(self, slots, self->plan.straight.from_q32, self->goal_q32);
    scurve_plan(&self->plan.straight.path, &limits, least_cycles);
    self->source = MOTION_STRAIGHT;
}

/* In motion: a stop, and the straight way from where it ends, of so many cycles at least; the cycles of both. The way begins as
 * early in the stop as the limits allow. Each part goes one way only, so that the sum goes no further than the stop or the
 * target. */
static int64_t plan_stop_and_straight(motion_t *self, const task_t *task, int64_t least_cycles)
{
    motion_straight_t *way = &self->plan.straight;
    sync_stop_slots(self, task);
    for (unsigned i = 0; i < task->slots; i++) {
        way->history[i] = self->halt.start[i];
        way->from_q32[i] = self->halt.rest_q32[i];
        way->to_q32[i] = self->goal_q32[i];
    }
    const path_limits_t limits = plan_limits_of_straight(self, task->slots, way->from_q32, self->goal_q32);
    scurve_plan(&way->path, &limits, 1);
    int64_t part = 0;
    while (part < BLEND_PARTS && !path_check_blend_is_feasible(self, task->slots, self->halt.cycles * part / BLEND_PARTS)) {
        part++;
    }
    self->straight_after = self->halt.cycles * part / BLEND_PARTS;
    scurve_plan(&way->path, &limits, least_cycles - self->straight_after);
    self->source = MOTION_HALTING;
    const int64_t cycles = self->straight_after + scurve_cycles(&way->path);
    return cycles > self->halt.cycles ? cycles : self->halt.cycles;
}

static int64_t plan_timed_cycles(motion_t *self, int64_t cycles)
{
    const task_t task = {.slots = AXES_MAX, .is_shifted = true, .target_q32 = self->goal_q32};
    self->source = MOTION_TIMED;
    if (try_quintic(self, &task, cycles)) {
        return cycles;
    }
    if (active_axis_all_at_rest(self, AXES_MAX)) {
        plan_straight(self, AXES_MAX, cycles);
        return scurve_cycles(&self->plan.straight.path);
    }
    return plan_stop_and_straight(self, &task, cycles);
}

void plan_timed(motion_t *self, int64_t asked, bool is_first, uint64_t now_us)
{
    self->planned_slots = AXES_MAX;
    axis_targets_plan(self, self->slot_q32);
    int64_t cycles = plan_timed_cycles(self, asked > 0 ? asked : 1);
    const int64_t fade = is_first ? fade_cycles(&self->fade, &self->fade_limits) : 0;
    cycles = fade > cycles ? fade : cycles;
    self->is_stretched = asked > 0 && cycles > asked;
    self->stretched_count += self->is_stretched;
    self->timed_end_us = now_us + (uint64_t)cycles * self->cycle_us;
}

/* Whether no cylinder could be asked for more than it can do while each of these axes moves as quickly as it may: by what a small
 * way of each axis is for the cylinders at the goal. */
static bool can_axes_go_alone(const motion_t *self)
{
    pose_t pose;
    q32_t at_mm_q32[CYLINDERS_MAX];
    int64_t need_q16[CYLINDERS_MAX][3] = {{0}};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = self->goal_q32[i];
    }
    bool is_reached = kin_inverse(&self->kin, &pose, at_mm_q32) == HV_OK;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t *state = active_axis_state(self, i);
        const ramp_limits_t *axis = active_axis_limits(self, i);
        if (!self->is_axis_moved[i] || (state->pos_q32 == self->goal_q32[i] && ramp_is_at_rest(&self->axis[i]))) {
            continue;
        }
        q32_t there_mm_q32[CYLINDERS_MAX] = {0};
        pose.axis_q32[i] += SMALL_WAY_Q32;
        is_reached = is_reached && kin_inverse(&self->kin, &pose, there_mm_q32) == HV_OK;
        pose.axis_q32[i] -= SMALL_WAY_Q32;
        for (unsigned c = 0; c < self->cylinders && is_reached; c++) {
            const ramp_limits_t *cylinder = &self->cylinder[c].limits;
            const q32_t travel_q32 = fx_abs(there_mm_q32[c] - at_mm_q32[c]) * (Q32_ONE / SMALL_WAY_Q32);
            need_q16[c][0] +=
                fx_mul_div(fx_mul_shift(axis->vel_per_cycle_q32, travel_q32, 32), Q16_ONE, cylinder->vel_per_cycle_q32);
            need_q16[c][1] +=
                fx_mul_div(fx_mul_shift(axis->acc_per_cycle2_q32, travel_q32, 32), Q16_ONE, cylinder->acc_per_cycle2_q32);
            need_q16[c][2] +=
                fx_mul_div(fx_mul_shift(axis->jerk_per_cycle3_q32, travel_q32, 32), Q16_ONE, cylinder->jerk_per_cycle3_q32);
        }
    }
    for (unsigned c = 0; c < self->cylinders; c++) {
        is_reached = is_reached && need_q16[c][0] < Q16_ONE && need_q16[c][1] < Q16_ONE && need_q16[c][2] < Q16_ONE;
    }
    return is_reached;
}

void plan_step(motion_t *self)
{
    self->planned_slots = POSE_AXES;
    axis_targets_plan(self, self->slot_q32);
    if (active_axis_all_at_rest(self, POSE_AXES)) {
        plan_straight(self, POSE_AXES, 1);
        if (fade_in_is_hidden(self)) { /* fading is the move */
            scurve_end(&self->plan.straight.path);
        }
        return;
    }
    if (!self->is_fading && (self->space == MOTION_CYLINDERS || can_axes_go_alone(self))) {
        self->source = MOTION_STREAMED; /* a lone sample: each axis by its own ramp, which is the quickest way in motion */
        return;
    }
    const task_t task = {.slots = POSE_AXES, .is_shifted = true, .target_q32 = self->goal_q32};
    (void)plan_stop_and_straight(self, &task, 1);
}

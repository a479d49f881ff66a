/* SPDX-License-Identifier: MIT
 * plan.c - ways to a target that all slots go together.
 *
 * A quintic is tried for longer and longer times until axes and cylinders keep their limits. Towards a target that moves it is
 * planned for the error: the reference moves on by itself and the quintic fades the difference out. Of the acceleration and the
 * jerk it may use what such a reference leaves, but a third at least; what that turns out to be too much, the next plan mends.
 */
#include "plan.h"

#include "past.h"
#include "slot.h"
#include "slots.h"
#include "way.h"

#define SHORTEST_CYCLES 32
#define ATTEMPTS        34               /* each an eighth longer: up to 50 times the first ... */
#define ATTEMPTS_POSE   48               /* ... 250 times where a stream of poses can be met in no other way */
#define START_SLACK_Q32 (Q32_ONE / 1000) /* rounding of a quintic's first points */
#define JOIN_MAX_US     600000           /* a longer quintic swings out further than it is worth */

/* What a quintic is looked for. Where it starts and what limits it are worked out where they are needed: they would lie on the
 * stack under everything that an attempt calls. */
typedef struct {
    unsigned slots;
    bool is_shifted; /* the intensity moves slots by itself, which is not for the plan to do */
    const q32_t *target_q32;
    const ramp_ref_t *curve; /* what the target moves with, NULL where it rests */
    bool stays_near;         /* goes no further than the stop in self->aside.halt */
} task_t;

/* A state of the cycle before, less what something else adds to the plan: its reference is that of this cycle already. */
static ramp_state_t seen_from(const ramp_state_t *state, const ramp_ref_t *ref)
{
    const ramp_state_t base = past_state(ref);
    return (ramp_state_t){state->pos_q32 - base.pos_q32, state->vel_per_cycle_q32 - base.vel_per_cycle_q32,
                          state->acc_per_cycle2_q32 - base.acc_per_cycle2_q32};
}

/* Where a slot starts, seen from what the target moves with. */
static ramp_state_t start_of(const motion_t *self, const task_t *task, unsigned i)
{
    ramp_state_t start = *slot_state(self, i);
    if (task->is_shifted) {
        const ramp_ref_t shift = intensity_shift(&self->intensity, self->timed_share_q46, self->timed_way_q32[i]);
        start = seen_from(&start, &shift);
    }
    return task->curve != NULL ? seen_from(&start, &task->curve[i]) : start;
}

/* Where cylinders led beyond an axis' range, the way back begins there. */
static void include_start(ramp_limits_t *limits, q32_t start_q32)
{
    limits->pos_min_q32 = fx_clamp(start_q32 - START_SLACK_Q32, INT64_MIN, limits->pos_min_q32);
    limits->pos_max_q32 = fx_clamp(start_q32 + START_SLACK_Q32, limits->pos_max_q32, INT64_MAX);
}

/* The longer a quintic is, the further the acceleration it starts with carries it: planned anew with each sample such ways swing
 * out ever further. Where none stays between start and target, or where the quickest stop ends, that stop is the better way. */
static void stay_near(ramp_limits_t *limits, q32_t from_q32, q32_t to_q32, q32_t rest_q32)
{
    const q32_t low_q32 = fx_clamp(to_q32, INT64_MIN, from_q32 < rest_q32 ? from_q32 : rest_q32);
    const q32_t high_q32 = fx_clamp(to_q32, from_q32 > rest_q32 ? from_q32 : rest_q32, INT64_MAX);
    limits->pos_min_q32 = fx_clamp(low_q32 - START_SLACK_Q32, limits->pos_min_q32, INT64_MAX);
    limits->pos_max_q32 = fx_clamp(high_q32 + START_SLACK_Q32, INT64_MIN, limits->pos_max_q32);
}

/* The limits of a slot, less what a target that moves takes of them. */
static ramp_limits_t limits_of(const motion_t *self, const task_t *task, unsigned i)
{
    ramp_limits_t limits = *slot_limits(self, i);
    if (task->curve != NULL) {
        limits.jerk_per_cycle3_q32 -= limits.jerk_per_cycle3_q32 / 4;
        limits.pos_min_q32 = INT64_MIN / 4; /* where the target will be is not known: the ramps keep the bounds */
        limits.pos_max_q32 = INT64_MAX / 4;
        return limits;
    }
    const q32_t start_q32 = start_of(self, task, i).pos_q32;
    include_start(&limits, start_q32);
    if (task->stays_near) {
        stay_near(&limits, start_q32, task->target_q32[i], self->aside.halt.rest_q32[i]);
    }
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

/* Adds what the target moves with, or takes it off again. */
static void add_curve(motion_t *self, const task_t *task, int sign)
{
    for (unsigned i = 0; task->curve != NULL && i < task->slots; i++) {
        const ramp_state_t base = past_state(&task->curve[i]);
        quintic_add_motion(&self->plan.quintic, i, &base, sign);
    }
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
    add_curve(self, task, 1);
    if (!keeps_limits(self, task) || (self->space == MOTION_POSE && !way_is_feasible(self, &self->plan.quintic))) {
        return false;
    }
    add_curve(self, task, -1);
    return true;
}

static bool find_shortest(motion_t *self, const task_t *task, int64_t least, int64_t most, int attempts)
{
    int64_t cycles = least > SHORTEST_CYCLES ? least : SHORTEST_CYCLES;
    for (int attempt = 0; attempt < attempts && cycles <= most; attempt++) {
        if (try_quintic(self, task, cycles)) {
            return true;
        }
        cycles += cycles / 8;
    }
    return false;
}

static int attempts_in(const motion_t *self)
{
    return self->space == MOTION_POSE ? ATTEMPTS_POSE : ATTEMPTS;
}

bool plan_join(motion_t *self, const ramp_ref_t *curve)
{
    static const q32_t k_no_difference_q32[POSE_AXES] = {0};
    const task_t task = {.slots = POSE_AXES, .target_q32 = k_no_difference_q32, .curve = curve};
    return find_shortest(self, &task, 1, JOIN_MAX_US / (int64_t)self->cycle_us, attempts_in(self));
}

/* A stop from where a task starts. */
static void halt_within(motion_t *self, const task_t *task, const ramp_limits_t *const *limits)
{
    halt_t *halt = &self->aside.halt;
    for (unsigned i = 0; i < task->slots; i++) {
        halt->start[i] = start_of(self, task, i);
    }
    halt_plan(halt, task->slots, POSE_AXES, halt->start, limits);
}

/* Within the task's own limits. */
HV_OWN_FRAME static void halt_task(motion_t *self, const task_t *task)
{
    limits_t limits;
    set_limits(self, task, &limits);
    halt_within(self, task, limits.list);
}

/* Within those of the slots. */
HV_OWN_FRAME static void halt_slots(motion_t *self, const task_t *task)
{
    const ramp_limits_t *limits[AXES_MAX];
    for (unsigned i = 0; i < task->slots; i++) {
        limits[i] = slot_limits(self, i);
    }
    halt_within(self, task, limits);
}

void plan_halt(motion_t *self)
{
    const task_t task = {.slots = POSE_AXES};
    halt_slots(self, &task);
}

bool plan_shortest(motion_t *self, const q32_t target_q32[AXES_MAX])
{
    task_t task = {.slots = POSE_AXES, .target_q32 = target_q32};
    if (self->space == MOTION_CYLINDERS) { /* of poses a stop need not be what the cylinders can do */
        halt_task(self, &task);
        task.stays_near = true;
    }
    return find_shortest(self, &task, 1, INT64_MAX, attempts_in(self));
}

/* The straight way between two points of the slots, as a path with the limits of axes and cylinders. */
static path_limits_t limits_of_straight(const motion_t *self, unsigned slots, const q32_t *from_q32)
{
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < slots; i++) {
        path_limits_narrow(&limits, self->goal_q32[i] - from_q32[i], slot_limits(self, i));
    }
    if (self->space == MOTION_POSE) {
        way_narrow(self, from_q32, self->goal_q32, &limits);
    }
    return limits;
}

void plan_straight(motion_t *self, unsigned slots, int64_t least_cycles)
{
    self->timed_share_q46 = self->intensity.share_q46[0];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->plan.straight.history[i] = *slot_state(self, i);
        self->plan.straight.from_q32[i] = self->plan.straight.history[i].pos_q32;
        self->plan.straight.to_q32[i] = self->goal_q32[i];
    }
    const path_limits_t limits = limits_of_straight(self, slots, self->plan.straight.from_q32);
    scurve_plan(&self->plan.straight.path, &limits, least_cycles);
    self->source = MOTION_STRAIGHT;
}

/* A stop first, then the straight way; the cycles of both. */
static int64_t plan_stop_then_straight(motion_t *self, const task_t *task)
{
    halt_slots(self, task);
    const path_limits_t path = limits_of_straight(self, task->slots, self->aside.halt.rest_q32);
    scurve_plan(&self->plan.straight.path, &path, 1);
    self->straight_cycles = scurve_cycles(&self->plan.straight.path);
    return self->aside.halt.cycles + 1 + self->straight_cycles;
}

/* In motion: the shorter one of a quintic of at least so many cycles and a stop with a straight way. The cycles it takes. */
static int64_t plan_quickest(motion_t *self, const task_t *task, int64_t least)
{
    const int64_t in_two_parts = plan_stop_then_straight(self, task);
    self->source = MOTION_TIMED;
    const int64_t from = least > in_two_parts / 4 ? least : in_two_parts / 4; /* none is shorter than that */
    if (find_shortest(self, task, from, in_two_parts, ATTEMPTS)) {
        return self->plan.quintic.cycles;
    }
    self->source = MOTION_HALTING;
    return in_two_parts;
}

static int64_t plan_timed_cycles(motion_t *self, int64_t cycles)
{
    const task_t task = {.slots = AXES_MAX, .is_shifted = true, .target_q32 = self->goal_q32};
    self->source = MOTION_TIMED;
    if (try_quintic(self, &task, cycles)) {
        return cycles;
    }
    if (slot_all_at_rest(self, AXES_MAX)) {
        plan_straight(self, AXES_MAX, cycles);
        return scurve_cycles(&self->plan.straight.path);
    }
    if (plan_stop_then_straight(self, &task) <= cycles) {
        self->source = MOTION_HALTING;
        self->straight_cycles = cycles - self->aside.halt.cycles - 1;
        return cycles;
    }
    return plan_quickest(self, &task, cycles);
}

void plan_timed(motion_t *self, int64_t asked, bool is_first, uint64_t now_us)
{
    self->planned_slots = AXES_MAX;
    slots_plan(self, self->slot_q32);
    int64_t cycles = plan_timed_cycles(self, asked > 0 ? asked : 1);
    if (is_first && scurve_cycles(&self->blend) > cycles) {
        cycles = scurve_cycles(&self->blend);
    }
    self->is_stretched = asked > 0 && cycles > asked;
    self->stretched_count += self->is_stretched;
    self->timed_end_us = now_us + (uint64_t)cycles * self->cycle_us;
}

void plan_step(motion_t *self)
{
    self->planned_slots = POSE_AXES;
    slots_plan(self, self->slot_q32);
    if (slot_all_at_rest(self, POSE_AXES)) {
        plan_straight(self, POSE_AXES, 1);
        return;
    }
    const task_t task = {.slots = POSE_AXES, .is_shifted = true, .target_q32 = self->goal_q32};
    (void)plan_quickest(self, &task, 1);
}

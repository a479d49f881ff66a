/* SPDX-License-Identifier: MIT
 * plan.c - ways to a target that all slots go together.
 *
 * A quintic is tried for longer and longer times until axes and cylinders keep their limits. Towards a target that moves it is
 * planned for the error: the reference moves on by itself and the quintic fades the difference out. Of the acceleration and the
 * jerk it may use what such a reference leaves, but a third at least; what that turns out to be too much, the next plan mends.
 */
#include "plan.h"

#include "slot.h"
#include "slots.h"
#include "way.h"

#define SHORTEST_CYCLES 32
#define ATTEMPTS        34               /* each an eighth longer: up to 50 times the first ... */
#define ATTEMPTS_POSE   48               /* ... 250 times where a stream of poses can be met in no other way */
#define START_SLACK_Q32 (Q32_ONE / 1000) /* rounding of a quintic's first points */
#define JOIN_MAX_US     600000           /* a longer quintic swings out further than it is worth */

/* Limits of a quintic's slots, less what a moving base takes of them. */
typedef struct {
    ramp_limits_t own[AXES_MAX];
    const ramp_limits_t *list[AXES_MAX];
} plan_limits_t;

/* Where cylinders led beyond an axis' range, the way back begins there. */
static void include_start(ramp_limits_t *limits, q32_t start_q32)
{
    limits->pos_min_q32 = fx_clamp(start_q32 - START_SLACK_Q32, INT64_MIN, limits->pos_min_q32);
    limits->pos_max_q32 = fx_clamp(start_q32 + START_SLACK_Q32, limits->pos_max_q32, INT64_MAX);
}

static void limits_beside(const motion_t *self, unsigned slots, const ramp_state_t *start, const ramp_state_t *base,
                          plan_limits_t *limits)
{
    for (unsigned i = 0; i < slots; i++) {
        ramp_limits_t *own = &limits->own[i];
        *own = *slot_limits(self, i);
        limits->list[i] = own;
        include_start(own, start[i].pos_q32);
        if (base != NULL) {
            own->jerk_per_cycle3_q32 -= own->jerk_per_cycle3_q32 / 4;
            own->pos_min_q32 = INT64_MIN / 4; /* where the base will be is not known: the ramps keep the bounds */
            own->pos_max_q32 = INT64_MAX / 4;
        }
    }
}

/* Plans self->quintic; false where an axis or a cylinder would break its limits, with what its base adds where it has one. */
static bool try_quintic(motion_t *self, unsigned slots, const ramp_state_t *start, const q32_t *target_q32,
                        const ramp_state_t *base, const plan_limits_t *limits, int64_t cycles)
{
    quintic_t *quintic = &self->quintic;
    if (quintic_plan(quintic, slots, start, target_q32, cycles) != HV_OK) {
        return false;
    }
    for (unsigned i = 0; base != NULL && i < slots; i++) {
        quintic_add_motion(quintic, i, &base[i], 1);
    }
    if (!quintic_is_feasible(quintic, limits->list) || (self->space == MOTION_POSE && !way_is_feasible(self, quintic))) {
        return false;
    }
    for (unsigned i = 0; base != NULL && i < slots; i++) {
        quintic_add_motion(quintic, i, &base[i], -1);
    }
    return true;
}

static bool find_shortest(motion_t *self, const plan_limits_t *limits, unsigned slots, const ramp_state_t *start,
                          const q32_t *target_q32, const ramp_state_t *base, int64_t least, int64_t most, int attempts)
{
    int64_t cycles = least > SHORTEST_CYCLES ? least : SHORTEST_CYCLES;
    for (int attempt = 0; attempt < attempts && cycles <= most; attempt++) {
        if (try_quintic(self, slots, start, target_q32, base, limits, cycles)) {
            return true;
        }
        cycles += cycles / 8;
    }
    return false;
}

/* The longer a quintic is, the further the acceleration it starts with carries it: planned anew with each sample such ways swing
 * out ever further. Where none stays between start and target, or where the quickest stop ends, that stop is the better way. */
static void stay_near(motion_t *self, const ramp_state_t *start, const q32_t *target_q32, plan_limits_t *limits)
{
    halt_plan(&self->aside.halt, POSE_AXES, POSE_AXES, start, limits->list);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q32_t from_q32 = start[i].pos_q32;
        const q32_t rest_q32 = self->aside.halt.rest_q32[i];
        const q32_t low_q32 = fx_clamp(target_q32[i], INT64_MIN, from_q32 < rest_q32 ? from_q32 : rest_q32);
        const q32_t high_q32 = fx_clamp(target_q32[i], from_q32 > rest_q32 ? from_q32 : rest_q32, INT64_MAX);
        ramp_limits_t *own = &limits->own[i];
        own->pos_min_q32 = fx_clamp(low_q32 - START_SLACK_Q32, own->pos_min_q32, INT64_MAX);
        own->pos_max_q32 = fx_clamp(high_q32 + START_SLACK_Q32, INT64_MIN, own->pos_max_q32);
    }
}

bool plan_shortest(motion_t *self, const ramp_state_t *start, const q32_t *target_q32, const ramp_state_t *base, int64_t least)
{
    const int64_t most = base != NULL ? JOIN_MAX_US / (int64_t)self->cycle_us : INT64_MAX;
    const int attempts = self->space == MOTION_POSE ? ATTEMPTS_POSE : ATTEMPTS;
    plan_limits_t limits;
    limits_beside(self, POSE_AXES, start, base, &limits);
    if (base == NULL && self->space == MOTION_CYLINDERS) { /* of poses a stop need not be what the cylinders can do */
        stay_near(self, start, target_q32, &limits);
    }
    return find_shortest(self, &limits, POSE_AXES, start, target_q32, base, least, most, attempts);
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
        self->path_history[i] = *slot_state(self, i);
        self->path_from_q32[i] = self->path_history[i].pos_q32;
        self->path_to_q32[i] = self->goal_q32[i];
    }
    const path_limits_t limits = limits_of_straight(self, slots, self->path_from_q32);
    scurve_plan(&self->path, &limits, least_cycles);
    self->source = MOTION_STRAIGHT;
}

/* A stop first, then the straight way; the cycles of both. */
static int64_t plan_stop_then_straight(motion_t *self, unsigned slots, const ramp_state_t *start)
{
    const ramp_limits_t *limits[AXES_MAX];
    for (unsigned i = 0; i < slots; i++) {
        limits[i] = slot_limits(self, i);
    }
    halt_plan(&self->aside.halt, slots, POSE_AXES, start, limits);
    const path_limits_t path = limits_of_straight(self, slots, self->aside.halt.rest_q32);
    scurve_plan(&self->path, &path, 1);
    self->straight_cycles = scurve_cycles(&self->path);
    return self->aside.halt.cycles + 1 + self->straight_cycles;
}

/* In motion: the shorter one of a quintic of at least so many cycles and a stop with a straight way. The cycles it takes. */
static int64_t plan_quickest(motion_t *self, unsigned slots, const ramp_state_t *start, const plan_limits_t *limits,
                             int64_t least)
{
    const int64_t in_two_parts = plan_stop_then_straight(self, slots, start);
    self->source = MOTION_TIMED;
    const int64_t from = least > in_two_parts / 4 ? least : in_two_parts / 4; /* none is shorter than that */
    if (find_shortest(self, limits, slots, start, self->goal_q32, NULL, from, in_two_parts, ATTEMPTS)) {
        return self->quintic.cycles;
    }
    self->source = MOTION_HALTING;
    return in_two_parts;
}

/* The states a plan starts from: less what the intensity moves by itself. */
static void copy_states(const motion_t *self, unsigned slots, ramp_state_t *state)
{
    for (unsigned i = 0; i < slots; i++) {
        const ramp_ref_t shift = intensity_shift(&self->intensity, self->timed_share_q46, self->timed_way_q32[i]);
        state[i] = *slot_state(self, i);
        state[i].vel_per_cycle_q32 -= shift.vel_per_cycle_q32;
        state[i].acc_per_cycle2_q32 -= shift.acc_per_cycle2_q32;
    }
}

static int64_t plan_timed_cycles(motion_t *self, int64_t cycles)
{
    ramp_state_t start[AXES_MAX];
    plan_limits_t limits;
    copy_states(self, AXES_MAX, start);
    limits_beside(self, AXES_MAX, start, NULL, &limits);
    self->source = MOTION_TIMED;
    if (try_quintic(self, AXES_MAX, start, self->goal_q32, NULL, &limits, cycles)) {
        return cycles;
    }
    if (slot_all_at_rest(self, AXES_MAX)) {
        plan_straight(self, AXES_MAX, cycles);
        return scurve_cycles(&self->path);
    }
    if (plan_stop_then_straight(self, AXES_MAX, start) <= cycles) {
        self->source = MOTION_HALTING;
        self->straight_cycles = cycles - self->aside.halt.cycles - 1;
        return cycles;
    }
    return plan_quickest(self, AXES_MAX, start, &limits, cycles);
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
    ramp_state_t start[AXES_MAX];
    plan_limits_t limits;
    copy_states(self, POSE_AXES, start);
    limits_beside(self, POSE_AXES, start, NULL, &limits);
    (void)plan_quickest(self, POSE_AXES, start, &limits, 1);
}

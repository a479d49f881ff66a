/* SPDX-License-Identifier: MIT
 * sync_stop.c - the quickest stop of several axes together.
 *
 * With n1, n2, n3 cycles of change, hold and take-back the acceleration runs from a straight to the plateau p, stays there and
 * falls straight to 0. Its sum has to be -v:  p = -(2 v + a (n1 - 1)) / (n1 + 2 n2 + n3).  Limits: |p| <= A, |p| <= n3 J,
 * |p - a| <= n1 J. For given n1 and n3 each of them is a bound of the divisor, so the shortest n2 is found directly, and the
 * shortest stop by a search along n1 and n3 with halved steps.
 */
#include "heave/sync_stop.h"
#include "heave/profile.h"

#define NONE_CYCLES     ((int64_t)1 << 40)
#define FURTHEST_Q32    ((q32_t)1 << 52) /* a million mm or degrees */
#define ROUNDS_PER_STEP 8

/* Data for the stop of one axis. The limits are a little smaller than allowed, because of rounding. */
typedef struct {
    q32_t vel_q32, acc_q32; /* turned so that vel is not negative */
    q32_t acc_max_q32, jerk_q32;
} need_t;

static need_t need_of(const ramp_state_t *start, const ramp_limits_t *limits)
{
    const q32_t acc_q32 = ramp_safe_acceleration(limits);
    const q32_t jerk_q32 = limits->jerk_per_cycle3_q32;
    const int sign = start->vel_per_cycle_q32 < 0 ? -1 : 1;
    return (need_t){sign * start->vel_per_cycle_q32, sign * start->acc_per_cycle2_q32, acc_q32 - acc_q32 / 64 - 1,
                    jerk_q32 - jerk_q32 / 128 - 4};
}

static bool is_resting(const need_t *need)
{
    return need->vel_q32 == 0 && need->acc_q32 == 0;
}

static q32_t at_most(q32_t a, q32_t b)
{
    return a < b ? a : b;
}

static int64_t divide_up(q32_t a, q32_t b)
{
    return a <= 0 ? 0 : a / b + (a % b != 0);
}

/* Narrows the range of the divisor n1 + 2 n2 + n3 to what one axis allows. */
static void narrow(const need_t *need, int64_t change, int64_t back, int64_t *least, int64_t *most)
{
    const q32_t push_q32 = 2 * need->vel_q32 + need->acc_q32 * (change - 1);
    const int sign = push_q32 < 0 ? -1 : 1; /* the plateau has the opposite sign */
    const q32_t size_q32 = sign * push_q32;
    const q32_t acc_q32 = sign * need->acc_q32;
    const q32_t reach_q32 = change * need->jerk_q32 - acc_q32; /* largest size of the plateau that the change can reach */
    const q32_t plateau_q32 = at_most(at_most(need->acc_max_q32, back * need->jerk_q32), reach_q32);
    const q32_t left_q32 = -acc_q32 - change * need->jerk_q32; /* its smallest size; at or below 0: no lower bound */
    if (plateau_q32 <= 0) {
        *least = size_q32 > 0 || reach_q32 < 0 ? NONE_CYCLES : *least;
        return;
    }
    const int64_t own_least = divide_up(size_q32, plateau_q32);
    *least = own_least > *least ? own_least : *least;
    if (left_q32 > 0 && size_q32 / left_q32 < *most) {
        *most = size_q32 / left_q32;
    }
}

/* Cycles of the whole stop with these ends; the hold is as short as it can be. NONE_CYCLES where there is none. */
static int64_t cycles_with(const need_t *need, unsigned axes, sync_stop_times_t *times)
{
    int64_t least = times->change + times->back;
    int64_t most = NONE_CYCLES;
    for (unsigned i = 0; i < axes; i++) {
        if (!is_resting(&need[i])) {
            narrow(&need[i], times->change, times->back, &least, &most);
        }
    }
    times->hold = (least - times->change - times->back + 1) / 2;
    const bool fits = least < NONE_CYCLES && times->change + 2 * times->hold + times->back <= most;
    return fits ? times->change + times->hold + times->back : NONE_CYCLES;
}

/* Ends that always do: the acceleration has time for every change there may be. */
static sync_stop_times_t longest_ends(const need_t *need, unsigned axes)
{
    sync_stop_times_t times = {.change = 1, .back = 1};
    for (unsigned i = 0; i < axes; i++) {
        const q32_t acc_q32 = fx_abs(need[i].acc_q32);
        const int64_t back = 1 + divide_up(need[i].acc_max_q32, need[i].jerk_q32);
        const int64_t change = back + 1 + divide_up(acc_q32, need[i].jerk_q32);
        if (!is_resting(&need[i])) {
            times.change = change > times.change ? change : times.change;
            times.back = back > times.back ? back : times.back;
        }
    }
    return times;
}

static bool try_ends(const need_t *need, unsigned axes, sync_stop_times_t *best, int64_t change, int64_t back)
{
    sync_stop_times_t tried = {.change = change > 1 ? change : 1, .back = back > 1 ? back : 1};
    if (cycles_with(need, axes, &tried) >= best->change + best->hold + best->back) {
        return false;
    }
    *best = tried;
    return true;
}

/* One step to shorter or exchanged ends, if any of them helps. */
static bool improve(const need_t *need, unsigned axes, sync_stop_times_t *best, int64_t step)
{
    static const int8_t k_moves[][2] = {{-1, -1}, {-1, 0}, {0, -1}, {1, 1}, {1, 0}, {0, 1}, {1, -1}, {-1, 1}};
    for (unsigned i = 0; i < sizeof k_moves / sizeof k_moves[0]; i++) {
        if (try_ends(need, axes, best, best->change + k_moves[i][0] * step, best->back + k_moves[i][1] * step)) {
            return true;
        }
    }
    return false;
}

static sync_stop_times_t shortest(const need_t *need, unsigned axes)
{
    sync_stop_times_t best = longest_ends(need, axes);
    int64_t step = 1;
    (void)cycles_with(need, axes, &best);
    while (step < best.change) { /* of the longest ends, the change is the longer one */
        step *= 2;
    }
    for (; step > 0; step /= 2) {
        for (int round = 0; round < ROUNDS_PER_STEP && improve(need, axes, &best, step); round++) {}
    }
    return best;
}

/* What the plateau has to make up for, and what it is divided by. */
static q32_t push_of(const ramp_state_t *start, const sync_stop_times_t *t)
{
    return 2 * start->vel_per_cycle_q32 + start->acc_per_cycle2_q32 * (t->change - 1);
}

static int64_t divisor_of(const sync_stop_times_t *t)
{
    return t->change + 2 * t->hold + t->back;
}

/* Distance of the whole stop: the sums of the three phases over speed, acceleration and plateau, the last two in sixths. */
static q32_t distance(const ramp_state_t *start, const sync_stop_times_t *t)
{
    const int64_t n1 = t->change, n2 = t->hold, n3 = t->back;
    const int64_t by_acc = 3 * n1 * (n1 + 1) - (n1 + 1) * (n1 + 2) + 3 * (n1 - 1) * (n2 + n3);
    const int64_t by_plateau =
        (n1 + 1) * (n1 + 2) + 3 * (n1 + 1) * (n2 + n3) + 3 * n2 * (n2 + 1) + 6 * n2 * n3 + 2 * (n3 * n3 - 1);
    const q32_t free_q32 =
        fx_add_sat(fx_mul_div(start->vel_per_cycle_q32, n1 + n2 + n3, 1), fx_mul_div(start->acc_per_cycle2_q32, by_acc, 6));
    if (free_q32 == INT64_MAX || free_q32 == INT64_MIN) {
        return free_q32; /* what the brake takes off it is beyond all bounds as well */
    }
    return fx_sub_sat(free_q32, fx_mul_div(push_of(start, t), by_plateau, 6 * divisor_of(t)));
}

/* Where an axis comes to rest. The state that forward kinematics finds near a singularity can be hundreds of times beyond the
 * limits, and a stop from there further away than anything is: it must not wrap around and look near. */
static q32_t rest_of(const ramp_state_t *start, const sync_stop_times_t *t)
{
    return fx_clamp(fx_add_sat(start->pos_q32, distance(start, t)), -FURTHEST_Q32, FURTHEST_Q32);
}

/* Fastest an axis gets while its acceleration is taken back: v + a^2 / 2 over the slope of the change. Without a change it is
 * beyond every limit (fx_mul_div saturates), and the axis gets times of its own: one at rest none. */
static q32_t fastest(const ramp_state_t *start, const sync_stop_times_t *t)
{
    const q32_t acc_q32 = start->acc_per_cycle2_q32;
    const q32_t fall_q32 = fx_abs(acc_q32 + push_of(start, t) / divisor_of(t));
    const bool is_speeding_up = (start->vel_per_cycle_q32 > 0) == (acc_q32 > 0);
    const q32_t gain_q32 = is_speeding_up ? fx_mul_div(fx_mul_div(acc_q32, t->change, 2), fx_abs(acc_q32), fall_q32) : 0;
    return fx_abs(fx_add_sat(start->vel_per_cycle_q32, gain_q32));
}

/* An axis that goes along with the others would leave its bounds or go too fast. */
static bool is_carried_away(const ramp_state_t *start, const sync_stop_times_t *common, const ramp_limits_t *limits)
{
    const q32_t rest_q32 = rest_of(start, common);
    return rest_q32 < limits->pos_min_q32 || rest_q32 > limits->pos_max_q32 || fastest(start, common) > limits->vel_per_cycle_q32;
}

/* The times of the axes that stop together, and of what moves with them. */
static sync_stop_times_t common_times(unsigned together, const ramp_state_t *start, const ramp_limits_t *const *limits,
                                      const sync_stop_riders_t *riders)
{
    need_t need[AXES_MAX + CYLINDERS_MAX] = {{0}};
    const unsigned count = riders != NULL ? riders->count : 0;
    for (unsigned i = 0; i < together; i++) {
        need[i] = need_of(&start[i], limits[i]);
    }
    for (unsigned i = 0; i < count; i++) {
        need[together + i] = need_of(riders->state[i], riders->limits[i]);
    }
    return shortest(need, together + count);
}

/* The times of one axis. */
static sync_stop_times_t own_times(const sync_stop_times_t *common, bool is_apart, const ramp_state_t *start,
                                   const ramp_limits_t *limits)
{
    if (!is_apart && !is_carried_away(start, common, limits)) {
        return *common;
    }
    const need_t need = need_of(start, limits);
    return shortest(&need, 1);
}

void sync_stop_plan(sync_stop_t *self, unsigned axes, unsigned together, const ramp_state_t *start,
                    const ramp_limits_t *const *limits, const sync_stop_riders_t *riders)
{
    const sync_stop_times_t common = common_times(together, start, limits, riders);
    self->axes = axes;
    self->cycles = 0;
    self->elapsed = 0;
    for (unsigned i = 0; i < axes; i++) {
        sync_stop_times_t *times = &self->times[i];
        *times = own_times(&common, i >= together, &start[i], limits[i]);
        const int64_t cycles = times->change + times->hold + times->back;
        self->start[i] = self->now[i] = start[i];
        self->rest_q32[i] = rest_of(&start[i], times);
        self->cycles = cycles > self->cycles ? cycles : self->cycles;
    }
}

void sync_stop_rests(unsigned axes, const ramp_state_t *start, const ramp_limits_t *const *limits, q32_t *rest_q32)
{
    const sync_stop_times_t common = common_times(axes, start, limits, NULL);
    for (unsigned i = 0; i < axes; i++) {
        const sync_stop_times_t times = own_times(&common, false, &start[i], limits[i]);
        rest_q32[i] = rest_of(&start[i], &times);
    }
}

/* Velocity of an axis k cycles after the start, before the end: v + a c + plateau w, with the sums c and w of the shape. */
static q32_t velocity_after(const sync_stop_t *self, unsigned i, int64_t k)
{
    const sync_stop_times_t *t = &self->times[i];
    const ramp_state_t *start = &self->start[i];
    const int64_t n1 = t->change, n2 = t->hold, n3 = t->back;
    const int64_t in_change = k < n1 ? k : n1;
    const int64_t in_hold = fx_clamp(k - n1, 0, n2);
    const int64_t in_back = k > n1 + n2 ? k - n1 - n2 : 0;
    const int64_t risen = in_change * (in_change + 1); /* in 2 n1 */
    const int64_t fallen = in_back * (in_back + 1);    /* in 2 n3 */
    const int64_t shape = risen * n3 + (in_hold + in_back) * 2 * n1 * n3 - fallen * n1;
    return start->vel_per_cycle_q32 + fx_mul_div(start->acc_per_cycle2_q32, 2 * n1 * in_change - risen, 2 * n1) -
           fx_mul_div(push_of(start, t), shape, 2 * n1 * n3 * divisor_of(t));
}

q32_t sync_stop_velocity(const sync_stop_t *self, unsigned axis, int64_t cycle)
{
    const sync_stop_times_t *t = &self->times[axis];
    return cycle < t->change + t->hold + t->back ? velocity_after(self, axis, cycle) : 0;
}

void sync_stop_step(sync_stop_t *self, ramp_ref_t *ref)
{
    const bool was_done = sync_stop_is_done(self);
    self->elapsed += self->elapsed <= self->cycles ? 1 : 0; /* past the end it does not count for ever */
    for (unsigned i = 0; i < self->axes; i++) {
        const sync_stop_times_t *t = &self->times[i];
        const bool is_ending = self->elapsed >= t->change + t->hold + t->back;
        const q32_t pos_q32 = is_ending ? self->rest_q32[i] : self->now[i].pos_q32 + velocity_after(self, i, self->elapsed);
        const ramp_ref_t rest = {.pos_q32 = pos_q32};
        ref[i] = was_done ? rest : history_advance(&self->now[i], pos_q32);
    }
}

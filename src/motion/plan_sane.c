/* SPDX-License-Identifier: MIT
 * plan_sane.c - whether plans that were loaded may go on; see plan_sane.h.
 */
#include "plan_sane.h"

#include "heave/sane.h"

#define CYCLES_MAX      ((int64_t)1 << 40)
#define COUNT_MAX       ((int64_t)1 << 24)  /* cycles of a part of a move: hours */
#define TOTAL_MAX       (INT64_MAX / 4)     /* running sums go three times as far at most */
#define COEFFICIENT_MAX ((q32_t)1 << 56)    /* see profile.c */
#define STOP_TERM_MAX   ((int64_t)1 << 60)  /* of the products that a velocity in a stop is made of */
#define TRAVEL_MAX_Q32  (SANE_Q32_MAX * 64) /* as far as a small part may be, times their number */
#define PERIOD_MAX_US   (STREAM_PERIOD_MAX_US * 2)

enum { SETTLED_MAX = 8, GAP_MAX = 5 }; /* see spike_filter.c */

static bool is_within(int64_t value, int64_t low, int64_t high)
{
    return value >= low && value <= high;
}

static bool is_history_sane(const history_t *at)
{
    return sane_q32(at->pos_q32) && sane_q32(at->vel_per_cycle_q32) && sane_q32(at->acc_per_cycle2_q32);
}

/* Product of counts; no further than just beyond the limit. */
static int64_t product(int64_t a, int64_t b, int64_t most)
{
    return b > 0 && a > most / b ? most + 1 : a * b;
}

/* Sums of the jerk pattern lie between their ends. */
bool plan_scurve_is_sane(const scurve_t *path)
{
    if (!is_within(path->nj, 1, COUNT_MAX) || !is_within(path->na, 0, COUNT_MAX) || !is_within(path->nv, 0, CYCLES_MAX)) {
        return false;
    }
    const int64_t vel_max = product(path->nj, path->nj + path->na, TOTAL_MAX);
    const int64_t total = product(vel_max, 2 * path->nj + path->na + path->nv, TOTAL_MAX);
    return total <= TOTAL_MAX && path->total == total && is_within(path->elapsed, 0, scurve_cycles(path)) &&
           is_within(path->acc, -path->nj, path->nj) && is_within(path->vel, 0, vel_max) && is_within(path->pos, 0, total);
}

bool plan_straight_is_sane(const motion_straight_t *way)
{
    bool is_sane =
        plan_scurve_is_sane(&way->path) && sane_all_q32(way->from_q32, AXES_MAX) && sane_all_q32(way->to_q32, AXES_MAX);
    for (unsigned i = 0; i < AXES_MAX; i++) {
        is_sane = is_sane && is_history_sane(&way->history[i]);
    }
    return is_sane;
}

/* Of a platform that rests, only where it does. */
static bool is_rest_sane(const motion_straight_t *way)
{
    return sane_all_q32(way->to_q32, AXES_MAX);
}

static bool is_quintic_sane(const quintic_t *plan)
{
    bool is_sane = plan->axes <= AXES_MAX && is_within(plan->cycles, 1, CYCLES_MAX) &&
                   is_within(plan->elapsed, 0, plan->cycles) &&
                   sane_all_q32(plan->start_q32, plan->axes <= AXES_MAX ? plan->axes : 0) &&
                   sane_all_q32(plan->target_q32, plan->axes <= AXES_MAX ? plan->axes : 0);
    for (unsigned i = 0; is_sane && i < plan->axes; i++) {
        is_sane = is_history_sane(&plan->history[i]);
        for (unsigned k = 0; k < 5; k++) {
            is_sane = is_sane && is_within(plan->coefficient_q32[i][k], -COEFFICIENT_MAX, COEFFICIENT_MAX);
        }
    }
    return is_sane;
}

/* Velocities are divided by products of the times, which have to fit. */
static bool are_times_sane(const sync_stop_times_t *t, int64_t cycles)
{
    if (!is_within(t->change, 1, COUNT_MAX) || !is_within(t->back, 1, COUNT_MAX) || !is_within(t->hold, 0, CYCLES_MAX)) {
        return false;
    }
    const int64_t ends = product(2 * t->change, t->back, STOP_TERM_MAX);
    return product(ends, t->change + 2 * t->hold + t->back, STOP_TERM_MAX) <= STOP_TERM_MAX &&
           t->change + t->hold + t->back <= cycles;
}

static bool is_stop_sane(const sync_stop_t *stop)
{
    bool is_sane = stop->axes <= AXES_MAX && is_within(stop->cycles, 1, CYCLES_MAX) && is_within(stop->elapsed, 0, CYCLES_MAX);
    for (unsigned i = 0; is_sane && i < stop->axes; i++) {
        is_sane = are_times_sane(&stop->times[i], stop->cycles) && is_history_sane(&stop->start[i]) &&
                  is_history_sane(&stop->now[i]) && sane_q32(stop->rest_q32[i]);
    }
    return is_sane;
}

bool plan_is_sane(const motion_t *saved)
{
    switch (saved->source) {
    case MOTION_RESTING:
        return is_rest_sane(&saved->plan.straight);
    case MOTION_STOPPING:
        return is_stop_sane(&saved->halt);
    case MOTION_ON_PATH:
    case MOTION_JOGGED:
    case MOTION_STRAIGHT:
        return plan_straight_is_sane(&saved->plan.straight);
    case MOTION_TIMED:
        return is_quintic_sane(&saved->plan.quintic);
    case MOTION_HALTING:
        return is_stop_sane(&saved->halt) && plan_straight_is_sane(&saved->plan.straight);
    case MOTION_STREAMED:
        break;
    }
    return true; /* a stream has no plan */
}

bool fade_is_sane(const fade_t *fade)
{
    bool is_sane = sane_all_q32(fade->from_q32, POSE_AXES) && is_within(fade->plan_travel_mm_q32, 0, TRAVEL_MAX_Q32) &&
                   (fade->least_cycles == 0 || is_within(fade->least_cycles, FADE_CYCLES_MIN, FADE_CYCLES_MAX));
    for (unsigned age = 0; age < sizeof fade->share_q46 / sizeof fade->share_q46[0]; age++) {
        is_sane = is_sane && is_within(fade->share_q46[age], 0, FADE_FULL);
    }
    return is_sane;
}

static bool is_spike_sane(const spike_t *spike)
{
    return spike->axis < POSE_AXES && sane_q32(spike->value_q32) && sane_q32(spike->before_q32);
}

bool spike_filter_is_sane(const spike_filter_t *saved, const spike_filter_t *prepared)
{
    bool is_sane = saved->factor <= SPIKE_FILTER_FACTOR_MAX && saved->settled <= SETTLED_MAX &&
                   saved->period_us <= PERIOD_MAX_US &&
                   (saved->period_us > 0 || (saved->settled == 0 && !saved->is_withholding)) && sane_time(saved->last_us) &&
                   sane_bool(&saved->is_withholding) && sane_bool(&saved->is_step) && sane_time(saved->withheld_us) &&
                   is_within(saved->withheld_periods, 0, GAP_MAX) && is_spike_sane(&saved->withheld) &&
                   is_spike_sane(&saved->spike) && sane_all_q32(saved->withheld_q32, POSE_AXES);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        is_sane = is_sane && saved->accel_q32[i] == prepared->accel_q32[i] && is_within(saved->quantum_q32[i], 0, SANE_Q32_MAX);
    }
    for (unsigned age = 0; age < SPIKE_FILTER_HISTORY; age++) {
        is_sane = is_sane && sane_all_q32(saved->past_q32[age], POSE_AXES);
    }
    return is_sane;
}

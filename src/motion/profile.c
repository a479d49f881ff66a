/* SPDX-License-Identifier: MIT
 * profile.c - quintic and S-curve moves of several axes that start and end together.
 *
 * Quintic: with t = cycle / cycles, pos = start + c1 t + ... + c5 t^5 meets position, velocity and acceleration at both ends.
 * Finite differences of its samples never exceed the continuous extremes, so checking those is enough.
 * S-curve: the jerk is +-1 or 0 in each cycle; its triple running sum is an integer, and pos / total is the path exactly.
 * Distance 1 = J nj (nj + na) (2 nj + na + nv); A = J nj; V = A (nj + na).
 */
#include "heave/profile.h"

#define COEFFICIENT_MAX_Q32 ((q32_t)1 << 56) /* leaves room for the factor 60 of the third derivative */
#define CHECK_POINTS        32
#define COARSE_STRIDE       8
#define SPARE_DIV           64

/* Product that saturates: for bounds that may be far beyond what they bound. */
static int64_t product(int64_t a, int64_t b)
{
    const int64_t half = fx_mul_shift(a, b, 1);
    return half >= INT64_MAX / 2 ? INT64_MAX : half <= INT64_MIN / 2 ? INT64_MIN : a * b;
}

/* Velocity as the derivative at the cycle itself: the backward difference lies half a cycle earlier. */
static q32_t central_velocity(const ramp_state_t *state)
{
    return state->vel_per_cycle_q32 + state->acc_per_cycle2_q32 / 2;
}

static bool plan_axis(quintic_t *self, unsigned i, const ramp_state_t *start, q32_t target_q32, int64_t cycles)
{
    const q32_t d = target_q32 - start->pos_q32;
    const q32_t c1 = product(central_velocity(start), cycles);
    const q32_t c2 = product(product(start->acc_per_cycle2_q32, cycles), cycles) / 2;
    if (fx_abs(c1) > COEFFICIENT_MAX_Q32 / 32 || fx_abs(c2) > COEFFICIENT_MAX_Q32 / 32 || fx_abs(d) > COEFFICIENT_MAX_Q32 / 32) {
        return false;
    }
    q32_t *c = self->coefficient_q32[i];
    c[0] = c1;
    c[1] = c2;
    c[2] = 10 * d - 6 * c1 - 3 * c2;
    c[3] = -15 * d + 8 * c1 + 3 * c2;
    c[4] = 6 * d - 3 * c1 - c2;
    self->start_q32[i] = start->pos_q32;
    self->target_q32[i] = target_q32;
    self->history[i] = *start;
    return true;
}

hv_status_t quintic_plan(quintic_t *self, unsigned axes, const ramp_state_t *start, const q32_t *target_q32, int64_t cycles)
{
    self->axes = axes;
    self->cycles = cycles;
    self->elapsed = 0;
    for (unsigned i = 0; i < axes; i++) {
        if (!plan_axis(self, i, &start[i], target_q32[i], cycles)) {
            return HV_ERR_RANGE;
        }
    }
    return HV_OK;
}

/* c[first] + c[first + 1] t + ..., each coefficient times its factor. */
static q32_t polynomial(const q32_t *c, const int64_t *factor, unsigned first, q62_t t_q62)
{
    q32_t sum_q32 = 0;
    for (unsigned i = 5; i > first;) {
        i--;
        sum_q32 = fx_mul_shift(sum_q32, t_q62, 62) + factor[i] * c[i];
    }
    return sum_q32;
}

static const int64_t k_factor_pos[5] = {1, 1, 1, 1, 1};
static const int64_t k_factor_vel[5] = {1, 2, 3, 4, 5};
static const int64_t k_factor_acc[5] = {0, 2, 6, 12, 20};
static const int64_t k_factor_jerk[5] = {0, 0, 6, 24, 60};

/* What a plan may use of a limit. A ramp needs the rest to come back onto a way that rounded positions have led it off: without
 * it, it falls behind in the first cycles, cannot catch up, and overshoots at the end. */
static int64_t less_spare(int64_t limit)
{
    return limit - limit / SPARE_DIV;
}

/* Upper bounds of the derivatives with respect to t. */
typedef struct {
    int64_t vel, acc, jerk;
} bounds_t;

/* The limits of an axis over a move of so many cycles, with 1/64 to spare. */
static bounds_t bounds_of_move(const ramp_limits_t *limits, int64_t cycles)
{
    const int64_t vel = product(limits->vel_per_cycle_q32, cycles);
    const int64_t acc = product(product(ramp_safe_acceleration(limits), cycles), cycles);
    const int64_t jerk = product(product(product(limits->jerk_per_cycle3_q32, cycles), cycles), cycles);
    return (bounds_t){less_spare(vel), less_spare(acc), less_spare(jerk)};
}

static bool is_within_bounds_at(const quintic_t *self, unsigned axis, const bounds_t *bounds, q62_t t_q62)
{
    const q32_t *c = self->coefficient_q32[axis];
    return fx_abs(polynomial(c, k_factor_vel, 0, t_q62)) <= bounds->vel &&
           fx_abs(polynomial(c, k_factor_acc, 1, t_q62)) <= bounds->acc &&
           fx_abs(polynomial(c, k_factor_jerk, 2, t_q62)) <= bounds->jerk;
}

static bool keeps_bounds(const quintic_t *self, unsigned axis, const bounds_t *bounds, int64_t stride)
{
    for (int64_t point = 0; point <= CHECK_POINTS; point += stride) {
        if (!is_within_bounds_at(self, axis, bounds, point * (Q62_ONE / CHECK_POINTS))) {
            return false;
        }
    }
    return true;
}

q32_t quintic_position(const quintic_t *self, unsigned axis, q62_t t_q62)
{
    return self->start_q32[axis] + fx_mul_shift(polynomial(self->coefficient_q32[axis], k_factor_pos, 0, t_q62), t_q62, 62);
}

static bool stays_inside(const quintic_t *self, unsigned axis, const ramp_limits_t *limits)
{
    for (int64_t point = 0; point <= CHECK_POINTS; point++) {
        const q32_t pos_q32 = quintic_position(self, axis, point * (Q62_ONE / CHECK_POINTS));
        if (pos_q32 < limits->pos_min_q32 || pos_q32 > limits->pos_max_q32) {
            return false;
        }
    }
    return true;
}

bool quintic_is_feasible(const quintic_t *self, const ramp_limits_t *const *limits)
{
    bounds_t bounds[AXES_MAX];
    for (unsigned axis = 0; axis < self->axes; axis++) { /* a few points of all axes first: most of what is tried fails there */
        bounds[axis] = bounds_of_move(limits[axis], self->cycles);
        if (!keeps_bounds(self, axis, &bounds[axis], COARSE_STRIDE)) {
            return false;
        }
    }
    for (unsigned axis = 0; axis < self->axes; axis++) {
        if (!keeps_bounds(self, axis, &bounds[axis], 1) || !stays_inside(self, axis, limits[axis])) {
            return false;
        }
    }
    return true;
}

/* Position of an axis in the present cycle. */
static q32_t position_now(const quintic_t *self, unsigned i)
{
    if (self->elapsed >= self->cycles) {
        return self->target_q32[i];
    }
    return quintic_position(self, i, fx_mul_div(self->elapsed, Q62_ONE, self->cycles));
}

void quintic_step(quintic_t *self, ramp_ref_t *ref)
{
    if (quintic_is_done(self)) {
        for (unsigned i = 0; i < self->axes; i++) {
            ref[i] = (ramp_ref_t){.pos_q32 = self->target_q32[i]};
        }
        return;
    }
    self->elapsed++;
    for (unsigned i = 0; i < self->axes; i++) {
        ref[i] = history_advance(&self->history[i], position_now(self, i));
    }
}

path_limits_t path_limits_none(void)
{
    return (path_limits_t){Q62_ONE, Q62_ONE, Q62_ONE};
}

static void narrow(int64_t *limit_q62, q32_t axis_limit_q32, q32_t distance_q32)
{
    const int64_t own_q62 = fx_mul_div(axis_limit_q32, Q62_ONE, distance_q32);
    if (own_q62 < *limit_q62) {
        *limit_q62 = own_q62 > 1 ? own_q62 : 1;
    }
}

void path_limits_narrow(path_limits_t *self, q32_t distance_q32, const ramp_limits_t *limits)
{
    const q32_t length_q32 = fx_abs(distance_q32);
    if (length_q32 == 0) {
        return;
    }
    narrow(&self->vel_q62, less_spare(limits->vel_per_cycle_q32), length_q32);
    narrow(&self->acc_q62, less_spare(ramp_safe_acceleration(limits)), length_q32);
    narrow(&self->jerk_q62, less_spare(limits->jerk_per_cycle3_q32), length_q32);
}

static int64_t divide_up(int64_t a, int64_t b)
{
    return a / b + (a % b != 0);
}

/* Jerk that covers the path in these counts, Q62, rounded up. */
static int64_t jerk_needed_q62(const scurve_t *s)
{
    return divide_up(Q62_ONE, product(product(s->nj, s->nj + s->na), 2 * s->nj + s->na + s->nv));
}

/* Acceleration likewise. */
static int64_t acc_needed_q62(const scurve_t *s)
{
    return divide_up(Q62_ONE, product(s->nj + s->na, 2 * s->nj + s->na + s->nv));
}

/* Largest n for which jerk * factor(n) stays at or below bound; factor is n, n^2 or 2 n^3. Counts stay below 2^20. */
static int64_t largest_count(int64_t jerk_q62, unsigned power, int64_t bound_q62)
{
    int64_t n = 0;
    for (int64_t bit = (int64_t)1 << 20; bit > 0; bit /= 2) {
        int64_t value = product(jerk_q62, power == 3 ? 2 : 1);
        for (unsigned i = 0; i < power; i++) {
            value = product(value, n + bit);
        }
        n += value <= bound_q62 ? bit : 0;
    }
    return n;
}

/* Cycles of full jerk: until the acceleration, the speed or the distance is used up. */
static int64_t jerk_cycles(const path_limits_t *limits)
{
    const int64_t by_acc = largest_count(limits->jerk_q62, 1, limits->acc_q62);
    const int64_t by_vel = largest_count(limits->jerk_q62, 2, limits->vel_q62);
    const int64_t by_distance = largest_count(limits->jerk_q62, 3, Q62_ONE);
    const int64_t least = by_acc < by_vel ? by_acc : by_vel;
    return 1 + (least < by_distance ? least : by_distance);
}

/* Cycles of full acceleration: until the speed or the distance is used up. */
static int64_t acceleration_cycles(const path_limits_t *limits, int64_t nj)
{
    const int64_t by_vel = divide_up(limits->vel_q62, limits->acc_q62) - nj;
    scurve_t probe = {.nj = nj};
    for (int64_t bit = (int64_t)1 << 20; bit > 0; bit /= 2) {
        probe.na += bit;
        probe.na -= acc_needed_q62(&probe) > limits->acc_q62 ? 0 : bit;
    }
    const int64_t by_distance = acc_needed_q62(&probe) > limits->acc_q62 ? probe.na + 1 : 0;
    return fx_clamp(by_vel < by_distance ? by_vel : by_distance, 0, INT32_MAX);
}

/* Cycles of full speed that are left. */
static int64_t cruise_cycles(const path_limits_t *limits, const scurve_t *s)
{
    return fx_clamp(divide_up(Q62_ONE, limits->vel_q62) - 2 * s->nj - s->na, 0, INT32_MAX);
}

/* One cycle of jerk counts four times; up to three cycles of cruise instead may do. Where the jerk is enough, so are acceleration
 * and speed: one cycle of jerk less takes no more of either than there is. */
static void trade_jerk_for_cruise(scurve_t *self, const path_limits_t *limits)
{
    scurve_t traded = *self;
    traded.nj--;
    for (int more = 0; more < 4 && traded.nj > 0; more++) {
        if (jerk_needed_q62(&traded) <= limits->jerk_q62) {
            *self = traded;
            return;
        }
        traded.nv++;
    }
}

/* Each count is rounded up on what those before it leave, in whole numbers: together they need no more than the limits. */
void scurve_plan(scurve_t *self, const path_limits_t *limits, int64_t least_cycles)
{
    *self = (scurve_t){.nj = jerk_cycles(limits)};
    self->na = acceleration_cycles(limits, self->nj);
    self->nv = cruise_cycles(limits, self);
    trade_jerk_for_cruise(self, limits);
    if (scurve_cycles(self) < least_cycles) {
        self->nv += least_cycles - scurve_cycles(self);
    }
    self->total = product(product(self->nj, self->nj + self->na), 2 * self->nj + self->na + self->nv);
}

/* Jerk of a cycle: +1, 0 or -1. */
static int jerk_in_cycle(const scurve_t *s, int64_t k)
{
    const int64_t rise = 2 * s->nj + s->na;
    if (k >= rise + s->nv) {
        return -jerk_in_cycle(s, k - rise - s->nv);
    }
    if (k >= rise) {
        return 0;
    }
    return k < s->nj ? 1 : k < s->nj + s->na ? 0 : -1;
}

void scurve_step(scurve_t *self)
{
    if (scurve_is_done(self)) {
        return;
    }
    self->acc += jerk_in_cycle(self, self->elapsed);
    self->vel += self->acc;
    self->pos += self->vel;
    self->elapsed++;
}

void scurve_end(scurve_t *self)
{
    self->acc = 0;
    self->vel = 0;
    self->pos = self->total;
    self->elapsed = scurve_cycles(self);
}

q32_t scurve_between(const scurve_t *self, q32_t from_q32, q32_t to_q32)
{
    return scurve_is_done(self) ? to_q32 : from_q32 + fx_mul_div(to_q32 - from_q32, self->pos, self->total);
}

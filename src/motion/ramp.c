/* SPDX-License-Identifier: MIT
 * ramp.c - the jerk-limited ramp of one axis.
 *
 * Every cycle chooses the next acceleration; velocity and position are exact sums of it. The choice has two parts.
 *
 * 1. What the reference asks for. Errors against the reference of the cycle before: d = ref - pos, w = vel - ref vel,
 *    b = acc - ref acc. With b' = b + u, w' = w + b', d' = d - w' the law
 *        u = k1 d - k2 w - k3 b,   k1 = g^3, k2 = 3 g^2 - 2 g^3, k3 = 3 g - 3 g^2 + g^3
 *    has its three poles at 1 - g exactly (derived in DESIGN.md); it works inside a boundary layer, so that no chatter arises.
 *    g = 1 is the dead-beat law that ends a move exactly on its target. Outside the layer the next acceleration is the largest
 * from which the quickest stop does not pass the reference (the discrete time-optimal law for a reference that rests).
 *
 * 2. What the limits allow. Every state kept satisfies: the velocity limit holds if the jerk turns full from now on, and so does
 * each position bound (brake.h, exact in integers). The full counter-jerk therefore always is an answer, and the largest allowed
 *    acceleration lies between it and what was asked for. ramp_safe_acceleration() makes the two directions compatible.
 */
#include "heave/ramp.h"

#include "brake.h"
#include "root.h"

/* Boundary layer and gains of a bandwidth: gains in units of 1 / 2^gain_shift, layer sizes in multiples of the jerk limit / 8. */
typedef struct {
    int64_t k1, k2, k3;
    unsigned gain_shift;
    int64_t layer_d, layer_w, layer_b;
} bandwidth_t;

static const bandwidth_t k_bandwidths[] = {
    [RAMP_SOFT] = {.k1 = 1, .k2 = 46, .k3 = 721, .gain_shift = 12, .layer_d = 8 * 4096, .layer_w = 8 * 178, .layer_b = 8 * 11},
    [RAMP_FIRM] = {.k1 = 1, .k2 = 10, .k3 = 37, .gain_shift = 6, .layer_d = 8 * 13, .layer_w = 8 * 3, .layer_b = 7},
};

/* Steps of the root search; the chord of the last bracket is the result. */
#define SOLVER_STEPS 10

#define USE_MEMORY_SHIFT 11 /* 2^11 cycles after which what a reference once took of the jerk counts 1/e */

/* Errors against the reference of the cycle before. */
typedef struct {
    q32_t d, w, b;
} errors_t;

void ramp_adopt(ramp_t *self, const ramp_state_t *state)
{
    const q32_t acc_q32 = fx_clamp(state->acc_per_cycle2_q32, -self->acc_safe_q32, self->acc_safe_q32);
    const q32_t vel_max_q32 = self->limits.vel_per_cycle_q32;
    self->state.pos_q32 = state->pos_q32;
    self->state.acc_per_cycle2_q32 = acc_q32;
    const q32_t gain_q32 = brake_velocity_peak(self, 0, fx_abs(acc_q32));
    self->state.vel_per_cycle_q32 = acc_q32 >= 0 ? fx_clamp(state->vel_per_cycle_q32, -vel_max_q32, vel_max_q32 - gain_q32)
                                                 : fx_clamp(state->vel_per_cycle_q32, gain_q32 - vel_max_q32, vel_max_q32);
}

static errors_t errors_against(const ramp_state_t *state, const ramp_ref_t *ref)
{
    return (errors_t){
        .d = ref->pos_q32 - ref->vel_per_cycle_q32 - state->pos_q32,
        .w = state->vel_per_cycle_q32 - (ref->vel_per_cycle_q32 - ref->acc_per_cycle2_q32),
        .b = state->acc_per_cycle2_q32 - (ref->acc_per_cycle2_q32 - ref->jerk_per_cycle3_q32),
    };
}

static bool is_within(q32_t value_q32, q32_t limit_q32)
{
    return value_q32 <= limit_q32 && value_q32 >= -limit_q32;
}

/* Division by a power of two, to the nearest, ties away from zero: symmetric, so that both directions behave alike. */
static int64_t scale_down(int64_t value, unsigned shift)
{
    const int64_t half = (int64_t)1 << (shift - 1);
    return fx_shift_down(value + half + fx_shift_down(value, 63), shift); /* one less where negative: then down is away */
}

/* Signed distance by which the quickest stop after relative acceleration b' would fall short of the reference. */
static q32_t shortfall(const ramp_t *self, const errors_t *e, q32_t b_next)
{
    const q32_t w_next = e->w + b_next;
    return fx_sub_sat(e->d - w_next, brake_distance(self, w_next, b_next));
}

/* Acceleration, relative to the feed, with which the quickest stop ends on the reference; acc is the present one on the same
 * terms. The stop is that of `relative`. */
static q32_t solve_upwards(const ramp_t *self, const ramp_t *relative, const errors_t *e, q32_t acc_q32, q32_t feed_q32)
{
    const q32_t jerk_q32 = self->limits.jerk_per_cycle3_q32;
    bracket_t k = {.low = fx_clamp(acc_q32 - jerk_q32, -self->acc_safe_q32, self->acc_safe_q32) - feed_q32,
                   .high = fx_clamp(acc_q32 + jerk_q32, -self->acc_safe_q32, self->acc_safe_q32) - feed_q32};
    k.at_low = shortfall(relative, e, k.low);
    k.at_high = shortfall(relative, e, k.high);
    if (k.at_high >= 0) {
        return k.high;
    }
    if (k.at_low <= 0) {
        return k.low;
    }
    for (int step = 0; step < SOLVER_STEPS && k.high - k.low > 1; step++) {
        const q32_t at = bracket_chord(&k);
        bracket_narrow(&k, at, shortfall(relative, e, at));
    }
    return bracket_chord(&k);
}

/* The same towards a reference on either side: downwards is the mirror image, to the bit. */
static q32_t solve_for_stop(const ramp_t *self, const ramp_t *relative, const errors_t *e, q32_t feed_q32)
{
    const q32_t acc_q32 = self->state.acc_per_cycle2_q32;
    const bool is_downwards = e->d != 0 ? e->d < 0 : e->w != 0 ? e->w > 0 : acc_q32 > feed_q32;
    const errors_t mirrored = {.d = -e->d, .w = -e->w, .b = -e->b};
    return is_downwards ? -solve_upwards(self, relative, &mirrored, -acc_q32, -feed_q32)
                        : solve_upwards(self, relative, e, acc_q32, feed_q32);
}

/* The ramp with what a reference in motion leaves of its acceleration and jerk: so much there is for certain, whichever way the
 * difference has to be braked. */
static void beside(const ramp_t *self, q32_t feed_q32, ramp_t *relative)
{
    const q32_t jerk_q32 = self->limits.jerk_per_cycle3_q32;
    const q32_t left_q32 = fx_clamp(jerk_q32 - self->ref_jerk_q32, jerk_q32 / 8, jerk_q32 - jerk_q32 / 4);
    *relative = *self;
    relative->limits.jerk_per_cycle3_q32 = left_q32;
    const q32_t used_q32 = fx_abs(feed_q32) > self->ref_acc_q32 ? fx_abs(feed_q32) : self->ref_acc_q32;
    const q32_t acc_left_q32 = fx_clamp(self->acc_safe_q32 - used_q32, self->acc_safe_q32 / 8, self->acc_safe_q32);
    relative->acc_cycles = fx_clamp(acc_left_q32 / left_q32, 1, self->acc_safe_q32);
    relative->acc_safe_q32 = relative->acc_cycles * left_q32;
    relative->per_jerk_q62 = Q62_ONE / left_q32;
    relative->per_acc_q62 = Q62_ONE / relative->acc_safe_q32;
}

static bool is_at_rest(const ramp_ref_t *ref)
{
    return ref->vel_per_cycle_q32 == 0 && ref->acc_per_cycle2_q32 == 0 && ref->jerk_per_cycle3_q32 == 0;
}

/* True if the dead-beat law (g = 1) meets the reference in three cycles without more jerk than there is. */
static bool can_close_in_three(const errors_t *e, q32_t jerk_q32)
{
    return is_within(e->d, jerk_q32) && is_within(e->w - 2 * e->d, jerk_q32) && is_within(e->d - e->w - e->b, jerk_q32);
}

/* So many eighths of the jerk, which is below 2^43 (ramp_limits_from_units()): a little more, so that all of the last eighth of
 * an eighth is in. */
static q32_t layer_size(q32_t jerk_q32, int64_t eighths)
{
    return fx_shift_down(jerk_q32 * eighths + 32, 3) | 7;
}

static bool is_in_layer(const errors_t *e, q32_t jerk_q32, const bandwidth_t *g)
{
    return is_within(e->d, layer_size(jerk_q32, g->layer_d)) && is_within(e->w, layer_size(jerk_q32, g->layer_w)) &&
           is_within(e->b, layer_size(jerk_q32, g->layer_b));
}

/* |value|, or one less where it is negative. */
static uint64_t size_of(q32_t value_q32)
{
    return (uint64_t)value_q32 ^ (uint64_t)fx_shift_down(value_q32, 63);
}

/* Well inside the layer of the soft bandwidth, as nearly all cycles of a stream are: one test for all three errors, as none is
 * above what their bits are together. */
static bool is_deep_in_soft_layer(const errors_t *e, q32_t jerk_q32)
{
    return ((size_of(e->d) >> 12) | (size_of(e->w) >> 7) | (size_of(e->b) >> 3)) < (uint64_t)jerk_q32;
}

/* The jerk by the law of a bandwidth. */
static inline q32_t by_law(const errors_t *e, const ramp_ref_t *ref, const bandwidth_t *g)
{
    return ref->jerk_per_cycle3_q32 + scale_down(g->k1 * e->d - g->k2 * e->w - g->k3 * e->b, g->gain_shift);
}

/* The jerk that a linear law takes to the reference; false if the reference is too far away for them. */
static inline bool find_by_law(const ramp_t *self, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth, q32_t *wanted_jerk_q32)
{
    const q32_t jerk_q32 = self->limits.jerk_per_cycle3_q32;
    const bool is_firm = bandwidth == RAMP_FIRM || is_at_rest(ref);
    const errors_t e = errors_against(&self->state, ref);
    if (!is_firm && is_deep_in_soft_layer(&e, jerk_q32)) {
        *wanted_jerk_q32 = by_law(&e, ref, &k_bandwidths[RAMP_SOFT]);
        return true;
    }
    if (is_firm && can_close_in_three(&e, jerk_q32)) {
        *wanted_jerk_q32 = ref->acc_per_cycle2_q32 + e.d - e.w - self->state.acc_per_cycle2_q32;
        return true;
    }
    if (is_firm && is_in_layer(&e, jerk_q32, &k_bandwidths[RAMP_FIRM])) {
        *wanted_jerk_q32 = by_law(&e, ref, &k_bandwidths[RAMP_FIRM]);
        return true;
    }
    /* towards a reference in motion the firm law has a wider layer around its own: without it, it would miss that for ever */
    if (is_at_rest(ref) || !is_in_layer(&e, jerk_q32, &k_bandwidths[RAMP_SOFT])) {
        return false;
    }
    *wanted_jerk_q32 = by_law(&e, ref, &k_bandwidths[RAMP_SOFT]);
    return true;
}

/* The acceleration that the quickest stop on the reference begins with. */
static q32_t acceleration_to_stop(const ramp_t *self, const ramp_ref_t *ref)
{
    errors_t e = errors_against(&self->state, ref);
    /* a reference far beyond the limits counts as one that is just beyond them: everything stays in range */
    const q32_t vel_most_q32 = 4 * self->limits.vel_per_cycle_q32;
    const q32_t feed_q32 = fx_clamp(ref->acc_per_cycle2_q32, -self->acc_safe_q32, self->acc_safe_q32);
    e.w = fx_clamp(e.w, -vel_most_q32, vel_most_q32);
    if (is_at_rest(ref)) {
        return solve_for_stop(self, self, &e, 0);
    }
    ramp_t relative;
    beside(self, feed_q32, &relative);
    return feed_q32 + solve_for_stop(self, &relative, &e, feed_q32);
}

/* The acceleration the reference asks for. */
static q32_t wanted_acceleration(const ramp_t *self, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth)
{
    q32_t jerk_q32;
    return find_by_law(self, ref, bandwidth, &jerk_q32) ? self->state.acc_per_cycle2_q32 + jerk_q32
                                                        : acceleration_to_stop(self, ref);
}

/* True if the wanted jerk is within the limits and leads to none of them, whatever comes then: as can be told without
 * working a brake out. With A = acc_safe = N J:
 * - What an acceleration gains until it is taken back, brake_velocity_peak(), is the largest of the straight lines
 *   acc + k acc - J k (k + 1) / 2, and so at most the chord from 0 to A, acc (N + 1) / 2. No speed of a brake is above `peak`.
 * - Taking acc back takes at most N cycles at the peak. The quickest stop from there is symmetric, so that its mean speed is half
 * of the peak, and takes peak / A + N cycles if it gets as far as -A, else at most 2 N. Together that is no farther than 2 N + V
 * / 2 A cycles at the peak; a brake that does not take -A back ends earlier. */
static bool is_free(const ramp_t *self, q32_t jerk_q32)
{
    const ramp_state_t *at = &self->state;
    const ramp_limits_t *limits = &self->limits;
    const q32_t acc_q32 = at->acc_per_cycle2_q32 + jerk_q32;
    const q32_t size_q32 = acc_q32 >= 0 ? acc_q32 : -acc_q32;
    if (size_q32 > self->acc_safe_q32 || !is_within(jerk_q32, limits->jerk_per_cycle3_q32)) {
        return false;
    }
    const q32_t speed_q32 = at->vel_per_cycle_q32 >= 0 ? at->vel_per_cycle_q32 : -at->vel_per_cycle_q32;
    const q32_t peak_q32 = speed_q32 + fx_shift_down(size_q32 * (self->acc_cycles + 1), 1);
    if (peak_q32 > limits->vel_per_cycle_q32 || self->brake_cycles == 0) {
        return false;
    }
    const q32_t reach_q32 = self->brake_cycles * peak_q32;
    const q32_t pos_q32 = at->pos_q32 + at->vel_per_cycle_q32 + acc_q32;
    return limits->pos_max_q32 - pos_q32 >= reach_q32 && pos_q32 - limits->pos_min_q32 >= reach_q32;
}

/* True if after acceleration acc the upper bound can still be kept; sign -1 asks the same of the lower one. */
static bool keeps_bound(const ramp_t *self, q32_t acc_q32, int sign)
{
    const q32_t vel_q32 = self->state.vel_per_cycle_q32 + acc_q32;
    const q32_t pos_q32 = self->state.pos_q32 + vel_q32;
    const q32_t room_q32 = sign > 0 ? self->limits.pos_max_q32 - pos_q32 : pos_q32 - self->limits.pos_min_q32;
    if (room_q32 >= self->brake_reach_q32) {
        return true;
    }
    const bool rises =
        sign * vel_q32 > 0 || (sign * acc_q32 > 0 && brake_velocity_peak(self, sign * vel_q32, sign * acc_q32) > 0);
    return !rises ||
           brake_peak(self, sign * vel_q32, sign * acc_q32) <= room_q32; /* outside: it may come in, but never turns back */
}

/* True if after acceleration acc the ramp can come to rest, acceleration included, before the bound on the side of sign. */
static bool can_rest_inside(const ramp_t *self, q32_t acc_q32, int sign)
{
    const q32_t vel_q32 = self->state.vel_per_cycle_q32 + acc_q32;
    const q32_t pos_q32 = self->state.pos_q32 + vel_q32;
    const q32_t room_q32 = sign > 0 ? self->limits.pos_max_q32 - pos_q32 : pos_q32 - self->limits.pos_min_q32;
    const bool is_outside = room_q32 + sign * vel_q32 < 0;
    const bool is_leaving = sign * vel_q32 <= 0 && sign * acc_q32 <= 0;
    return room_q32 >= self->brake_reach_q32 || is_outside || is_leaving ||
           brake_distance(self, sign * vel_q32, sign * acc_q32) <= room_q32;
}

/* Acceleration towards a bound: at most what the quickest stop on the bound takes. Without this a reference that leads past the
 * bound would only be left when nothing but the full brake helps, and that would throw the ramp back. */
static q32_t stop_on_bound(ramp_t *self, q32_t wanted_q32, int sign)
{
    if (can_rest_inside(self, wanted_q32, sign)) {
        return wanted_q32;
    }
    self->flags |= RAMP_BOUND;
    const ramp_ref_t bound = {.pos_q32 = sign > 0 ? self->limits.pos_max_q32 : self->limits.pos_min_q32};
    const q32_t stopping_q32 = wanted_acceleration(self, &bound, RAMP_FIRM);
    return sign * stopping_q32 < sign * wanted_q32 ? stopping_q32 : wanted_q32;
}

/* Acceleration nearest to the wanted one that keeps the bound on the side of sign; safe is one that does. */
static q32_t limit_by_bound(ramp_t *self, q32_t wanted_q32, q32_t safe_q32, int sign)
{
    if (keeps_bound(self, wanted_q32, sign)) {
        return wanted_q32;
    }
    self->flags |= RAMP_BOUND;
    q32_t good_q32 = safe_q32;
    q32_t bad_q32 = wanted_q32;
    for (int step = 0; step < 10; step++) {
        const q32_t middle_q32 = good_q32 + (bad_q32 - good_q32) / 2;
        if (keeps_bound(self, middle_q32, sign)) {
            good_q32 = middle_q32;
        } else {
            bad_q32 = middle_q32;
        }
    }
    return good_q32;
}

/* Acceleration nearest to the wanted one from which the velocity limit on the side of sign can be kept. */
static q32_t limit_by_speed(ramp_t *self, q32_t wanted_q32, int sign)
{
    const q32_t room_q32 = self->limits.vel_per_cycle_q32 - sign * self->state.vel_per_cycle_q32;
    const q32_t towards_q32 = sign * wanted_q32;
    if (towards_q32 <= 0 || brake_velocity_peak(self, towards_q32, towards_q32) <= room_q32) {
        return wanted_q32;
    }
    self->flags |= RAMP_SPEED;
    return sign * (room_q32 > 0 ? brake_acc_for_velocity_room(self, room_q32) : 0);
}

q32_t ramp_allowed(ramp_t *self, q32_t wanted_q32)
{
    const q32_t acc_q32 = self->state.acc_per_cycle2_q32;
    const q32_t jerk_q32 = self->limits.jerk_per_cycle3_q32;
    const q32_t low_q32 = fx_clamp(acc_q32 - jerk_q32, -self->acc_safe_q32, self->acc_safe_q32);
    const q32_t high_q32 = fx_clamp(acc_q32 + jerk_q32, -self->acc_safe_q32, self->acc_safe_q32);
    if (fx_abs(wanted_q32) > self->acc_safe_q32) {
        self->flags |= RAMP_ACCEL;
    }
    q32_t next_q32 = fx_clamp(wanted_q32, low_q32, high_q32);
    next_q32 = stop_on_bound(self, next_q32, 1);
    next_q32 = stop_on_bound(self, next_q32, -1);
    next_q32 = limit_by_speed(self, next_q32, 1);
    next_q32 = limit_by_speed(self, next_q32, -1);
    next_q32 = fx_clamp(next_q32, low_q32, high_q32);
    next_q32 = limit_by_bound(self, next_q32, low_q32, 1);
    next_q32 = limit_by_bound(self, next_q32, high_q32, -1);
    return next_q32;
}

/* Pulls a reference that lies outside the bounds onto the bound, at rest there. A ramp that is outside itself (it was placed
 * there) may be led in at the reference's pace. */
static ramp_ref_t reference_within_bounds(ramp_t *self, const ramp_ref_t *ref)
{
    const q32_t pos_q32 = self->state.pos_q32;
    const q32_t low_q32 = pos_q32 < self->limits.pos_min_q32 ? pos_q32 : self->limits.pos_min_q32;
    const q32_t high_q32 = pos_q32 > self->limits.pos_max_q32 ? pos_q32 : self->limits.pos_max_q32;
    const q32_t inside_q32 = fx_clamp(ref->pos_q32, low_q32, high_q32);
    if (inside_q32 == ref->pos_q32) {
        return *ref;
    }
    self->flags |= RAMP_CLAMPED;
    return (ramp_ref_t){.pos_q32 = inside_q32};
}

/* Remembers how much of the limits the references take: a reference that has turned sharply will again. */
static void note_use(ramp_t *self, const ramp_ref_t *ref)
{
    const q32_t jerk_q32 = self->ref_jerk_q32 - fx_shift_down(self->ref_jerk_q32, USE_MEMORY_SHIFT);
    const q32_t acc_q32 = self->ref_acc_q32 - fx_shift_down(self->ref_acc_q32, USE_MEMORY_SHIFT);
    self->ref_jerk_q32 = is_within(ref->jerk_per_cycle3_q32, jerk_q32)
                             ? jerk_q32
                             : fx_clamp(fx_abs(ref->jerk_per_cycle3_q32), 0, self->limits.jerk_per_cycle3_q32);
    self->ref_acc_q32 =
        is_within(ref->acc_per_cycle2_q32, acc_q32) ? acc_q32 : fx_clamp(fx_abs(ref->acc_per_cycle2_q32), 0, self->acc_safe_q32);
}

q32_t ramp_advance(ramp_t *self, q32_t acc_q32)
{
    self->state.acc_per_cycle2_q32 = acc_q32;
    self->state.vel_per_cycle_q32 += acc_q32;
    self->state.pos_q32 += self->state.vel_per_cycle_q32;
    return self->state.pos_q32;
}

static bool is_reference_inside(const ramp_t *self, const ramp_ref_t *ref)
{
    return ref->pos_q32 >= self->limits.pos_min_q32 && ref->pos_q32 <= self->limits.pos_max_q32;
}

/* The acceleration of a cycle in which a limit may bind, or the reference is far away. */
HV_OUT_OF_LINE static q32_t aim_with_care(ramp_t *self, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth)
{
    const ramp_ref_t inside = reference_within_bounds(self, ref);
    note_use(self, &inside);
    return ramp_allowed(self, wanted_acceleration(self, &inside, bandwidth));
}

static inline q32_t aim(ramp_t *self, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth)
{
    q32_t jerk_q32;
    self->flags = 0;
    if (!is_reference_inside(self, ref) || !find_by_law(self, ref, bandwidth, &jerk_q32) || !is_free(self, jerk_q32)) {
        return aim_with_care(self, ref, bandwidth);
    }
    note_use(self, ref);
    return self->state.acc_per_cycle2_q32 + jerk_q32;
}

q32_t ramp_step(ramp_t *self, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth)
{
    return ramp_advance(self, aim(self, ref, bandwidth));
}

unsigned ramp_aim_all(ramp_t *ramp, unsigned count, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth, q32_t *acc_q32)
{
    unsigned flags = 0;
    for (unsigned i = 0; i < count; i++) {
        acc_q32[i] = aim(&ramp[i], &ref[i], bandwidth);
        flags |= ramp[i].flags;
    }
    return flags;
}

unsigned ramp_step_all(ramp_t *ramp, unsigned count, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth, q32_t *pos_q32)
{
    unsigned flags = 0;
    for (unsigned i = 0; i < count; i++) {
        pos_q32[i] = ramp_advance(&ramp[i], aim(&ramp[i], &ref[i], bandwidth));
        flags |= ramp[i].flags;
    }
    return flags;
}

q32_t ramp_stop_position(const ramp_t *self)
{
    const q32_t distance_q32 = brake_distance(self, self->state.vel_per_cycle_q32, self->state.acc_per_cycle2_q32);
    return fx_clamp(self->state.pos_q32 + distance_q32, self->limits.pos_min_q32, self->limits.pos_max_q32);
}

/* SPDX-License-Identifier: MIT
 * test_ramp.c - the ramp against hostile references: limits judged by finite differences of the returned positions alone, in
 * integers; its times against the analytic optimum in double precision.
 */
#include "heave/ramp.h"

#include "../../src/motion/brake.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "random.h"
#include "unity.h"

#define UM_Q32 ((q32_t)(4294967296.0 / 1000))

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

static double random_log(double low, double high)
{
    return low * pow(high / low, random_unit());
}

static q16_t q16(double value)
{
    return (q16_t)lround(value * 65536);
}

static q32_t q32(double value)
{
    return (q32_t)llround(value * 4294967296.0);
}

static ramp_limits_t limits_of(double min, double max, double speed, double accel, int32_t jerk, uint32_t cycle_us)
{
    ramp_limits_t limits;
    TEST_ASSERT_EQUAL(HV_OK, ramp_limits_from_units(q16(min), q16(max), q16(speed), q16(accel), jerk, cycle_us, &limits));
    return limits;
}

static ramp_t ramp_of(const ramp_limits_t *limits, q32_t pos_q32)
{
    ramp_t ramp;
    TEST_ASSERT_EQUAL(HV_OK, ramp_init(&ramp, limits, pos_q32));
    return ramp;
}

static ramp_limits_t usual_limits(void)
{
    return limits_of(-500, 500, 400, 3000, 50000, 1000);
}

/* Any settings a platform may have, narrow ranges included. */
static ramp_limits_t random_limits(void)
{
    static const uint32_t k_cycles_us[] = {500, 1000, 2000, 10000};
    const double range = random_log(1, 2000);
    const double middle = (random_unit() - 0.5) * 1000;
    ramp_limits_t limits;
    hv_status_t status = HV_ERR_RANGE;
    while (status != HV_OK) {
        status = ramp_limits_from_units(q16(middle - range / 2), q16(middle + range / 2), q16(random_log(20, 2000)),
                                        q16(random_log(30, 32000)), (int32_t)random_log(500, 500000),
                                        k_cycles_us[random_bits() % 4], &limits);
    }
    return limits;
}

/* ---- the judge: what was returned, and nothing else ---- */

typedef struct {
    const ramp_limits_t *limits;
    ramp_state_t last;
    long cycles;
} judge_t;

static void fail_with(const judge_t *self, const char *what, q32_t value, q32_t limit)
{
    char text[256];
    const ramp_limits_t *l = self->limits;
    snprintf(text, sizeof text, "%s %lld, limit %lld, in cycle %ld (range %lld v %lld a %lld j %lld)", what, (long long)value,
             (long long)limit, self->cycles, (long long)(l->pos_max_q32 - l->pos_min_q32), (long long)l->vel_per_cycle_q32,
             (long long)l->acc_per_cycle2_q32, (long long)l->jerk_per_cycle3_q32);
    TEST_FAIL_MESSAGE(text);
}

static void judge_differences(judge_t *self, q32_t pos_q32)
{
    const q32_t vel = pos_q32 - self->last.pos_q32;
    const q32_t acc = vel - self->last.vel_per_cycle_q32;
    const q32_t jerk = acc - self->last.acc_per_cycle2_q32;
    if (llabs(vel) > self->limits->vel_per_cycle_q32) {
        fail_with(self, "speed", vel, self->limits->vel_per_cycle_q32);
    }
    if (llabs(acc) > self->limits->acc_per_cycle2_q32) {
        fail_with(self, "acceleration", acc, self->limits->acc_per_cycle2_q32);
    }
    if (llabs(jerk) > self->limits->jerk_per_cycle3_q32) {
        fail_with(self, "jerk", jerk, self->limits->jerk_per_cycle3_q32);
    }
    self->last = (ramp_state_t){pos_q32, vel, acc};
    self->cycles++;
}

static void judge(judge_t *self, q32_t pos_q32)
{
    judge_differences(self, pos_q32);
    if (pos_q32 < self->limits->pos_min_q32) {
        fail_with(self, "below", pos_q32, self->limits->pos_min_q32);
    }
    if (pos_q32 > self->limits->pos_max_q32) {
        fail_with(self, "above", pos_q32, self->limits->pos_max_q32);
    }
}

/* ---- hostile references ---- */

/* A value somewhere in the range, on a bound, or far outside. */
static q32_t random_position(const ramp_limits_t *limits)
{
    const double low = (double)limits->pos_min_q32;
    const double range = (double)limits->pos_max_q32 - low;
    switch (random_bits() % 8) {
    case 0:
        return limits->pos_min_q32;
    case 1:
        return limits->pos_max_q32;
    case 2:
        return (q32_t)(low + (random_unit() * 20 - 10) * range);
    default:
        return (q32_t)(low + random_unit() * range);
    }
}

static q32_t random_around(q32_t limit, double factor)
{
    return (q32_t)((random_unit() * 2 - 1) * factor * (double)limit);
}

static ramp_ref_t random_reference(const ramp_limits_t *limits, const ramp_ref_t *last)
{
    const double factor = random_unit() < 0.3 ? 10 : 1;
    switch (random_bits() % 5) {
    case 0: /* a step */
    case 1:
        return (ramp_ref_t){.pos_q32 = random_position(limits)};
    case 2: /* differences that have nothing to do with the position */
        return (ramp_ref_t){random_position(limits), random_around(limits->vel_per_cycle_q32, factor),
                            random_around(limits->acc_per_cycle2_q32, factor),
                            random_around(limits->jerk_per_cycle3_q32, factor)};
    case 3: { /* a line at any speed */
        const q32_t vel = random_around(limits->vel_per_cycle_q32, factor);
        return (ramp_ref_t){last->pos_q32 + vel, vel, 0, 0};
    }
    default: /* a little beside the last one */
        return (ramp_ref_t){.pos_q32 = last->pos_q32 + random_around(limits->jerk_per_cycle3_q32, 20)};
    }
}

/* How the reference goes on inside one phase of a run. */
static void go_on(ramp_ref_t *ref)
{
    ref->vel_per_cycle_q32 += ref->acc_per_cycle2_q32;
    ref->pos_q32 = fx_clamp(ref->pos_q32 + ref->vel_per_cycle_q32, -q32(20000), q32(20000));
}

static void storm(ramp_t *ramp, judge_t *judge_of, int phases, void (*judging)(judge_t *, q32_t))
{
    ramp_ref_t ref = {.pos_q32 = ramp->state.pos_q32};
    for (int phase = 0; phase < phases; phase++) {
        const long cycles = 1 + (long)random_log(1, 400);
        const ramp_bandwidth_t bandwidth = random_bits() % 2 == 0 ? RAMP_SOFT : RAMP_FIRM;
        ref = random_reference(&ramp->limits, &ref);
        for (long i = 0; i < cycles; i++) {
            judging(judge_of, ramp_step(ramp, &ref, bandwidth));
            go_on(&ref);
        }
    }
}

static void test_ramp_step_hostile_references_keep_every_limit(void)
{
    long cycles = 0;
    for (int setting = 0; setting < 300; setting++) {
        const ramp_limits_t limits = random_limits();
        const q32_t start = limits.pos_min_q32 + (q32_t)(random_unit() * (double)(limits.pos_max_q32 - limits.pos_min_q32));
        ramp_t ramp = ramp_of(&limits, start);
        judge_t j = {.limits = &limits, .last = {.pos_q32 = start}};
        storm(&ramp, &j, 120, judge);
        cycles += j.cycles;
    }
    printf("hostile references: %ld cycles\n", cycles);
}

static void test_ramp_step_alternating_bounds_keep_every_limit(void)
{
    for (int setting = 0; setting < 200; setting++) {
        const ramp_limits_t limits = random_limits();
        ramp_t ramp = ramp_of(&limits, limits.pos_min_q32);
        judge_t j = {.limits = &limits, .last = {.pos_q32 = limits.pos_min_q32}};
        const long period = 1 + (long)random_log(1, 1500);
        for (long i = 0; i < 6000; i++) {
            const ramp_ref_t ref = {.pos_q32 = i / period % 2 == 0 ? limits.pos_max_q32 : limits.pos_min_q32};
            judge(&j, ramp_step(&ramp, &ref, RAMP_FIRM));
        }
    }
}

/* The reference runs against the bound at full speed and then, as the ramp has to brake, turns as sharply as it can. */
static void test_ramp_step_turning_before_the_bound_keeps_every_limit(void)
{
    for (int setting = 0; setting < 400; setting++) {
        const ramp_limits_t limits = random_limits();
        ramp_t ramp = ramp_of(&limits, limits.pos_min_q32);
        judge_t j = {.limits = &limits, .last = {.pos_q32 = limits.pos_min_q32}};
        q32_t towards = INT64_MAX / 4;
        for (long i = 0; i < 4000; i++) {
            const ramp_ref_t ref = {.pos_q32 = towards};
            judge(&j, ramp_step(&ramp, &ref, RAMP_FIRM));
            if ((ramp.flags & RAMP_BOUND) != 0 && random_bits() % 8 == 0) {
                towards = -towards;
            }
        }
    }
}

/* Any state, now and then near where a brake of it ends on a bound, and a reference beside it that the law can follow. */
static ramp_ref_t place_anywhere(ramp_t *ramp)
{
    const ramp_limits_t *l = &ramp->limits;
    const double share = random_bits() % 2 == 0 ? 1 : 0.01;
    const q32_t vel = random_around(l->vel_per_cycle_q32, share), acc = random_around(ramp->acc_safe_q32, share);
    const q32_t jerk = l->jerk_per_cycle3_q32;
    const q32_t reach = (q32_t)(random_unit() * 4 * (double)llabs(ramp_stop_position(ramp) - ramp->state.pos_q32));
    const q32_t near = random_bits() % 2 == 0 ? l->pos_max_q32 - reach : l->pos_min_q32 + reach;
    ramp->state = (ramp_state_t){random_bits() % 2 == 0 ? near : random_position(l), vel, acc};
    return (ramp_ref_t){ramp->state.pos_q32 + vel + random_around(jerk, 20), vel + random_around(jerk, 3),
                        acc + random_around(jerk, 1), random_around(jerk, 1)};
}

/* Where nothing can bind a cycle works no brake out. The same ramp, told that it cannot know that, does so in every cycle. */
static void test_ramp_step_without_working_brakes_out_is_the_same(void)
{
    long alike = 0;
    for (int setting = 0; setting < 1500; setting++) {
        const ramp_limits_t limits = random_limits();
        ramp_t quick = ramp_of(&limits, limits.pos_min_q32);
        for (int i = 0; i < 600; i++) {
            const ramp_bandwidth_t bandwidth = random_bits() % 2 == 0 ? RAMP_SOFT : RAMP_FIRM;
            ramp_ref_t ref =
                i % 3 == 0 ? place_anywhere(&quick) : random_reference(&limits, &(ramp_ref_t){.pos_q32 = quick.state.pos_q32});
            ramp_t careful = quick;
            careful.brake_cycles = 0;
            TEST_ASSERT_EQUAL_INT64(ramp_step(&careful, &ref, bandwidth), ramp_step(&quick, &ref, bandwidth));
            careful.brake_cycles = quick.brake_cycles;
            TEST_ASSERT_EQUAL_MEMORY(&careful, &quick, sizeof quick);
            alike += quick.flags == 0;
        }
    }
    TEST_ASSERT_GREATER_THAN(200000, alike);
    printf("the same without working brakes out: 900000 cycles, %ld where nothing bound\n", alike);
}

/* The first acceleration where only one of the errors is not 0, beside a reference that turns the other way. */
static q32_t acceleration_for(const ramp_t *resting, q32_t d, q32_t w, q32_t b, q32_t turn)
{
    ramp_t ramp = *resting;
    const ramp_ref_t ref = {ramp.state.pos_q32 + d - w + b + turn, -w + b + turn, -b + turn, turn};
    (void)ramp_step(&ramp, &ref, RAMP_SOFT);
    return ramp.state.acc_per_cycle2_q32;
}

/* The soft law is asked up to the edge of its layer, and not beyond: there the stop asks for all the jerk. */
static void test_ramp_step_soft_law_holds_up_to_the_edge_of_its_layer(void)
{
    const ramp_limits_t limits = {.pos_min_q32 = q32(-1000),
                                  .pos_max_q32 = q32(1000),
                                  .vel_per_cycle_q32 = q32(1),
                                  .acc_per_cycle2_q32 = q32(0.01),
                                  .jerk_per_cycle3_q32 = q32(0.00005)};
    const ramp_t ramp = ramp_of(&limits, 0);
    const q32_t jerk = ramp.limits.jerk_per_cycle3_q32, turn = jerk / 4;
    const q32_t edge = (4096 * jerk + 4) | 7;
    for (q32_t beside = -5000; beside <= 5000; beside++) {
        const q32_t d = edge + beside, law = turn - llround((double)d / 4096);
        TEST_ASSERT_EQUAL_INT64(beside <= 0 ? law : -jerk, acceleration_for(&ramp, -d, 0, 0, turn));
        TEST_ASSERT_EQUAL_INT64(beside <= 0 ? -law : jerk, acceleration_for(&ramp, d, 0, 0, -turn));
    }
}

static void test_ramp_step_all_is_each_by_itself(void)
{
    enum { RAMPS = 5 };
    for (int setting = 0; setting < 2000; setting++) {
        ramp_t one[RAMPS], all[RAMPS];
        ramp_ref_t ref[RAMPS];
        q32_t pos[RAMPS + 1];
        unsigned flags = 0;
        const unsigned count = (unsigned)(random_bits() % (RAMPS + 1));
        const ramp_bandwidth_t bandwidth = random_bits() % 2 == 0 ? RAMP_SOFT : RAMP_FIRM;
        for (unsigned i = 0; i < RAMPS; i++) {
            const ramp_limits_t limits = random_limits();
            one[i] = ramp_of(&limits, limits.pos_min_q32);
            ref[i] =
                i % 2 == 0 ? place_anywhere(&one[i]) : random_reference(&limits, &(ramp_ref_t){.pos_q32 = one[i].state.pos_q32});
            all[i] = one[i];
            pos[i] = 42;
        }
        pos[RAMPS] = 42;
        const unsigned all_flags = ramp_step_all(all, count, ref, bandwidth, pos);
        for (unsigned i = 0; i < count; i++) {
            TEST_ASSERT_EQUAL_INT64(ramp_step(&one[i], &ref[i], bandwidth), pos[i]);
            flags |= one[i].flags;
        }
        TEST_ASSERT_EQUAL_MEMORY(one, all, sizeof one);
        TEST_ASSERT_EQUAL_UINT(flags, all_flags);
        TEST_ASSERT_EQUAL_INT64(42, pos[count]);
    }
}

static void test_brake_keeps_velocity_is_by_the_peak(void)
{
    for (int setting = 0; setting < 2000; setting++) {
        const ramp_limits_t limits = random_limits();
        const ramp_t ramp = ramp_of(&limits, limits.pos_min_q32);
        for (int i = 0; i < 200; i++) {
            const q32_t vel = random_around(limits.vel_per_cycle_q32, 1), acc = llabs(random_around(ramp.acc_safe_q32, 1));
            const q32_t peak = brake_velocity_peak(&ramp, vel, acc);
            const q32_t beside = (q32_t)random_log(1, (double)limits.vel_per_cycle_q32);
            TEST_ASSERT_TRUE(brake_keeps_velocity(&ramp, vel, acc, peak) && brake_keeps_velocity(&ramp, vel, acc, peak + beside));
            TEST_ASSERT_FALSE(brake_keeps_velocity(&ramp, vel, acc, peak - beside));
        }
    }
}

static void test_ramp_take_over_own_state_keeps_every_limit(void)
{
    for (int setting = 0; setting < 100; setting++) {
        const ramp_limits_t limits = random_limits();
        ramp_t ramp = ramp_of(&limits, limits.pos_min_q32);
        judge_t j = {.limits = &limits, .last = {.pos_q32 = limits.pos_min_q32}};
        for (int change = 0; change < 10; change++) {
            storm(&ramp, &j, 10, judge);
            ramp_t next = ramp_of(&limits, 0);
            ramp_adopt(&next, &ramp.state);
            TEST_ASSERT_EQUAL_MEMORY(&ramp.state, &next.state, sizeof next.state);
            ramp = next;
        }
    }
}

/* Any state at all: speed, acceleration and jerk hold from what was taken over on, and the ramp ends inside and at rest. */
static void test_ramp_take_over_any_state_keeps_differences_and_comes_in(void)
{
    for (int setting = 0; setting < 600; setting++) {
        const ramp_limits_t limits = random_limits();
        ramp_t ramp = ramp_of(&limits, limits.pos_min_q32);
        const ramp_state_t any = {random_position(&limits), random_around(limits.vel_per_cycle_q32, 3),
                                  random_around(limits.acc_per_cycle2_q32, 3)};
        ramp_adopt(&ramp, &any);
        judge_t j = {.limits = &limits, .last = ramp.state};
        TEST_ASSERT_EQUAL_INT64(any.pos_q32, ramp.state.pos_q32);
        storm(&ramp, &j, 40, judge_differences);
        const ramp_ref_t ref = {.pos_q32 = (limits.pos_min_q32 + limits.pos_max_q32) / 2};
        for (long i = 0; i < 4000000 && (!ramp_is_at_rest(&ramp) || ramp.state.pos_q32 != ref.pos_q32); i++) {
            judge_differences(&j, ramp_step(&ramp, &ref, RAMP_FIRM));
        }
        TEST_ASSERT_EQUAL_INT64(ref.pos_q32, ramp.state.pos_q32);
        TEST_ASSERT_TRUE(ramp_is_at_rest(&ramp));
    }
}

static void test_ramp_step_from_outside_never_goes_further_out(void)
{
    for (int setting = 0; setting < 300; setting++) {
        const ramp_limits_t limits = random_limits();
        const q32_t range = limits.pos_max_q32 - limits.pos_min_q32;
        const bool is_above = random_bits() % 2 == 0;
        const q32_t out = (q32_t)(random_log(0.0001, 3) * (double)range);
        const q32_t start = is_above ? limits.pos_max_q32 + out : limits.pos_min_q32 - out;
        ramp_t ramp = ramp_of(&limits, start);
        judge_t j = {.limits = &limits, .last = {.pos_q32 = start}};
        q32_t furthest = out;
        ramp_ref_t ref = {.pos_q32 = start};
        for (int phase = 0; phase < 60; phase++) {
            ref = random_reference(&limits, &ref);
            for (long i = 0; i < 80; i++) {
                const q32_t pos = ramp_step(&ramp, &ref, RAMP_FIRM);
                judge_differences(&j, pos);
                const q32_t outside = is_above ? pos - limits.pos_max_q32 : limits.pos_min_q32 - pos;
                const q32_t other = is_above ? limits.pos_min_q32 - pos : pos - limits.pos_max_q32;
                if (outside > furthest || other > 0) {
                    fail_with(&j, "further out", outside > furthest ? outside : other, furthest);
                }
                furthest = outside > 0 ? outside : 0;
            }
        }
    }
}

/* ---- steps ---- */

/* Shortest time from rest to rest with limited speed, acceleration and jerk. */
static double optimal_s(double distance, double speed, double accel, double jerk)
{
    double rise = speed * jerk >= accel * accel ? accel / jerk + speed / accel : 2 * sqrt(speed / jerk);
    if (distance >= speed * rise) {
        return distance / speed + rise;
    }
    if (distance >= 2 * accel * accel * accel / (jerk * jerk)) {
        const double half = accel / jerk / 2;
        rise = half + sqrt(half * half + distance / accel);
        return 2 * rise;
    }
    return 4 * cbrt(distance / (2 * jerk));
}

/* Cycles until the ramp rests exactly on a step; how far it went beyond. */
static long settle(ramp_t *ramp, q32_t target_q32, ramp_bandwidth_t bandwidth, q32_t *overshoot_q32)
{
    const ramp_ref_t ref = {.pos_q32 = target_q32};
    const int sign = target_q32 >= ramp->state.pos_q32 ? 1 : -1;
    judge_t j = {.limits = &ramp->limits, .last = ramp->state};
    *overshoot_q32 = 0;
    for (long i = 0; i < 2000000; i++) {
        if (ramp_is_at_rest(ramp) && ramp->state.pos_q32 == target_q32) {
            return i;
        }
        const q32_t pos = ramp_step(ramp, &ref, bandwidth);
        judge(&j, pos);
        *overshoot_q32 = sign * (pos - target_q32) > *overshoot_q32 ? sign * (pos - target_q32) : *overshoot_q32;
    }
    TEST_FAIL_MESSAGE("does not come to rest on the target");
    return -1;
}

static void test_ramp_step_long_step_takes_at_most_five_percent_more_than_the_optimum(void)
{
    static const double k_mm[] = {0.01, 0.1, 1, 5, 10, 20, 50, 70, 100, 150, 200, 300, 400, 500, 700, 1000};
    printf("step 400/3000/50000: mm, ms, optimum ms, ratio, overshoot um\n");
    const ramp_limits_t limits = usual_limits();
    for (unsigned i = 0; i < sizeof k_mm / sizeof k_mm[0]; i++) {
        ramp_t ramp = ramp_of(&limits, q32(-500));
        q32_t over;
        const double ms = (double)settle(&ramp, q32(-500 + k_mm[i]), RAMP_FIRM, &over);
        const double best_ms = 1000 * optimal_s(k_mm[i], 400, 3000, 50000);
        printf("  %8.2f %7.0f %8.1f %6.3f %8.4f\n", k_mm[i], ms, best_ms, ms / best_ms, (double)over / UM_Q32);
        if (k_mm[i] >= 50) {
            TEST_ASSERT_TRUE_MESSAGE(ms <= 1.05 * best_ms, "slower than 1.05 x the optimum");
        }
    }
}

static void test_ramp_step_step_overshoots_at_most_a_micrometre(void)
{
    q32_t worst = 0;
    double worst_ratio = 0, sum = 0;
    int counted = 0;
    for (int run = 0; run < 1500; run++) {
        const double speed = random_log(20, 2000), accel = random_log(100, 30000), jerk = floor(random_log(500, 500000));
        ramp_limits_t limits;
        if (ramp_limits_from_units(q16(-1000), q16(1000), q16(speed), q16(accel), (int32_t)jerk, 1000, &limits) != HV_OK) {
            continue;
        }
        const q32_t start = q32(random_unit() * 2000 - 1000), target = q32(random_unit() * 2000 - 1000);
        ramp_t ramp = ramp_of(&limits, start);
        q32_t over;
        const double s = (double)settle(&ramp, target, RAMP_FIRM, &over) / 1000;
        const double best = optimal_s(fabs((double)(target - start)) / 4294967296.0, speed, accel, jerk);
        worst = over > worst ? over : worst;
        if (best > 0.2) {
            worst_ratio = s / best > worst_ratio ? s / best : worst_ratio;
            sum += s / best;
            counted++;
        }
    }
    printf("random steps: worst overshoot %.4f um; time over optimum (> 200 ms): mean %.3f, worst %.3f\n", (double)worst / UM_Q32,
           sum / counted, worst_ratio);
    TEST_ASSERT_TRUE(worst <= UM_Q32);
    TEST_ASSERT_TRUE(worst_ratio < 1.25);
}

static void test_ramp_step_at_rest_stays_exactly_for_a_constant_reference(void)
{
    for (int run = 0; run < 12; run++) {
        const ramp_limits_t limits = run == 0 ? usual_limits() : random_limits();
        ramp_t ramp = ramp_of(&limits, limits.pos_min_q32);
        const q32_t target = fx_clamp(random_position(&limits), limits.pos_min_q32, limits.pos_max_q32);
        const ramp_bandwidth_t bandwidth = run % 2 == 0 ? RAMP_FIRM : RAMP_SOFT;
        q32_t over;
        (void)settle(&ramp, target, bandwidth, &over);
        const ramp_ref_t ref = {.pos_q32 = target};
        for (long i = 0; i < 100000; i++) {
            TEST_ASSERT_EQUAL_INT64(target, ramp_step(&ramp, &ref, bandwidth));
        }
    }
}

static void test_ramp_step_reference_outside_ends_at_rest_on_the_bound(void)
{
    for (int run = 0; run < 100; run++) {
        const ramp_limits_t limits = random_limits();
        ramp_t ramp = ramp_of(&limits, (limits.pos_min_q32 + limits.pos_max_q32) / 2);
        judge_t j = {.limits = &limits, .last = ramp.state};
        const ramp_ref_t ref = {.pos_q32 = limits.pos_max_q32 + 1 + (q32_t)(random_bits() >> 20)};
        for (long i = 0; i < 1000000 && !(ramp.state.pos_q32 == limits.pos_max_q32 && ramp_is_at_rest(&ramp)); i++) {
            judge(&j, ramp_step(&ramp, &ref, RAMP_FIRM));
            TEST_ASSERT_TRUE((ramp.flags & RAMP_CLAMPED) != 0);
        }
        TEST_ASSERT_EQUAL_INT64(limits.pos_max_q32, ramp.state.pos_q32);
        TEST_ASSERT_TRUE(ramp_is_at_rest(&ramp));
    }
}

/* ---- references in motion ---- */

typedef struct {
    double amplitude, rate, phase;
    ramp_state_t last;
} sine_t;

static ramp_ref_t sine_at(sine_t *self, long cycle)
{
    const q32_t pos = q32(self->amplitude * sin(self->rate * (double)cycle + self->phase));
    const q32_t vel = pos - self->last.pos_q32, acc = vel - self->last.vel_per_cycle_q32;
    const ramp_ref_t ref = {pos, vel, acc, acc - self->last.acc_per_cycle2_q32};
    self->last = (ramp_state_t){pos, vel, acc};
    return ref;
}

/* Largest error over so many cycles after the lock-in. */
static q32_t track_sine(const ramp_limits_t *limits, sine_t sine, ramp_bandwidth_t bandwidth, long lock_in)
{
    ramp_t ramp = ramp_of(limits, 0);
    judge_t j = {.limits = limits};
    q32_t worst = 0;
    for (long i = -3; i < 0; i++) {
        (void)sine_at(&sine, i);
    }
    for (long i = 0; i < lock_in + 5000; i++) {
        const ramp_ref_t ref = sine_at(&sine, i);
        const q32_t pos = ramp_step(&ramp, &ref, bandwidth);
        judge(&j, pos);
        const q32_t error = llabs(pos - ref.pos_q32);
        worst = i >= lock_in && error > worst ? error : worst;
    }
    return worst;
}

/* Sines that take half of every limit: from about 0.6 on a ramp that starts from rest may go round them for ever. */
static void test_ramp_step_feasible_sine_is_tracked_exactly(void)
{
    const ramp_limits_t limits = usual_limits();
    q32_t worst_soft = 0;
    for (int run = 0; run < 300; run++) {
        const double hz = random_log(0.05, 8), omega = 2 * acos(-1) * hz;
        double amplitude = 450;
        amplitude = fmin(amplitude, 0.5 * 400 / omega);
        amplitude = fmin(amplitude, 0.5 * 3000 / (omega * omega));
        amplitude = fmin(amplitude, 0.5 * 50000 / (omega * omega * omega));
        const sine_t sine = {.amplitude = amplitude, .rate = omega / 1000, .phase = random_unit() * 6};
        const q32_t firm = track_sine(&limits, sine, RAMP_FIRM, 8000), soft = track_sine(&limits, sine, RAMP_SOFT, 8000);
        worst_soft = soft > worst_soft ? soft : worst_soft;
        if (firm != 0) {
            printf("sine %.3f Hz, %.3f mm: firm error %lld LSB\n", hz, amplitude, (long long)firm);
        }
        TEST_ASSERT_EQUAL_INT64(0, firm);
    }
    printf("feasible sines: firm exact, soft worst %.6f um\n", (double)worst_soft / UM_Q32);
    TEST_ASSERT_TRUE(worst_soft <= UM_Q32 / 100);
}

/* ---- joining a reference that is moving already ---- */

typedef struct {
    double locked, worst; /* share of the cycles from 1.5 s on within 0.01 mm; worst error then, mm */
} joins_t;

/* Random starts beside sines whose speed (power 1), acceleration (2) or jerk (3) peaks at a share of the limit. */
static joins_t join_sines(unsigned power, double share, ramp_bandwidth_t bandwidth)
{
    static const double k_limit[] = {0, 400, 3000, 50000};
    static const double k_omega[] = {0, 4, 9, 18};
    const ramp_limits_t limits = limits_of(-500, 500, 400, 3000, 50000, 1000);
    long locked = 0, cycles = 0;
    joins_t joins = {0};
    for (int run = 0; run < 60; run++) {
        const double omega = k_omega[power] * (0.8 + 0.4 * random_unit());
        sine_t sine = {
            .amplitude = share * k_limit[power] / pow(omega, power), .rate = omega / 1000, .phase = 6.28 * random_unit()};
        ramp_t ramp;
        (void)sine_at(&sine, 0), (void)sine_at(&sine, 1), (void)sine_at(&sine, 2);
        TEST_ASSERT_EQUAL(HV_OK,
                          ramp_init(&ramp, &limits, q32(sine.amplitude * (2 * random_unit() - 1) + 40 * random_unit() - 20)));
        for (long i = 3; i < 5000; i++) {
            const ramp_ref_t ref = sine_at(&sine, i);
            const double error = fabs((double)(ramp_step(&ramp, &ref, bandwidth) - ref.pos_q32)) / 4294967296.0;
            if (i > 1500) {
                cycles++;
                locked += error < 0.01;
                joins.worst = fmax(joins.worst, error);
            }
        }
    }
    joins.locked = (double)locked / (double)cycles;
    return joins;
}

static void test_ramp_step_running_sine_is_joined_without_hunting(void)
{
    static const double k_share[] = {0.3, 0.5, 0.7, 0.8, 0.9, 0.95};
    static const char *const k_name[] = {"", "speed", "acceleration", "jerk"};
    for (unsigned power = 1; power <= 3; power++) {
        for (unsigned i = 0; i < sizeof k_share / sizeof k_share[0]; i++) {
            const joins_t firm = join_sines(power, k_share[i], RAMP_FIRM), soft = join_sines(power, k_share[i], RAMP_SOFT);
            printf("sine at %.2f of the %s limit: on it %.1f %% (firm), %.1f %% (soft) of the time from 1.5 s on; worst %.2f, "
                   "%.2f mm\n",
                   k_share[i], k_name[power], 100 * firm.locked, 100 * soft.locked, firm.worst, soft.worst);
            TEST_ASSERT_TRUE(firm.locked > (k_share[i] < 0.85 ? 0.999 : 0.8) && soft.locked > (k_share[i] < 0.85 ? 0.999 : 0.8));
            TEST_ASSERT_TRUE(firm.worst < 5 && soft.worst < 5);
        }
    }
}

static void test_ramp_step_infeasible_sine_keeps_limits_and_locks_when_it_calms_down(void)
{
    const ramp_limits_t limits = usual_limits();
    for (int run = 0; run < 100; run++) {
        ramp_t ramp = ramp_of(&limits, 0);
        judge_t j = {.limits = &limits};
        sine_t wild = {.amplitude = 50 + 600 * random_unit(), .rate = 0.002 + 0.1 * random_unit(), .phase = 6 * random_unit()};
        for (long i = 0; i < 3000; i++) {
            const ramp_ref_t ref = sine_at(&wild, i);
            judge(&j, ramp_step(&ramp, &ref, RAMP_FIRM));
        }
        sine_t calm = {.amplitude = 40, .rate = 0.004};
        long locked = 0;
        for (long i = 3000; i < 11000; i++) {
            const ramp_ref_t ref = sine_at(&calm, i);
            const q32_t pos = ramp_step(&ramp, &ref, RAMP_FIRM);
            judge(&j, pos);
            locked = pos == ref.pos_q32 ? locked + 1 : 0;
        }
        TEST_ASSERT_TRUE_MESSAGE(locked > 1000, "does not lock on a feasible reference again");
    }
}

static void test_ramp_step_mirrored_references_give_mirrored_positions(void)
{
    for (int setting = 0; setting < 150; setting++) {
        const ramp_limits_t limits = random_limits();
        ramp_limits_t mirrored = limits;
        mirrored.pos_min_q32 = -limits.pos_max_q32;
        mirrored.pos_max_q32 = -limits.pos_min_q32;
        ramp_t a = ramp_of(&limits, limits.pos_min_q32), b = ramp_of(&mirrored, -limits.pos_min_q32);
        ramp_ref_t ref = {.pos_q32 = limits.pos_min_q32};
        for (int phase = 0; phase < 60; phase++) {
            ref = random_reference(&limits, &ref);
            const ramp_bandwidth_t bandwidth = phase % 2 == 0 ? RAMP_SOFT : RAMP_FIRM;
            for (long i = 0; i < 100; i++) {
                const ramp_ref_t opposite = {-ref.pos_q32, -ref.vel_per_cycle_q32, -ref.acc_per_cycle2_q32,
                                             -ref.jerk_per_cycle3_q32};
                TEST_ASSERT_EQUAL_INT64(ramp_step(&a, &ref, bandwidth), -ramp_step(&b, &opposite, bandwidth));
                TEST_ASSERT_EQUAL_UINT(a.flags, b.flags);
                go_on(&ref);
            }
        }
    }
}

/* Cycles of the quickest stop: acceleration to 0, then from the speed that is left. */
static double quickest_stop(const ramp_t *ramp)
{
    const double acc = (double)ramp->state.acc_per_cycle2_q32, jerk = (double)ramp->limits.jerk_per_cycle3_q32;
    const double acc_max = (double)ramp->acc_safe_q32;
    const double speed = fabs((double)ramp->state.vel_per_cycle_q32 + acc * fabs(acc) / (2 * jerk));
    return fabs(acc) / jerk + (speed * jerk >= acc_max * acc_max ? speed / acc_max + acc_max / jerk : 2 * sqrt(speed / jerk));
}

static void test_ramp_stop_position_is_where_the_ramp_comes_to_rest(void)
{
    double worst = 0;
    for (int run = 0; run < 2000; run++) {
        const ramp_limits_t limits = random_limits();
        ramp_t ramp = ramp_of(&limits, limits.pos_min_q32);
        judge_t j = {.limits = &limits, .last = {.pos_q32 = limits.pos_min_q32}};
        storm(&ramp, &j, 6, judge);
        const double least = quickest_stop(&ramp);
        const q32_t stop = ramp_stop_position(&ramp);
        TEST_ASSERT_TRUE(stop >= limits.pos_min_q32 && stop <= limits.pos_max_q32);
        const ramp_ref_t ref = {.pos_q32 = stop};
        long cycles = 0;
        bool is_bounded = false;
        while (cycles < 1000000 && !(ramp_is_at_rest(&ramp) && ramp.state.pos_q32 == stop)) {
            judge(&j, ramp_step(&ramp, &ref, RAMP_FIRM));
            is_bounded |= (ramp.flags & RAMP_BOUND) != 0; /* the bound brakes harder than a stop, and then it has to come back */
            cycles++;
        }
        TEST_ASSERT_EQUAL_INT64(stop, ramp.state.pos_q32);
        TEST_ASSERT_TRUE(ramp_is_at_rest(&ramp));
        worst = !is_bounded && least > 100 && (double)cycles / least > worst ? (double)cycles / least : worst;
    }
    printf("stops of more than 100 cycles: worst time over the quickest %.3f\n", worst);
    TEST_ASSERT_TRUE(worst < 1.3);
}

/* ---- settings ---- */

static void test_ramp_limits_from_units_out_of_range_is_refused(void)
{
    ramp_limits_t limits = {.pos_min_q32 = 77};
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(q16(1), q16(1), q16(1), q16(1), 1000, 1000, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(q16(2), q16(1), q16(1), q16(1), 1000, 1000, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(0, q16(1), 0, q16(1), 1000, 1000, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(0, q16(1), -1, q16(1), 1000, 1000, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(0, q16(1), q16(1), 0, 1000, 1000, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(0, q16(1), q16(1), q16(1), 0, 1000, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(0, q16(1), q16(1), q16(1), 1000, RAMP_CYCLE_MIN_US - 1, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_limits_from_units(0, q16(1), q16(1), q16(1), 1000, RAMP_CYCLE_MAX_US + 1, &limits));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE,
                      ramp_limits_from_units(0, q16(1), q16(1), q16(1), 10, 500, &limits)); /* below the least jerk */
    TEST_ASSERT_EQUAL_INT64(77, limits.pos_min_q32);
}

static void test_ramp_init_limits_that_no_brake_ends_in_are_refused(void)
{
    const ramp_limits_t good = {0, q32(100), q32(0.4), q32(0.003), q32(0.00005)};
    ramp_t ramp = {.state = {.pos_q32 = 77}};
    for (unsigned i = 0; i < 6; i++) {
        ramp_limits_t bad = good;
        bad.pos_max_q32 = i == 0 ? 0 : bad.pos_max_q32;
        bad.vel_per_cycle_q32 = i == 1 ? 0 : i == 2 ? RAMP_JERK_MIN_Q32 * (RAMP_SPEED_PER_JERK_MAX + 1) : bad.vel_per_cycle_q32;
        bad.acc_per_cycle2_q32 = i == 3 ? 0 : bad.acc_per_cycle2_q32;
        bad.jerk_per_cycle3_q32 = i == 4   ? 0
                                  : i == 5 ? RAMP_JERK_MIN_Q32 - 1
                                  : i == 2 ? RAMP_JERK_MIN_Q32
                                           : bad.jerk_per_cycle3_q32;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, ramp_init(&ramp, &bad, 0));
        TEST_ASSERT_EQUAL_INT64(77, ramp.state.pos_q32);
    }
    TEST_ASSERT_EQUAL(HV_OK, ramp_init(&ramp, &good, 0));
}

/* Brakes of hours or years: how far they go is not reckoned in cycles. */
static void test_ramp_init_brakes_beyond_all_counting_are_not_counted(void)
{
    static const q32_t k_accelerations_q32[] = {64, 65536};
    for (unsigned i = 0; i < 2; i++) {
        const ramp_limits_t limits = {.pos_min_q32 = -q32_from_int(1000),
                                      .pos_max_q32 = q32_from_int(1000),
                                      .vel_per_cycle_q32 = q32_from_int(1000),
                                      .acc_per_cycle2_q32 = k_accelerations_q32[i],
                                      .jerk_per_cycle3_q32 = 65536};
        ramp_t ramp = ramp_of(&limits, 0);
        TEST_ASSERT_EQUAL_UINT32(0, ramp.brake_cycles);
        TEST_ASSERT_EQUAL_INT64(0, ramp_step(&ramp, &(ramp_ref_t){0}, RAMP_FIRM));
    }
}

/* A range of next to nothing leaves next to no acceleration, but some. */
static void test_ramp_safe_acceleration_is_never_nothing(void)
{
    const ramp_limits_t narrow = {0, 1, q32(0.4), q32(0.003), 1};
    TEST_ASSERT_EQUAL_INT64(1, ramp_safe_acceleration(&narrow));
}

static void test_ramp_limits_from_units_values_are_per_cycle(void)
{
    const ramp_limits_t limits = limits_of(-1, 3, 400, 3000, 50000, 2000);
    TEST_ASSERT_EQUAL_INT64(q32(-1), limits.pos_min_q32);
    TEST_ASSERT_EQUAL_INT64(q32(3), limits.pos_max_q32);
    TEST_ASSERT_INT64_WITHIN(1, q32(0.8), limits.vel_per_cycle_q32);
    TEST_ASSERT_INT64_WITHIN(1, q32(0.012), limits.acc_per_cycle2_q32);
    TEST_ASSERT_INT64_WITHIN(1, q32(0.0004), limits.jerk_per_cycle3_q32);
    TEST_ASSERT_TRUE(limits.vel_per_cycle_q32 <= q32(0.8) &&
                     limits.jerk_per_cycle3_q32 <= q32(0.0004)); /* never more than asked */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_ramp_step_hostile_references_keep_every_limit);
    RUN_TEST(test_ramp_step_alternating_bounds_keep_every_limit);
    RUN_TEST(test_ramp_step_turning_before_the_bound_keeps_every_limit);
    RUN_TEST(test_ramp_step_without_working_brakes_out_is_the_same);
    RUN_TEST(test_ramp_step_soft_law_holds_up_to_the_edge_of_its_layer);
    RUN_TEST(test_ramp_step_all_is_each_by_itself);
    RUN_TEST(test_brake_keeps_velocity_is_by_the_peak);
    RUN_TEST(test_ramp_take_over_own_state_keeps_every_limit);
    RUN_TEST(test_ramp_take_over_any_state_keeps_differences_and_comes_in);
    RUN_TEST(test_ramp_step_from_outside_never_goes_further_out);
    RUN_TEST(test_ramp_step_long_step_takes_at_most_five_percent_more_than_the_optimum);
    RUN_TEST(test_ramp_step_step_overshoots_at_most_a_micrometre);
    RUN_TEST(test_ramp_step_at_rest_stays_exactly_for_a_constant_reference);
    RUN_TEST(test_ramp_step_reference_outside_ends_at_rest_on_the_bound);
    RUN_TEST(test_ramp_step_feasible_sine_is_tracked_exactly);
    RUN_TEST(test_ramp_step_running_sine_is_joined_without_hunting);
    RUN_TEST(test_ramp_step_infeasible_sine_keeps_limits_and_locks_when_it_calms_down);
    RUN_TEST(test_ramp_step_mirrored_references_give_mirrored_positions);
    RUN_TEST(test_ramp_stop_position_is_where_the_ramp_comes_to_rest);
    RUN_TEST(test_ramp_limits_from_units_out_of_range_is_refused);
    RUN_TEST(test_ramp_init_limits_that_no_brake_ends_in_are_refused);
    RUN_TEST(test_ramp_init_brakes_beyond_all_counting_are_not_counted);
    RUN_TEST(test_ramp_safe_acceleration_is_never_nothing);
    RUN_TEST(test_ramp_limits_from_units_values_are_per_cycle);
    return UNITY_END();
}

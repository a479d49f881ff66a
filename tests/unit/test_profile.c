/* SPDX-License-Identifier: MIT
 * test_profile.c - quintics and S-curves judged by finite differences of their positions and by closed forms in double precision.
 */
#include "heave/profile.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "random.h"
#include "unity.h"

#define AXES 3
#define LSB  4294967296.0

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

static double random_log(double low, double high)
{
    return low * pow(high / low, random_unit());
}

static q32_t q32(double value)
{
    return (q32_t)llround(value * LSB);
}

typedef struct {
    double speed, accel, jerk, rate; /* units per s^k; cycles per s */
    ramp_limits_t limits;
} axis_t;

static axis_t axis_of(double speed, double accel, int32_t jerk, uint32_t cycle_us)
{
    axis_t axis = {.speed = speed, .accel = accel, .jerk = jerk, .rate = 1e6 / cycle_us};
    TEST_ASSERT_EQUAL(HV_OK, ramp_limits_from_units(-5000 * 65536, 5000 * 65536, (q16_t)lround(speed * 65536),
                                                    (q16_t)lround(accel * 65536), jerk, cycle_us, &axis.limits));
    return axis;
}

static axis_t random_axis(void)
{
    return axis_of(random_log(50, 1500), random_log(300, 20000), (int32_t)random_log(5000, 500000), 1000);
}

/* ---- the judge: differences of positions as a share of the limits ---- */

typedef struct {
    double speed, accel, jerk;
    ramp_state_t last;
} judge_t;

static void judge(judge_t *self, const ramp_limits_t *limits, q32_t pos_q32)
{
    const q32_t vel = pos_q32 - self->last.pos_q32, acc = vel - self->last.vel_per_cycle_q32;
    const q32_t jerk = acc - self->last.acc_per_cycle2_q32;
    self->speed = fmax(self->speed, fabs((double)vel) / (double)limits->vel_per_cycle_q32);
    self->accel = fmax(self->accel, fabs((double)acc) / (double)limits->acc_per_cycle2_q32);
    self->jerk = fmax(self->jerk, (fabs((double)jerk) - 12) / (double)limits->jerk_per_cycle3_q32); /* positions are rounded */
    self->last = (ramp_state_t){pos_q32, vel, acc};
}

static void worst_of(judge_t *worst, const judge_t *one)
{
    worst->speed = fmax(worst->speed, one->speed);
    worst->accel = fmax(worst->accel, one->accel);
    worst->jerk = fmax(worst->jerk, one->jerk);
}

/* ---- quintics ---- */

/* A state a ramp gets into: it chases random steps for a while. */
static ramp_state_t random_state(const ramp_limits_t *limits)
{
    ramp_t ramp;
    TEST_ASSERT_EQUAL(HV_OK, ramp_init(&ramp, limits, q32(random_unit() * 1000 - 500)));
    for (int change = 0; change < 3; change++) {
        const ramp_ref_t ref = {.pos_q32 = q32(random_unit() * 2000 - 1000)};
        for (long i = (long)random_log(5, 600); i > 0; i--) {
            (void)ramp_step(&ramp, &ref, RAMP_FIRM);
        }
    }
    return ramp.state;
}

static void test_quintic_step_random_start_ends_exactly_on_the_target(void)
{
    judge_t worst = {0};
    int feasible = 0;
    for (int run = 0; run < 4000; run++) {
        axis_t axis[AXES];
        const ramp_limits_t *limits[AXES];
        ramp_state_t start[AXES];
        q32_t target[AXES];
        judge_t j[AXES];
        const int64_t cycles = (int64_t)random_log(1, 6000);
        for (unsigned i = 0; i < AXES; i++) {
            axis[i] = random_axis();
            limits[i] = &axis[i].limits;
            start[i] = run % 4 == 0 ? (ramp_state_t){.pos_q32 = q32(random_unit())} : random_state(limits[i]);
            target[i] = start[i].pos_q32 + q32((random_unit() * 2 - 1) * random_log(0.001, 800));
            j[i] = (judge_t){.last = start[i]};
        }
        quintic_t quintic;
        TEST_ASSERT_EQUAL(HV_OK, quintic_plan(&quintic, AXES, start, target, cycles));
        const bool is_feasible = quintic_is_feasible(&quintic, limits);
        for (int64_t k = 0; k < cycles; k++) {
            ramp_ref_t ref[AXES];
            TEST_ASSERT_FALSE(quintic_is_done(&quintic));
            quintic_step(&quintic, ref);
            for (unsigned i = 0; i < AXES; i++) {
                judge(&j[i], limits[i], ref[i].pos_q32);
                TEST_ASSERT_EQUAL_INT64(j[i].last.vel_per_cycle_q32, ref[i].vel_per_cycle_q32);
                TEST_ASSERT_EQUAL_INT64(j[i].last.acc_per_cycle2_q32, ref[i].acc_per_cycle2_q32);
            }
        }
        TEST_ASSERT_TRUE(quintic_is_done(&quintic));
        for (unsigned i = 0; i < AXES; i++) {
            TEST_ASSERT_EQUAL_INT64(target[i], j[i].last.pos_q32);
            if (is_feasible) {
                worst_of(&worst, &j[i]);
            }
        }
        ramp_ref_t after[AXES];
        quintic_step(&quintic, after);
        TEST_ASSERT_EQUAL_INT64(target[0], after[0].pos_q32);
        TEST_ASSERT_EQUAL_INT64(0, after[0].vel_per_cycle_q32);
        feasible += is_feasible;
    }
    printf("quintics called feasible: %d of 4000; shares of the limits: speed %.4f, acceleration %.4f, jerk %.4f\n", feasible,
           worst.speed, worst.accel, worst.jerk);
    TEST_ASSERT_TRUE(feasible > 200);
    TEST_ASSERT_TRUE(worst.speed <= 1 && worst.accel <= 1 && worst.jerk <= 1);
}

/* Rest to rest over d the extremes are known: 1.875 d/T, 5.7735 d/T^2, 60 d/T^3. */
static void test_quintic_is_feasible_agrees_with_the_closed_form(void)
{
    for (int run = 0; run < 5000; run++) {
        const axis_t axis = random_axis();
        const ramp_limits_t *limits[1] = {&axis.limits};
        const double d = random_log(0.01, 2000), s = random_log(0.02, 20);
        const double share =
            fmax(fmax(1.875 * d / s / axis.speed, 5.7735 * d / s / s / axis.accel), 60 * d / s / s / s / axis.jerk);
        const double safe = fmin(axis.accel, sqrt(axis.speed * axis.jerk));
        const double safe_share = fmax(share, 5.7735 * d / s / s / safe);
        const ramp_state_t start = {0};
        const q32_t target = q32(d);
        quintic_t quintic;
        TEST_ASSERT_EQUAL(HV_OK, quintic_plan(&quintic, 1, &start, &target, (int64_t)lround(s * 1000)));
        const bool is_feasible = quintic_is_feasible(&quintic, limits);
        if (share > 1.005) {
            TEST_ASSERT_FALSE(is_feasible);
        }
        if (safe_share < 0.95) {
            TEST_ASSERT_TRUE(is_feasible);
        }
    }
}

static void test_quintic_is_feasible_path_outside_the_bounds_is_not(void)
{
    ramp_limits_t limits;
    TEST_ASSERT_EQUAL(HV_OK, ramp_limits_from_units(0, 100 * 65536, 400 * 65536, 3000 * 65536, 50000, 1000, &limits));
    const ramp_limits_t *list[1] = {&limits};
    const ramp_state_t start = {q32(99), q32(0.1), 0}; /* 100 mm/s towards the bound, the target is behind */
    const q32_t target = q32(50);
    quintic_t quintic;
    TEST_ASSERT_EQUAL(HV_OK, quintic_plan(&quintic, 1, &start, &target, 2000));
    TEST_ASSERT_FALSE(quintic_is_feasible(&quintic, list));
}

static void test_quintic_plan_far_too_long_is_refused(void)
{
    const ramp_state_t start = {0, q32(0.4), q32(0.003)};
    const q32_t target = q32(10);
    quintic_t quintic;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, quintic_plan(&quintic, 1, &start, &target, 3600000));
    const ramp_state_t back = {0, -q32(0.4), -q32(0.003)};
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, quintic_plan(&quintic, 1, &back, &target, 3600000));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, quintic_plan(&quintic, 1, &back, &target, INT32_MAX)); /* products that saturate */
    const q32_t far = INT64_MAX / 2;
    const ramp_state_t rest = {0};
    TEST_ASSERT_EQUAL(HV_OK, quintic_plan(&quintic, 1, &rest, &target, 7200000));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, quintic_plan(&quintic, 1, &rest, &far, 1000));
}

/* ---- S-curves ---- */

/* Shortest time from rest to rest with limited speed, acceleration and jerk. */
static double optimal_s(double distance, const axis_t *axis)
{
    const double v = axis->speed, a = axis->accel, j = axis->jerk;
    const double rise = v * j >= a * a ? a / j + v / a : 2 * sqrt(v / j);
    if (distance >= v * rise) {
        return distance / v + rise;
    }
    if (distance >= 2 * a * a * a / (j * j)) {
        const double half = a / j / 2;
        return 2 * (half + sqrt(half * half + distance / a));
    }
    return 4 * cbrt(distance / (2 * j));
}

/* Walks along a curve; the positions judged. */
static judge_t walk(scurve_t *curve, const ramp_limits_t *limits, q32_t from_q32, q32_t to_q32)
{
    judge_t j = {.last = {.pos_q32 = from_q32}};
    const int64_t cycles = scurve_cycles(curve);
    for (int64_t k = 0; k < cycles; k++) {
        TEST_ASSERT_FALSE(scurve_is_done(curve));
        scurve_step(curve);
        judge(&j, limits, scurve_between(curve, from_q32, to_q32));
    }
    TEST_ASSERT_TRUE(scurve_is_done(curve));
    TEST_ASSERT_EQUAL_INT64(to_q32, j.last.pos_q32);
    TEST_ASSERT_EQUAL_INT64(curve->total, curve->pos);
    TEST_ASSERT_EQUAL_INT64(0, curve->vel);
    TEST_ASSERT_EQUAL_INT64(0, curve->acc);
    for (int k = 0; k < 3; k++) {
        scurve_step(curve);
        judge(&j, limits, scurve_between(curve, from_q32, to_q32));
        TEST_ASSERT_EQUAL_INT64(to_q32, j.last.pos_q32);
    }
    return j;
}

static void test_scurve_plan_random_moves_keep_limits_and_are_short(void)
{
    judge_t worst = {0};
    double longest = 0, sum = 0, medium = 0;
    int counted = 0;
    for (int run = 0; run < 3000; run++) {
        static const uint32_t k_cycles_us[] = {500, 1000, 2000, 5000};
        const axis_t axis =
            axis_of(random_log(20, 2000), random_log(100, 30000), (int32_t)random_log(2000, 500000), k_cycles_us[run % 4]);
        const double distance = random_log(0.001, 2000);
        const q32_t from = q32(random_unit() * 100), to = from + q32(run % 2 == 0 ? distance : -distance);
        path_limits_t limits = path_limits_none();
        path_limits_narrow(&limits, to - from, &axis.limits);
        scurve_t curve;
        scurve_plan(&curve, &limits, 1);
        const double best = optimal_s(distance, &axis) * axis.rate;
        if (best > 100) {
            const double ratio = (double)scurve_cycles(&curve) / best;
            longest = fmax(longest, ratio);
            medium = best > 300 ? fmax(medium, ratio) : medium;
            sum += ratio;
            counted++;
        }
        const judge_t j = walk(&curve, &axis.limits, from, to);
        worst_of(&worst, &j);
    }
    printf("S-curves over 100 cycles: time over optimum mean %.4f, worst %.4f (over 300 cycles %.4f); shares: speed %.4f,"
           " acceleration %.4f, jerk %.4f\n",
           sum / counted, longest, medium, worst.speed, worst.accel, worst.jerk);
    const double used = 1 - 1.0 / 64 + 1e-3; /* the rest is the ramps'; limits are whole numbers */
    TEST_ASSERT_TRUE(worst.speed <= used && worst.accel <= used && worst.jerk <= used);
    TEST_ASSERT_TRUE(longest <= 1.04 && medium <= 1.025);
}

static void test_scurve_plan_several_axes_each_keeps_its_own_limits(void)
{
    judge_t worst = {0};
    for (int run = 0; run < 1000; run++) {
        axis_t axis[AXES];
        q32_t to[AXES];
        path_limits_t limits = path_limits_none();
        for (unsigned i = 0; i < AXES; i++) {
            axis[i] = random_axis();
            to[i] = q32((random_unit() * 2 - 1) * random_log(0.0001, 300));
            path_limits_narrow(&limits, to[i], &axis[i].limits);
        }
        scurve_t curve;
        scurve_plan(&curve, &limits, 1);
        for (unsigned i = 0; i < AXES; i++) {
            scurve_t copy = curve;
            const judge_t j = walk(&copy, &axis[i].limits, 0, to[i]);
            worst_of(&worst, &j);
        }
    }
    TEST_ASSERT_TRUE(worst.speed <= 1.000001 && worst.accel <= 1.000001 && worst.jerk <= 1.000001);
}

static void test_scurve_plan_extreme_distances_are_covered(void)
{
    static const q32_t k_distance[] = {1, 2, 3, 10, 1000, 100000, (q32_t)1 << 32, (q32_t)4000 << 32, (q32_t)16000 << 32};
    for (unsigned i = 0; i < sizeof k_distance / sizeof k_distance[0]; i++) {
        const axis_t slow = axis_of(20, 30, 500, 500), quick = axis_of(2000, 30000, 500000, 10000);
        const axis_t *const axes[2] = {&slow, &quick};
        for (unsigned a = 0; a < 2; a++) {
            path_limits_t limits = path_limits_none();
            path_limits_narrow(&limits, -k_distance[i], &axes[a]->limits);
            scurve_t curve;
            scurve_plan(&curve, &limits, 1);
            TEST_ASSERT_TRUE(scurve_cycles(&curve) >= 4);
            const judge_t j = walk(&curve, &axes[a]->limits, k_distance[i], 0);
            TEST_ASSERT_TRUE(j.speed <= 1.000001 && j.accel <= 1.000001 && j.jerk <= 1.000001);
        }
    }
}

/* Limits of nearly nothing on a way without end are still more than nothing: nothing is divided by zero. */
static void test_path_limits_narrow_leaves_something(void)
{
    const ramp_limits_t least = {0, 1, 1, 1, RAMP_JERK_MIN_Q32};
    path_limits_t limits = path_limits_none();
    path_limits_narrow(&limits, INT64_MAX, &least);
    TEST_ASSERT_EQUAL_INT64(1, limits.vel_q62);
    TEST_ASSERT_EQUAL_INT64(1, limits.acc_q62);
    TEST_ASSERT_GREATER_OR_EQUAL_INT64(1, limits.jerk_q62);
}

static void test_scurve_plan_no_distance_takes_the_least_cycles_without_moving(void)
{
    path_limits_t limits = path_limits_none();
    const axis_t axis = axis_of(400, 3000, 50000, 1000);
    path_limits_narrow(&limits, 0, &axis.limits);
    scurve_t curve;
    scurve_plan(&curve, &limits, 700);
    TEST_ASSERT_EQUAL_INT64(700, scurve_cycles(&curve));
    const judge_t j = walk(&curve, &axis.limits, q32(7), q32(7));
    TEST_ASSERT_EQUAL_DOUBLE(0, j.speed);
}

static void test_scurve_plan_least_cycles_is_exact(void)
{
    for (int run = 0; run < 2000; run++) {
        const axis_t axis = random_axis();
        const q32_t to = q32(random_log(0.001, 500));
        path_limits_t limits = path_limits_none();
        path_limits_narrow(&limits, to, &axis.limits);
        scurve_t quickest, curve;
        scurve_plan(&quickest, &limits, 1);
        const int64_t own = scurve_cycles(&quickest);
        const int64_t least = 1 + (int64_t)random_log(1, (double)own * 5);
        scurve_plan(&curve, &limits, least);
        TEST_ASSERT_EQUAL_INT64(least > own ? least : own, scurve_cycles(&curve));
        const judge_t j = walk(&curve, &axis.limits, 0, to);
        TEST_ASSERT_TRUE(j.speed <= 1.000001 && j.accel <= 1.000001 && j.jerk <= 1.000001);
    }
}

static void test_scurve_plan_an_hour_is_exact(void)
{
    const axis_t axis = axis_of(400, 3000, 50000, 500);
    path_limits_t limits = path_limits_none();
    path_limits_narrow(&limits, q32(50), &axis.limits);
    scurve_t curve;
    scurve_plan(&curve, &limits, 7200000);
    TEST_ASSERT_EQUAL_INT64(7200000, scurve_cycles(&curve));
    (void)walk(&curve, &axis.limits, 0, q32(50));
}

static void test_history_advance_gives_backward_differences(void)
{
    history_t history = {10, 3, 1};
    const ramp_ref_t ref = history_advance(&history, 20);
    TEST_ASSERT_EQUAL_INT64(20, ref.pos_q32);
    TEST_ASSERT_EQUAL_INT64(10, ref.vel_per_cycle_q32);
    TEST_ASSERT_EQUAL_INT64(7, ref.acc_per_cycle2_q32);
    TEST_ASSERT_EQUAL_INT64(6, ref.jerk_per_cycle3_q32);
    TEST_ASSERT_EQUAL_INT64(7, history.acc_per_cycle2_q32);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_quintic_step_random_start_ends_exactly_on_the_target);
    RUN_TEST(test_quintic_is_feasible_agrees_with_the_closed_form);
    RUN_TEST(test_quintic_is_feasible_path_outside_the_bounds_is_not);
    RUN_TEST(test_quintic_plan_far_too_long_is_refused);
    RUN_TEST(test_scurve_plan_random_moves_keep_limits_and_are_short);
    RUN_TEST(test_scurve_plan_several_axes_each_keeps_its_own_limits);
    RUN_TEST(test_scurve_plan_extreme_distances_are_covered);
    RUN_TEST(test_path_limits_narrow_leaves_something);
    RUN_TEST(test_scurve_plan_no_distance_takes_the_least_cycles_without_moving);
    RUN_TEST(test_scurve_plan_least_cycles_is_exact);
    RUN_TEST(test_scurve_plan_an_hour_is_exact);
    RUN_TEST(test_history_advance_gives_backward_differences);
    return UNITY_END();
}

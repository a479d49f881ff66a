/* SPDX-License-Identifier: MIT
 * test_sync_stop.c - stops of several axes: how long against the slowest axis' own, in which direction, within which limits.
 * The quickest stop of one axis is worked out here in double precision from the continuous law.
 */
#include "heave/sync_stop.h"

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

static ramp_limits_t limits_of(double speed, double accel, int32_t jerk)
{
    ramp_limits_t limits;
    TEST_ASSERT_EQUAL(HV_OK, ramp_limits_from_units(-5000 * 65536, 5000 * 65536, (q16_t)lround(speed * 65536),
                                                    (q16_t)lround(accel * 65536), jerk, 1000, &limits));
    return limits;
}

static ramp_limits_t random_limits(void)
{
    const int32_t jerk = (int32_t)random_log(5000, 500000); /* one after the other: arguments come in any order */
    const double accel = random_log(300, 20000);
    return limits_of(random_log(50, 1500), accel, jerk);
}

/* Cycles of the quickest stop of one axis, continuous. */
static double own_cycles(const ramp_state_t *s, const ramp_limits_t *limits)
{
    const double a = (double)s->acc_per_cycle2_q32, acc = (double)ramp_safe_acceleration(limits);
    const double jerk = (double)limits->jerk_per_cycle3_q32;
    const double left = (double)s->vel_per_cycle_q32 + a * fabs(a) / (2 * jerk); /* once a is taken back */
    const double along = left < 0 ? -a : a,
                 v = fabs((double)s->vel_per_cycle_q32) * (left * (double)s->vel_per_cycle_q32 < 0 ? -1 : 1);
    const double peak = fmin(acc, sqrt(fmax(0, jerk * v + along * along / 2)));
    return (along + peak) / jerk + peak / jerk + fmax(0, (v + along * along / (2 * jerk) - peak * peak / jerk) / peak);
}

/* Worst differences as a share of the limits. */
typedef struct {
    double accel, jerk;
    ramp_state_t last;
} judge_t;

static void judge(judge_t *self, const ramp_limits_t *limits, q32_t pos_q32)
{
    const q32_t vel = pos_q32 - self->last.pos_q32, acc = vel - self->last.vel_per_cycle_q32;
    const q32_t jerk = acc - self->last.acc_per_cycle2_q32;
    self->accel = fmax(self->accel, fabs((double)acc) / (double)ramp_safe_acceleration(limits));
    self->jerk = fmax(self->jerk, (fabs((double)jerk) - 12) / (double)limits->jerk_per_cycle3_q32);
    self->last = (ramp_state_t){pos_q32, vel, acc};
}

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

/* Walks a stop to its end. */
static void walk(sync_stop_t *halt, const ramp_limits_t *limits, judge_t *j)
{
    ramp_ref_t ref[AXES_MAX];
    while (!sync_stop_is_done(halt)) {
        sync_stop_step(halt, ref);
        for (unsigned i = 0; i < halt->axes; i++) {
            judge(&j[i], &limits[i], ref[i].pos_q32);
        }
    }
    for (unsigned i = 0; i < halt->axes; i++) {
        TEST_ASSERT_EQUAL_INT64(halt->rest_q32[i], j[i].last.pos_q32);
        TEST_ASSERT_TRUE(llabs(j[i].last.vel_per_cycle_q32) <= 2 * halt->cycles + 8); /* rounding */
    }
    sync_stop_step(halt, ref);
    for (unsigned i = 0; i < halt->axes; i++) {
        TEST_ASSERT_EQUAL_INT64(halt->rest_q32[i], ref[i].pos_q32);
        TEST_ASSERT_EQUAL_INT64(0, ref[i].vel_per_cycle_q32);
    }
}

static void test_halt_plan_one_axis_is_as_quick_as_its_limits(void)
{
    double worst = 0, accel = 0, jerk = 0;
    int longer = 0;
    for (int run = 0; run < 4000; run++) {
        const ramp_limits_t limits = random_limits();
        const ramp_limits_t *const list[1] = {&limits};
        const ramp_state_t start = random_state(&limits);
        judge_t j = {.last = start};
        sync_stop_t halt;
        sync_stop_plan(&halt, 1, 1, &start, list, NULL);
        const double own = own_cycles(&start, &limits);
        worst = own > 50 ? fmax(worst, (double)halt.cycles / own) : worst;
        longer += (double)halt.cycles > own * 1.05 + 6;
        walk(&halt, &limits, &j);
        accel = fmax(accel, j.accel);
        jerk = fmax(jerk, j.jerk);
    }
    printf("stop of one axis: at most %.3f x the quickest; acceleration %.4f, jerk %.4f of the limits\n", worst, accel, jerk);
    TEST_ASSERT_TRUE(accel <= 1 && jerk <= 1);
    TEST_ASSERT_TRUE(worst <= 1.2 && longer <= 8);
}

static void test_halt_plan_one_body_ends_together_within_ten_percent_of_the_slowest(void)
{
    static double ratio[3000];
    unsigned count = 0;
    double accel = 0, jerk = 0, worst = 0;
    for (int run = 0; run < 3000; run++) {
        const ramp_limits_t one = random_limits();
        const ramp_limits_t limits[AXES] = {one, one, one};
        const ramp_limits_t *const list[AXES] = {&limits[0], &limits[1], &limits[2]};
        ramp_state_t start[AXES];
        judge_t j[AXES] = {{0}};
        double own = 1;
        for (unsigned i = 0; i < AXES; i++) {
            start[i] = random_state(&one);
            j[i].last = start[i];
            own = fmax(own, own_cycles(&start[i], &one));
        }
        sync_stop_t halt;
        sync_stop_plan(&halt, AXES, AXES, start, list, NULL);
        walk(&halt, limits, j);
        for (unsigned i = 0; i < AXES; i++) {
            accel = fmax(accel, j[i].accel);
            jerk = fmax(jerk, j[i].jerk);
        }
        if (own > 50) {
            ratio[count++] = (double)halt.cycles / own;
            worst = fmax(worst, ratio[count - 1]);
        }
    }
    unsigned within = 0;
    double sum = 0;
    for (unsigned i = 0; i < count; i++) {
        within += ratio[i] <= 1.1;
        sum += ratio[i] / count;
    }
    printf("stops of three: %.3f x the slowest axis' own on average, %.1f %% within 1.1, worst %.3f; accel %.4f, jerk %.4f\n",
           sum, 100.0 * within / count, worst, accel, jerk);
    TEST_ASSERT_TRUE(accel <= 1 && jerk <= 1);
    TEST_ASSERT_TRUE(sum <= 1.04 && within * 100 >= count * 98 && worst <= 1.2);
}

/* Axes that move in one direction stay in it. */
static void test_halt_plan_proportional_axes_keep_their_direction(void)
{
    for (int run = 0; run < 500; run++) {
        const ramp_limits_t one = random_limits();
        const ramp_limits_t limits[AXES] = {one, one, one};
        const ramp_limits_t *const list[AXES] = {&limits[0], &limits[1], &limits[2]};
        const ramp_state_t lead = random_state(&one);
        const double share[AXES] = {1, random_unit() * 2 - 1, random_unit() * 2 - 1};
        ramp_state_t start[AXES];
        for (unsigned i = 0; i < AXES; i++) {
            start[i] = (ramp_state_t){0, (q32_t)((double)lead.vel_per_cycle_q32 * share[i]),
                                      (q32_t)((double)lead.acc_per_cycle2_q32 * share[i])};
        }
        sync_stop_t halt;
        sync_stop_plan(&halt, AXES, AXES, start, list, NULL);
        TEST_ASSERT_TRUE((double)halt.cycles <= own_cycles(&lead, &one) * 1.05 + 6);
        while (!sync_stop_is_done(&halt)) {
            ramp_ref_t ref[AXES];
            sync_stop_step(&halt, ref);
            for (unsigned i = 1; i < AXES; i++) {
                TEST_ASSERT_DOUBLE_WITHIN(1e-4, (double)ref[0].pos_q32 / LSB * share[i], (double)ref[i].pos_q32 / LSB);
            }
        }
    }
}

static void test_halt_plan_at_rest_stays_where_it_is(void)
{
    const ramp_limits_t limits = limits_of(400, 3000, 50000);
    const ramp_limits_t *const list[2] = {&limits, &limits};
    const ramp_state_t start[2] = {{.pos_q32 = q32(3)}, {.pos_q32 = q32(-7)}};
    sync_stop_t halt;
    sync_stop_plan(&halt, 2, 2, start, list, NULL);
    TEST_ASSERT_TRUE(halt.cycles <= 3);
    TEST_ASSERT_EQUAL_INT64(start[0].pos_q32, halt.rest_q32[0]);
    TEST_ASSERT_EQUAL_INT64(start[1].pos_q32, halt.rest_q32[1]);
}

/* All that is left of a motion is an acceleration that one cycle takes back: it is over before it moves. */
static void test_halt_plan_acceleration_of_one_cycle_ends_where_it_is(void)
{
    const ramp_limits_t limits = limits_of(400, 3000, 50000);
    const ramp_limits_t *const list[1] = {&limits};
    const q32_t jerk_q32 = limits.jerk_per_cycle3_q32;
    const ramp_state_t start = {.pos_q32 = q32(20), .acc_per_cycle2_q32 = jerk_q32 - jerk_q32 / 128 - 4};
    judge_t j = {.last = start};
    sync_stop_t halt;
    sync_stop_plan(&halt, 1, 1, &start, list, NULL);
    TEST_ASSERT_EQUAL_INT64(2, halt.cycles);
    walk(&halt, &limits, &j);
    TEST_ASSERT_EQUAL_INT64(start.pos_q32, halt.rest_q32[0]);
    TEST_ASSERT_TRUE(j.jerk <= 1);
}

/* A heavy rotation motor takes seconds to stop; the cylinders need not wait for it. */
static void test_halt_plan_axis_apart_takes_its_own_time(void)
{
    const ramp_limits_t limits[3] = {limits_of(400, 3000, 50000), limits_of(400, 3000, 50000), limits_of(60, 20, 200)};
    const ramp_limits_t *const list[3] = {&limits[0], &limits[1], &limits[2]};
    const ramp_state_t start[3] = {{0, q32(0.1), q32(0.003)}, {0, q32(0.2), 0}, {0, q32(0.06), 0}};
    judge_t j[3] = {{.last = start[0]}, {.last = start[1]}, {.last = start[2]}};
    sync_stop_t halt;
    sync_stop_plan(&halt, 3, 2, start, list, NULL);
    TEST_ASSERT_TRUE(halt.cycles > 3000);
    TEST_ASSERT_TRUE(halt.times[0].change + halt.times[0].hold + halt.times[0].back < 250);
    TEST_ASSERT_EQUAL_INT64(halt.times[0].change, halt.times[1].change);
    walk(&halt, limits, j);
}

/* Just before the end of its stroke an axis is not carried past it for the others' sake. */
static void test_halt_plan_near_a_bound_takes_its_own_time(void)
{
    ramp_limits_t limits[2] = {limits_of(400, 3000, 50000), limits_of(400, 3000, 50000)};
    const ramp_limits_t *const list[2] = {&limits[0], &limits[1]};
    const ramp_state_t start[2] = {{0, q32(0.4), 0}, {0, q32(0.1), 0}};
    sync_stop_t halt;
    sync_stop_plan(&halt, 2, 2, start, list, NULL);
    const q32_t together = halt.rest_q32[1];
    limits[1].pos_max_q32 = together - q32(1);
    sync_stop_plan(&halt, 2, 2, start, list, NULL);
    TEST_ASSERT_TRUE(halt.rest_q32[1] < limits[1].pos_max_q32);
}

/* Found by fuzzing: what forward kinematics makes of a jump of the cylinders near a singularity. */
static void test_halt_plan_far_beyond_the_limits_does_not_wrap_around(void)
{
    const ramp_limits_t limits = limits_of(400, 3000, 50000);
    const ramp_limits_t *const list[2] = {&limits, &limits};
    const ramp_state_t start[2] = {{0, INT64_C(4628414351), INT64_C(709253659)}, {0, INT64_C(20861527538), INT64_C(3196799946)}};
    for (int sign = 1; sign >= -1; sign -= 2) {
        ramp_state_t turned[2];
        sync_stop_t halt;
        for (unsigned i = 0; i < 2; i++) {
            turned[i] = (ramp_state_t){0, sign * start[i].vel_per_cycle_q32, sign * start[i].acc_per_cycle2_q32};
        }
        sync_stop_plan(&halt, 2, 2, turned, list, NULL);
        for (unsigned i = 0; i < 2; i++) {
            TEST_ASSERT_TRUE(sign * halt.rest_q32[i] > q32(100) && sign * halt.rest_q32[i] <= q32(1 << 20));
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_halt_plan_one_axis_is_as_quick_as_its_limits);
    RUN_TEST(test_halt_plan_one_body_ends_together_within_ten_percent_of_the_slowest);
    RUN_TEST(test_halt_plan_proportional_axes_keep_their_direction);
    RUN_TEST(test_halt_plan_at_rest_stays_where_it_is);
    RUN_TEST(test_halt_plan_acceleration_of_one_cycle_ends_where_it_is);
    RUN_TEST(test_halt_plan_axis_apart_takes_its_own_time);
    RUN_TEST(test_halt_plan_near_a_bound_takes_its_own_time);
    RUN_TEST(test_halt_plan_far_beyond_the_limits_does_not_wrap_around);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_intensity.c - the share of a sender's motion: its ramp by plain differences, its arithmetic against double precision, and
 * that 100 % and 0 % are exact.
 */
#include <math.h>

#include "heave/intensity.h"
#include "random.h"
#include "unity.h"

#define CYCLE_US 1000u
#define RAMP_MS  2000u

static intensity_t m_intensity;

static int64_t random_to(int64_t limit)
{
    return (int64_t)(random_bits() >> 2) % limit;
}

void setUp(void)
{
    random_begin(RANDOM_SEED);
    TEST_ASSERT_EQUAL(HV_OK, intensity_init(&m_intensity, 100, 100, RAMP_MS, CYCLE_US));
}

void tearDown(void) {}

static double share(void)
{
    return (double)m_intensity.share_q46[0] / (double)INTENSITY_FULL;
}

/* Differences of the share, judged in every cycle against those of the fastest S-curve over the ramp time. */
typedef struct {
    double pos, vel, acc;
} watch_t;

static watch_t watch_start(void)
{
    return (watch_t){.pos = share()};
}

static void watch_cycle(watch_t *self, unsigned ramp_cycles)
{
    const double n = (double)ramp_cycles;
    intensity_step(&m_intensity);
    const double vel = share() - self->pos;
    const double acc = vel - self->vel;
    const double jerk = fabs(acc - self->acc);
    TEST_ASSERT_TRUE(fabs(vel) <= 2.0 / n * 1.000001);
    TEST_ASSERT_TRUE(fabs(acc) <= 8.0 / (n * n) * 1.000001);
    TEST_ASSERT_TRUE(jerk <= 32.0 / (n * n * n) * 1.001 + 1e-13);
    TEST_ASSERT_TRUE(share() >= 0.0 && share() <= m_intensity.max_percent / 100.0);
    *self = (watch_t){share(), vel, acc};
}

static unsigned cycles_until_there(unsigned percent, unsigned ramp_cycles)
{
    watch_t watch = watch_start();
    TEST_ASSERT_EQUAL(HV_OK, intensity_set(&m_intensity, percent));
    for (unsigned cycle = 0; cycle < 2 * ramp_cycles; cycle++) {
        if (m_intensity.share_q46[0] == INTENSITY_FULL * (int64_t)percent / 100 && watch.vel == 0.0 && watch.acc == 0.0) {
            return cycle;
        }
        watch_cycle(&watch, ramp_cycles);
    }
    TEST_FAIL_MESSAGE("does not arrive");
    return 0;
}

static void test_intensity_step_full_change_takes_the_ramp_time(void)
{
    TEST_ASSERT_UINT_WITHIN(100, 2000, cycles_until_there(0, 2000));
    TEST_ASSERT_UINT_WITHIN(100, 2000, cycles_until_there(100, 2000));
}

static void test_intensity_step_small_change_takes_the_cube_root(void)
{
    TEST_ASSERT_UINT_WITHIN(100, 1587, cycles_until_there(50, 2000));
    TEST_ASSERT_UINT_WITHIN(100, 928, cycles_until_there(60, 2000));
}

static void test_intensity_step_changed_on_the_way_stays_smooth_and_inside(void)
{
    TEST_ASSERT_EQUAL(HV_OK, intensity_init(&m_intensity, 30, 80, RAMP_MS, CYCLE_US));
    watch_t watch = watch_start();
    for (unsigned change = 0; change < 300; change++) {
        TEST_ASSERT_EQUAL(HV_OK, intensity_set(&m_intensity, (unsigned)random_to(81)));
        for (int64_t cycles = random_to(1500); cycles > 0; cycles--) {
            watch_cycle(&watch, 2000);
        }
    }
}

static void test_intensity_init_every_cycle_and_ramp_time_arrives_exactly(void)
{
    static const struct {
        uint32_t cycle_us, ramp_ms;
    } cases[] = {{500, 500}, {500, 10000}, {1000, 500}, {1000, 10000}, {10000, 500}, {10000, 10000}, {3333, 777}};
    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const unsigned cycles = cases[i].ramp_ms * 1000 / cases[i].cycle_us;
        TEST_ASSERT_EQUAL(HV_OK, intensity_init(&m_intensity, 0, 100, cases[i].ramp_ms, cases[i].cycle_us));
        TEST_ASSERT_TRUE(cycles_until_there(100, cycles) <= cycles + cycles / 10 + 20);
        TEST_ASSERT_TRUE(cycles_until_there(37, cycles) <= cycles + cycles / 10 + 20);
        TEST_ASSERT_TRUE(cycles_until_there(0, cycles) <= cycles + cycles / 10 + 20);
    }
}

static void test_intensity_init_out_of_range_is_refused(void)
{
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_init(&m_intensity, 81, 80, RAMP_MS, CYCLE_US));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_init(&m_intensity, 0, 0, RAMP_MS, CYCLE_US));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_init(&m_intensity, 0, 101, RAMP_MS, CYCLE_US));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_init(&m_intensity, 0, 100, INTENSITY_RAMP_MIN_MS - 1, CYCLE_US));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_init(&m_intensity, 0, 100, INTENSITY_RAMP_MAX_MS + 1, CYCLE_US));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_init(&m_intensity, 0, 100, RAMP_MS, 499));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_init(&m_intensity, 0, 100, RAMP_MS, RAMP_CYCLE_MAX_US + 1));
}

static void test_intensity_set_above_the_cap_changes_nothing(void)
{
    TEST_ASSERT_EQUAL(HV_OK, intensity_init(&m_intensity, 60, 80, RAMP_MS, CYCLE_US));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_set(&m_intensity, 81));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, intensity_set(&m_intensity, UINT32_MAX));
    TEST_ASSERT_EQUAL_UINT(60, m_intensity.percent);
    TEST_ASSERT_EQUAL(HV_OK, intensity_set(&m_intensity, 80));
}

static void test_intensity_place_is_there_at_once(void)
{
    TEST_ASSERT_EQUAL(HV_OK, intensity_set(&m_intensity, 25));
    intensity_step(&m_intensity);
    intensity_place(&m_intensity);
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL_INT64(INTENSITY_FULL / 4, m_intensity.share_q46[i]);
    }
}

static ramp_ref_t random_ref(void)
{
    const int64_t range = q32_from_int(4000);
    return (ramp_ref_t){random_to(range) - range / 2, random_to(range / 1000), -random_to(range / 100000),
                        random_to(range / 10000000)};
}

static void test_intensity_scale_at_100_is_the_reference_itself(void)
{
    for (unsigned i = 0; i < 10000; i++) {
        const ramp_ref_t ref = random_ref();
        const q32_t neutral_q32 = random_ref().pos_q32;
        const ramp_ref_t scaled = intensity_scale(&m_intensity, neutral_q32, &ref);
        TEST_ASSERT_EQUAL_MEMORY(&ref, &scaled, sizeof ref);
        TEST_ASSERT_EQUAL_INT64(ref.pos_q32, intensity_scaled(&m_intensity, neutral_q32, ref.pos_q32));
        TEST_ASSERT_EQUAL_INT64(ref.pos_q32, intensity_unscaled(&m_intensity, neutral_q32, ref.pos_q32));
    }
}

static void test_intensity_scale_at_0_is_neutral_at_rest(void)
{
    TEST_ASSERT_EQUAL(HV_OK, intensity_set(&m_intensity, 0));
    intensity_place(&m_intensity);
    for (unsigned i = 0; i < 10000; i++) {
        const ramp_ref_t ref = random_ref();
        const ramp_ref_t neutral = {.pos_q32 = random_ref().pos_q32};
        const ramp_ref_t scaled = intensity_scale(&m_intensity, neutral.pos_q32, &ref);
        TEST_ASSERT_EQUAL_MEMORY(&neutral, &scaled, sizeof scaled);
        TEST_ASSERT_EQUAL_INT64(neutral.pos_q32, intensity_unscaled(&m_intensity, neutral.pos_q32, ref.pos_q32));
    }
}

/* A reference in motion while the share moves: what comes out are the differences of its own positions. */
static void test_intensity_scale_on_the_way_has_consistent_differences(void)
{
    const q32_t neutral_q32 = q32_from_int(7);
    ramp_ref_t before = {.pos_q32 = 0};
    TEST_ASSERT_EQUAL(HV_OK, intensity_set(&m_intensity, 10));
    q32_t pos_q32[4] = {0};
    for (int t = 0; t < 2500; t++) {
        intensity_step(&m_intensity);
        for (unsigned age = 3; age > 0; age--) {
            pos_q32[age] = pos_q32[age - 1];
        }
        pos_q32[0] = (q32_t)(sin(t * 0.01) * 20.0 * 4294967296.0);
        const q32_t vel_q32 = pos_q32[0] - pos_q32[1];
        const q32_t acc_q32 = vel_q32 - (pos_q32[1] - pos_q32[2]);
        const ramp_ref_t ref = {pos_q32[0], vel_q32, acc_q32, acc_q32 - (pos_q32[1] - 2 * pos_q32[2] + pos_q32[3])};
        const ramp_ref_t scaled = intensity_scale(&m_intensity, neutral_q32, &ref);
        const double expected = 7.0 + share() * ((double)pos_q32[0] / 4294967296.0 - 7.0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected, (double)scaled.pos_q32 / 4294967296.0);
        if (t > 3) {
            TEST_ASSERT_EQUAL_INT64(scaled.pos_q32 - before.pos_q32, scaled.vel_per_cycle_q32);
            TEST_ASSERT_EQUAL_INT64(scaled.vel_per_cycle_q32 - before.vel_per_cycle_q32, scaled.acc_per_cycle2_q32);
            TEST_ASSERT_EQUAL_INT64(scaled.acc_per_cycle2_q32 - before.acc_per_cycle2_q32, scaled.jerk_per_cycle3_q32);
        }
        before = scaled;
    }
}

static void test_intensity_shift_ends_where_the_scaled_value_is(void)
{
    const q32_t neutral_q32 = q32_from_int(-3);
    const q32_t value_q32 = q32_from_int(117);
    const int64_t planned_q46 = m_intensity.share_q46[0];
    const q32_t planned_q32 = intensity_scaled(&m_intensity, neutral_q32, value_q32);
    (void)cycles_until_there(45, 2000);
    const ramp_ref_t by = intensity_shift(&m_intensity, planned_q46, value_q32 - neutral_q32);
    TEST_ASSERT_INT64_WITHIN(2, intensity_scaled(&m_intensity, neutral_q32, value_q32), planned_q32 + by.pos_q32);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_intensity_step_full_change_takes_the_ramp_time);
    RUN_TEST(test_intensity_step_small_change_takes_the_cube_root);
    RUN_TEST(test_intensity_step_changed_on_the_way_stays_smooth_and_inside);
    RUN_TEST(test_intensity_init_every_cycle_and_ramp_time_arrives_exactly);
    RUN_TEST(test_intensity_init_out_of_range_is_refused);
    RUN_TEST(test_intensity_set_above_the_cap_changes_nothing);
    RUN_TEST(test_intensity_place_is_there_at_once);
    RUN_TEST(test_intensity_scale_at_100_is_the_reference_itself);
    RUN_TEST(test_intensity_scale_at_0_is_neutral_at_rest);
    RUN_TEST(test_intensity_scale_on_the_way_has_consistent_differences);
    RUN_TEST(test_intensity_shift_ends_where_the_scaled_value_is);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_counts.c - counts and units by hand, there and back over whole strokes, and against remainders in plain long division.
 */
#include "heave/counts.h"

#include "random.h"
#include "unity.h"

#define MM(x) ((q32_t)(x)*Q32_ONE)

void setUp(void) {}
void tearDown(void) {}

static int64_t counts_of(counts_scale_t scale, q32_t units_q32)
{
    int64_t counts = INT64_MIN;
    TEST_ASSERT_EQUAL(HV_OK, counts_from_units(&scale, units_q32, &counts));
    return counts;
}

static q32_t units_of(counts_scale_t scale, int64_t counts)
{
    q32_t units_q32 = INT64_MIN;
    TEST_ASSERT_EQUAL(HV_OK, counts_to_units(&scale, counts, &units_q32));
    return units_q32;
}

static void test_from_units_known_drives_are_exact(void)
{
    const counts_scale_t pulses = {20000, 10, 0};
    TEST_ASSERT_EQUAL_INT64(600000, counts_of(pulses, MM(300)));
    TEST_ASSERT_EQUAL_INT64(-2000, counts_of(pulses, MM(-1)));
    TEST_ASSERT_EQUAL_INT64(599000, counts_of((counts_scale_t){-20000, 10, 599400}, MM(1) / 5));
    TEST_ASSERT_EQUAL_INT64(3276800, counts_of((counts_scale_t){131072 * 3, 36, 0}, MM(300)));
}

static void test_from_units_halves_go_away_from_zero(void)
{
    const counts_scale_t one = {1, 1, 0};
    TEST_ASSERT_EQUAL_INT64(1, counts_of(one, Q32_ONE / 2));
    TEST_ASSERT_EQUAL_INT64(0, counts_of(one, Q32_ONE / 2 - 1));
    TEST_ASSERT_EQUAL_INT64(-1, counts_of(one, -Q32_ONE / 2));
    TEST_ASSERT_EQUAL_INT64(0, counts_of(one, -Q32_ONE / 2 + 1));
    TEST_ASSERT_EQUAL_INT64(8, counts_of((counts_scale_t){1, 1, 7}, Q32_ONE / 2));
}

static void test_to_units_thirds_are_nearest(void)
{
    const counts_scale_t third = {3, 1, 0};
    TEST_ASSERT_EQUAL_INT64(1431655765, units_of(third, 1));
    TEST_ASSERT_EQUAL_INT64(2863311531, units_of(third, 2));
    TEST_ASSERT_EQUAL_INT64(-2863311531, units_of(third, -2));
    TEST_ASSERT_EQUAL_INT64(MM(4), units_of(third, 12));
    TEST_ASSERT_EQUAL_INT64(MM(-4), units_of((counts_scale_t){-3, 1, 5}, 17));
}

/* Every count of some strokes, and back. */
static void test_there_and_back_is_the_same_count(void)
{
    static const counts_scale_t k_scales[] = {
        {20000, 10, 0}, {-4096, 7, -123}, {1, 1000, 99}, {2147483647, 3, 0}, {997, 1009, -5}};
    for (size_t i = 0; i < sizeof k_scales / sizeof k_scales[0]; i++) {
        for (int64_t counts = -700000; counts <= 700000; counts += 7) {
            TEST_ASSERT_EQUAL_INT64(counts, counts_of(k_scales[i], units_of(k_scales[i], counts)));
        }
    }
}

/* |units * num - (counts - zero) * den * 2^32| is at most half of den * 2^32: that is what nearest means. Small enough numbers
 * for 64 bits. */
static void test_from_units_random_scales_are_nearest(void)
{
    random_begin(RANDOM_SEED);
    for (int n = 0; n < 200000; n++) {
        const uint64_t seed = random_bits();
        const counts_scale_t scale = {(int32_t)(seed % 2001) - 1000, (int32_t)(seed >> 20 & 1023) + 1,
                                      (int32_t)(seed >> 32 & 255)};
        const q32_t units_q32 = (q32_t)(seed >> 12) - (INT64_C(1) << 51);
        const int64_t counts = counts_of(scale, units_q32);
        const int64_t whole = (counts - scale.zero) * scale.den;
        const int64_t left_q32 = units_q32 / 1024 * scale.num - whole * (Q32_ONE / 1024); /* both sides / 2^10 */
        TEST_ASSERT_TRUE(fx_abs(left_q32) <= scale.den * (Q32_ONE / 2048) + 1000);
    }
}

static void test_out_of_range_is_reported_and_changes_nothing(void)
{
    const counts_scale_t steep = {INT32_MAX, 1, 0};
    const counts_scale_t flat = {1, INT32_MAX, 0};
    int64_t counts = 42;
    q32_t units_q32 = 43;
    TEST_ASSERT_EQUAL(HV_OK, counts_from_units(&steep, INT64_MAX / 2, &counts));
    counts = 42;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, counts_from_units(&(counts_scale_t){INT32_MIN, 1, 0}, INT64_MIN, &counts));
    TEST_ASSERT_EQUAL_INT64(42, counts);
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, counts_to_units(&flat, 2, &units_q32));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, counts_to_units(&flat, INT64_MIN, &units_q32));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, counts_to_units(&flat, INT64_MAX, &units_q32));
    TEST_ASSERT_EQUAL_INT64(43, units_q32);
}

/* The ends of what 62 bits hold, from both sides. */
static void test_from_units_beyond_the_counts_there_are_is_refused_and_changes_nothing(void)
{
    static const struct {
        counts_scale_t scale;
        q32_t units_q32;
    } k_rows[] = {{{INT32_MIN, 1, 0}, INT64_MIN}, {{INT32_MIN, 1, -1}, INT64_MAX}};
    for (size_t i = 0; i < 2; i++) {
        int64_t counts = 42;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, counts_from_units(&k_rows[i].scale, k_rows[i].units_q32, &counts));
        TEST_ASSERT_EQUAL_INT64(42, counts);
    }
    TEST_ASSERT_EQUAL_INT64(-(INT64_C(1) << 62), counts_of((counts_scale_t){INT32_MIN, 1, 0}, INT64_MAX));
}

static void test_to_units_beyond_the_units_there_are_is_refused_and_changes_nothing(void)
{
    static const struct {
        counts_scale_t scale;
        int64_t counts;
    } k_rows[] = {{{1, 1, 0}, INT64_C(1) << 31},
                  {{1, 1, 0}, -(INT64_C(1) << 31)},
                  {{-1, INT32_MAX, 0}, 2},
                  {{1, 1, 0}, (INT64_C(1) << 61) + 1}};
    for (size_t i = 0; i < 4; i++) {
        q32_t units_q32 = 42;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, counts_to_units(&k_rows[i].scale, k_rows[i].counts, &units_q32));
        TEST_ASSERT_EQUAL_INT64(42, units_q32);
    }
    TEST_ASSERT_EQUAL_INT64(-(INT64_C(1) << 62) + Q32_ONE, units_of((counts_scale_t){1, 1, 0}, -(1 << 30) + 1));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_from_units_known_drives_are_exact);
    RUN_TEST(test_from_units_halves_go_away_from_zero);
    RUN_TEST(test_to_units_thirds_are_nearest);
    RUN_TEST(test_there_and_back_is_the_same_count);
    RUN_TEST(test_from_units_random_scales_are_nearest);
    RUN_TEST(test_out_of_range_is_reported_and_changes_nothing);
    RUN_TEST(test_from_units_beyond_the_counts_there_are_is_refused_and_changes_nothing);
    RUN_TEST(test_to_units_beyond_the_units_there_are_is_refused_and_changes_nothing);
    return UNITY_END();
}

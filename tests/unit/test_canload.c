/* SPDX-License-Identifier: MIT
 * test_canload.c - bits of CAN frames against the published table; loads against sums in double precision.
 * tests/check/test_canload.py stuffs frames bit by bit instead.
 */
#include "heave/canload.h"

#include <math.h>

#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

/* Without stuffing: 47 + 8n and 67 + 8n bits; one stuffing bit for four bits of 34 + 8n or 54 + 8n. */
static void test_frame_bits_standard_match_the_table(void)
{
    static const struct {
        uint8_t bytes;
        uint32_t bits;
    } k_table[] = {{0, 55}, {1, 65}, {2, 75}, {4, 95}, {6, 115}, {7, 125}, {8, 135}};
    for (size_t i = 0; i < sizeof k_table / sizeof k_table[0]; i++) {
        TEST_ASSERT_EQUAL_UINT32(k_table[i].bits, canload_frame_bits(false, k_table[i].bytes));
    }
}

static void test_frame_bits_extended_match_the_formula(void)
{
    TEST_ASSERT_EQUAL_UINT32(80, canload_frame_bits(true, 0));
    TEST_ASSERT_EQUAL_UINT32(160, canload_frame_bits(true, 8));
}

/* Seven drives, set-points and feedback of each kind, one SYNC: bits per set and the highest rates of the published table. */
static void test_ppm_sets_of_seven_drives_match_the_table(void)
{
    static const struct {
        uint8_t sync, out, in;
        uint32_t bits;
    } k_table[] = {{0, 6, 6, 1665}, {0, 6, 8, 1805}, {1, 8, 8, 1955}};
    for (size_t i = 0; i < 3; i++) {
        const canload_entry_t entry[] = {
            {false, k_table[i].sync, 1, 1, 0}, {false, k_table[i].out, 7, 1, 0}, {false, k_table[i].in, 7, 1, 0}};
        const uint32_t expected_ppm = k_table[i].bits * 1000u;
        TEST_ASSERT_EQUAL_UINT32(expected_ppm, canload_ppm(entry, 3, 1000, 1000000));
        TEST_ASSERT_EQUAL_UINT32(expected_ppm * 2, canload_ppm(entry, 3, 1000, 500000));
    }
}

static void test_ppm_any_entries_match_the_sum_in_double(void)
{
    uint32_t seed = 12345;
    for (int n = 0; n < 20000; n++) {
        canload_entry_t entry[6];
        static const uint32_t k_rates[] = {10000, 50000, 125000, 250000, 500000, 800000, 1000000};
        const uint32_t bitrate_bps = k_rates[n % 7];
        double load = 0.0;
        for (int i = 0; i < 6; i++) {
            seed = seed * 1664525u + 1013904223u;
            const uint32_t periods = (seed >> 16) % 3;
            const uint32_t interval_us = 500 + (seed >> 4) % 100000;
            entry[i] = (canload_entry_t){seed >> 31, (seed >> 20) % 9, (seed >> 8) % 20, periods, interval_us};
            const double every_us = periods > 0 ? periods * 2000.0 : interval_us;
            const double stuffed = (entry[i].is_extended ? 54 : 34) + 8.0 * entry[i].bytes;
            load += (stuffed + floor((stuffed - 1) / 4) + 13) * entry[i].frames / every_us / bitrate_bps * 1e12;
        }
        const double ppm = canload_ppm(entry, 6, 2000, bitrate_bps);
        TEST_ASSERT_TRUE(ppm >= load - 1e-3 && ppm < load + 6.001);
    }
}

static void test_ppm_absurd_load_saturates(void)
{
    const canload_entry_t entry[] = {{true, 8, UINT32_MAX, 0, 1}, {true, 8, UINT32_MAX, 1, 0}};
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, canload_ppm(entry, 2, 1, 1));
}

/* The period it names keeps the limit, one step less does not. */
static void test_fitting_period_is_the_shortest_that_fits(void)
{
    for (uint32_t frames = 1; frames <= 14; frames++) {
        for (uint32_t limit_ppm = 100000; limit_ppm <= 900000; limit_ppm += 50000) {
            const canload_entry_t entry[] = {{false, 8, frames, 1, 0}, {false, 2, 7, 4, 0}, {true, 4, 2, 0, 20000}};
            const uint32_t fitting_us = canload_fitting_period_us(entry, 3, 500000, limit_ppm, 500);
            TEST_ASSERT_TRUE(fitting_us > 0 && fitting_us % 500 == 0);
            TEST_ASSERT_TRUE(canload_ppm(entry, 3, fitting_us, 500000) <= limit_ppm);
            TEST_ASSERT_TRUE(fitting_us == 500 || canload_ppm(entry, 3, fitting_us - 500, 500000) > limit_ppm);
        }
    }
}

static void test_fitting_period_where_the_rest_is_too_much_is_none(void)
{
    const canload_entry_t entry[] = {{false, 8, 7, 1, 0}, {false, 8, 7, 0, 2000}};
    TEST_ASSERT_EQUAL_UINT32(0, canload_fitting_period_us(entry, 2, 500000, 900000, 500));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frame_bits_standard_match_the_table);
    RUN_TEST(test_frame_bits_extended_match_the_formula);
    RUN_TEST(test_ppm_sets_of_seven_drives_match_the_table);
    RUN_TEST(test_ppm_any_entries_match_the_sum_in_double);
    RUN_TEST(test_ppm_absurd_load_saturates);
    RUN_TEST(test_fitting_period_is_the_shortest_that_fits);
    RUN_TEST(test_fitting_period_where_the_rest_is_too_much_is_none);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_histogram.c - percentiles, against the sorted durations themselves.
 */
#include <stdlib.h>

#include "common/histogram.h"
#include "unity.h"

static histogram_t m_histogram;

void setUp(void)
{
    m_histogram = (histogram_t){.most_us = 0};
}

void tearDown(void) {}

static void test_histogram_empty_has_only_zeros(void)
{
    TEST_ASSERT_EQUAL_UINT64(0, histogram_count(&m_histogram));
    TEST_ASSERT_EQUAL_UINT64(0, histogram_percentile_us(&m_histogram, 99999));
    TEST_ASSERT_EQUAL_UINT64(0, histogram_max_us(&m_histogram));
}

static int by_size(const void *a, const void *b)
{
    const uint64_t left = *(const uint64_t *)a;
    const uint64_t right = *(const uint64_t *)b;
    return left < right ? -1 : left > right;
}

static void test_histogram_percentile_random_durations_is_that_of_the_sorted_list(void)
{
    enum { COUNT = 20000 };
    static uint64_t durations[COUNT];
    uint32_t random = 5;
    for (unsigned i = 0; i < COUNT; i++) {
        random = random * 1664525u + 1013904223u;
        durations[i] = (random >> 20) * (random >> 26) / 64u;
        histogram_add(&m_histogram, durations[i]);
    }
    qsort(durations, COUNT, sizeof durations[0], by_size);
    for (uint32_t share = 1; share <= 100000; share += 7) {
        const unsigned at = (unsigned)(((uint64_t)COUNT * share + 99999) / 100000) - 1;
        TEST_ASSERT_EQUAL_UINT64(durations[at], histogram_percentile_us(&m_histogram, share));
    }
    TEST_ASSERT_EQUAL_UINT64(COUNT, histogram_count(&m_histogram));
    uint64_t between = 0;
    for (unsigned i = 0; i < COUNT; i++) {
        between += durations[i] >= 100 && durations[i] < 250;
    }
    TEST_ASSERT_GREATER_THAN_UINT64(0, between);
    TEST_ASSERT_EQUAL_UINT64(between, histogram_between(&m_histogram, 100, 250));
    TEST_ASSERT_EQUAL_UINT64(COUNT, histogram_between(&m_histogram, 0, HISTOGRAM_BINS));
    TEST_ASSERT_EQUAL_UINT64(durations[COUNT - 1], histogram_max_us(&m_histogram));
}

static void test_histogram_durations_beyond_the_bins_count_as_the_longest(void)
{
    histogram_add(&m_histogram, 10);
    histogram_add(&m_histogram, HISTOGRAM_BINS - 1u);
    histogram_add(&m_histogram, 5000000);
    TEST_ASSERT_EQUAL_UINT64(10, histogram_percentile_us(&m_histogram, 30000));
    TEST_ASSERT_EQUAL_UINT64(5000000, histogram_percentile_us(&m_histogram, 50000));
    TEST_ASSERT_EQUAL_UINT64(3, histogram_count(&m_histogram));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_histogram_empty_has_only_zeros);
    RUN_TEST(test_histogram_percentile_random_durations_is_that_of_the_sorted_list);
    RUN_TEST(test_histogram_durations_beyond_the_bins_count_as_the_longest);
    return UNITY_END();
}

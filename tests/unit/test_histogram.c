/* SPDX-License-Identifier: MIT
 * test_histogram.c - percentiles, against the sorted durations themselves.
 */
#include <pthread.h>
#include <stdlib.h>

#include "common/histogram.h"
#include "unity.h"

static histogram_t m_histogram;

void setUp(void)
{
    m_histogram = (histogram_t){.most_us = 0};
}

void tearDown(void) {}

static uint64_t percentile_us(uint32_t of_100000)
{
    uint64_t us = UINT64_MAX;
    histogram_percentiles_us(&m_histogram, 1, &of_100000, &us);
    return us;
}

static void test_histogram_empty_has_only_zeros(void)
{
    TEST_ASSERT_EQUAL_UINT64(0, histogram_count(&m_histogram));
    TEST_ASSERT_EQUAL_UINT64(0, percentile_us(99999));
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
        TEST_ASSERT_EQUAL_UINT64(durations[at], percentile_us(share));
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
    TEST_ASSERT_EQUAL_UINT64(10, percentile_us(30000));
    TEST_ASSERT_EQUAL_UINT64(5000000, percentile_us(50000));
    TEST_ASSERT_EQUAL_UINT64(3, histogram_count(&m_histogram));
}

/* Few long ones, and short ones that never cease: while somebody looks at one bin after the other, the share of the long ones
 * shrinks. */
static void *add_short_ones(void *is_over)
{
    while (!__atomic_load_n((bool *)is_over, __ATOMIC_RELAXED)) {
        histogram_add(&m_histogram, 3);
    }
    return NULL;
}

static unsigned wrong_in_looks_while_another_thread_adds(unsigned looks)
{
    static const uint32_t k_shares[] = {50000, 99000, 99300, 99600, 99900, 99990, 100000};
    enum { SHARES = sizeof k_shares / sizeof k_shares[0], LONG = 1000 };
    m_histogram = (histogram_t){.most_us = 0};
    for (unsigned i = 0; i < LONG; i++) {
        histogram_add(&m_histogram, 40);
    }
    pthread_t adding;
    bool is_over = false;
    TEST_ASSERT_EQUAL_INT(0, pthread_create(&adding, NULL, add_short_ones, &is_over));
    unsigned wrong = 0;
    for (unsigned look = 0; look < looks; look++) {
        uint64_t us[SHARES];
        histogram_percentiles_us(&m_histogram, SHARES, k_shares, us);
        wrong += us[SHARES - 1] > histogram_max_us(&m_histogram);
        for (unsigned i = 1; i < SHARES; i++) {
            wrong += us[i] < us[i - 1];
        }
    }
    __atomic_store_n(&is_over, true, __ATOMIC_RELAXED);
    TEST_ASSERT_EQUAL_INT(0, pthread_join(adding, NULL));
    return wrong;
}

static void test_histogram_percentiles_while_another_thread_adds_are_in_order(void)
{
    for (unsigned i = 0; i < 300; i++) {
        TEST_ASSERT_EQUAL_UINT(0, wrong_in_looks_while_another_thread_adds(100));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_histogram_empty_has_only_zeros);
    RUN_TEST(test_histogram_percentile_random_durations_is_that_of_the_sorted_list);
    RUN_TEST(test_histogram_durations_beyond_the_bins_count_as_the_longest);
    RUN_TEST(test_histogram_percentiles_while_another_thread_adds_are_in_order);
    return UNITY_END();
}

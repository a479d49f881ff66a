/* SPDX-License-Identifier: MIT
 * test_nearest.c - which word somebody has meant.
 */
#include "unity.h"

#include "common/nearest.h"

void setUp(void) {}

void tearDown(void) {}

static void test_slips_counts_each_kind_once(void)
{
    static const struct {
        const char *one, *other;
        unsigned slips;
    } k_rows[] = {{"engage", "engage", 0}, {"engag", "engage", 1},  {"enngage", "engage", 1}, {"emgage", "engage", 1},
                  {"egnage", "engage", 1}, {"", "jog", 3},          {"jog", "", 3},           {"", "", 0},
                  {"stauts", "status", 1}, {"status", "statsu", 1}, {"abcdef", "badcfe", 3},  {"parc", "park", 1},
                  {"ca", "abc", 3},        {"hold", "shutdown", 6}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(k_rows[i].slips, nearest_slips(k_rows[i].one, k_rows[i].other), k_rows[i].one);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(k_rows[i].slips, nearest_slips(k_rows[i].other, k_rows[i].one), k_rows[i].one);
    }
}

static void test_slips_long_words_are_none_of_each_other(void)
{
    static const char k_31[] = "1234567890123456789012345678901", k_32[] = "12345678901234567890123456789012";
    TEST_ASSERT_EQUAL_UINT(0, nearest_slips(k_31, k_31));
    TEST_ASSERT_EQUAL_UINT(31, nearest_slips(k_31, k_32));
    TEST_ASSERT_EQUAL_UINT(31, nearest_slips(k_32, k_32));
}

static void test_likely_needs_most_of_a_word(void)
{
    TEST_ASSERT_TRUE(nearest_is_likely(1, "jog"));
    TEST_ASSERT_FALSE(nearest_is_likely(2, "jog"));
    TEST_ASSERT_TRUE(nearest_is_likely(2, "engage"));
    TEST_ASSERT_FALSE(nearest_is_likely(3, "acknowledge"));
    TEST_ASSERT_FALSE(nearest_is_likely(1, "by"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_slips_counts_each_kind_once);
    RUN_TEST(test_slips_long_words_are_none_of_each_other);
    RUN_TEST(test_likely_needs_most_of_a_word);
    return UNITY_END();
}

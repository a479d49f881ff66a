/* SPDX-License-Identifier: MIT
 * test_setup_legs.c - which drive is on which cylinder: every exchange and reversal of six, and what people get wrong.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "setup/legs.h"
#include "unity.h"

#define ASKED_MM 5.0
#define LONG_MM  20.0 /* where 5 mm do not tell ratios apart */

static const unsigned k_ratio[][2] = {{1, 1}, {2, 1}, {1, 2}, {3, 1}, {4, 1}, {5, 1}, {10, 1}};

void setUp(void) {}
void tearDown(void) {}

/* How a machine answers: drive d is on cylinder leg[d], moves times/parts of the way, backwards or not; a tape is off by some. */
static void look(const unsigned leg[LEGS_MAX], unsigned reversed, const unsigned ratio[LEGS_MAX], double asked_mm, double off_mm,
                 legs_seen_t seen[LEGS_MAX])
{
    for (unsigned d = 0; d < LEGS_MAX; d++) {
        seen[d] = (legs_seen_t){.leg = leg[d] + 1u,
                                .is_shorter = (reversed >> d & 1u) != 0,
                                .asked_mm = asked_mm,
                                .measured_mm =
                                    asked_mm * k_ratio[ratio[d]][0] / k_ratio[ratio[d]][1] + (d % 2u == 0 ? off_mm : -off_mm)};
    }
}

static bool next_order(unsigned *order, unsigned count)
{
    unsigned k = count - 1u, l = count - 1u;
    while (k > 0 && order[k - 1u] > order[k]) {
        k--;
    }
    if (k == 0) {
        return false;
    }
    while (order[l] < order[k - 1u]) {
        l--;
    }
    const unsigned kept = order[l];
    order[l] = order[k - 1u];
    order[k - 1u] = kept;
    for (unsigned a = k, b = count - 1u; a < b; a++, b--) {
        const unsigned other = order[a];
        order[a] = order[b];
        order[b] = other;
    }
    return true;
}

static void test_every_exchange_and_reversal(void)
{
    unsigned order[LEGS_MAX] = {0, 1, 2, 3, 4, 5}, cases = 0;
    do {
        for (unsigned reversed = 0; reversed < 64u; reversed++) {
            legs_seen_t seen[LEGS_MAX];
            legs_found_t found;
            char text[LEGS_TEXT_MAX];
            unsigned ratio[LEGS_MAX];
            for (unsigned d = 0; d < LEGS_MAX; d++) {
                ratio[d] = (cases / 7u + d * (cases % 7u)) % (sizeof k_ratio / sizeof k_ratio[0]);
            }
            look(order, reversed, ratio, ASKED_MM, 0.1, seen);
            legs_status_t status = legs_identify(seen, LEGS_MAX, &found, text);
            if (cases % 2u == 0 || status == LEGS_TOO_ROUGH) { /* which is said, and answered by the longer way */
                look(order, reversed, ratio, LONG_MM, 0.5, seen);
                status = legs_identify(seen, LEGS_MAX, &found, text);
            }
            TEST_ASSERT_EQUAL_INT_MESSAGE(LEGS_FOUND, status, text);
            for (unsigned d = 0; d < LEGS_MAX; d++) {
                const unsigned leg = order[d];
                TEST_ASSERT_EQUAL_UINT(d, found.drive[leg]);
                TEST_ASSERT_EQUAL_INT((reversed >> d & 1u) != 0, found.is_reversed[leg]);
                TEST_ASSERT_EQUAL_UINT(k_ratio[ratio[d]][0] * found.parts[leg], k_ratio[ratio[d]][1] * found.times[leg]);
            }
            cases++;
        }
    } while (next_order(order, LEGS_MAX));
    TEST_ASSERT_EQUAL_UINT(46080, cases);
}

/* One wrong answer of one person is never taken for a machine: a cylinder that was named twice leaves one without a drive. */
static void test_every_wrong_cylinder_is_refused(void)
{
    unsigned order[LEGS_MAX] = {0, 1, 2, 3, 4, 5};
    const unsigned ratio[LEGS_MAX] = {0};
    do {
        legs_seen_t seen[LEGS_MAX];
        legs_found_t found = {.is_as_given = true}, before = found;
        char text[LEGS_TEXT_MAX];
        look(order, 0, ratio, ASKED_MM, 0, seen);
        for (unsigned d = 0; d < LEGS_MAX; d++) {
            const unsigned right = seen[d].leg;
            for (unsigned wrong = 0; wrong <= LEGS_MAX + 1u; wrong++) {
                seen[d].leg = wrong;
                if (wrong != right) {
                    const legs_status_t status = legs_identify(seen, LEGS_MAX, &found, text);
                    TEST_ASSERT_EQUAL_INT(wrong == 0 ? LEGS_NONE_MOVED : wrong > LEGS_MAX ? LEGS_NO_SUCH : LEGS_TWICE, status);
                    TEST_ASSERT_NOT_EQUAL('\0', text[0]);
                    TEST_ASSERT_EQUAL_MEMORY(&before, &found, sizeof found);
                }
            }
            seen[d].leg = right;
        }
    } while (next_order(order, LEGS_MAX));
}

static void test_mistakes_are_named(void)
{
    const unsigned order[LEGS_MAX] = {0, 4, 2, 3, 1, 5}, ratio[LEGS_MAX] = {0, 0, 1, 0, 0, 0};
    legs_seen_t seen[LEGS_MAX];
    legs_found_t found;
    char text[LEGS_TEXT_MAX];
    look(order, 1u << 3, ratio, ASKED_MM, 0, seen);
    TEST_ASSERT_EQUAL_INT(LEGS_FOUND, legs_identify(seen, LEGS_MAX, &found, text));
    TEST_ASSERT_EQUAL_STRING("Drives 2 and 5 have changed places: drive 2 moves cylinder 5, drive 5 moves cylinder 2.\n"
                             "Drive 3 moves cylinder 3 by 2 times the asked way: its lead is not the one given.\n"
                             "Drive 4 runs backwards: cylinder 4 went in where it was sent out.\n",
                             text);
    TEST_ASSERT_FALSE(found.is_as_given);
}

static void test_nothing_wrong(void)
{
    const unsigned order[LEGS_MAX] = {0, 1, 2, 3, 4, 5}, ratio[LEGS_MAX] = {0};
    legs_seen_t seen[LEGS_MAX];
    legs_found_t found;
    char text[LEGS_TEXT_MAX];
    look(order, 0, ratio, ASKED_MM, 0.7, seen);
    TEST_ASSERT_EQUAL_INT(LEGS_FOUND, legs_identify(seen, LEGS_MAX, &found, text));
    TEST_ASSERT_EQUAL_STRING("", text);
    TEST_ASSERT_TRUE(found.is_as_given);
}

/* A way is never taken for that of another screw, as roughly as people read it. */
static void test_what_is_found_is_so(void)
{
    const unsigned order[LEGS_MAX] = {0, 1, 2, 3, 4, 5};
    unsigned found_ones = 0;
    for (unsigned times = 1; times <= 5u; times++) {
        for (unsigned parts = 1; parts <= 5u; parts++) {
            for (unsigned is_long = 0; is_long < 2u; is_long++) {
                const unsigned ratio[LEGS_MAX] = {0};
                const double asked_mm = is_long != 0 ? LONG_MM : ASKED_MM;
                legs_seen_t seen[LEGS_MAX];
                legs_found_t found;
                char text[LEGS_TEXT_MAX];
                look(order, 0, ratio, asked_mm, 0, seen);
                for (int off = -1; off <= 1; off++) { /* half a mm to both sides, as whole mm are */
                    seen[2].measured_mm = asked_mm * times / parts + 0.5 * off;
                    if (legs_identify(seen, LEGS_MAX, &found, text) == LEGS_FOUND &&
                        fabs(seen[2].measured_mm - asked_mm) > 0.75) {
                        TEST_ASSERT_EQUAL_UINT_MESSAGE(times * found.parts[2], parts * found.times[2], text);
                        found_ones++;
                    }
                }
            }
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(60, found_ones);
}

/* What a tape cannot tell apart is asked for over a longer way. */
static void test_rough_ways_are_refused(void)
{
    static const double k_mm[] = {0.5, 0, 7.1, 6.4, 3.5, 63};
    const unsigned order[LEGS_MAX] = {0, 1, 2, 3, 4, 5}, ratio[LEGS_MAX] = {0};
    for (size_t i = 0; i < sizeof k_mm / sizeof k_mm[0]; i++) {
        legs_seen_t seen[LEGS_MAX];
        legs_found_t found;
        char text[LEGS_TEXT_MAX];
        look(order, 0, ratio, ASKED_MM, 0, seen);
        seen[2].measured_mm = k_mm[i];
        TEST_ASSERT_EQUAL_INT_MESSAGE(LEGS_TOO_ROUGH, legs_identify(seen, LEGS_MAX, &found, text), text);
        TEST_ASSERT_NOT_NULL(strstr(text, "Drive 3 moved"));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_exchange_and_reversal);
    RUN_TEST(test_every_wrong_cylinder_is_refused);
    RUN_TEST(test_mistakes_are_named);
    RUN_TEST(test_nothing_wrong);
    RUN_TEST(test_what_is_found_is_so);
    RUN_TEST(test_rough_ways_are_refused);
    return UNITY_END();
}

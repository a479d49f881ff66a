/* SPDX-License-Identifier: MIT
 * test_setup_lengths.c - joints from distances that were measured with a tape, and the one that was misread.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "random.h"
#include "setup/lengths.h"
#include "unity.h"

#define MACHINES 300u
#define DEGREE   (3.14159265358979323846 / 180)

void setUp(void) {}
void tearDown(void) {}

/* Not quite regular, as machines are: each joint some mm beside its place. */
static void make(lengths_set_t set, double joint[LENGTHS_JOINTS][2], double beside_mm)
{
    const double radius = 700 + 500 * random_between(-1, 1), spread = 25 + 15 * random_between(-1, 1);
    double middle[2] = {0};
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        const unsigned place = set == LENGTHS_BASE ? i : i + 1u;
        const double centre = 120.0 * (place / 2u) + (set == LENGTHS_BASE ? 0 : -60);
        const double angle = (centre + (place % 2u == 0 ? -spread / 2 : spread / 2)) * DEGREE;
        joint[i][0] = radius * cos(angle) + beside_mm * random_between(-1, 1);
        joint[i][1] = radius * sin(angle) + beside_mm * random_between(-1, 1);
        middle[0] += joint[i][0] / LENGTHS_JOINTS;
        middle[1] += joint[i][1] / LENGTHS_JOINTS;
    }
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        joint[i][0] -= middle[0];
        joint[i][1] -= middle[1];
    }
}

static void measure(double joint[LENGTHS_JOINTS][2], double off_mm, double distance_mm[LENGTHS_PAIRS])
{
    for (unsigned pair = 0; pair < LENGTHS_PAIRS; pair++) {
        unsigned a = 0, b = 0;
        lengths_pair(pair, &a, &b);
        distance_mm[pair] = hypot(joint[a][0] - joint[b][0], joint[a][1] - joint[b][1]) + off_mm * random_between(-1, 1);
    }
}

/* Largest distance of a joint from where it is, once both are turned to agree best: what a turn of the whole is, the frame says.
 */
static double worst(double is[LENGTHS_JOINTS][2], double said[LENGTHS_JOINTS][2])
{
    double sine = 0, cosine = 0, most = 0;
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        sine += said[i][0] * is[i][1] - said[i][1] * is[i][0];
        cosine += said[i][0] * is[i][0] + said[i][1] * is[i][1];
    }
    const double turn = atan2(sine, cosine);
    TEST_ASSERT_TRUE_MESSAGE(fabs(turn) < 3 * DEGREE, "the frame is turned");
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        const double x = said[i][0] * cos(turn) - said[i][1] * sin(turn), y = said[i][0] * sin(turn) + said[i][1] * cos(turn);
        most = fmax(most, hypot(x - is[i][0], y - is[i][1]));
    }
    return most;
}

static void test_pairs(void)
{
    unsigned a = 0, b = 0;
    lengths_pair(0, &a, &b);
    TEST_ASSERT_TRUE(a == 0 && b == 1);
    lengths_pair(5, &a, &b);
    TEST_ASSERT_TRUE(a == 1 && b == 2);
    lengths_pair(14, &a, &b);
    TEST_ASSERT_TRUE(a == 4 && b == 5);
}

static void test_exact_distances_give_the_joints(void)
{
    for (unsigned n = 0; n < MACHINES; n++) {
        const lengths_set_t set = n % 2u == 0 ? LENGTHS_BASE : LENGTHS_PLATE;
        double joint[LENGTHS_JOINTS][2], distance_mm[LENGTHS_PAIRS];
        lengths_found_t found;
        make(set, joint, n < 10u ? 0 : 10);
        measure(joint, 0, distance_mm);
        TEST_ASSERT_TRUE(lengths_fit(set, distance_mm, &found));
        TEST_ASSERT_TRUE(worst(joint, found.joint_mm) < 1e-3);
        TEST_ASSERT_TRUE(found.off_mm < 1e-3);
        TEST_ASSERT_TRUE(found.suspect_mm <= 0);
        if (n < 10u) { /* a regular one stands in the frame as the configuration has it */
            for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
                TEST_ASSERT_TRUE(hypot(joint[i][0] - found.joint_mm[i][0], joint[i][1] - found.joint_mm[i][1]) < 1e-3);
            }
        }
    }
}

static void test_a_tape_is_off_by_a_millimetre(void)
{
    double most = 0;
    for (unsigned n = 0; n < MACHINES; n++) {
        const lengths_set_t set = n % 2u == 0 ? LENGTHS_BASE : LENGTHS_PLATE;
        double joint[LENGTHS_JOINTS][2], distance_mm[LENGTHS_PAIRS];
        lengths_found_t found;
        make(set, joint, 10);
        measure(joint, 1, distance_mm);
        TEST_ASSERT_TRUE(lengths_fit(set, distance_mm, &found));
        TEST_ASSERT_TRUE(found.suspect_mm <= 0);
        most = fmax(most, worst(joint, found.joint_mm));
    }
    char text[64];
    (void)snprintf(text, sizeof text, "worst joint: %.2f mm", most);
    TEST_ASSERT_TRUE_MESSAGE(most < 2, text);
}

static void test_one_that_was_misread_is_named(void)
{
    for (unsigned n = 0; n < MACHINES; n++) {
        const lengths_set_t set = n % 2u == 0 ? LENGTHS_BASE : LENGTHS_PLATE;
        double joint[LENGTHS_JOINTS][2], distance_mm[LENGTHS_PAIRS];
        lengths_found_t found;
        make(set, joint, 10);
        measure(joint, 1, distance_mm);
        const unsigned wrong = n % LENGTHS_PAIRS;
        const double right_mm = distance_mm[wrong];
        distance_mm[wrong] += n % 4u < 2u ? 20 : -20;
        TEST_ASSERT_TRUE(lengths_fit(set, distance_mm, &found));
        TEST_ASSERT_EQUAL_UINT(wrong, found.suspect);
        TEST_ASSERT_TRUE(fabs(found.suspect_mm - right_mm) < 6);
        distance_mm[wrong] = found.suspect_mm; /* taken: then it is as good as measured */
        TEST_ASSERT_TRUE(lengths_fit(set, distance_mm, &found));
        TEST_ASSERT_TRUE(found.suspect_mm <= 0);
        TEST_ASSERT_TRUE(worst(joint, found.joint_mm) < 4);
    }
}

static void test_circle(void)
{
    double radius_mm = 0, spread_deg = 0;
    lengths_circle(2 * 1100 * sin(8 * DEGREE), 2 * 1100 * sin(52 * DEGREE), &radius_mm, &spread_deg);
    TEST_ASSERT_TRUE(fabs(radius_mm - 1100) < 1e-6);
    TEST_ASSERT_TRUE(fabs(spread_deg - 16) < 1e-6);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_pairs);
    RUN_TEST(test_exact_distances_give_the_joints);
    RUN_TEST(test_a_tape_is_off_by_a_millimetre);
    RUN_TEST(test_one_that_was_misread_is_named);
    RUN_TEST(test_circle);
    return UNITY_END();
}

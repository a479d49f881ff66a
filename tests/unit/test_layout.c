/* SPDX-License-Identifier: MIT
 * test_layout.c - slips in the joints of a platform: every one of a kind is made in every ready-made platform, and has to be
 * refused by its name; what nobody did wrong is not refused, however the platform is turned, scaled or measured.
 */
#define _POSIX_C_SOURCE 200809L

#include "platform/layout.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "config/config.h"
#include "platform/load.h"
#include "heave/number.h"
#include "random.h"
#include "unity.h"

static const char *const k_hexapods[] = {"demo-hexapod.ini", "hexapod-400.ini", "hexapod-435-300.ini"};
static const char *const k_tripods[] = {"tripod.ini", "tripod-rotation.ini"};
#define HEXAPODS (sizeof k_hexapods / sizeof k_hexapods[0])

static config_t m_config;
static kin_geometry_t *const m_geometry = &m_config.settings.geometry;
static char m_errors[4000];

void setUp(void) {}

void tearDown(void) {}

static void load_platform(const char *name)
{
    char path[400];
    FILE *errors = tmpfile();
    TEST_ASSERT_NOT_NULL(errors);
    snprintf(path, sizeof path, "%s/%s", HEAVE_CONFIG_DIR, name);
    TEST_ASSERT_EQUAL_INT(0, config_load(path, &m_config, errors));
    fclose(errors);
}

/* What is said to be wrong with the joints as they are now; "" for nothing. */
static const char *refusal(void)
{
    static config_source_t source;
    FILE *errors = tmpfile();
    TEST_ASSERT_NOT_NULL(errors);
    memset(&source, 0, sizeof source);
    source.path = "x.ini";
    source.errors = errors;
    source.config = &m_config;
    config_layout_check(&source);
    rewind(errors);
    m_errors[fread(m_errors, 1, sizeof m_errors - 1, errors)] = '\0';
    fclose(errors);
    TEST_ASSERT_EQUAL_INT(source.error_count > 0, m_errors[0] != '\0');
    return m_errors;
}

static void expect_refusal(const char *words)
{
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(refusal(), words), m_errors[0] == '\0' ? words : m_errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_errors, "; allowed: "), m_errors);
}

static bool is_warned(const char *words)
{
    config_text_t text;
    for (unsigned at = 0; config_layout_next_oddity(&m_config, &at, &text);) {
        if (strstr(text.data, words) != NULL)
            return true;
    }
    return false;
}

static void exchange(q16_t a[3], q16_t b[3])
{
    q16_t c[3];
    memcpy(c, a, sizeof c);
    memcpy(a, b, sizeof c);
    memcpy(b, c, sizeof c);
}

static void test_ready_made_platforms_have_nothing_odd(void)
{
    config_text_t text;
    for (unsigned i = 0; i < HEXAPODS + 2; i++) {
        unsigned at = 0;
        load_platform(i < HEXAPODS ? k_hexapods[i] : k_tripods[i - HEXAPODS]);
        TEST_ASSERT_EQUAL_STRING("", refusal());
        TEST_ASSERT_FALSE_MESSAGE(config_layout_next_oddity(&m_config, &at, &text), text.data);
    }
}

static void test_two_joints_exchanged_are_named(void)
{
    for (unsigned p = 0; p < HEXAPODS; p++) {
        for (unsigned i = 0; i < 6; i++) {
            for (unsigned k = i + 1; k < 6; k++) {
                char expected[160];
                load_platform(k_hexapods[p]);
                exchange(m_geometry->plate_mm_q16[i], m_geometry->plate_mm_q16[k]);
                snprintf(expected, sizeof expected,
                         "[geometry] plate%u_mm: plate%u and plate%u look exchanged: with them exchanged all 6", i + 1, i + 1,
                         k + 1);
                expect_refusal(expected);
                load_platform(k_hexapods[p]);
                exchange(m_geometry->base_mm_q16[i], m_geometry->base_mm_q16[k]);
                snprintf(expected, sizeof expected, "[geometry] base%u_mm: base%u and base%u look exchanged", i + 1, i + 1,
                         k + 1);
                expect_refusal(expected);
            }
        }
    }
}

static void test_two_joints_of_a_tripod_exchanged_are_named(void)
{
    load_platform("tripod.ini");
    exchange(m_geometry->plate_mm_q16[0], m_geometry->plate_mm_q16[2]);
    expect_refusal("[geometry] plate1_mm: plate1 and plate3 look exchanged");
}

static void test_plate_numbered_from_another_place_is_named(void)
{
    for (unsigned p = 0; p < HEXAPODS; p++) {
        for (unsigned places = 1; places < 6; places++) {
            char expected[160];
            q16_t plate[6][3];
            load_platform(k_hexapods[p]);
            memcpy(plate, m_geometry->plate_mm_q16, sizeof plate);
            for (unsigned i = 0; i < 6; i++)
                memcpy(m_geometry->plate_mm_q16[i], plate[(i + places) % 6], sizeof plate[0]);
            snprintf(expected, sizeof expected,
                     "the plate's joints look numbered from the wrong place: with plate%u as plate1, and on in that order all 6",
                     (6 - places) % 6 + 1);
            expect_refusal(expected);
        }
    }
}

/* Base with the clock, plate against it, from the front. */
static void test_plate_numbered_the_other_way_round_is_named(void)
{
    for (unsigned p = 0; p < HEXAPODS; p++) {
        load_platform(k_hexapods[p]);
        exchange(m_geometry->plate_mm_q16[0], m_geometry->plate_mm_q16[1]);
        exchange(m_geometry->plate_mm_q16[2], m_geometry->plate_mm_q16[5]);
        exchange(m_geometry->plate_mm_q16[3], m_geometry->plate_mm_q16[4]);
        expect_refusal("run the other way round than those of the base's: with plate2 as plate1, and on against that order");
    }
}

static void test_metres_are_named(void)
{
    for (unsigned p = 0; p < HEXAPODS + 2; p++) {
        load_platform(p < HEXAPODS ? k_hexapods[p] : k_tripods[p - HEXAPODS]);
        for (unsigned i = 0; i < 6; i++) {
            for (unsigned k = 0; k < 3; k++)
                m_geometry->base_mm_q16[i][k] /= 1000;
        }
        expect_refusal("[geometry] base1_mm: joints of the base not beyond ");
        expect_refusal(" mm look like metres");
        m_config.is_as_measured = true;
        TEST_ASSERT_EQUAL_STRING("", refusal());
    }
}

/* Both digits of one pair exchanged. Returns false where that is no other number. */
static bool exchange_digits(q16_t *value_q16, unsigned at)
{
    config_text_t text;
    q16_t other_q16 = 0;
    config_text_clear(&text);
    config_text_add_q16(&text, *value_q16);
    if (at + 1 >= text.length || text.data[at] == '-' || text.data[at] == '.' || text.data[at + 1] == '.')
        return false;
    const char digit = text.data[at];
    text.data[at] = text.data[at + 1];
    text.data[at + 1] = digit;
    if (number_parse(text.data, text.length, &other_q16) != NUMBER_OK || other_q16 == *value_q16)
        return false;
    *value_q16 = other_q16;
    return true;
}

static double length_of(unsigned i)
{
    double sum = 0;
    for (unsigned k = 0; k < 3; k++) {
        const double way =
            m_geometry->plate_mm_q16[i][k] - m_geometry->base_mm_q16[i][k] + (k == 2 ? m_geometry->zero_height_mm_q16 : 0);
        sum += way * way / 65536 / 65536;
    }
    return sqrt(sum);
}

/* What makes a cylinder longer or shorter is found wherever it is; the words name the joint, or one that explains it as well. */
static void test_two_digits_exchanged_are_refused(void)
{
    unsigned slips = 0, named = 0;
    for (unsigned p = 0; p < HEXAPODS; p++) {
        for (unsigned at = 0; at < 36u * 8u; at++) {
            const unsigned i = at / 8u / 3u % 6u, k = at / 8u % 3u;
            load_platform(k_hexapods[p]);
            q16_t *value_q16 = &(at / 8u < 18u ? m_geometry->base_mm_q16 : m_geometry->plate_mm_q16)[i][k];
            const double right_mm = length_of(i);
            if (!exchange_digits(value_q16, at % 8u) || fabs(length_of(i) - right_mm) < 1.1)
                continue;
            char expected[160];
            slips++;
            snprintf(expected, sizeof expected, "%c of %s%u looks", "xyz"[k], at / 8u < 18u ? "base" : "plate", i + 1);
            named += strstr(refusal(), expected) != NULL;
            TEST_ASSERT_NOT_EQUAL_MESSAGE('\0', m_errors[0], expected);
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(100, slips);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(slips * 95u / 100u, named);
}

static void test_the_digit_of_the_example_is_named_with_its_value(void)
{
    load_platform("can-raw-hexapod.ini");
    m_geometry->base_mm_q16[0][0] = (q16_t)(482.391 * 65536 + 0.5);
    expect_refusal(
        "[geometry] base1_mm: x of base1 looks as if two of its digits were exchanged: with 428.391 all 6 extensions at pose "
        "zero agree within 0.1 mm");
    load_platform("can-raw-hexapod.ini");
    m_geometry->plate_mm_q16[2][1] = -m_geometry->plate_mm_q16[2][1];
    expect_refusal("y of plate3 looks as if its sign were wrong: with 408.766 ");
}

/* A joint that nothing else tells from its mirror image: the others, which stand round the middle, do. */
static void test_every_wrong_sign_is_named(void)
{
    for (unsigned p = 0; p < HEXAPODS; p++) {
        for (unsigned at = 0; at < 36u; at++) {
            const unsigned i = at / 3u % 6u, k = at % 3u;
            load_platform(k_hexapods[p]);
            q16_t *value_q16 = &(at < 18u ? m_geometry->base_mm_q16 : m_geometry->plate_mm_q16)[i][k];
            *value_q16 = -*value_q16;
            if (*value_q16 == 0)
                continue;
            char expected[160];
            snprintf(expected, sizeof expected, "%c of %s%u looks as if its sign were wrong", "xyz"[k],
                     at < 18u ? "base" : "plate", i + 1);
            expect_refusal(expected);
        }
    }
}

/* --- Nothing wrong --- */

static void turn(q16_t joint[3], double angle, double scale, double noise_mm)
{
    const double x = joint[0], y = joint[1];
    joint[0] = (q16_t)((x * cos(angle) - y * sin(angle)) * scale + random_between(-1, 1) * noise_mm * 65536);
    joint[1] = (q16_t)((x * sin(angle) + y * cos(angle)) * scale + random_between(-1, 1) * noise_mm * 65536);
    joint[2] += (q16_t)(random_between(-1, 1) * noise_mm * 65536);
}

/* A tape measures to some mm, and nobody has to put cylinder 1 in front. */
static void test_platforms_measured_with_a_tape_are_not_refused(void)
{
    for (unsigned run = 0; run < 3000; run++) {
        load_platform(run % 100u == 0 ? k_hexapods[run / 100u % HEXAPODS] : "demo-hexapod.ini");
        const double angle = random_between(-1, 1) * 3.14, noise_mm = run % 3u * 2.0;
        for (unsigned i = 0; i < 6; i++) {
            turn(m_geometry->base_mm_q16[i], angle, 1, noise_mm);
            turn(m_geometry->plate_mm_q16[i], angle, 1, noise_mm);
        }
        TEST_ASSERT_EQUAL_STRING("", refusal());
    }
}

/* Two kinds of cylinders, a plate that is no circle: there is no symmetry to be broken. */
static void test_platform_without_symmetry_is_not_refused(void)
{
    for (unsigned run = 0; run < 3000; run++) {
        load_platform("hexapod-400.ini");
        for (unsigned i = 0; i < 6; i++) {
            turn(m_geometry->base_mm_q16[i], 0, 1, 60);
            turn(m_geometry->plate_mm_q16[i], 0, 1, 60);
        }
        TEST_ASSERT_EQUAL_STRING("", refusal());
    }
}

/* --- What may be meant --- */

static void test_as_measured_makes_a_warning_of_it(void)
{
    load_platform("hexapod-400.ini");
    exchange(m_geometry->plate_mm_q16[0], m_geometry->plate_mm_q16[1]);
    m_config.is_as_measured = true;
    TEST_ASSERT_EQUAL_STRING("", refusal());
    TEST_ASSERT_TRUE(is_warned("[geometry] plate1 and plate2 look exchanged"));
    TEST_ASSERT_TRUE(is_warned("[geometry] cylinders 1 and 2 cross each other, seen from above"));
}

static void test_mirrored_frame_is_warned_of(void)
{
    for (unsigned p = 0; p < HEXAPODS + 2; p++) {
        load_platform(p < HEXAPODS ? k_hexapods[p] : k_tripods[p - HEXAPODS]);
        for (unsigned i = 0; i < 6; i++) {
            m_geometry->base_mm_q16[i][1] = -m_geometry->base_mm_q16[i][1];
            m_geometry->plate_mm_q16[i][1] = -m_geometry->plate_mm_q16[i][1];
        }
        TEST_ASSERT_TRUE(is_warned("numbered against the clock, seen from above"));
        TEST_ASSERT_EQUAL_STRING("", refusal());
    }
}

/* Both joints of two cylinders exchanged: somebody may have numbered them so. */
static void test_numbers_that_do_not_go_round_are_warned_of(void)
{
    for (unsigned p = 0; p < HEXAPODS; p++) {
        load_platform(k_hexapods[p]);
        TEST_ASSERT_FALSE(is_warned("not numbered one after the other"));
        exchange(m_geometry->base_mm_q16[1], m_geometry->base_mm_q16[4]);
        exchange(m_geometry->plate_mm_q16[1], m_geometry->plate_mm_q16[4]);
        TEST_ASSERT_EQUAL_STRING("", refusal());
        TEST_ASSERT_TRUE(is_warned("[geometry] the cylinders are not numbered one after the other round the platform"));
    }
}

static void test_tilted_neutral_and_a_leg_that_sticks_out_are_warned_of(void)
{
    load_platform("hexapod-400.ini");
    m_config.settings.neutral_q16[AXIS_PITCH] = 3 * 65536;
    TEST_ASSERT_TRUE(is_warned("[pose] neutral is not level: roll 0 deg, pitch 3 deg"));
    m_geometry->retracted_mm_q16[3] -= 17 * 65536;
    TEST_ASSERT_TRUE(
        is_warned("[geometry] cylinder 4 is 17.0 mm further out than the others at pose zero, which agree within 0.1 mm"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_ready_made_platforms_have_nothing_odd);
    RUN_TEST(test_two_joints_exchanged_are_named);
    RUN_TEST(test_two_joints_of_a_tripod_exchanged_are_named);
    RUN_TEST(test_plate_numbered_from_another_place_is_named);
    RUN_TEST(test_plate_numbered_the_other_way_round_is_named);
    RUN_TEST(test_metres_are_named);
    RUN_TEST(test_two_digits_exchanged_are_refused);
    RUN_TEST(test_the_digit_of_the_example_is_named_with_its_value);
    RUN_TEST(test_every_wrong_sign_is_named);
    RUN_TEST(test_platforms_measured_with_a_tape_are_not_refused);
    RUN_TEST(test_platform_without_symmetry_is_not_refused);
    RUN_TEST(test_as_measured_makes_a_warning_of_it);
    RUN_TEST(test_mirrored_frame_is_warned_of);
    RUN_TEST(test_numbers_that_do_not_go_round_are_warned_of);
    RUN_TEST(test_tilted_neutral_and_a_leg_that_sticks_out_are_warned_of);
    return UNITY_END();
}

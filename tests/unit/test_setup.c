/* SPDX-License-Identifier: MIT
 * test_setup.c - the conversation without a machine: which step comes next, what is refused and in which words, and that the
 * answers are on the disk as a whole.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "setup/setup.h"
#include "unity.h"

static setup_t s_setup, s_other;
static ini_text_t s_text;
static char s_error[SETUP_ERROR_MAX];

void setUp(void)
{
    memset(&s_setup, 0, sizeof s_setup);
}
void tearDown(void) {}

static setup_question_t next(void)
{
    setup_question_t question;
    setup_next(&s_setup, &question);
    return question;
}

/* The step that has to be next, and its answer. */
static bool answer(const char *key, const char *text)
{
    const setup_question_t question = next();
    TEST_ASSERT_EQUAL_STRING(key, question.key);
    return setup_accept(&s_setup, &question, text, s_error);
}

static void say(const char *key, const char *text)
{
    TEST_ASSERT_TRUE_MESSAGE(answer(key, text), s_error);
}

static void refuse(const char *key, const char *text, const char *why)
{
    const unsigned count = s_setup.count;
    TEST_ASSERT_FALSE_MESSAGE(answer(key, text), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(s_error, why), s_error);
    TEST_ASSERT_EQUAL_UINT(count, s_setup.count);
}

static void begin(void)
{
    say("start", "");
    say("start.found", "none");
    say("cylinders", "");
}

static void to_drives(void)
{
    begin();
    say("geometry", "s");
    say("base.near", "306.18");
    say("base.far", "1733.62 mm");
    say("plate.near", "281.58");
    say("plate.far", "1398.3");
    say("sizes.ok", "y");
    say("retracted", "1300");
    say("stroke", "400");
    say("geometry.check", "right");
    say("drives", "c");
    say("interface", "");
    say("scan", "1,2,3,4,5,6,9");
}

static void to_legs(void)
{
    to_drives();
    say("nodes", "");
    say("turn", "131072");
    say("gear", "");
    say("lead", "10");
    say("accel", "");
    say("speed", "");
    say("jerk", "");
    say("margin", "");
    say("settled", "");
    say("legs.ready", "y");
    say("legs.room", "y");
}

/* Drive d is on cylinder leg[d]. */
static void look_at_legs(const unsigned leg[6], unsigned reversed, unsigned twice)
{
    char key[32], text[32];
    for (unsigned d = 1; d <= 6u; d++) {
        (void)snprintf(key, sizeof key, "legs.way.%u", d);
        say(key, "5.00");
        (void)snprintf(key, sizeof key, "legs.moved.%u", d);
        (void)snprintf(text, sizeof text, "%u", leg[d - 1u]);
        say(key, text);
        (void)snprintf(key, sizeof key, "legs.direction.%u", d);
        say(key, d == reversed ? "s" : "l");
        (void)snprintf(key, sizeof key, "legs.measured.%u", d);
        say(key, d == twice ? "10" : "5");
    }
}

static void expect(const char *section, const char *key, const char *value)
{
    char is[INI_VALUE_MAX];
    TEST_ASSERT_TRUE_MESSAGE(ini_text_get(&s_text, section, key, is), key);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(value, is, key);
}

static void test_numbers_are_refused_by_name(void)
{
    begin();
    say("geometry", "s");
    refuse("base.near", "306,18", "a decimal point, not a comma");
    refuse("base.near", "three", "is no number of mm");
    refuse("base.near", "306 cm", "is no number of mm");
    refuse("base.near", "0.306", "In mm, not in metres");
    refuse("base.near", "-306", "allowed are 10 to 4000 mm");
    refuse("base.near", "nan", "is no number");
    refuse("base.near", "", "an answer is needed");
    refuse("base.near", "\x1b[A", "control character");
    say("base.near", "306.18 mm");
    refuse("base.far", "300", "the two look exchanged");
}

static void test_choices_and_joints_are_refused_by_name(void)
{
    refuse("start", "no-such-platform", "no such platform");
    refuse("start", "./no-such.ini", "No such file");
    begin();
    refuse("geometry", "yes", "\"yes\" is none of the answers");
    refuse("geometry", "k", "none of the answers"); /* there is no file to keep */
    say("geometry", "j");
    refuse("base.joint.1", "1089.3; 153", "two or three numbers");
    refuse("base.joint.1", "1.0893, 0.153", "not in metres");
    say("base.joint.1", "1089.3, -153.1");
}

static void test_addresses_are_refused_by_name(void)
{
    to_drives();
    refuse("nodes", "1,2,3", "6 numbers are needed");
    refuse("nodes", "1,2,3,4,5,5", "5 stands there twice");
    refuse("nodes", "1,2,3,4,5,7", "nobody answers at 7");
    refuse("nodes", "1,2,3,4,5,x", "6 numbers are needed");
    say("nodes", "a"); /* looks again */
    say("scan", "none");
    TEST_ASSERT_NOT_NULL(strstr(next().text, "0 of 6 drives answer"));
    refuse("nodes", "1,2,3,4,5,6", "nobody answers at 1");
    say("nodes", "a");
    say("scan", "1,2,3,4,5,6");
    say("nodes", "");
    refuse("turn", "1000.5", "a whole number of counts");
}

static void test_legs_end_in_the_configuration(void)
{
    static const unsigned k_leg[6] = {1, 5, 3, 4, 2, 6};
    static const double k_counts[6] = {0, 0, 0, 0, 0, 0};
    to_legs();
    refuse("legs.way.1", "", "an answer is needed");
    look_at_legs(k_leg, 4, 3);
    const setup_question_t verdict = next();
    TEST_ASSERT_NOT_NULL(strstr(verdict.text, "Drives 2 and 5 have changed places"));
    TEST_ASSERT_NOT_NULL(strstr(verdict.text, "Drive 4 runs backwards"));
    TEST_ASSERT_NOT_NULL(strstr(verdict.text, "2 times the asked way"));
    say("legs.verdict", "y");
    setup_configure(&s_setup, SETUP_STAGE_BUS, k_counts, &s_text);
    expect("cia402", "nodes", "1, 2, 3, 4, 5, 6");
    expect("drives", "lead_mm", "10, 10, 10, 10, 10, 10");
    setup_configure(&s_setup, SETUP_STAGE_LEGS, k_counts, &s_text);
    expect("cia402", "nodes", "1, 5, 3, 4, 2, 6");
    expect("drives", "lead_mm", "10, 10, 20, -10, 10, 10");
    expect("cia402", "zero_counts", "-2621440, -2621440, -1310720, 2621440, -2621440, -2621440");
    TEST_ASSERT_TRUE(fabs(next().way_mm + 5) < 1e-9); /* each goes back to where it stood */
    say("again.way.1", "-5.00");
    say("again.right.1", "y");
    say("again.way.2", "-5.00");
    say("again.right.2", "y");
    TEST_ASSERT_TRUE(fabs(next().way_mm + 10) < 1e-9);
    say("again.way.3", "-10.00");
    say("again.right.3", "y");
    TEST_ASSERT_TRUE(fabs(next().way_mm - 5) < 1e-9);
    say("again.way.4", "5.00");
    say("again.right.4", "n"); /* all of them once more */
    TEST_ASSERT_EQUAL_STRING("legs.ready", next().key);
}

static void test_a_wrong_leg_is_looked_at_again(void)
{
    static const unsigned k_leg[6] = {1, 2, 3, 3, 5, 6};
    to_legs();
    look_at_legs(k_leg, 0, 0);
    TEST_ASSERT_NOT_NULL(strstr(next().text, "Drives 3 and 4 are both said to move cylinder 3"));
    refuse("legs.verdict", "y", "none of the answers");
    say("legs.verdict", "n");
    TEST_ASSERT_EQUAL_STRING("legs.ready", next().key);
}

static void test_zero_of_the_tape(void)
{
    static const unsigned k_leg[6] = {1, 2, 3, 4, 5, 6};
    char key[32];
    to_legs();
    look_at_legs(k_leg, 2, 0);
    say("legs.verdict", "y");
    for (unsigned k = 1; k <= 6u; k++) {
        (void)snprintf(key, sizeof key, "again.way.%u", k);
        say(key, "-5");
        (void)snprintf(key, sizeof key, "again.right.%u", k);
        say(key, "y");
    }
    say("zero.kind", "h");
    refuse("zero.method", "0", "not 0");
    refuse("zero.method", "17.5", "a whole number");
    say("zero.method", "17");
    say("zero.home", "homed");
    TEST_ASSERT_EQUAL_INT(SETUP_STAGE_ZERO, next().stage);
    say("zero.counts", "0,100,0,0,0,0");
    say("zero.length.1", "400");
    TEST_ASSERT_NOT_NULL(strstr(next().text, "Cylinder 1 was measured as 400 mm long. It is 1300 mm long fully in"));
    say("zero.beyond.1", "l");
    say("zero.length.1", "1300");
    say("zero.length.2", "1703"); /* within what a tape and play are off */
    say("zero.length.3", "1710");
    TEST_ASSERT_NOT_NULL(strstr(next().text, "and 1700 mm fully out, as it was said"));
    say("zero.beyond.3", "s");
    say("retracted", "1305");
    say("stroke", "410");
    say("geometry.check", "right");
    say("zero.length.4", "1305"); /* what was measured stays */
}

static void say_each(const char *key, unsigned index, const char *text)
{
    char name[SETUP_KEY_MAX];
    (void)snprintf(name, sizeof name, "%s.%u", key, index);
    say(name, text);
}

static void look_again(void)
{
    for (unsigned k = 1; k <= 6u; k++) {
        say_each("again.way", k, "-5");
        say_each("again.right", k, "y");
    }
}

static void measure(void)
{
    say("zero.counts", "0,0,0,0,0,0");
    for (unsigned k = 1; k <= 6u; k++) {
        say_each("zero.length", k, "1400");
    }
    say("zero.same", "same");
    say("zero.pose", "0,0,0,0,0,900");
    say("zero.right", "y");
}

static void to_rise(void)
{
    static const unsigned k_leg[6] = {1, 2, 3, 4, 5, 6};
    to_legs();
    look_at_legs(k_leg, 0, 0);
    say("legs.verdict", "y");
    look_again();
    say("zero.kind", "a");
    measure();
    say("limits", "shown");
    say("limits.take", "y");
    say("relays.kind", "n");
    say("switches.kind", "n");
    say("switches.bare", "y");
    say("rise.ready", "y");
    say("rise.way", "20.0");
    say("rise.right", "y");
}

static void to_tilts(void)
{
    to_rise();
    say("supply.counts", "1,1,1,1,1,1");
    say("supply.off", "s");
}

static void tilt(unsigned front, unsigned right)
{
    char hour[8];
    say("tilt.way.1", "0.7");
    (void)snprintf(hour, sizeof hour, "%u", front);
    say("tilt.low.1", hour);
    TEST_ASSERT_TRUE(fabs(next().way_mm + 0.7) < 1e-9); /* back, level */
    say("tilt.way.2", "-0.7");
    say("tilt.way.3", "-1.0");
    (void)snprintf(hour, sizeof hour, "%u", right);
    say("tilt.low.3", hour);
    TEST_ASSERT_TRUE(fabs(next().way_mm - 1) < 1e-9);
    say("tilt.way.4", "1.0");
    TEST_ASSERT_EQUAL_STRING("tilt.verdict", next().key);
}

/* Numbers from another side, and the other way round, are known by where the plate leans, also by somebody who is an hour off. */
static void test_front_is_found(void)
{
    for (unsigned thirds = 0; thirds < 3u; thirds++) {
        for (unsigned mirrored = 0; mirrored < 2u; mirrored++) {
            for (int off = -1; off <= 1; off++) {
                memset(&s_setup, 0, sizeof s_setup);
                to_tilts();
                const int front = (int)(4u * thirds), right = mirrored != 0 ? front - 3 : front + 3;
                tilt((unsigned)(front + off + 23) % 12u + 1u, (unsigned)(right + 23) % 12u + 1u);
                if (thirds == 0 && mirrored == 0) {
                    say("tilt.verdict", "");
                    TEST_ASSERT_EQUAL_STRING("ends.way.1", next().key);
                    continue;
                }
                refuse("tilt.verdict", "y", "none of the answers");
                say("tilt.verdict", "r");
                TEST_ASSERT_EQUAL_STRING("again.way.1",
                                         next().key); /* each is looked at with its new number, and measured anew */
                for (unsigned drive = 1; drive <= 6u; drive++) {
                    /* a cylinder stands at its own hour: pairs at 12, 4 and 8; 1, 3 and 5 before, the others behind */
                    char key[SETUP_KEY_MAX];
                    (void)snprintf(key, sizeof key, "legs.moved.%u", drive);
                    const int half = 8 * (int)((drive - 1u) / 2u) + (drive % 2u == 0 ? 1 : -1);
                    const int is = mirrored != 0 ? 2 * front - half : 2 * front + half;
                    const int turned = ((is + 1) % 24 + 24) % 24;
                    TEST_ASSERT_EQUAL_INT(turned / 8 * 2 + (turned % 8 == 2) + 1, atoi(setup_get(&s_setup, key)));
                }
                look_again();
                measure();
                say("rise.ready", "y"); /* what was answered before stays */
                TEST_ASSERT_EQUAL_STRING("rise.way", next().key);
            }
        }
    }
}

static void test_what_leans_like_nothing_is_looked_at_again(void)
{
    to_tilts();
    tilt(12, 12);
    TEST_ASSERT_NOT_NULL(strstr(next().text, "No other numbers"));
    refuse("tilt.verdict", "r", "none of the answers");
    say("tilt.verdict", "a");
    TEST_ASSERT_EQUAL_STRING("tilt.way.1", next().key);
    tilt(6, 9); /* half a turn: no pair of cylinders stands there */
    say("tilt.verdict", "m");
    TEST_ASSERT_EQUAL_STRING("zero.counts", next().key);
}

static void test_encoders_without_supply(void)
{
    to_rise();
    say("supply.counts", "1,1,1,1,1,1");
    say("supply.off", "y");
    say("supply.same", "moved");
    say("supply.lost", "h");
    TEST_ASSERT_EQUAL_STRING("zero.method", next().key);
    say("zero.method", "17");
    say("zero.home", "homed");
    TEST_ASSERT_EQUAL_STRING("zero.counts", next().key);
    TEST_ASSERT_EQUAL_STRING("The encoders lose their counts with the supply: the drives home after each start.",
                             setup_get(&s_setup, "note.1") != NULL && strstr(setup_get(&s_setup, "note.1"), "encoders") != NULL
                                 ? setup_get(&s_setup, "note.1")
                                 : setup_get(&s_setup, "note.2"));
}

static void test_an_end_that_comes_too_early(void)
{
    to_tilts();
    tilt(12, 3);
    say("tilt.verdict", "");
    TEST_ASSERT_TRUE(next().way_mm < 0);
    say("ends.way.1", "there");
    TEST_ASSERT_TRUE(next().way_mm > 0);
    say("ends.way.2", "stopped 4 251.0");
    TEST_ASSERT_NOT_NULL(strstr(next().text, "Cylinder 4 went no further out than to 251.0 mm of its 400 mm"));
    say("ends.wrong.2", "a");
    say("ends.way.1", "stopped 2 31.0");
    TEST_ASSERT_NOT_NULL(strstr(next().text, "Cylinder 2 went no further in than to 31.0 mm of its 400 mm"));
    say("ends.wrong.1", "s");
    say("retracted", "1300");
    say("stroke", "250");
    say("geometry.check", "right");
    say("limits", "shown");
    say("limits.take", "y");
    TEST_ASSERT_EQUAL_STRING("ends.way.1", next().key);
    setup_configure(&s_setup, SETUP_STAGE_FULL, NULL, &s_text);
    expect("geometry", "stroke_mm", "250");
}

static void test_serial_numbers_go_with_their_drives(void)
{
    static const unsigned k_leg[6] = {1, 5, 3, 4, 2, 6};
    begin();
    say("geometry", "s");
    say("base.near", "306.18");
    say("base.far", "1733.62 mm");
    say("plate.near", "281.58");
    say("plate.far", "1398.3");
    say("sizes.ok", "y");
    say("retracted", "1300");
    say("stroke", "400");
    say("geometry.check", "right");
    say("drives", "c");
    say("interface", "");
    say("scan", "1/0x11,2/0x22,3,4/0x44,5/0x55,6/0x66,9/0x99");
    TEST_ASSERT_NOT_NULL(strstr(next().text, "7 drives answer: 1,2,3,4,5,6,9."));
    refuse("nodes", "1,2,3,4,5,7", "allowed are those that do: 1,2,3,4,5,6,9");
    say("nodes", "9,2,3,4,5,6");
    say("turn", "131072");
    say("gear", "");
    say("lead", "10");
    say("accel", "");
    say("speed", "");
    say("jerk", "");
    say("margin", "");
    say("settled", "");
    say("legs.ready", "y");
    say("legs.room", "y");
    look_at_legs(k_leg, 0, 0);
    say("legs.verdict", "y");
    setup_configure(&s_setup, SETUP_STAGE_LEGS, NULL, &s_text);
    expect("cia402", "nodes", "9, 5, 3, 4, 2, 6");
    expect("cia402", "serial_numbers", "0x99, 0x55, 0, 0x44, 0x22, 0x66");
}

static void test_back_takes_one_answer(void)
{
    TEST_ASSERT_FALSE(setup_back(&s_setup));
    to_drives();
    TEST_ASSERT_TRUE(setup_back(&s_setup)); /* what was done since goes with it */
    TEST_ASSERT_EQUAL_STRING("interface", next().key);
    TEST_ASSERT_TRUE(setup_back(&s_setup));
    TEST_ASSERT_EQUAL_STRING("drives", next().key);
    TEST_ASSERT_TRUE(setup_back(&s_setup));
    TEST_ASSERT_EQUAL_STRING("stroke", next().key);
}

static void test_kept_on_the_disk(void)
{
    char path[] = "/tmp/test_setup_XXXXXX";
    const int fd = mkstemp(path);
    TEST_ASSERT_TRUE(fd >= 0);
    (void)close(fd);
    to_drives();
    TEST_ASSERT_TRUE(setup_save(&s_setup, path));
    TEST_ASSERT_TRUE(setup_load(&s_other, path));
    TEST_ASSERT_EQUAL_UINT(s_setup.count, s_other.count);
    TEST_ASSERT_EQUAL_MEMORY(s_setup.answer, s_other.answer, s_setup.count * sizeof s_setup.answer[0]);
    static const char *const k_bad[] = {"", "{", "[1]", "{\"heave_setup\": 2, \"answers\": []}",
                                        "{\"heave_setup\": 1, \"answers\": [[\"a\"]]}"};
    for (size_t i = 0; i < sizeof k_bad / sizeof k_bad[0]; i++) {
        FILE *file = fopen(path, "w");
        TEST_ASSERT_NOT_NULL(file);
        (void)fputs(k_bad[i], file);
        (void)fclose(file);
        TEST_ASSERT_FALSE(setup_load(&s_other, path));
        TEST_ASSERT_EQUAL_INT(EINVAL, errno);
        TEST_ASSERT_EQUAL_UINT(0, s_other.count);
    }
    (void)unlink(path);
    TEST_ASSERT_FALSE(setup_load(&s_other, path));
    TEST_ASSERT_EQUAL_INT(ENOENT, errno);
}

static void test_ini_text(void)
{
    char value[INI_VALUE_MAX];
    ini_text_load(&s_text, "; head\n[a]\nx = 1 ; one\n;y = 2\n\n; of b\n[b]\nx = 5\n");
    ini_text_set(&s_text, "a", "x", "3", NULL);
    ini_text_set(&s_text, "a", "y", "4", "four");
    ini_text_set(&s_text, "a", "z", "5", NULL);
    ini_text_set(&s_text, "c", "w", "6", NULL);
    TEST_ASSERT_EQUAL_STRING("; head\n[a]\nx = 3\ny = 4  ; four\nz = 5\n\n; of b\n[b]\nx = 5\n\n[c]\nw = 6\n", s_text.text);
    ini_text_drop(&s_text, "b", "x");
    TEST_ASSERT_FALSE(ini_text_get(&s_text, "b", "x", value));
    TEST_ASSERT_TRUE(ini_text_get(&s_text, "a", "y", value));
    TEST_ASSERT_EQUAL_STRING("4", value);
    TEST_ASSERT_FALSE(s_text.is_cut);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_numbers_are_refused_by_name);
    RUN_TEST(test_choices_and_joints_are_refused_by_name);
    RUN_TEST(test_addresses_are_refused_by_name);
    RUN_TEST(test_legs_end_in_the_configuration);
    RUN_TEST(test_a_wrong_leg_is_looked_at_again);
    RUN_TEST(test_zero_of_the_tape);
    RUN_TEST(test_front_is_found);
    RUN_TEST(test_what_leans_like_nothing_is_looked_at_again);
    RUN_TEST(test_encoders_without_supply);
    RUN_TEST(test_an_end_that_comes_too_early);
    RUN_TEST(test_serial_numbers_go_with_their_drives);
    RUN_TEST(test_back_takes_one_answer);
    RUN_TEST(test_kept_on_the_disk);
    RUN_TEST(test_ini_text);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_request_table.c - what each request of the control socket is, who may ask for it, and what it may do.
 */
#include "service/request_table.h"

#include <string.h>

#include "unity.h"

void setUp(void) {}

void tearDown(void) {}

static void test_request_level_of_each_request(void)
{
    static const struct {
        const char *request;
        level_t level;
    } k_rows[] = {
        {"status", LEVEL_LOOK},
        {"watch 5", LEVEL_LOOK},
        {"hold", LEVEL_LOOK},
        {"by anna", LEVEL_LOOK},
        {"nonsense", LEVEL_LOOK},
        {"engage", LEVEL_OPERATE},
        {"resume", LEVEL_OPERATE},
        {"park", LEVEL_OPERATE},
        {"intensity 0", LEVEL_OPERATE},
        {"intensity 40", LEVEL_OPERATE},
        {"intensity 41", LEVEL_SERVICE},
        {"intensity 100", LEVEL_SERVICE},
        {"service", LEVEL_SERVICE},
        {"service-off", LEVEL_SERVICE},
        {"torque 1 on", LEVEL_SERVICE},
        {"jog 1 5 1", LEVEL_SERVICE},
        {"home all 1", LEVEL_SERVICE},
        {"relay 1 1", LEVEL_SERVICE},
        {"beat 1 1 1", LEVEL_SERVICE},
        {"release 1", LEVEL_SERVICE},
        {"tick", LEVEL_LOOK},
        {"counts", LEVEL_LOOK},
        {"intensity -1", LEVEL_SERVICE},
        {"intensity ", LEVEL_SERVICE},
        {"intensity 0040", LEVEL_SERVICE},
        {"reset", LEVEL_SERVICE},
        {"shutdown", LEVEL_SERVICE},
        {"dump", LEVEL_SERVICE},
        {"incidents", LEVEL_LOOK},
        {"seen", LEVEL_OPERATE},
        {"acknowledge", LEVEL_SERVICE},
        {"commissioned", LEVEL_SERVICE},
        {"sdo 1 6041:00", LEVEL_SERVICE},
        {"sdo 1 6083:00 5", LEVEL_SERVICE},
    };
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].level, request_level(k_rows[i].request, 40), k_rows[i].request);
    }
}

static void test_request_read_what_can_start_or_enlarge_a_motion(void)
{
    static const char *const k_moving[] = {
        "engage",      "resume",        "park",        "reset",           "shutdown",
        "service",     "intensity 41",

        "torque 1 on", "torque all on", "acknowledge", "selftest passed", "configure 0123456789abcdef",
        "commissioned"};
    static const char *const k_others[] = {
        "hold",  "release 5", "service-off", "intensity 40",    "intensity 0", "torque 1 off", "torque all off", "status",
        "watch", "dump",      "seen",        "selftest failed", "selftest",    "by on",        "beat 1 1 1",     ""};
    for (size_t i = 0; i < sizeof k_moving / sizeof k_moving[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(request_read(k_moving[i], 40).is_moving, k_moving[i]);
    }
    for (size_t i = 0; i < sizeof k_others / sizeof k_others[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(request_read(k_others[i], 40).is_moving, k_others[i]);
    }
}

static void test_request_read_what_somebody_holds(void)
{
    TEST_ASSERT_TRUE(request_read("jog 3 2 5", 40).is_held && request_read("signal z sine 1 1 9 5", 40).is_held &&
                     request_read("home all 5", 40).is_held && request_read("relay 2 5", 40).is_held);
    TEST_ASSERT_FALSE(request_read("hold", 40).is_held || request_read("beat 1 1 1", 40).is_held ||
                      request_read("release 5", 40).is_held || request_read("torque 1 on", 40).is_held);
}

static void expect(const char *line, request_kind_t kind, const char *words)
{
    const request_t request = request_read(line, 40);
    TEST_ASSERT_EQUAL_MESSAGE(kind, request.kind, line);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(words, request.words, line);
}

static void test_request_read_names_stand_whole_and_words_behind_one_blank(void)
{
    expect("status", REQUEST_STATUS, "");
    expect("watch", REQUEST_WATCH, "");
    expect("watch 5", REQUEST_WATCH, "5");
    expect("intensity 40", REQUEST_INTENSITY, "40");
    expect("by anna  b", REQUEST_BY, "anna  b");
    expect("configure 0123", REQUEST_CONFIGURE, "0123");
    expect("selftest", REQUEST_SELFTEST, "");
    expect("selftest passed", REQUEST_SELFTEST_PASSED, "");
    expect("selftest failed", REQUEST_SELFTEST_FAILED, "");
    expect("service-off", REQUEST_STATE, "service-off");
    expect("jog 1 5 1", REQUEST_HAND, "jog 1 5 1");
    expect("sdo", REQUEST_OBJECT, "sdo");
}

static void test_request_read_everything_else_is_unknown_and_takes_no_level(void)
{
    static const char *const k_lines[] = {
        "",         " ",    "statu",     "statusx",    "status ",          "Engage",           "engage now",
        "watchdog", "by",   "intensity", "configure",  "selftest  passed", "selftest maybe",   "serviceoff",
        "jogs 1",   "sdox", "hold\t",    "engage\x01", "operator-log x",   "incident-folder /"};
    for (size_t i = 0; i < sizeof k_lines / sizeof k_lines[0]; i++) {
        const request_t request = request_read(k_lines[i], 40);
        TEST_ASSERT_EQUAL_MESSAGE(REQUEST_UNKNOWN, request.kind, k_lines[i]);
        TEST_ASSERT_EQUAL_MESSAGE(LEVEL_LOOK, request.level, k_lines[i]);
        TEST_ASSERT_FALSE_MESSAGE(request.is_look || request.is_moving || request.is_held, k_lines[i]);
    }
}

/* Who only looks on leaves no trace; reading an object is looking, writing one is not. */
static void test_request_read_what_only_looks_on(void)
{
    static const char *const k_looks[] = {"status",       "watch 5", "tick",          "counts",   "by anna", "beat 1 1 1",
                                          "operator-log", "samples", "sdo 1 6041:00", "selftest", "times"};
    static const char *const k_others[] = {
        "hold",      "engage",       "seen",           "dump", "intensity 5", "sdo 1 6083:00 5", "sdo 1 2000:01 u16 5",
        "release 5", "torque 1 off", "selftest failed"};
    for (size_t i = 0; i < sizeof k_looks / sizeof k_looks[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(request_read(k_looks[i], 40).is_look, k_looks[i]);
        TEST_ASSERT_FALSE_MESSAGE(request_read(k_looks[i], 40).is_moving, k_looks[i]);
    }
    for (size_t i = 0; i < sizeof k_others / sizeof k_others[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(request_read(k_others[i], 40).is_look, k_others[i]);
    }
    TEST_ASSERT_TRUE(request_read("sdo 1 6083:00 5", 40).is_moving);
}

/* Doubt goes to the safe side: what is no off, and no percentage, has an age. */
static void test_request_read_what_is_not_understood_counts_as_a_motion(void)
{
    TEST_ASSERT_TRUE(request_read("torque 1 onn", 40).is_moving);
    TEST_ASSERT_TRUE(request_read("torque", 40).is_moving);
    TEST_ASSERT_TRUE(request_read("intensity x", 40).is_moving);
}

static void test_request_level_behind_heard_is_that_of_the_request(void)
{
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, request_level("heard 5 reset", 40));
    TEST_ASSERT_EQUAL(LEVEL_OPERATE, request_level("  heard 5  engage", 40));
    TEST_ASSERT_EQUAL(LEVEL_LOOK, request_level("heard engage", 40)); /* it is rejected as such */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_request_level_of_each_request);
    RUN_TEST(test_request_read_what_can_start_or_enlarge_a_motion);
    RUN_TEST(test_request_read_what_somebody_holds);
    RUN_TEST(test_request_read_names_stand_whole_and_words_behind_one_blank);
    RUN_TEST(test_request_read_everything_else_is_unknown_and_takes_no_level);
    RUN_TEST(test_request_read_what_only_looks_on);
    RUN_TEST(test_request_read_what_is_not_understood_counts_as_a_motion);
    RUN_TEST(test_request_level_behind_heard_is_that_of_the_request);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * test_identify_report.c - the advice of an identification: what it recommends, and that it recommends nothing that would switch
 * a watch off.
 */
#include "identify/identify_report.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "unity.h"

#define TEXT_BYTES 16384u

static identify_report_t m_report;
static char m_text[TEXT_BYTES];

/* Six cylinders under a pose axis, all 10 ms late, without backlash. */
void setUp(void)
{
    m_report = (identify_report_t){.axis = "z",
                                   .unit = "mm",
                                   .is_posed = true,
                                   .amplitude = 2,
                                   .from_hz = 0.2,
                                   .to_hz = 20,
                                   .seconds = 51,
                                   .speed_mm_s = 200,
                                   .accel_mm_s2 = 3000,
                                   .jerk_mm_s3 = 60000,
                                   .window_mm = 5,
                                   .channels = 7};
    for (unsigned i = 0; i < m_report.channels; i++) {
        response_t *found = &m_report.channel[i].response;
        (void)snprintf(m_report.channel[i].name, sizeof m_report.channel[i].name, "%u", i);
        *found = (response_t){.is_moved = true, .lag_ms = 10, .gain = 1};
        for (unsigned k = 0; k < RESPONSE_POINTS; k++) {
            found->point[k] = (response_point_t){.hz = 0.2 + k, .gain = 1, .coherence = 1};
        }
    }
}

void tearDown(void) {}

static void lags(double lag_ms)
{
    for (unsigned i = 0; i < m_report.channels; i++) {
        m_report.channel[i].response.lag_ms = lag_ms;
    }
}

/* The text that a person sees. */
static const char *text(void)
{
    FILE *file = tmpfile();
    const int own = dup(STDOUT_FILENO);
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_TRUE(own >= 0);
    (void)fflush(stdout);
    TEST_ASSERT_TRUE(dup2(fileno(file), STDOUT_FILENO) >= 0);
    const int code = identify_report_write(&m_report, NULL, false);
    (void)fflush(stdout);
    TEST_ASSERT_TRUE(dup2(own, STDOUT_FILENO) >= 0);
    (void)close(own);
    rewind(file);
    m_text[fread(m_text, 1, sizeof m_text - 1u, file)] = '\0';
    (void)fclose(file);
    TEST_ASSERT_EQUAL(0, code);
    return m_text;
}

static void expect(const char *words, bool is_there)
{
    TEST_ASSERT_EQUAL_MESSAGE(is_there, strstr(text(), words) != NULL, m_text);
}

/* 200 mm/s and 10 ms are 2 mm, and half as much again is free. */
static void test_the_window_follows_the_lag(void)
{
    expect("following_error_mm", false); /* 5 mm is neither too narrow nor far too wide */
    m_report.window_mm = 20;
    expect("following_error_mm = 3.0 would do", true);
    m_report.window_mm = 2;
    expect("following_error_mm = 3.0 at least", true);
}

static void test_no_advice_switches_the_watch_off(void)
{
    static const double k_lags[] = {0.05, 0.001, 0.3};
    for (unsigned i = 0; i < sizeof k_lags / sizeof k_lags[0]; i++) {
        lags(k_lags[i]);
        expect("following_error_mm = 0.5 would do", true);
    }
    m_report.window_mm = 1;
    expect("following_error_mm", false);
}

static void test_a_drive_that_was_not_seen_to_follow_gives_no_window(void)
{
    m_report.window_mm = 20;
    m_report.channel[3].response = (response_t){.is_moved = false};
    expect("drive 3: no feedback moved with the set-point", true);
    expect("following_error_mm", false);
    m_report.window_mm = 1;
    expect("following_error_mm", false);
    setUp();
    m_report.window_mm = 20;
    lags(-0.6);
    expect("following_error_mm", false);
    lags(0);
    m_report.channel[2].response.hysteresis = 0.5;
    m_report.window_mm = 0.2;
    expect("following_error_mm", false);
    expect("inf", false);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_window_follows_the_lag);
    RUN_TEST(test_no_advice_switches_the_watch_off);
    RUN_TEST(test_a_drive_that_was_not_seen_to_follow_gives_no_window);
    return UNITY_END();
}

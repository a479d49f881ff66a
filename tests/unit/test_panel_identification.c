/* SPDX-License-Identifier: MIT
 * test_panel_identification.c - what drives do with a chirp, as the panel records it and works it out: from samples whose lag is
 * known.
 */
#include "panel/identification.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "heave/status.h"
#include "identify/identify_plan.h"
#include "panel/viewer_service.h"
#include "service/samples_writer.h"
#include "unity.h"

#define LAG_CYCLES 12u
#define FROM_HZ    1.0
#define TO_HZ      20.0
#define PI         3.14159265358979323846

static samples_writer_t m_writer;
static config_t m_config;
static snapshot_t m_snapshot;
static upstream_t m_upstream;
static identification_t m_self;
static char m_line[128], m_why[256];

void hv_assert_failed(const char *file, int line)
{
    (void)fprintf(stderr, "%s:%d\n", file, line);
    abort();
}

void setUp(void)
{
    memset(&m_config, 0, sizeof m_config);
    m_config.settings.geometry.kind = KIN_HEXAPOD;
    m_config.settings.cycle_us = 1000;
    m_config.samples_seconds = 2;
    memset(&m_snapshot, 0, sizeof m_snapshot);
    m_snapshot.cylinders = 6;
    m_writer = (samples_writer_t){.fd = -1};
    memset(&m_upstream, 0, sizeof m_upstream);
    TEST_ASSERT_TRUE(samples_writer_open(&m_writer, &m_config));
    TEST_ASSERT_NULL(samples_reader_open(&m_upstream.samples, m_writer.fd));
    m_why[0] = m_line[0] = '\0';
}

void tearDown(void)
{
    identification_end(&m_self);
    samples_reader_close(&m_upstream.samples);
    samples_writer_close(&m_writer);
}

static bool begin(const char *message)
{
    cJSON *const json = cJSON_Parse(message);
    TEST_ASSERT_NOT_NULL_MESSAGE(json, message);
    const bool is_begun = identification_begin(&m_self, &m_upstream, json, m_line, sizeof m_line, m_why, sizeof m_why);
    cJSON_Delete(json);
    return is_begun;
}

static void add(double sent_mm, double actual_mm)
{
    m_snapshot.cycle++;
    m_snapshot.now_us += 1000;
    m_snapshot.extension_mm_q32[2] = (q32_t)(sent_mm * (double)Q32_ONE);
    m_snapshot.drive[2].actual_mm_q32 = (q32_t)(actual_mm * (double)Q32_ONE);
    samples_writer_add(&m_writer, &m_snapshot, 0, 0);
}

/* What the child process writes, as JSON. */
static cJSON *work(void)
{
    static char text[262144];
    FILE *const file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_INT(0, identification_work(&m_self, dup(fileno(file))));
    rewind(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    (void)fclose(file);
    return cJSON_Parse(text);
}

static double number(const cJSON *json, const char *name)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(json, name);
    TEST_ASSERT_TRUE_MESSAGE(cJSON_IsNumber(item), name);
    return item->valuedouble;
}

static void test_wrong_axes_are_refused(void)
{
    static const char *const k_wrong[] = {"{}",
                                          "{\"axis\":3}",
                                          "{\"axis\":\"\"}",
                                          "{\"axis\":\"9\"}",
                                          "{\"axis\":\"33\"}",
                                          "{\"axis\":\"zz\"}",
                                          "{\"axis\":\"z 1 2\"}",
                                          "{\"axis\":\"../../z\"}",
                                          "{\"axis\":\"z\\nhold\"}",
                                          "{\"axis\":\"rollrollroll\"}"};
    for (unsigned i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(begin(k_wrong[i]), k_wrong[i]);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_why, "that is no axis"), k_wrong[i]);
    }
}

static void test_without_samples_it_says_what_is_missing(void)
{
    samples_reader_close(&m_upstream.samples);
    memset(&m_upstream.samples, 0, sizeof m_upstream.samples);
    TEST_ASSERT_FALSE(begin("{\"axis\":\"3\"}"));
    TEST_ASSERT_NOT_NULL(strstr(m_why, "[samples] seconds"));
}

static void test_it_says_what_to_press(void)
{
    TEST_ASSERT_TRUE(begin("{\"axis\":\"3\",\"amplitude\":1.5,\"from_hz\":1,\"to_hz\":20,\"seconds\":30}"));
    TEST_ASSERT_EQUAL_STRING("signal 3 chirp 1.5 1 20 30", m_line);
    TEST_ASSERT_EQUAL_UINT(1, m_self.channels);
    TEST_ASSERT_TRUE(begin("{\"axis\":\"roll\"}")); /* as usual, and the one before is forgotten */
    TEST_ASSERT_EQUAL_STRING_LEN("signal roll chirp 1 0.2 20 ", m_line, 27);
    TEST_ASSERT_EQUAL_UINT(7, m_self.channels);
    TEST_ASSERT_FALSE(begin("{\"axis\":\"3\",\"to_hz\":900}"));
    TEST_ASSERT_NOT_NULL(strstr(m_why, "allowed with this cycle"));
    TEST_ASSERT_FALSE(begin("{\"axis\":\"3\",\"seconds\":2}"));
    TEST_ASSERT_NOT_NULL(strstr(m_why, "too short"));
}

static void test_limits_come_with_the_request_and_are_numbers(void)
{
    TEST_ASSERT_TRUE(begin("{\"axis\":\"3\",\"cylinder_limits\":{\"speed_mm_s\":200,\"accel_mm_s2\":-1,\"jerk_mm_s3\":\"x\","
                           "\"following_error_mm\":1e9}}"));
    TEST_ASSERT_TRUE(m_self.report.speed_mm_s > 199 && m_self.report.speed_mm_s < 201);
    TEST_ASSERT_TRUE(m_self.report.accel_mm_s2 == 0 && m_self.report.jerk_mm_s3 == 0 && m_self.report.window_mm == 0);
}

static void test_it_records_from_the_press_until_what_lags_is_at_rest(void)
{
    for (unsigned i = 0; i < 50; i++) {
        add(1, 1); /* before it */
    }
    TEST_ASSERT_TRUE(begin("{\"axis\":\"3\"}"));
    for (unsigned i = 0; i < 100; i++) {
        add(i, i / 2.0);
    }
    TEST_ASSERT_FALSE(identification_collect(&m_self, 5000));
    TEST_ASSERT_EQUAL_UINT(100, m_self.count);
    TEST_ASSERT_TRUE(m_self.sent_at[0][0] == 0 && m_self.sent_at[0][99] == 99 && m_self.actual_at[0][99] == 49.5);
    identification_arrived(&m_self, 6000);
    identification_arrived(&m_self, 6500); /* told twice: the first counts */
    TEST_ASSERT_FALSE(identification_collect(&m_self, 6000 + IDENTIFY_AFTER_MS - 1));
    TEST_ASSERT_TRUE(identification_collect(&m_self, 6000 + IDENTIFY_AFTER_MS));
}

/* A sine whose frequency rises as heaved's does, and drives that are LAG_CYCLES behind. */
static void test_a_lag_that_is_known_is_found(void)
{
    static double sent[64000];
    TEST_ASSERT_TRUE(begin("{\"axis\":\"3\",\"amplitude\":2,\"from_hz\":1,\"to_hz\":20,\"seconds\":30}"));
    const double rate = log(TO_HZ / FROM_HZ) / 30;
    for (unsigned i = 0; i < 31000; i++) {
        const double t_s = i / 1000.0;
        const double share = fmin(1, fmin(t_s / 2, (30 - t_s) / 2)); /* in and out */
        sent[i] = t_s < 30 ? 2 * share * sin(2 * PI * FROM_HZ * (exp(rate * t_s) - 1) / rate) : 0;
        add(sent[i], i < LAG_CYCLES ? 0 : sent[i - LAG_CYCLES]);
        if (i % 500 == 0) {
            (void)identification_collect(&m_self, i);
        }
    }
    identification_arrived(&m_self, 30000);
    TEST_ASSERT_TRUE(identification_collect(&m_self, 31000));
    TEST_ASSERT_EQUAL_UINT(31000, m_self.count);
    cJSON *const json = work();
    TEST_ASSERT_NOT_NULL(json);
    const cJSON *const channel = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(json, "channels"), 0);
    TEST_ASSERT_DOUBLE_WITHIN(0.25, LAG_CYCLES, number(channel, "lag_ms"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 1, number(channel, "gain"));
    cJSON_Delete(json);
}

static void test_cycles_that_are_missing_are_no_result(void)
{
    TEST_ASSERT_TRUE(begin("{\"axis\":\"3\"}"));
    for (unsigned i = 0; i < 6000; i++) { /* three times what the ring holds */
        add(i, i);
    }
    (void)identification_collect(&m_self, 0);
    TEST_ASSERT_GREATER_THAN_UINT(0, m_self.reader.lost);
    cJSON *const json = work();
    TEST_ASSERT_TRUE(cJSON_IsFalse(cJSON_GetObjectItemCaseSensitive(json, "ok")));
    TEST_ASSERT_NOT_NULL(strstr(cJSON_GetObjectItemCaseSensitive(json, "error")->valuestring, "cycles are missing"));
    cJSON_Delete(json);
}

static void wake(viewer_t *viewer)
{
    (void)viewer;
}

/* A page whose press is on its way to heaved. */
static viewer_t *ask_for_a_signal(viewers_t *viewers, const char *name)
{
    viewer_t *const viewer = viewer_enter(viewers, NULL, LEVEL_SERVICE, name);
    TEST_ASSERT_NOT_NULL(viewer);
    cJSON *const json = cJSON_Parse("{\"axis\":\"3\"}");
    TEST_ASSERT_TRUE(
        identification_begin(&viewers->identification[0], &m_upstream, json, m_line, sizeof m_line, m_why, sizeof m_why));
    cJSON_Delete(json);
    viewers->identification[0].viewer = viewer->number;
    return viewer;
}

static void test_a_page_that_has_gone_or_has_no_answer_keeps_nobody_out(void)
{
    static viewers_t viewers;
    viewers = (viewers_t){.platform = &m_upstream, .platforms = 1, .wake = wake};
    viewer_t *const lost = ask_for_a_signal(&viewers, "lost");
    const asker_t asker = {.viewer = lost->number, .id = 7 | VIEWER_PRESS_BIT};
    viewer_service_pump(&viewers);
    TEST_ASSERT_EQUAL_UINT64(lost->number, viewers.identification[0].viewer); /* it is still waited for */
    viewers_answer(&viewers, &m_upstream, &asker, NULL);                      /* the connection to heaved is lost */
    TEST_ASSERT_EQUAL_UINT64(0, viewers.identification[0].viewer);
    viewer_leave(&viewers, lost);
    viewer_leave(&viewers, ask_for_a_signal(&viewers, "gone"));
    viewer_service_pump(&viewers);
    TEST_ASSERT_EQUAL_UINT64(0, viewers.identification[0].viewer);
    TEST_ASSERT_NULL(viewers.identification[0].sent_at[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_wrong_axes_are_refused);
    RUN_TEST(test_without_samples_it_says_what_is_missing);
    RUN_TEST(test_it_says_what_to_press);
    RUN_TEST(test_limits_come_with_the_request_and_are_numbers);
    RUN_TEST(test_it_records_from_the_press_until_what_lags_is_at_rest);
    RUN_TEST(test_a_lag_that_is_known_is_found);
    RUN_TEST(test_cycles_that_are_missing_are_no_result);
    RUN_TEST(test_a_page_that_has_gone_or_has_no_answer_keeps_nobody_out);
    return UNITY_END();
}

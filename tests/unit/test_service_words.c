/* SPDX-License-Identifier: MIT
 * test_service_words.c - requests of SERVICE in words: what a client sends, what a file holds, what is neither.
 */
#include "record/service_words.h"

#include <stdio.h>
#include <string.h>

#include "unity.h"

static service_request_t m_request;
static uint64_t m_tick_us;

void setUp(void) {}
void tearDown(void) {}

static const char *read_from(const char *text, bool is_file)
{
    return service_words_read(text, strlen(text), is_file, &m_request, &m_tick_us);
}

static void test_client_words_are_read(void)
{
    TEST_ASSERT_NULL(read_from("torque 3 on", false));
    TEST_ASSERT_EQUAL(SERVICE_TORQUE_ON, m_request.verb);
    TEST_ASSERT_EQUAL(3, m_request.axis);
    TEST_ASSERT_NULL(read_from("torque all off", false));
    TEST_ASSERT_EQUAL(SERVICE_TORQUE_OFF, m_request.verb);
    TEST_ASSERT_EQUAL(SERVICE_ALL, m_request.axis);
    TEST_ASSERT_NULL(read_from("jog 3 -2.5 184000", false));
    TEST_ASSERT_EQUAL(SERVICE_JOG_AXIS, m_request.verb);
    TEST_ASSERT_EQUAL(3, m_request.axis);
    TEST_ASSERT_EQUAL_INT32(-163840, m_request.speed_q16);
    TEST_ASSERT_EQUAL_UINT64(184000, m_tick_us);
    TEST_ASSERT_NULL(read_from("jog yaw 1e1 1", false));
    TEST_ASSERT_EQUAL(SERVICE_JOG_POSE, m_request.verb);
    TEST_ASSERT_EQUAL(AXIS_YAW + 1, m_request.axis);
    TEST_ASSERT_EQUAL_INT32(655360, m_request.speed_q16);
    TEST_ASSERT_NULL(read_from("home all 7", false));
    TEST_ASSERT_EQUAL(SERVICE_HOME, m_request.verb);
    TEST_ASSERT_NULL(read_from("relay 12 7", false));
    TEST_ASSERT_EQUAL(12, m_request.axis);
    TEST_ASSERT_NULL(read_from("beat 4294967295 1 4611686018427387903", false));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, m_request.series);
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX / 4, m_tick_us);
    TEST_ASSERT_NULL(read_from("release 5", false));
    TEST_ASSERT_EQUAL_UINT32(5, m_request.series);
}

/* Each is refused by the name of its request. */
static void test_wrong_words_are_refused_by_name(void)
{
    static const char *const k_wrong[] = {"torque",
                                          "torque 3",
                                          "torque 0 on",
                                          "torque 256 on",
                                          "torque -1 on",
                                          "torque 3 On",
                                          "torque 3 on 1",
                                          "torque 3 4 5 6 7 8",
                                          "jog",
                                          "jog 3",
                                          "jog 3 5",
                                          "jog 0 5 1",
                                          "jog all 5 1",
                                          "jog Z 5 1",
                                          "jog 3 0 1",
                                          "jog 3 0.0000001 1",
                                          "jog 3 x 1",
                                          "jog 3 5mm/s 1",
                                          "jog 3 5 -1",
                                          "jog 3 5 1.5",
                                          "jog 3 99999 1",
                                          "jog 3 5 4611686018427387904",
                                          "jog 3 5 99999999999999999999999",
                                          "jog 1 2 3 4 5 6 7 8 9",
                                          "home",
                                          "home 3",
                                          "home z 1",
                                          "home 0 1",
                                          "relay",
                                          "relay 1",
                                          "relay all 1",
                                          "relay 0 1",
                                          "relay 300 1",
                                          "beat",
                                          "beat 1",
                                          "beat 1 1",
                                          "beat 0 1 1",
                                          "beat 1 0 1",
                                          "beat 4294967296 1 1",
                                          "beat 1 1 1 1",
                                          "release",
                                          "release 0",
                                          "release x",
                                          "release 1 1",
                                          "jog 1 5 0 1",
                                          "jog 1 5 -2 1",
                                          "jog 1 5 2 1 1",
                                          "signal",
                                          "signal z",
                                          "signal z sine 2 1 10",
                                          "signal z sine 2 1 10 5 1 1",
                                          "signal z saw 2 1 10 1",
                                          "signal w sine 2 1 10 1",
                                          "signal all sine 2 1 10 1",
                                          "signal z sine 0 1 10 1",
                                          "signal z sine -2 1 10 1",
                                          "signal z sine 2 0 10 1",
                                          "signal z chirp 2 1 10 1",
                                          "signal z chirp 2 1 10 x 1"};
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        const char *why = read_from(k_wrong[i], false);
        TEST_ASSERT_NOT_NULL_MESSAGE(why, k_wrong[i]);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE(k_wrong[i], why, strcspn(k_wrong[i], " "), k_wrong[i]);
        TEST_ASSERT_TRUE(service_words_are(k_wrong[i], strlen(k_wrong[i])));
    }
    TEST_ASSERT_FALSE(service_words_are("", 0));
    TEST_ASSERT_FALSE(service_words_are("jogging 3", 9));
    TEST_ASSERT_FALSE(service_words_are("tor", 3));
}

/* What a file holds is what was taken, to the last bit. */
static void test_file_words_are_what_was_written(void)
{
    uint32_t random = 12345;
    for (unsigned n = 0; n < 200000; n++) {
        char text[SERVICE_WORDS_MAX + 1];
        random = random * 1664525u + 1013904223u;
        service_request_t request = {.verb = (service_verb_t)(SERVICE_TORQUE_ON + (random >> 8) % (SERVICE_VERBS - 1u))};
        const bool is_jog = request.verb == SERVICE_JOG_AXIS || request.verb == SERVICE_JOG_POSE;
        const bool is_all = request.verb == SERVICE_HOME || request.verb <= SERVICE_TORQUE_OFF;
        if (request.verb <= SERVICE_SIGNAL_POSE) {
            request.axis = (uint8_t)((random >> 12) % 6u + (is_all ? 0u : 1u));
        }
        if (is_jog) {
            request.speed_q16 = (q16_t)(random ^ n) / (1 + (int32_t)(n % 7u) * 1000);
            request.speed_q16 += request.speed_q16 == 0;
            request.way_q16 = n % 3u == 0 ? 0 : 1 + (q16_t)(random >> 2);
        }
        if (request.verb == SERVICE_SIGNAL_AXIS || request.verb == SERVICE_SIGNAL_POSE) {
            request.signal =
                (excitation_request_t){(excitation_kind_t)(n % 4u), (q16_t)(1u + (random >> 3)) & INT32_MAX, 1u + random % 50000u,
                                       n % 4u >= 2u ? 1u + n % 50000u : 0, 1u + random % 600000u};
            request.signal.amplitude_q16 += request.signal.amplitude_q16 == 0;
        }
        if (request.verb >= SERVICE_JOG_AXIS) {
            request.series = random | 1u;
            request.age_us = request.verb != SERVICE_RELEASE ? random % 300000u : 0;
            request.counter = request.verb == SERVICE_BEAT ? n + 1u : 0;
        }
        const size_t length = service_words_put(text, &request);
        TEST_ASSERT_LESS_OR_EQUAL(SERVICE_WORDS_MAX, length);
        text[length] = '\0';
        const char *why = service_words_read(text, length, true, &m_request, &m_tick_us);
        TEST_ASSERT_NULL_MESSAGE(why, text);
        TEST_ASSERT_EQUAL_MESSAGE(request.verb, m_request.verb, text);
        TEST_ASSERT_EQUAL_MESSAGE(request.axis, m_request.axis, text);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(request.speed_q16, m_request.speed_q16, text);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&request.signal, &m_request.signal, sizeof request.signal, text);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(request.way_q16, m_request.way_q16, text);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(request.series, m_request.series, text);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(request.counter, m_request.counter, text);
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(request.age_us, m_request.age_us, text);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_client_words_are_read);
    RUN_TEST(test_wrong_words_are_refused_by_name);
    RUN_TEST(test_file_words_are_what_was_written);
    return UNITY_END();
}

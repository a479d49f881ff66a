/* SPDX-License-Identifier: MIT
 * test_operator_requests.c - requests of an operator and their refusals, and who may send frames.
 */
#include "service/operator_requests.h"

#include <string.h>

#include "record/udp_recorder.h"
#include "unity.h"

static char m_text[256];
static snapshot_t m_snapshot;

void setUp(void)
{
    memset(m_text, 0, sizeof m_text);
    m_snapshot = (snapshot_t){.state = STATE_SETTLED};
}

void tearDown(void) {}

static void test_operator_request_find_knows_every_request_and_no_other_event(void)
{
    static const char *const k_names[] = {"engage", "hold", "resume", "park", "reset", "shutdown"};
    static const char *const k_others[] = {"", "tick", "frame", "fault", "estop", "Engage", "engage ", "status"};
    for (size_t i = 0; i < sizeof k_names / sizeof k_names[0]; i++) {
        const event_t event = operator_request_find(k_names[i]);
        TEST_ASSERT_NOT_EQUAL(EVENTS, event);
        TEST_ASSERT_EQUAL_STRING(k_names[i], event_name(event));
    }
    for (size_t i = 0; i < sizeof k_others / sizeof k_others[0]; i++) {
        TEST_ASSERT_EQUAL_INT(EVENTS, operator_request_find(k_others[i]));
    }
}

static void test_operator_request_behind_heard_is_the_request(void)
{
    static const char *const k_wrong[] = {"heard ", "heard 5", "heard engage", "heard -5 engage",
                                          "heard 1234567890123456789 engage"};
    bool has_heard = true;
    uint64_t tick_us = 9;
    TEST_ASSERT_EQUAL_STRING("torque 1 on", operator_request_behind_heard("  torque 1 on", &has_heard, &tick_us));
    TEST_ASSERT_TRUE(!has_heard && tick_us == 0);
    TEST_ASSERT_EQUAL_STRING("engage", operator_request_behind_heard(" heard 123456789012345678  engage", &has_heard, &tick_us));
    TEST_ASSERT_TRUE(has_heard && tick_us == 123456789012345678u);
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        TEST_ASSERT_NULL_MESSAGE(operator_request_behind_heard(k_wrong[i], &has_heard, &tick_us), k_wrong[i]);
    }
}

static void test_operator_explain_says_why_and_what_else(void)
{
    (void)operator_explain(EVENT_RESUME, &m_snapshot, false, m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("resume: there is nothing to resume in SETTLED; possible: engage, service", m_text);
    m_snapshot.state = STATE_FAULT;
    m_snapshot.fault.code = FAULT_BUS;
    (void)operator_explain(EVENT_RESET, &m_snapshot, false, m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING(
        "reset: the cause is still there in FAULT (the bus of the drives is lost); possible: reset, once the cause is gone",
        m_text);
    (void)operator_explain(EVENT_ENGAGE, &m_snapshot, true, m_text, sizeof m_text);
    TEST_ASSERT_NOT_NULL(strstr(m_text, "shutdown is under way"));
}

static void test_operator_read_percent_takes_whole_numbers_only(void)
{
    static const char *const k_wrong[] = {"", " 5", "5 ", "+5", "-5", "5.5", "5%", "1000", "0x5", "five"};
    uint32_t percent = 0;
    TEST_ASSERT_TRUE(operator_read_percent("0", &percent));
    TEST_ASSERT_EQUAL_UINT32(0, percent);
    TEST_ASSERT_TRUE(operator_read_percent("999", &percent));
    TEST_ASSERT_EQUAL_UINT32(999, percent);
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(operator_read_percent(k_wrong[i], &percent), k_wrong[i]);
    }
}

static void test_operator_explain_percent_says_the_cap(void)
{
    (void)operator_explain_percent(90, 60, m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("intensity 90: too much for this platform; possible: 0 to 60 % ([intensity] max_percent)", m_text);
}

static void test_operator_explain_says_what_service_waits_for(void)
{
    m_snapshot = (snapshot_t){.state = STATE_OFF, .cylinders = 3};
    (void)operator_explain(EVENT_SERVICE, &m_snapshot, false, m_text, sizeof m_text); /* nothing is heard yet */
    TEST_ASSERT_EQUAL_STRING("service: drives 1, 2, 3 are not ready; drive 1: it does not answer", m_text);
    for (unsigned i = 0; i < 3; i++) {
        m_snapshot.drive[i].state = DRIVE_DISABLED;
    }
    (void)operator_explain(EVENT_SERVICE, &m_snapshot, false, m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("service: the drives are still going off: try again in OFF; possible: engage, park, service",
                             m_text);
}

static void test_operator_explain_absent_names_the_drives_and_what_the_first_is_at(void)
{
    static const drive_report_t k_refused = {.phase = "refused", .trouble = "does not take an object", .detail = "", .code = 1};
    static const drive_report_t k_setup = {.phase = "configuring", .trouble = "no error", .detail = ""};
    m_snapshot = (snapshot_t){.state = STATE_OFF, .cylinders = 6, .has_angle = true};
    (void)operator_explain_absent(EVENT_ENGAGE, &m_snapshot, 1u << 6, "", m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("engage: drive 7 is not ready: it does not answer", m_text);
    m_snapshot.report[2] = k_setup;
    m_snapshot.report[5] = k_refused;
    (void)operator_explain_absent(EVENT_ENGAGE, &m_snapshot, 1u << 2 | 1u << 5, "", m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("engage: drives 3, 6 are not ready; drive 3: configuring", m_text);
    (void)operator_explain_absent(EVENT_PARK, &m_snapshot, 1u << 5, "", m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("park: drive 6 is not ready: refused: does not take an object", m_text);
    m_snapshot.drive[5].state = DRIVE_FAULT;
    (void)operator_explain_absent(EVENT_PARK, &m_snapshot, 1u << 5, "", m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("park: drive 6 is not ready: refused: does not take an object; `reset` leads out of it", m_text);
    (void)operator_explain_absent(EVENT_PARK, &m_snapshot, 0x7F, "the cable is out", m_text, sizeof m_text);
    TEST_ASSERT_EQUAL_STRING("park: the drives cannot be reached: the cable is out", m_text);
    TEST_ASSERT_EQUAL(9, operator_explain_absent(EVENT_PARK, &m_snapshot, 0x7F, "the cable is out", m_text, 10)); /* cut */
}

/* What a refusal offers has to be something the states take. */
static void test_operator_explain_offers_only_what_the_states_take(void)
{
    for (state_t state = STATE_OFF; state < STATES; state++) {
        m_snapshot.state = state;
        (void)operator_explain(EVENT_RESUME, &m_snapshot, false, m_text, sizeof m_text);
        const char *possible = strstr(m_text, "possible: ");
        TEST_ASSERT_NOT_NULL(possible);
        unsigned offered = 0;
        for (unsigned i = 0; i < OPERATOR_REQUESTS; i++) {
            const event_t event = operator_requests[i];
            if (strstr(possible, event_name(event)) != NULL) {
                const supervisor_view_t view = {.is_at_rest = true};
                supervisor_t supervisor = {.state = state, .goal = STATE_ENGAGED, .interrupted = STATE_ENGAGED};
                (void)supervisor_event(&supervisor, event, &view);
                TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, supervisor.ignored[event], m_text);
                offered++;
            }
        }
        TEST_ASSERT_GREATER_THAN_UINT(0, offered);
    }
}

static hal_udp_peer_t ipv4(uint8_t a, uint8_t b, uint8_t c, uint8_t d)
{
    return (hal_udp_peer_t){.address = {a, b, c, d}, .port = 1};
}

static void test_udp_recorder_is_allowed_without_a_list_everyone_is(void)
{
    const hal_udp_networks_t none = {.count = 0};
    const hal_udp_peer_t peer = ipv4(1, 2, 3, 4);
    TEST_ASSERT_TRUE(udp_recorder_is_allowed(&none, &peer));
}

/* Every prefix length against a comparison bit by bit. */
static void test_udp_recorder_is_allowed_compares_the_first_bits(void)
{
    uint32_t random = 7;
    for (unsigned round = 0; round < 20000; round++) {
        random = random * 1664525u + 1013904223u;
        const unsigned prefix = round % 33;
        const uint32_t network = 0xC0A80780u;
        const uint32_t address = network ^ (round % 3 == 0 ? random : 1u << (random >> 27));
        const hal_udp_networks_t allow = {.count = 1,
                                          .network = {{.prefix = (uint8_t)prefix, .address = {0xC0, 0xA8, 0x07, 0x80}}}};
        const hal_udp_peer_t peer =
            ipv4((uint8_t)(address >> 24), (uint8_t)(address >> 16), (uint8_t)(address >> 8), (uint8_t)address);
        const bool is_same = prefix == 0 || (network ^ address) >> (32 - prefix) == 0;
        TEST_ASSERT_EQUAL(is_same, udp_recorder_is_allowed(&allow, &peer));
    }
}

static void test_udp_recorder_is_allowed_keeps_ipv4_and_ipv6_apart(void)
{
    hal_udp_networks_t allow = {.count = 1, .network = {{.is_ipv6 = true, .prefix = 0}}};
    hal_udp_peer_t peer = ipv4(1, 2, 3, 4);
    TEST_ASSERT_FALSE(udp_recorder_is_allowed(&allow, &peer));
    peer.is_ipv6 = true;
    TEST_ASSERT_TRUE(udp_recorder_is_allowed(&allow, &peer));
    allow.network[0].prefix = 128;
    TEST_ASSERT_FALSE(udp_recorder_is_allowed(&allow, &peer));
    memcpy(allow.network[0].address, peer.address, sizeof peer.address);
    TEST_ASSERT_TRUE(udp_recorder_is_allowed(&allow, &peer));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_operator_request_find_knows_every_request_and_no_other_event);
    RUN_TEST(test_operator_request_behind_heard_is_the_request);
    RUN_TEST(test_operator_explain_says_why_and_what_else);
    RUN_TEST(test_operator_read_percent_takes_whole_numbers_only);
    RUN_TEST(test_operator_explain_percent_says_the_cap);
    RUN_TEST(test_operator_explain_absent_names_the_drives_and_what_the_first_is_at);
    RUN_TEST(test_operator_explain_says_what_service_waits_for);
    RUN_TEST(test_operator_explain_offers_only_what_the_states_take);
    RUN_TEST(test_udp_recorder_is_allowed_without_a_list_everyone_is);
    RUN_TEST(test_udp_recorder_is_allowed_compares_the_first_bits);
    RUN_TEST(test_udp_recorder_is_allowed_keeps_ipv4_and_ipv6_apart);
    return UNITY_END();
}

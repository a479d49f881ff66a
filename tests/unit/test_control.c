/* SPDX-License-Identifier: MIT
 * test_control.c - who gets a place at the control socket, in virtual time: a newcomer always does, and who gives way is told.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "platform/load.h"
#include "service/control.h"
#include "unity.h"

#define LATE    (CONTROL_GRACE_US + 1)
#define IS_GONE "too many clients: this one had to give way to a newer one"

static config_t m_config;
static handover_t m_handover;
static blackbox_t m_blackbox;
static operator_log_t m_log;
static control_t m_control;
static uint64_t m_now_us;
static char m_folder[64];
static char m_path[80];
static int m_client[CONTROL_CLIENTS + 1];   /* the last one: the newcomer */
static char m_said[CONTROL_ANSWER_MAX * 2]; /* to the one that was listened to last */

#define NEWCOMER CONTROL_CLIENTS

/* --- Clients --- */

static void pass(uint64_t us)
{
    struct pollfd fds[CONTROL_FDS];
    m_now_us += us;
    control_fill(&m_control, fds, m_now_us);
    (void)poll(fds, CONTROL_FDS, 0);
    control_serve(&m_control, fds, m_now_us);
}

static void come(unsigned i)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    memcpy(address.sun_path, m_path, sizeof m_path);
    m_client[i] = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    TEST_ASSERT_EQUAL(0, connect(m_client[i], (const struct sockaddr *)&address, sizeof address));
}

static void ask(unsigned i, const char *request)
{
    TEST_ASSERT_EQUAL(strlen(request), send(m_client[i], request, strlen(request), MSG_NOSIGNAL));
}

/* All places taken, by clients that have asked this; a millisecond between one and the next. */
static void come_all(const char *request)
{
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        come(i);
        pass(1000);
        ask(i, request);
        pass(0);
    }
}

/* Takes all that was said to a client.
 * Returns true: it has been dropped. */
static bool is_dropped(unsigned i)
{
    size_t length = 0;
    ssize_t got = 0;
    while (length < sizeof m_said - 1 &&
           (got = recv(m_client[i], &m_said[length], sizeof m_said - 1 - length, MSG_DONTWAIT)) > 0) {
        length += (size_t)got;
    }
    m_said[length] = '\0';
    return got == 0;
}

static bool has_heard(unsigned i, const char *text)
{
    (void)is_dropped(i);
    return strstr(m_said, text) != NULL;
}

/* Which client was dropped, having been told why. */
static unsigned who_gave_way(void)
{
    unsigned who = NEWCOMER;
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        if (m_client[i] >= 0 && is_dropped(i)) {
            TEST_ASSERT_EQUAL_MESSAGE(NEWCOMER, who, "more than one");
            TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_said, IS_GONE), m_said);
            who = i;
        }
    }
    return who;
}

/* The motion thread: answers one request. */
static void motion_answers(void)
{
    static motion_result_t result;
    motion_request_t request;
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0);
    result = (motion_result_t){.id = request.id, .status = HV_OK};
    TEST_ASSERT_TRUE(ring_push(&m_handover.results, &result, sizeof result, NULL, 0));
}

static void newcomer_is_heard(void)
{
    come(NEWCOMER);
    ask(NEWCOMER, "hold\n");
    pass(LATE);
    pass(0);
    motion_answers();
    pass(0);
    TEST_ASSERT_TRUE(has_heard(NEWCOMER, "{\"ok\":true"));
}

void setUp(void)
{
    static uint8_t memory;
    TEST_ASSERT_EQUAL(0, config_load(HEAVE_CONFIG_DIR "/demo-hexapod.ini", &m_config, stderr));
    memset(&m_control, 0, sizeof m_control);
    handover_init(&m_handover);
    m_blackbox.memory = &memory; /* it is there, and never answers */
    m_now_us = 1000000;
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-control-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    (void)snprintf(m_path, sizeof m_path, "%s/s", m_folder);
    for (unsigned i = 0; i <= NEWCOMER; i++) {
        m_client[i] = -1;
    }
    TEST_ASSERT_EQUAL(0, control_open(&m_control, m_path, &m_config, &m_handover, &m_blackbox, &m_log));
}

void tearDown(void)
{
    control_close(&m_control);
    for (unsigned i = 0; i <= NEWCOMER; i++) {
        if (m_client[i] >= 0) {
            (void)close(m_client[i]);
        }
    }
    (void)rmdir(m_folder);
}

/* --- Who gives way --- */

static void test_a_client_that_asks_nothing_gives_way_before_watchers(void)
{
    come_all("watch 1\n");
    (void)close(m_client[3]);
    pass(0);
    come(3);
    pass(0);
    pass(CONTROL_IDLE_US);
    newcomer_is_heard();
    TEST_ASSERT_EQUAL(3, who_gave_way());
}

static void test_of_idle_clients_the_one_that_asked_first_gives_way(void)
{
    come_all("status\n");
    pass(1000);
    ask(0, "status\n");
    pass(CONTROL_IDLE_US * 2);
    ask(1, "status\n");
    pass(0);
    newcomer_is_heard();
    TEST_ASSERT_EQUAL(2, who_gave_way());
}

static void test_the_oldest_watcher_gives_way_before_who_has_just_asked(void)
{
    come_all("status\n");
    ask(5, "watch\n");
    pass(1000);
    ask(4, "watch\n");
    pass(1000);
    newcomer_is_heard();
    TEST_ASSERT_EQUAL(5, who_gave_way());
}

static void test_clients_that_keep_asking_do_not_keep_others_out(void)
{
    come_all("status\n");
    pass(LATE);
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        ask(i, "status\n");
    }
    newcomer_is_heard();
    TEST_ASSERT_NOT_EQUAL(NEWCOMER, who_gave_way());
}

static void test_who_has_just_come_may_ask_first(void)
{
    come_all("");
    come(NEWCOMER);
    ask(NEWCOMER, "status\n");
    pass(CONTROL_GRACE_US / 2);
    TEST_ASSERT_EQUAL(NEWCOMER, who_gave_way());
    TEST_ASSERT_FALSE(has_heard(NEWCOMER, "{"));
    pass(CONTROL_GRACE_US / 2);
    pass(0);
    TEST_ASSERT_EQUAL(0, who_gave_way());
    TEST_ASSERT_TRUE(has_heard(NEWCOMER, "\"counters\""));
}

static void test_who_has_asked_since_the_poll_stays(void)
{
    struct pollfd fds[CONTROL_FDS];
    come_all("");
    pass(CONTROL_IDLE_US);
    come(NEWCOMER);
    control_fill(&m_control, fds, m_now_us);
    (void)poll(fds, CONTROL_FDS, 0);
    ask(0, "hold\n");
    control_serve(&m_control, fds, m_now_us);
    TEST_ASSERT_EQUAL(1, who_gave_way());
    motion_answers();
    pass(0);
    TEST_ASSERT_TRUE(has_heard(0, "{\"ok\":true"));
}

static void test_nobody_gives_way_where_somebody_has_gone_since_the_poll(void)
{
    struct pollfd fds[CONTROL_FDS];
    come_all("");
    pass(CONTROL_IDLE_US);
    come(NEWCOMER);
    control_fill(&m_control, fds, m_now_us);
    (void)poll(fds, CONTROL_FDS, 0);
    (void)close(m_client[6]);
    m_client[6] = -1;
    control_serve(&m_control, fds, m_now_us);
    TEST_ASSERT_EQUAL(NEWCOMER, who_gave_way());
    newcomer_is_heard();
}

/* --- Who waits for an answer --- */

static void test_who_waits_for_the_motion_thread_gets_its_answer_and_a_newcomer_waits_outside(void)
{
    struct pollfd fds[CONTROL_FDS];
    come_all("hold\n");
    come(NEWCOMER);
    ask(NEWCOMER, "status\n");
    pass(LATE);
    pass(0);
    TEST_ASSERT_EQUAL(NEWCOMER, who_gave_way());
    control_fill(&m_control, fds, m_now_us);
    TEST_ASSERT_EQUAL_MESSAGE(0, poll(fds, CONTROL_FDS, 0), "the loop would spin");
    motion_answers();
    pass(0);
    pass(0);
    TEST_ASSERT_TRUE(is_dropped(0));
    TEST_ASSERT_EQUAL_STRING_LEN("{\"ok\":true", m_said, 10);
    TEST_ASSERT_NOT_NULL(strstr(m_said, IS_GONE));
    TEST_ASSERT_TRUE(has_heard(NEWCOMER, "\"counters\""));
    control_fill(&m_control, fds, m_now_us);
    TEST_ASSERT_EQUAL(m_control.socket[0].fd, fds[0].fd);
}

static void test_who_waits_for_the_disk_gives_way_last(void)
{
    come_all("dump\n");
    pass(LATE);
    (void)close(m_client[4]);
    pass(0);
    come(4);
    pass(LATE);
    ask(4, "status\n");
    pass(0);
    newcomer_is_heard();
    TEST_ASSERT_EQUAL(4, who_gave_way());
    (void)close(m_client[4]);
    m_client[4] = m_client[NEWCOMER];
    ask(4, "dump\n");
    pass(0);
    newcomer_is_heard();
    TEST_ASSERT_TRUE(is_dropped(0));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_said, "dump: the disk has not taken it yet; heaved goes on trying"), m_said);
    TEST_ASSERT_FALSE(is_dropped(1));
}

/* --- What is old --- */

static bool has_reached_the_motion_thread(void)
{
    return !ring_is_empty(&m_handover.requests);
}

static void show_tick(uint64_t tick_us)
{
    static motion_view_words_t view;
    view.view.snapshot.service.tick_us = tick_us;
    seqlock_write(&m_handover.view, view.word);
}

/* Asks, while heaved stands still for so long. */
static void ask_in_a_stop(unsigned i, const char *request, uint64_t us)
{
    pass(0);
    ask(i, request);
    pass(us);
}

static void test_what_waited_while_heaved_stood_still_is_not_done(void)
{
    come(0);
    pass(0);
    ask_in_a_stop(0, "engage\n", REQUEST_FRESH_US);
    /* control_fill() of the look that finds it comes after the stop: only the look before it says since when it may have waited
     */
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_TRUE_MESSAGE(
        has_heard(0, "engage: asked more than 1 s ago, so it is not done any more: ask again\",\"why\":\"stale\""), m_said);
    ask_in_a_stop(0, "engage\n", REQUEST_FRESH_US - 1);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_what_came_with_its_connection_is_as_old_as_that(void)
{
    pass(0);
    come(0);
    ask(0, "engage\n");
    pass(REQUEST_FRESH_US);
    pass(0);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "\"stale\""), m_said);
}

static void test_who_came_before_the_first_look_came_then(void)
{
    come(0);
    ask(0, "engage\n");
    pass(20 * REQUEST_FRESH_US);
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_one_that_came_among_many_is_as_old_as_it_is(void)
{
    pass(0);
    for (unsigned i = 0; i < 4; i++) {
        come(i);
    }
    pass(REQUEST_FRESH_US); /* all of them are let in at one look */
    come(4);
    ask(4, "engage\n");
    pass(1000);
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_what_only_makes_it_safer_has_no_age(void)
{
    static const char *const k_safe[] = {"hold\n", "service-off\n", "torque all off\n", "release 7\n", "intensity 0\n"};
    come(0);
    pass(0);
    for (unsigned i = 0; i < sizeof k_safe / sizeof k_safe[0]; i++) {
        ask_in_a_stop(0, k_safe[i], 30 * REQUEST_FRESH_US);
        TEST_ASSERT_TRUE_MESSAGE(has_reached_the_motion_thread(), k_safe[i]);
        motion_answers();
        pass(0);
    }
}

static void test_a_request_that_waits_behind_another_grows_old(void)
{
    come(0);
    pass(0);
    ask(0, "hold\nengage\n");
    pass(0);
    pass(REQUEST_FRESH_US - 1);
    motion_answers();
    pass(2);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "\"stale\""), m_said);
}

/* A hold between a refusal and the next try ends the tries: whoever tries again says what the refusal told. */
static void test_who_waits_for_drives_is_told_a_tick_to_come_back_with(void)
{
    static motion_result_t result;
    motion_request_t request;
    come(0);
    pass(0);
    ask(0, "engage\n");
    pass(0);
    pass(0);
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0);
    result = (motion_result_t){.id = request.id, .status = HV_ERR_STATE, .absent = 1u << 2};
    result.snapshot.service.tick_us = 81204000;
    TEST_ASSERT_TRUE(ring_push(&m_handover.results, &result, sizeof result, NULL, 0));
    pass(0);
    TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "{\"ok\":false,\"error\":\"engage: drive 3 is not ready: it does not answer\","
                                          "\"why\":\"not-ready\",\"state\":\"OFF\",\"tick\":81204000}"),
                             m_said);
}

static void test_who_has_gone_does_not_engage(void)
{
    come(0);
    pass(0);
    ask(0, "engage\n");
    (void)close(m_client[0]);
    m_client[0] = -1;
    pass(0);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_EQUAL(-1, m_control.client[0].fd);
}

/* Says something, closes, and is looked at. Returns which events reach the motion thread, as bits. */
static unsigned say_and_go(const char *text)
{
    motion_request_t request;
    unsigned events = 0;
    come(0);
    pass(0);
    ask(0, text);
    (void)close(m_client[0]);
    m_client[0] = -1;
    for (unsigned i = 0; i < 5; i++) {
        pass(0);
        while (ring_pop(&m_handover.requests, &request, sizeof request) > 0) {
            events |= 1u << request.event;
        }
    }
    TEST_ASSERT_EQUAL_MESSAGE(-1, m_control.client[0].fd, text);
    return events;
}

static void test_who_has_gone_still_holds_whatever_it_asked_before(void)
{
    static const char *const k_before[] = {
        "",
        "by anna\n",
        "status\n",
        "resume\n",
        "nonsense\n",
        "dump\n",
        "watch\n",
        "heard 1 park\n",
        "service-off\n",
        "status\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\nstatus\n"};
    for (unsigned i = 0; i < sizeof k_before / sizeof k_before[0]; i++) {
        char text[256];
        (void)snprintf(text, sizeof text, "%shold\n", k_before[i]);
        const unsigned events = say_and_go(text) & ~(1u << EVENT_SERVICE_OFF);
        TEST_ASSERT_EQUAL_MESSAGE(1u << EVENT_HOLD, events, text);
        (void)snprintf(text, sizeof text, "%sheard 1 hold\n", k_before[i]);
        TEST_ASSERT_EQUAL_MESSAGE(1u << EVENT_HOLD, say_and_go(text) & ~(1u << EVENT_SERVICE_OFF), text);
    }
    TEST_ASSERT_EQUAL(0, say_and_go("status\nengage\njog 1 1 1\ntorque 1 on\nintensity 100\nreset\n"));
}

static void test_a_hold_behind_a_request_that_waits_for_its_answer_counts_when_its_client_goes(void)
{
    motion_request_t request;
    come(0);
    pass(0);
    ask(0, "engage\nhold\n");
    pass(0);
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0 && request.event == EVENT_ENGAGE);
    (void)close(m_client[0]);
    m_client[0] = -1;
    pass(0);
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0 && request.event == EVENT_HOLD);
}

static void test_who_waits_outside_grows_old_while_there_is_no_room(void)
{
    motion_request_t request;
    bool is_engaged = false;
    come_all("hold\n"); /* they stay, as long as the motion thread owes them an answer */
    come(NEWCOMER);
    pass(0);
    const int first = m_client[0];
    come(0);
    ask(0, "engage\n");
    for (unsigned i = 0; i < 30; i++) {
        pass(REQUEST_FRESH_US / 10);
        while (ring_pop(&m_handover.requests, &request, sizeof request) > 0) {
            is_engaged |= request.event == EVENT_ENGAGE;
        }
    }
    TEST_ASSERT_FALSE(is_engaged);
    TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "engage: asked more than 1 s ago") || has_heard(0, "engage: a hold came"), m_said);
    (void)close(first);
}

static void test_bytes_of_the_one_before_do_not_count_for_a_newcomer(void)
{
    come(0);
    pass(0);
    ask(0, "a line without an end, as long as there is room for it in the buffer of heaved");
    pass(0);
    (void)close(m_client[0]);
    m_client[0] = -1;
    pass(0);
    come(0);
    come(1);
    ask(1, "hold\n");
    pass(0);
    pass(0);
    motion_answers();
    pass(1000);
    ask(0, "resume\n");
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_blanks_before_a_request_change_nothing(void)
{
    static const char *const k_asked[] = {"  engage\n", "   torque all on\n", "heard 1  torque all on\n"};
    show_tick(5000000);
    come(0);
    pass(0);
    for (unsigned i = 0; i < sizeof k_asked / sizeof k_asked[0]; i++) {
        ask_in_a_stop(0, k_asked[i], REQUEST_FRESH_US);
        TEST_ASSERT_FALSE_MESSAGE(has_reached_the_motion_thread(), k_asked[i]);
        TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "\"stale\""), m_said);
    }
}

static void test_who_has_closed_its_sending_side_is_there(void)
{
    come(0);
    pass(0);
    ask(0, "engage\n");
    (void)shutdown(m_client[0], SHUT_WR);
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
    motion_answers();
    pass(0);
    TEST_ASSERT_TRUE(has_heard(0, "{\"ok\":true"));
}

static void test_a_tick_says_when_its_client_heard_heaved(void)
{
    motion_request_t request;
    show_tick(5000000);
    come(0);
    pass(0);
    ask(0, "heard 4000000 engage\n");
    pass(0);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "engage: asked more than 1 s ago"), m_said);
    ask(0, "heard 5000001 engage\n"); /* never told */
    pass(0);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    ask(0, "heard 4000001 engage\n");
    pass(0);
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0);
    TEST_ASSERT_TRUE(request.event == EVENT_ENGAGE && request.has_age && request.has_heard);
    TEST_ASSERT_EQUAL_UINT64(4000001, request.heard_us);
}

static void test_what_only_makes_it_safer_may_carry_any_tick(void)
{
    show_tick(5000000);
    come(0);
    pass(0);
    ask(0, "heard 0 hold\n");
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_a_wrong_tick_is_told(void)
{
    static const char *const k_wrong[] = {"heard engage\n", "heard 5\n", "heard -5 engage\n", "heard 5  \n",
                                          "heard 1234567890123456789 engage\n"};
    come(0);
    for (unsigned i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        ask(0, k_wrong[i]);
        pass(0);
        pass(0);
        TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "{\"ok\":false"), k_wrong[i]);
        TEST_ASSERT_FALSE_MESSAGE(has_reached_the_motion_thread(), k_wrong[i]);
    }
}

static void test_the_motion_thread_may_say_that_it_is_old(void)
{
    static motion_result_t result;
    motion_request_t request;
    come(0);
    pass(0);
    ask(0, "park\n");
    pass(0);
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0);
    TEST_ASSERT_TRUE(request.has_age && !request.has_heard && request.since_us <= m_now_us);
    result = (motion_result_t){.id = request.id, .status = HV_ERR_STATE, .is_old = true};
    TEST_ASSERT_TRUE(ring_push(&m_handover.results, &result, sizeof result, NULL, 0));
    pass(0);
    TEST_ASSERT_TRUE_MESSAGE(has_heard(0, "park: asked more than 1 s ago"), m_said);
}

/* --- What was asked before a hold --- */

#define VOID "a hold came after it was asked, so it is not done: ask again\",\"why\":\"held\""

static void test_hold_voids_what_others_asked_before_it(void)
{
    come(0);
    come(1);
    pass(0);
    ask(1, "dump\nengage\nstatus\n"); /* the dump is never answered in time */
    pass(0);
    ask(0, "hold\n");
    pass(0);
    motion_answers();
    pass(0);
    TEST_ASSERT_TRUE(has_heard(0, "{\"ok\":true"));
    m_control.client[1].dump_ticket = 0; /* it is answered */
    pass(0);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_TRUE_MESSAGE(has_heard(1, "engage: " VOID), m_said);
    TEST_ASSERT_NOT_NULL(strstr(m_said, "\"counters\""));
    ask(1, "engage\n");
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_hold_voids_what_still_waits_in_a_socket(void)
{
    char many[CONTROL_REQUEST_MAX * 2] = "dump\n";
    come(0);
    come(1);
    pass(0);
    for (size_t i = 0; i < 25; i++) {
        (void)strcat(many, "engage\n"); /* more than heaved reads while it owes an answer */
    }
    ask(1, many);
    pass(0);
    ask(0, "hold\n");
    pass(0);
    motion_answers();
    ask(1, "park\n"); /* after it */
    pass(0);
    m_control.client[1].dump_ticket = 0;
    for (unsigned i = 0; i < 30 && !has_reached_the_motion_thread(); i++) {
        pass(0);
    }
    motion_request_t request;
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0);
    TEST_ASSERT_EQUAL(EVENT_PARK, request.event);
}

static void test_hold_of_a_client_does_not_void_what_it_asks_next(void)
{
    come(0);
    pass(0);
    ask(0, "hold\nengage\n");
    pass(0);
    motion_answers();
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_who_heard_the_hold_and_comes_may_resume(void)
{
    come(0);
    pass(0);
    ask(0, "hold\n");
    pass(1000);
    motion_answers();
    pass(1000);
    TEST_ASSERT_TRUE(has_heard(0, "{\"ok\":true"));
    come(1);
    ask(1, "resume\n");
    pass(1000);
    pass(0);
    TEST_ASSERT_TRUE(has_reached_the_motion_thread());
}

static void test_hold_voids_what_came_with_a_connection_before_it(void)
{
    come(0);
    pass(1000);
    ask(0, "hold\n");
    come(1);
    ask(1, "engage\n");
    pass(1000);
    motion_answers();
    pass(0);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_TRUE_MESSAGE(has_heard(1, VOID), m_said);
}

static void test_a_hold_of_heaved_itself_voids_what_waits(void)
{
    static motion_view_words_t view;
    come(0);
    pass(0);
    ask(0, "hold\nengage\n");
    pass(0);
    motion_answers();
    view.view.own_holds = 1;
    seqlock_write(&m_handover.view, view.word);
    pass(0);
    TEST_ASSERT_FALSE(has_reached_the_motion_thread());
    TEST_ASSERT_TRUE_MESSAGE(has_heard(0, VOID), m_said);
    ask(0, "engage\n");
    pass(0);
    motion_request_t request;
    TEST_ASSERT_TRUE(ring_pop(&m_handover.requests, &request, sizeof request) > 0);
    TEST_ASSERT_TRUE(request.is_voidable && request.own_holds == 1);
}

/* --- Who may ask for what --- */

static char m_look_path[90];

/* With a second socket; client NEWCOMER comes by that. */
static void open_look_socket(void)
{
    control_close(&m_control);
    (void)snprintf(m_look_path, sizeof m_look_path, "%s/look", m_folder);
    (void)snprintf(m_config.look_socket, sizeof m_config.look_socket, "%s", m_look_path);
    TEST_ASSERT_EQUAL(0, control_open(&m_control, m_path, &m_config, &m_handover, &m_blackbox, &m_log));
}

static void look_in(unsigned i)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    memcpy(address.sun_path, m_look_path, sizeof m_look_path);
    m_client[i] = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    TEST_ASSERT_EQUAL(0, connect(m_client[i], (const struct sockaddr *)&address, sizeof address));
}

static void show(state_t state, unsigned percent)
{
    static motion_view_words_t view;
    view.view.snapshot.state = state;
    view.view.snapshot.intensity_percent = (uint8_t)percent;
    seqlock_write(&m_handover.view, view.word);
}

static void expect_refused(unsigned i, const char *request, const char *why)
{
    ask(i, request);
    pass(0);
    pass(0);
    TEST_ASSERT_TRUE_MESSAGE(has_heard(i, why), m_said);
    TEST_ASSERT_TRUE_MESSAGE(ring_is_empty(&m_handover.requests), request);
}

static void expect_taken(unsigned i, const char *request)
{
    ask(i, request);
    pass(0);
    pass(0);
    motion_answers();
    pass(0);
    TEST_ASSERT_TRUE_MESSAGE(has_heard(i, "{\"ok\":true"), request);
}

static void test_the_look_socket_is_for_everybody_and_takes_a_hold_but_nothing_else(void)
{
    static const char *const k_refused[] = {"engage\n", "resume\n",      "park\n",        "reset\n",       "shutdown\n",
                                            "dump\n",   "intensity 0\n", "intensity x\n", "operator-log\n"};
    struct stat found;
    open_look_socket();
    TEST_ASSERT_EQUAL(0, stat(m_look_path, &found));
    TEST_ASSERT_EQUAL_HEX(0666, found.st_mode & 0777);
    look_in(NEWCOMER);
    pass(0);
    for (unsigned i = 0; i < sizeof k_refused / sizeof k_refused[0]; i++) {
        expect_refused(NEWCOMER, k_refused[i], "not allowed; it takes the level ");
    }
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(m_said, "and not this socket"), m_said);
    expect_taken(NEWCOMER, "hold\n");
    ask(NEWCOMER, "status\n");
    pass(0);
    TEST_ASSERT_TRUE(has_heard(NEWCOMER, "\"counters\""));
    control_close(&m_control);
    TEST_ASSERT_NOT_EQUAL(0, stat(m_look_path, &found));
}

static void test_levels_of_clients_decide_and_hold_is_for_all(void)
{
    (void)snprintf(m_config.service_group.text, sizeof m_config.service_group.text, "mechanics");
    come(0);
    pass(0);
    m_control.levels.has_service_group = true;
    show(STATE_ENGAGED, 50);
    m_control.client[0].peer.level = LEVEL_OPERATE;
    expect_refused(0, "intensity 51\n",
                   "intensity 51: not allowed; it takes the level service (members of group mechanics)\",\"state\":\"ENGAGED\"");
    expect_refused(0, "reset\n", "reset: not allowed; it takes the level service");
    expect_refused(0, "shutdown\n", "not allowed");
    expect_refused(0, "dump\n", "not allowed");
    expect_taken(0, "intensity 50\n");
    expect_taken(0, "park\n");
    m_control.client[0].peer.level = LEVEL_LOOK;
    expect_refused(0, "park\n", "park: not allowed; it takes the level operate");
    expect_taken(0, "hold\n");
    m_control.client[0].peer.level = LEVEL_SERVICE;
    expect_taken(0, "intensity 51\n");
    expect_taken(0, "shutdown\n");
}

static void test_without_groups_whoever_connects_may_do_all(void)
{
    come(0);
    pass(0);
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, m_control.client[0].peer.level);
    TEST_ASSERT_EQUAL(getpid(), m_control.client[0].peer.pid);
    TEST_ASSERT_EQUAL(getuid(), m_control.client[0].peer.uid);
}

static void test_lookers_have_a_few_places_and_never_those_of_others(void)
{
    open_look_socket();
    for (unsigned i = 0; i < CONTROL_LOOKERS; i++) {
        look_in(i);
        pass(0);
    }
    for (unsigned i = CONTROL_LOOKERS; i < CONTROL_CLIENTS; i++) {
        come(i);
        pass(0);
    }
    pass(CONTROL_IDLE_US);
    for (unsigned i = CONTROL_LOOKERS; i < CONTROL_CLIENTS; i++) {
        ask(i, "watch 1\n"); /* they would be the first to go */
        pass(0);
    }
    look_in(NEWCOMER);
    ask(NEWCOMER, "hold\n");
    pass(LATE);
    pass(0);
    motion_answers();
    pass(0);
    TEST_ASSERT_TRUE(has_heard(NEWCOMER, "{\"ok\":true"));
    TEST_ASSERT_LESS_THAN_UINT(CONTROL_LOOKERS, who_gave_way());
}

/* --- What is written down --- */

static bool takes_entry(operator_entry_t *entry)
{
    return ring_pop(&m_log.ring, entry, sizeof *entry) > 0;
}

static void keep_a_log(void)
{
    memset(&m_log, 0, sizeof m_log);
    ring_init(&m_log.ring, m_log.ring_bytes, sizeof m_log.ring_bytes);
    (void)snprintf(m_log.path, sizeof m_log.path, "nobody writes it");
}

static void test_log_has_who_what_and_what_became_of_it(void)
{
    operator_entry_t entry;
    keep_a_log();
    show(STATE_SETTLED, 100);
    come(0);
    pass(0);
    ask(0, "status\n");
    pass(0);
    ask(0, "nonsense\n");
    pass(0);
    TEST_ASSERT_FALSE(takes_entry(&entry));
    expect_taken(0, "engage\n");
    TEST_ASSERT_TRUE(takes_entry(&entry));
    TEST_ASSERT_EQUAL_STRING("engage", entry.request);
    TEST_ASSERT_EQUAL_STRING("", entry.answer);
    TEST_ASSERT_EQUAL_STRING("", entry.by);
    TEST_ASSERT_EQUAL_UINT32(getuid(), entry.uid);
    TEST_ASSERT_EQUAL_UINT32(getgid(), entry.gid);
    TEST_ASSERT_EQUAL_INT32(getpid(), entry.pid);
    TEST_ASSERT_EQUAL(STATE_SETTLED, entry.before);
    TEST_ASSERT_EQUAL(STATE_OFF, entry.after); /* as the motion thread has it in this test */
    TEST_ASSERT_INT64_WITHIN(60, time(NULL), entry.at.tv_sec);
    ask(0, "by anna\n");
    pass(0);
    TEST_ASSERT_TRUE(has_heard(0, "{\"ok\":true"));
    m_control.client[0].peer.level = LEVEL_LOOK;
    expect_refused(0, "park\n", "not allowed");
    TEST_ASSERT_TRUE(takes_entry(&entry));
    TEST_ASSERT_EQUAL_STRING("anna", entry.by);
    TEST_ASSERT_EQUAL_STRING_LEN("park: not allowed", entry.answer, 17);
    TEST_ASSERT_EQUAL(STATE_SETTLED, entry.after);
    ask(0, "by \nby 0123456789012345678901234567890123456789abcdefgh\n");
    pass(0);
    TEST_ASSERT_TRUE(has_heard(0, "by: a name of 1 to 47 bytes is needed"));
}

static void test_log_has_requests_whose_client_has_gone(void)
{
    operator_entry_t entry;
    keep_a_log();
    come(0);
    ask(0, "hold\n");
    pass(0);
    pass(0);
    TEST_ASSERT_FALSE(takes_entry(&entry));
    control_close(&m_control);
    TEST_ASSERT_TRUE(takes_entry(&entry));
    TEST_ASSERT_EQUAL_STRING("hold", entry.request);
    TEST_ASSERT_EQUAL_STRING("under way; the client has gone before it was answered", entry.answer);
    TEST_ASSERT_FALSE_MESSAGE(entry.is_refused, "it is carried out all the same");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_blanks_before_a_request_change_nothing);
    RUN_TEST(test_bytes_of_the_one_before_do_not_count_for_a_newcomer);
    RUN_TEST(test_who_waits_outside_grows_old_while_there_is_no_room);
    RUN_TEST(test_a_hold_behind_a_request_that_waits_for_its_answer_counts_when_its_client_goes);
    RUN_TEST(test_who_has_gone_still_holds_whatever_it_asked_before);
    RUN_TEST(test_hold_voids_what_others_asked_before_it);
    RUN_TEST(test_hold_voids_what_still_waits_in_a_socket);
    RUN_TEST(test_hold_of_a_client_does_not_void_what_it_asks_next);
    RUN_TEST(test_who_heard_the_hold_and_comes_may_resume);
    RUN_TEST(test_hold_voids_what_came_with_a_connection_before_it);
    RUN_TEST(test_a_hold_of_heaved_itself_voids_what_waits);
    RUN_TEST(test_what_waited_while_heaved_stood_still_is_not_done);
    RUN_TEST(test_what_came_with_its_connection_is_as_old_as_that);
    RUN_TEST(test_who_came_before_the_first_look_came_then);
    RUN_TEST(test_one_that_came_among_many_is_as_old_as_it_is);
    RUN_TEST(test_what_only_makes_it_safer_has_no_age);
    RUN_TEST(test_a_request_that_waits_behind_another_grows_old);
    RUN_TEST(test_who_waits_for_drives_is_told_a_tick_to_come_back_with);
    RUN_TEST(test_who_has_gone_does_not_engage);
    RUN_TEST(test_who_has_closed_its_sending_side_is_there);
    RUN_TEST(test_a_tick_says_when_its_client_heard_heaved);
    RUN_TEST(test_what_only_makes_it_safer_may_carry_any_tick);
    RUN_TEST(test_a_wrong_tick_is_told);
    RUN_TEST(test_the_motion_thread_may_say_that_it_is_old);
    RUN_TEST(test_a_client_that_asks_nothing_gives_way_before_watchers);
    RUN_TEST(test_of_idle_clients_the_one_that_asked_first_gives_way);
    RUN_TEST(test_the_oldest_watcher_gives_way_before_who_has_just_asked);
    RUN_TEST(test_clients_that_keep_asking_do_not_keep_others_out);
    RUN_TEST(test_who_has_just_come_may_ask_first);
    RUN_TEST(test_who_has_asked_since_the_poll_stays);
    RUN_TEST(test_nobody_gives_way_where_somebody_has_gone_since_the_poll);
    RUN_TEST(test_who_waits_for_the_motion_thread_gets_its_answer_and_a_newcomer_waits_outside);
    RUN_TEST(test_who_waits_for_the_disk_gives_way_last);
    RUN_TEST(test_the_look_socket_is_for_everybody_and_takes_a_hold_but_nothing_else);
    RUN_TEST(test_levels_of_clients_decide_and_hold_is_for_all);
    RUN_TEST(test_without_groups_whoever_connects_may_do_all);
    RUN_TEST(test_lookers_have_a_few_places_and_never_those_of_others);
    RUN_TEST(test_log_has_who_what_and_what_became_of_it);
    RUN_TEST(test_log_has_requests_whose_client_has_gone);
    return UNITY_END();
}

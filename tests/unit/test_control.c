/* SPDX-License-Identifier: MIT
 * test_control.c - who gets a place at the control socket, in virtual time: a newcomer always does, and who gives way is told.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "control.h"
#include "unity.h"

#define LATE    (CONTROL_GRACE_US + 1)
#define IS_GONE "too many clients: this one had to give way to a newer one"

void hv_assert_failed(const char *file, int line)
{
    (void)file;
    (void)line;
    TEST_FAIL_MESSAGE("assertion failed");
}

static config_t m_config;
static motion_loop_t m_loop;
static blackbox_t m_blackbox;
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
    control_fill(&m_control, fds);
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
    TEST_ASSERT_TRUE(ring_pop(&m_loop.requests, &request, sizeof request) > 0);
    result = (motion_result_t){.id = request.id, .status = HV_OK};
    TEST_ASSERT_TRUE(ring_push(&m_loop.results, &result, sizeof result, NULL, 0));
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
    seqlock_init(&m_loop.view, m_loop.view_word, MOTION_VIEW_WORDS);
    ring_init(&m_loop.requests, m_loop.request_bytes, sizeof m_loop.request_bytes);
    ring_init(&m_loop.results, m_loop.result_bytes, sizeof m_loop.result_bytes);
    m_blackbox.memory = &memory; /* it is there, and never answers */
    m_now_us = 1000000;
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-control-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    (void)snprintf(m_path, sizeof m_path, "%s/s", m_folder);
    for (unsigned i = 0; i <= NEWCOMER; i++) {
        m_client[i] = -1;
    }
    TEST_ASSERT_EQUAL(0, control_open(&m_control, m_path, &m_config, &m_loop, &m_blackbox));
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
    control_fill(&m_control, fds);
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
    control_fill(&m_control, fds);
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
    control_fill(&m_control, fds);
    TEST_ASSERT_EQUAL_MESSAGE(0, poll(fds, CONTROL_FDS, 0), "the loop would spin");
    motion_answers();
    pass(0);
    pass(0);
    TEST_ASSERT_TRUE(is_dropped(0));
    TEST_ASSERT_EQUAL_STRING_LEN("{\"ok\":true", m_said, 10);
    TEST_ASSERT_NOT_NULL(strstr(m_said, IS_GONE));
    TEST_ASSERT_TRUE(has_heard(NEWCOMER, "\"counters\""));
    control_fill(&m_control, fds);
    TEST_ASSERT_EQUAL(m_control.fd, fds[0].fd);
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

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_client_that_asks_nothing_gives_way_before_watchers);
    RUN_TEST(test_of_idle_clients_the_one_that_asked_first_gives_way);
    RUN_TEST(test_the_oldest_watcher_gives_way_before_who_has_just_asked);
    RUN_TEST(test_clients_that_keep_asking_do_not_keep_others_out);
    RUN_TEST(test_who_has_just_come_may_ask_first);
    RUN_TEST(test_who_has_asked_since_the_poll_stays);
    RUN_TEST(test_nobody_gives_way_where_somebody_has_gone_since_the_poll);
    RUN_TEST(test_who_waits_for_the_motion_thread_gets_its_answer_and_a_newcomer_waits_outside);
    RUN_TEST(test_who_waits_for_the_disk_gives_way_last);
    return UNITY_END();
}

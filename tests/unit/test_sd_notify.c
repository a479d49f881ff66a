/* SPDX-License-Identifier: MIT
 * test_sd_notify.c - what the service manager gets to hear, on a socket like its own.
 */
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "daemon/sd_notify.h"
#include "unity.h"

static int m_fd = -1;
static sd_notify_t m_manager = {.fd = -1};
static snapshot_t m_snapshot;

void setUp(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "/tmp/heave-notify-%ld", (long)getpid());
    (void)unlink(address.sun_path);
    m_fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    TEST_ASSERT_EQUAL_INT(0, bind(m_fd, (const struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, setenv("NOTIFY_SOCKET", address.sun_path, 1));
    TEST_ASSERT_EQUAL_INT(0, setenv("WATCHDOG_USEC", "200000", 1));
    m_snapshot = (snapshot_t){.state = STATE_ENGAGED};
}

void tearDown(void)
{
    if (m_fd >= 0) {
        (void)unlink(getenv("NOTIFY_SOCKET"));
        (void)close(m_fd);
    }
    (void)unsetenv("NOTIFY_SOCKET");
    (void)unsetenv("WATCHDOG_USEC");
    (void)unsetenv("WATCHDOG_PID");
    sd_notify_close(&m_manager);
}

/* The next message; "" where there is none. */
static const char *heard(void)
{
    static char text[256];
    const ssize_t length = recv(m_fd, text, sizeof text - 1, 0);
    text[length > 0 ? length : 0] = '\0';
    return text;
}

static void serve_cycle(uint64_t cycle, uint64_t now_us)
{
    m_snapshot.cycle = cycle;
    sd_notify_serve(&m_manager, &m_snapshot, now_us);
}

static void test_manager_ready_then_state_once(void)
{
    sd_notify_ready(&m_manager, 0);
    TEST_ASSERT_EQUAL_STRING("READY=1", heard());
    serve_cycle(1, 1000);
    TEST_ASSERT_EQUAL_STRING("STATUS=ENGAGED", heard());
    serve_cycle(2, 2000);
    TEST_ASSERT_EQUAL_STRING("", heard());
}

static void test_manager_change_of_state_and_fault_are_told(void)
{
    sd_notify_ready(&m_manager, 0);
    serve_cycle(1, 1000);
    (void)heard();
    (void)heard();
    m_snapshot.state = STATE_FAULT;
    m_snapshot.fault.code = FAULT_BUS;
    serve_cycle(2, 2000);
    const char *text = heard();
    TEST_ASSERT_EQUAL_STRING_LEN("STATUS=FAULT: ", text, 14);
    TEST_ASSERT_EQUAL_STRING(fault_text(FAULT_BUS), &text[14]);
}

static void test_manager_watchdog_is_petted_twice_a_period_while_cycles_run(void)
{
    sd_notify_ready(&m_manager, 0);
    serve_cycle(1, 1000);
    (void)heard();
    (void)heard();
    unsigned petted = 0;
    for (uint64_t ms = 2; ms <= 1000; ms++) {
        serve_cycle(ms, ms * 1000);
        petted += strcmp(heard(), "WATCHDOG=1") == 0;
    }
    TEST_ASSERT_UINT_WITHIN(1, 10, petted);
}

static void test_manager_watchdog_is_not_petted_for_a_thread_that_stands_still(void)
{
    sd_notify_ready(&m_manager, 0);
    serve_cycle(7, 1000);
    serve_cycle(7, 150000);
    (void)heard();
    (void)heard();
    TEST_ASSERT_EQUAL_STRING("WATCHDOG=1", heard());
    for (uint64_t ms = 151; ms <= 2000; ms++) {
        serve_cycle(7, ms * 1000);
        TEST_ASSERT_EQUAL_STRING("", heard());
    }
    serve_cycle(8, 2001000);
    TEST_ASSERT_EQUAL_STRING("WATCHDOG=1", heard());
}

static void test_manager_stopping_says_how_long_it_may_take(void)
{
    sd_notify_ready(&m_manager, 0);
    (void)heard();
    sd_notify_stopping(&m_manager, 7000000);
    TEST_ASSERT_EQUAL_STRING("STOPPING=1\nEXTEND_TIMEOUT_USEC=7000000", heard());
}

static void test_manager_without_one_nothing_is_told(void)
{
    TEST_ASSERT_EQUAL_INT(0, unsetenv("WATCHDOG_USEC"));
    sd_notify_ready(&m_manager, 0);
    (void)heard();
    serve_cycle(1, 1000);
    (void)heard();
    for (uint64_t ms = 2; ms <= 1000; ms++) {
        serve_cycle(ms, ms * 1000);
        TEST_ASSERT_EQUAL_STRING("", heard());
    }
    TEST_ASSERT_EQUAL_INT(0, setenv("NOTIFY_SOCKET", "/tmp/heave-notify-gone", 1));
}

static void test_manager_that_is_not_there_does_no_harm(void)
{
    sd_notify_ready(&m_manager, 0);
    (void)close(m_fd);
    m_fd = -1;
    serve_cycle(1, 1000);
    sd_notify_stopping(&m_manager, 7000000);
    sd_notify_close(&m_manager);
    TEST_ASSERT_EQUAL_INT(0, setenv("NOTIFY_SOCKET", "/tmp/heave-notify-gone", 1));
    sd_notify_ready(&m_manager, 0);
    sd_notify_stopping(&m_manager, 7000000);
    sd_notify_close(&m_manager);
    TEST_ASSERT_EQUAL_INT(0, unsetenv("NOTIFY_SOCKET"));
    sd_notify_ready(&m_manager, 0);
    serve_cycle(2, 2000);
    sd_notify_stopping(&m_manager, 7000000);
}

/* A manager that reads nothing for a while: nobody waits for it, and it hears all that still counts afterwards. */
static void test_manager_that_does_not_read_is_told_later(void)
{
    unsigned taken = 0;
    const int filler = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", getenv("NOTIFY_SOCKET"));
    while (sendto(filler, "x", 1, 0, (const struct sockaddr *)&address, sizeof address) == 1) {
        taken++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, taken);
    sd_notify_ready(&m_manager, 0);
    serve_cycle(1, 1000);
    serve_cycle(2, 200000);
    sd_notify_stopping(&m_manager, 7000000);
    for (unsigned i = 0; i < taken; i++) {
        TEST_ASSERT_EQUAL_STRING("x", heard());
    }
    TEST_ASSERT_EQUAL_STRING("", heard());
    serve_cycle(3, 201000);
    TEST_ASSERT_EQUAL_STRING("READY=1", heard());
    TEST_ASSERT_EQUAL_STRING("STOPPING=1\nEXTEND_TIMEOUT_USEC=7000000", heard());
    TEST_ASSERT_EQUAL_STRING("STATUS=ENGAGED", heard());
    TEST_ASSERT_EQUAL_STRING("WATCHDOG=1", heard());
    serve_cycle(4, 202000);
    TEST_ASSERT_EQUAL_STRING("", heard());
    (void)close(filler);
}

static void test_manager_waits_while_heaved_starts_anew(void)
{
    sd_notify_ready(&m_manager, 0);
    (void)heard();
    sd_notify_restart(&m_manager, false);
    TEST_ASSERT_EQUAL_STRING("WATCHDOG=1\nWATCHDOG_USEC=30000000", heard());
    sd_notify_restart(&m_manager, true);
    TEST_ASSERT_EQUAL_STRING("WATCHDOG=1\nWATCHDOG_USEC=200000", heard());
    TEST_ASSERT_EQUAL_INT(0, unsetenv("WATCHDOG_USEC"));
    sd_notify_ready(&m_manager, 0);
    (void)heard();
    sd_notify_restart(&m_manager, false);
    TEST_ASSERT_EQUAL_STRING("", heard());
}

static void test_manager_on_an_abstract_socket(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int length = snprintf(&address.sun_path[1], sizeof address.sun_path - 1, "heave-notify-%ld", (long)getpid());
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    char name[sizeof address.sun_path + 1], text[16] = "";
    TEST_ASSERT_EQUAL_INT(
        0, bind(fd, (const struct sockaddr *)&address, (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)length)));
    (void)unlink(getenv("NOTIFY_SOCKET"));
    (void)snprintf(name, sizeof name, "@%s", &address.sun_path[1]);
    TEST_ASSERT_EQUAL_INT(0, setenv("NOTIFY_SOCKET", name, 1));
    sd_notify_ready(&m_manager, 0);
    TEST_ASSERT_EQUAL_INT(7, recv(fd, text, sizeof text, 0));
    TEST_ASSERT_EQUAL_STRING("READY=1", text);
    (void)close(fd);
}

static void test_manager_watchdog_of_another_process_is_not_petted(void)
{
    TEST_ASSERT_EQUAL_INT(0, setenv("WATCHDOG_PID", "1", 1));
    sd_notify_ready(&m_manager, 0);
    TEST_ASSERT_EQUAL_UINT64(0, m_manager.watchdog_us);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_manager_ready_then_state_once);
    RUN_TEST(test_manager_change_of_state_and_fault_are_told);
    RUN_TEST(test_manager_watchdog_is_petted_twice_a_period_while_cycles_run);
    RUN_TEST(test_manager_watchdog_is_not_petted_for_a_thread_that_stands_still);
    RUN_TEST(test_manager_stopping_says_how_long_it_may_take);
    RUN_TEST(test_manager_without_one_nothing_is_told);
    RUN_TEST(test_manager_that_is_not_there_does_no_harm);
    RUN_TEST(test_manager_that_does_not_read_is_told_later);
    RUN_TEST(test_manager_waits_while_heaved_starts_anew);
    RUN_TEST(test_manager_on_an_abstract_socket);
    RUN_TEST(test_manager_watchdog_of_another_process_is_not_petted);
    return UNITY_END();
}

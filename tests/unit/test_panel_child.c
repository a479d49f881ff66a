/* SPDX-License-Identifier: MIT
 * test_panel_child.c - programs that the panel runs for a page: what comes back of them, what they get, and their bounds.
 */
#include "panel/child.h"

#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "heave/status.h"
#include "unity.h"

static child_t *m_watched[CHILDREN_MAX];
static unsigned m_watched_count;
static int m_code, m_told;
static char *m_text;
static size_t m_length;

void hv_assert_failed(const char *file, int line)
{
    (void)fprintf(stderr, "%s:%d\n", file, line);
    abort();
}

static void watch(child_t *child)
{
    m_watched[m_watched_count++] = child;
}

static void end(void *context, int code, char *text, size_t length)
{
    (void)context;
    free(m_text);
    m_code = code;
    m_text = text;
    m_length = length;
    m_told++;
}

/* Of another kind. */
static void other_end(void *context, int code, char *text, size_t length)
{
    end(context, code, text, length);
}

void setUp(void)
{
    child_watch = watch;
    m_watched_count = 0;
    m_told = 0;
    m_code = 99;
}

void tearDown(void)
{
    free(m_text);
    m_text = NULL;
}

/* As the event loop does: until it has ended. */
static void wait_for(child_t *child)
{
    struct pollfd fd = {.fd = child->fd, .events = POLLIN};
    while (poll(&fd, 1, 20000) > 0 && child_readable(child)) {}
    (void)close(child->fd);
    child_closed(child);
}

static bool start(const char *script, const char *language)
{
    const char *const argv[] = {"/bin/sh", "-c", script, NULL};
    return child_run(argv, language, end, &m_code, 1000);
}

static const char *run(const char *script, const char *language)
{
    m_watched_count = 0;
    TEST_ASSERT_TRUE(start(script, language));
    TEST_ASSERT_EQUAL_UINT(1, m_watched_count);
    wait_for(m_watched[0]);
    return m_text != NULL ? m_text : "";
}

static void test_output_and_exit_code_come_back(void)
{
    TEST_ASSERT_EQUAL_STRING("one\ntwo\n", run("echo one; echo not this >&2; echo two; exit 3", ""));
    TEST_ASSERT_EQUAL_INT(3, m_code);
    TEST_ASSERT_EQUAL_UINT(8, m_length);
    TEST_ASSERT_EQUAL_INT(1, m_told);
    TEST_ASSERT_EQUAL_STRING("", run("cat", "")); /* there is nothing to read */
    TEST_ASSERT_EQUAL_INT(0, m_code);
    (void)run("kill -9 $$", "");
    TEST_ASSERT_EQUAL_INT(-1, m_code);
}

static void test_a_program_that_is_not_there(void)
{
    const char *const argv[] = {"/nonexistent/heaved", NULL};
    TEST_ASSERT_TRUE(child_run(argv, "", end, &m_code, 0));
    wait_for(m_watched[0]);
    TEST_ASSERT_EQUAL_INT(127, m_code);
}

static void test_it_speaks_the_language_and_inherits_nothing(void)
{
    char script[128];
    const int secret = open("/dev/null", O_RDONLY); // NOLINT(android-cloexec-open): what a child would inherit
    TEST_ASSERT_GREATER_THAN_INT(2, secret);
    TEST_ASSERT_EQUAL_INT(0, setenv("HEAVE_SECRET", "x", 1)); // NOLINT(concurrency-mt-unsafe): no other thread
    TEST_ASSERT_EQUAL_STRING("zh_CN.UTF-8\n", run("echo $LC_ALL $HEAVE_SECRET", "zh"));
    TEST_ASSERT_EQUAL_STRING("C.UTF-8\n", run("echo $LANG$LC_ALL$HEAVE_SECRET", ""));
    (void)snprintf(script, sizeof script, "test -e /proc/self/fd/%d && echo there || echo gone", secret);
    TEST_ASSERT_EQUAL_STRING("gone\n", run(script, ""));
    (void)close(secret);
}

static void test_it_writes_no_file(void)
{
    char path[] = "/tmp/heave-child-XXXXXX", script[96];
    struct stat about;
    const int fd = mkstemp(path);
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, fd);
    (void)close(fd);
    (void)snprintf(script, sizeof script, "echo x > %s", path);
    (void)run(script, "");
    TEST_ASSERT_NOT_EQUAL(0, m_code);
    TEST_ASSERT_EQUAL_INT(0, stat(path, &about));
    TEST_ASSERT_EQUAL_INT(0, about.st_size);
    (void)unlink(path);
}

static void test_too_much_output_ends_it(void)
{
    (void)run("exec cat /dev/zero", "");
    TEST_ASSERT_EQUAL_INT(-1, m_code);
    TEST_ASSERT_GREATER_THAN_UINT(CHILD_OUTPUT_MAX, m_length);
    TEST_ASSERT_LESS_THAN_UINT(CHILD_OUTPUT_MAX + 131072u, m_length);
}

static void test_too_long_ends_it(void)
{
    struct pollfd fd = {.events = POLLIN};
    TEST_ASSERT_TRUE(start("exec sleep 600", ""));
    fd.fd = m_watched[0]->fd;
    child_watch_time(1000 + CHILD_LONGEST_MS - 1);
    TEST_ASSERT_EQUAL_INT(0, poll(&fd, 1, 100)); /* still there */
    child_watch_time(1000 + CHILD_LONGEST_MS);
    wait_for(m_watched[0]);
    TEST_ASSERT_EQUAL_INT(-1, m_code);
}

static void test_who_is_gone_is_not_told(void)
{
    TEST_ASSERT_TRUE(start("echo late", ""));
    child_forget(&m_code);
    wait_for(m_watched[0]);
    TEST_ASSERT_EQUAL_INT(0, m_told);
    TEST_ASSERT_EQUAL_INT(0, m_watched[0]->pid); /* and its place is free */
}

static int work(void *context, int fd)
{
    const char *const text = context;
    return write(fd, text, strlen(text)) == (ssize_t)strlen(text) ? 5 : 6;
}

static void test_this_process_works_something_out(void)
{
    TEST_ASSERT_TRUE(child_work(work, (char[]){"worked out"}, end, 0));
    wait_for(m_watched[0]);
    TEST_ASSERT_EQUAL_INT(5, m_code);
    TEST_ASSERT_EQUAL_STRING("worked out", m_text);
}

/* And they keep no work away, which is of two at a time for each kind. */
static void test_few_at_a_time(void)
{
    for (unsigned i = 0; i < CHILD_PROGRAMS; i++) {
        TEST_ASSERT_TRUE(start("exec sleep 600", ""));
    }
    TEST_ASSERT_FALSE(start("exit 0", ""));
    for (unsigned i = 0; i < CHILD_WORKS; i++) {
        TEST_ASSERT_TRUE(child_work(work, (char[]){"worked out"}, other_end, 1000));
    }
    TEST_ASSERT_FALSE(child_work(work, (char[]){"worked out"}, other_end, 1000));
    child_watch_time(1000 + CHILD_LONGEST_MS);
    for (unsigned i = 0; i < CHILD_PROGRAMS + CHILD_WORKS; i++) {
        wait_for(m_watched[i]);
    }
    TEST_ASSERT_EQUAL_INT(CHILD_PROGRAMS + CHILD_WORKS, m_told);
    TEST_ASSERT_EQUAL_STRING("again\n", run("echo again", ""));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_output_and_exit_code_come_back);
    RUN_TEST(test_a_program_that_is_not_there);
    RUN_TEST(test_it_speaks_the_language_and_inherits_nothing);
    RUN_TEST(test_it_writes_no_file);
    RUN_TEST(test_too_much_output_ends_it);
    RUN_TEST(test_too_long_ends_it);
    RUN_TEST(test_few_at_a_time);
    RUN_TEST(test_who_is_gone_is_not_told);
    RUN_TEST(test_this_process_works_something_out);
    return UNITY_END();
}

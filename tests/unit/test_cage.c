/* SPDX-License-Identifier: MIT
 * test_cage.c - what a process in the cage can do, and what ends it.
 */
#include "common/cage.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "heave/status.h"
#include "unity.h"

#define SECONDS 5u

static int m_pipe[2];
static volatile int m_zero;

void setUp(void)
{
    TEST_ASSERT_EQUAL(0, pipe(m_pipe));
}

void tearDown(void)
{
    (void)close(m_pipe[0]);
    (void)close(m_pipe[1]);
}

static int code_of(void *ctx)
{
    return *(int *)ctx;
}

static void test_code_of_the_function_comes_back(void)
{
    static const int k_codes[] = {0, 1, 65, 254};
    for (unsigned i = 0; i < sizeof k_codes / sizeof k_codes[0]; i++) {
        int code = k_codes[i];
        TEST_ASSERT_EQUAL(code, cage_run(code_of, &code, m_pipe[1], SECONDS));
    }
}

static int write_to_both(void *ctx)
{
    const int other = *(int *)ctx;
    return write(m_pipe[1], "kept", 4) == 4 && write(other, "lost", 4) < 0 ? 7 : 8;
}

static void test_only_what_was_given_can_be_written(void)
{
    char bytes[8] = "";
    int other = open("/dev/null", O_WRONLY);
    TEST_ASSERT_TRUE(other > m_pipe[1]);
    TEST_ASSERT_EQUAL(7, cage_run(write_to_both, &other, m_pipe[1], SECONDS));
    TEST_ASSERT_EQUAL(4, read(m_pipe[0], bytes, sizeof bytes));
    TEST_ASSERT_EQUAL_STRING("kept", bytes);
    TEST_ASSERT_EQUAL(4, write(other, "open", 4)); /* here it still is */
    (void)close(other);
}

static int change_memory(void *ctx)
{
    *(int *)ctx = 2;
    return 0;
}

static void test_memory_stays_as_it_was(void)
{
    int value = 1;
    TEST_ASSERT_EQUAL(0, cage_run(change_memory, &value, m_pipe[1], SECONDS));
    TEST_ASSERT_EQUAL(1, value);
}

/* --- What ends it --- */

static int open_a_file(void *ctx)
{
    return open(ctx, O_RDONLY) >= 0 ? 1 : 2;
}

static int make_a_file(void *ctx)
{
    (void)ctx;
    return creat("cage-was-left", 0600) >= 0 ? 1 : 2;
}

static int ask_the_network(void *ctx)
{
    (void)ctx;
    return socket(AF_INET, SOCK_DGRAM, 0) >= 0 ? 1 : 2;
}

static int kill_the_parent(void *ctx)
{
    return kill(*(pid_t *)ctx, SIGTERM);
}

static int start_a_program(void *ctx)
{
    static char *const k_words[] = {"/bin/true", NULL};
    (void)ctx;
    return execv(k_words[0], k_words);
}

static int start_a_process(void *ctx)
{
    (void)ctx;
    return fork() < 0 ? 1 : 2;
}

static int get_memory(void *ctx)
{
    (void)ctx;
    return mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) != MAP_FAILED ? 1 : 2;
}

static int crash(void *ctx)
{
    (void)ctx;
    __builtin_trap();
}

static int run_for_ever(void *ctx)
{
    (void)ctx;
    while (m_zero == 0) {}
    return 0;
}

static void test_anything_else_ends_it(void)
{
    pid_t self = getpid();
    const struct {
        int (*run)(void *ctx);
        void *ctx;
        const char *what;
    } k_rows[] = {{open_a_file, "/etc/hostname", "a file"}, {make_a_file, NULL, "a new file"},
                  {ask_the_network, NULL, "the network"},   {kill_the_parent, &self, "a signal"},
                  {start_a_program, NULL, "a program"},     {start_a_process, NULL, "a process"},
                  {get_memory, NULL, "memory for code"},    {crash, NULL, "a crash"}};
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(CAGE_BROKEN, cage_run(k_rows[i].run, k_rows[i].ctx, m_pipe[1], SECONDS), k_rows[i].what);
    }
    TEST_ASSERT_NOT_EQUAL_MESSAGE(0, access("cage-was-left", F_OK), "made a file all the same");
}

static void test_a_loop_without_end_ends(void)
{
    TEST_ASSERT_EQUAL(CAGE_BROKEN, cage_run(run_for_ever, NULL, m_pipe[1], 1));
}

/* Whoever ends the run, or no longer reads its trace, ends the whole of it. */
static int wait_in_cage(void *ctx)
{
    char byte = 0;
    (void)!write(m_pipe[1], "!", 1);
    return (int)read(STDIN_FILENO, &byte, 1) + *(int *)ctx;
}

static void test_signal_from_outside_ends_both(void)
{
    int code = 3;
    int status = 0;
    char byte = 0;
    int input[2];
    TEST_ASSERT_EQUAL(0, pipe(input));
    const pid_t child = fork();
    if (child == 0) {
        (void)setpgid(0, 0);
        (void)dup2(input[0], STDIN_FILENO);
        _exit(cage_run(wait_in_cage, &code, m_pipe[1], SECONDS));
    }
    TEST_ASSERT_EQUAL(1, read(m_pipe[0], &byte, 1)); /* it is in there */
    TEST_ASSERT_EQUAL(0, kill(-child, SIGINT));
    TEST_ASSERT_EQUAL(child, waitpid(child, &status, 0));
    TEST_ASSERT_TRUE(WIFSIGNALED(status));
    TEST_ASSERT_EQUAL(SIGINT, WTERMSIG(status));
    (void)close(input[0]);
    (void)close(input[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_code_of_the_function_comes_back);
    RUN_TEST(test_only_what_was_given_can_be_written);
    RUN_TEST(test_memory_stays_as_it_was);
    RUN_TEST(test_anything_else_ends_it);
    RUN_TEST(test_a_loop_without_end_ends);
    RUN_TEST(test_signal_from_outside_ends_both);
    return UNITY_END();
}

/* SPDX-License-Identifier: MIT
 * child.c - see child.h.
 */
#include "panel/child.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define CPU_S        10u
#define MEMORY_BYTES (512u * 1024u * 1024u)
#define CHUNK        65536u

void (*child_watch)(child_t *child); /* the event loop's, set before anything is served */

static child_t m_child[CHILDREN_MAX]; /* the loop's callbacks reach nothing else */

static child_t *find_free(void)
{
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        if (m_child[i].pid == 0) {
            return &m_child[i];
        }
    }
    return NULL;
}

/* --- In the child --- */

static void limit(__rlimit_resource_t which, rlim_t value)
{
    const struct rlimit both = {value, value};
    (void)setrlimit(which, &both);
}

static void close_above(unsigned first)
{
    if (syscall(SYS_close_range, first, ~0u, 0u) != 0) {
        for (unsigned fd = first; fd < 1024u; fd++) {
            (void)close((int)fd);
        }
    }
}

/* Nothing of the panel but a pipe: no socket, no session, no file; and bounds. */
static void settle_in(int out)
{
    sigset_t none;
    const int null = open("/dev/null", O_RDWR);
    (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
    (void)prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    (void)dup2(null, STDIN_FILENO);
    (void)dup2(out, STDOUT_FILENO);
    (void)dup2(null, STDERR_FILENO);
    close_above(STDERR_FILENO + 1u);
    (void)sigemptyset(&none);
    (void)sigprocmask(SIG_SETMASK, &none, NULL);
    limit(RLIMIT_CPU, CPU_S);
    limit(RLIMIT_AS, MEMORY_BYTES);
    limit(RLIMIT_FSIZE, 0);
    limit(RLIMIT_CORE, 0);
}

static void run_program(const char *const *argv, const char *language)
{
    char *const chinese[] = {(char *)"LANG=zh_CN.UTF-8", (char *)"LANGUAGE=zh_CN", (char *)"LC_ALL=zh_CN.UTF-8", NULL};
    char *const english[] = {(char *)"LANG=C.UTF-8", NULL};
    union {
        const char *const *in;
        char *const *out;
    } arguments = {.in = argv}; /* execve changes none of them */
    (void)execve(argv[0], arguments.out, strcmp(language, "zh") == 0 ? chinese : english);
}

/* --- In the panel --- */

/* @return the pid; 0 in the child, whose output goes to its standard output; -1: not started */
static pid_t begin(child_t *child, child_end_t *end, void *context, int64_t now_ms)
{
    int ends[2];
    if (child == NULL || pipe2(ends, O_CLOEXEC) != 0) {
        return -1;
    }
    const pid_t pid = fork();
    if (pid == 0) {
        settle_in(ends[1]);
        return 0;
    }
    (void)close(ends[1]);
    if (pid < 0) {
        (void)close(ends[0]);
        return -1;
    }
    (void)fcntl(ends[0], F_SETFL, O_NONBLOCK);
    *child = (child_t){.pid = pid, .fd = ends[0], .until_ms = now_ms + CHILD_LONGEST_MS, .end = end, .context = context};
    child_watch(child);
    return pid;
}

static unsigned count_programs(void)
{
    unsigned count = 0;
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        count += m_child[i].pid != 0 && m_child[i].is_program;
    }
    return count;
}

bool child_run(const char *const *argv, const char *language, child_end_t *end, void *context, int64_t now_ms)
{
    child_t *const child = count_programs() < CHILD_PROGRAMS ? find_free() : NULL;
    const pid_t pid = begin(child, end, context, now_ms);
    if (pid == 0) {
        run_program(argv, language);
        _exit(127);
    }
    if (pid > 0) {
        child->is_program = true;
    }
    return pid > 0;
}

bool child_work(int (*work)(void *context, int fd), void *context, child_end_t *end, int64_t now_ms)
{
    const pid_t pid = begin(child_count(end) < CHILD_WORKS ? find_free() : NULL, end, context, now_ms);
    if (pid == 0) {
        _exit(work(context, STDOUT_FILENO));
    }
    return pid > 0;
}

unsigned child_count(child_end_t *end)
{
    unsigned count = 0;
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        count += m_child[i].pid != 0 && m_child[i].end == end;
    }
    return count;
}

bool child_readable(child_t *child)
{
    char *const text = realloc(child->text, child->length + CHUNK + 1u);
    if (text == NULL || child->length > CHILD_OUTPUT_MAX) {
        (void)kill(child->pid, SIGKILL);
        return false;
    }
    child->text = text;
    const ssize_t got = read(child->fd, child->text + child->length, CHUNK);
    if (got < 0) {
        return errno == EAGAIN || errno == EINTR;
    }
    child->length += (size_t)got;
    child->text[child->length] = '\0';
    return got > 0;
}

/* Its output is at its end: it ends at once, or is made to. */
void child_closed(child_t *child)
{
    int status = 0;
    const child_t ended = *child;
    if (waitpid(ended.pid, &status, WNOHANG) == 0) {
        const struct timespec moment = {.tv_nsec = 5000000}; /* between the end of its output and its own */
        (void)nanosleep(&moment, NULL);
        if (waitpid(ended.pid, &status, WNOHANG) == 0) {
            (void)kill(ended.pid, SIGKILL);
            (void)waitpid(ended.pid, &status, 0);
        }
    }
    *child = (child_t){.pid = 0};
    if (ended.context != NULL) {
        ended.end(ended.context, WIFEXITED(status) ? WEXITSTATUS(status) : -1, ended.text, ended.length);
    } else {
        free(ended.text);
    }
}

void child_watch_time(int64_t now_ms)
{
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        if (m_child[i].pid != 0 && now_ms >= m_child[i].until_ms) {
            (void)kill(m_child[i].pid, SIGKILL); /* which closes its pipe */
        }
    }
}

void child_forget(const void *context)
{
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        if (m_child[i].context == context) {
            m_child[i].context = NULL;
        }
    }
}

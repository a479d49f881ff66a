/* SPDX-License-Identifier: MIT
 * cage.c - a process that can only read, write and end; see cage.h.
 */
#include "common/cage.h"

#include <errno.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stdbool.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#define NO_CAGE 255 /* exit code */

/* Less where less is allowed anyway. */
static bool limit_time(unsigned seconds)
{
    struct rlimit time;
    if (getrlimit(RLIMIT_CPU, &time) != 0) {
        return false;
    }
    time.rlim_cur = seconds < time.rlim_max ? seconds : time.rlim_max;
    return setrlimit(RLIMIT_CPU, &time) == 0;
}

static bool close_range_of(unsigned first, unsigned last)
{
    return first > last ||
           syscall(SYS_close_range, first, last, 0u) == 0; /* by its number, as older C libraries have no name for it */
}

/* Descriptors that came from the caller's shell, too. */
static bool close_others(int output)
{
    const unsigned first = STDERR_FILENO + 1u, kept = output > STDERR_FILENO ? (unsigned)output : STDERR_FILENO;
    return close_range_of(first, kept - 1u) && close_range_of(kept + 1u, ~0u);
}

static bool enter(int output, unsigned seconds)
{
    const struct rlimit none = {0, 0};
    return prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && setrlimit(RLIMIT_CORE, &none) == 0 && limit_time(seconds) &&
           close_others(output) && prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) == 0;
}

static bool is_from_outside(int signal)
{
    return signal == SIGINT || signal == SIGTERM || signal == SIGHUP || signal == SIGQUIT || signal == SIGPIPE;
}

int cage_run(int (*run)(void *ctx), void *ctx, int output, unsigned seconds)
{
    int status = 0;
    const pid_t child = fork();
    if (child == 0) {
        const int code = enter(output, seconds) ? run(ctx) : NO_CAGE;
        for (;;) { /* the C library would end all threads of the process, which the cage does not allow */
            (void)syscall(SYS_exit, code);
        }
    }
    while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {}
    if (child < 0 || (WIFEXITED(status) && WEXITSTATUS(status) == NO_CAGE)) {
        return CAGE_MISSING;
    }
    if (WIFSIGNALED(status) && is_from_outside(WTERMSIG(status))) {
        (void)raise(WTERMSIG(status));
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : CAGE_BROKEN;
}

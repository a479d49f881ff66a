/* SPDX-License-Identifier: MIT
 * signals.c - see signals.h.
 */
#include "daemon/signals.h"

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/signalfd.h>

static const struct {
    int number;
    const char *name;
} k_handled[] = {{SIGTERM, "SIGTERM"}, {SIGINT, "SIGINT"}, {SIGQUIT, "SIGQUIT"}, {SIGHUP, "SIGHUP"}};

enum { HANDLED = sizeof k_handled / sizeof k_handled[0] };

static const int k_kept[] = {SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSEGV, SIGSYS, SIGTRAP, SIGXCPU, SIGCHLD};

static bool is_kept(int number)
{
    bool is_kept = false;
    for (size_t i = 0; i < sizeof k_kept / sizeof k_kept[0]; i++) {
        is_kept = is_kept || k_kept[i] == number;
    }
    return is_kept;
}

int signals_open(void)
{
    sigset_t set;
    for (int number = 1; number <= SIGRTMAX; number++) {
        if (!is_kept(number)) {
            (void)signal(number, SIG_IGN); /* refused for SIGKILL, SIGSTOP and those of the C library */
        }
    }
    (void)sigemptyset(&set);
    for (size_t i = 0; i < HANDLED; i++) {
        (void)sigaddset(&set, k_handled[i].number);
        (void)signal(k_handled[i].number, SIG_DFL); /* what is ignored does not become readable */
    }
    return sigprocmask(SIG_BLOCK, &set, NULL) == 0 ? signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK) : -1;
}

const char *signals_name(int number)
{
    for (size_t i = 0; i < HANDLED; i++) {
        if (k_handled[i].number == number) {
            return k_handled[i].name;
        }
    }
    return "";
}

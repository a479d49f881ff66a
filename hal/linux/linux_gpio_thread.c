/* SPDX-License-Identifier: MIT
 * linux_gpio_thread.c - the threads that talk to GPIO chips; see linux_gpio_thread.h.
 */
#include "linux_gpio_thread.h"

#include <errno.h>
#include <sched.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#define PRIORITY    60             /* below motion, which has 80, above threaded interrupts, which have 50 */
#define STACK_BYTES (128u * 1024u) /* locked into memory, so no more than needed */
#define END_S       1
#define PAUSE_NS    1000000 /* as between two looks at a chip that tells of no edges */

int linux_gpio_thread_start(pthread_t *thread, int *wake, void *(*function)(void *), void *argument)
{
    static const struct sched_param k_ordinary = {.sched_priority = 0};
    pthread_attr_t attributes;
    sigset_t all, before;
    *wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (*wake < 0) {
        return errno;
    }
    (void)pthread_attr_init(&attributes);
    (void)pthread_attr_setstacksize(&attributes, STACK_BYTES);
    (void)pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    (void)pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    (void)pthread_attr_setschedparam(&attributes, &k_ordinary);
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int error = pthread_create(thread, &attributes, function, argument);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    (void)pthread_attr_destroy(&attributes);
    if (error != 0) {
        (void)close(*wake);
    }
    return error;
}

void linux_gpio_thread_ask_for_priority(void)
{
    const struct sched_param parameters = {.sched_priority = PRIORITY};
    (void)pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

int linux_gpio_thread_wait(struct pollfd *fds, unsigned count, int ms)
{
    static const struct timespec k_pause = {.tv_nsec = PAUSE_NS};
    const int ready = poll(fds, count, ms);
    if (ready < 0) {
        (void)nanosleep(&k_pause, NULL);
    }
    return ready;
}

void linux_gpio_thread_wake(int wake)
{
    const uint64_t one = 1;
    (void)!write(wake, &one, sizeof one); /* cannot block; full means that it is awake */
}

bool linux_gpio_thread_end(pthread_t thread, int wake)
{
    struct timespec until;
    linux_gpio_thread_wake(wake);
    (void)clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += END_S;
    if (pthread_timedjoin_np(thread, NULL, &until) != 0) {
        return false;
    }
    (void)close(wake);
    return true;
}

uint64_t linux_gpio_thread_now_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

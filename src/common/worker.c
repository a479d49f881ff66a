/* SPDX-License-Identifier: MIT
 * worker.c - see worker.h.
 */
#include "common/worker.h"

#include <errno.h>
#include <stdint.h>
#include <time.h>

#define STACK_BYTES 262144 /* locked into memory whole */

static struct timespec from_now(unsigned ms)
{
    struct timespec time;
    (void)clock_gettime(CLOCK_MONOTONIC, &time);
    const int64_t ns = time.tv_nsec + (int64_t)ms * 1000000;
    time.tv_sec += (time_t)(ns / 1000000000);
    time.tv_nsec = (long)(ns % 1000000000);
    return time;
}

/* Waits until a flag is set, for so long at most. The mutex is held.
 * Returns the flag. */
static bool await(worker_t *self, const bool *flag, unsigned most_ms)
{
    const struct timespec until = from_now(most_ms);
    int error = 0;
    while (!*flag && error == 0) {
        error = pthread_cond_timedwait(&self->changed, &self->mutex, &until);
    }
    return *flag;
}

static void set(worker_t *self, bool *flag)
{
    (void)pthread_mutex_lock(&self->mutex);
    *flag = true;
    (void)pthread_cond_broadcast(&self->changed);
    (void)pthread_mutex_unlock(&self->mutex);
}

static void *run(void *argument)
{
    worker_t *self = argument;
    bool is_quit = false;
    while (!is_quit) {
        self->step(self->ctx, false);
        (void)pthread_mutex_lock(&self->mutex);
        is_quit = await(self, &self->is_quit, self->pause_ms);
        (void)pthread_mutex_unlock(&self->mutex);
    }
    self->step(self->ctx, true);
    set(self, &self->is_ended);
    return NULL;
}

static void init(worker_t *self, worker_step_t *step, void *ctx, unsigned pause_ms)
{
    pthread_condattr_t attributes;
    *self = (worker_t){.step = step, .ctx = ctx, .pause_ms = pause_ms};
    (void)pthread_mutex_init(&self->mutex, NULL);
    (void)pthread_condattr_init(&attributes);
    (void)pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    (void)pthread_cond_init(&self->changed, &attributes);
    (void)pthread_condattr_destroy(&attributes);
}

bool worker_start(worker_t *self, worker_step_t *step, void *ctx, unsigned pause_ms)
{
    pthread_attr_t attributes;
    init(self, step, ctx, pause_ms);
    (void)pthread_attr_init(&attributes);
    (void)pthread_attr_setstacksize(&attributes, STACK_BYTES);
    const int error = pthread_create(&self->thread, &attributes, run, self);
    (void)pthread_attr_destroy(&attributes);
    self->is_running = error == 0;
    errno = error;
    return self->is_running;
}

void worker_request_end(worker_t *self)
{
    if (self->is_running) {
        set(self, &self->is_quit);
    }
}

bool worker_close(worker_t *self, unsigned most_ms)
{
    if (self->step == NULL) {
        return true;
    }
    if (self->is_running) {
        worker_request_end(self);
        (void)pthread_mutex_lock(&self->mutex);
        const bool is_ended = await(self, &self->is_ended, most_ms);
        (void)pthread_mutex_unlock(&self->mutex);
        if (!is_ended) {
            return false;
        }
        (void)pthread_join(self->thread, NULL);
        self->is_running = false;
    } else {
        self->step(self->ctx, true);
    }
    self->step = NULL;
    return true;
}

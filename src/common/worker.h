/* SPDX-License-Identifier: MIT
 * worker.h - a thread that does over and over what may wait for a disk, so that nobody else has to. It takes its work from
 * bounded hand-overs; whoever ends it waits for a bounded time. Nothing is allocated but by the start.
 */
#ifndef HEAVE_COMMON_WORKER_H
#define HEAVE_COMMON_WORKER_H

#include <pthread.h>
#include <stdbool.h>

/** What it does over and over.
 *  @param is_end the last time: what waits is done now, as far as it can be */
typedef void worker_step_t(void *ctx, bool is_end);

/** A worker. Zeroed: none. Members are private to worker.c. */
typedef struct {
    worker_step_t *step;
    void *ctx;
    unsigned pause_ms;
    pthread_t thread;
    bool is_running;
    pthread_mutex_t mutex; /**< guards what follows */
    pthread_cond_t changed;
    bool is_quit;
    bool is_ended;
} worker_t;

/** Starts it.
 *  @param pause_ms between two steps
 *  @return false: errno says why; its last step can be done by worker_close() all the same */
bool worker_start(worker_t *self, worker_step_t *step, void *ctx, unsigned pause_ms);

/** Tells it to do its last step; waits for nothing. Harmless on none. */
void worker_request_end(worker_t *self);

/** Tells it to do its last step, and waits for the end of that. One that could not be started does it here. Harmless on none.
 *  @return false: it still runs, as a disk does not answer, and all that it uses has to stay */
bool worker_close(worker_t *self, unsigned most_ms);

#endif

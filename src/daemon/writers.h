/* SPDX-License-Identifier: MIT
 * writers.h - whatever a live run writes, each behind a thread of its own: recording, trace, metrics, log. What is written comes
 * through bounded hand-overs; where a disk or a reader does not take it in time it is lost and counted, and nobody waits.
 */
#ifndef HEAVE_DAEMON_WRITERS_H
#define HEAVE_DAEMON_WRITERS_H

#include "common/output_file.h"
#include "common/worker.h"
#include "daemon/motion_loop.h"
#include "daemon/options.h"
#include "linux_log.h"
#include "record/record.h"
#include "service/metrics.h"
#include "service/status_json.h"

/** What a configuration is recognised by, as a hand-over takes it. */
typedef union {
    char text[CONFIG_HASH_MAX];
    uint64_t word[(CONFIG_HASH_MAX + 7u) / 8u];
} writers_hash_t;

/** A recording or a trace. */
typedef struct {
    output_file_t file; /**< its thread's, until that has ended */
    const char *path;
    uint32_t thrown; /**< atomic: lines that came after its error */
    int error;       /**< atomic: errno of the write that ended it, 0 = none */
    bool is_logged;  /**< that lines are lost; the service thread's, as the next one */
    bool is_error_logged;
} writers_file_t;

/** The writers; large: from the heap, at the start. Private to writers.c but for the log. */
typedef struct {
    motion_loop_t *loop;
    const options_t *options;
    const config_t *config;
    linux_log_t log;  /**< of the motion thread */
    linux_log_t said; /**< of the service thread */
    record_writer_t lines;
    writers_file_t record;
    writers_file_t trace;
    bool is_log_broken; /**< its end could not be written; of the thread of the log, until that has ended */
    metrics_t metrics;
    seqlock_t hash; /**< of the configuration in force, to the metrics */
    writers_hash_t hash_words;
    motion_view_words_t view; /**< for the metrics */
    worker_t record_worker;
    worker_t trace_worker;
    worker_t metrics_worker;
    worker_t log_worker;
} writers_t;

/** Opens the files, and tells the loop what to hand over. Says what is wrong.
 *  @param options, config, loop kept
 *  @return EXIT_DONE; EXIT_NO_OUTPUT */
int writers_open(writers_t *self, const options_t *options, const config_t *config, motion_loop_t *loop);

/** Starts the threads. One that cannot be started is said; what it would write is lost. */
void writers_start(writers_t *self);

/** The configuration in force is another one from now on. The service thread. */
void writers_put_hash(writers_t *self, const char *hash);

/** A line of the service thread, with what is said about as `heaved: ...`. Never waits. */
void writers_say(writers_t *self, const char *format, ...) __attribute__((format(printf, 2, 3)));

/** What has been lost so far. Any thread. */
void writers_count(writers_t *self, status_lost_t *lost);

/** Says once what can no longer be written, and that lines are lost. The service thread, again and again. */
void writers_say_losses(writers_t *self);

/** Writes what waits and closes, within seconds. Says what is missing.
 *  @param has_ended out: false where a disk does not answer: self has to stay
 *  @return EXIT_DONE; EXIT_IO */
int writers_close(writers_t *self, bool *has_ended);

#endif

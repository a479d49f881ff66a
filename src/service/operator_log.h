/* SPDX-License-Identifier: MIT
 * operator_log.h - who asked for what, and what became of it: an append-only file, a JSON object per line, rotated by size. The
 * service thread hands entries over and never waits; a thread of its own writes them, and what it has no room for is counted.
 * Nothing is allocated after the open.
 */
#ifndef HEAVE_SERVICE_OPERATOR_LOG_H
#define HEAVE_SERVICE_OPERATOR_LOG_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>
#include <time.h>

#include "common/ring.h"
#include "common/worker.h"
#include "config/config.h"
#include "heave/supervisor.h"
#include "service/access_levels.h"

#define OPERATOR_LOG_NAME       "operator.log" /* in the state directory, where no file is configured */
#define OPERATOR_LOG_BY_MAX     48u
#define OPERATOR_LOG_ASKED_MAX  96u
#define OPERATOR_LOG_ANSWER_MAX 192u
#define OPERATOR_LOG_RING_BYTES (1u << 16)
#define OPERATOR_LOG_REPEATS_S  10 /* the same again within that time is a number, not a line */

/* What is refused, or asked by somebody who may only look and changes nothing, is anybody's to ask: of each user at each level so
 * many lines at once, then one in so many seconds, and of each level one byte of so many of a file. What operators have done is
 * never pushed out by it. */
#define OPERATOR_LOG_BURST    10u
#define OPERATOR_LOG_PAUSE_S  10
#define OPERATOR_LOG_SHARES   8u
#define OPERATOR_LOG_MINOR_OF 8u

/** A request and its answer. Texts are cut to fit. */
typedef struct {
    struct timespec at; /**< wall clock */
    uint32_t uid;
    uint32_t gid;
    int32_t pid;
    level_t level;
    char by[OPERATOR_LOG_BY_MAX]; /**< whom the client says that it asks for; "" = nobody */
    char request[OPERATOR_LOG_ASKED_MAX];
    char answer[OPERATOR_LOG_ANSWER_MAX]; /**< why it was refused; "" = it was done */
    state_t before;
    state_t after;
    bool is_refused;
    uint32_t repeats;  /**< of the entry before this one, that were not written */
    uint32_t left_out; /**< other entries since the one before, that count little: not written */
} operator_entry_t;

/** How much of that may be written of a user at a level. */
typedef struct {
    uint32_t uid;
    level_t level;
    uint32_t lines; /**< now */
    int64_t at_s;   /**< when they became so many; 0: nobody's */
} operator_share_t;

/** The log; large: from the heap, at the start. Private. */
typedef struct {
    char path[CONFIG_PATH_MAX]; /**< "" = there is none */
    int fd;
    int folder;         /**< the file's directory as a place (O_PATH); -1 = none */
    uint64_t bytes;     /**< of the file */
    uint64_t bytes_max; /**< beyond that it is rotated */
    uint32_t files;     /**< older ones that are kept */
    operator_entry_t last;
    uint32_t repeats; /**< of the last one */
    struct timespec repeated_at;
    operator_share_t share[OPERATOR_LOG_SHARES];
    uint32_t left_out;                       /**< of the service thread */
    uint32_t minor_left_out;                 /**< of the writer */
    uint64_t minor_bytes[LEVEL_SERVICE + 1]; /**< of the file, as far as this process has written them */
    ring_t ring;                             /**< operator_entry_t to the writer */
    uint32_t failed;                         /**< atomic: entries that could not be written */
    int32_t error;                           /**< atomic: errno of the newest failure, 0 = the newest entry is on the disk */
    int32_t logged_error;                    /**< error that operator_log_trouble() has told of */
    worker_t worker;
    uint8_t ring_bytes[OPERATOR_LOG_RING_BYTES];
} operator_log_t;

/** Opens or creates the file; without one, configured or given by a service manager, there is none, which is no error.
 *  @return EXIT_DONE; EXIT_NO_OUTPUT: it cannot be written, which is said */
int operator_log_open(operator_log_t *self, const config_t *config);

/** Starts the writer; does nothing where there is no log.
 *  @return false: errno says why */
bool operator_log_start(operator_log_t *self);

/** Hands an entry over. Never blocks. The service thread. */
void operator_log_add(operator_log_t *self, const operator_entry_t *entry);

/** The directory of the file, for others to open it in (O_PATH); -1 = there is none. And its name there. */
int operator_log_folder(const operator_log_t *self);
const char *operator_log_name(const operator_log_t *self);

/** Entries that are lost: no room for them on the way, or the disk does not take them. Any thread. */
uint32_t operator_log_lost(const operator_log_t *self);

/** Whether writing has begun to fail, or works again, since the last call.
 *  @param error out: errno; 0 = it works again */
bool operator_log_trouble(operator_log_t *self, int *error);

/** Writes what has been handed over. What its thread does all the time; tests do it by themselves. */
void operator_log_step(operator_log_t *self);

/** Writes what waits and ends the thread, or leaves it alone where the disk takes longer than a second.
 *  @return false: it still runs, and self has to stay */
bool operator_log_close(operator_log_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * log.h - contract of the log for the motion loop: accepts a line without waiting.
 * One writer thread per hal_log_t; another thread (of the backend's owner) prints. Time stamps are the reader's business.
 */
#ifndef HEAVE_HAL_LOG_H
#define HEAVE_HAL_LOG_H

#include "heave/status.h"

/** Severity, with the numbers of syslog and journald. */
typedef enum { HAL_LOG_ERROR = 3, HAL_LOG_WARNING = 4, HAL_LOG_NOTICE = 5, HAL_LOG_INFO = 6, HAL_LOG_DEBUG = 7 } hal_log_level_t;

/** Longest line kept, in characters; the rest of a longer one is cut off. */
#define HAL_LOG_TEXT_MAX 239u

/** Every op is mandatory. */
typedef struct {
    void (*write)(void *ctx, hal_log_level_t level, const char *text);
    uint32_t (*dropped)(void *ctx);
} hal_log_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const hal_log_ops_t *ops;
    void *ctx;
} hal_log_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool hal_log_valid(hal_log_t log)
{
    return log.ops != NULL && log.ops->write != NULL && log.ops->dropped != NULL;
}

/** Writes one line. Never blocks (<= 5 us). If the backend has no room, it drops the line and counts it; earlier lines are kept.
 *  @param text without newline; copied before the return. Bytes outside printable ASCII become '?': text may come from a
 *          sender. */
static inline void hal_log_write(hal_log_t log, hal_log_level_t level, const char *text)
{
    log.ops->write(log.ctx, level, text);
}

/** Lines dropped since the open. Any thread. Never blocks. */
static inline uint32_t hal_log_dropped(hal_log_t log)
{
    return log.ops->dropped(log.ctx);
}

/** For backends: copies text as write() promises.
 *  @param to HAL_LOG_TEXT_MAX + 1 bytes
 *  @return length without NUL */
static inline size_t hal_log_copy(char *to, const char *text)
{
    size_t length = 0;
    for (; length < HAL_LOG_TEXT_MAX && text[length] != '\0'; length++) {
        to[length] = (char)(text[length] >= ' ' && text[length] <= '~' ? text[length] : '?');
    }
    to[length] = '\0';
    return length;
}

#endif

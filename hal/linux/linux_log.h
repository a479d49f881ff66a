/* SPDX-License-Identifier: MIT
 * linux_log.h - log of one writer thread: lines pass through a bounded lock-free ring and another thread prints them.
 * The caller owns linux_log_t (about 64 KiB, no allocation). A writer never makes a system call; a blocked terminal or pipe stops
 * only the printing thread. One instance per writing thread.
 */
#ifndef LINUX_LOG_H
#define LINUX_LOG_H

#include "heave/hal/log.h"

/** Lines that wait at most; a power of two. */
#define LINUX_LOG_LINES 256u

/** One line; private. */
typedef struct {
    uint8_t level;
    char text[HAL_LOG_TEXT_MAX + 1];
} linux_log_line_t;

/** A log; private. */
typedef struct {
    linux_log_line_t line[LINUX_LOG_LINES];
    uint32_t written;  /**< lines put in so far; only the writer stores it */
    uint32_t printed;  /**< lines taken out so far; only the printer stores it */
    uint32_t dropped;  /**< only the writer stores it */
    uint32_t reported; /**< of dropped, those a printed line has told of; the printer's, as everything below */
    int fd;
    bool has_prefix;
    char out[HAL_LOG_TEXT_MAX + 8];
    size_t out_length;
    size_t out_done;
} linux_log_t;

/** Starts empty.
 *  @param fd where to print, usually 2; stays the caller's. Lines get journald's `<n>` prefix where it is not a terminal. */
void linux_log_init(linux_log_t *self, int fd);

/** Prints what waits, then how many lines were dropped since it last said so. From one thread, not the writer's. Blocks as
 *  long as fd does.
 *  @return HV_OK: nothing waits; HV_ERR_AGAIN: a non-blocking fd takes no more now; HV_ERR_IO: fd is broken (errno says
 *          why). What is not printed yet waits for the next call. */
hv_status_t linux_log_flush(linux_log_t *self) HV_MUST_CHECK;

/** The log as hal/log.h wants it. */
hal_log_t linux_log_hal(linux_log_t *self);

#endif

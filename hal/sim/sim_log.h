/* SPDX-License-Identifier: MIT
 * sim_log.h - log in memory: the oldest lines stay, what does not fit is counted.
 * The caller owns sim_log_t; one thread.
 */
#ifndef SIM_LOG_H
#define SIM_LOG_H

#include "heave/hal/log.h"

#define SIM_LOG_LINES 64u /**< lines that wait at most */

/** One line. */
typedef struct {
    hal_log_level_t level;
    char text[HAL_LOG_TEXT_MAX + 1];
} sim_log_line_t;

/** A log. */
typedef struct {
    sim_log_line_t line[SIM_LOG_LINES];
    uint32_t first;
    uint32_t count;
    uint32_t dropped;
} sim_log_t;

/** Starts empty. */
void sim_log_init(sim_log_t *self);

/** Takes the oldest line.
 *  @return the line, valid until SIM_LOG_LINES more were written; NULL: none */
const sim_log_line_t *sim_log_pop(sim_log_t *self);

/** The log as hal/log.h wants it. */
hal_log_t sim_log_hal(sim_log_t *self);

#endif

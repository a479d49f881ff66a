/* SPDX-License-Identifier: MIT
 * guard.h - checks each set-point before it is sent to a drive. A set-point that jumps, or that is too far from the actual
 * position, becomes a fault and is not sent. Shared by the bus drivers. Pure.
 */
#ifndef HEAVE_GUARD_H
#define HEAVE_GUARD_H

#include "heave/drives.h"

/** References of the check. */
typedef struct {
    q32_t from_q32;     /**< previous set-point, or the actual position if there is none */
    q32_t step_max_q32; /**< largest distance from from_q32; INT64_MAX: no limit */
    q32_t actual_q32;   /**< actual position */
    q32_t window_q32;   /**< largest distance from the actual position; 0: no limit */
} guard_limits_t;

/** Checks a set-point. Of two errors the jump is returned. */
drive_guard_t guard_judge(q32_t setpoint_q32, const guard_limits_t *limits);

/** The result for a set-point that the drive's counts cannot express: a jump from the actual position. */
drive_guard_t guard_out_of_counts(q32_t setpoint_q32, const guard_limits_t *limits);

/** The error in words: constant text. */
const char *guard_text(const drive_guard_t *guard);

#endif

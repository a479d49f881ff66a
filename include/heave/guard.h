/* SPDX-License-Identifier: MIT
 * guard.h - the last look at a set-point before it goes to a drive: one that jumps, or that is too far from where the drive is,
 * becomes a fault instead of a frame. Shared by the drivers of buses. Pure.
 */
#ifndef HEAVE_GUARD_H
#define HEAVE_GUARD_H

#include "heave/drives.h"

/** What a set-point may be measured against. */
typedef struct {
    q32_t from_q32;     /**< the set-point before; actual where there is none */
    q32_t step_max_q32; /**< from it; INT64_MAX: any */
    q32_t actual_q32;   /**< where the drive is */
    q32_t window_q32;   /**< from there; 0: any */
} guard_limits_t;

/** Judges a set-point; of two errors the jump is told. */
drive_guard_t guard_judge(q32_t setpoint_q32, const guard_limits_t *limits);

/** One that the drive's counts cannot express: a jump from where it is. */
drive_guard_t guard_out_of_counts(q32_t setpoint_q32, const guard_limits_t *limits);

/** What it is, in words: constant text. */
const char *guard_text(const drive_guard_t *guard);

#endif

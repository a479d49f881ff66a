/* SPDX-License-Identifier: MIT
 * drive_run.h - what the fuzz targets of drivers share: records of twelve bytes, and drives that are polled, sent to and asked.
 */
#ifndef DRIVE_RUN_H
#define DRIVE_RUN_H

#include "fuzz.h"
#include "heave/drives.h"

/** One record of an input; what its numbers mean is the target's. */
typedef struct {
    uint8_t op, kind;
    uint8_t drive;  /**< [0, DRIVES_MAX) */
    uint8_t length; /**< [0, 8] */
    uint8_t data[8];
} record_t;

/** The next record; bytes behind the end count as 0. */
record_t record_read(fuzz_input_t *in);

/** Drives at work, as the motion sees them. */
typedef struct {
    drives_t drives;
    uint64_t now_us;
    drive_feedback_t feedback[DRIVES_MAX]; /**< of the last poll */
    q32_t setpoint_q32[DRIVES_MAX];
} drive_run_t;

/** True where the last poll found all drives in a state. */
bool drive_run_are_all(const drive_run_t *self, drive_state_t state);

/** Set-points where the drives are. */
void drive_run_follow_actual(drive_run_t *self);

/** Cycles at actual until all drives are in a state, which must come within ten seconds of 1 ms cycles.
 *  @param cycle one cycle of the world that this run is part of */
void drive_run_await(drive_run_t *self, drive_state_t state, void (*cycle)(void *world), void *world);

/** A request, and set-points at actual, as the record wants. What stops drives shows in feedback at once.
 *  @return HV_OK: it was taken */
hv_status_t drive_run_ask(drive_run_t *self, const record_t *record);

/** Moves a set-point as the record wants. */
void drive_run_move(drive_run_t *self, const record_t *record);

/** What a position is in counts, rounded down; at most 2^60 of them.
 *  @param per_3_mm counts
 *  @param zero     counts at 0 mm */
int64_t drive_run_counts(q32_t mm_q32, int64_t per_3_mm, int64_t zero);

/** True where a set-point is further from another value than a limit. */
bool drive_run_is_beyond(q32_t a_q32, q32_t b_q32, q32_t limit_q32);

#endif

/* SPDX-License-Identifier: MIT
 * trace.h - the rows of a trace: what was sent in a cycle, as a plain record and as a line of CSV.
 * Pure. The motion thread takes rows, another thread writes them; an offline run does both.
 */
#ifndef HEAVE_RECORD_TRACE_H
#define HEAVE_RECORD_TRACE_H

#include "heave/telemetry.h"

/** Numbers of a row: the pose sent, the rotation motor, six cylinders. */
#define TRACE_VALUES (POSE_AXES + 1 + CYLINDERS_MAX)

/** Bytes that hold every header and every row. */
#define TRACE_LINE_MAX 512u

/** One cycle. */
typedef struct {
    uint64_t t_us; /**< since time zero; before it, since the start */
    q32_t value_q32[TRACE_VALUES];
    uint16_t relay_mask;
    uint16_t flags; /**< MOTION_* in the low byte, then those private to trace.c */
    uint8_t state;
} trace_row_t;

/** Takes what the trace needs of a cycle.
 *  @param is_late        cycles were skipped before this one
 *  @param is_before_zero time zero has not come yet: t_us is since the start */
void trace_fill(trace_row_t *self, const snapshot_t *snapshot, uint64_t t_us, bool is_late, bool is_before_zero);

/** The header line, with its newline.
 *  @return bytes written, without NUL */
size_t trace_header(char to[TRACE_LINE_MAX]);

/** A row, likewise. */
size_t trace_format(const trace_row_t *self, char to[TRACE_LINE_MAX]);

#endif

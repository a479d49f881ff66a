/* SPDX-License-Identifier: MIT
 * session.h - a gateway and its time line, the same for live and offline runs: cycles are counted, not measured.
 * Logical time is the number of executed cycles times cycle_us; time zero is the cycle that first shows SETTLED. One thread.
 */
#ifndef HEAVE_RECORD_SESSION_H
#define HEAVE_RECORD_SESSION_H

#include "heave/gateway.h"
#include "record/trace.h"

/** A running gateway. */
typedef struct {
    gateway_t gateway;
    settings_t settings; /**< in force */
    uint64_t now_us;     /**< of the coming cycle; the first one is at cycle_us, because 0 means "never" to the gateway */
    bool has_zero;
    uint64_t zero_us;
    uint32_t late_cycles; /**< counted up to the last row */
} session_t;

/** @return as gateway_init */
hv_status_t session_init(session_t *self, const settings_t *settings, const gateway_io_t *io) HV_MUST_CHECK;

/** As gateway_reload(); copied. */
void session_reload(session_t *self, const settings_t *settings);

/** As gateway_resume(), with the settings that were in force. */
void session_resume(session_t *self, const session_t *saved);

/** One cycle.
 *  @return true where it is time zero */
bool session_cycle(session_t *self);

/** The row of the last cycle. Once per cycle, from the first one that is wanted on. */
void session_row(session_t *self, trace_row_t *out);

#endif

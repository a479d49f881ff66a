/* SPDX-License-Identifier: MIT
 * motion_notes.c - see motion_notes.h.
 */
#include "daemon/motion_notes.h"

#include <string.h>

static void note_at(motion_loop_t *self, record_kind_t kind, uint64_t t_us, uint32_t value)
{
    if (self->is_recording) {
        record_push(&self->handover.record, kind, t_us, value);
    }
    if (self->blackbox != NULL) {
        blackbox_note(self->blackbox, kind, t_us, value);
    }
}

void motion_note(motion_loop_t *self, record_kind_t kind, uint32_t value)
{
    note_at(self, kind, self->session.now_us, value);
}

void motion_note_service(motion_loop_t *self, const service_request_t *service)
{
    if (self->is_recording) {
        record_push_service(&self->handover.record, self->session.now_us, service);
    }
    if (self->blackbox != NULL) {
        record_push_service(&self->blackbox->records, self->session.now_us, service);
    }
}

static void note_faults(motion_loop_t *self, const snapshot_t *snapshot)
{
    if (self->is_recording) {
        record_push_faults(&self->handover.record, snapshot);
    }
    if (self->blackbox != NULL) {
        record_push_faults(&self->blackbox->records, snapshot);
    }
}

static void note_drives(motion_loop_t *self, const snapshot_t *snapshot)
{
    if (self->is_recording) {
        record_push_drives(&self->handover.record, snapshot->now_us, self->was_drive, snapshot->drive);
    }
    if (self->blackbox != NULL) {
        record_push_drives(&self->blackbox->records, snapshot->now_us, self->was_drive, snapshot->drive);
    }
    memcpy(self->was_drive, snapshot->drive, sizeof self->was_drive);
}

static void write_row(motion_loop_t *self)
{
    trace_row_t row;
    session_row(&self->session, &row);
    if (self->is_tracing) {
        (void)ring_push(&self->handover.trace, &row, sizeof row, NULL, 0);
    }
    if (self->blackbox != NULL) {
        blackbox_cycle(self->blackbox, &self->session, &row);
    }
}

static bool is_heard(const snapshot_t *snapshot)
{
    bool is_any = snapshot->state == STATE_SETTLED;
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        is_any = is_any || snapshot->drive[i].has_actual;
    }
    return is_any;
}

void motion_write_down(motion_loop_t *self, bool is_zero)
{
    const snapshot_t *snapshot = gateway_snapshot(&self->session.gateway);
    if (snapshot->is_estop_active != self->was_estop) {
        note_at(self, RECORD_ESTOP, snapshot->now_us, snapshot->is_estop_active);
    }
    self->was_estop = snapshot->is_estop_active;
    note_drives(self, snapshot);
    note_faults(self, snapshot);
    if (is_zero) {
        note_at(self, RECORD_ZERO, snapshot->now_us,
                record_zero(snapshot->goal, snapshot->intensity_percent, self->rise_percent));
    }
    self->has_feedback = self->has_feedback || is_heard(snapshot);
    if (self->has_feedback) {
        write_row(self);
    }
}

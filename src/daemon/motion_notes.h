/* SPDX-License-Identifier: MIT
 * motion_notes.h - what the motion thread writes down of its cycles: into the recording, the trace and the black box, each only
 * where there is one. Nothing waits: what does not fit is dropped and counted.
 */
#ifndef HEAVE_DAEMON_MOTION_NOTES_H
#define HEAVE_DAEMON_MOTION_NOTES_H

#include "daemon/motion_loop.h"
#include "record/record.h"

/** What comes from outside, before the cycle that takes it. */
void motion_note(motion_loop_t *self, record_kind_t kind, uint32_t value);
void motion_note_service(motion_loop_t *self, const service_request_t *service);

/** What a recording and a trace need of the cycle that has just run. */
void motion_write_down(motion_loop_t *self, bool is_zero);

#endif

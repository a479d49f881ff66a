/* SPDX-License-Identifier: MIT
 * handover.c - hand-overs between the motion thread and the others; see handover.h.
 */
#include "service/handover.h"

void handover_init(handover_t *self)
{
    seqlock_init(&self->view, self->view_word, MOTION_VIEW_WORDS);
    ring_init(&self->requests, self->request_bytes, sizeof self->request_bytes);
    ring_init(&self->reloads, self->reload_bytes, sizeof self->reload_bytes);
    ring_init(&self->results, self->result_bytes, sizeof self->result_bytes);
    ring_init(&self->record, self->record_bytes, sizeof self->record_bytes);
    ring_init(&self->trace, self->trace_bytes, sizeof self->trace_bytes);
}

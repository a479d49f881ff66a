/* SPDX-License-Identifier: MIT
 * motion_objects.c - see motion_objects.h.
 */
#include "daemon/motion_objects.h"

void motion_objects_accept(motion_loop_t *self, const motion_request_t *request, motion_result_t *result)
{
    result->status = HV_OK;
    result->object = request->object;
    result->object_state = DRIVE_OBJECT_NONE;
    result->object_code = 0;
    result->answer = gateway_object_begin(&self->session.gateway, request->number, &request->object);
    result->is_later = result->answer == SERVICE_DONE;
    if (result->is_later) {
        self->object_id = request->id;
        self->object = request->object;
    }
}

/* Apart, so that a cycle without one does not clear a place for it. */
static __attribute__((noinline)) void look(motion_loop_t *self)
{
    motion_result_t result = {.id = self->object_id, .status = HV_OK, .answer = SERVICE_DONE, .object = self->object};
    result.object_state = gateway_object_end(&self->session.gateway, &result.object, &result.object_code);
    if (result.object_state != DRIVE_OBJECT_BUSY) {
        self->object_id = 0;
        result.snapshot = *gateway_snapshot(&self->session.gateway);
        (void)ring_push(&self->handover.results, &result, sizeof result, NULL, 0);
    }
}

void motion_objects_step(motion_loop_t *self)
{
    if (self->object_id != 0) {
        look(self);
    }
}

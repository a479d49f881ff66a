/* SPDX-License-Identifier: MIT
 * service_object.c - what a person reads from drives and sets in them, beside the motion; see heave/gateway.h.
 */
#include "service.h"

/* Where no set-point is followed, and nobody waits for the platform: an error of a drive is read in FAULT. */
static bool is_readable_in(state_t state)
{
    return state == STATE_OFF || state == STATE_SERVICE || state == STATE_FAULT || state == STATE_ESTOP;
}

static service_answer_t answer_of(hv_status_t status)
{
    return status == HV_OK          ? SERVICE_DONE
           : status == HV_ERR_NOSUP ? SERVICE_NO_OBJECTS
           : status == HV_ERR_STATE ? SERVICE_ABSENT
           : status == HV_ERR_ARG   ? SERVICE_RELIED_ON
                                    : SERVICE_NOT_TAKEN;
}

service_answer_t gateway_object_begin(gateway_t *self, unsigned drive, const drive_object_t *object)
{
    const state_t state = self->sequencer.supervisor.state;
    if (object->is_write && state != STATE_SERVICE) {
        return SERVICE_NOT_SERVING;
    }
    if (!is_readable_in(state)) {
        return SERVICE_MOVING;
    }
    if (drive < 1 || drive > drives_count(self->io.drives)) {
        return SERVICE_NO_SUCH;
    }
    if (object->is_write && (self->sequencer.service.doing != SERVICE_NOTHING || !motion_is_at_rest(&self->motion))) {
        return SERVICE_BUSY;
    }
    return answer_of(drives_object_begin(self->io.drives, (uint8_t)(drive - 1u), object));
}

drive_object_state_t gateway_object_end(gateway_t *self, drive_object_t *out, uint32_t *code)
{
    return drives_object_end(self->io.drives, out, code);
}

/* SPDX-License-Identifier: MIT
 * operator.c - requests of an operator; see operator.h.
 */
#include "operator.h"

#include <string.h>

#include "heave/text.h"

const event_t operator_requests[OPERATOR_REQUESTS] = {EVENT_ENGAGE, EVENT_HOLD,  EVENT_RESUME,
                                                      EVENT_PARK,   EVENT_RESET, EVENT_SHUTDOWN};

/* What each state takes, shutdown aside. */
static const char *const k_possible[STATES] = {
    [STATE_OFF] = "engage, park",
    [STATE_HOMING] = "hold, engage, park",
    [STATE_SETTLED] = "engage",
    [STATE_RISING] = "hold, engage, park",
    [STATE_NEUTRAL] = "engage, hold, park",
    [STATE_ENGAGED] = "hold, park",
    [STATE_HOLD] = "resume, engage, park",
    [STATE_SETTLING] = "hold, engage",
    [STATE_FAULT] = "reset, once the cause is gone",
    [STATE_ESTOP] = "reset, once the e-stop is released",
};

event_t operator_request_find(const char *name)
{
    for (unsigned i = 0; i < OPERATOR_REQUESTS; i++) {
        if (strcmp(event_name(operator_requests[i]), name) == 0) {
            return operator_requests[i];
        }
    }
    return EVENTS;
}

/* What of a request does not fit the state. */
static const char *reason(event_t request, const snapshot_t *s)
{
    if (request == EVENT_RESET) {
        const bool is_latched = s->state == STATE_FAULT || s->state == STATE_ESTOP;
        return !is_latched          ? "there is nothing to reset"
               : s->is_estop_active ? "the e-stop is still active"
                                    : "the cause is still there";
    }
    return request == EVENT_RESUME ? "there is nothing to resume" : "this is not possible";
}

size_t operator_explain(event_t request, const snapshot_t *snapshot, bool is_shutting_down, char *text, size_t capacity)
{
    text_t out = text_start(text, capacity);
    text_put(&out, event_name(request));
    text_put(&out, ": ");
    if (is_shutting_down && request != EVENT_RESET) {
        text_put(&out, "a shutdown is under way; start heaved again once it has ended");
        return out.length;
    }
    text_put(&out, reason(request, snapshot));
    text_put(&out, " in ");
    text_put(&out, state_name(snapshot->state));
    if (snapshot->state == STATE_FAULT) {
        text_put(&out, " (");
        text_put(&out, fault_text(snapshot->fault.code));
        text_put(&out, ")");
    }
    text_put(&out, "; possible: ");
    text_put(&out, k_possible[snapshot->state]);
    return out.length;
}

/* SPDX-License-Identifier: MIT
 * operator_requests.c - requests of an operator; see operator_requests.h.
 */
#include "service/operator_requests.h"

#include <stdio.h>
#include <string.h>

#include "common/translate.h"

#define TICK_DIGITS_MAX 18u

const event_t operator_requests[OPERATOR_REQUESTS] = {EVENT_ENGAGE, EVENT_HOLD,     EVENT_RESUME,  EVENT_PARK,
                                                      EVENT_RESET,  EVENT_SHUTDOWN, EVENT_SERVICE, EVENT_SERVICE_OFF};

/* What each state takes, shutdown aside. */
static const char *const k_possible[STATES] = {
    [STATE_OFF] = "engage, park, service",
    [STATE_HOMING] = "hold, engage, park",
    [STATE_SETTLED] = "engage, service",
    [STATE_RISING] = "hold, engage, park",
    [STATE_NEUTRAL] = "engage, hold, park",
    [STATE_ENGAGED] = "hold, park",
    [STATE_HOLD] = "resume, engage, park",
    [STATE_SETTLING] = "hold, engage",
    [STATE_SERVICE] = "torque, jog, home, relay, hold, service-off",
    [STATE_FAULT] = N_("reset, once the cause is gone"),
    [STATE_ESTOP] = N_("reset, once the e-stop is released"),
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

const char *operator_request_behind_heard(const char *line, bool *has_heard, uint64_t *tick_us)
{
    static const char k_heard[] = "heard ";
    line += strspn(line, " ");
    *tick_us = 0;
    *has_heard = strncmp(line, k_heard, strlen(k_heard)) == 0;
    if (!*has_heard) {
        return line;
    }
    line += strlen(k_heard);
    const size_t digits = strspn(line, "0123456789");
    if (digits == 0 || digits > TICK_DIGITS_MAX || line[digits] != ' ') {
        return NULL;
    }
    for (size_t i = 0; i < digits; i++) {
        *tick_us = *tick_us * 10u + (uint64_t)(line[i] - '0');
    }
    line += digits;
    return line + strspn(line, " ");
}

bool operator_read_percent(const char *text, uint32_t *percent)
{
    *percent = 0;
    const size_t length = strlen(text);
    for (size_t i = 0; i < length; i++) {
        *percent = *percent * 10 + (uint32_t)(uint8_t)(text[i] - '0');
    }
    return length > 0 && length <= 3 && strspn(text, "0123456789") == length;
}

size_t operator_explain_percent(uint32_t percent, unsigned max_percent, char *text, size_t capacity)
{
    const int length =
        snprintf(text, capacity, N_("intensity %u: too much for this platform; possible: 0 to %u %% ([intensity] max_percent)"),
                 (unsigned)percent, max_percent);
    return length < 0 ? 0 : (size_t)length < capacity ? (size_t)length : capacity - 1u;
}

/* A drive that would be a fault as soon as the state is one in which drives are watched. */
static bool is_drive_amiss(const snapshot_t *s)
{
    for (unsigned i = 0; i < s->cylinders + (s->has_angle ? 1u : 0u); i++) {
        if (s->drive[i].state == DRIVE_FAULT || s->drive[i].state == DRIVE_OFFLINE) {
            return true;
        }
    }
    return false;
}

/* What of a request does not fit the state. */
static const char *reason(event_t request, const snapshot_t *s)
{
    if (request == EVENT_RESET) {
        const bool is_latched = s->state == STATE_FAULT || s->state == STATE_ESTOP;
        return !is_latched ? N_("there is nothing to reset")
               : s->fault.code == FAULT_ESTOP_CHANNELS && s->is_estop_active
                   ? N_("the channels of the e-stop have disagreed: press it and release it, so that both open and close")
               : s->is_estop_active ? N_("the e-stop is still active")
                                    : N_("the cause is still there");
    }
    if (request == EVENT_SERVICE && (s->state == STATE_OFF || s->state == STATE_SETTLED)) {
        return is_drive_amiss(s) ? N_("a drive does not answer yet, or is in fault (`counts` says which)")
                                 : N_("the drives are still going off: try again");
    }
    return request == EVENT_RESUME ? N_("there is nothing to resume") : N_("this is not possible");
}

/* The whole sentences, so that a translation has them as such (common/sentence.h). */
static int explain(event_t request, const snapshot_t *snapshot, bool is_shutting_down, char *text, size_t capacity)
{
    const char *asked = event_name(request);
    const char *possible = k_possible[snapshot->state];
    if (is_shutting_down && request != EVENT_RESET) {
        return snprintf(text, capacity, N_("%s: a shutdown is under way; %s"), asked,
                        snapshot->state == STATE_HOLD ? N_("shutdown goes on with it, a second signal ends at once")
                                                      : N_("start heaved again once it has ended"));
    }
    if (snapshot->state == STATE_FAULT) {
        return snprintf(text, capacity, N_("%s: %s in %s (%s); possible: %s"), asked, reason(request, snapshot),
                        state_name(snapshot->state), fault_text(snapshot->fault.code), possible);
    }
    return snprintf(text, capacity, N_("%s: %s in %s; possible: %s"), asked, reason(request, snapshot),
                    state_name(snapshot->state), possible);
}

size_t operator_explain(event_t request, const snapshot_t *snapshot, bool is_shutting_down, char *text, size_t capacity)
{
    const int length = explain(request, snapshot, is_shutting_down, text, capacity);
    return length < 0 ? 0 : (size_t)length < capacity ? (size_t)length : capacity - 1u;
}

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

static size_t fitted(int length, size_t capacity)
{
    return length < 0 ? 0 : (size_t)length < capacity ? (size_t)length : capacity - 1u;
}

size_t operator_explain_percent(uint32_t percent, unsigned max_percent, char *text, size_t capacity)
{
    const int length =
        snprintf(text, capacity, N_("intensity %u: too much for this platform; possible: 0 to %u %% ([intensity] max_percent)"),
                 (unsigned)percent, max_percent);
    return fitted(length, capacity);
}

/* Numbers from 1, as in "3, 4, 6". */
static void list_drives(uint32_t drives, char *text, size_t capacity)
{
    size_t length = 0;
    text[0] = '\0';
    for (unsigned i = 0; i < DRIVES_MAX && length < capacity; i++) {
        if ((drives >> i & 1u) != 0) {
            length += (size_t)snprintf(&text[length], capacity - length, "%s%u", length > 0 ? ", " : "", i + 1u);
        }
    }
}

/* What the first of some drives is at, in its driver's words, if it has any; and what leads out.
 * Returns its index. */
static unsigned describe_first(const snapshot_t *s, uint32_t drives, char *text, size_t capacity)
{
    unsigned first = 0;
    while (first + 1u < DRIVES_MAX && (drives >> first & 1u) == 0) {
        first++;
    }
    const drive_report_t *report = &s->report[first];
    const bool has_phase = report->phase != NULL && report->phase[0] != '\0';
    const bool has_trouble = has_phase && report->code != 0;
    const char *without_words = s->drive[first].state == DRIVE_FAULT ? N_("it is in fault") : N_("it does not answer");
    (void)snprintf(text, capacity, "%s%s%s%s", has_phase ? report->phase : without_words, has_trouble ? ": " : "",
                   has_trouble ? report->trouble : "",
                   s->drive[first].state == DRIVE_FAULT ? N_("; `reset` leads out of it") : "");
    return first;
}

/* The whole sentences, so that a translation has them as such (common/sentence.h). */
static int explain_drives(event_t request, const snapshot_t *s, uint32_t drives, const char *bus_trouble, char *text,
                          size_t capacity)
{
    char all[4 * DRIVES_MAX], at[160];
    const char *asked = event_name(request);
    const unsigned first = describe_first(s, drives, at, sizeof at) + 1u;
    const bool is_one = (drives & (drives - 1u)) == 0;
    list_drives(drives, all, sizeof all);
    return bus_trouble[0] != '\0' ? snprintf(text, capacity, N_("%s: the drives cannot be reached: %s"), asked, bus_trouble)
           : is_one               ? snprintf(text, capacity, N_("%s: drive %u is not ready: %s"), asked, first, at)
                    : snprintf(text, capacity, N_("%s: drives %s are not ready; drive %u: %s"), asked, all, first, at);
}

size_t operator_explain_absent(event_t request, const snapshot_t *snapshot, uint32_t absent, const char *bus_trouble, char *text,
                               size_t capacity)
{
    return fitted(explain_drives(request, snapshot, absent, bus_trouble, text, capacity), capacity);
}

/* Drives that would be a fault as soon as the state is one in which drives are watched. */
static uint32_t drives_amiss(const snapshot_t *s)
{
    uint32_t drives = 0;
    for (unsigned i = 0; i < s->cylinders + (s->has_angle ? 1u : 0u); i++) {
        drives |= s->drive[i].state == DRIVE_FAULT || s->drive[i].state == DRIVE_OFFLINE ? 1u << i : 0u;
    }
    return drives;
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
        return N_("the drives are still going off: try again");
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
    if (request == EVENT_SERVICE && (snapshot->state == STATE_OFF || snapshot->state == STATE_SETTLED) &&
        drives_amiss(snapshot) != 0) {
        return explain_drives(request, snapshot, drives_amiss(snapshot), "", text, capacity);
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
    return fitted(length, capacity);
}

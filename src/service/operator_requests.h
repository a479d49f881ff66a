/* SPDX-License-Identifier: MIT
 * operator_requests.h - what an operator can ask for: names of requests, and why one was refused. Pure.
 */
#ifndef HEAVE_SERVICE_REQUESTS_H
#define HEAVE_SERVICE_REQUESTS_H

#include "heave/telemetry.h"

/** Requests that travel to the motion thread. */
#define OPERATOR_REQUESTS 8u
extern const event_t operator_requests[OPERATOR_REQUESTS];

/** In the place of an event: a request with a percentage. */
#define OPERATOR_INTENSITY EVENTS

/** Likewise: a request of SERVICE (heave/service.h). */
#define OPERATOR_SERVICE ((event_t)(EVENTS + 1))
/** Likewise: an object of a drive. */
#define OPERATOR_OBJECT ((event_t)(EVENTS + 2))

/** Reads what follows `intensity `.
 *  @return false where it is no whole number of at most three digits */
bool operator_read_percent(const char *text, uint32_t *percent);

/** Why a percentage was refused, and what would be possible.
 *  @return length without NUL; cut to fit */
size_t operator_explain_percent(uint32_t percent, unsigned max_percent, char *text, size_t capacity);

/** @return EVENTS where the name is no request */
event_t operator_request_find(const char *name);

/** The request behind `heard TICK`, and behind leading blanks.
 *  @param tick_us out: that tick; without the words 0
 *  @param has_heard out: whether it has these words
 *  @return within line; NULL: `heard` without a tick or a request */
const char *operator_request_behind_heard(const char *line, bool *has_heard, uint64_t *tick_us);

/** Why a request was refused for want of drives: which, and what the first of them is at.
 *  @param absent bit k for axis k; not 0
 *  @param bus_trouble why none of them can be reached; "": no such reason is known
 *  @return length without NUL; cut to fit */
size_t operator_explain_absent(event_t request, const snapshot_t *snapshot, uint32_t absent, const char *bus_trouble, char *text,
                               size_t capacity);

/** Why a request was refused, and what would be possible.
 *  @param is_shutting_down a shutdown was asked for
 *  @return length without NUL; cut to fit */
size_t operator_explain(event_t request, const snapshot_t *snapshot, bool is_shutting_down, char *text, size_t capacity);

#endif

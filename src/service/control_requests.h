/* SPDX-License-Identifier: MIT
 * control_requests.h - the requests of clients: reads lines, judges them, hands them to the motion thread or the black box, and
 * answers when the result is there. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_REQUESTS_H
#define HEAVE_SERVICE_CONTROL_REQUESTS_H

#include "service/control.h"

/** True if the client's bytes are read now. */
bool control_requests_is_reading(const control_client_t *client);

/** Reads bytes of the client and takes the complete lines. */
void control_requests_receive(control_t *self, control_client_t *client, uint64_t now_us);

/** A hold came: what clients have asked before it and has not begun is void.
 *  @param by who held: all that it asked before has begun; NULL: heaved itself */
void control_requests_void(control_t *self, const control_client_t *by, uint64_t now_us);

/** Its client has gone, or reads no answers: what it has asked that only makes the machine safer is still carried out, without an
 *  answer to the one before it. Closes the connection. */
void control_requests_end(control_t *self, control_client_t *client, uint64_t now_us);

/** Answers that are due by now: results, timeouts, and the next status of a client that watches. */
void control_requests_serve_time(control_t *self, control_client_t *client, uint64_t now_us);

#endif

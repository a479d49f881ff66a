/* SPDX-License-Identifier: MIT
 * control_client.h - one client of the control socket: the answers to it, sending them, and its end. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_CLIENT_H
#define HEAVE_SERVICE_CONTROL_CLIENT_H

#include "common/json.h"
#include "service/control.h"

#define CONTROL_DUMP_LATER "dump: the disk has not taken it yet; heaved goes on trying"

/** What the newest view shows. */
const snapshot_t *control_snapshot(const control_t *self);

/** Closes the connection. A request that is still open is logged without an answer. */
void control_client_drop(control_client_t *client);

/** Reads what its socket has behind what it has sent already, and a descriptor that comes with it. As recv(). */
ssize_t control_client_receive(control_client_t *client);

/** Closes that descriptor; harmless where there is none. */
void control_client_forget_received(control_client_t *client);

/** Sends what the socket takes now. */
void control_client_send(control_client_t *client);

/** Begins an answer behind those that still wait. */
json_t control_client_start_answer(control_client_t *client);

/** Queues a complete answer. A client that has not read the last ones is given up (is_gone): it would get half an answer. */
void control_client_answer(control_client_t *client, json_t *json);

/** Writes the answer to a request into the operator log, once. */
void control_client_log(control_client_t *client, const char *error, state_t after);

/** The same where its client has gone. */
void control_client_log_gone(control_client_t *client);

/** True while the motion thread or the black box still owes an answer. */
bool control_client_is_waiting(const control_client_t *client);

void control_client_answer_done(control_client_t *client, const snapshot_t *snapshot);
void control_client_answer_service(control_client_t *client, const motion_result_t *result);
void control_client_answer_error(control_client_t *client, const char *error, const char *state);

/** Drives are not there yet. */
void control_client_answer_not_ready(control_client_t *client, const char *error, const snapshot_t *snapshot);

/** Its request came too late to be done. */
void control_client_answer_stale(control_client_t *client);

/** Its request was asked before a hold that came since. */
void control_client_answer_void(control_client_t *client);

/** All that has come from it so far came before a hold. */
void control_client_void(control_client_t *client);

/** True: nobody is there any more who could read an answer. A client that has only closed its sending side is there. */
bool control_client_has_gone(const control_client_t *client);

void control_client_answer_status(control_t *self, control_client_t *client);
void control_client_answer_dumped(control_client_t *client, const char *folder);

#endif

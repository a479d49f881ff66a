/* SPDX-License-Identifier: MIT
 * control_object.h - requests for objects of drives: `sdo N INDEX:SUB [[TYPE] VALUE]`. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_OBJECT_H
#define HEAVE_SERVICE_CONTROL_OBJECT_H

#include "service/control_client.h"

/** Reads a request; of a client whose object it becomes.
 *  @return NULL; or what is wrong: then nothing is asked of the motion thread. Valid until the next call of the client */
const char *control_object_read(control_client_t *client, const char *line, motion_request_t *out);

/** Answers with what has come of it. */
void control_object_answer(control_client_t *client, const motion_result_t *result);

#endif

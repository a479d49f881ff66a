/* SPDX-License-Identifier: MIT
 * motion_objects.h - requests for objects of drives: the motion thread owns the bus, begins them, and hands over what has come
 * some cycles later. One at a time.
 */
#ifndef HEAVE_DAEMON_MOTION_OBJECTS_H
#define HEAVE_DAEMON_MOTION_OBJECTS_H

#include "daemon/motion_loop.h"

/** Takes a request. Where it was begun, its result is later. */
void motion_objects_accept(motion_loop_t *self, const motion_request_t *request, motion_result_t *result);

/** Once per cycle: hands over the result of what has ended. */
void motion_objects_step(motion_loop_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * control_results.h - what becomes of requests of clients: answers when the motion thread or the black box has a result, or has
 * none in time. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_RESULTS_H
#define HEAVE_SERVICE_CONTROL_RESULTS_H

#include "service/control.h"

/** Takes the motion thread's results. */
void control_results_pop(control_t *self);

/** A request whose answer comes with time: a reset that took effect, or one that never got its answer. */
void control_results_watch_request(control_t *self, control_client_t *client, uint64_t now_us);

/** A dump that is on the disk, or was not in time. */
void control_results_watch_dump(control_t *self, control_client_t *client, uint64_t now_us);

#endif

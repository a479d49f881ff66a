/* SPDX-License-Identifier: MIT
 * control_times.h - how long things took, as histograms, for programs that draw them. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_TIMES_H
#define HEAVE_SERVICE_CONTROL_TIMES_H

#include "service/control.h"

/** The answer to `times`: docs/control-socket.md. */
void control_times_answer(const control_t *self, control_client_t *client);

#endif

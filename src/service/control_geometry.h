/* SPDX-License-Identifier: MIT
 * control_geometry.h - the mechanism and its limits, for programs that draw it. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_GEOMETRY_H
#define HEAVE_SERVICE_CONTROL_GEOMETRY_H

#include "service/control.h"

/** The answer to `geometry`: docs/control-socket.md. */
void control_geometry_answer(const control_t *self, control_client_t *client);

#endif

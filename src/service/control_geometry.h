/* SPDX-License-Identifier: MIT
 * control_geometry.h - the mechanism and its limits, for programs that draw it.
 */
#ifndef HEAVE_SERVICE_CONTROL_GEOMETRY_H
#define HEAVE_SERVICE_CONTROL_GEOMETRY_H

#include "common/json.h"
#include "service/control.h"

/** The members of a geometry: docs/control-socket.md. */
void control_geometry_put(json_t *json, const settings_t *settings);

/** The answer to `geometry`. Private to control*.c. */
void control_geometry_answer(const control_t *self, control_client_t *client);

#endif

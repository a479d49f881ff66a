/* SPDX-License-Identifier: MIT
 * viewer_service.h - what pages of the role service ask for: another configuration, and what the drives do with a test signal.
 */
#ifndef HEAVE_PANEL_VIEWER_SERVICE_H
#define HEAVE_PANEL_VIEWER_SERVICE_H

#include "panel/viewer_call.h"

void viewer_configure(const call_t *call);
void viewer_identify(const call_t *call);

/** A press was answered, a tick has come, a platform has gone, time passes. */
void viewer_service_pressed(hall_t *hall, const viewer_t *viewer, unsigned at);
void viewer_service_tick(hall_t *hall, unsigned at, const char *line);
void viewer_service_gone(hall_t *hall, unsigned at);
void viewer_service_pump(hall_t *hall);

#endif

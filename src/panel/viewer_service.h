/* SPDX-License-Identifier: MIT
 * viewer_service.h - what pages of the role service ask for: another configuration, and what the drives do with a test signal.
 */
#ifndef HEAVE_PANEL_VIEWER_SERVICE_H
#define HEAVE_PANEL_VIEWER_SERVICE_H

#include "panel/viewer_call.h"

void viewer_configure(const call_t *call);
void viewer_identify(const call_t *call);

/** A press was answered, a tick has come, a platform has gone, time passes. */
void viewer_service_pressed(viewers_t *viewers, const viewer_t *viewer, unsigned at);
void viewer_service_tick(viewers_t *viewers, unsigned at, const char *line);
void viewer_service_gone(viewers_t *viewers, unsigned at);
void viewer_service_pump(viewers_t *viewers);

#endif

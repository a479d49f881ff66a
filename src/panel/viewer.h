/* SPDX-License-Identifier: MIT
 * viewer.h - somebody's page: what it has asked for and what waits to be sent to it. docs/panel.md is the contract of the
 * messages. What a slow page does not take is dropped (samples, counted), or replaced by the newest (status); nothing waits
 * without bound.
 */
#ifndef HEAVE_PANEL_VIEWER_H
#define HEAVE_PANEL_VIEWER_H

#include "panel/identification.h"
#include "panel/viewer_state.h"

/** The platforms and pages of a panel. */
typedef struct {
    upstream_t *platform;
    unsigned platforms;
    viewer_t *first;
    uint64_t last_viewer;
    int64_t now_ms;
    identification_t identification[VIEWER_PLATFORMS]; /**< of each platform */
    const char *state;                                 /**< directory where configurations are staged */
    void (*wake)(viewer_t *viewer);                    /**< it has something to send */
} viewers_t;

/** A page has come; @return NULL where there is no memory */
viewer_t *viewer_enter(viewers_t *viewers, void *handle, int role, const char *name);

/** A page has gone: what it held is let go. */
void viewer_leave(viewers_t *viewers, viewer_t *viewer);

/** A message of a page. */
void viewer_hear(viewers_t *viewers, viewer_t *viewer, const char *text, size_t length);

/** The newest status of a platform has come, heaved is gone, or has answered. */
void viewers_status(viewers_t *viewers, const upstream_t *upstream);
void viewers_gone(viewers_t *viewers, const upstream_t *upstream);
void viewers_answer(viewers_t *viewers, upstream_t *upstream, const asker_t *asker, const char *line);

/** Every 33 ms: samples, and ticks where somebody wants them. */
void viewers_pump(viewers_t *viewers);

#endif

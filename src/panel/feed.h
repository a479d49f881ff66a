/* SPDX-License-Identifier: MIT
 * feed.h - sends samples to a page: the columns that it asked for, from the shared memory, in blocks of float64. It sends all
 * rows, or the minimum and the maximum of every n rows, so that no peak is lost.
 */
#ifndef HEAVE_PANEL_FEED_H
#define HEAVE_PANEL_FEED_H

#include <cjson/cJSON.h>

#include "panel/viewer_state.h"

/** Begins the stream of samples that a message asks for. @return NULL: `error` says why */
feed_t *feed_begin(viewer_t *viewer, upstream_t *upstream, const cJSON *json, char *error, size_t size);

/** The answer to the message: number, columns and cycle of the stream. */
cJSON *feed_describe(const feed_t *stream, int64_t id);

void feed_end(viewer_t *viewer, uint32_t number);

/** Queues the new rows. @return true: something waits to be sent */
bool feed_pump(viewer_t *viewer);

#endif

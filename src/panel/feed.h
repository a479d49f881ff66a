/* SPDX-License-Identifier: MIT
 * feed.h - the samples that a page wants: columns of the shared memory, in blocks of float64, all rows or least and most of so
 * many, so that no peak is lost.
 */
#ifndef HEAVE_PANEL_FEED_H
#define HEAVE_PANEL_FEED_H

#include <cjson/cJSON.h>

#include "panel/viewer_state.h"

/** Begins one, as a message asks for it. @return NULL, and why */
feed_t *feed_begin(viewer_t *viewer, upstream_t *upstream, const cJSON *json, char *error, size_t size);

/** The answer: its number, its columns, the cycle. */
cJSON *feed_describe(const feed_t *stream, int64_t id);

void feed_end(viewer_t *viewer, uint32_t number);

/** Sends what is new. @return true: something waits to be sent */
bool feed_pump(viewer_t *viewer);

#endif

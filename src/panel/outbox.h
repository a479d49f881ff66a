/* SPDX-License-Identifier: MIT
 * outbox.h - messages that wait for a page's link. Bounded: what does not fit is the caller's to drop or to count.
 */
#ifndef HEAVE_PANEL_OUTBOX_H
#define HEAVE_PANEL_OUTBOX_H

#include "panel/viewer_state.h"

#define OUTBOX_HEAD 32u /* bytes before a message's data, for the library's head */

/** Queues a message. @return false: the queue is full, or there is no memory */
bool outbox_put(viewer_t *viewer, const void *data, size_t length, bool is_binary);

/** The next message to send; false where there is none. The caller frees its data. */
bool outbox_pop(viewer_t *viewer, message_t *out);

#endif

/* SPDX-License-Identifier: MIT
 * outbox.c - see outbox.h.
 */
#include "panel/outbox.h"

#include <stdlib.h>
#include <string.h>

bool outbox_put(viewer_t *viewer, const void *data, size_t length, bool is_binary)
{
    if (viewer->count == VIEWER_QUEUE) {
        return false;
    }
    unsigned char *const copy = malloc(OUTBOX_HEAD + length);
    if (copy == NULL) {
        return false;
    }
    memcpy(copy + OUTBOX_HEAD, data, length);
    viewer->queue[(viewer->first + viewer->count) % VIEWER_QUEUE] = (message_t){is_binary, length, copy};
    viewer->count++;
    return true;
}

bool outbox_pop(viewer_t *viewer, message_t *out)
{
    if (viewer->count == 0) {
        return false;
    }
    *out = viewer->queue[viewer->first];
    viewer->first = (viewer->first + 1) % VIEWER_QUEUE;
    viewer->count--;
    return true;
}

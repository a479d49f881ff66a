/* SPDX-License-Identifier: MIT
 * door.h - browsers that connect: where, how many, and who gives way. What they ask for is server.c's and http.c's. Knows the
 * library (libwebsockets).
 */
#ifndef HEAVE_PANEL_DOOR_H
#define HEAVE_PANEL_DOOR_H

#include <libwebsockets.h>

#include "panel/server.h"

#define DOOR_PAGES_MAX 64u

/** Raises the limit of open files to what all bounds of the panel need, so that strangers cannot take those that pages and heaved
 * need. @return false: it may not, and has said so */
bool door_has_descriptors(void);

/** Listens. @param server kept @return false: it cannot, and has said why */
bool door_open(struct lws_vhost *vhost, const server_t *server);

/** The callback of the protocol "listener". */
int door_serve(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length);

/** A connection has become a page, or has gone; without effect on others. */
void door_passed(const struct lws *wsi);

/** A turn has passed: it looks again for who waits. */
void door_turn(void);

#endif

/* SPDX-License-Identifier: MIT
 * server.h - HTTP and WebSocket for pages. Only server.c, door.c and http*.c know the library (libwebsockets), so that another
 * one can take its place.
 */
#ifndef HEAVE_PANEL_SERVER_H
#define HEAVE_PANEL_SERVER_H

#include "panel/access.h"
#include "panel/listener.h"
#include "panel/pages.h"
#include "panel/viewer.h"

/** What it serves and where. */
typedef struct {
    const listener_address_t *where; /**< to listen */
    const char *certificate, *key;   /**< NULL: no TLS */
    const char *proxy;               /**< address whose X-Forwarded-... are believed; NULL: none's */
    const char *state;               /**< directory with the passwords and what is staged */
    const char *heaved;              /**< the program that checks configurations */
    access_t *access;
    pages_t *pages;
    viewers_t *viewers;
    const char *version;
} server_t;

/** Calls of the platforms, for upstream_init(). */
extern const upstream_calls_t server_upstream_calls;

/** Begins to listen. One in a process. @return false: it cannot, and has said why */
bool server_open(server_t *server);

/** Serves what has come.
 *  @param waits else it looks and returns
 *  @return false: it cannot go on */
bool server_turn(bool waits);

void server_close(void);

#endif

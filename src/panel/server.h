/* SPDX-License-Identifier: MIT
 * server.h - HTTP and WebSocket for pages. Only server.c and http.c know the library (libwebsockets), so that another one can
 * take its place.
 */
#ifndef HEAVE_PANEL_SERVER_H
#define HEAVE_PANEL_SERVER_H

#include <signal.h>

#include "panel/access.h"
#include "panel/listener.h"
#include "panel/pages.h"
#include "panel/viewer.h"

/** What it serves and where. */
typedef struct {
    const listener_address_t *where; /**< to listen */
    const char *certificate, *key;   /**< NULL: no TLS */
    const char *proxy;               /**< address whose X-Forwarded-... are believed; NULL: none's */
    const char *state;               /**< directory with the passwords, looked at anew when they change */
    const char *heaved;              /**< the program that checks configurations */
    access_t *access;
    pages_t *pages;
    hall_t *hall;
    const char *version;
    const volatile sig_atomic_t *is_ended;
} server_t;

/** Calls of the platforms, for upstream_init(). */
extern const upstream_calls_t server_upstream_calls;

/** Serves until it is ended. @return 0; else it could not, and said why */
int server_run(server_t *server);

#endif

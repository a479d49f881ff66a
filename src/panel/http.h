/* SPDX-License-Identifier: MIT
 * http.h - pages, logins and files over HTTP; and who it is that asks. Private to server.c.
 */
#ifndef HEAVE_PANEL_HTTP_H
#define HEAVE_PANEL_HTTP_H

#include "panel/http_answer.h"

/** Once, before anything is served. */
void http_init(server_t *server);

/** The protocol's callback. */
int http_serve(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length);

#endif

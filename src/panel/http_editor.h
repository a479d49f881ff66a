/* SPDX-License-Identifier: MIT
 * http_editor.h - over HTTP: the configuration in force, the table of keys, and a text that heaved checks. Private to http.c.
 */
#ifndef HEAVE_PANEL_HTTP_EDITOR_H
#define HEAVE_PANEL_HTTP_EDITOR_H

#include "panel/http_answer.h"

void http_editor_init(server_t *server);

/** `/api/keys`, `/api/keys/zh`, `/api/config/PLATFORM`. */
bool http_editor_is_get(const char *path);
int http_editor_get(struct lws *wsi, request_t *request, const char *path);

/** `/api/check/PLATFORM`, with `/zh` behind it or not: a JSON object with `text`. */
bool http_editor_is_post(const char *path);

/** @param type of its content: JSON alone is taken. @return as the callback */
int http_editor_begin(struct lws *wsi, request_t *request, const char *type);
int http_editor_receive(request_t *request, const void *bytes, size_t length);
int http_editor_end(struct lws *wsi, request_t *request);

#endif

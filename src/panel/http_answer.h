/* SPDX-License-Identifier: MIT
 * http_answer.h - one HTTP request: who it is that asks, and answers. Private to server.c and http*.c.
 */
#ifndef HEAVE_PANEL_HTTP_ANSWER_H
#define HEAVE_PANEL_HTTP_ANSWER_H

#include <libwebsockets.h>

#include "panel/editor.h"
#include "panel/server.h"

#define HTTP_HEAD_MAX 8192u
#define HTTP_BODY_MAX 512u

/** One HTTP request. */
typedef struct {
    const unsigned char *data;
    size_t length, sent;
    bool is_begun, is_answered; /**< one request and one answer for each connection */
    bool has_file;
    int file;    /**< instead of data */
    char *owned; /**< data to be freed; NULL: none */
    unsigned char answer[HTTP_BODY_MAX];
    char body[HTTP_BODY_MAX];
    size_t body_length;
    bool wants_body; /**< it is answered when its body has come; else that does nothing */
    char *large;     /**< a body that may be large; NULL: it may not. Freed with the request */
    char path[PAGES_PATH_MAX];
    unsigned refused;    /**< code of the answer that its body does not change; 0: none */
    const char *refusal; /**< its words */
    struct lws *wsi;     /**< while a program works for it */
    level_t role;        /**< that a login asks for */
    char address[ACCESS_ADDRESS_MAX];
    char staged[EDITOR_DIGEST_MAX]; /**< of a configuration that is being checked */
} request_t;

/** Once, before anything is served. */
void http_answer_init(server_t *server);

/** Whose request it is; behind the proxy the browser. */
void http_peer(struct lws *wsi, char address[ACCESS_ADDRESS_MAX]);

/** Whether the browser speaks TLS, with the panel or with its proxy. */
bool http_is_secure(struct lws *wsi);

/** A header's value. @return false: there is none */
bool http_header(struct lws *wsi, enum lws_token_indexes which, char *out, int size);

/** Time of sessions. */
int64_t http_seconds(void);

/** Gives back what a request holds beside its own memory. */
void http_end_request(request_t *request);

/** Begins an answer. @param extra a header of this answer alone, with its value; NULL: none */
int http_begin_answer(struct lws *wsi, request_t *request, unsigned code, const char *type, const void *data, size_t length,
                      const char *extra, const char *value);

/** A short JSON text. @param cookie to set; NULL: none */
int http_answer_text(struct lws *wsi, request_t *request, unsigned code, const char *text, const char *cookie);

/** Why a request is none of ours: another name, a page of another origin, or, without passwords, through a proxy.
 *  @param has_origin the browser has to say whose page it is: for all that is more than reading
 *  @return NULL: it is ours */
const char *http_refusal(struct lws *wsi, bool has_origin);

/** The role of its session; ACCESS_NOBODY where it has none. */
int http_role(struct lws *wsi);

/** The token of its session. @return false: it has none */
bool http_token(struct lws *wsi, char token[ACCESS_TOKEN_MAX]);

/** An error as JSON. */
int http_answer_error(struct lws *wsi, request_t *request, unsigned code, const char *why);

/** @param text becomes the request's */
int http_answer_owned(struct lws *wsi, request_t *request, const char *type, char *text, size_t length);

/** The platform that a path names, and what stands behind it. */
const upstream_t *http_platform(const char *path, const char **rest);

/** Whether that session has not ended. */
bool http_is_session(const char *token);

#endif

/* SPDX-License-Identifier: MIT
 * http_answer.c - see http_answer.h.
 */
#include "panel/http_answer.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "panel/child.h"
#include "panel/listener.h"

#define HEAD_BYTES    2048u
#define FORWARDED_MAX 1024u

/* Nothing but our own files and this origin's WebSocket; nobody may put the page into a frame. */
#define POLICY                                                                                                                   \
    "default-src 'self'; connect-src 'self'; img-src 'self' data:; style-src 'self'; script-src 'self'; "                        \
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"

static server_t *m_server; /* the library's callbacks reach nothing else */

void http_answer_init(server_t *server)
{
    m_server = server;
}

/* --- Who asks --- */

int64_t http_seconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1;
}

bool http_header(struct lws *wsi, enum lws_token_indexes which, char *out, int size)
{
    out[0] = '\0';
    return lws_hdr_copy(wsi, out, size, which) > 0;
}

static bool is_proxy(struct lws *wsi, char address[ACCESS_ADDRESS_MAX])
{
    listener_peer_t peer;
    (void)listener_peer(lws_get_socket_fd(wsi), &peer);
    (void)snprintf(address, ACCESS_ADDRESS_MAX, "%s", peer.address);
    return m_server->proxy != NULL && strcmp(address, m_server->proxy) == 0;
}

void http_peer(struct lws *wsi, char address[ACCESS_ADDRESS_MAX])
{
    char list[FORWARDED_MAX];
    if (is_proxy(wsi, address) &&
        !(http_header(wsi, WSI_TOKEN_X_FORWARDED_FOR, list, (int)sizeof list) && access_forwarded(list, address))) {
        lwsl_warn("the proxy names no browser: its X-Forwarded-For has to end with an address\n");
    }
}

bool http_is_secure(struct lws *wsi)
{
    static const char k_name[] = "x-forwarded-proto:";
    char address[ACCESS_ADDRESS_MAX];
    char scheme[16] = "";
    return m_server->certificate != NULL ||
           (is_proxy(wsi, address) && lws_hdr_custom_copy(wsi, scheme, (int)sizeof scheme, k_name, (int)strlen(k_name)) > 0 &&
            strcmp(scheme, "https") == 0);
}

/* Everybody behind a proxy on this machine looks like this machine. */
static bool is_forwarded(struct lws *wsi)
{
    static const enum lws_token_indexes k_tokens[] = {WSI_TOKEN_X_FORWARDED_FOR, WSI_TOKEN_HTTP_X_REAL_IP, WSI_TOKEN_HTTP_VIA};
    static const char *const k_names[] = {"forwarded:", "x-forwarded-host:", "x-forwarded-proto:"};
    bool is_such = false;
    for (unsigned i = 0; i < sizeof k_tokens / sizeof k_tokens[0]; i++) {
        is_such = is_such || lws_hdr_total_length(wsi, k_tokens[i]) > 0;
    }
    for (unsigned i = 0; i < sizeof k_names / sizeof k_names[0]; i++) {
        is_such = is_such || lws_hdr_custom_length(wsi, k_names[i], (int)strlen(k_names[i])) > 0;
    }
    return is_such;
}

const char *http_refusal(struct lws *wsi, bool has_origin)
{
    char host[ACCESS_HOST_MAX];
    char origin[ACCESS_HOST_MAX + 16];
    if (!http_header(wsi, WSI_TOKEN_HOST, host, (int)sizeof host) ||
        !(access_is_host(m_server->access, host) || listener_is_own(lws_get_socket_fd(wsi), host))) {
        return "this is not a name of this panel; --allow-host makes it one";
    }
    if (!m_server->access->has_password && is_forwarded(wsi)) {
        return "through a proxy only once there is a password: heave-panel passwd";
    }
    const bool is_said = http_header(wsi, WSI_TOKEN_ORIGIN, origin, (int)sizeof origin);
    return (is_said ? access_is_own_origin(origin, host, http_is_secure(wsi)) : !has_origin)
               ? NULL
               : "this comes from a page of another origin";
}

bool http_token(struct lws *wsi, char token[ACCESS_TOKEN_MAX])
{
    char cookies[HTTP_HEAD_MAX]; /* other programs of this host have some, too */
    const char *at = http_header(wsi, WSI_TOKEN_HTTP_COOKIE, cookies, (int)sizeof cookies) ? cookies : "";
    token[0] = '\0';
    for (; *at != '\0'; at += strcspn(at, ";") + (strchr(at, ';') != NULL)) {
        at += strspn(at, " ");
        if (strncmp(at, "heave=", 6) == 0) {
            const size_t length = strcspn(at + 6, "; ");
            (void)snprintf(token, ACCESS_TOKEN_MAX, "%.*s", (int)(length < ACCESS_TOKEN_MAX ? length : 0), at + 6);
            return length > 0 && length < ACCESS_TOKEN_MAX;
        }
    }
    return false;
}

int http_role(struct lws *wsi)
{
    char token[ACCESS_TOKEN_MAX];
    if (!m_server->access->has_password) {
        return LEVEL_SERVICE; /* it listens on this machine alone then */
    }
    return http_token(wsi, token) ? access_find(m_server->access, token, http_seconds()) : ACCESS_NOBODY;
}

bool http_is_session(const char *token)
{
    return !m_server->access->has_password || access_find(m_server->access, token, http_seconds()) >= 0;
}

/* What it holds beside its own memory. */
void http_end_request(request_t *request)
{
    if (request->has_file) {
        (void)close(request->file);
    }
    free(request->owned);
    free(request->large);
    child_forget(request);
    request->has_file = false;
    request->owned = request->large = NULL;
}

/* @param extra a header of this answer alone, with its value; NULL: none */
int http_begin_answer(struct lws *wsi, request_t *request, unsigned code, const char *type, const void *data, size_t length,
                      const char *extra, const char *value)
{
    unsigned char head[LWS_PRE + HEAD_BYTES];
    unsigned char *const start = &head[LWS_PRE], *const end = &head[sizeof head - 1];
    unsigned char *at = start;
    static const char *const k_headers[][2] = {
        {"content-security-policy:", POLICY},
        {"x-content-type-options:", "nosniff"},
        {"referrer-policy:", "no-referrer"},
        {"cache-control:", "no-cache"},
        {"cross-origin-opener-policy:", "same-origin"},
        {"x-frame-options:", "DENY"},
        {"cross-origin-resource-policy:", "same-origin"},
        {"vary:", "accept-encoding"},
        {"connection:", "close"}}; /* one request each: what stands behind it is nobody's */
    bool is_cut = lws_add_http_common_headers(wsi, code, type, (lws_filepos_t)length, &at, end) != 0;
    for (unsigned i = 0; i < sizeof k_headers / sizeof k_headers[0]; i++) {
        is_cut = is_cut ||
                 lws_add_http_header_by_name(wsi, (const unsigned char *)k_headers[i][0], (const unsigned char *)k_headers[i][1],
                                             (int)strlen(k_headers[i][1]), &at, end) != 0;
    }
    if (extra != NULL && value != NULL) {
        is_cut = is_cut || lws_add_http_header_by_name(wsi, (const unsigned char *)extra, (const unsigned char *)value,
                                                       (int)strlen(value), &at, end) != 0;
    }
    if (is_cut || lws_finalize_write_http_header(wsi, start, &at, end) != 0) {
        return -1;
    }
    request->data = data;
    request->length = length;
    request->sent = 0;
    request->is_answered = true;
    (void)lws_callback_on_writable(wsi);
    return 0;
}

int http_answer_text(struct lws *wsi, request_t *request, unsigned code, const char *text, const char *cookie)
{
    (void)snprintf((char *)request->answer, sizeof request->answer, "%s", text);
    return http_begin_answer(wsi, request, code, "application/json", request->answer, strlen((char *)request->answer),
                             "set-cookie:", cookie);
}

int http_answer_error(struct lws *wsi, request_t *request, unsigned code, const char *why)
{
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddStringToObject(json, "error", why);
    char *const text = cJSON_PrintUnformatted(json);
    const int result = http_answer_text(wsi, request, code, text != NULL ? text : "{}", NULL);
    cJSON_free(text);
    cJSON_Delete(json);
    return result;
}

int http_answer_owned(struct lws *wsi, request_t *request, const char *type, char *text, size_t length)
{
    free(request->owned);
    request->owned = text;
    return http_begin_answer(wsi, request, HTTP_STATUS_OK, type, text, length, NULL, NULL);
}

const upstream_t *http_platform(const char *path, const char **rest)
{
    const size_t length = strcspn(path, "/");
    *rest = path[length] == '/' ? path + length + 1 : "";
    for (unsigned i = 0; i < m_server->viewers->platforms; i++) {
        const upstream_t *const one = &m_server->viewers->platform[i];
        if (strlen(one->name) == length && strncmp(one->name, path, length) == 0) {
            return one;
        }
    }
    return NULL;
}

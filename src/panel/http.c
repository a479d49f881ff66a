/* SPDX-License-Identifier: MIT
 * http.c - see http.h.
 */
#include "panel/http.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "panel/child.h"
#include "panel/files.h"
#include "panel/http_editor.h"

#define CHUNK            16384u
#define WHY_MAX          256u
#define LOGIN_PATIENCE_S 30

static server_t *m_server;             /* the library's callbacks reach nothing else */
static char m_password[HTTP_BODY_MAX]; /* of the login that is being begun: the process that compares it has a copy */

static const char k_incident[] = "/api/incident/";
static const char k_log[] = "/api/log/";

void http_init(server_t *server)
{
    m_server = server;
    http_answer_init(server);
    http_editor_init(server);
}

/* --- HTTP --- */

static int answer_me(struct lws *wsi, request_t *request)
{
    const int role = http_role(wsi);
    cJSON *const json = cJSON_CreateObject();
    if (role >= 0) {
        cJSON_AddStringToObject(json, "role", level_name((level_t)role));
    } else {
        cJSON_AddNullToObject(json, "role");
    }
    cJSON_AddBoolToObject(json, "login_needed", m_server->access->has_password);
    cJSON_AddStringToObject(json, "version", m_server->version);
    cJSON *const names = cJSON_AddArrayToObject(json, "platforms");
    for (unsigned i = 0; role >= 0 && i < m_server->viewers->platforms; i++) {
        cJSON_AddItemToArray(names, cJSON_CreateString(m_server->viewers->platform[i].name));
    }
    char *const text = cJSON_PrintUnformatted(json);
    const int result = http_answer_text(wsi, request, HTTP_STATUS_OK, text != NULL ? text : "{}", NULL);
    cJSON_free(text);
    cJSON_Delete(json);
    return result;
}

static int answer_log(struct lws *wsi, request_t *request, const upstream_t *upstream)
{
    char why[WHY_MAX];
    size_t length = 0;
    if (http_role(wsi) < (int)LEVEL_OPERATE) {
        return http_answer_error(wsi, request, HTTP_STATUS_FORBIDDEN, "not allowed; it takes the role operate");
    }
    request->owned = files_read_log(upstream, &length, why, sizeof why);
    return request->owned == NULL
               ? http_answer_error(wsi, request, HTTP_STATUS_NOT_FOUND, why)
               : http_begin_answer(wsi, request, HTTP_STATUS_OK, "application/x-ndjson", request->owned, length, NULL, NULL);
}

/* NAME/FILE of an incident, as a download. */
static int answer_incident(struct lws *wsi, request_t *request, const upstream_t *upstream, const char *rest)
{
    char why[WHY_MAX];
    char name[64];
    char value[WHY_MAX];
    const char *const slash = strchr(rest, '/');
    (void)snprintf(name, sizeof name, "%.*s", (int)(slash != NULL ? slash - rest : 0), rest);
    const opened_t opened = files_open_incident(upstream, name, slash != NULL ? slash + 1 : "", why, sizeof why);
    if (opened.fd < 0) {
        return http_answer_error(wsi, request, HTTP_STATUS_NOT_FOUND, why);
    }
    request->file = opened.fd;
    request->has_file = true;
    (void)snprintf(value, sizeof value, "attachment; filename=\"%s-%s-%s\"", upstream->name, name, slash + 1);
    return http_begin_answer(wsi, request, HTTP_STATUS_OK, "text/plain; charset=utf-8", NULL, opened.length,
                             "content-disposition:", value);
}

/* What a platform has written, for who is logged in. */
static int answer_files(struct lws *wsi, request_t *request, const char *path)
{
    const char *rest = "";
    const bool is_log = strncmp(path, k_log, strlen(k_log)) == 0;
    const upstream_t *const upstream = http_platform(path + strlen(is_log ? k_log : k_incident), &rest);
    if (http_role(wsi) < 0) {
        return http_answer_error(wsi, request, HTTP_STATUS_UNAUTHORIZED, "log in first");
    }
    if (upstream == NULL) {
        return http_answer_error(wsi, request, HTTP_STATUS_NOT_FOUND, "there is no such platform here");
    }
    return is_log ? answer_log(wsi, request, upstream) : answer_incident(wsi, request, upstream, rest);
}

/* gzip, and not with q=0. */
static bool accepts_gzip(struct lws *wsi)
{
    char value[128];
    const char *const at =
        http_header(wsi, WSI_TOKEN_HTTP_ACCEPT_ENCODING, value, (int)sizeof value) ? strstr(value, "gzip") : NULL;
    return at != NULL && (strncmp(at, "gzip;q=0", 8) != 0 || at[8] == '.');
}

static int begin_post(struct lws *wsi, request_t *request, const char *path)
{
    char type[64];
    if (http_editor_is_post(path)) {
        request->wants_body = true;
        return http_editor_begin(wsi, request, http_header(wsi, WSI_TOKEN_HTTP_CONTENT_TYPE, type, (int)sizeof type) ? type : "");
    }
    const bool is_json = http_header(wsi, WSI_TOKEN_HTTP_CONTENT_TYPE, type, (int)sizeof type) &&
                         strncmp(type, "application/json", 16) == 0; /* a form of another page cannot say that */
    request->wants_body = is_json && (strcmp(path, "/api/login") == 0 || strcmp(path, "/api/logout") == 0);
    return request->wants_body
               ? 0
               : http_answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "{\"error\":\"there is no such request\"}", NULL);
}

static int begin_request(struct lws *wsi, request_t *request, const char *path)
{
    const bool is_post = lws_hdr_total_length(wsi, WSI_TOKEN_POST_URI) > 0;
    if (request->is_begun) {
        return -1; /* one each */
    }
    *request = (request_t){.is_begun = true};
    (void)snprintf(request->path, sizeof request->path, "%.90s", path);
    const char *const refusal = http_refusal(wsi, is_post);
    if (refusal != NULL) {
        return http_answer_error(wsi, request, HTTP_STATUS_FORBIDDEN, refusal);
    }
    if (is_post) {
        return begin_post(wsi, request, path);
    }
    if (strcmp(path, "/api/me") == 0) {
        return answer_me(wsi, request);
    }
    if (strncmp(path, k_log, strlen(k_log)) == 0 || strncmp(path, k_incident, strlen(k_incident)) == 0) {
        return answer_files(wsi, request, path);
    }
    if (http_editor_is_get(path)) {
        return http_editor_get(wsi, request, path);
    }
    const page_t *const page = pages_find(m_server->pages, path);
    if (page == NULL) {
        return http_answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "{\"error\":\"there is no such page\"}", NULL);
    }
    return page->packed != NULL && accepts_gzip(wsi)
               ? http_begin_answer(wsi, request, HTTP_STATUS_OK, page->type, page->packed, page->packed_length,
                                   "content-encoding:", "gzip")
               : http_begin_answer(wsi, request, HTTP_STATUS_OK, page->type, page->data, page->length, NULL, NULL);
}

static int reject_login(struct lws *wsi, request_t *request, bool is_too_often)
{
    lwsl_warn("login from %s: %s\n", request->address, is_too_often ? "too often" : "wrong");
    return is_too_often
               ? http_answer_text(wsi, request, 429, "{\"error\":\"too many tries: wait a few seconds\"}", NULL)
               : http_answer_text(wsi, request, HTTP_STATUS_UNAUTHORIZED, "{\"error\":\"wrong role or password\"}", NULL);
}

/* In a process of its own. */
static int compare(void *context, int fd)
{
    const request_t *const request = context;
    (void)fd;
    return access_is_right(m_server->access, request->role, m_password) ? EXIT_SUCCESS : EXIT_FAILURE;
}

static void on_compared(void *context, int code, char *text, size_t length)
{
    request_t *const request = context;
    char token[ACCESS_TOKEN_MAX];
    char cookie[ACCESS_TOKEN_MAX + 96];
    (void)length;
    free(text);
    if (code != EXIT_SUCCESS || !access_enter(m_server->access, request->role, request->address, http_seconds(), token)) {
        (void)reject_login(request->wsi, request, false);
        return;
    }
    (void)snprintf(cookie, sizeof cookie, "heave=%s; HttpOnly; SameSite=Strict; Path=/%s", token,
                   http_is_secure(request->wsi) ? "; Secure" : "");
    (void)http_answer_text(request->wsi, request, HTTP_STATUS_OK, "{}", cookie);
}

/* The password is compared in a process of its own, few at a time: beats of hands and ticks do not wait for that. */
static int log_in(struct lws *wsi, request_t *request)
{
    cJSON *const json = cJSON_ParseWithLength(request->body, request->body_length);
    const cJSON *const role = cJSON_GetObjectItemCaseSensitive(json, "role");
    const cJSON *const password = cJSON_GetObjectItemCaseSensitive(json, "password");
    const int wanted = cJSON_IsString(role) ? access_role(role->valuestring) : ACCESS_NOBODY;
    const bool is_login = wanted >= 0 && cJSON_IsString(password);
    http_peer(wsi, request->address);
    if (is_login) {
        request->role = (level_t)wanted;
        (void)snprintf(m_password, sizeof m_password, "%s", password->valuestring);
        memset(password->valuestring, 0, strlen(password->valuestring));
    }
    cJSON_Delete(json);
    memset(request->body, 0, sizeof request->body);
    request->wsi = wsi;
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, LOGIN_PATIENCE_S);
    const bool is_begun = is_login && child_count(on_compared) < CHILD_WORKS &&
                          access_begin(m_server->access, request->address, http_seconds()) &&
                          child_work(compare, request, on_compared, http_seconds() * 1000);
    memset(m_password, 0, sizeof m_password);
    return is_begun ? 0 : reject_login(wsi, request, is_login);
}

static int log_out(struct lws *wsi, request_t *request)
{
    char token[ACCESS_TOKEN_MAX];
    if (http_token(wsi, token)) {
        access_logout(m_server->access, token);
    }
    return http_answer_text(wsi, request, HTTP_STATUS_OK, "{}", "heave=; HttpOnly; SameSite=Strict; Path=/; Max-Age=0");
}

static int send_chunk(struct lws *wsi, request_t *request)
{
    static unsigned char chunk[LWS_PRE + CHUNK];
    const size_t left = request->length - request->sent;
    const size_t length = left < CHUNK ? left : CHUNK;
    if (!request->is_answered) {
        return 0;
    }
    if (left == 0) {
        return -1; /* all of it has gone: the connection ends */
    }
    if (!request->has_file) {
        memcpy(&chunk[LWS_PRE], request->data + request->sent, length);
    } else if (pread(request->file, &chunk[LWS_PRE], length, (off_t)request->sent) != (ssize_t)length) {
        return -1; /* shorter than it was: what was promised cannot be sent */
    }
    if (lws_write(wsi, &chunk[LWS_PRE], length, length == left ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) != (int)length) {
        return -1;
    }
    request->sent += length;
    (void)lws_callback_on_writable(wsi);
    return 0;
}

static int receive_body(request_t *request, const void *bytes, size_t length)
{
    if (http_editor_is_post(request->path)) {
        return http_editor_receive(request, bytes, length);
    }
    if (request->body_length + length > sizeof request->body) {
        return -1;
    }
    memcpy(request->body + request->body_length, bytes, length);
    request->body_length += length;
    return 0;
}

static int end_body(struct lws *wsi, request_t *request)
{
    request->wants_body = false; /* bytes behind it would complete it again */
    if (http_editor_is_post(request->path)) {
        return http_editor_end(wsi, request);
    }
    return strcmp(request->path, "/api/login") == 0 ? log_in(wsi, request) : log_out(wsi, request);
}

int http_serve(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    request_t *const request = user;
    switch ((int)reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return -1; /* no WebSocket, but what a client may name as one */
    case LWS_CALLBACK_HTTP:
        return begin_request(wsi, request, in);
    case LWS_CALLBACK_HTTP_BODY:
        return request->wants_body && length > 0 ? receive_body(request, in, length) : 0;
    case LWS_CALLBACK_HTTP_BODY_COMPLETION:
        return request->wants_body ? end_body(wsi, request) : 0;
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return send_chunk(wsi, request);
    case LWS_CALLBACK_CLOSED_HTTP:
        if (request != NULL) { /* it may have asked nothing */
            http_end_request(request);
        }
        return 0;
    default:
        return lws_callback_http_dummy(wsi, reason, user, in, length);
    }
}

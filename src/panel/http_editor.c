/* SPDX-License-Identifier: MIT
 * http_editor.c - see http_editor.h.
 */
#include "panel/http_editor.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "common/message.h" // exit codes
#include "panel/child.h"

#define BODY_MAX   (3u * EDITOR_TEXT_MAX) /* a text as JSON, with room for what is escaped */
#define PATIENCE_S 30
#define WHY_MAX    256u

static server_t *m_server; /* the library's callbacks reach nothing else */

static const char k_keys[] = "/api/keys";
static const char k_config[] = "/api/config/";
static const char k_check[] = "/api/check/";

void http_editor_init(server_t *server)
{
    m_server = server;
}

static int64_t milliseconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static bool begins(const char *path, const char *prefix)
{
    return strncmp(path, prefix, strlen(prefix)) == 0;
}

static const char *language_of(const char *rest)
{
    return strcmp(rest, "zh") == 0 ? "zh" : "";
}

/* --- What there is --- */

bool http_editor_is_get(const char *path)
{
    return strcmp(path, k_keys) == 0 || strcmp(path, "/api/keys/zh") == 0 || begins(path, k_config);
}

static void on_keys(void *context, int code, char *text, size_t length)
{
    request_t *const request = context;
    if (code == EXIT_DONE) {
        (void)http_answer_owned(request->wsi, request, "application/json", text, length);
    } else {
        free(text);
        (void)http_answer_error(request->wsi, request, 503, "heaved --keys has not answered: is heaved installed here?");
    }
}

static int run(struct lws *wsi, request_t *request, const char *const *argv, const char *language, child_end_t *end)
{
    request->wsi = wsi;
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, PATIENCE_S);
    return child_run(argv, language, end, request, milliseconds())
               ? 0
               : http_answer_error(wsi, request, 503, "too much is being checked at once: try again");
}

static int answer_config(struct lws *wsi, request_t *request, const upstream_t *upstream)
{
    const configuration_t *const it = &upstream->configuration;
    if (it->text == NULL) {
        return http_answer_error(wsi, request, HTTP_STATUS_NOT_FOUND, "heaved is not there, or does not tell its configuration");
    }
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddStringToObject(json, "text", it->text);
    cJSON_AddStringToObject(json, "digest", it->digest);
    cJSON_AddStringToObject(json, "file", it->file);
    cJSON_AddBoolToObject(json, "applied", it->is_applied);
    cJSON_AddBoolToObject(json, "keeps", it->is_kept);
    char *const text = cJSON_PrintUnformatted(json);
    cJSON_Delete(json);
    return text != NULL ? http_answer_owned(wsi, request, "application/json", text, strlen(text)) : -1;
}

int http_editor_get(struct lws *wsi, request_t *request, const char *path)
{
    const char *rest = "";
    if (http_role(wsi) < 0) {
        return http_answer_error(wsi, request, HTTP_STATUS_UNAUTHORIZED, "log in first");
    }
    if (begins(path, k_keys)) {
        const char *const argv[] = {m_server->heaved, "--keys", NULL};
        return run(wsi, request, argv, language_of(path[sizeof k_keys - 1u] == '/' ? path + sizeof k_keys : ""), on_keys);
    }
    const upstream_t *const upstream = http_platform(path + strlen(k_config), &rest);
    return upstream == NULL || rest[0] != '\0'
               ? http_answer_error(wsi, request, HTTP_STATUS_NOT_FOUND, "there is no such platform here")
               : answer_config(wsi, request, upstream);
}

/* --- What somebody has written --- */

bool http_editor_is_post(const char *path)
{
    return begins(path, k_check);
}

/* It is answered once its body has gone by: an answer in the middle of it would be cut off. */
static int reject(request_t *request, unsigned code, const char *why)
{
    request->refused = code;
    request->refusal = why;
    return 0;
}

int http_editor_begin(struct lws *wsi, request_t *request, const char *type)
{
    const char *rest = "";
    const int role = http_role(wsi);
    if (!begins(type, "application/json")) { /* a form of another page cannot say that */
        return reject(request, HTTP_STATUS_NOT_FOUND, "there is no such request");
    }
    if (role < (int)LEVEL_SERVICE) {
        return role < 0 ? reject(request, HTTP_STATUS_UNAUTHORIZED, "log in first")
                        : reject(request, HTTP_STATUS_FORBIDDEN, "not allowed; it takes the role service");
    }
    if (http_platform(request->path + strlen(k_check), &rest) == NULL || (rest[0] != '\0' && strcmp(rest, "zh") != 0)) {
        return reject(request, HTTP_STATUS_NOT_FOUND, "there is no such platform here");
    }
    request->large = malloc(BODY_MAX);
    return request->large != NULL ? 0 : -1;
}

int http_editor_receive(request_t *request, const void *bytes, size_t length)
{
    if (request->body_length + length > BODY_MAX) {
        return -1;
    }
    if (request->large != NULL) {
        memcpy(request->large + request->body_length, bytes, length);
    }
    request->body_length += length;
    return 0;
}

static void on_checked(void *context, int code, char *text, size_t length)
{
    request_t *const request = context;
    static const char k_form[] = "{\"staged\":\"%s\",\"check\":%s}";
    const bool is_answered = (code == EXIT_DONE || code == EXIT_BAD_CONFIG) && length > 2 && text[0] == '{';
    const size_t size = sizeof k_form + sizeof request->staged + length;
    char *const whole = is_answered ? malloc(size) : NULL;
    if (whole != NULL) {
        const int written = snprintf(whole, size, k_form, request->staged, text);
        (void)http_answer_owned(request->wsi, request, "application/json", whole, (size_t)written);
    } else {
        (void)http_answer_error(
            request->wsi, request, 503,
            "heaved --check has not come to an end: is heaved installed here? Otherwise the text takes too long");
    }
    free(text);
}

int http_editor_end(struct lws *wsi, request_t *request)
{
    char path[EDITOR_PATH_MAX];
    char why[WHY_MAX];
    const char *rest = "";
    if (request->refused != 0 || request->large == NULL) {
        return http_answer_error(wsi, request, request->refused != 0 ? request->refused : 503,
                                 request->refused != 0 ? request->refusal : "");
    }
    const upstream_t *const upstream = http_platform(request->path + strlen(k_check), &rest);
    cJSON *const json = cJSON_ParseWithLength(request->large, request->body_length);
    const cJSON *const text = cJSON_GetObjectItemCaseSensitive(json, "text");
    if (!cJSON_IsString(text) || upstream == NULL) {
        cJSON_Delete(json);
        return http_answer_error(wsi, request, HTTP_STATUS_BAD_REQUEST, "a JSON object with text is needed");
    }
    const bool is_staged = editor_stage(m_server->state, upstream, text->valuestring, strlen(text->valuestring), path,
                                        request->staged, why, sizeof why);
    cJSON_Delete(json);
    if (!is_staged) {
        return http_answer_error(wsi, request, 503, why);
    }
    const char *const argv[] = {m_server->heaved, "--config", path, "--check", "--json", NULL};
    return run(wsi, request, argv, language_of(rest), on_checked);
}

/* SPDX-License-Identifier: MIT
 * server.c - see server.h.
 * One thread: pages, connections to heaved and time are all events of libwebsockets' loop. Host and Origin are checked for every
 * request and every WebSocket; a name that is not ours (DNS rebinding) gets nothing.
 */
#include "panel/server.h"

#include <cjson/cJSON.h>
#include <libwebsockets.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "panel/outbox.h"

#define PROTOCOL    "heave-panel.1"
#define HEAD_BYTES  2048u
#define BODY_MAX    512u
#define CHUNK       16384u
#define PUMP_US     (33 * LWS_US_PER_MS)
#define CONNECT_US  (1 * LWS_US_PER_SEC)
#define VIEWERS_MAX 64u

/* Nothing but our own files and this origin's WebSocket; nobody may put the page into a frame. */
#define POLICY                                                                                                                   \
    "default-src 'self'; connect-src 'self'; img-src 'self' data:; style-src 'self'; script-src 'self'; "                        \
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"

/* One HTTP request. */
typedef struct {
    const unsigned char *data;
    size_t length, sent;
    unsigned char answer[BODY_MAX];
    char body[BODY_MAX];
    size_t body_length;
    char path[PAGES_PATH_MAX];
} request_t;

/* One WebSocket. */
typedef struct {
    viewer_t *viewer;
} socket_t;

static server_t *m_server; /* the library's callbacks reach nothing else */
static struct lws_context *m_context;
static struct lws_vhost *m_vhost;
static lws_sorted_usec_list_t m_pump, m_connect;
static unsigned m_viewers;

static int64_t seconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1;
}

static int64_t milliseconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* --- Who asks --- */

static bool header(struct lws *wsi, enum lws_token_indexes which, char *out, int size)
{
    out[0] = '\0';
    return lws_hdr_copy(wsi, out, size, which) > 0;
}

/* @param has_origin the browser has to say whose page it is: for all that is more than reading a file */
static bool is_ours(struct lws *wsi, bool has_origin)
{
    char host[ACCESS_HOST_MAX];
    char origin[ACCESS_HOST_MAX + 16];
    if (!header(wsi, WSI_TOKEN_HOST, host, (int)sizeof host) || !access_is_host(m_server->access, host)) {
        return false;
    }
    const bool is_said = header(wsi, WSI_TOKEN_ORIGIN, origin, (int)sizeof origin);
    return is_said ? access_is_own_origin(origin, host) : !has_origin;
}

static bool find_token(struct lws *wsi, char token[ACCESS_TOKEN_MAX])
{
    char cookies[1024];
    const char *at = header(wsi, WSI_TOKEN_HTTP_COOKIE, cookies, (int)sizeof cookies) ? cookies : "";
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

static int role_of(struct lws *wsi)
{
    char token[ACCESS_TOKEN_MAX];
    if (!m_server->access->has_password) {
        return LEVEL_SERVICE; /* it listens on this machine alone then */
    }
    return find_token(wsi, token) ? access_find(m_server->access, token, seconds()) : ACCESS_NOBODY;
}

static void address_of(struct lws *wsi, char address[ACCESS_ADDRESS_MAX])
{
    (void)lws_get_peer_simple(wsi, address, ACCESS_ADDRESS_MAX);
}

/* --- HTTP --- */

static int begin_answer(struct lws *wsi, request_t *request, unsigned code, const char *type, const void *data, size_t length,
                        const char *cookie)
{
    unsigned char head[LWS_PRE + HEAD_BYTES];
    unsigned char *const start = &head[LWS_PRE], *const end = &head[sizeof head - 1];
    unsigned char *at = start;
    static const char *const k_headers[][2] = {
        {"content-security-policy:", POLICY}, {"x-content-type-options:", "nosniff"},         {"referrer-policy:", "no-referrer"},
        {"cache-control:", "no-cache"},       {"cross-origin-opener-policy:", "same-origin"}, {"x-frame-options:", "DENY"}};
    bool is_cut = lws_add_http_common_headers(wsi, code, type, (lws_filepos_t)length, &at, end) != 0;
    for (unsigned i = 0; i < sizeof k_headers / sizeof k_headers[0]; i++) {
        is_cut = is_cut ||
                 lws_add_http_header_by_name(wsi, (const unsigned char *)k_headers[i][0], (const unsigned char *)k_headers[i][1],
                                             (int)strlen(k_headers[i][1]), &at, end) != 0;
    }
    if (cookie != NULL) {
        is_cut = is_cut || lws_add_http_header_by_name(wsi, (const unsigned char *)"set-cookie:", (const unsigned char *)cookie,
                                                       (int)strlen(cookie), &at, end) != 0;
    }
    if (is_cut || lws_finalize_write_http_header(wsi, start, &at, end) != 0) {
        return -1;
    }
    request->data = data;
    request->length = length;
    request->sent = 0;
    if (length == 0) {
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    (void)lws_callback_on_writable(wsi);
    return 0;
}

static int answer_text(struct lws *wsi, request_t *request, unsigned code, const char *text, const char *cookie)
{
    (void)snprintf((char *)request->answer, sizeof request->answer, "%s", text);
    return begin_answer(wsi, request, code, "application/json", request->answer, strlen((char *)request->answer), cookie);
}

static int answer_me(struct lws *wsi, request_t *request)
{
    const int role = role_of(wsi);
    cJSON *const json = cJSON_CreateObject();
    if (role >= 0) {
        cJSON_AddStringToObject(json, "role", level_name((level_t)role));
    } else {
        cJSON_AddNullToObject(json, "role");
    }
    cJSON_AddBoolToObject(json, "login_needed", m_server->access->has_password);
    cJSON_AddStringToObject(json, "version", m_server->version);
    cJSON *const names = cJSON_AddArrayToObject(json, "platforms");
    for (unsigned i = 0; role >= 0 && i < m_server->hall->platforms; i++) {
        cJSON_AddItemToArray(names, cJSON_CreateString(m_server->hall->platform[i].name));
    }
    char *const text = cJSON_PrintUnformatted(json);
    const int result = answer_text(wsi, request, HTTP_STATUS_OK, text != NULL ? text : "{}", NULL);
    cJSON_free(text);
    cJSON_Delete(json);
    return result;
}

static int begin_request(struct lws *wsi, request_t *request, const char *path)
{
    const bool is_post = lws_hdr_total_length(wsi, WSI_TOKEN_POST_URI) > 0;
    *request = (request_t){.length = 0};
    (void)snprintf(request->path, sizeof request->path, "%.90s", path);
    if (!is_ours(wsi, is_post)) {
        return answer_text(wsi, request, HTTP_STATUS_FORBIDDEN,
                           "{\"error\":\"this is not a name of this panel; --allow-host makes it one\"}", NULL);
    }
    if (is_post) {
        char type[64];
        const bool is_json = header(wsi, WSI_TOKEN_HTTP_CONTENT_TYPE, type, (int)sizeof type) &&
                             strncmp(type, "application/json", 16) == 0; /* a form of another page cannot say that */
        return is_json && (strcmp(path, "/api/login") == 0 || strcmp(path, "/api/logout") == 0)
                   ? 0
                   : answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "{\"error\":\"there is no such request\"}", NULL);
    }
    if (strcmp(path, "/api/me") == 0) {
        return answer_me(wsi, request);
    }
    const page_t *const page = pages_find(m_server->pages, path);
    if (page == NULL) {
        return answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "{\"error\":\"there is no such page\"}", NULL);
    }
    return begin_answer(wsi, request, HTTP_STATUS_OK, page->type, page->data, page->length, NULL);
}

static int log_in(struct lws *wsi, request_t *request)
{
    char token[ACCESS_TOKEN_MAX];
    char cookie[ACCESS_TOKEN_MAX + 96];
    char address[ACCESS_ADDRESS_MAX] = "";
    cJSON *const json = cJSON_ParseWithLength(request->body, request->body_length);
    const cJSON *const role = cJSON_GetObjectItemCaseSensitive(json, "role");
    const cJSON *const password = cJSON_GetObjectItemCaseSensitive(json, "password");
    const int wanted = cJSON_IsString(role) ? access_role(role->valuestring) : ACCESS_NOBODY;
    address_of(wsi, address);
    const access_login_t result =
        wanted >= 0 && cJSON_IsString(password)
            ? access_login(m_server->access, (level_t)wanted, password->valuestring, address, seconds(), token)
            : ACCESS_WRONG;
    if (cJSON_IsString(password)) {
        memset(password->valuestring, 0, strlen(password->valuestring));
    }
    cJSON_Delete(json);
    memset(request->body, 0, sizeof request->body);
    if (result != ACCESS_IN) {
        lwsl_warn("login from %s: %s\n", address, result == ACCESS_WRONG ? "wrong" : "too often");
        return result == ACCESS_WRONG
                   ? answer_text(wsi, request, HTTP_STATUS_UNAUTHORIZED, "{\"error\":\"wrong role or password\"}", NULL)
                   : answer_text(wsi, request, 429, "{\"error\":\"too many tries: wait a few seconds\"}", NULL);
    }
    (void)snprintf(cookie, sizeof cookie, "heave=%s; HttpOnly; SameSite=Strict; Path=/%s", token,
                   m_server->certificate != NULL ? "; Secure" : "");
    return answer_text(wsi, request, HTTP_STATUS_OK, "{}", cookie);
}

static int log_out(struct lws *wsi, request_t *request)
{
    char token[ACCESS_TOKEN_MAX];
    if (find_token(wsi, token)) {
        access_logout(m_server->access, token);
    }
    return answer_text(wsi, request, HTTP_STATUS_OK, "{}", "heave=; HttpOnly; SameSite=Strict; Path=/; Max-Age=0");
}

static int send_chunk(struct lws *wsi, request_t *request)
{
    static unsigned char chunk[LWS_PRE + CHUNK];
    const size_t left = request->length - request->sent;
    const size_t length = left < CHUNK ? left : CHUNK;
    if (request->data == NULL || left == 0) {
        return 0;
    }
    memcpy(&chunk[LWS_PRE], request->data + request->sent, length);
    if (lws_write(wsi, &chunk[LWS_PRE], length, length == left ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) != (int)length) {
        return -1;
    }
    request->sent += length;
    if (request->sent == request->length) {
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    (void)lws_callback_on_writable(wsi);
    return 0;
}

static int serve_http(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    request_t *const request = user;
    switch ((int)reason) {
    case LWS_CALLBACK_HTTP:
        return begin_request(wsi, request, in);
    case LWS_CALLBACK_HTTP_BODY:
        if (request->body_length + length > sizeof request->body) {
            return -1;
        }
        memcpy(request->body + request->body_length, in, length);
        request->body_length += length;
        return 0;
    case LWS_CALLBACK_HTTP_BODY_COMPLETION:
        return strcmp(request->path, "/api/login") == 0 ? log_in(wsi, request) : log_out(wsi, request);
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return send_chunk(wsi, request);
    default:
        return lws_callback_http_dummy(wsi, reason, user, in, length);
    }
}

/* --- WebSocket --- */

static int let_in(struct lws *wsi)
{
    char path[32];
    const bool is_right = header(wsi, WSI_TOKEN_GET_URI, path, (int)sizeof path) && strcmp(path, "/ws") == 0 &&
                          is_ours(wsi, true) && role_of(wsi) >= 0 && m_viewers < VIEWERS_MAX;
    return is_right ? 0 : -1;
}

static int enter(struct lws *wsi, socket_t *socket)
{
    char address[ACCESS_ADDRESS_MAX] = "";
    char name[UPSTREAM_NAME_MAX];
    const int role = role_of(wsi);
    address_of(wsi, address);
    (void)snprintf(name, sizeof name, "%s@%s", role >= 0 ? level_name((level_t)role) : "?", address);
    socket->viewer = role >= 0 ? viewer_enter(m_server->hall, wsi, role, name) : NULL;
    m_viewers += socket->viewer != NULL;
    return socket->viewer != NULL ? 0 : -1;
}

static int hear(struct lws *wsi, viewer_t *viewer, const void *in, size_t length)
{
    if (lws_frame_is_binary(wsi) || viewer->in_length + length > sizeof viewer->in) {
        return -1; /* no message of ours */
    }
    memcpy(viewer->in + viewer->in_length, in, length);
    viewer->in_length += length;
    if (lws_remaining_packet_payload(wsi) == 0 && lws_is_final_fragment(wsi)) {
        m_server->hall->now_ms = milliseconds();
        viewer_hear(m_server->hall, viewer, viewer->in, viewer->in_length);
        viewer->in_length = 0;
    }
    return viewer->is_over ? -1 : 0;
}

static int talk(struct lws *wsi, viewer_t *viewer)
{
    message_t message;
    if (viewer->is_over) {
        return -1;
    }
    if (!viewer_take(viewer, &message)) {
        return 0;
    }
    const int sent =
        lws_write(wsi, message.data + OUTBOX_HEAD, message.length, message.is_binary ? LWS_WRITE_BINARY : LWS_WRITE_TEXT);
    free(message.data);
    if (viewer->count > 0) {
        (void)lws_callback_on_writable(wsi);
    }
    return sent < 0 ? -1 : 0;
}

static int serve_page(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    socket_t *const socket = user;
    switch ((int)reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return let_in(wsi);
    case LWS_CALLBACK_ESTABLISHED:
        return enter(wsi, socket);
    case LWS_CALLBACK_RECEIVE:
        return hear(wsi, socket->viewer, in, length);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return talk(wsi, socket->viewer);
    case LWS_CALLBACK_CLOSED:
        if (socket->viewer != NULL) {
            viewer_leave(m_server->hall, socket->viewer);
            m_viewers--;
            socket->viewer = NULL;
        }
        return 0;
    default:
        return 0;
    }
}

static void wake(viewer_t *viewer)
{
    (void)lws_callback_on_writable(viewer->handle);
}

/* --- Connections to heaved --- */

typedef struct {
    link_t *link;
} adopted_t;

static link_t *m_adopting; /* the library calls back while it takes a descriptor */

static int serve_link(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    adopted_t *const adopted = user;
    (void)in;
    (void)length;
    switch ((int)reason) {
    case LWS_CALLBACK_RAW_ADOPT_FILE:
        adopted->link = m_adopting;
        m_adopting->handle = wsi;
        return 0;
    case LWS_CALLBACK_RAW_RX_FILE:
        m_server->hall->now_ms = milliseconds();
        return adopted->link == NULL || upstream_readable(adopted->link) ? 0 : -1;
    case LWS_CALLBACK_RAW_CLOSE_FILE:
        if (adopted->link != NULL) {
            link_t *const link = adopted->link;
            adopted->link = NULL;
            upstream_closed(link);
        }
        return 0;
    default:
        return 0;
    }
}

static void watch_fd(link_t *link)
{
    lws_sock_file_fd_type descriptor;
    descriptor.filefd = link->fd;
    m_adopting = link;
    if (lws_adopt_descriptor_vhost(m_vhost, LWS_ADOPT_RAW_FILE_DESC, descriptor, "heaved", NULL) == NULL) {
        (void)close(link->fd);
        link->fd = -1;
    }
    m_adopting = NULL;
}

static void on_status(upstream_t *upstream)
{
    hall_status(m_server->hall, upstream);
}

static void on_gone(upstream_t *upstream)
{
    hall_gone(m_server->hall, upstream);
}

static void on_answer(upstream_t *upstream, const asker_t *asker, const char *line)
{
    hall_answer(m_server->hall, upstream, asker, line);
}

const upstream_calls_t server_upstream_calls = {watch_fd, on_status, on_answer, on_gone};

/* --- Time --- */

static void pump(lws_sorted_usec_list_t *list)
{
    m_server->hall->now_ms = milliseconds();
    hall_pump(m_server->hall);
    lws_sul_schedule(m_context, 0, list, pump, PUMP_US);
}

static void connect_all(lws_sorted_usec_list_t *list)
{
    for (unsigned i = 0; i < m_server->hall->platforms; i++) {
        upstream_connect(&m_server->hall->platform[i]);
    }
    lws_sul_schedule(m_context, 0, list, connect_all, CONNECT_US);
}

static void say(int level, const char *line)
{
    (void)level;
    fprintf(stderr, "heave-panel: %s", line);
}

int server_run(server_t *server)
{
    static const struct lws_protocols k_protocols[] = {
        {.name = "http", .callback = serve_http, .per_session_data_size = sizeof(request_t), .rx_buffer_size = BODY_MAX},
        {.name = PROTOCOL,
         .callback = serve_page,
         .per_session_data_size = sizeof(socket_t),
         .rx_buffer_size = VIEWER_MESSAGE_MAX},
        {.name = "heaved", .callback = serve_link, .per_session_data_size = sizeof(adopted_t)},
        {.name = NULL}};
    struct lws_context_creation_info info = {.port = server->port,
                                             .iface = server->address,
                                             .protocols = k_protocols,
                                             .ssl_cert_filepath = server->certificate,
                                             .ssl_private_key_filepath = server->key,
                                             .timeout_secs = 10,
                                             .ka_time = 10,
                                             .ka_interval = 2,
                                             .ka_probes = 3,
                                             .server_string = "heave-panel"};
    info.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS | LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND |
                   (server->certificate != NULL ? LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT : 0);
    lws_set_log_level(LLL_ERR | LLL_WARN, say);
    m_server = server;
    server->hall->wake = wake;
    m_context = lws_create_context(&info);
    m_vhost = m_context != NULL ? lws_create_vhost(m_context, &info) : NULL;
    if (m_vhost == NULL) {
        fprintf(stderr, "heave-panel: cannot listen on %s port %d\n", server->address, server->port);
        if (m_context != NULL) {
            lws_context_destroy(m_context);
        }
        return 1;
    }
    printf("heave-panel: %s://%s:%d/ for %u platform%s\n", server->certificate != NULL ? "https" : "http", server->address,
           server->port, server->hall->platforms, server->hall->platforms == 1 ? "" : "s");
    (void)fflush(stdout);
    connect_all(&m_connect);
    pump(&m_pump);
    while (*server->is_ended == 0 && lws_service(m_context, 0) >= 0) {}
    lws_context_destroy(m_context);
    return 0;
}

/* SPDX-License-Identifier: MIT
 * server.c - see server.h.
 * One thread: pages, connections to heaved and time are all events of libwebsockets' loop. Host and Origin are checked for every
 * request and every WebSocket; a name that is not ours (DNS rebinding) gets nothing.
 */
#include "panel/server.h"

#include <libwebsockets.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>
#include <unistd.h>

#include "panel/child.h"
#include "panel/connections.h"
#include "panel/door.h"
#include "panel/http.h"
#include "panel/outbox.h"

#define PROTOCOL  "heave-panel.1"
#define PUMP_US   (33 * LWS_US_PER_MS)
#define SECOND_US (1 * LWS_US_PER_SEC)
#define SAID_MAX  20u
#define SAID_MS   30000

/* One WebSocket. */
typedef struct {
    viewer_t *viewer;
} socket_t;

static server_t *m_server; /* the library's callbacks reach nothing else */
static struct lws_context *m_context;
static struct lws_vhost *m_vhost;
static lws_sorted_usec_list_t m_pump, m_second;

static int64_t milliseconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* --- WebSocket --- */

static void wake(viewer_t *viewer)
{
    if (viewer->is_over) { /* also where it does not read any more */
        lws_set_timeout(viewer->handle, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
    } else {
        (void)lws_callback_on_writable(viewer->handle);
    }
}

/* The oldest page of the lowest role below this one, which gives way to it. */
static viewer_t *page_below(int role)
{
    viewer_t *lowest = NULL;
    for (viewer_t *viewer = m_server->viewers->first; viewer != NULL; viewer = viewer->next) { /* the newest first */
        if (!viewer->is_over && viewer->role < role && (lowest == NULL || viewer->role <= lowest->role)) {
            lowest = viewer;
        }
    }
    return lowest;
}

static bool is_full(void)
{
    unsigned pages = 0;
    for (const viewer_t *viewer = m_server->viewers->first; viewer != NULL; viewer = viewer->next) {
        pages += !viewer->is_over;
    }
    return pages >= DOOR_PAGES_MAX;
}

static int let_in(struct lws *wsi)
{
    char path[32];
    const bool is_right = lws_hdr_copy(wsi, path, (int)sizeof path, WSI_TOKEN_GET_URI) > 0 && strcmp(path, "/ws") == 0 &&
                          http_refusal(wsi, true) == NULL && http_role(wsi) >= 0;
    return is_right && (!is_full() || page_below(http_role(wsi)) != NULL) ? 0 : -1;
}

static int enter(struct lws *wsi, socket_t *socket)
{
    char address[ACCESS_ADDRESS_MAX];
    char name[UPSTREAM_BY_MAX];
    const int role = http_role(wsi);
    http_peer(wsi, address);
    (void)snprintf(name, sizeof name, "%.7s@%.39s", role >= 0 ? level_name((level_t)role) : "?", address);
    viewer_t *const below = role >= 0 && is_full() ? page_below(role) : NULL;
    if (below != NULL) {
        below->is_over = true;
        wake(below);
    }
    socket->viewer = role >= 0 && !is_full() ? viewer_enter(m_server->viewers, wsi, role, name) : NULL;
    if (socket->viewer != NULL) {
        (void)http_token(wsi, socket->viewer->session);
        door_passed(wsi);
    }
    return socket->viewer != NULL ? 0 : -1;
}

static int hear(struct lws *wsi, viewer_t *viewer, const void *in, size_t length)
{
    if (lws_frame_is_binary(wsi) || viewer->in_length + length > sizeof viewer->in) {
        return -1; /* no message of ours */
    }
    if (!http_is_session(viewer->session)) {
        return -1; /* logged out elsewhere, or it has ended */
    }
    if (length > 0) {
        memcpy(viewer->in + viewer->in_length, in, length);
        viewer->in_length += length;
    }
    if (lws_remaining_packet_payload(wsi) == 0 && lws_is_final_fragment(wsi)) {
        m_server->viewers->now_ms = milliseconds();
        viewer_hear(m_server->viewers, viewer, viewer->in, viewer->in_length);
        viewer->in_length = 0;
        if (++viewer->heard >= VIEWER_HEARD_MAX) { /* so that a page that asks without end holds up nobody's ticks */
            (void)lws_rx_flow_control(wsi, 0);
        }
    }
    return viewer->is_over ? -1 : 0;
}

static int talk(struct lws *wsi, viewer_t *viewer)
{
    message_t message;
    if (viewer->is_over) {
        return -1;
    }
    if (!outbox_pop(viewer, &message)) {
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
            viewer_leave(m_server->viewers, socket->viewer);
            socket->viewer = NULL;
        }
        return 0;
    default:
        return 0;
    }
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
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return -1; /* nobody's WebSocket: a client names its protocol */
    case LWS_CALLBACK_RAW_ADOPT_FILE:
        adopted->link = m_adopting;
        m_adopting->handle = wsi;
        return 0;
    case LWS_CALLBACK_RAW_RX_FILE:
        m_server->viewers->now_ms = milliseconds();
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
    viewers_status(m_server->viewers, upstream);
}

static void on_gone(upstream_t *upstream)
{
    viewers_gone(m_server->viewers, upstream);
}

static void on_answer(upstream_t *upstream, const asker_t *asker, const char *line)
{
    viewers_answer(m_server->viewers, upstream, asker, line);
}

const upstream_calls_t server_upstream_calls = {watch_fd, on_status, on_answer, on_gone};

/* --- Programs that work for a page --- */

typedef struct {
    child_t *child;
} watched_t;

static child_t *m_watching; /* as m_adopting */

static int serve_child(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    watched_t *const watched = user;
    (void)in;
    (void)length;
    switch ((int)reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return -1; /* as in serve_link() */
    case LWS_CALLBACK_RAW_ADOPT_FILE:
        watched->child = m_watching;
        m_watching->handle = wsi;
        return 0;
    case LWS_CALLBACK_RAW_RX_FILE:
        return watched->child == NULL || child_readable(watched->child) ? 0 : -1;
    case LWS_CALLBACK_RAW_CLOSE_FILE:
        if (watched->child != NULL) {
            child_t *const child = watched->child;
            watched->child = NULL;
            child_closed(child);
        }
        return 0;
    default:
        return 0;
    }
}

static void watch_child(child_t *child)
{
    lws_sock_file_fd_type descriptor;
    descriptor.filefd = child->fd;
    m_watching = child;
    if (lws_adopt_descriptor_vhost(m_vhost, LWS_ADOPT_RAW_FILE_DESC, descriptor, "child", NULL) == NULL) {
        (void)close(child->fd);
        child_closed(child);
    }
    m_watching = NULL;
}

/* --- Connections of browsers --- */

/* Of every connection, as the library's first protocol. */
static int serve_http(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    if (reason == LWS_CALLBACK_WSI_DESTROY) {
        door_passed(wsi);
        return 0;
    }
    if (reason == LWS_CALLBACK_HTTP_CONFIRM_UPGRADE) {
        return in != NULL && strcasecmp(in, "websocket") == 0 ? 0 : -1; /* HTTP/2 has many requests for each connection */
    }
    return http_serve(wsi, reason, user, in, length);
}

/* --- Time --- */

/* To pages that have had their turn. */
static void listen_again(void)
{
    door_turn();
    for (viewer_t *viewer = m_server->viewers->first; viewer != NULL; viewer = viewer->next) {
        if (viewer->heard >= VIEWER_HEARD_MAX) {
            (void)lws_rx_flow_control(viewer->handle, 1);
        }
        viewer->heard = 0;
    }
}

static void pump(lws_sorted_usec_list_t *list)
{
    m_server->viewers->now_ms = milliseconds();
    viewers_pump(m_server->viewers);
    listen_again();
    lws_sul_schedule(m_context, 0, list, pump, PUMP_US);
}

/* Who has logged out elsewhere, or whose session has ended, is out here too. */
static void end_sessions(void)
{
    for (viewer_t *viewer = m_server->viewers->first; viewer != NULL; viewer = viewer->next) {
        if (!viewer->is_over && !http_is_session(viewer->session)) {
            viewer->is_over = true;
            wake(viewer);
        }
    }
}

static void each_second(lws_sorted_usec_list_t *list)
{
    end_sessions();
    child_watch_time(milliseconds());
    for (unsigned i = 0; i < m_server->viewers->platforms; i++) {
        upstream_connect(&m_server->viewers->platform[i]);
    }
    lws_sul_schedule(m_context, 0, list, each_second, SECOND_US);
}

/* Strangers do not fill the log. */
static void say(int level, const char *line)
{
    static unsigned said, left_out;
    static int64_t since_ms;
    const int64_t now_ms = milliseconds();
    (void)level;
    if (now_ms - since_ms >= SAID_MS) {
        if (left_out > 0) {
            fprintf(stderr, "heave-panel: %u lines before this one were left out\n", left_out);
        }
        since_ms = now_ms;
        said = left_out = 0;
    }
    if (said < SAID_MAX) {
        said++;
        fprintf(stderr, "heave-panel: %s", line);
    } else {
        left_out++;
    }
}

static bool make_context(const server_t *server)
{
    static const struct lws_protocols k_protocols[] = {
        {.name = "http", .callback = serve_http, .per_session_data_size = sizeof(request_t), .rx_buffer_size = HTTP_BODY_MAX},
        {.name = PROTOCOL,
         .callback = serve_page,
         .per_session_data_size = sizeof(socket_t),
         .rx_buffer_size = VIEWER_MESSAGE_MAX},
        {.name = "heaved", .callback = serve_link, .per_session_data_size = sizeof(adopted_t)},
        {.name = "child", .callback = serve_child, .per_session_data_size = sizeof(watched_t)},
        {.name = "listener", .callback = door_serve},
        {.name = NULL}};
    struct lws_context_creation_info info = {.port = CONTEXT_PORT_NO_LISTEN_SERVER,
                                             .protocols = k_protocols,
                                             .ssl_cert_filepath = server->certificate,
                                             .ssl_private_key_filepath = server->key,
                                             .timeout_secs = 10,
                                             .max_http_header_data = HTTP_HEAD_MAX,
                                             .max_http_header_pool = CONNECTIONS_MAX,
                                             .server_string = "heave-panel",
                                             .alpn = "http/1.1"};
    info.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS | (server->certificate != NULL ? LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT : 0);
    m_context = lws_create_context(&info);
    m_vhost = m_context != NULL ? lws_create_vhost(m_context, &info) : NULL;
    if (m_vhost == NULL) {
        fprintf(stderr, "heave-panel: the certificate or its key cannot be used, or there is no memory\n");
    }
    return m_vhost != NULL && door_open(m_vhost, server);
}

bool server_open(server_t *server)
{
    lws_set_log_level(LLL_ERR | LLL_WARN, say);
    m_server = server;
    http_init(server);
    child_watch = watch_child;
    server->viewers->wake = wake;
    if (!door_has_descriptors() || !make_context(server)) {
        server_close();
        return false;
    }
    printf("heave-panel: %s://%s:%d/ for %u platform%s\n", server->certificate != NULL ? "https" : "http", server->where->host,
           server->where->port, server->viewers->platforms, server->viewers->platforms == 1 ? "" : "s");
    (void)fflush(stdout);
    each_second(&m_second);
    pump(&m_pump);
    return true;
}

bool server_turn(bool waits)
{
    return lws_service(m_context, waits ? 0 : -1) >= 0;
}

void server_close(void)
{
    if (m_context != NULL) {
        lws_context_destroy(m_context);
    }
    m_context = NULL;
}

/* SPDX-License-Identifier: MIT
 * door.c - see door.h.
 */
#include "panel/door.h"

#include <errno.h>
#include <stdio.h>
#include <sys/resource.h>
#include <unistd.h>

#include "panel/connections.h"

#define ACCEPTS_MAX 16u /* at a time: pages that are there have their turn between */
#define WHY_MAX     256u

/* A connection may be sending a file; a platform has its links and its samples; the rest is the library's, children's and room.
 */
#define DESCRIPTORS (CONNECTIONS_MAX * 2u + DOOR_PAGES_MAX + VIEWER_PLATFORMS * 6u + 64u)

static const server_t *m_server; /* the library's callbacks reach nothing else */
static struct lws_vhost *m_vhost;
static struct lws *m_listener;
static connections_t m_connections; /* that are no pages */
static bool m_is_waiting;           /* nothing was left for one more */

bool door_has_descriptors(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0) {
        return true;
    }
    if (limit.rlim_max < DESCRIPTORS) {
        fprintf(stderr, "heave-panel: it needs %u file descriptors, and may have %llu (ulimit -n, LimitNOFILE=)\n", DESCRIPTORS,
                (unsigned long long)limit.rlim_max);
        return false;
    }
    if (limit.rlim_cur < DESCRIPTORS) {
        limit.rlim_cur = DESCRIPTORS;
        (void)setrlimit(RLIMIT_NOFILE, &limit); /* where a sandbox forbids it, new connections wait for those that end */
    }
    return true;
}

bool door_open(struct lws_vhost *vhost, const server_t *server)
{
    char why[WHY_MAX] = "";
    lws_sock_file_fd_type descriptor = {.filefd = listener_open(server->where, why, sizeof why)};
    if (descriptor.filefd < 0) {
        fprintf(stderr, "heave-panel: %s\n", why);
        return false;
    }
    m_server = server;
    m_vhost = vhost;
    m_listener = lws_adopt_descriptor_vhost(vhost, LWS_ADOPT_RAW_FILE_DESC, descriptor, "listener", NULL);
    return m_listener != NULL;
}

static void accept_one(int fd, const listener_peer_t *peer)
{
    void *const oldest = connections_give_way(&m_connections);
    if (oldest != NULL) {
        connections_remove(&m_connections, oldest);
        lws_set_timeout(oldest, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
    }
    struct lws *const wsi = lws_adopt_socket_vhost(m_vhost, fd);
    if (wsi != NULL) {
        connections_add(&m_connections, wsi, connections_network(peer->address));
    }
}

/* Where nothing is left for one more, the kernel goes on telling who waits. Not before the next turn, so that pages that are
 * there have the processor. */
static void wait_a_turn(void)
{
    if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
        m_is_waiting = true;
        (void)lws_rx_flow_control(m_listener, 0);
    }
}

void door_turn(void)
{
    if (m_is_waiting) {
        m_is_waiting = false;
        (void)lws_rx_flow_control(m_listener, 1);
    }
}

static void accept_all(int listening)
{
    listener_peer_t peer;
    for (unsigned i = 0; i < ACCEPTS_MAX; i++) {
        const int fd = listener_accept(listening, &peer);
        if (fd < 0) {
            wait_a_turn();
            return;
        }
        if (m_server->access->has_password || peer.is_this_machine) {
            accept_one(fd, &peer);
        } else {
            (void)close(fd);
        }
    }
}

int door_serve(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    (void)user;
    (void)in;
    (void)length;
    switch ((int)reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return -1; /* nobody's WebSocket: a client names its protocol */
    case LWS_CALLBACK_RAW_RX_FILE:
        accept_all(lws_get_socket_fd(wsi));
        return 0;
    default:
        return 0;
    }
}

void door_passed(const struct lws *wsi)
{
    connections_remove(&m_connections, wsi);
}

/* SPDX-License-Identifier: MIT
 * control.c - the control socket: who gets a place at it, and what poll found; see control.h.
 */
#include "service/control.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/message.h"
#include "service/control_client.h"
#include "service/control_requests.h"
#include "service/control_results.h"
#include "service/control_socket.h"

#define WAITING_POLL_MS 1

int control_timeout_ms(const control_t *self, uint64_t now_us, int at_most_ms)
{
    int timeout_ms = at_most_ms;
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        const control_client_t *client = &self->client[i];
        if (client->fd < 0) {
            continue;
        }
        if (client->request_id != 0) {
            return WAITING_POLL_MS;
        }
        if (client->watch_period_us != 0) {
            const uint64_t left_us = client->watch_next_us > now_us ? client->watch_next_us - now_us : 0;
            const int left_ms = (int)(left_us / 1000) + 1;
            timeout_ms = left_ms < timeout_ms ? left_ms : timeout_ms;
        }
    }
    return timeout_ms;
}

/* --- Connections --- */

/* In the order in which clients give way. */
typedef enum { IDLE, WATCHES, TALKS, WAITS_FOR_DISK, STAYS } eviction_rank_t;

/* Who waits for the motion thread stays, for a moment. Not so for the disk: that may take a minute. */
static eviction_rank_t eviction_rank(const control_client_t *client, uint64_t now_us)
{
    if (client->request_id != 0 || now_us - client->came_us < CONTROL_GRACE_US) {
        return STAYS;
    }
    if (client->dump_ticket != 0 || client->is_configuring) {
        return WAITS_FOR_DISK;
    }
    if (client->watch_period_us != 0) {
        return WATCHES;
    }
    return now_us - client->asked_us >= CONTROL_IDLE_US ? IDLE : TALKS;
}

/* Of those that matter least, the one that has not asked for longest; NULL: all stay. */
static control_client_t *find_least(control_t *self, bool is_among_lookers, uint64_t now_us)
{
    control_client_t *least = NULL;
    eviction_rank_t least_rank = STAYS;
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        control_client_t *client = &self->client[i];
        const eviction_rank_t its = client->is_looker || !is_among_lookers ? eviction_rank(client, now_us) : STAYS;
        if (its < least_rank || (its == least_rank && least != NULL && client->asked_us < least->asked_us)) {
            least = client;
            least_rank = its;
        }
    }
    return least;
}

static void give_way(control_client_t *client)
{
    const bool is_dumping = client->dump_ticket != 0;
    control_client_answer_error(
        client, is_dumping ? CONTROL_DUMP_LATER : "too many clients: this one had to give way to a newer one", NULL);
    if (client->fd >= 0) {
        control_client_drop(client);
    }
}

/* The second socket has a few places at most, so that who may do more than look always finds one. */
static control_client_t *find_free(control_t *self, bool is_looker)
{
    unsigned lookers = 0;
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        lookers += self->client[i].fd >= 0 && self->client[i].is_looker;
    }
    if (is_looker && lookers >= CONTROL_LOOKERS) {
        return NULL;
    }
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        if (self->client[i].fd < 0) {
            return &self->client[i];
        }
    }
    return NULL;
}

/* A place for a newcomer; NULL: there is none yet. */
static control_client_t *make_room(control_t *self, bool is_looker, uint64_t now_us)
{
    control_client_t *client = find_free(self, is_looker);
    if (client != NULL) {
        return client;
    }
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) { /* who has asked, or gone, since the poll */
        if (control_requests_is_reading(&self->client[i])) {
            control_requests_receive(self, &self->client[i], now_us);
        }
    }
    client = find_free(self, is_looker);
    if (client == NULL) {
        client = find_least(self, is_looker, now_us);
        if (client != NULL) {
            give_way(client);
        }
    }
    return client;
}

/* Whoever waits outside. Where the system has no descriptor left, who matters least gives one back, and it is tried again. */
static void let_in(control_t *self, unsigned at, uint64_t now_us)
{
    control_socket_t *listening = &self->socket[at];
    const bool was_shut = listening->is_shut;
    listening->newcomer_us = listening->looked_us;
    listening->newcomer = accept4(listening->fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    listening->looked_us = listening->newcomer < 0 && errno == EAGAIN ? self->polled_us : listening->looked_us;
    listening->is_shut = listening->newcomer < 0 && errno != EAGAIN && errno != EINTR && errno != ECONNABORTED;
    control_client_t *least = listening->is_shut && !was_shut ? find_least(self, at > 0, now_us) : NULL;
    if (least != NULL) {
        give_way(least);
    }
}

/* A newcomer for whom there is no room yet waits for it. Returns false: nobody was let in. */
static bool accept_connection(control_t *self, unsigned at, uint64_t now_us)
{
    control_socket_t *listening = &self->socket[at];
    if (listening->newcomer < 0) {
        let_in(self, at, now_us);
    }
    control_client_t *client = listening->newcomer >= 0 ? make_room(self, at > 0, now_us) : NULL;
    if (client == NULL) {
        return false;
    }
    client->fd = listening->newcomer;
    client->looked_us = listening->newcomer_us;
    listening->newcomer = -1;
    client->is_looker = at > 0;
    client->is_logged = false;
    client->entry.by[0] = '\0';
    client->peer = levels_peer(&self->levels, client->fd);
    client->peer.level = client->is_looker ? LEVEL_LOOK : client->peer.level;
    client->in_length = 0;
    client->out_length = 0;
    client->is_closing = false;
    client->passing = -1;
    client->received = -1;
    client->is_configuring = false;
    client->request_id = 0;
    client->dump_ticket = 0;
    client->watch_period_us = 0;
    client->came_us = client->asked_us = now_us;
    client->is_gone = false;
    client->void_bytes = 0;
    if (listening->newcomer_us < self->held_us) {
        control_client_void(client);
    }
    return true;
}

/* Who came while heaved was starting counts as come when it first looks. */
void control_fill(control_t *self, struct pollfd fds[CONTROL_FDS], uint64_t now_us)
{
    self->polled_us = now_us;
    for (unsigned at = 0; at < CONTROL_SOCKETS; at++) { /* poll would not wait while nobody is let in */
        control_socket_t *listening = &self->socket[at];
        const bool is_open = listening->newcomer < 0 && !listening->is_shut;
        listening->looked_us = listening->looked_us == 0 ? now_us : listening->looked_us;
        fds[at] = (struct pollfd){.fd = is_open ? listening->fd : -1, .events = is_open ? POLLIN : 0};
    }
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        const control_client_t *client = &self->client[i];
        const short events = (short)((control_requests_is_reading(client) ? POLLIN : 0) | (client->out_length > 0 ? POLLOUT : 0));
        fds[i + CONTROL_SOCKETS] = (struct pollfd){.fd = client->fd, .events = events};
    }
}

static void serve_client(control_t *self, control_client_t *client, const struct pollfd *found, uint64_t now_us)
{
    const bool is_silent = (found->events & POLLIN) != 0 && (found->revents & POLLIN) == 0;
    client->looked_us = is_silent ? self->polled_us : client->looked_us;
    if (client->fd >= 0 && (found->revents & POLLOUT) != 0) {
        control_client_send(client);
    }
    if (client->fd >= 0 && (found->revents & POLLIN) != 0) {
        control_requests_receive(self, client, now_us);
    }
    if (client->fd >= 0) {
        control_requests_serve_time(self, client, now_us);
    }
    if (client->fd >= 0 && (client->is_gone || (found->revents & (POLLHUP | POLLERR)) != 0)) {
        control_requests_end(self, client, now_us);
    }
}

static void serve_socket(control_t *self, unsigned at, const struct pollfd *found, uint64_t now_us)
{
    control_socket_t *listening = &self->socket[at];
    const bool has_come = (found->revents & POLLIN) != 0;
    listening->looked_us = (found->events & POLLIN) != 0 && !has_come ? self->polled_us : listening->looked_us;
    bool is_going_on = has_come || listening->newcomer >= 0 || listening->is_shut;
    for (unsigned i = 0; i < CONTROL_CLIENTS && is_going_on; i++) {
        is_going_on = accept_connection(self, at, now_us);
    }
}

void control_serve(control_t *self, const struct pollfd fds[CONTROL_FDS], uint64_t now_us)
{
    (void)seqlock_read(&self->handover->view, self->view.word); /* the last view stays where there is no new one */
    if (self->view.view.own_holds != self->own_holds) {
        self->own_holds = self->view.view.own_holds;
        control_requests_void(self, NULL, now_us);
    }
    control_results_pop(self);
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        serve_client(self, &self->client[i], &fds[i + CONTROL_SOCKETS], now_us);
    }
    for (unsigned at = 0; at < CONTROL_SOCKETS; at++) {
        serve_socket(self, at, &fds[at], now_us);
    }
}

/* --- Open and close --- */

void control_init(control_t *self)
{
    self->samples_fd = -1;
    for (unsigned at = 0; at < CONTROL_SOCKETS; at++) {
        self->socket[at].fd = -1;
        self->socket[at].newcomer = -1;
        self->socket[at].is_shut = false;
    }
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        self->client[i].fd = -1;
        self->client[i].received = -1;
        self->client[i].control = self;
    }
}

int control_open(control_t *self, const char *path, const config_t *config, handover_t *handover, blackbox_t *blackbox,
                 operator_log_t *log)
{
    control_init(self);
    self->config = config;
    self->handover = handover;
    self->blackbox = blackbox;
    self->log = log;
    self->mistakes_stream = fmemopen(self->mistakes, sizeof self->mistakes - 1u, "w"); /* now: nothing is allocated later */
    if (self->mistakes_stream == NULL) {
        return print_message(EXIT_UNAVAILABLE, "no memory");
    }
    (void)setvbuf(self->mistakes_stream, NULL, _IONBF, 0);
    int code = levels_open(&self->levels, config);
    code = code == EXIT_DONE ? control_socket_open(&self->socket[0], path, 0660) : code;
    if (code == EXIT_DONE && strcmp(config->look_socket, "none") != 0) {
        code = control_socket_open(&self->socket[1], config->look_socket, 0666);
    }
    return code;
}

void control_close(control_t *self)
{
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        if (self->client[i].fd >= 0) {
            control_client_send(&self->client[i]);
        }
        if (self->client[i].fd >= 0) {
            control_client_drop(&self->client[i]);
        }
    }
    for (unsigned at = 0; at < CONTROL_SOCKETS; at++) {
        control_socket_close(&self->socket[at]);
    }
    if (self->mistakes_stream != NULL) {
        (void)fclose(self->mistakes_stream);
        self->mistakes_stream = NULL;
    }
}

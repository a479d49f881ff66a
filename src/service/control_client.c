/* SPDX-License-Identifier: MIT
 * control_client.c - see control_client.h.
 */
#include "service/control_client.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "common/translate.h"
#include "service/operator_requests.h"
#include "service/service_json.h"

const snapshot_t *control_snapshot(const control_t *self)
{
    return &self->view.view.snapshot;
}

state_t control_state(const control_t *self)
{
    return control_snapshot(self)->state;
}

static void log_it(control_client_t *client, const char *error, state_t after, bool is_refused)
{
    if (client->is_logged) {
        client->is_logged = false;
        client->entry.is_refused = is_refused;
        (void)snprintf(client->entry.answer, sizeof client->entry.answer, "%s", error);
        client->entry.after = after;
        operator_log_add(client->control->log, &client->entry);
    }
}

/* What became of a request, for the operator log. Once for each. */
void control_client_log(control_client_t *client, const char *error, state_t after)
{
    log_it(client, error, after, error[0] != '\0');
}

/* What was handed over is carried out, whoever has gone. */
void control_client_log_gone(control_client_t *client)
{
    const bool is_handed_over = control_client_is_waiting(client);
    log_it(client,
           is_handed_over ? "under way; the client has gone before it was answered" : "the client has gone before it was asked",
           client->entry.before, !is_handed_over);
}

void control_client_drop(control_client_t *client)
{
    control_client_log_gone(client);
    (void)close(client->fd);
    client->fd = -1;
    control_client_forget_received(client);
}

void control_client_forget_received(control_client_t *client)
{
    if (client->received >= 0) {
        (void)close(client->received);
    }
    client->received = -1;
}

ssize_t control_client_receive(control_client_t *client)
{
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(sizeof(int))];
    } passed;
    struct iovec bytes = {&client->in[client->in_length], sizeof client->in - client->in_length};
    struct msghdr message = {
        .msg_iov = &bytes, .msg_iovlen = 1, .msg_control = passed.bytes, .msg_controllen = CMSG_LEN(sizeof(int))};
    /* Room for one; in CMSG_SPACE two would fit. The kernel closes what does not. */
    const ssize_t received = recvmsg(client->fd, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    const struct cmsghdr *const head = received > 0 ? CMSG_FIRSTHDR(&message) : NULL;
    if (head != NULL && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_RIGHTS) {
        control_client_forget_received(client);
        memcpy(&client->received, CMSG_DATA(head), sizeof(int));
    }
    return received;
}

bool control_client_is_waiting(const control_client_t *client)
{
    return client->request_id != 0 || client->dump_ticket != 0 || client->is_configuring;
}

/* Sends bytes, and with the first of them a descriptor that is due. */
static ssize_t send_bytes(control_client_t *client)
{
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(sizeof(int))];
    } passed;
    struct iovec bytes = {client->out, client->out_length};
    struct msghdr message = {.msg_iov = &bytes, .msg_iovlen = 1};
    if (client->passing >= 0) {
        memset(&passed, 0, sizeof passed);
        message.msg_control = passed.bytes;
        message.msg_controllen = sizeof passed.bytes;
        struct cmsghdr *header = CMSG_FIRSTHDR(&message);
        header->cmsg_level = SOL_SOCKET;
        header->cmsg_type = SCM_RIGHTS;
        header->cmsg_len = CMSG_LEN(sizeof(int));
        memcpy(CMSG_DATA(header), &client->passing, sizeof(int));
    }
    const ssize_t sent = sendmsg(client->fd, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
    client->passing = sent > 0 ? -1 : client->passing;
    return sent;
}

/* Sends what the socket takes now. */
void control_client_send(control_client_t *client)
{
    if (client->out_length == 0) {
        return;
    }
    const ssize_t sent = send_bytes(client);
    if (sent < 0) {
        if (errno != EAGAIN && errno != EINTR) {
            client->is_gone = true;
            client->out_length = 0;
        }
        return;
    }
    client->out_length -= (size_t)sent;
    memmove(client->out, &client->out[sent], client->out_length);
    if (client->out_length == 0 && client->is_closing && !control_client_is_waiting(client)) {
        control_client_drop(client);
    }
}

/* Queues a complete answer. A client that has not read the last ones is dropped: it would get half an answer. */
void control_client_answer(control_client_t *client, json_t *json)
{
    json_newline(json);
    client->is_gone |= json->is_cut;
    if (client->is_gone) {
        client->out_length = 0;
        client->passing = -1;
        return;
    }
    client->out_length += json->length;
    control_client_send(client);
}

json_t control_client_start_answer(control_client_t *client)
{
    json_t json;
    json_start(&json, &client->out[client->out_length], sizeof client->out - client->out_length);
    return json;
}

/* For who has just asked for it. */
static const char k_slow[] = N_(
    "nobody has seen this machine rise as it is configured now: it rises at a tenth of engage speed. Look whether it stands and "
    "moves as it should; then `heavectl commissioned`");

void control_client_answer_done(control_client_t *client, const snapshot_t *snapshot)
{
    control_client_log(client, "", snapshot->state);
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(snapshot->state));
    if (client->request == EVENT_ENGAGE && client->control->lost.is_slow) {
        json_text(&json, "notice", k_slow);
    }
    if (client->request == OPERATOR_INTENSITY) {
        json_number(&json, "intensity_percent", snapshot->intensity_percent);
    }
    json_close(&json, '}');
    control_client_answer(client, &json);
}

/* Of a request by hand: as good or as bad as it was, with the newest tick. */
void control_client_answer_service(control_client_t *client, const motion_result_t *result)
{
    char error[160];
    const bool is_done = result->answer == SERVICE_DONE;
    (void)snprintf(error, sizeof error, "%s%s%s", is_done ? "" : service_verb_name(client->service.verb), is_done ? "" : ": ",
                   service_answer_text(result->answer));
    control_client_log(client, error, result->snapshot.state);
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", is_done);
    if (!is_done) {
        json_text(&json, "error", error);
        json_text(&json, "why", service_answer_name(result->answer));
    }
    json_text(&json, "state", state_name(result->snapshot.state));
    service_json_hand(&json, &result->snapshot);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

static json_t start_no(control_client_t *client, const char *error, const char *why, const char *state)
{
    control_client_log(client, error, control_state(client->control));
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", false);
    json_text(&json, "error", error);
    if (why != NULL) {
        json_text(&json, "why", why);
    }
    if (state != NULL) {
        json_text(&json, "state", state);
    }
    return json;
}

static void answer_no(control_client_t *client, const char *error, const char *why, const char *state)
{
    json_t json = start_no(client, error, why, state);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

void control_client_answer_not_ready(control_client_t *client, const char *error, const snapshot_t *snapshot)
{
    json_t json = start_no(client, error, "not-ready", state_name(snapshot->state));
    json_number(&json, "tick", snapshot->service.tick_us);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

void control_client_answer_error(control_client_t *client, const char *error, const char *state)
{
    answer_no(client, error, NULL, state);
}

void control_client_answer_stale(control_client_t *client)
{
    char error[160];
    (void)snprintf(error, sizeof error, N_("%.20s: asked more than 1 s ago, so it is not done any more: ask again"),
                   client->entry.request);
    answer_no(client, error, service_answer_name(SERVICE_STALE), state_name(control_state(client->control)));
}

void control_client_answer_void(control_client_t *client)
{
    char error[160];
    (void)snprintf(error, sizeof error, N_("%.20s: a hold came after it was asked, so it is not done: ask again"),
                   client->entry.request);
    answer_no(client, error, "held", state_name(control_state(client->control)));
}

void control_client_void(control_client_t *client)
{
    int waiting = 0;
    (void)ioctl(client->fd, FIONREAD, &waiting);
    client->void_bytes = client->in_length + (size_t)waiting;
}

bool control_client_has_gone(const control_client_t *client)
{
    struct pollfd look = {.fd = client->fd};
    return poll(&look, 1, 0) > 0 && (look.revents & (POLLHUP | POLLERR)) != 0;
}

void control_client_answer_status(control_t *self, control_client_t *client)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_REALTIME, &now);
    self->lost.unix_ms = (uint64_t)now.tv_sec * 1000u + (uint64_t)now.tv_nsec / 1000000u;
    json_t json = control_client_start_answer(client);
    status_json_write(&json, &self->view.view, self->config, &self->lost, &self->handover->times);
    control_client_answer(client, &json);
}

void control_client_answer_dumped(control_client_t *client, const char *folder)
{
    control_client_log(client, "", control_state(client->control));
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "folder", folder);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

/* SPDX-License-Identifier: MIT
 * control.c - the control socket; see control.h.
 */
#include "service/control.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "common/message.h"
#include "record/service_words.h"
#include "service/operator_requests.h"
#include "service/service_json.h"

#define BACKLOG         8
#define ANSWER_US       1000000u  /* the motion thread answers within a cycle or two */
#define DUMP_US         50000000u /* heavectl waits a little longer */
#define RESET_US        2500000u  /* a reset takes effect when the drives say so */
#define WAITING_POLL_MS 1

static const char k_unapproved[] =
    "the configuration %s is not the one that was approved (%s): `heavectl acknowledge` lets it move until "
    "heaved ends, [platform] approved for good";
static const char k_untested[] =
    "a self-test is due: `heavectl selftest`, with nobody on board, has to pass today with this configuration";
static const char k_acknowledge[] = "acknowledge";
static const char k_selftest[] = "selftest";
static const char k_dump_later[] = "dump: the disk has not taken it yet; heaved goes on trying";

/* --- Answers --- */

static control_client_t *find_client(control_t *self, uint32_t request_id)
{
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        if (self->client[i].fd >= 0 && self->client[i].request_id == request_id) {
            return &self->client[i];
        }
    }
    return NULL;
}

/* What became of a request, for the operator log. Once for each. */
static void log_answer(control_client_t *client, const char *error, state_t after)
{
    if (client->is_logged) {
        client->is_logged = false;
        (void)snprintf(client->entry.answer, sizeof client->entry.answer, "%s", error);
        client->entry.after = after;
        operator_log_add(client->control->log, &client->entry);
    }
}

static void drop(control_client_t *client)
{
    log_answer(client, "the client has gone before it was answered", client->entry.before);
    (void)close(client->fd);
    client->fd = -1;
}

static bool is_waiting(const control_client_t *client)
{
    return client->request_id != 0 || client->dump_ticket != 0;
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
    if (client->is_passing) {
        memset(&passed, 0, sizeof passed);
        message.msg_control = passed.bytes;
        message.msg_controllen = sizeof passed.bytes;
        struct cmsghdr *header = CMSG_FIRSTHDR(&message);
        header->cmsg_level = SOL_SOCKET;
        header->cmsg_type = SCM_RIGHTS;
        header->cmsg_len = CMSG_LEN(sizeof(int));
        memcpy(CMSG_DATA(header), &client->control->samples_fd, sizeof(int));
    }
    const ssize_t sent = sendmsg(client->fd, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
    client->is_passing = client->is_passing && sent <= 0;
    return sent;
}

/* Sends what the socket takes now. */
static void send_out(control_client_t *client)
{
    if (client->out_length == 0) {
        return;
    }
    const ssize_t sent = send_bytes(client);
    if (sent < 0) {
        if (errno != EAGAIN && errno != EINTR) {
            drop(client);
        }
        return;
    }
    client->out_length -= (size_t)sent;
    memmove(client->out, &client->out[sent], client->out_length);
    if (client->out_length == 0 && client->is_closing && !is_waiting(client)) {
        drop(client);
    }
}

/* Queues a complete answer. A client that has not read the last ones is dropped: it would get half an answer. */
static void answer(control_client_t *client, json_t *json)
{
    json_newline(json);
    if (json->is_cut) {
        drop(client);
        return;
    }
    client->out_length += json->length;
    send_out(client);
}

static json_t start_answer(control_client_t *client)
{
    json_t json;
    json_start(&json, &client->out[client->out_length], sizeof client->out - client->out_length);
    return json;
}

static void answer_done(control_client_t *client, const snapshot_t *snapshot)
{
    log_answer(client, "", snapshot->state);
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(snapshot->state));
    if (client->request == OPERATOR_INTENSITY) {
        json_number(&json, "intensity_percent", snapshot->intensity_percent);
    }
    json_close(&json, '}');
    answer(client, &json);
}

/* Of a request by hand: as good or as bad as it was, with the newest tick. */
static void answer_service(control_client_t *client, const motion_result_t *result)
{
    char error[160];
    const bool is_done = result->answer == SERVICE_DONE;
    (void)snprintf(error, sizeof error, "%s%s%s", is_done ? "" : service_verb_name(client->service.verb), is_done ? "" : ": ",
                   service_answer_text(result->answer));
    log_answer(client, error, result->snapshot.state);
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", is_done);
    if (!is_done) {
        json_text(&json, "error", error);
        json_text(&json, "why", service_answer_name(result->answer));
    }
    json_text(&json, "state", state_name(result->snapshot.state));
    service_json_hand(&json, &result->snapshot);
    json_close(&json, '}');
    answer(client, &json);
}

static void answer_error(control_client_t *client, const char *error, const char *state)
{
    log_answer(client, error, control_state(client->control));
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", false);
    json_text(&json, "error", error);
    if (state != NULL) {
        json_text(&json, "state", state);
    }
    json_close(&json, '}');
    answer(client, &json);
}

static void answer_status(control_t *self, control_client_t *client)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_REALTIME, &now);
    self->lost.unix_ms = (uint64_t)now.tv_sec * 1000u + (uint64_t)now.tv_nsec / 1000000u;
    json_t json = start_answer(client);
    status_json_write(&json, &self->view.view, self->config, &self->lost, &self->handover->times);
    answer(client, &json);
}

/* --- Requests --- */

static const snapshot_t *snapshot_of(const control_t *self)
{
    return &self->view.view.snapshot;
}

static void refuse(const control_t *self, control_client_t *client, const snapshot_t *snapshot, bool is_shutting_down)
{
    char error[256];
    if (client->request == OPERATOR_INTENSITY) {
        (void)operator_explain_percent(client->number, self->config->settings.intensity_max_percent, error, sizeof error);
    } else {
        (void)operator_explain(client->request, snapshot, is_shutting_down, error, sizeof error);
    }
    answer_error(client, error, state_name(snapshot->state));
}

/* Hands a request to the motion thread; the answer follows.
 * @param content what it asks for, without its id */
static void hand_over(control_t *self, control_client_t *client, const motion_request_t *content, uint64_t now_us)
{
    const event_t event = (event_t)content->event;
    motion_request_t request = *content;
    self->last_id += self->last_id == UINT32_MAX ? 2 : 1; /* 0 means none */
    request.id = self->last_id;
    if (!ring_push(&self->handover->requests, &request, sizeof request, NULL, 0)) {
        answer_error(client, "heaved is busy: try again", NULL);
        return;
    }
    client->request_id = self->last_id;
    client->request = event;
    client->number = request.number;
    client->service = request.service;
    client->is_accepted = false;
    client->answer_by_us = now_us + (event == EVENT_RESET ? RESET_US : ANSWER_US);
}

static void begin_request(control_t *self, control_client_t *client, event_t event, uint32_t number, uint64_t now_us)
{
    hand_over(self, client, &(motion_request_t){.event = (uint32_t)event, .number = number}, now_us);
}

/* By hand. What is held gets the number of its series here. */
static void begin_service(control_t *self, control_client_t *client, const char *line, uint64_t now_us)
{
    motion_request_t request = {.event = OPERATOR_SERVICE};
    const char *why = service_words_read(line, strlen(line), false, &request.service, &request.tick_us);
    if (why != NULL) {
        answer_error(client, why, state_name(snapshot_of(self)->state));
        return;
    }
    if (service_is_held(request.service.verb)) {
        request.service.series = ++self->last_series;
    }
    hand_over(self, client, &request, now_us);
}

static void begin_intensity(control_t *self, control_client_t *client, const char *argument, uint64_t now_us)
{
    uint32_t percent = 0;
    if (operator_read_percent(argument, &percent)) {
        begin_request(self, client, OPERATOR_INTENSITY, percent, now_us);
    } else {
        answer_error(client, "intensity: a whole number of percent is needed, as in `intensity 50`", NULL);
    }
}

static bool is_digits(const char *text)
{
    return text[0] != '\0' && strspn(text, "0123456789") == strlen(text) && strlen(text) <= 3;
}

/* "watch" or "watch HZ". */
static bool begin_watch(control_client_t *client, const char *argument, uint64_t now_us)
{
    unsigned hz = CONTROL_WATCH_HZ;
    if (argument[0] == ' ') {
        argument++;
        if (!is_digits(argument)) {
            return false;
        }
        for (hz = 0; *argument != '\0'; argument++) {
            hz = hz * 10 + (unsigned)(*argument - '0');
        }
    } else if (argument[0] != '\0') {
        return false;
    }
    if (hz < 1 || hz > CONTROL_WATCH_MAX_HZ) {
        return false;
    }
    client->watch_period_us = 1000000u / hz;
    client->watch_next_us = now_us;
    return true;
}

/* The answer follows when everything is on the disk. */
static void begin_dump(control_t *self, control_client_t *client, uint64_t now_us)
{
    client->dump_ticket = blackbox_ask(self->blackbox);
    client->answer_by_us = now_us + DUMP_US;
    if (client->dump_ticket == 0) {
        answer_error(client, "dump: there is no black box; [black-box] directory says where it writes to", NULL);
    }
}

/* `tick`, `counts`: what a hand needs before and while it does anything. From the newest view: nothing is asked of the motion. */
static void answer_tick(control_t *self, control_client_t *client, bool has_counts)
{
    const snapshot_t *s = snapshot_of(self);
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(s->state));
    service_json_hand(&json, s);
    if (has_counts) {
        service_json_drives(&json, s);
    }
    json_close(&json, '}');
    answer(client, &json);
}

/* Who says that they have been seen gets the list of what was. */
static void answer_incidents(control_t *self, control_client_t *client, bool is_seeing)
{
    uint32_t seen = 0;
    if (blackbox_feed(self->blackbox) == NULL) {
        answer_error(client, "incidents: there is no black box; [black-box] directory says where it writes to", NULL);
        return;
    }
    if (is_seeing) {
        blackbox_see(self->blackbox);
        log_answer(client, "", snapshot_of(self)->state);
    }
    const uint32_t count = blackbox_list(self->blackbox, self->folder, &seen);
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_open(&json, "incidents", '[');
    for (uint32_t i = 0; i < count; i++) {
        json_open(&json, NULL, '{');
        json_text(&json, "name", self->folder[i].name);
        json_bool(&json, "dump", blackbox_is_dump(self->folder[i].name));
        json_bool(&json, "seen", blackbox_number(self->folder[i].name) <= seen);
        json_close(&json, '}');
    }
    json_close(&json, ']');
    json_close(&json, '}');
    answer(client, &json);
}

/* The memory of the samples comes with the answer (SCM_RIGHTS). */
static void answer_samples(const control_t *self, control_client_t *client)
{
    if (self->samples_fd < 0) {
        answer_error(client, "samples: there are none; [samples] seconds says how long they are kept", NULL);
        return;
    }
    client->is_passing = true;
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_number(&json, "seconds", self->config->samples_seconds);
    json_close(&json, '}');
    answer(client, &json);
}

static const char k_intensity[] = "intensity ";
static const char k_by[] = "by ";

static bool is_look(const char *line)
{
    return strcmp(line, "status") == 0 || strcmp(line, "tick") == 0 || strcmp(line, "counts") == 0 ||
           strncmp(line, "beat ", 5) == 0 || strcmp(line, "incidents") == 0 || strcmp(line, "samples") == 0 ||
           strcmp(line, k_selftest) == 0 || strncmp(line, "watch", 5) == 0 || strncmp(line, k_by, strlen(k_by)) == 0;
}

/* What came of one; the bare word asks. */
static bool is_said_of_selftest(const char *line)
{
    return strcmp(line, "selftest passed") == 0 || strcmp(line, "selftest failed") == 0;
}

static bool is_known(const char *line)
{
    return operator_request_find(line) != EVENTS || service_words_are(line, strlen(line)) ||
           strncmp(line, k_intensity, strlen(k_intensity)) == 0 || strcmp(line, "dump") == 0 || strcmp(line, "seen") == 0 ||
           strcmp(line, k_acknowledge) == 0 || is_said_of_selftest(line);
}

/* Somebody has seen that this is not the configuration that was approved, and wants it. */
static void acknowledge(control_t *self, control_client_t *client)
{
    if (__atomic_exchange_n(&self->handover->is_unapproved, 0, __ATOMIC_ACQ_REL) == 0) {
        answer_error(client, "acknowledge: there is nothing to acknowledge", state_name(snapshot_of(self)->state));
        return;
    }
    self->acknowledged_by = client->peer;
    client->request = EVENT_TICK; /* none that the motion thread has to answer */
    answer_done(client, snapshot_of(self));
}

static void put_switch(json_t *json, const char *name, const config_label_t *line)
{
    json_bool(json, name, line->text[0] != '\0');
}

/* What a self-test has to look at, and what it allows; and what is known of the newest one. */
static void answer_selftest(control_t *self, control_client_t *client)
{
    const config_t *config = self->config;
    const config_inputs_t *inputs = &config->inputs;
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(snapshot_of(self)->state));
    status_json_selftest(&json, &self->lost, config);
    json_q32(&json, "following_mm", q32_from_q16(config->selftest.following_mm_q16));
    json_q32(&json, "drift_mm", q32_from_q16(config->selftest.drift_mm_q16));
    json_q32(&json, "jog_mm_s", q32_from_q16(config->settings.jog_mm_s_q16));
    json_number(&json, "relays", snapshot_of(self)->relay_count);
    json_open(&json, "switches", '{');
    put_switch(&json, "estop", &inputs->estop_line);
    put_switch(&json, "estop2", &inputs->estop2_line);
    put_switch(&json, "enable", &inputs->enable_line);
    put_switch(&json, "power", &inputs->power_line);
    json_close(&json, '}');
    json_bool(&json, "healthy_pulse", config->healthy.driver != CONFIG_HEALTHY_NONE);
    json_text(&json, "configuration", config->hash);
    json_close(&json, '}');
    answer(client, &json);
}

/* Somebody has made one. Who did, and what came of it, is in the operator log. */
static void take_selftest(control_t *self, control_client_t *client, bool is_passed)
{
    self->selftest = (control_selftest_t){.is_news = true, .is_passed = is_passed, .peer = client->peer};
    client->request = EVENT_TICK; /* none that the motion thread has to answer */
    answer_done(client, snapshot_of(self));
}

/* Whom it asks for, in its own words: a panel has people behind it that the kernel does not know. */
static void take_by(control_t *self, control_client_t *client, const char *name)
{
    (void)snprintf(client->entry.by, sizeof client->entry.by, "%s", name);
    if (name[0] == '\0' || strlen(name) >= sizeof client->entry.by) {
        client->entry.by[0] = '\0';
        answer_error(client, "by: a name of 1 to 31 bytes is needed, as in `by anna`", NULL);
    } else {
        client->request = EVENT_TICK; /* none that the motion thread has to answer */
        answer_done(client, snapshot_of(self));
    }
}

/* Everything but looking on is written down. */
static void begin_entry(control_t *self, control_client_t *client, const char *line)
{
    operator_entry_t *entry = &client->entry;
    client->is_logged = is_known(line);
    (void)clock_gettime(CLOCK_REALTIME, &entry->at);
    entry->uid = (uint32_t)client->peer.uid;
    entry->gid = (uint32_t)client->peer.gid;
    entry->pid = (int32_t)client->peer.pid;
    (void)snprintf(entry->request, sizeof entry->request, "%s", line);
    entry->before = snapshot_of(self)->state;
    entry->repeats = 0;
}

/* What the client may not ask for is refused here, in words that say who may. */
static bool is_allowed(const control_t *self, control_client_t *client, const char *line)
{
    const level_t needed = levels_needed(line, snapshot_of(self)->intensity_percent);
    const config_label_t *group =
        needed == LEVEL_SERVICE && self->levels.has_service_group ? &self->config->service_group : &self->config->operate_group;
    char error[192];
    if (client->peer.level >= needed) {
        return true;
    }
    (void)snprintf(error, sizeof error, "%.20s: not allowed; it takes the level %s (%s%s)%s", line, level_name(needed),
                   group->text[0] != '\0' ? "members of group " : "the other socket", group->text,
                   client->is_looker ? ", and not this socket" : "");
    answer_error(client, error, state_name(snapshot_of(self)->state));
    return false;
}

static void take_request(control_t *self, control_client_t *client, const char *line, uint64_t now_us)
{
    const event_t event = operator_request_find(line);
    if (!is_look(line)) {
        begin_entry(self, client, line);
    }
    if (!is_allowed(self, client, line)) {
        return;
    }
    if (event != EVENTS) {
        begin_request(self, client, event, 0, now_us);
    } else if (strncmp(line, k_intensity, strlen(k_intensity)) == 0) {
        begin_intensity(self, client, &line[strlen(k_intensity)], now_us);
    } else if (service_words_are(line, strlen(line))) {
        begin_service(self, client, line, now_us);
    } else if (strcmp(line, "tick") == 0 || strcmp(line, "counts") == 0) {
        answer_tick(self, client, line[0] == 'c');
    } else if (strcmp(line, "dump") == 0) {
        begin_dump(self, client, now_us);
    } else if (strcmp(line, "incidents") == 0 || strcmp(line, "seen") == 0) {
        answer_incidents(self, client, line[0] == 's');
    } else if (strcmp(line, k_acknowledge) == 0) {
        acknowledge(self, client);
    } else if (strcmp(line, k_selftest) == 0) {
        answer_selftest(self, client);
    } else if (is_said_of_selftest(line)) {
        take_selftest(self, client, strcmp(line, "selftest passed") == 0);
    } else if (strcmp(line, "samples") == 0) {
        answer_samples(self, client);
    } else if (strcmp(line, "status") == 0) {
        answer_status(self, client);
    } else if (strncmp(line, k_by, strlen(k_by)) == 0) {
        take_by(self, client, &line[strlen(k_by)]);
    } else if (strncmp(line, "watch", 5) == 0) {
        if (!begin_watch(client, &line[5], now_us)) {
            answer_error(client, "watch: `watch` or `watch HZ` with 1 to 50 is allowed", NULL);
        }
    } else {
        answer_error(client,
                     "unknown request; status, watch [HZ], tick, counts, intensity PERCENT, engage, hold, resume, park, reset, "
                     "shutdown, service, service-off, torque, jog, home, relay, beat, release, dump, incidents, samples, seen, "
                     "selftest [passed|failed], acknowledge and by NAME are allowed",
                     NULL);
    }
}

/* Carries out the complete lines of a client, one at a time: the next one waits for the answer to the last. */
static void take_lines(control_t *self, control_client_t *client, uint64_t now_us)
{
    while (client->fd >= 0 && !is_waiting(client)) {
        char *const newline = memchr(client->in, '\n', client->in_length);
        if (newline == NULL) {
            return;
        }
        const bool has_zero = memchr(client->in, '\0', (size_t)(newline - client->in)) != NULL; /* what stands behind it counts */
        *newline = '\0';
        if (newline > client->in && newline[-1] == '\r') {
            newline[-1] = '\0';
        }
        client->asked_us = now_us;
        if (has_zero) {
            answer_error(client, "a zero byte in the request; allowed: text, one request per line", NULL);
        } else {
            take_request(self, client, client->in, now_us);
        }
        client->in_length -= (size_t)(newline + 1 - client->in);
        memmove(client->in, newline + 1, client->in_length);
    }
}

/* A client that has said all it wants to say still gets its answer. */
static void end_input(control_client_t *client, bool is_false_alarm)
{
    if (is_false_alarm) {
        return;
    }
    client->is_closing = true;
    if (!is_waiting(client) && client->out_length == 0) {
        drop(client);
    }
}

/* A closing client is read no more, nor one whose next requests wait for the answer to the last. */
static bool is_read(const control_client_t *client)
{
    return client->fd >= 0 && !client->is_closing && client->in_length < sizeof client->in;
}

static void receive(control_t *self, control_client_t *client, uint64_t now_us)
{
    const ssize_t received =
        recv(client->fd, &client->in[client->in_length], sizeof client->in - client->in_length, MSG_DONTWAIT);
    if (received <= 0) {
        end_input(client, received < 0 && (errno == EAGAIN || errno == EINTR));
        return;
    }
    client->in_length += (size_t)received;
    take_lines(self, client, now_us);
    if (client->fd >= 0 && client->in_length == sizeof client->in && memchr(client->in, '\n', sizeof client->in) == NULL) {
        client->is_closing = true;
        answer_error(client, "request too long", NULL);
    }
}

/* --- What time brings --- */

/* A reset has an effect once the platform has left FAULT or ESTOP; everything else has its answer after one cycle. */
static void take_result(const control_t *self, control_client_t *client, const motion_result_t *result)
{
    char error[256];
    if (result->is_key_off) {
        client->request_id = 0;
        answer_error(client, "the enable key is off: turn it on first", state_name(result->snapshot.state));
    } else if (result->is_power_failing) {
        client->request_id = 0;
        answer_error(client, "the supply is failing: nothing goes up until it is back", state_name(result->snapshot.state));
    } else if (result->is_unapproved) {
        client->request_id = 0;
        (void)snprintf(error, sizeof error, k_unapproved, self->config->hash, self->config->approved.text);
        answer_error(client, error, state_name(result->snapshot.state));
    } else if (result->is_untested) {
        client->request_id = 0;
        answer_error(client, k_untested, state_name(result->snapshot.state));
    } else if (client->request == OPERATOR_SERVICE) {
        client->request_id = 0;
        answer_service(client, result);
    } else if (result->status != HV_OK) {
        client->request_id = 0;
        refuse(self, client, &result->snapshot, result->is_shutting_down);
    } else if (client->request == EVENT_RESET) {
        client->is_accepted = true;
    } else {
        client->request_id = 0;
        answer_done(client, &result->snapshot);
    }
}

static void take_results(control_t *self)
{
    motion_result_t result;
    while (ring_pop(&self->handover->results, &result, sizeof result) > 0) {
        control_client_t *client = find_client(self, result.id);
        if (result.id != 0 && client != NULL) {
            take_result(self, client, &result);
        }
    }
}

/* Requests whose answer comes with time: a reset that took effect, or one that never got its answer. */
static void watch_request(control_t *self, control_client_t *client, uint64_t now_us)
{
    const snapshot_t *s = snapshot_of(self);
    const bool is_latched = s->state == STATE_FAULT || s->state == STATE_ESTOP;
    if (client->is_accepted && !is_latched) {
        client->request_id = 0;
        answer_done(client, s);
    } else if (now_us >= client->answer_by_us) {
        client->request_id = 0;
        if (client->is_accepted) {
            refuse(self, client, s, self->view.view.is_shutting_down);
        } else {
            answer_error(client, "no answer from the motion thread", NULL);
        }
    }
}

static void answer_dumped(control_client_t *client, const char *folder)
{
    log_answer(client, "", control_state(client->control));
    json_t json = start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "folder", folder);
    json_close(&json, '}');
    answer(client, &json);
}

static void watch_dump(control_t *self, control_client_t *client, uint64_t now_us)
{
    char text[BLACKBOX_TEXT_MAX];
    char error[BLACKBOX_TEXT_MAX + 8];
    bool is_good = false;
    if (blackbox_answer(self->blackbox, client->dump_ticket, &is_good, text)) {
        client->dump_ticket = 0;
        (void)snprintf(error, sizeof error, "dump: %s", text);
        if (is_good) {
            answer_dumped(client, text);
        } else {
            answer_error(client, error, NULL);
        }
    } else if (now_us >= client->answer_by_us) {
        client->dump_ticket = 0;
        answer_error(client, k_dump_later, NULL);
    }
}

static void serve_time(control_t *self, control_client_t *client, uint64_t now_us)
{
    if (client->request_id != 0) {
        watch_request(self, client, now_us);
    } else if (client->dump_ticket != 0) {
        watch_dump(self, client, now_us);
    }
    take_lines(self, client, now_us); /* what waited for an answer */
    if (client->fd >= 0 && client->watch_period_us != 0 && now_us >= client->watch_next_us) {
        client->watch_next_us += client->watch_period_us * (1 + (now_us - client->watch_next_us) / client->watch_period_us);
        answer_status(self, client);
    }
}

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
typedef enum { IDLE, WATCHES, TALKS, WAITS_FOR_DISK, STAYS } standing_t;

/* Who waits for the motion thread stays, for a moment. Not so for the disk: that may take a minute. */
static standing_t standing(const control_client_t *client, uint64_t now_us)
{
    if (client->request_id != 0 || now_us - client->came_us < CONTROL_GRACE_US) {
        return STAYS;
    }
    if (client->dump_ticket != 0) {
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
    standing_t least_standing = STAYS;
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        control_client_t *client = &self->client[i];
        const standing_t its = client->is_looker || !is_among_lookers ? standing(client, now_us) : STAYS;
        if (its < least_standing || (its == least_standing && least != NULL && client->asked_us < least->asked_us)) {
            least = client;
            least_standing = its;
        }
    }
    return least;
}

static void give_way(control_client_t *client)
{
    const bool is_dumping = client->dump_ticket != 0;
    answer_error(client, is_dumping ? k_dump_later : "too many clients: this one had to give way to a newer one", NULL);
    if (client->fd >= 0) {
        drop(client);
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
        if (is_read(&self->client[i])) {
            receive(self, &self->client[i], now_us);
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
    listening->newcomer = accept4(listening->fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    listening->is_shut = listening->newcomer < 0 && errno != EAGAIN && errno != EINTR && errno != ECONNABORTED;
    control_client_t *least = listening->is_shut && !was_shut ? find_least(self, at > 0, now_us) : NULL;
    if (least != NULL) {
        give_way(least);
    }
}

/* A newcomer for whom there is no room yet waits for it. */
static void take_connection(control_t *self, unsigned at, uint64_t now_us)
{
    control_socket_t *listening = &self->socket[at];
    if (listening->newcomer < 0) {
        let_in(self, at, now_us);
    }
    control_client_t *client = listening->newcomer >= 0 ? make_room(self, at > 0, now_us) : NULL;
    if (client == NULL) {
        return;
    }
    client->fd = listening->newcomer;
    listening->newcomer = -1;
    client->is_looker = at > 0;
    client->is_logged = false;
    client->entry.by[0] = '\0';
    client->peer = levels_peer(&self->levels, client->fd);
    client->peer.level = client->is_looker ? LEVEL_LOOK : client->peer.level;
    client->in_length = 0;
    client->out_length = 0;
    client->is_closing = false;
    client->is_passing = false;
    client->request_id = 0;
    client->dump_ticket = 0;
    client->watch_period_us = 0;
    client->came_us = client->asked_us = now_us;
}

void control_fill(const control_t *self, struct pollfd fds[CONTROL_FDS])
{
    for (unsigned at = 0; at < CONTROL_SOCKETS; at++) { /* poll would not wait while nobody is let in */
        const control_socket_t *listening = &self->socket[at];
        const bool is_open = listening->newcomer < 0 && !listening->is_shut;
        fds[at] = (struct pollfd){.fd = is_open ? listening->fd : -1, .events = POLLIN};
    }
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        const control_client_t *client = &self->client[i];
        const short events = (short)((is_read(client) ? POLLIN : 0) | (client->out_length > 0 ? POLLOUT : 0));
        fds[i + CONTROL_SOCKETS] = (struct pollfd){.fd = client->fd, .events = events};
    }
}

void control_serve(control_t *self, const struct pollfd fds[CONTROL_FDS], uint64_t now_us)
{
    (void)seqlock_read(&self->handover->view, self->view.word); /* the last view stays where there is no new one */
    take_results(self);
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        control_client_t *client = &self->client[i];
        const short revents = fds[i + CONTROL_SOCKETS].revents;
        if (client->fd >= 0 && (revents & POLLOUT) != 0) {
            send_out(client);
        }
        if (client->fd >= 0 && (revents & POLLIN) != 0) {
            receive(self, client, now_us);
        } else if (client->fd >= 0 && (revents & (POLLHUP | POLLERR)) != 0) {
            drop(client);
        }
        if (client->fd >= 0) {
            serve_time(self, client, now_us);
        }
    }
    for (unsigned at = 0; at < CONTROL_SOCKETS; at++) {
        const control_socket_t *listening = &self->socket[at];
        if ((fds[at].revents & POLLIN) != 0 || listening->newcomer >= 0 || listening->is_shut) {
            take_connection(self, at, now_us);
        }
    }
}

/* --- Open and close --- */

/* Whether somebody answers at the path: a running daemon, or nobody any more. */
static bool is_alive(const struct sockaddr_un *address)
{
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool is_connected = fd >= 0 && connect(fd, (const struct sockaddr *)address, sizeof *address) == 0;
    if (fd >= 0) {
        (void)close(fd);
    }
    return is_connected;
}

/* The directory of the socket, where it is missing. */
static void make_directory(const char *path)
{
    char directory[CONFIG_PATH_MAX];
    (void)snprintf(directory, sizeof directory, "%s", path);
    char *const slash = strrchr(directory, '/');
    if (slash != NULL && slash != directory) {
        *slash = '\0';
        (void)!mkdir(directory, 0755);
    }
}

/* Makes way for the socket. */
static int clear_path(const char *path, const struct sockaddr_un *address)
{
    struct stat found;
    if (lstat(path, &found) != 0) {
        make_directory(path);
        return EXIT_DONE;
    }
    if (!S_ISSOCK(found.st_mode)) {
        return print_message(EXIT_NO_OUTPUT, "control socket %s: there is something else of that name", path);
    }
    if (is_alive(address)) {
        return print_message(EXIT_UNAVAILABLE, "control socket %s: another heaved is running; stop it, or give --socket PATH",
                             path);
    }
    (void)unlink(path);
    return EXIT_DONE;
}

static int fail(control_socket_t *self)
{
    const int error = errno;
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    self->fd = -1;
    return print_message(EXIT_NO_OUTPUT, "control socket %s: %s; create its directory, or give --socket PATH", self->path,
                         strerror(error));
}

static int open_socket(control_socket_t *self, const char *path, mode_t mode)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(self->path, sizeof self->path, "%s", path);
    memcpy(address.sun_path, self->path, sizeof self->path);
    const int code = clear_path(self->path, &address);
    if (code != EXIT_DONE) {
        return code;
    }
    self->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->fd < 0 || bind(self->fd, (const struct sockaddr *)&address, sizeof address) != 0 || chmod(self->path, mode) != 0 ||
        stat(self->path, &self->made) != 0 || listen(self->fd, BACKLOG) != 0) {
        return fail(self);
    }
    return EXIT_DONE;
}

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
    int code = levels_open(&self->levels, config);
    code = code == EXIT_DONE ? open_socket(&self->socket[0], path, 0660) : code;
    if (code == EXIT_DONE && strcmp(config->look_socket, "none") != 0) {
        code = open_socket(&self->socket[1], config->look_socket, 0666);
    }
    return code;
}

state_t control_state(const control_t *self)
{
    return snapshot_of(self)->state;
}

static bool is_ours(const control_socket_t *self)
{
    struct stat found;
    return stat(self->path, &found) == 0 && found.st_dev == self->made.st_dev && found.st_ino == self->made.st_ino;
}

static void close_socket(control_socket_t *self)
{
    if (self->newcomer >= 0) {
        (void)close(self->newcomer);
    }
    self->newcomer = -1;
    if (self->fd >= 0 && is_ours(self)) {
        (void)unlink(self->path);
    }
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    self->fd = -1;
}

void control_close(control_t *self)
{
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        if (self->client[i].fd >= 0) {
            send_out(&self->client[i]);
        }
        if (self->client[i].fd >= 0) {
            drop(&self->client[i]);
        }
    }
    for (unsigned at = 0; at < CONTROL_SOCKETS; at++) {
        close_socket(&self->socket[at]);
    }
}

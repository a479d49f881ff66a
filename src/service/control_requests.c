/* SPDX-License-Identifier: MIT
 * control_requests.c - see control_requests.h.
 */
#include "common/translate.h"
#include "service/control_requests.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "record/service_words.h"
#include "service/control_answers.h"
#include "service/control_client.h"
#include "service/control_commissioned.h"
#include "service/control_configuration.h"
#include "service/control_object.h"
#include "service/control_geometry.h"
#include "service/control_passing.h"
#include "service/control_results.h"
#include "service/control_selftest.h"
#include "service/control_times.h"
#include "service/operator_requests.h"
#include "service/request_table.h"
#include "service/service_json.h"

#define ANSWER_US 1000000u  /* the motion thread answers within a cycle or two */
#define OBJECT_US 1000000u  /* beside what a drive may take: it is asked once, and left alone as long after that */
#define DUMP_US   50000000u /* heavectl waits a little longer */
#define RESET_US  2500000u  /* a reset takes effect when the drives say so */

/* --- How old --- */

/* Since its client has heard heaved, as far as it says so, or since heaved has looked at it: whichever is longer. */
static uint64_t age_us(const control_t *self, const control_client_t *client, uint64_t now_us)
{
    const uint64_t tick_us = control_snapshot(self)->service.tick_us;
    const uint64_t looked_us = now_us - client->since_us;
    if (!client->has_heard) {
        return looked_us;
    }
    const uint64_t heard_us = client->heard_us <= tick_us ? tick_us - client->heard_us : UINT64_MAX;
    return heard_us > looked_us ? heard_us : looked_us;
}

/* What can start or enlarge a motion is done now, for somebody who is there and knows of the last hold, or never. The motion
 * thread looks once more: this thread may be stopped between now and then. */
static bool is_fresh(const control_t *self, control_client_t *client, const request_t *request, uint64_t now_us)
{
    const bool is_before_hold = client->void_bytes > 0 || (client->has_heard && client->heard_us < self->view.view.held_tick_us);
    client->is_moving = request->is_moving;
    client->is_voidable = request->is_moving || request->is_held;
    if (client->is_voidable && (client->is_gone || control_client_has_gone(client))) {
        client->is_gone = true;
        control_client_log(client, "the client has gone before it was carried out", control_state(self));
    } else if (client->is_voidable && is_before_hold) {
        control_client_answer_void(client);
    } else if (client->is_moving && age_us(self, client, now_us) >= REQUEST_FRESH_US) {
        control_client_answer_stale(client);
    } else {
        return true;
    }
    return false;
}

void control_requests_void(control_t *self, const control_client_t *by, uint64_t now_us)
{
    self->held_us = now_us;
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        if (self->client[i].fd >= 0 && &self->client[i] != by) {
            control_client_void(&self->client[i]);
        }
    }
}

/* Hands a request to the motion thread; the answer follows.
 * @param content what it asks for, without its id */
static void hand_over(control_t *self, control_client_t *client, const motion_request_t *content, uint64_t now_us)
{
    const event_t event = (event_t)content->event;
    motion_request_t request = *content;
    self->last_id += self->last_id == UINT32_MAX ? 2 : 1; /* 0 means none */
    request.id = self->last_id;
    request.has_age = client->is_moving;
    request.is_voidable = client->is_voidable;
    request.own_holds = self->own_holds;
    request.has_heard = client->has_heard;
    request.heard_us = client->heard_us;
    request.since_us = client->since_us;
    if (!ring_push(&self->handover->requests, &request, sizeof request, NULL, 0)) {
        control_client_answer_error(client, "heaved is busy: try again", NULL);
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
    if (event == EVENT_HOLD) {
        control_requests_void(self, client, now_us);
    }
    hand_over(self, client, &(motion_request_t){.event = (uint32_t)event, .number = number}, now_us);
    if (event == EVENT_SHUTDOWN && client->request_id != 0) {
        self->is_end_wanted = true;
        self->end_id = client->request_id;
    }
}

static void begin_state(control_t *self, control_client_t *client, const char *line, uint64_t now_us)
{
    begin_request(self, client, operator_request_find(line), 0, now_us);
}

/* By hand. What is held gets the number of its series here. */
static void begin_service(control_t *self, control_client_t *client, const char *line, uint64_t now_us)
{
    motion_request_t request = {.event = OPERATOR_SERVICE};
    const char *why = service_words_read(line, strlen(line), false, &request.service, &request.tick_us);
    if (why != NULL) {
        control_client_answer_error(client, why, state_name(control_snapshot(self)->state));
        return;
    }
    if (service_is_held(request.service.verb)) {
        request.service.series = ++self->last_series;
    }
    hand_over(self, client, &request, now_us);
}

/* An object of a drive. */
static void begin_object(control_t *self, control_client_t *client, const char *line, uint64_t now_us)
{
    motion_request_t request;
    const char *wrong = control_object_read(client, line, &request);
    if (wrong != NULL) {
        control_client_answer_error(client, wrong, state_name(control_snapshot(self)->state));
        return;
    }
    hand_over(self, client, &request, now_us);
    client->answer_by_us += 2000u * (uint64_t)self->config->cia402.sdo_timeout_ms + OBJECT_US;
}

static void begin_intensity(control_t *self, control_client_t *client, const char *words, uint64_t now_us)
{
    uint32_t percent = 0;
    if (operator_read_percent(words, &percent)) {
        begin_request(self, client, OPERATOR_INTENSITY, percent, now_us);
    } else {
        control_client_answer_error(client, "intensity: a whole number of percent is needed, as in `intensity 50`", NULL);
    }
}

static bool is_digits(const char *text)
{
    return text[0] != '\0' && strspn(text, "0123456789") == strlen(text) && strlen(text) <= 3;
}

/* "watch" or "watch HZ". */
static void begin_watch(control_t *self, control_client_t *client, const char *words, uint64_t now_us)
{
    const bool has_rate = words[0] != '\0';
    const unsigned long hz = !has_rate ? CONTROL_WATCH_HZ : is_digits(words) ? strtoul(words, NULL, 10) : 0;
    (void)self;
    if (hz < 1 || hz > CONTROL_WATCH_MAX_HZ) {
        control_client_answer_error(client, "watch: `watch` or `watch HZ` with 1 to 50 is allowed", NULL);
        return;
    }
    client->watch_period_us = 1000000u / (uint32_t)hz;
    client->watch_next_us = now_us;
}

/* The answer follows when everything is on the disk. */
static void begin_dump(control_t *self, control_client_t *client, const char *words, uint64_t now_us)
{
    (void)words;
    client->dump_ticket = blackbox_ask(self->blackbox);
    client->answer_by_us = now_us + DUMP_US;
    if (client->dump_ticket == 0) {
        control_client_answer_error(client, "dump: there is no black box; [black-box] directory says where it writes to", NULL);
    }
}

/* Somebody has seen that this is not the configuration that was approved, and wants it. */
static void acknowledge(control_t *self, control_client_t *client)
{
    if (!handover_withhold(self->handover, PERMIT_APPROVAL, false)) {
        control_client_answer_error(client, "acknowledge: there is nothing to acknowledge",
                                    state_name(control_snapshot(self)->state));
        return;
    }
    self->acknowledged_by = client->peer;
    client->request = EVENT_TICK; /* none that the motion thread has to answer */
    control_client_answer_done(client, control_snapshot(self));
}

/* Whom it asks for, in its own words: a panel has people behind it that the kernel does not know. */
static void begin_by(control_t *self, control_client_t *client, const char *name, uint64_t now_us)
{
    (void)now_us;
    (void)snprintf(client->entry.by, sizeof client->entry.by, "%s", name);
    if (name[0] == '\0' || strlen(name) >= sizeof client->entry.by) {
        client->entry.by[0] = '\0';
        control_client_answer_error(client, "by: a name of 1 to 47 bytes is needed, as in `by anna`", NULL);
    } else {
        client->request = EVENT_TICK; /* none that the motion thread has to answer */
        control_client_answer_done(client, control_snapshot(self));
    }
}

/* Everything but looking on is written down. */
static void begin_entry(control_t *self, control_client_t *client, const char *line, bool is_logged)
{
    operator_entry_t *entry = &client->entry;
    client->is_logged = is_logged;
    (void)clock_gettime(CLOCK_REALTIME, &entry->at);
    entry->uid = (uint32_t)client->peer.uid;
    entry->gid = (uint32_t)client->peer.gid;
    entry->pid = (int32_t)client->peer.pid;
    entry->level = client->peer.level;
    (void)snprintf(entry->request, sizeof entry->request, "%s", line);
    entry->before = control_snapshot(self)->state;
    entry->repeats = entry->left_out = 0;
}

/* What the client may not ask for is refused here, in words that say who may. */
static bool is_allowed(const control_t *self, control_client_t *client, const char *line, level_t needed)
{
    const config_label_t *group =
        needed == LEVEL_SERVICE && self->levels.has_service_group ? &self->config->service_group : &self->config->operate_group;
    char error[192];
    if (client->peer.level >= needed) {
        return true;
    }
    (void)snprintf(error, sizeof error, N_("%.20s: not allowed; it takes the level %s (%s%s)%s"), line, level_name(needed),
                   group->text[0] != '\0' ? N_("members of group ") : N_("the other socket"), group->text,
                   client->is_looker ? N_(", and not this socket") : "");
    control_client_answer_error(client, error, state_name(control_snapshot(self)->state));
    return false;
}

/* --- Who carries it out --- */

static void answer_unknown(const control_t *self, control_client_t *client)
{
    (void)self;
    control_client_answer_error(
        client,
        "unknown request; status, watch [HZ], tick, counts, intensity PERCENT, engage, hold, resume, park, reset, "
        "shutdown, service, service-off, torque, jog, signal, home, relay, beat, release, sdo, dump, incidents, samples, "
        "geometry, incident-folder, operator-log, configuration, configure DIGEST, seen, "
        "selftest [passed|failed], acknowledge, commissioned, by NAME and heard TICK REQUEST are allowed",
        NULL);
}

/** One of these: it looks, it does something at once, or it needs its words and the time. */
typedef struct {
    void (*answer)(const control_t *self, control_client_t *client);
    void (*act)(control_t *self, control_client_t *client);
    void (*begin)(control_t *self, control_client_t *client, const char *words, uint64_t now_us);
} carrier_t;

static const carrier_t k_carriers[REQUEST_KINDS + 1] = {
    [REQUEST_STATE] = {.begin = begin_state},
    [REQUEST_INTENSITY] = {.begin = begin_intensity},
    [REQUEST_HAND] = {.begin = begin_service},
    [REQUEST_OBJECT] = {.begin = begin_object},
    [REQUEST_TICK] = {.answer = control_answer_tick},
    [REQUEST_COUNTS] = {.answer = control_answer_counts},
    [REQUEST_DUMP] = {.begin = begin_dump},
    [REQUEST_INCIDENTS] = {.act = control_answer_incidents},
    [REQUEST_SEEN] = {.act = control_answer_seen},
    [REQUEST_ACKNOWLEDGE] = {.act = acknowledge},
    [REQUEST_COMMISSIONED] = {.act = control_commissioned_accept},
    [REQUEST_SELFTEST] = {.act = control_selftest_answer},
    [REQUEST_SELFTEST_PASSED] = {.act = control_selftest_pass},
    [REQUEST_SELFTEST_FAILED] = {.act = control_selftest_fail},
    [REQUEST_CONFIGURATION] = {.answer = control_configuration_answer},
    [REQUEST_CONFIGURE] = {.begin = control_configuration_accept},
    [REQUEST_INCIDENT_FOLDER] = {.answer = control_pass_incident_folder},
    [REQUEST_OPERATOR_LOG] = {.answer = control_pass_operator_log},
    [REQUEST_STATUS] = {.act = control_client_answer_status},
    [REQUEST_BY] = {.begin = begin_by},
    [REQUEST_WATCH] = {.begin = begin_watch},
    [REQUEST_GEOMETRY] = {.answer = control_geometry_answer},
    [REQUEST_TIMES] = {.answer = control_times_answer},
    [REQUEST_SAMPLES] = {.answer = control_pass_samples},
    [REQUEST_UNKNOWN] = {.answer = answer_unknown},
};

static void carry_out(control_t *self, control_client_t *client, const request_t *request, uint64_t now_us)
{
    const carrier_t *carrier = &k_carriers[request->kind];
    if (carrier->answer != NULL) {
        carrier->answer(self, client);
    } else if (carrier->act != NULL) {
        carrier->act(self, client);
    } else {
        carrier->begin(self, client, request->words, now_us);
    }
}

static void accept_request(control_t *self, control_client_t *client, const char *said, uint64_t now_us)
{
    const char *const line = operator_request_behind_heard(said, &client->has_heard, &client->heard_us);
    if (line == NULL) {
        control_client_answer_error(client, "heard: a tick and a request are needed, as in `heard 81204000 engage`", NULL);
        return;
    }
    const request_t request = request_read(line, control_snapshot(self)->intensity_percent);
    if (!request.is_look) {
        begin_entry(self, client, line, request.kind != REQUEST_UNKNOWN);
    }
    if (is_allowed(self, client, line, request.level) && is_fresh(self, client, &request, now_us)) {
        carry_out(self, client, &request, now_us);
    }
}

/* Carries out the complete lines of a client, one at a time: the next one waits for the answer to the last. */
static void parse_lines(control_t *self, control_client_t *client, uint64_t now_us)
{
    while (client->fd >= 0 && !control_client_is_waiting(client)) {
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
            control_client_answer_error(client, "a zero byte in the request; allowed: text, one request per line", NULL);
        } else {
            accept_request(self, client, client->in, now_us);
        }
        const size_t taken = (size_t)(newline + 1 - client->in);
        client->void_bytes -= client->void_bytes < taken ? client->void_bytes : taken;
        client->in_length -= taken;
        memmove(client->in, newline + 1, client->in_length);
    }
}

static void forget_answers(control_client_t *client)
{
    control_client_log_gone(client);
    client->request_id = 0;
    client->dump_ticket = 0;
    client->is_configuring = false;
}

void control_requests_end(control_t *self, control_client_t *client, uint64_t now_us)
{
    ssize_t received = 0;
    client->is_gone = true;
    client->out_length = 0;
    do {
        client->in_length += received > 0 ? (size_t)received : 0;
        while (client->fd >= 0 && memchr(client->in, '\n', client->in_length) != NULL) {
            forget_answers(client);
            parse_lines(self, client, now_us);
        }
        received = client->fd >= 0 && client->in_length < sizeof client->in ? control_client_receive(client) : 0;
    } while (received > 0);
    forget_answers(client);
    if (client->fd >= 0) {
        control_client_drop(client);
    }
}

/* A client that has said all it wants to say still gets its answer. */
static void end_input(control_client_t *client, bool is_false_alarm)
{
    if (is_false_alarm) {
        return;
    }
    client->is_closing = true;
    if (!control_client_is_waiting(client) && client->out_length == 0) {
        control_client_drop(client);
    }
}

/* A closing client is read no more, nor one whose next requests wait for the answer to the last. */
bool control_requests_is_reading(const control_client_t *client)
{
    return client->fd >= 0 && !client->is_closing && client->in_length < sizeof client->in;
}

void control_requests_receive(control_t *self, control_client_t *client, uint64_t now_us)
{
    const size_t room = sizeof client->in - client->in_length;
    const int passed = client->received;
    const ssize_t received = control_client_receive(client);
    if (received <= 0) {
        const bool is_false_alarm = received < 0 && (errno == EAGAIN || errno == EINTR);
        client->looked_us = is_false_alarm ? self->polled_us : client->looked_us;
        end_input(client, is_false_alarm);
        return;
    }
    client->since_us = client->in_length == 0 ? client->looked_us : client->since_us;
    client->in_length += (size_t)received;
    const bool is_all = (size_t)received < room && client->received == passed; /* the kernel stops behind a descriptor */
    client->looked_us = is_all ? self->polled_us : client->looked_us;
    parse_lines(self, client, now_us);
    if (client->fd >= 0 && client->in_length == sizeof client->in && memchr(client->in, '\n', sizeof client->in) == NULL) {
        client->is_closing = true;
        control_client_answer_error(client, "request too long", NULL);
    }
}

/* --- What time brings --- */

void control_requests_serve_time(control_t *self, control_client_t *client, uint64_t now_us)
{
    if (client->request_id != 0) {
        control_results_watch_request(self, client, now_us);
    } else if (client->dump_ticket != 0) {
        control_results_watch_dump(self, client, now_us);
    } else if (client->is_configuring) {
        control_configuration_watch(client, now_us);
    }
    parse_lines(self, client, now_us); /* what waited for an answer */
    if (client->fd >= 0 && client->watch_period_us != 0 && now_us >= client->watch_next_us) {
        client->watch_next_us += client->watch_period_us * (1 + (now_us - client->watch_next_us) / client->watch_period_us);
        control_client_answer_status(self, client);
    }
}

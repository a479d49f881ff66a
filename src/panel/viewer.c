/* SPDX-License-Identifier: MIT
 * viewer.c - what pages ask for and get; see viewer.h.
 */
#include "panel/viewer.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "panel/feed.h"
#include "panel/outbox.h"
#include "panel/viewer_call.h"
#include "panel/viewer_service.h"

#define STATUS_HZ_MAX 10.0
#define NO_PLATFORM   "there is no such platform here"
#define TICK_ID       (-1) /* of the panel's own questions */

/* --- Who --- */

viewer_t *viewer_enter(viewers_t *viewers, void *handle, int role, const char *name)
{
    viewer_t *const viewer = calloc(1, sizeof *viewer);
    if (viewer == NULL) {
        return NULL;
    }
    viewer->number = ++viewers->last_viewer;
    viewer->handle = handle;
    viewer->role = role;
    (void)snprintf(viewer->name, sizeof viewer->name, "%s", name);
    viewer->next = viewers->first;
    viewers->first = viewer;
    return viewer;
}

static void send_controls_to(viewers_t *viewers, const upstream_t *upstream, viewer_t *viewer)
{
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddStringToObject(json, "event", "controls");
    cJSON_AddStringToObject(json, "platform", upstream->name);
    if (upstream->holder != 0) {
        cJSON_AddStringToObject(json, "holder", upstream->holder_name);
    } else {
        cJSON_AddNullToObject(json, "holder");
    }
    cJSON_AddBoolToObject(json, "yours", upstream->holder == viewer->number);
    viewers_send_json(viewers, viewer, json);
}

/* Everybody, when they have changed. */
static void send_controls(viewers_t *viewers, const upstream_t *upstream)
{
    for (viewer_t *viewer = viewers->first; viewer != NULL; viewer = viewer->next) {
        send_controls_to(viewers, upstream, viewer);
    }
}

static void let_go(upstream_t *upstream, viewer_t *viewer, unsigned at)
{
    char line[UPSTREAM_REQUEST];
    const asker_t nobody = {.viewer = 0};
    if (viewer->series[at] != 0) {
        (void)snprintf(line, sizeof line, "release %u", viewer->series[at]);
        (void)upstream_send(upstream, LINK_QUICK, line, &nobody);
        viewer->series[at] = 0;
    }
}

void viewer_leave(viewers_t *viewers, viewer_t *viewer)
{
    viewer_t **at = &viewers->first;
    message_t message;
    while (*at != NULL && *at != viewer) {
        at = &(*at)->next;
    }
    if (*at == viewer) {
        *at = viewer->next;
    }
    for (unsigned i = 0; i < viewers->platforms; i++) {
        let_go(&viewers->platform[i], viewer, i);
        if (viewers->platform[i].holder == viewer->number) {
            viewers->platform[i].holder = 0;
            send_controls(viewers, &viewers->platform[i]);
        }
    }
    while (outbox_pop(viewer, &message)) {
        free(message.data);
    }
    free(viewer);
}

/* --- What happens at heaved --- */

void viewers_status(viewers_t *viewers, const upstream_t *upstream)
{
    char head[128 + UPSTREAM_WHY_ZH_MAX];
    const unsigned at = viewers_place_of(viewers, upstream);
    const char *const put_back = upstream->put_back_zh;
    (void)snprintf(head, sizeof head, "{\"event\":\"status\",\"platform\":\"%s\",%s%s%s\"status\":", upstream->name,
                   put_back[0] != '\0' ? "\"put_back_zh\":" : "", put_back, put_back[0] != '\0' ? "," : "");
    for (viewer_t *viewer = viewers->first; viewer != NULL; viewer = viewer->next) {
        const unsigned hz = viewer->status_hz[at];
        /* a page that has not taken the last ones gets the next one */
        if (hz != 0 && viewer->count < VIEWER_QUEUE / 4 && (viewers->now_ms - viewer->status_ms[at]) * hz >= 900) {
            viewer->status_ms[at] = viewers->now_ms;
            viewers_send_object(viewers, viewer, head, upstream->status);
        }
    }
}

void viewers_gone(viewers_t *viewers, const upstream_t *upstream)
{
    viewer_service_gone(viewers, viewers_place_of(viewers, upstream));
    for (viewer_t *viewer = viewers->first; viewer != NULL; viewer = viewer->next) {
        cJSON *const json = cJSON_CreateObject();
        cJSON_AddStringToObject(json, "event", "gone");
        cJSON_AddStringToObject(json, "platform", upstream->name);
        viewer->series[viewers_place_of(viewers, upstream)] = 0;
        for (unsigned i = 0; i < VIEWER_STREAMS_MAX; i++) {
            viewer->stream[i].number = viewer->stream[i].upstream == upstream ? 0 : viewer->stream[i].number;
        }
        viewers_send_json(viewers, viewer, json);
    }
}

/* The answer to a press says which series this page holds now. */
static void note_series(viewer_t *viewer, unsigned at, const char *line)
{
    cJSON *const answer = cJSON_Parse(line);
    const cJSON *const series = cJSON_GetObjectItemCaseSensitive(answer, "series");
    const cJSON *const held = cJSON_GetObjectItemCaseSensitive(answer, "held");
    if (cJSON_IsNumber(series) && cJSON_IsTrue(held)) {
        viewer->series[at] = (uint32_t)series->valuedouble;
    }
    cJSON_Delete(answer);
}

static void send_tick(viewers_t *viewers, const upstream_t *upstream, const char *line)
{
    char head[128];
    const unsigned at = viewers_place_of(viewers, upstream);
    viewer_service_tick(viewers, at, line);
    (void)snprintf(head, sizeof head, "{\"event\":\"tick\",\"platform\":\"%s\",\"tick\":", upstream->name);
    for (viewer_t *viewer = viewers->first; viewer != NULL; viewer = viewer->next) {
        if (viewer->wants_ticks[at] && viewer->count < VIEWER_QUEUE / 2) {
            viewers_send_object(viewers, viewer, head, line);
        }
    }
}

void viewers_answer(viewers_t *viewers, upstream_t *upstream, const asker_t *asker, const char *line)
{
    char head[64];
    if (asker->viewer == 0) {
        if (asker->id == TICK_ID && line != NULL) {
            send_tick(viewers, upstream, line);
        }
        return;
    }
    viewer_t *const viewer = viewers_find(viewers, asker->viewer);
    const bool is_press = (asker->id & VIEWER_PRESS_BIT) != 0;
    if (viewer == NULL) { /* gone meanwhile: what it pressed is nobody's; heaved lets go by itself within 250 ms */
        return;
    }
    if (line == NULL) {
        if (is_press) {
            viewer_service_pressed(viewers, viewer, viewers_place_of(viewers, upstream));
        }
        viewers_answer_error(viewers, viewer, asker->id & ~VIEWER_PRESS_BIT, "heaved has not answered");
        return;
    }
    if (is_press) {
        note_series(viewer, viewers_place_of(viewers, upstream), line);
        viewer_service_pressed(viewers, viewer, viewers_place_of(viewers, upstream));
    }
    if (strstr(line, "\"ok\":false") != NULL) {
        viewers_answer_refusal(viewers, viewer, asker->id & ~VIEWER_PRESS_BIT, line);
        return;
    }
    (void)snprintf(head, sizeof head, "{\"id\":%lld,\"answer\":", (long long)(asker->id & ~VIEWER_PRESS_BIT));
    viewers_send_object(viewers, viewer, head, line);
}

/* --- In --- */

/* What has an operation of its own, or is the panel's to say. */
static bool is_kept_back(const char *line)
{
    static const char *const k_words[] = {"watch", "samples", "by",      "beat",      "jog",           "home",
                                          "relay", "signal",  "release", "configure", "configuration", "heard"};
    for (unsigned i = 0; i < sizeof k_words / sizeof k_words[0]; i++) {
        if (viewer_begins(line, k_words[i])) {
            return true;
        }
    }
    return false;
}

static link_kind_t link_for(const char *line)
{
    const bool is_quick = viewer_begins(line, "hold") || viewer_begins(line, "tick") || viewer_begins(line, "counts") ||
                          viewer_begins(line, "geometry") || viewer_begins(line, "times");
    const bool is_long = viewer_begins(line, "dump") || viewer_begins(line, "sdo"); /* a disk, a bus */
    return is_quick ? LINK_QUICK : is_long ? LINK_LONG : viewer_begins(line, "reset") ? LINK_RESET : LINK_SLOW;
}

/* Half of the places are for hold and for hands: nobody who asks much takes those. */
static bool has_room(const upstream_t *upstream, const char *line)
{
    return viewer_begins(line, "hold") || upstream->link[link_for(line)].waits < UPSTREAM_WAITING / 2;
}

static void op_request(const call_t *call)
{
    char heard[UPSTREAM_HEARD];
    const char *const line = viewer_word(call->json, "line");
    if (!viewer_is_plain(line) || is_kept_back(line)) {
        viewer_reject(call, "that is no request that goes this way");
    } else if (viewer_is_allowed(call, line)) {
        if (has_room(call->upstream, line)) {
            (void)viewer_send(call, link_for(line), viewer_heard(call, line, heard), call->id);
        } else {
            viewer_reject(call, UPSTREAM_BUSY);
        }
    }
}

static void op_press(const call_t *call)
{
    const char *const wanted = viewer_word(call->json, "line");
    const bool is_held = viewer_begins(wanted, "jog") || viewer_begins(wanted, "home") || viewer_begins(wanted, "relay") ||
                         viewer_begins(wanted, "signal");
    if (!viewer_is_plain(wanted) || !is_held) {
        viewer_reject(call, "only jog, home, relay and signal are held");
    } else {
        (void)viewer_press(call, wanted);
    }
}

/* A beat is passed on as the page made it: its counter, its tick. The panel adds none of its own. */
static void op_beat(const call_t *call)
{
    char line[UPSTREAM_REQUEST];
    const asker_t nobody = {.viewer = 0};
    const uint32_t series = call->viewer->series[viewers_place_of(call->viewers, call->upstream)];
    if (series != 0 && (double)series == viewer_number(call->json, "series", 0) &&
        call->upstream->holder == call->viewer->number) {
        (void)snprintf(line, sizeof line, "beat %u %.0f %.0f", series, viewer_number(call->json, "counter", 0),
                       viewer_number(call->json, "tick", 0));
        (void)upstream_send(call->upstream, LINK_QUICK, line, &nobody);
    }
}

static void op_controls(const call_t *call, bool is_taking)
{
    upstream_t *const upstream = call->upstream;
    if (is_taking && call->viewer->role < (int)LEVEL_OPERATE) {
        viewer_reject(call, "not allowed; it takes the role operate");
        return;
    }
    viewer_t *const before = viewers_find(call->viewers, upstream->holder);
    if (before != NULL && (is_taking || before == call->viewer)) {
        let_go(upstream, before, viewers_place_of(call->viewers, upstream));
    }
    if (is_taking) {
        upstream->holder = call->viewer->number;
        (void)snprintf(upstream->holder_name, sizeof upstream->holder_name, "%s", call->viewer->name);
    } else if (upstream->holder == call->viewer->number) {
        upstream->holder = 0;
    } else { /* nothing has changed: others hear nothing of it, however often a page says so */
        send_controls_to(call->viewers, upstream, call->viewer);
        return;
    }
    send_controls(call->viewers, upstream);
}

static void op_status(const call_t *call)
{
    const unsigned at = viewers_place_of(call->viewers, call->upstream);
    const double hz = viewer_number(call->json, "hz", STATUS_HZ_MAX);
    call->viewer->status_hz[at] = hz <= 0 ? 0 : hz < 1 ? 1u : hz > STATUS_HZ_MAX ? (unsigned)STATUS_HZ_MAX : (unsigned)hz;
    if (call->upstream->is_there) {
        viewers_status(call->viewers, call->upstream);
    } else {
        cJSON *const json = cJSON_CreateObject();
        cJSON_AddStringToObject(json, "event", "gone");
        cJSON_AddStringToObject(json, "platform", call->upstream->name);
        viewers_send_json(call->viewers, call->viewer, json);
    }
    send_controls_to(call->viewers, call->upstream, call->viewer);
}

static void op_samples(const call_t *call)
{
    char error[128] = "";
    feed_t *const stream = feed_begin(call->viewer, call->upstream, call->json, error, sizeof error);
    if (stream == NULL) {
        viewer_reject(call, error);
    } else {
        viewers_send_json(call->viewers, call->viewer, feed_describe(stream, call->id));
    }
}

static void op_ticks(const call_t *call)
{
    call->viewer->wants_ticks[viewers_place_of(call->viewers, call->upstream)] =
        cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(call->json, "on"));
}

static void carry_out(const call_t *call, const char *op)
{
    if (strcmp(op, "request") == 0) {
        op_request(call);
    } else if (strcmp(op, "configure") == 0) {
        viewer_configure(call);
    } else if (strcmp(op, "identify") == 0) {
        viewer_identify(call);
    } else if (strcmp(op, "press") == 0) {
        op_press(call);
    } else if (strcmp(op, "beat") == 0) {
        op_beat(call);
    } else if (strcmp(op, "release") == 0) {
        let_go(call->upstream, call->viewer, viewers_place_of(call->viewers, call->upstream));
    } else if (strcmp(op, "take") == 0 || strcmp(op, "drop") == 0) {
        op_controls(call, op[0] == 't');
    } else if (strcmp(op, "status") == 0) {
        op_status(call);
    } else if (strcmp(op, "samples") == 0) {
        op_samples(call);
    } else if (strcmp(op, "samples-end") == 0) {
        int64_t stream = 0;
        if (viewer_whole(call->json, "stream", UINT32_MAX, &stream)) {
            feed_end(call->viewer, (uint32_t)stream);
        }
    } else if (strcmp(op, "ticks") == 0) {
        op_ticks(call);
    } else {
        viewer_reject(call, "there is no such operation");
    }
}

void viewer_hear(viewers_t *viewers, viewer_t *viewer, const char *text, size_t length)
{
    cJSON *const json = cJSON_ParseWithLength(text, length);
    call_t call = {.viewers = viewers, .viewer = viewer, .json = json};
    if (!cJSON_IsObject(json) || !viewer_whole(json, "id", VIEWER_PRESS_BIT - 1, &call.id)) {
        viewers_answer_error(viewers, viewer, 0, "a message is one JSON object with op, platform and a whole number as id");
    } else {
        for (unsigned i = 0; i < viewers->platforms; i++) {
            call.upstream =
                strcmp(viewers->platform[i].name, viewer_word(json, "platform")) == 0 ? &viewers->platform[i] : call.upstream;
        }
        if (call.upstream == NULL) {
            viewer_reject(&call, NO_PLATFORM);
        } else {
            carry_out(&call, viewer_word(json, "op"));
        }
    }
    cJSON_Delete(json);
}

/* --- By time --- */

static bool wants_ticks(const viewers_t *viewers, unsigned at)
{
    for (const viewer_t *viewer = viewers->first; viewer != NULL; viewer = viewer->next) {
        if (viewer->wants_ticks[at]) {
            return true;
        }
    }
    return false;
}

void viewers_pump(viewers_t *viewers)
{
    viewer_service_pump(viewers);
    const asker_t own = {.viewer = 0, .id = TICK_ID};
    for (unsigned i = 0; i < viewers->platforms; i++) {
        upstream_t *const upstream = &viewers->platform[i];
        if (upstream->is_there && wants_ticks(viewers, i) && upstream->link[LINK_QUICK].waits < UPSTREAM_WAITING / 4) {
            (void)upstream_send(upstream, LINK_QUICK, "tick", &own);
        }
    }
    for (viewer_t *viewer = viewers->first; viewer != NULL; viewer = viewer->next) {
        if (feed_pump(viewer)) {
            viewers->wake(viewer);
        }
    }
}

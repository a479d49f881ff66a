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

#define STATUS_HZ_MAX 10.0
#define NO_PLATFORM   "there is no such platform here"
#define TICK_ID       (-1) /* of the panel's own questions */

/* --- Out --- */

/* What may not be lost: a page that does not take it is closed, and comes again. */
static void tell(hall_t *hall, viewer_t *viewer, const char *text, size_t length)
{
    viewer->is_over = viewer->is_over || !viewer_put(viewer, text, length, false);
    hall->wake(viewer);
}

static void tell_json(hall_t *hall, viewer_t *viewer, cJSON *json)
{
    char *const text = cJSON_PrintUnformatted(json);
    if (text != NULL) {
        tell(hall, viewer, text, strlen(text));
    }
    cJSON_free(text);
    cJSON_Delete(json);
}

static void answer_error(hall_t *hall, viewer_t *viewer, int64_t id, const char *error)
{
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddNumberToObject(json, "id", (double)id);
    cJSON_AddStringToObject(json, "error", error);
    tell_json(hall, viewer, json);
}

/* heaved's own object, unchanged, within one of ours. */
static void tell_object(hall_t *hall, viewer_t *viewer, const char *head, const char *object)
{
    const size_t size = strlen(head) + strlen(object) + 2;
    char *const text = malloc(size);
    if (text != NULL) {
        tell(hall, viewer, text, (size_t)snprintf(text, size, "%s%s}", head, object));
    }
    free(text);
}

/* --- Who --- */

viewer_t *viewer_enter(hall_t *hall, void *handle, int role, const char *name)
{
    viewer_t *const viewer = calloc(1, sizeof *viewer);
    if (viewer == NULL) {
        return NULL;
    }
    viewer->number = ++hall->last_viewer;
    viewer->handle = handle;
    viewer->role = role;
    (void)snprintf(viewer->name, sizeof viewer->name, "%s", name);
    viewer->next = hall->viewers;
    hall->viewers = viewer;
    return viewer;
}

static viewer_t *find(const hall_t *hall, uint64_t number)
{
    viewer_t *viewer = hall->viewers;
    while (viewer != NULL && viewer->number != number) {
        viewer = viewer->next;
    }
    return viewer;
}

static void tell_controls(hall_t *hall, const upstream_t *upstream)
{
    for (viewer_t *viewer = hall->viewers; viewer != NULL; viewer = viewer->next) {
        cJSON *const json = cJSON_CreateObject();
        cJSON_AddStringToObject(json, "event", "controls");
        cJSON_AddStringToObject(json, "platform", upstream->name);
        if (upstream->holder != 0) {
            cJSON_AddStringToObject(json, "holder", upstream->holder_name);
        } else {
            cJSON_AddNullToObject(json, "holder");
        }
        cJSON_AddBoolToObject(json, "yours", upstream->holder == viewer->number);
        tell_json(hall, viewer, json);
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

void viewer_leave(hall_t *hall, viewer_t *viewer)
{
    viewer_t **at = &hall->viewers;
    message_t message;
    while (*at != NULL && *at != viewer) {
        at = &(*at)->next;
    }
    if (*at == viewer) {
        *at = viewer->next;
    }
    for (unsigned i = 0; i < hall->platforms; i++) {
        let_go(&hall->platform[i], viewer, i);
        if (hall->platform[i].holder == viewer->number) {
            hall->platform[i].holder = 0;
            tell_controls(hall, &hall->platform[i]);
        }
    }
    while (viewer_take(viewer, &message)) {
        free(message.data);
    }
    free(viewer);
}

/* --- What happens at heaved --- */

static unsigned place_of(const hall_t *hall, const upstream_t *upstream)
{
    return (unsigned)(upstream - hall->platform);
}

void hall_status(hall_t *hall, const upstream_t *upstream)
{
    char head[128];
    const unsigned at = place_of(hall, upstream);
    (void)snprintf(head, sizeof head, "{\"event\":\"status\",\"platform\":\"%s\",\"status\":", upstream->name);
    for (viewer_t *viewer = hall->viewers; viewer != NULL; viewer = viewer->next) {
        const unsigned hz = viewer->status_hz[at];
        /* a page that has not taken the last ones gets the next one */
        if (hz != 0 && viewer->count < VIEWER_QUEUE / 4 && (hall->now_ms - viewer->status_ms[at]) * hz >= 900) {
            viewer->status_ms[at] = hall->now_ms;
            tell_object(hall, viewer, head, upstream->status);
        }
    }
}

void hall_gone(hall_t *hall, const upstream_t *upstream)
{
    for (viewer_t *viewer = hall->viewers; viewer != NULL; viewer = viewer->next) {
        cJSON *const json = cJSON_CreateObject();
        cJSON_AddStringToObject(json, "event", "gone");
        cJSON_AddStringToObject(json, "platform", upstream->name);
        viewer->series[place_of(hall, upstream)] = 0;
        for (unsigned i = 0; i < VIEWER_STREAMS_MAX; i++) {
            viewer->stream[i].number = viewer->stream[i].upstream == upstream ? 0 : viewer->stream[i].number;
        }
        tell_json(hall, viewer, json);
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

static void tell_tick(hall_t *hall, const upstream_t *upstream, const char *line)
{
    char head[128];
    const unsigned at = place_of(hall, upstream);
    (void)snprintf(head, sizeof head, "{\"event\":\"tick\",\"platform\":\"%s\",\"tick\":", upstream->name);
    for (viewer_t *viewer = hall->viewers; viewer != NULL; viewer = viewer->next) {
        if (viewer->wants_ticks[at] && viewer->count < VIEWER_QUEUE / 2) {
            tell_object(hall, viewer, head, line);
        }
    }
}

#define PRESS_BIT ((int64_t)1 << 52) /* of an id: the answer tells a series */

void hall_answer(hall_t *hall, upstream_t *upstream, const asker_t *asker, const char *line)
{
    char head[64];
    if (asker->viewer == 0) {
        if (asker->id == TICK_ID && line != NULL) {
            tell_tick(hall, upstream, line);
        }
        return;
    }
    viewer_t *const viewer = find(hall, asker->viewer);
    const bool is_press = (asker->id & PRESS_BIT) != 0;
    if (viewer == NULL) { /* gone meanwhile: what it pressed is nobody's; heaved lets go by itself within 250 ms */
        return;
    }
    if (line == NULL) {
        answer_error(hall, viewer, asker->id & ~PRESS_BIT, "heaved has not answered");
        return;
    }
    if (is_press) {
        note_series(viewer, place_of(hall, upstream), line);
    }
    (void)snprintf(head, sizeof head, "{\"id\":%lld,\"answer\":", (long long)(asker->id & ~PRESS_BIT));
    tell_object(hall, viewer, head, line);
}

/* --- In --- */

/* A message that was understood so far. */
typedef struct {
    hall_t *hall;
    viewer_t *viewer;
    const cJSON *json;
    int64_t id;
    upstream_t *upstream;
} call_t;

static const char *word_of(const cJSON *json, const char *name)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsString(item) ? item->valuestring : "";
}

static double number_of(const cJSON *json, const char *name, double fallback)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsNumber(item) ? item->valuedouble : fallback;
}

static void refuse(const call_t *call, const char *error)
{
    answer_error(call->hall, call->viewer, call->id, error);
}

static void send_to(const call_t *call, link_kind_t kind, const char *line, int64_t id)
{
    asker_t asker = {.viewer = call->viewer->number, .id = id};
    (void)snprintf(asker.by, sizeof asker.by, "%s", call->viewer->name);
    const char *const why = upstream_send(call->upstream, kind, line, &asker);
    if (why != NULL) {
        refuse(call, why);
    }
}

/* One request, as heaved takes it: printable, short, one line. */
static bool is_plain(const char *line)
{
    const size_t length = strlen(line);
    for (size_t i = 0; i < length; i++) {
        if (line[i] < ' ' || line[i] > '~') {
            return false;
        }
    }
    return length > 0 && length < UPSTREAM_REQUEST;
}

static bool begins(const char *line, const char *word)
{
    const size_t length = strlen(word);
    return strncmp(line, word, length) == 0 && (line[length] == ' ' || line[length] == '\0');
}

/* What has an operation of its own, or is the panel's to say. */
static bool is_kept_back(const char *line)
{
    static const char *const k_words[] = {"watch", "samples", "by", "beat", "jog", "home", "relay", "release"};
    for (unsigned i = 0; i < sizeof k_words / sizeof k_words[0]; i++) {
        if (begins(line, k_words[i])) {
            return true;
        }
    }
    return false;
}

static bool is_allowed(const call_t *call, const char *line)
{
    char error[128];
    const level_t needed = levels_needed(line, call->upstream->intensity);
    if (call->viewer->role < (int)needed) {
        (void)snprintf(error, sizeof error, "%.20s: not allowed; it takes the role %s", line, level_name(needed));
        refuse(call, error);
        return false;
    }
    if (needed > LEVEL_LOOK && call->upstream->holder != call->viewer->number) {
        refuse(call, call->upstream->holder == 0 ? "take the controls first" : "somebody else has the controls: take them first");
        return false;
    }
    return true;
}

static void op_request(const call_t *call)
{
    const char *const line = word_of(call->json, "line");
    if (!is_plain(line) || is_kept_back(line)) {
        refuse(call, "that is no request that goes this way");
    } else if (is_allowed(call, line)) {
        const bool is_quick = begins(line, "hold") || begins(line, "tick") || begins(line, "counts") || begins(line, "geometry");
        send_to(call, is_quick ? LINK_QUICK : LINK_SLOW, line, call->id);
    }
}

static void op_press(const call_t *call)
{
    char line[UPSTREAM_REQUEST + 24];
    const char *const wanted = word_of(call->json, "line");
    const bool is_held = begins(wanted, "jog") || begins(wanted, "home") || begins(wanted, "relay");
    if (!is_plain(wanted) || !is_held) {
        refuse(call, "only jog, home and relay are held");
    } else if (is_allowed(call, wanted)) {
        call->viewer->wants_ticks[place_of(call->hall, call->upstream)] = true;
        (void)snprintf(line, sizeof line, "%s %.0f", wanted, number_of(call->json, "tick", 0));
        if (strlen(line) < UPSTREAM_REQUEST) {
            send_to(call, LINK_QUICK, line, call->id | PRESS_BIT);
        } else {
            refuse(call, "that request is too long");
        }
    }
}

/* A beat is passed on as the page made it: its counter, its tick. The panel adds none of its own. */
static void op_beat(const call_t *call)
{
    char line[UPSTREAM_REQUEST];
    const asker_t nobody = {.viewer = 0};
    const uint32_t series = call->viewer->series[place_of(call->hall, call->upstream)];
    if (series != 0 && (double)series == number_of(call->json, "series", 0) && call->upstream->holder == call->viewer->number) {
        (void)snprintf(line, sizeof line, "beat %u %.0f %.0f", series, number_of(call->json, "counter", 0),
                       number_of(call->json, "tick", 0));
        (void)upstream_send(call->upstream, LINK_QUICK, line, &nobody);
    }
}

static void op_take(const call_t *call, bool is_taking)
{
    upstream_t *const upstream = call->upstream;
    if (is_taking && call->viewer->role < (int)LEVEL_OPERATE) {
        refuse(call, "not allowed; it takes the role operate");
        return;
    }
    viewer_t *const before = find(call->hall, upstream->holder);
    if (before != NULL && (is_taking || before == call->viewer)) {
        let_go(upstream, before, place_of(call->hall, upstream));
    }
    if (is_taking) {
        upstream->holder = call->viewer->number;
        (void)snprintf(upstream->holder_name, sizeof upstream->holder_name, "%s", call->viewer->name);
    } else if (upstream->holder == call->viewer->number) {
        upstream->holder = 0;
    }
    tell_controls(call->hall, upstream);
}

static void op_status(const call_t *call)
{
    const unsigned at = place_of(call->hall, call->upstream);
    const double hz = number_of(call->json, "hz", STATUS_HZ_MAX);
    call->viewer->status_hz[at] = hz <= 0 ? 0 : hz < 1 ? 1u : hz > STATUS_HZ_MAX ? (unsigned)STATUS_HZ_MAX : (unsigned)hz;
    if (call->upstream->is_there) {
        hall_status(call->hall, call->upstream);
    } else {
        cJSON *const json = cJSON_CreateObject();
        cJSON_AddStringToObject(json, "event", "gone");
        cJSON_AddStringToObject(json, "platform", call->upstream->name);
        tell_json(call->hall, call->viewer, json);
    }
    tell_controls(call->hall, call->upstream);
}

static void op_samples(const call_t *call)
{
    char error[128] = "";
    feed_t *const stream = feed_begin(call->viewer, call->upstream, call->json, error, sizeof error);
    if (stream == NULL) {
        refuse(call, error);
    } else {
        tell_json(call->hall, call->viewer, feed_describe(stream, call->id));
    }
}

static void op_ticks(const call_t *call)
{
    call->viewer->wants_ticks[place_of(call->hall, call->upstream)] =
        cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(call->json, "on"));
}

static void carry_out(const call_t *call, const char *op)
{
    if (strcmp(op, "request") == 0) {
        op_request(call);
    } else if (strcmp(op, "press") == 0) {
        op_press(call);
    } else if (strcmp(op, "beat") == 0) {
        op_beat(call);
    } else if (strcmp(op, "release") == 0) {
        let_go(call->upstream, call->viewer, place_of(call->hall, call->upstream));
    } else if (strcmp(op, "take") == 0 || strcmp(op, "drop") == 0) {
        op_take(call, op[0] == 't');
    } else if (strcmp(op, "status") == 0) {
        op_status(call);
    } else if (strcmp(op, "samples") == 0) {
        op_samples(call);
    } else if (strcmp(op, "samples-end") == 0) {
        feed_end(call->viewer, (uint32_t)number_of(call->json, "stream", 0));
    } else if (strcmp(op, "ticks") == 0) {
        op_ticks(call);
    } else {
        refuse(call, "there is no such operation");
    }
}

void viewer_hear(hall_t *hall, viewer_t *viewer, const char *text, size_t length)
{
    cJSON *const json = cJSON_ParseWithLength(text, length);
    call_t call = {.hall = hall, .viewer = viewer, .json = json, .id = (int64_t)number_of(json, "id", 0)};
    if (!cJSON_IsObject(json) || call.id < 0 || call.id >= PRESS_BIT) {
        answer_error(hall, viewer, 0, "a message is one JSON object with op, platform and a whole number as id");
    } else {
        for (unsigned i = 0; i < hall->platforms; i++) {
            call.upstream = strcmp(hall->platform[i].name, word_of(json, "platform")) == 0 ? &hall->platform[i] : call.upstream;
        }
        if (call.upstream == NULL) {
            refuse(&call, NO_PLATFORM);
        } else {
            carry_out(&call, word_of(json, "op"));
        }
    }
    cJSON_Delete(json);
}

/* --- By time --- */

static bool wants_ticks(const hall_t *hall, unsigned at)
{
    for (const viewer_t *viewer = hall->viewers; viewer != NULL; viewer = viewer->next) {
        if (viewer->wants_ticks[at]) {
            return true;
        }
    }
    return false;
}

void hall_pump(hall_t *hall)
{
    const asker_t own = {.viewer = 0, .id = TICK_ID};
    for (unsigned i = 0; i < hall->platforms; i++) {
        upstream_t *const upstream = &hall->platform[i];
        if (upstream->is_there && wants_ticks(hall, i) && upstream->link[LINK_QUICK].waits < UPSTREAM_WAITING / 4) {
            (void)upstream_send(upstream, LINK_QUICK, "tick", &own);
        }
    }
    for (viewer_t *viewer = hall->viewers; viewer != NULL; viewer = viewer->next) {
        if (feed_pump(viewer)) {
            hall->wake(viewer);
        }
    }
}

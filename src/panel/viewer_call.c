/* SPDX-License-Identifier: MIT
 * viewer_call.c - see viewer_call.h.
 */
#include "panel/viewer_call.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/sentence.h"
#include "panel/outbox.h"
#include "service/request_table.h"

#define TICK_MAX 9e15 /* whole numbers of JSON */

/* What may not be lost: a page that does not take it is closed, and comes again. */
static void send(viewers_t *viewers, viewer_t *viewer, const char *text, size_t length)
{
    viewer->is_over = viewer->is_over || !outbox_put(viewer, text, length, false);
    viewers->wake(viewer);
}

void viewers_send_json(viewers_t *viewers, viewer_t *viewer, cJSON *json)
{
    char *const text = cJSON_PrintUnformatted(json);
    if (text != NULL) {
        send(viewers, viewer, text, strlen(text));
    }
    cJSON_free(text);
    cJSON_Delete(json);
}

void viewers_add_chinese(cJSON *json, const char *error)
{
    char out[SENTENCE_MAX];
    const char *const chinese = sentence(error, out, sizeof out);
    if (strcmp(chinese, error) != 0) {
        cJSON_AddStringToObject(json, "error_zh", chinese);
    }
}

void viewers_answer_error(viewers_t *viewers, viewer_t *viewer, int64_t id, const char *error)
{
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddNumberToObject(json, "id", (double)id);
    cJSON_AddStringToObject(json, "error", error);
    viewers_add_chinese(json, error);
    viewers_send_json(viewers, viewer, json);
}

void viewers_answer_refusal(viewers_t *viewers, viewer_t *viewer, int64_t id, const char *line)
{
    cJSON *const json = cJSON_CreateObject(), *const answer = cJSON_Parse(line);
    cJSON_AddNumberToObject(json, "id", (double)id);
    cJSON_AddItemToObject(json, "answer", cJSON_CreateRaw(line));
    viewers_add_chinese(json, viewer_word(answer, "error"));
    cJSON_Delete(answer);
    viewers_send_json(viewers, viewer, json);
}

/* heaved's own object, unchanged, within one of ours. */
void viewers_send_object(viewers_t *viewers, viewer_t *viewer, const char *head, const char *object)
{
    const size_t size = strlen(head) + strlen(object) + 2;
    char *const text = malloc(size);
    if (text != NULL) {
        send(viewers, viewer, text, (size_t)snprintf(text, size, "%s%s}", head, object));
    }
    free(text);
}

viewer_t *viewers_find(const viewers_t *viewers, uint64_t number)
{
    viewer_t *viewer = viewers->first;
    while (viewer != NULL && viewer->number != number) {
        viewer = viewer->next;
    }
    return viewer;
}

unsigned viewers_place_of(const viewers_t *viewers, const upstream_t *upstream)
{
    return (unsigned)(upstream - viewers->platform);
}

const char *viewer_word(const cJSON *json, const char *name)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsString(item) ? item->valuestring : "";
}

double viewer_number(const cJSON *json, const char *name, double fallback)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsNumber(item) ? item->valuedouble : fallback;
}

bool viewer_whole(const cJSON *json, const char *name, int64_t most, int64_t *number)
{
    const double value = viewer_number(json, name, 0);
    if (!(value >= 0 && value <= (double)most) || value != (double)(int64_t)value) {
        return false;
    }
    *number = (int64_t)value;
    return true;
}

void viewer_reject(const call_t *call, const char *error)
{
    viewers_answer_error(call->viewers, call->viewer, call->id, error);
}

bool viewer_send(const call_t *call, link_kind_t kind, const char *line, int64_t id)
{
    asker_t asker = {.viewer = call->viewer->number, .id = id};
    (void)snprintf(asker.by, sizeof asker.by, "%s", call->viewer->name);
    const char *const why = upstream_send(call->upstream, kind, line, &asker);
    if (why != NULL) {
        viewer_reject(call, why);
    }
    return why == NULL;
}

const char *viewer_heard(const call_t *call, const char *line, char out[UPSTREAM_HEARD])
{
    const double tick = viewer_number(call->json, "tick", -1);
    if (!(tick >= 0 && tick <= TICK_MAX)) {
        return line;
    }
    (void)snprintf(out, UPSTREAM_HEARD, "heard %.0f %s", tick, line);
    return out;
}

/* One request, as heaved takes it: printable, short, one line. */
bool viewer_is_plain(const char *line)
{
    const size_t length = strlen(line);
    for (size_t i = 0; i < length; i++) {
        if (line[i] < ' ' || line[i] > '~') {
            return false;
        }
    }
    return length > 0 && length < UPSTREAM_REQUEST && line[0] != ' ';
}

bool viewer_begins(const char *line, const char *word)
{
    const size_t length = strlen(word);
    return strncmp(line, word, length) == 0 && (line[length] == ' ' || line[length] == '\0');
}

bool viewer_is_allowed(const call_t *call, const char *line)
{
    char error[128];
    const level_t needed = request_level(line, call->upstream->intensity);
    if (call->viewer->role < (int)needed) {
        (void)snprintf(error, sizeof error, "%.20s: not allowed; it takes the role %s", line, level_name(needed));
        viewer_reject(call, error);
        return false;
    }
    if (needed > LEVEL_LOOK && call->upstream->holder != call->viewer->number) {
        viewer_reject(call, call->upstream->holder == 0 ? "take the controls first"
                                                        : "somebody else has the controls: take them first");
        return false;
    }
    return true;
}

bool viewer_press(const call_t *call, const char *wanted)
{
    char line[UPSTREAM_REQUEST + 24];
    if (!viewer_is_allowed(call, wanted)) {
        return false;
    }
    call->viewer->wants_ticks[viewers_place_of(call->viewers, call->upstream)] = true;
    (void)snprintf(line, sizeof line, "%s %.0f", wanted, viewer_number(call->json, "tick", 0));
    if (strlen(line) >= UPSTREAM_REQUEST) {
        viewer_reject(call, "that request is too long");
        return false;
    }
    return viewer_send(call, LINK_QUICK, line, call->id | VIEWER_PRESS_BIT);
}

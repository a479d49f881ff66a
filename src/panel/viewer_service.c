/* SPDX-License-Identifier: MIT
 * viewer_service.c - see viewer_service.h.
 */
#include "panel/viewer_service.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "panel/child.h"
#include "panel/editor.h"

/* A configuration that was staged and checked: heaved judges it as it judges everybody's. */
void viewer_configure(const call_t *call)
{
    char line[UPSTREAM_REQUEST];
    char heard[UPSTREAM_HEARD];
    char error[128];
    asker_t asker = {.viewer = call->viewer->number, .id = call->id};
    (void)snprintf(asker.by, sizeof asker.by, "%s", call->viewer->name);
    (void)snprintf(line, sizeof line, "configure %.16s", viewer_word(call->json, "base"));
    if (!viewer_is_plain(line)) {
        viewer_reject(call, "that is no request that goes this way");
        return;
    }
    if (!viewer_is_allowed(call, line)) {
        return;
    }
    const int fd = editor_open(call->viewers->state, call->upstream, viewer_word(call->json, "staged"), error, sizeof error);
    if (fd < 0) {
        viewer_reject(call, error);
        return;
    }
    const char *const why = upstream_send_with(call->upstream, LINK_LONG, viewer_heard(call, line, heard), &asker, fd);
    (void)close(fd);
    if (why != NULL) {
        viewer_reject(call, why);
    }
}

/* --- Test signals --- */

/* Tells who has pressed, if that page is still there, and is done with it. @param result deleted here */
static void end_with(viewers_t *viewers, unsigned at, cJSON *result)
{
    identification_t *const it = &viewers->identification[at];
    viewer_t *const viewer = viewers_find(viewers, it->viewer);
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddStringToObject(json, "event", "identified");
    cJSON_AddStringToObject(json, "platform", viewers->platform[at].name);
    viewers_add_chinese(json, viewer_word(result, "error"));
    cJSON_AddItemToObject(json, "result", result);
    identification_end(it);
    if (viewer != NULL) {
        viewers_send_json(viewers, viewer, json);
    } else {
        cJSON_Delete(json);
    }
}

static void end_without(viewers_t *viewers, unsigned at, const char *error)
{
    cJSON *const result = cJSON_CreateObject();
    cJSON_AddFalseToObject(result, "ok");
    cJSON_AddStringToObject(result, "error", error);
    end_with(viewers, at, result);
}

void viewer_identify(const call_t *call)
{
    char line[UPSTREAM_REQUEST];
    char why[192];
    const unsigned at = viewers_place_of(call->viewers, call->upstream);
    identification_t *const it = &call->viewers->identification[at];
    if (it->viewer != 0) {
        viewer_reject(call, "a test signal is being made, or worked out: wait for it");
        return;
    }
    if (!identification_begin(it, call->upstream, call->json, line, sizeof line, why, sizeof why)) {
        identification_end(it);
        viewer_reject(call, why);
        return;
    }
    it->viewers = call->viewers;
    it->viewer = call->viewer->number;
    call->viewer->series[at] = 0;
    if (!viewer_press(call, line)) {
        identification_end(it);
    }
}

void viewer_service_pressed(viewers_t *viewers, const viewer_t *viewer, unsigned at)
{
    identification_t *const it = &viewers->identification[at];
    if (it->viewer != viewer->number || it->series != 0) {
        return;
    }
    it->series = viewer->series[at];
    if (it->series == 0) { /* heaved has refused it, or has not answered; that was said */
        identification_end(it);
    }
}

void viewer_service_tick(viewers_t *viewers, unsigned at, const char *line)
{
    identification_t *const it = &viewers->identification[at];
    if (it->series == 0 || it->until_ms != 0) {
        return;
    }
    cJSON *const tick = cJSON_Parse(line);
    const bool is_held = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(tick, "held"));
    if (viewer_number(tick, "finished", 0) == (double)it->series) {
        identification_arrived(it, viewers->now_ms);
    } else if (!is_held || viewer_number(tick, "series", 0) != (double)it->series) {
        end_without(viewers, at, "ended before the signal was: nothing is known; hold the button until it says so");
    }
    cJSON_Delete(tick);
}

static void on_worked_out(void *context, int code, char *text, size_t length)
{
    identification_t *const it = context;
    viewers_t *const viewers = it->viewers;
    const unsigned at = (unsigned)(it - viewers->identification);
    cJSON *const result = code == 0 && length > 0 ? cJSON_Parse(text) : NULL;
    free(text);
    if (cJSON_IsObject(result)) {
        end_with(viewers, at, result);
        return;
    }
    cJSON_Delete(result);
    end_without(viewers, at, "it could not be worked out");
}

void viewer_service_gone(viewers_t *viewers, unsigned at)
{
    identification_t *const it = &viewers->identification[at];
    if (it->viewer != 0 && !it->is_working) {
        end_without(viewers, at, "heaved has ended");
    }
}

void viewer_service_pump(viewers_t *viewers)
{
    for (unsigned at = 0; at < viewers->platforms; at++) {
        identification_t *const it = &viewers->identification[at];
        if (it->viewer != 0 && !it->is_working && viewers_find(viewers, it->viewer) == NULL) { /* nobody holds it any more */
            identification_end(it);
            continue;
        }
        if (it->series == 0 || it->is_working || !identification_collect(it, viewers->now_ms)) {
            continue;
        }
        it->is_working = true;
        if (!child_work(identification_work, it, on_worked_out, viewers->now_ms)) {
            end_without(viewers, at, "too much is being worked out at once: try again");
        }
    }
}

/* SPDX-License-Identifier: MIT
 * viewer_call.h - a message of a page while it is carried out, and answers to it. For viewer.c and viewer_service.c.
 */
#ifndef HEAVE_PANEL_VIEWER_CALL_H
#define HEAVE_PANEL_VIEWER_CALL_H

#include <cjson/cJSON.h>

#include "panel/viewer.h"

#define VIEWER_PRESS_BIT ((int64_t)1 << 52) /**< of an id: the answer tells a series */

/** A message that was understood so far. */
typedef struct {
    viewers_t *viewers;
    viewer_t *viewer;
    const cJSON *json;
    int64_t id;
    upstream_t *upstream;
} call_t;

const char *viewer_word(const cJSON *json, const char *name);
double viewer_number(const cJSON *json, const char *name, double fallback);

/** A whole number. @param number out: 0 where it is not there; else as before
 *  @return false: it is none from 0 to `most` */
bool viewer_whole(const cJSON *json, const char *name, int64_t most, int64_t *number);
void viewer_reject(const call_t *call, const char *error);

/** One request, as heaved takes it: printable, short, one line. */
bool viewer_is_plain(const char *line);

/** Whether its role and the controls allow it; if not, that was said. */
bool viewer_is_allowed(const call_t *call, const char *line);

/** Begins to hold something, with the tick of the message. @return false: refused or not sent, which was said */
bool viewer_press(const call_t *call, const char *wanted);

/** @param json deleted here */
void viewers_send_json(viewers_t *viewers, viewer_t *viewer, cJSON *json);

/** heaved's own object, unchanged, within one of ours. */
void viewers_send_object(viewers_t *viewers, viewer_t *viewer, const char *head, const char *object);
unsigned viewers_place_of(const viewers_t *viewers, const upstream_t *upstream);
viewer_t *viewers_find(const viewers_t *viewers, uint64_t number);

/** One of the words that a request begins with. */
bool viewer_begins(const char *line, const char *word);

/** The request with the tick that its page has seen, if the page says so: a network, a panel or a heaved that stood still hands
 *  over late what somebody wanted when things were otherwise, and heaved judges that. */
const char *viewer_heard(const call_t *call, const char *line, char out[UPSTREAM_HEARD]);

/** Hands a request to heaved; the answer goes to who asks. @return false: it could not be sent, which was said */
bool viewer_send(const call_t *call, link_kind_t kind, const char *line, int64_t id);
void viewers_answer_error(viewers_t *viewers, viewer_t *viewer, int64_t id, const char *error);

/** Adds `error_zh`, what an error says in Chinese: a page may be in another language than this program. None, where it has no
 *  translation. */
void viewers_add_chinese(cJSON *json, const char *error);

/** heaved's refusal, unchanged, and what it says in Chinese beside it. @param line of heaved, with `error` */
void viewers_answer_refusal(viewers_t *viewers, viewer_t *viewer, int64_t id, const char *line);

#endif

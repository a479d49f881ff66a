/* SPDX-License-Identifier: MIT
 * control_answers.c - see control_answers.h.
 */
#include "service/control_answers.h"

#include "service/service_json.h"

/* `tick`, `counts`: what a hand needs before and while it does anything. From the newest view: nothing is asked of the motion. */
static void answer_hand(const control_t *self, control_client_t *client, bool has_counts)
{
    const snapshot_t *s = control_snapshot(self);
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(s->state));
    service_json_hand(&json, s);
    if (has_counts) {
        service_json_drives(&json, s);
    }
    json_close(&json, '}');
    control_client_answer(client, &json);
}

/* Who says that they have been seen gets the list of what was. */
static void list_incidents(control_t *self, control_client_t *client, bool is_seeing)
{
    uint32_t seen = 0;
    if (blackbox_feed(self->blackbox) == NULL) {
        control_client_answer_error(client, "incidents: there is no black box; [black-box] directory says where it writes to",
                                    NULL);
        return;
    }
    if (is_seeing) {
        blackbox_see(self->blackbox);
        control_client_log(client, "", control_snapshot(self)->state);
    }
    const uint32_t count = blackbox_list(self->blackbox, self->folder, &seen);
    json_t json = control_client_start_answer(client);
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
    control_client_answer(client, &json);
}

void control_answer_tick(const control_t *self, control_client_t *client)
{
    answer_hand(self, client, false);
}

void control_answer_counts(const control_t *self, control_client_t *client)
{
    answer_hand(self, client, true);
}

void control_answer_incidents(control_t *self, control_client_t *client)
{
    list_incidents(self, client, false);
}

void control_answer_seen(control_t *self, control_client_t *client)
{
    list_incidents(self, client, true);
}

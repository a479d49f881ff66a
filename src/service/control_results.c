/* SPDX-License-Identifier: MIT
 * control_results.c - see control_results.h.
 */
#include "service/control_results.h"

#include <stdio.h>

#include "common/translate.h"
#include "service/control_client.h"
#include "service/control_object.h"
#include "service/operator_requests.h"

static const char k_unapproved[] =
    N_("the configuration %s is not the one that was approved (%s): `heavectl acknowledge` lets it move until "
       "heaved ends, [platform] approved for good");
static const char k_untested[] =
    N_("a self-test is due: `heavectl selftest`, with nobody on board, has to pass today with this configuration");

static control_client_t *find_client(control_t *self, uint32_t request_id)
{
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        if (self->client[i].fd >= 0 && self->client[i].request_id == request_id) {
            return &self->client[i];
        }
    }
    return NULL;
}

/* With the tick of this answer: who asks again says that it has heard it, so that a hold in between counts. */
static void answer_absent(const control_t *self, control_client_t *client, const motion_result_t *result)
{
    char error[512];
    (void)operator_explain_absent(client->request, &result->snapshot, result->absent, self->view.view.bus_trouble, error,
                                  sizeof error);
    control_client_answer_not_ready(client, error, &result->snapshot);
}

static void reject(const control_t *self, control_client_t *client, const snapshot_t *snapshot, bool is_shutting_down)
{
    char error[256];
    if (client->request == OPERATOR_INTENSITY) {
        (void)operator_explain_percent(client->number, self->config->settings.intensity_max_percent, error, sizeof error);
    } else {
        (void)operator_explain(client->request, snapshot, is_shutting_down, error, sizeof error);
    }
    control_client_answer_error(client, error, state_name(snapshot->state));
}

/* What would have to be given first; NULL: nothing that somebody could give. */
static const char *explain_missing(const control_t *self, uint32_t missing, char *text, size_t capacity)
{
    if ((missing & PERMIT_KEY) != 0) {
        return N_("the enable key is off: turn it on first");
    }
    if ((missing & PERMIT_SUPPLY) != 0) {
        return N_("the supply is failing: nothing goes up until it is back");
    }
    if ((missing & PERMIT_APPROVAL) != 0) {
        (void)snprintf(text, capacity, k_unapproved, self->config->hash, self->config->approved.text);
        return text;
    }
    return (missing & PERMIT_SELFTEST) != 0 ? k_untested : NULL;
}

/* A reset has an effect once the platform has left FAULT or ESTOP; everything else has its answer after one cycle. */
static void answer_result(const control_t *self, control_client_t *client, const motion_result_t *result)
{
    char text[256];
    const char *missing = explain_missing(self, result->missing, text, sizeof text);
    if (result->is_old) {
        client->request_id = 0;
        control_client_answer_stale(client);
    } else if (result->is_void) {
        client->request_id = 0;
        control_client_answer_void(client);
    } else if (missing != NULL) {
        client->request_id = 0;
        control_client_answer_error(client, missing, state_name(result->snapshot.state));
    } else if (result->absent != 0) {
        client->request_id = 0;
        answer_absent(self, client, result);
    } else if (client->request == OPERATOR_SERVICE) {
        client->request_id = 0;
        control_client_answer_service(client, result);
    } else if (client->request == OPERATOR_OBJECT) {
        client->request_id = 0;
        control_object_answer(client, result);
    } else if (result->status != HV_OK) {
        client->request_id = 0;
        reject(self, client, &result->snapshot, result->is_shutting_down);
    } else if (client->request == EVENT_RESET) {
        client->is_accepted = true;
    } else {
        client->request_id = 0;
        control_client_answer_done(client, &result->snapshot);
    }
}

void control_results_pop(control_t *self)
{
    motion_result_t result;
    while (ring_pop(&self->handover->results, &result, sizeof result) > 0) {
        control_client_t *client = find_client(self, result.id);
        self->is_end_wanted &= result.id != self->end_id || handover_is_barred(&result) == 0;
        if (result.id != 0 && client != NULL) {
            answer_result(self, client, &result);
        }
    }
}

/* Requests whose answer comes with time: a reset that took effect, or one that never got its answer. */
void control_results_watch_request(control_t *self, control_client_t *client, uint64_t now_us)
{
    const snapshot_t *s = control_snapshot(self);
    const bool is_latched = s->state == STATE_FAULT || s->state == STATE_ESTOP;
    if (client->is_accepted && !is_latched) {
        client->request_id = 0;
        control_client_answer_done(client, s);
    } else if (now_us >= client->answer_by_us) {
        client->request_id = 0;
        if (client->is_accepted) {
            reject(self, client, s, self->view.view.is_shutting_down);
        } else {
            control_client_answer_error(client, "no answer from the motion thread", NULL);
        }
    }
}

void control_results_watch_dump(control_t *self, control_client_t *client, uint64_t now_us)
{
    char text[BLACKBOX_TEXT_MAX];
    char error[BLACKBOX_TEXT_MAX + 8];
    bool is_good = false;
    if (blackbox_answer(self->blackbox, client->dump_ticket, &is_good, text)) {
        client->dump_ticket = 0;
        (void)snprintf(error, sizeof error, "dump: %s", text);
        if (is_good) {
            control_client_answer_dumped(client, text);
        } else {
            control_client_answer_error(client, error, NULL);
        }
    } else if (now_us >= client->answer_by_us) {
        client->dump_ticket = 0;
        control_client_answer_error(client, CONTROL_DUMP_LATER, NULL);
    }
}

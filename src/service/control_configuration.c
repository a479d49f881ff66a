/* SPDX-License-Identifier: MIT
 * control_configuration.c - see control_configuration.h.
 */
#include "service/control_configuration.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/translate.h"
#include "service/control_client.h"
#include "platform/load.h"

#define WRITE_US 10000000u

bool control_configuration_fits(state_t state, bool is_restart)
{
    return state == STATE_OFF || state == STATE_SETTLED || (!is_restart && state == STATE_SERVICE);
}

void control_configuration_answer(const control_t *self, control_client_t *client)
{
    const config_store_t *const store = self->store;
    if (store == NULL || store->digest[0] == '\0') {
        control_client_answer_error(client, "configuration: heaved was started with a pipe, or its file has changed since", NULL);
        return;
    }
    client->passing = store->fd;
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "file", store->file);
    if (store->is_applied) {
        json_text(&json, "applied", store->kept);
    } else {
        json_null(&json, "applied");
    }
    json_bool(&json, "keeps", store->kept[0] != '\0');
    json_text(&json, "digest", store->digest);
    json_number(&json, "bytes", store->length);
    json_text(&json, "hash", self->config->hash);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

static void reject(const control_t *self, control_client_t *client, const char *why)
{
    char error[640];
    (void)snprintf(error, sizeof error, "configure: %s", why);
    control_client_answer_error(client, error, state_name(control_snapshot(self)->state));
}

/* What is wrong with the text itself: how many mistakes, and the first one with its line. */
static bool is_right(control_t *self, control_client_t *client, const char *text, size_t length, config_changes_t *changes)
{
    char why[560];
    memset(self->mistakes, 0, sizeof self->mistakes);
    rewind(self->mistakes_stream);
    const int mistakes = config_judge_text("configuration", text, length, self->config, changes, self->mistakes_stream);
    (void)fflush(self->mistakes_stream);
    if (mistakes == 0) {
        return true;
    }
    self->mistakes[strcspn(self->mistakes, "\n")] = '\0';
    if (mistakes == 1) {
        (void)snprintf(why, sizeof why, N_("1 mistake, nothing has changed: %.480s"), self->mistakes);
    } else {
        (void)snprintf(why, sizeof why, N_("%d mistakes, nothing has changed: %.480s"), mistakes, self->mistakes);
    }
    reject(self, client, why);
    return false;
}

static const char *why_not_now(const control_t *self, const config_changes_t *changes)
{
    static const char *const k_riding = N_("people may be on it: `park` first; possible in OFF and SETTLED, and in SERVICE "
                                           "where nothing needs a restart");
    static const char *const k_restart =
        N_("a key needs a restart of heaved, which is possible in OFF and SETTLED: `service-off` or `park` first");
    const state_t state = control_snapshot(self)->state;
    const bool is_restart = changes->restart > 0;
    if (!control_configuration_fits(state, is_restart)) {
        return state == STATE_SERVICE ? k_restart : k_riding;
    }
    return is_restart ? self->store->no_restart : NULL;
}

void control_configuration_accept(control_t *self, control_client_t *client, const char *digest, uint64_t now_us)
{
    config_changes_t changes;
    config_store_t *const store = self->store;
    const char *text = NULL;
    size_t length = 0;
    const char *why = NULL;
    if (store == NULL || store->kept[0] == '\0') {
        why = N_("there is no state directory to keep it in (STATE_DIRECTORY; the service heave@ has one)");
    } else if (store->digest[0] == '\0' || strcmp(digest, store->digest) != 0) {
        why = N_("another configuration is in force than the one that this was made from: read it again");
    } else if (config_store_is_busy(store)) {
        why = N_("the file is just being read, or another one written: try again");
    } else {
        why = config_store_accept(store, client->received, &text, &length);
    }
    control_client_forget_received(client);
    if (why != NULL) {
        reject(self, client, why);
        return;
    }
    if (!is_right(self, client, text, length, &changes)) {
        return;
    }
    why = why_not_now(self, &changes);
    if (why != NULL) {
        reject(self, client, why);
        return;
    }
    self->changes = changes;
    client->is_configuring = true;
    client->request = EVENT_TICK; /* none that the motion thread has to answer */
    client->answer_by_us = now_us + WRITE_US;
    config_store_write(store);
}

void control_configuration_watch(control_client_t *client, uint64_t now_us)
{
    if (now_us >= client->answer_by_us) {
        client->is_configuring = false;
        control_client_answer_error(client, "configure: the disk has not taken it yet; it comes into force once it has", NULL);
    }
}

static void answer(const control_t *self, control_client_t *client, bool is_restarting)
{
    control_client_log(client, "", control_state(self));
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(control_state(self)));
    json_text(&json, "hash", self->changes.hash);
    json_text(&json, "digest", self->store->digest);
    json_number(&json, "changed", (uint64_t)self->changes.live + self->changes.restart);
    json_bool(&json, "restart", is_restarting);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

void control_configuration_end(control_t *self, const char *error, bool is_restarting)
{
    for (unsigned i = 0; i < CONTROL_CLIENTS; i++) {
        control_client_t *const client = &self->client[i];
        if (client->fd < 0 || !client->is_configuring) {
            continue;
        }
        client->is_configuring = false;
        if (error != NULL) {
            reject(self, client, error);
        } else {
            answer(self, client, is_restarting);
        }
    }
}

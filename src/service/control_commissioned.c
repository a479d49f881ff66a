/* SPDX-License-Identifier: MIT
 * control_commissioned.c - see control_commissioned.h.
 */
#include "service/control_commissioned.h"

#include <stdio.h>
#include <string.h>

#include "common/translate.h"
#include "service/control_client.h"

void control_commissioned_accept(control_t *self, control_client_t *client)
{
    const snapshot_t *snapshot = control_snapshot(self);
    if (!self->lost.is_slow) {
        control_client_answer_error(client, N_("commissioned: nothing waits for it, the platform rises at engage speed"),
                                    state_name(snapshot->state));
    } else if (snapshot->rides == 0) {
        control_client_answer_error(
            client, N_("commissioned: the platform has not risen yet since heaved started: `heavectl engage`, look, then say it"),
            state_name(snapshot->state));
    } else {
        self->commissioned_by = client->peer;
        client->request = EVENT_TICK; /* none that the motion thread has to answer */
        control_client_answer_done(client, snapshot);
    }
}

/* What the log has to say of a change. */
static void say(const lifetime_commissioned_t *last, const char *changed, bool is_slow, char said[CONTROL_COMMISSIONED_SAID_MAX])
{
    if (!is_slow) {
        (void)snprintf(said, CONTROL_COMMISSIONED_SAID_MAX, "commissioned: the platform rises at engage speed");
    } else if (last->day == 0) {
        (void)snprintf(said, CONTROL_COMMISSIONED_SAID_MAX,
                       "not commissioned: the platform rises at a tenth of engage speed until `heavectl commissioned`");
    } else {
        (void)snprintf(
            said, CONTROL_COMMISSIONED_SAID_MAX,
            "the machine's keys have changed since it was commissioned (%u): it rises at a tenth of engage speed until "
            "`heavectl commissioned`%s%s",
            (unsigned)last->day, changed[0] != '\0' ? ": " : "", changed);
    }
}

bool control_commissioned_watch(control_t *self, lifetime_t *life, const config_t *config,
                                char said[CONTROL_COMMISSIONED_SAID_MAX])
{
    const bool is_news = self->commissioned_by.pid != 0 && lifetime_note_commissioned(life, lifetime_today(), config);
    if (is_news) {
        (void)snprintf(said, CONTROL_COMMISSIONED_SAID_MAX, "commissioned by user %u, process %d: it rises at engage speed",
                       (unsigned)self->commissioned_by.uid, (int)self->commissioned_by.pid);
        self->commissioned_by.pid = 0;
    }
    const lifetime_commissioned_t *last = &life->now.commissioned;
    const bool is_asked = life->path[0] != '\0' && config->drives != CONFIG_DRIVES_SIM;
    const bool is_slow = is_asked && strcmp(last->hash, config->machine_hash) != 0;
    const bool is_change = is_slow != self->lost.is_slow;
    if (is_change) {
        config_text_clear(&self->changed);
        if (is_slow) {
            machine_keys_compare(&life->keys, config, &self->changed);
        }
        self->lost.changed = self->changed.data;
    }
    if (is_change && !is_news) {
        say(last, self->changed.data, is_slow, said);
    }
    self->lost.is_slow = is_slow;
    __atomic_store_n(&self->handover->is_slow, is_slow ? 1u : 0u, __ATOMIC_RELEASE);
    return is_news || is_change;
}

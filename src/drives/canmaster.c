/* SPDX-License-Identifier: MIT
 * canmaster.c - see canmaster.h.
 */
#include "heave/canmaster.h"

#define SHOWN_US   5000000u
#define SILENCE_US 1000000u /* whoever was heard may be restarting its bus */

/* Nobody has been heard from now on: when it may be enough. */
static void wait(canmaster_t *self, uint64_t now_us)
{
    const bool is_short = self->heard_us != 0 && self->listen_us < SILENCE_US;
    self->until_us = now_us + (is_short ? SILENCE_US : self->listen_us);
}

void canmaster_listen(canmaster_t *self, uint32_t listen_ms, uint64_t now_us)
{
    self->listen_us = listen_ms * 1000u;
    self->is_listening = listen_ms > 0;
    wait(self, now_us);
}

void canmaster_deaf(canmaster_t *self, uint64_t now_us)
{
    if (self->is_listening) {
        wait(self, now_us);
    }
}

void canmaster_note(canmaster_t *self, uint32_t what)
{
    const bool is_named = self->is_listening && self->heard_us != 0; /* its kinds would take turns in the log */
    self->what = is_named ? self->what : what;
    self->is_new = true;
    self->count++;
}

canmaster_verdict_t canmaster_step(canmaster_t *self, uint64_t now_us)
{
    const bool is_new = self->is_new;
    self->is_new = false;
    self->heard_us = is_new ? now_us : self->heard_us;
    if (!self->is_listening) {
        return is_new ? CANMASTER_HEARD : CANMASTER_QUIET;
    }
    if (is_new) {
        wait(self, now_us);
    }
    self->is_listening = now_us < self->until_us;
    return self->is_listening ? CANMASTER_LISTENING : CANMASTER_BEGIN;
}

bool canmaster_was_heard(const canmaster_t *self, uint64_t now_us)
{
    return self->heard_us != 0 && now_us - self->heard_us < SHOWN_US;
}

bool canmaster_leads(const canmaster_t *self, uint64_t now_us)
{
    return self->is_listening && canmaster_was_heard(self, now_us);
}

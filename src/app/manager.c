/* SPDX-License-Identifier: MIT
 * manager.c - words with the service manager; see manager.h.
 */
#include "manager.h"

#ifdef HEAVE_SYSTEMD

#include <stdio.h>
#include <systemd/sd-daemon.h>

void manager_ready(manager_t *self, uint64_t now_us)
{
    uint64_t period_us = 0;
    *self = (manager_t){.watchdog_us = sd_watchdog_enabled(0, &period_us) > 0 ? period_us / 2 : 0};
    self->next_us = now_us + self->watchdog_us;
    (void)sd_notify(0, "READY=1");
}

static void tell_state(manager_t *self, const snapshot_t *snapshot)
{
    char text[128];
    const bool is_fault = snapshot->fault.code != FAULT_NONE;
    (void)snprintf(text, sizeof text, "STATUS=%s%s%s", state_name(snapshot->state), is_fault ? ": " : "",
                   is_fault ? fault_text(snapshot->fault.code) : "");
    (void)sd_notify(0, text);
    self->is_told = true;
    self->state = snapshot->state;
    self->fault = snapshot->fault.code;
}

void manager_serve(manager_t *self, const snapshot_t *snapshot, uint64_t now_us)
{
    if (!self->is_told || self->state != snapshot->state || self->fault != snapshot->fault.code) {
        tell_state(self, snapshot);
    }
    if (self->watchdog_us == 0 || now_us < self->next_us || snapshot->cycle == self->cycle) {
        return; /* a motion thread that stands still is the manager's business: it ends the program, and the drives stop */
    }
    self->cycle = snapshot->cycle;
    self->next_us = now_us + self->watchdog_us;
    (void)sd_notify(0, "WATCHDOG=1");
}

void manager_stopping(void)
{
    (void)sd_notify(0, "STOPPING=1");
}

#else

void manager_ready(manager_t *self, uint64_t now_us)
{
    (void)now_us;
    *self = (manager_t){.is_told = true};
}

void manager_serve(manager_t *self, const snapshot_t *snapshot, uint64_t now_us)
{
    (void)self;
    (void)snapshot;
    (void)now_us;
}

void manager_stopping(void) {}

#endif

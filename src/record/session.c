/* SPDX-License-Identifier: MIT
 * session.c - a gateway and its time line; see session.h.
 */
#include "record/session.h"

hv_status_t session_init(session_t *self, const settings_t *settings, const gateway_io_t *io)
{
    self->settings = *settings;
    self->now_us = settings->cycle_us;
    self->has_zero = false;
    self->zero_us = 0;
    self->late_cycles = 0;
    return gateway_init(&self->gateway, &self->settings, io);
}

void session_reload(session_t *self, const settings_t *settings)
{
    self->settings = *settings;
    gateway_reload(&self->gateway, &self->settings);
}

void session_resume(session_t *self, const session_t *saved)
{
    gateway_resume(&self->gateway, &saved->gateway);
    self->settings = saved->settings;
    self->now_us = saved->now_us;
    self->has_zero = saved->has_zero;
    self->zero_us = saved->zero_us;
    self->late_cycles = saved->late_cycles;
}

bool session_cycle(session_t *self)
{
    gateway_cycle(&self->gateway, self->now_us);
    const snapshot_t *snapshot = gateway_snapshot(&self->gateway);
    const bool is_zero = !self->has_zero && snapshot->state == STATE_SETTLED;
    if (is_zero) {
        self->late_cycles = snapshot->counters.late_cycles; /* what was late before is not part of the run */
        self->has_zero = true;
        self->zero_us = self->now_us;
    }
    self->now_us += self->settings.cycle_us;
    return is_zero;
}

void session_row(session_t *self, trace_row_t *out)
{
    const snapshot_t *snapshot = gateway_snapshot(&self->gateway);
    const uint32_t late_cycles = snapshot->counters.late_cycles;
    trace_fill(out, snapshot, snapshot->now_us - self->zero_us, late_cycles != self->late_cycles, !self->has_zero);
    self->late_cycles = late_cycles;
}

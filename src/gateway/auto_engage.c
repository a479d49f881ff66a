/* SPDX-License-Identifier: MIT
 * auto_engage.c - the auto policy; see auto_engage.h.
 */
#include "auto_engage.h"

#define WINDOW_US 1000000u

void auto_engage_init(auto_engage_t *self, bool is_due, uint32_t frames)
{
    HV_ASSERT(frames <= AUTO_ENGAGE_FRAMES_MAX);
    *self = (auto_engage_t){.is_due = is_due, .frames = frames};
}

void auto_engage_frame(auto_engage_t *self, uint64_t now_us)
{
    if (self->frames > 0) {
        self->seen = now_us - self->last_us <= WINDOW_US ? self->seen : 0;
        self->last_us = now_us;
        self->at_us[self->seen % self->frames] = (uint32_t)now_us;
        self->seen++;
    }
}

HV_WRAPS bool auto_engage_is_ready(const auto_engage_t *self, uint64_t now_us)
{
    if (!self->is_due || self->frames == 0) {
        return self->is_due;
    }
    /* the ring holds as many as are wanted: where the next one goes is the oldest, less than two minutes older than the last */
    const uint32_t since_us = (uint32_t)self->last_us - self->at_us[self->seen % self->frames];
    return self->seen >= self->frames && now_us - self->last_us + since_us <= WINDOW_US;
}

void auto_engage_end(auto_engage_t *self)
{
    self->is_due = false;
}

/* SPDX-License-Identifier: MIT
 * auto_engage.c - the auto policy; see auto_engage.h.
 */
#include "auto_engage.h"

#define WINDOW_US 1000000u

void auto_engage_init(auto_engage_t *self, bool is_due, uint32_t cycle_us, uint32_t frames)
{
    HV_ASSERT(frames <= AUTO_ENGAGE_FRAMES_MAX);
    *self = (auto_engage_t){.is_due = is_due, .cycle_us = cycle_us, .frames = frames};
}

/* The ring holds the gap in front of each of the frames that are wanted. That in front of the oldest does not lie between them.
 */
static void add_gap(auto_engage_t *self, uint32_t gap_cycles)
{
    self->gap_cycles[self->seen % self->frames] = (uint16_t)gap_cycles;
    self->seen++;
    self->span_cycles += gap_cycles;
    self->span_cycles -= self->gap_cycles[self->seen % self->frames];
}

void auto_engage_frame(auto_engage_t *self, uint64_t now_us)
{
    if (self->frames == 0) {
        return;
    }
    const uint64_t gap_us = now_us - self->last_us;
    if (gap_us > WINDOW_US) {
        auto_engage_init(self, self->is_due, self->cycle_us, self->frames);
    }
    add_gap(self, self->seen > 0 ? (uint32_t)gap_us / self->cycle_us : 0);
    self->last_us = now_us;
}

bool auto_engage_is_ready(const auto_engage_t *self, uint64_t now_us)
{
    if (!self->is_due || self->frames == 0) {
        return self->is_due;
    }
    const uint64_t span_us = (uint64_t)self->span_cycles * self->cycle_us;
    return self->seen >= self->frames && now_us - self->last_us + span_us <= WINDOW_US;
}

void auto_engage_end(auto_engage_t *self)
{
    self->is_due = false;
}

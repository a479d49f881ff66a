/* SPDX-License-Identifier: MIT
 * deadman.c - whether a hand is still there; see deadman.h.
 */
#include "heave/deadman.h"

deadman_answer_t deadman_press(deadman_t *self, uint32_t series, uint64_t age_us, uint64_t now_us)
{
    if (age_us >= DEADMAN_HOLD_US) {
        return DEADMAN_STALE;
    }
    if (series <= self->series) {
        return DEADMAN_KNOWN;
    }
    *self = (deadman_t){.is_held = true, .series = series, .until_us = now_us + (DEADMAN_HOLD_US - age_us)};
    return DEADMAN_TAKEN;
}

deadman_answer_t deadman_beat(deadman_t *self, uint32_t series, uint32_t counter, uint64_t age_us, uint64_t now_us)
{
    if (!deadman_step(self, now_us) || series != self->series) {
        return DEADMAN_OVER;
    }
    if (counter <= self->counter) {
        return DEADMAN_KNOWN;
    }
    self->counter = counter;
    if (age_us >= DEADMAN_HOLD_US) {
        return DEADMAN_STALE;
    }
    const uint64_t until_us = now_us + (DEADMAN_HOLD_US - age_us);
    self->until_us = until_us > self->until_us ? until_us : self->until_us;
    return DEADMAN_TAKEN;
}

void deadman_release(deadman_t *self)
{
    self->is_held = false;
}

bool deadman_step(deadman_t *self, uint64_t now_us)
{
    self->is_held = self->is_held && now_us < self->until_us;
    return self->is_held;
}

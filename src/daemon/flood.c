/* SPDX-License-Identifier: MIT
 * flood.c - floods; see flood.h.
 */
#include "daemon/flood.h"

static void begin_window(flood_t *self, uint32_t useless, uint64_t now_us)
{
    self->window_us = now_us;
    self->useless = useless;
}

bool flood_judge(flood_t *self, uint32_t useless, uint64_t now_us)
{
    if (self->window_us == 0) {
        begin_window(self, useless, now_us);
        return false;
    }
    const uint64_t length_us = now_us - self->window_us;
    if (length_us < FLOOD_WINDOW_US) {
        return false;
    }
    const uint64_t per_s = (uint64_t)(uint32_t)(useless - self->useless) * 1000000u / length_us;
    const bool was_on = self->is_on;
    begin_window(self, useless, now_us);
    if (per_s >= FLOOD_END_PER_S) {
        self->busy_us = now_us;
    }
    self->is_on = was_on ? now_us - self->busy_us < FLOOD_CALM_US : per_s >= FLOOD_BEGIN_PER_S;
    return self->is_on != was_on;
}

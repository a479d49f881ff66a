/* SPDX-License-Identifier: MIT
 * healthy.c - the healthy pulse; see heave/healthy.h.
 */
#include "heave/healthy.h"

bool healthy_is_running(const healthy_t *self, const healthy_settings_t *settings, uint64_t now_us)
{
    return self->ill_us != now_us && now_us - self->ill_us >= (uint64_t)settings->off_ms * 1000;
}

bool healthy_step(healthy_t *self, const healthy_settings_t *settings, bool is_well, uint64_t now_us)
{
    self->ill_us = is_well ? self->ill_us : now_us;
    if (!healthy_is_running(self, settings, now_us)) {
        self->level = false;
    } else if (now_us - self->changed_us >= (uint64_t)settings->toggle_ms * 1000) {
        self->level = !self->level;
        self->changed_us = now_us;
    }
    return self->level;
}

/* SPDX-License-Identifier: MIT
 * log_limit.c - see log_limit.h.
 */
#include "log_limit.h"

#define INTERVAL_US 1000000u

uint32_t log_limit_due(log_limit_t *self, uint32_t total, uint64_t now_us)
{
    const uint32_t news = total - self->logged;
    if (news == 0 || (self->last_us != 0 && now_us - self->last_us < INTERVAL_US)) {
        return 0;
    }
    self->last_us = now_us;
    self->logged = total;
    return news;
}

uint32_t log_limit_event(log_limit_t *self, uint64_t now_us)
{
    self->events++;
    return log_limit_due(self, self->events, now_us);
}

void log_limit_put(text_t *text, uint32_t count)
{
    if (count > 1) {
        text_put(text, "; before that ");
        text_put_u32(text, count - 1);
        text_put(text, " more");
    }
}

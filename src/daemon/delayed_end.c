/* SPDX-License-Identifier: MIT
 * delayed_end.c - see delayed_end.h.
 */
#include "daemon/delayed_end.h"

bool delayed_end_hold(delayed_end_t *self)
{
    self->held_us = 0;
    return self->held_all_us < DELAYED_END_HOLDS_US;
}

bool delayed_end_step(delayed_end_t *self, bool is_due, bool is_held, uint64_t now_us)
{
    const bool is_delayed = self->is_asked && is_held;
    const uint64_t passed_us = now_us - self->step_us;
    self->step_us = now_us;
    self->is_asked = self->is_asked || is_due;
    self->held_us = is_delayed ? self->held_us + passed_us : 0;
    self->held_all_us += is_delayed ? passed_us : 0;
    const bool is_over = is_delayed && (self->held_us >= DELAYED_END_HOLD_US || self->held_all_us >= DELAYED_END_HOLDS_US);
    if (is_due || is_over) {
        self->held_us = 0;
    }
    return is_due || is_over;
}

bool delayed_end_is_held(const delayed_end_t *self)
{
    return self->held_us > 0;
}

/* SPDX-License-Identifier: MIT
 * quick_stop.c - the end of a quick stop; see quick_stop.h.
 */
#include "heave/quick_stop.h"

void quick_stop_begin(quick_stop_t *self, uint64_t now_us)
{
    self->until_us = quick_stop_is_active(self) ? self->until_us : now_us + QUICK_STOP_MOST_US;
    self->rest_us = 0;
}

bool quick_stop_step(quick_stop_t *self, q32_t actual_q32, uint64_t actual_us, uint64_t command_us, uint64_t now_us)
{
    if (!quick_stop_is_active(self)) {
        return false;
    }
    const bool has_moved = fx_abs(fx_sub_sat(actual_q32, self->rest_q32)) > QUICK_STOP_REST_Q32;
    if (actual_us > command_us && (self->rest_us == 0 || has_moved)) {
        self->rest_us = actual_us;
        self->rest_q32 = actual_q32;
    }
    const bool is_at_rest = self->rest_us != 0 && actual_us - self->rest_us >= QUICK_STOP_REST_US;
    const bool is_over = is_at_rest || now_us >= self->until_us;
    if (is_over) {
        *self = (quick_stop_t){.until_us = 0};
    }
    return is_over;
}

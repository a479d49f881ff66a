/* SPDX-License-Identifier: MIT
 * shutdown.c - see shutdown.h.
 */
#include "shutdown.h"

#include "heave/quick_stop.h"
#include "heave/text.h"

#define ENERGIZED_TIMEOUT_US (QUICK_STOP_MOST_US + 1000000u) /* a quick stop, brakes, a line that has to try again */
#define LOST_TIMEOUT_US      1000000u                        /* in which a drive may come back and be told */

static void log_energized(hal_log_t log, uint32_t axes)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "not confirmed that the torque is off: axis");
    const char *before = " ";
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        if ((axes >> i & 1u) != 0) {
            text_put(&text, before);
            text_put_u32(&text, i + 1u);
            before = ", ";
        }
    }
    hal_log_write(log, HAL_LOG_ERROR, line);
}

void shutdown_step(shutdown_t *self, const shutdown_in_t *in, hal_log_t log, uint64_t now_us)
{
    const bool are_commanded = !in->is_disable_due || in->is_bus_lost;
    if (!self->is_asked || !in->is_down || !are_commanded) {
        self->since_us = 0;
        return;
    }
    self->since_us = self->since_us != 0 ? self->since_us : now_us;
    const uint32_t axes = feedback_energized(in->feedback, false);
    const bool can_confirm = !in->is_disable_due && feedback_energized(in->feedback, true) != 0;
    const uint32_t most_us = can_confirm ? ENERGIZED_TIMEOUT_US : LOST_TIMEOUT_US;
    if (axes != 0 && !self->is_overdue && now_us - self->since_us >= most_us) {
        self->is_overdue = true;
        log_energized(log, axes);
    }
}

bool shutdown_is_finished(const shutdown_t *self, feedback_t feedback)
{
    return self->since_us != 0 && (feedback_energized(feedback, false) == 0 || self->is_overdue);
}

/* SPDX-License-Identifier: MIT
 * shutdown.c - see shutdown.h.
 */
#include "shutdown.h"

#include "fault_watch.h"
#include "heave/quick_stop.h"
#include "heave/text.h"

#define ENERGIZED_TIMEOUT_US (QUICK_STOP_MOST_US + 1000000u) /* a quick stop, brakes, a line that has to try again */
#define LOST_TIMEOUT_US      1000000u                        /* in which a drive may come back and be told */

static unsigned drive_count(const gateway_t *self)
{
    return drives_count(self->io.drives);
}

uint32_t shutdown_energized(const gateway_t *self, bool is_answering)
{
    uint32_t axes = 0;
    for (unsigned i = 0; i < drive_count(self); i++) {
        const drive_feedback_t *f = &self->snapshot.drive[i];
        if (f->is_energized && (!is_answering || f->state != DRIVE_OFFLINE)) {
            axes |= 1u << i;
        }
    }
    return axes;
}

/* A lost bus tells drives nothing: their own watch has to. */
static bool are_drives_told(const gateway_t *self)
{
    return !self->is_disable_due || self->is_bus_lost || fault_watch_is_bus_stalled(self);
}

static void log_energized(const gateway_t *self, uint32_t axes)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "not confirmed that the torque is off: axis");
    const char *before = " ";
    for (unsigned i = 0; i < drive_count(self); i++) {
        if ((axes >> i & 1u) != 0) {
            text_put(&text, before);
            text_put_u32(&text, i + 1u);
            before = ", ";
        }
    }
    hal_log_write(self->io.log, HAL_LOG_ERROR, line);
}

void shutdown_watch(gateway_t *self, uint64_t now_us)
{
    const bool is_down = self->supervisor.state == STATE_OFF || supervisor_is_latched(&self->supervisor);
    if (!self->is_shutdown_asked || !is_down || !are_drives_told(self)) {
        self->end_since_us = 0;
        return;
    }
    self->end_since_us = self->end_since_us != 0 ? self->end_since_us : now_us;
    const uint32_t axes = shutdown_energized(self, false);
    const bool can_confirm = !self->is_disable_due && shutdown_energized(self, true) != 0;
    const uint32_t most_us = can_confirm ? ENERGIZED_TIMEOUT_US : LOST_TIMEOUT_US;
    if (axes != 0 && !self->is_end_overdue && now_us - self->end_since_us >= most_us) {
        self->is_end_overdue = true;
        log_energized(self, axes);
    }
}

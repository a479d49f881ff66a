/* SPDX-License-Identifier: MIT
 * sim_log.c - log in memory; see sim_log.h.
 */
#include "sim_log.h"

#include <string.h>

static void log_write(void *ctx, hal_log_level_t level, const char *text)
{
    sim_log_t *self = ctx;
    if (self->count == SIM_LOG_LINES) {
        self->dropped++;
        return;
    }
    sim_log_line_t *line = &self->line[(self->first + self->count) % SIM_LOG_LINES];
    line->level = level;
    (void)hal_log_copy(line->text, text);
    self->count++;
}

static uint32_t log_dropped(void *ctx)
{
    const sim_log_t *self = ctx;
    return self->dropped;
}

void sim_log_init(sim_log_t *self)
{
    memset(self, 0, sizeof *self);
}

const sim_log_line_t *sim_log_pop(sim_log_t *self)
{
    if (self->count == 0) {
        return NULL;
    }
    const sim_log_line_t *line = &self->line[self->first];
    self->first = (self->first + 1) % SIM_LOG_LINES;
    self->count--;
    return line;
}

hal_log_t sim_log_hal(sim_log_t *self)
{
    static const hal_log_ops_t k_ops = {log_write, log_dropped};
    return (hal_log_t){&k_ops, self};
}

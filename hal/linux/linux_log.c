/* SPDX-License-Identifier: MIT
 * linux_log.c - lock-free log ring; see linux_log.h.
 * Single producer, single consumer: a release store of the counter publishes the line (or gives the place back), the other side's
 * acquire load sees it. The counters run freely and wrap; their difference is what waits.
 */
#include "linux_log.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void log_write(void *ctx, hal_log_level_t level, const char *text)
{
    linux_log_t *self = ctx;
    const uint32_t written = self->written;
    if (written - __atomic_load_n(&self->printed, __ATOMIC_ACQUIRE) == LINUX_LOG_LINES) {
        __atomic_store_n(&self->dropped, self->dropped + 1, __ATOMIC_RELAXED);
        return;
    }
    linux_log_line_t *line = &self->line[written % LINUX_LOG_LINES];
    line->level = (uint8_t)level;
    (void)hal_log_copy(line->text, text);
    __atomic_store_n(&self->written, written + 1, __ATOMIC_RELEASE);
}

static uint32_t log_dropped(void *ctx)
{
    linux_log_t *self = ctx;
    return __atomic_load_n(&self->dropped, __ATOMIC_RELAXED);
}

static void prepare_line(linux_log_t *self, unsigned level, const char *text)
{
    char prefix[8] = "";
    if (self->has_prefix) {
        (void)snprintf(prefix, sizeof prefix, "<%u>", level % 8u);
    }
    const int length = snprintf(self->out, sizeof self->out, "%s%s\n", prefix, text);
    self->out_length = (size_t)length;
    self->out_done = 0;
}

/* Writes what is left of the prepared line. */
static hv_status_t print_out(linux_log_t *self)
{
    while (self->out_done < self->out_length) {
        const ssize_t done = write(self->fd, self->out + self->out_done, self->out_length - self->out_done);
        if (done >= 0) {
            self->out_done += (size_t)done;
        } else if (errno != EINTR) {
            return errno == EAGAIN || errno == EWOULDBLOCK ? HV_ERR_AGAIN : HV_ERR_IO;
        }
    }
    return HV_OK;
}

/* Makes the next line ready; false where nothing waits. */
static bool prepare_next(linux_log_t *self)
{
    const uint32_t printed = self->printed;
    if (__atomic_load_n(&self->written, __ATOMIC_ACQUIRE) != printed) {
        const linux_log_line_t *line = &self->line[printed % LINUX_LOG_LINES];
        prepare_line(self, line->level, line->text);
        __atomic_store_n(&self->printed, printed + 1, __ATOMIC_RELEASE);
        return true;
    }
    const uint32_t dropped = __atomic_load_n(&self->dropped, __ATOMIC_RELAXED);
    if (dropped != self->reported) {
        char text[48];
        (void)snprintf(text, sizeof text, "%u log lines dropped", (unsigned)(dropped - self->reported));
        self->reported = dropped;
        prepare_line(self, HAL_LOG_WARNING, text);
        return true;
    }
    return false;
}

void linux_log_init(linux_log_t *self, int fd)
{
    memset(self, 0, sizeof *self);
    self->fd = fd;
    self->has_prefix = isatty(fd) == 0;
}

hv_status_t linux_log_flush(linux_log_t *self)
{
    hv_status_t status = print_out(self);
    while (status == HV_OK && prepare_next(self)) {
        status = print_out(self);
    }
    return status;
}

hal_log_t linux_log_hal(linux_log_t *self)
{
    static const hal_log_ops_t k_ops = {log_write, log_dropped};
    return (hal_log_t){&k_ops, self};
}

/* SPDX-License-Identifier: MIT
 * sd_notify.c - words with the service manager; see sd_notify.h.
 */
#include "daemon/sd_notify.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SHUTDOWN_REST_US 15000000u /* a stop before settling, the drives going off, files */
#define RESTART_US       30000000u /* files and devices closed, opened again */

/* Whether there is nothing left to tell: taken, or nobody is there to take it. */
static bool put(const sd_notify_t *self, const char *text)
{
    if (self->fd < 0) {
        return true;
    }
    const ssize_t sent = sendto(self->fd, text, strlen(text), MSG_DONTWAIT | MSG_NOSIGNAL,
                                (const struct sockaddr *)&self->address, self->address_bytes);
    return sent >= 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != ENOBUFS && errno != EINTR);
}

/* A path, or a name in the abstract name space with @ in place of its first byte, 0. */
static void open_socket(sd_notify_t *self)
{
    const char *name = getenv("NOTIFY_SOCKET");
    const size_t length = name != NULL ? strlen(name) : 0;
    if (length < 2 || length >= sizeof self->address.sun_path || (name[0] != '/' && name[0] != '@')) {
        return;
    }
    self->address.sun_family = AF_UNIX;
    memcpy(self->address.sun_path, name, length);
    if (name[0] == '@') {
        self->address.sun_path[0] = '\0';
    }
    self->address_bytes = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
    self->fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

/* Half the period in which it wants to hear of this process. */
static uint64_t watchdog_us(void)
{
    const char *period = getenv("WATCHDOG_USEC");
    const char *pid = getenv("WATCHDOG_PID");
    const bool is_ours = pid == NULL || strtoull(pid, NULL, 10) == (unsigned long long)getpid();
    return period != NULL && is_ours ? strtoull(period, NULL, 10) / 2 : 0;
}

void sd_notify_ready(sd_notify_t *self, uint64_t now_us)
{
    *self = (sd_notify_t){.fd = -1, .watchdog_us = watchdog_us()};
    self->next_us = now_us + self->watchdog_us;
    open_socket(self);
    self->is_ready_sent = put(self, "READY=1");
}

static void send_state(sd_notify_t *self, const snapshot_t *snapshot)
{
    char text[128];
    const bool is_fault = snapshot->fault.code != FAULT_NONE;
    (void)snprintf(text, sizeof text, "STATUS=%s%s%s", state_name(snapshot->state), is_fault ? ": " : "",
                   is_fault ? fault_text(snapshot->fault.code) : "");
    self->is_sent = put(self, text);
    self->state = snapshot->state;
    self->fault = snapshot->fault.code;
}

/* Without it the manager ends what takes longer than its unit says. */
static void send_stopping(sd_notify_t *self)
{
    char text[64];
    (void)snprintf(text, sizeof text, "STOPPING=1\nEXTEND_TIMEOUT_USEC=%llu", (unsigned long long)self->unsent_us);
    self->unsent_us = put(self, text) ? 0 : self->unsent_us;
}

void sd_notify_serve(sd_notify_t *self, const snapshot_t *snapshot, uint64_t now_us)
{
    if (!self->is_ready_sent) {
        self->is_ready_sent = put(self, "READY=1");
    }
    if (self->unsent_us != 0) {
        send_stopping(self);
    }
    if (!self->is_sent || self->state != snapshot->state || self->fault != snapshot->fault.code) {
        send_state(self, snapshot);
    }
    if (self->watchdog_us == 0 || now_us < self->next_us || snapshot->cycle == self->cycle) {
        return; /* a motion thread that stands still is the manager's business: it ends the program, and the drives stop */
    }
    if (put(self, "WATCHDOG=1")) {
        self->cycle = snapshot->cycle;
        self->next_us = now_us + self->watchdog_us;
    }
}

uint64_t sd_notify_shutdown_us(const settings_t *settings)
{
    int64_t stroke_mm_q16 = 0;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        stroke_mm_q16 = settings->stroke_mm_q16[i] > stroke_mm_q16 ? settings->stroke_mm_q16[i] : stroke_mm_q16;
    }
    const int64_t speed_q16 = settings->engage_speed_mm_s_q16;
    const int64_t way_us = stroke_mm_q16 * 1000000 / speed_q16;
    const int64_t ramps_us = 2 * speed_q16 * 1000000 / settings->engage_accel_mm_s2_q16;
    return (uint64_t)(way_us + ramps_us) + SHUTDOWN_REST_US;
}

void sd_notify_stopping(sd_notify_t *self, uint64_t within_us)
{
    self->unsent_us = within_us;
    send_stopping(self);
}

void sd_notify_restart(const sd_notify_t *self, bool is_over)
{
    char text[64];
    const unsigned long long period_us = is_over ? 2u * self->watchdog_us : RESTART_US;
    (void)snprintf(text, sizeof text, "WATCHDOG=1\nWATCHDOG_USEC=%llu", period_us);
    if (self->watchdog_us != 0) {
        (void)put(self, text);
    }
}

void sd_notify_close(sd_notify_t *self)
{
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

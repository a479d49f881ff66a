/* SPDX-License-Identifier: MIT
 * linux_can_local.c - a CAN bus between programs; see linux_can_local.h.
 */
#include "linux_can_local.h"

#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "linux_can_frame.h"

bool linux_can_local_is(const char *name)
{
    return strncmp(name, LINUX_CAN_LOCAL_PREFIX, strlen(LINUX_CAN_LOCAL_PREFIX)) == 0;
}

unsigned linux_can_local_address(const char *name, struct sockaddr_un *out)
{
    memset(out, 0, sizeof *out);
    out->sun_family = AF_UNIX;
    const int length =
        snprintf(out->sun_path + 1, sizeof out->sun_path - 1, "heave-can-%s", name); /* abstract: begins with a NUL */
    return (unsigned)offsetof(struct sockaddr_un, sun_path) + 1u + (unsigned)length;
}

static void shut(linux_can_local_t *self)
{
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    self->fd = -1;
    self->unconfirmed = 0;
}

static hv_status_t say_gone(linux_can_local_t *self)
{
    shut(self);
    self->state = HAL_CAN_GONE;
    (void)snprintf(self->error_text, sizeof self->error_text,
                   "can: %s: nobody is this bus between programs: start heave-twin with the same configuration", self->name);
    return HV_ERR_IO;
}

/* Never waits: a bus that is there answers at once. */
static hv_status_t join(linux_can_local_t *self)
{
    struct sockaddr_un address;
    const socklen_t length = linux_can_local_address(self->name, &address);
    shut(self);
    self->fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->fd < 0) {
        (void)snprintf(self->error_text, sizeof self->error_text, "can: %s: socket: %s", self->name, strerror(errno));
        self->state = HAL_CAN_GONE;
        return HV_ERR_IO;
    }
    if (connect(self->fd, (const struct sockaddr *)&address, length) != 0) {
        (void)say_gone(self);
        return HV_ERR_AGAIN;
    }
    self->state = HAL_CAN_ACTIVE;
    self->error_text[0] = '\0';
    return HV_OK;
}

static hv_status_t local_send(void *ctx, const can_frame_t *frame)
{
    linux_can_local_t *self = ctx;
    if (frame->is_error || frame->length > CAN_MAX_DLEN || frame->id > (frame->is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX)) {
        return HV_ERR_ARG;
    }
    if (self->fd < 0 || self->state == HAL_CAN_BUS_OFF) {
        return HV_ERR_IO;
    }
    if (self->unconfirmed >= LINUX_CAN_LOCAL_QUEUE_FRAMES) {
        return HV_ERR_AGAIN;
    }
    const linux_can_local_packet_t packet = {.frame = linux_can_frame_to_kernel(frame)};
    if (send(self->fd, &packet, sizeof packet, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)sizeof packet) {
        self->unconfirmed++;
        return HV_OK;
    }
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS ? HV_ERR_AGAIN : say_gone(self);
}

/* An error frame. */
static void receive_report(linux_can_local_t *self, const struct can_frame *frame, can_frame_t *out)
{
    *out = (can_frame_t){.is_error = true, .id = linux_can_frame_report(frame, &self->state)};
    if (self->state == HAL_CAN_BUS_OFF) {
        (void)snprintf(self->error_text, sizeof self->error_text, "can: %s: bus-off", self->name);
    }
}

static hv_status_t local_receive(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    linux_can_local_t *self = ctx;
    linux_can_local_packet_t packet;
    struct timespec now;
    while (self->fd >= 0) {
        const ssize_t length = recv(self->fd, &packet, sizeof packet, MSG_DONTWAIT);
        if (length < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
            return HV_ERR_AGAIN;
        }
        if (length != (ssize_t)sizeof packet) {
            return say_gone(self);
        }
        if (packet.is_echo != 0) {
            self->unconfirmed -= self->unconfirmed > 0 ? 1 : 0;
            continue;
        }
        if (self->state == HAL_CAN_BUS_OFF) {
            continue; /* it hears nothing */
        }
        if ((packet.frame.can_id & CAN_ERR_FLAG) != 0) {
            receive_report(self, &packet.frame, out);
        } else {
            *out = linux_can_frame_from_kernel(&packet.frame);
        }
        (void)clock_gettime(CLOCK_MONOTONIC, &now);
        *rx_time_us = (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
        return HV_OK;
    }
    return HV_ERR_IO;
}

static hv_status_t local_state(void *ctx, hal_can_state_t *out)
{
    const linux_can_local_t *self = ctx;
    *out = self->state;
    return HV_OK;
}

static hv_status_t local_unconfirmed(void *ctx, uint32_t *frames)
{
    const linux_can_local_t *self = ctx;
    *frames = self->unconfirmed;
    return HV_OK;
}

static hv_status_t local_restart(void *ctx)
{
    return join(ctx);
}

hal_can_t linux_can_local_hal(linux_can_local_t *self)
{
    static const hal_can_ops_t k_ops = {.send = local_send,
                                        .recv = local_receive,
                                        .bus_state = local_state,
                                        .unconfirmed = local_unconfirmed,
                                        .restart = local_restart};
    return (hal_can_t){&k_ops, self};
}

hv_status_t linux_can_local_open(linux_can_local_t *self, const char *name)
{
    *self = (linux_can_local_t){.fd = -1, .state = HAL_CAN_GONE};
    (void)snprintf(self->name, sizeof self->name, "%s", name);
    return join(self);
}

void linux_can_local_close(linux_can_local_t *self)
{
    shut(self);
}

/* SPDX-License-Identifier: MIT
 * udp_recorder.c - allowed senders and recording; see udp_recorder.h.
 */
#include "record/udp_recorder.h"

#include <string.h>

#include "record/record.h"

#define REFUSED_PER_CALL 64u /* neither a flood from a stranger nor an old queue holds the cycle up; what is left of it waits */

bool udp_recorder_is_allowed(const hal_udp_networks_t *allow, const hal_udp_peer_t *peer)
{
    return allow->count == 0 || hal_udp_rank(allow, peer) < allow->count;
}

static void write_down(const udp_recorder_t *self, hv_status_t status, const hal_udp_peer_t *from, const uint8_t *bytes,
                       size_t length)
{
    for (unsigned i = 0; i < sizeof self->record / sizeof self->record[0]; i++) {
        if (self->record[i] != NULL) {
            record_push_datagram(self->record[i], status == HV_OK ? RECORD_DATAGRAM : RECORD_OVERSIZE,
                                 *self->now_us - self->waited_us, from, bytes, length);
        }
    }
}

/* Its wait is measured by the time of day, which somebody may have set meanwhile: after as long a stop nothing is fresh that does
 * not say how long it has waited. */
static bool is_stale(const udp_recorder_t *self)
{
    uint32_t waited_us = 0;
    (void)!hal_udp_waited(self->behind, &waited_us);
    return waited_us > UDP_RECORDER_FRESH_US || (waited_us == 0 && self->is_draining);
}

/* When a datagram came, and when the oldest one of the cycle did, for those who measure. */
static void note_arrival(udp_recorder_t *self)
{
    uint32_t waited_us = 0;
    (void)!hal_udp_waited(self->behind, &waited_us); /* not known: it comes now */
    const uint64_t came_us = *self->now_us - (waited_us < self->cycle_us ? waited_us : self->cycle_us - 1);
    self->came_us =
        came_us > self->came_us ? came_us : self->came_us; /* one that is read late has not come before the one before it */
    self->waited_us = (uint32_t)(*self->now_us - self->came_us);
    if (self->arrival_us == 0) {
        self->arrival_us = hal_clock_now_us(self->clock) - waited_us;
    }
}

static hv_status_t tap_recv(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    udp_recorder_t *self = ctx;
    self->is_draining |= self->late_us > UDP_RECORDER_FRESH_US;
    for (unsigned i = 0; i < REFUSED_PER_CALL; i++) {
        const hv_status_t status = hal_udp_recv(self->behind, buffer, capacity, length, from);
        self->is_draining &= status != HV_ERR_AGAIN;
        if (status != HV_OK && status != HV_ERR_RANGE) {
            return status;
        }
        const bool is_allowed = udp_recorder_is_allowed(self->allow, from);
        if (is_allowed && !is_stale(self)) {
            note_arrival(self);
            write_down(self, status, from, buffer, *length);
            return status;
        }
        self->refused += is_allowed ? 0u : 1u;
        self->stale += is_allowed ? 1u : 0u;
    }
    return HV_ERR_AGAIN;
}

static hv_status_t tap_dropped(void *ctx, uint32_t *datagrams)
{
    udp_recorder_t *self = ctx;
    return hal_udp_dropped(self->behind, datagrams);
}

static hv_status_t tap_waited(void *ctx, uint32_t *us)
{
    const udp_recorder_t *self = ctx;
    *us = self->waited_us;
    return HV_OK;
}

hal_udp_t udp_recorder_hal(udp_recorder_t *self)
{
    static const hal_udp_ops_t k_ops = {.recv = tap_recv, .dropped = tap_dropped, .waited = tap_waited};
    return (hal_udp_t){&k_ops, self};
}

/* SPDX-License-Identifier: MIT
 * sim_udp.c - simulated UDP socket; see sim_udp.h.
 */
#include "sim_udp.h"

#include <string.h>

static hv_status_t udp_recv(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    sim_udp_t *self = ctx;
    if (sim_fail_now(&self->fail)) {
        return HV_ERR_IO;
    }
    if (self->count == 0) {
        return HV_ERR_AGAIN;
    }
    const sim_udp_datagram_t *datagram = &self->queue[self->first];
    self->first = (self->first + 1) % SIM_UDP_DATAGRAMS;
    self->count--;
    *length = datagram->length;
    *from = datagram->from;
    if (datagram->length > capacity) {
        return HV_ERR_RANGE;
    }
    if (datagram->length > 0) {
        memcpy(buffer, datagram->data, datagram->length);
    }
    return HV_OK;
}

static hv_status_t udp_dropped(void *ctx, uint32_t *datagrams)
{
    const sim_udp_t *self = ctx;
    *datagrams = self->dropped;
    return HV_OK;
}

void sim_udp_init(sim_udp_t *self)
{
    memset(self, 0, sizeof *self);
}

hv_status_t sim_udp_push(sim_udp_t *self, const uint8_t *data, size_t length, const hal_udp_peer_t *from)
{
    static const hal_udp_peer_t k_local = {.address = {127, 0, 0, 1}, .port = 9};
    if (length > SIM_UDP_BYTES_MAX) {
        return HV_ERR_RANGE;
    }
    if (self->count == SIM_UDP_DATAGRAMS) {
        self->dropped++;
        return HV_ERR_FULL;
    }
    sim_udp_datagram_t *datagram = &self->queue[(self->first + self->count) % SIM_UDP_DATAGRAMS];
    datagram->length = length;
    datagram->from = from != NULL ? *from : k_local;
    if (length > 0) {
        memcpy(datagram->data, data, length);
    }
    self->count++;
    return HV_OK;
}

hal_udp_t sim_udp_hal(sim_udp_t *self)
{
    static const hal_udp_ops_t k_ops = {.recv = udp_recv, .dropped = udp_dropped};
    return (hal_udp_t){&k_ops, self};
}

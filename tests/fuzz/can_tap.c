/* SPDX-License-Identifier: MIT
 * can_tap.c - between a driver and its simulated bus; see can_tap.h.
 */
#include "can_tap.h"

void can_tap_slip_in(can_tap_t *self, const can_frame_t *frame)
{
    if (self->count < CAN_TAP_FRAMES) {
        self->frame[(self->first + self->count) % CAN_TAP_FRAMES] = *frame;
        self->count++;
    }
}

static hv_status_t tap_send(void *ctx, const can_frame_t *frame)
{
    const can_tap_t *self = ctx;
    const hv_status_t status = hal_can_send(self->inner, frame);
    if (status == HV_OK) {
        self->sent(self->watcher, frame);
    }
    return status;
}

static void take_first(can_tap_t *self, can_frame_t *out, uint64_t *rx_time_us)
{
    *out = self->frame[self->first];
    *rx_time_us = 0;
    self->first = (self->first + 1u) % CAN_TAP_FRAMES;
    self->count--;
}

static hv_status_t tap_recv(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    can_tap_t *self = ctx;
    hv_status_t status = HV_OK;
    if (self->count == 0) {
        status = hal_can_recv(self->inner, out, rx_time_us);
    } else {
        take_first(self, out, rx_time_us);
    }
    if (status == HV_OK && self->received != NULL) {
        self->received(self->watcher, out);
    }
    return status;
}

static hv_status_t tap_bus_state(void *ctx, hal_can_state_t *out)
{
    return hal_can_bus_state(((const can_tap_t *)ctx)->inner, out);
}

static hv_status_t tap_unconfirmed(void *ctx, uint32_t *frames)
{
    return hal_can_unconfirmed(((const can_tap_t *)ctx)->inner, frames);
}

static hv_status_t tap_restart(void *ctx)
{
    return hal_can_restart(((const can_tap_t *)ctx)->inner);
}

static hv_status_t tap_ask_state(void *ctx, hal_can_state_t *out)
{
    return hal_can_ask_state(((const can_tap_t *)ctx)->inner, out);
}

hal_can_t can_tap_hal(can_tap_t *self)
{
    static const hal_can_ops_t k_ops = {tap_send, tap_recv, tap_bus_state, tap_unconfirmed, tap_restart, tap_ask_state};
    return (hal_can_t){&k_ops, self};
}

/* SPDX-License-Identifier: MIT
 * port.c - backends of a port in their smallest correct form: nothing comes in, nothing goes out, and the core is told so.
 * Replace the bodies by your chip's peripherals; what each may return, and within which time, stands in the contracts.
 */
#include "port.h"

#define RELAYS 8u

/* --- Frames --- */

/* Yours: copies the oldest datagram out of the queue that the network driver fills. */
static hv_status_t udp_recv(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    (void)ctx, (void)buffer, (void)capacity, (void)length, (void)from;
    return HV_ERR_AGAIN;
}

hal_udp_t port_udp(void)
{
    static const hal_udp_ops_t k_ops = {.recv = udp_recv};
    return (hal_udp_t){&k_ops, NULL};
}

/* --- CAN --- */

/* Yours: puts a frame into a transmit buffer that keeps the order. A controller that can be asked for what it has not sent yet
 * counts that in `unconfirmed`; without it the core cannot know whether an old set-point still waits. */
static hv_status_t can_send(void *ctx, const can_frame_t *frame)
{
    (void)ctx, (void)frame;
    return HV_ERR_IO;
}

static hv_status_t can_recv(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    (void)ctx, (void)out, (void)rx_time_us;
    return HV_ERR_IO;
}

static hv_status_t can_bus_state(void *ctx, hal_can_state_t *out)
{
    (void)ctx;
    *out = HAL_CAN_GONE;
    return HV_OK;
}

static hv_status_t can_unconfirmed(void *ctx, uint32_t *frames)
{
    (void)ctx;
    *frames = 0;
    return HV_OK;
}

/* Yours: empties the transmit buffers before the controller takes part in the bus again. */
static hv_status_t can_restart(void *ctx)
{
    (void)ctx;
    return HV_ERR_IO;
}

hal_can_t port_can(void)
{
    static const hal_can_ops_t k_ops = {
        .send = can_send, .recv = can_recv, .bus_state = can_bus_state, .unconfirmed = can_unconfirmed, .restart = can_restart};
    return (hal_can_t){&k_ops, NULL};
}

/* --- Relays and inputs --- */

/* Yours: one port of outputs, whose state at reset is the safe one. */
static hv_status_t relays_write(void *ctx, uint16_t mask)
{
    (void)ctx;
    return mask >> RELAYS == 0 ? HV_OK : HV_ERR_RANGE;
}

static uint8_t relays_count(void *ctx)
{
    (void)ctx;
    return RELAYS;
}

hal_relays_t port_relays(void)
{
    static const hal_relays_ops_t k_ops = {.write = relays_write, .count = relays_count};
    return (hal_relays_t){&k_ops, NULL};
}

/* Yours: levels as they are; an e-stop that cannot be read is HV_ERR_IO, never "not pressed". */
static hv_status_t inputs_read(void *ctx, uint32_t *levels)
{
    (void)ctx, (void)levels;
    return HV_ERR_IO;
}

static uint32_t inputs_present(void *ctx)
{
    (void)ctx;
    return INPUT_ESTOP | INPUT_RESET;
}

hal_inputs_t port_inputs(void)
{
    static const hal_inputs_ops_t k_ops = {.read = inputs_read, .present = inputs_present};
    return (hal_inputs_t){&k_ops, NULL};
}

/* --- Log, requests and time --- */

/* Yours: a ring that a background task prints. */
static void log_write(void *ctx, hal_log_level_t level, const char *text)
{
    (void)ctx, (void)level, (void)text;
}

static uint32_t log_dropped(void *ctx)
{
    (void)ctx;
    return 0;
}

hal_log_t port_log(void)
{
    static const hal_log_ops_t k_ops = {.write = log_write, .dropped = log_dropped};
    return (hal_log_t){&k_ops, NULL};
}

bool port_request(event_t *request)
{
    (void)request;
    return false;
}

uint32_t port_wait(uint32_t cycle_us)
{
    (void)cycle_us;
    return 0;
}

/* SPDX-License-Identifier: MIT
 * sim_can.c - a CAN bus in memory; see sim_can.h.
 */
#include "sim_can.h"

#include <string.h>

static bool has_interface(const sim_can_t *self)
{
    return self->state != HAL_CAN_DOWN && self->state != HAL_CAN_GONE;
}

static bool is_on_bus(const sim_can_t *self)
{
    return has_interface(self) && self->state != HAL_CAN_BUS_OFF;
}

static bool has_rx_room(const sim_can_t *self, uint32_t frames)
{
    return self->rx_count + frames <= SIM_CAN_RX_FRAMES;
}

static void push_rx(sim_can_t *self, const can_frame_t *frame, uint64_t time_us)
{
    if (!has_rx_room(self, 1)) {
        self->lost++;
        self->is_overrun = true;
        return;
    }
    self->rx[(self->rx_first + self->rx_count) % SIM_CAN_RX_FRAMES] = (sim_can_rx_t){*frame, time_us};
    self->rx_count++;
}

static void push_report(sim_can_t *self, uint32_t what, uint64_t time_us)
{
    push_rx(self, &(can_frame_t){.id = what, .is_error = true}, time_us);
}

/* The loss is reported where it happened: behind the last frame that was kept, before the first one after the gap. */
static void report_overrun(sim_can_t *self, uint64_t time_us)
{
    self->is_overrun = false;
    push_report(self, CAN_ERROR_OVERRUN, time_us);
}

static bool passes(const sim_can_t *self, const can_frame_t *frame)
{
    for (uint32_t i = 0; i < self->filters; i++) {
        const hal_can_filter_t *filter = &self->filter[i];
        if (filter->is_extended == frame->is_extended && ((frame->id ^ filter->id) & filter->mask) == 0) {
            return true;
        }
    }
    return self->filters == 0;
}

static void receive(sim_can_t *self, const can_frame_t *frame, uint64_t time_us)
{
    if (!is_on_bus(self) || !passes(self, frame)) {
        return;
    }
    if (self->is_overrun && has_rx_room(self, 2)) {
        report_overrun(self, time_us);
    }
    push_rx(self, frame, time_us);
}

/* What arbitration compares: the eleven leading bits first, then standard before extended. */
static uint32_t priority(const can_frame_t *frame)
{
    return frame->is_extended ? ((frame->id >> 18) << 19) | (1u << 18) | (frame->id & 0x3FFFFu) : frame->id << 19;
}

/* A lone controller repeats its frame for ever: errors of acknowledgement stop counting at error-passive. */
static void complain_no_ack(sim_can_t *self, uint64_t time_us)
{
    if (self->state != HAL_CAN_PASSIVE) {
        self->state = HAL_CAN_PASSIVE;
        push_report(self, CAN_ERROR_PASSIVE | CAN_ERROR_NO_ACK, time_us);
    }
}

static bool has_partner(const sim_can_bus_t *self, const sim_can_t *sender)
{
    for (uint32_t i = 0; i < self->nodes; i++) {
        if (self->node[i] != sender && is_on_bus(self->node[i])) {
            return true;
        }
    }
    return false;
}

static const sim_can_tx_t *head_of(const sim_can_t *self)
{
    return is_on_bus(self) && self->tx_count > 0 ? &self->tx[self->tx_first] : NULL;
}

/* When the wire can start the next frame; UINT64_MAX where nothing waits. */
static uint64_t next_start_us(const sim_can_bus_t *self)
{
    uint64_t start_us = UINT64_MAX;
    for (uint32_t i = 0; i < self->nodes; i++) {
        const sim_can_tx_t *head = head_of(self->node[i]);
        if (head != NULL && head->ready_us < start_us) {
            start_us = head->ready_us;
        }
    }
    return start_us < self->free_us ? self->free_us : start_us;
}

static sim_can_t *arbitrate(const sim_can_bus_t *self, uint64_t start_us)
{
    sim_can_t *winner = NULL;
    for (uint32_t i = 0; i < self->nodes; i++) {
        const sim_can_tx_t *head = head_of(self->node[i]);
        if (head != NULL && head->ready_us <= start_us &&
            (winner == NULL || priority(&head->frame) < priority(&head_of(winner)->frame))) {
            winner = self->node[i];
        }
    }
    return winner;
}

static void deliver(sim_can_bus_t *self, const sim_can_t *sender, const sim_can_tx_t *sent, uint64_t time_us)
{
    for (uint32_t i = 0; i < self->nodes; i++) {
        for (uint8_t copy = 0; self->node[i] != sender && copy < sent->copies; copy++) {
            receive(self->node[i], &sent->frame, time_us);
        }
    }
}

/* One frame of the winner; false where the wire stands still. */
static bool transmit(sim_can_bus_t *self, sim_can_t *winner, uint64_t end_us)
{
    const sim_can_tx_t sent = winner->tx[winner->tx_first];
    if (sent.is_fatal) {
        sim_can_set_state(winner, HAL_CAN_BUS_OFF);
        return true;
    }
    if (!has_partner(self, winner)) {
        complain_no_ack(winner, end_us);
        return false;
    }
    winner->tx_first = (winner->tx_first + 1) % SIM_CAN_TX_FRAMES;
    winner->tx_count--;
    self->free_us = end_us;
    self->frames++;
    deliver(self, winner, &sent, end_us);
    return true;
}

void sim_can_bus_init(sim_can_bus_t *self, uint32_t frame_us, const sim_can_fault_t *plan, uint32_t planned)
{
    memset(self, 0, sizeof *self);
    self->frame_us = frame_us;
    self->plan = plan;
    self->planned = planned;
}

void sim_can_bus_step(sim_can_bus_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    for (;;) {
        const uint64_t start_us = next_start_us(self);
        if (start_us > now_us || start_us + self->frame_us > now_us) {
            return;
        }
        if (!transmit(self, arbitrate(self, start_us), start_us + self->frame_us)) {
            return;
        }
    }
}

static bool is_sendable(const can_frame_t *frame)
{
    return !frame->is_error && frame->length <= 8 && frame->id <= (frame->is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX);
}

/* The frame's own copy: bytes beyond its length are 0 on the other side. */
static can_frame_t clean(const can_frame_t *frame)
{
    can_frame_t copy = *frame;
    const size_t used = frame->is_rtr ? 0 : frame->length;
    memset(copy.data + used, 0, sizeof copy.data - used);
    return copy;
}

/* Applies the plan to this send call; false where the frame is refused. */
static bool apply_plan(const sim_can_bus_t *self, sim_can_tx_t *tx)
{
    for (uint32_t i = 0; i < self->planned; i++) {
        if (self->plan[i].at != self->sends) {
            continue;
        }
        switch (self->plan[i].kind) {
        case SIM_CAN_DROP:
            tx->copies = 0;
            break;
        case SIM_CAN_DUPLICATE:
            tx->copies = 2;
            break;
        case SIM_CAN_DELAY:
            tx->ready_us += self->plan[i].delay_us;
            break;
        case SIM_CAN_BUS_OFF:
            tx->is_fatal = true;
            break;
        case SIM_CAN_FULL:
            return false;
        }
    }
    return true;
}

static hv_status_t can_send(void *ctx, const can_frame_t *frame)
{
    sim_can_t *self = ctx;
    if (!is_sendable(frame)) {
        return HV_ERR_ARG;
    }
    sim_can_tx_t tx = {.frame = clean(frame), .ready_us = self->bus->now_us, .copies = 1};
    self->bus->sends++;
    if (!has_interface(self)) {
        return HV_ERR_IO;
    }
    if (!apply_plan(self->bus, &tx) || self->tx_count >= self->room) {
        return HV_ERR_AGAIN;
    }
    self->tx[(self->tx_first + self->tx_count) % SIM_CAN_TX_FRAMES] = tx;
    self->tx_count++;
    return HV_OK;
}

static hv_status_t can_recv(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    sim_can_t *self = ctx;
    if (!has_interface(self)) {
        return HV_ERR_IO;
    }
    if (self->rx_count == 0 && self->is_overrun) {
        report_overrun(self, self->bus->now_us);
    }
    if (self->rx_count == 0) {
        return HV_ERR_AGAIN;
    }
    *out = self->rx[self->rx_first].frame;
    *rx_time_us = self->rx[self->rx_first].time_us;
    self->rx_first = (self->rx_first + 1) % SIM_CAN_RX_FRAMES;
    self->rx_count--;
    return HV_OK;
}

static hv_status_t can_bus_state(void *ctx, hal_can_state_t *out)
{
    const sim_can_t *self = ctx;
    *out = self->state;
    return HV_OK;
}

static hv_status_t can_unconfirmed(void *ctx, uint32_t *frames)
{
    const sim_can_t *self = ctx;
    *frames = self->tx_count;
    return HV_OK;
}

static void forget_queues(sim_can_t *self)
{
    self->tx_count = 0;
    self->rx_count = 0;
    self->is_overrun = false;
}

static hv_status_t can_restart(void *ctx)
{
    sim_can_t *self = ctx;
    if (!self->is_plugged) {
        return HV_ERR_AGAIN;
    }
    forget_queues(self);
    self->state = HAL_CAN_ACTIVE;
    return HV_OK;
}

hv_status_t sim_can_open(sim_can_t *self, sim_can_bus_t *bus, const hal_can_filter_t *filter, uint32_t filters)
{
    if (filters > SIM_CAN_FILTERS_MAX) {
        return HV_ERR_ARG;
    }
    if (bus->nodes == SIM_CAN_NODES_MAX) {
        return HV_ERR_FULL;
    }
    memset(self, 0, sizeof *self);
    self->bus = bus;
    self->is_plugged = true;
    self->room = SIM_CAN_TX_FRAMES;
    self->state = HAL_CAN_ACTIVE;
    self->filters = filters;
    for (uint32_t i = 0; i < filters; i++) {
        self->filter[i] = filter[i];
    }
    bus->node[bus->nodes++] = self;
    return HV_OK;
}

void sim_can_close(sim_can_t *self)
{
    sim_can_bus_t *bus = self->bus;
    for (uint32_t i = 0; i < bus->nodes; i++) {
        if (bus->node[i] == self) {
            bus->nodes--;
            /* NOLINTNEXTLINE(bugprone-sizeof-expression): the elements are pointers */
            memmove(&bus->node[i], &bus->node[i + 1], (bus->nodes - i) * sizeof bus->node[0]);
            return;
        }
    }
}

void sim_can_unplug(sim_can_t *self)
{
    self->is_plugged = false;
    self->state = HAL_CAN_GONE;
    forget_queues(self);
}

void sim_can_plug(sim_can_t *self)
{
    self->is_plugged = true;
}

void sim_can_set_state(sim_can_t *self, hal_can_state_t state)
{
    static const uint32_t k_report[] = {
        [HAL_CAN_ACTIVE] = CAN_ERROR_OTHER,    [HAL_CAN_WARNING] = CAN_ERROR_WARNING, [HAL_CAN_PASSIVE] = CAN_ERROR_PASSIVE,
        [HAL_CAN_BUS_OFF] = CAN_ERROR_BUS_OFF, [HAL_CAN_DOWN] = CAN_ERROR_OTHER,      [HAL_CAN_GONE] = CAN_ERROR_OTHER,
    };
    if (self->state != state) {
        const bool is_restart = self->state == HAL_CAN_BUS_OFF && state == HAL_CAN_ACTIVE;
        self->state = state;
        sim_can_report(self, is_restart ? (uint32_t)CAN_ERROR_RESTARTED : k_report[state]);
    }
}

void sim_can_report(sim_can_t *self, uint32_t error)
{
    push_report(self, error, self->bus->now_us);
}

hal_can_t sim_can_hal(sim_can_t *self)
{
    static const hal_can_ops_t k_ops = {can_send, can_recv, can_bus_state, can_unconfirmed, can_restart, NULL};
    return (hal_can_t){&k_ops, self};
}

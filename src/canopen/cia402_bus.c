/* SPDX-License-Identifier: MIT */
#include "cia402_bus.h"

#include "cia402_loss.h"
#include "cia402_node.h"
#include "cia402_stage.h"

#define STALLED_PERIODS  3u
#define RESTART_US       500000u /* between attempts to restart the bus */
#define SILENCE_LEAST_US 500000u

void cia402_bus_lose(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_lose(cia402_drive(self, k), CIA402_LOST_BUS);
    }
}

static bool is_controller_up(const cia402_t *self)
{
    hal_can_state_t state = HAL_CAN_DOWN;
    return hal_can_bus_state(self->can, &state) == HV_OK && state != HAL_CAN_BUS_OFF && state != HAL_CAN_DOWN &&
           state != HAL_CAN_GONE;
}

/* The drives' watch over our heartbeat runs out before we are heard again. */
static uint64_t silence_us(const cia402_t *self)
{
    const uint64_t watch_us = self->config->heartbeat_timeout_ms * (uint64_t)1500u;
    return watch_us > SILENCE_LEAST_US ? watch_us : SILENCE_LEAST_US;
}

static void come_back(cia402_t *self)
{
    self->is_gone = false;
    self->is_refused = false;
    self->is_preop_due = true;
    self->free_us = self->now_us;
    self->due_us = self->now_us;
    self->is_due = true;
    self->restarts++;
}

static void try_restart(cia402_t *self, bool is_bad)
{
    if (self->now_us - self->gone_us < silence_us(self) || self->now_us - self->restart_us < RESTART_US) {
        return;
    }
    self->restart_us = self->now_us;
    const hv_status_t status = hal_can_restart(self->can);
    if (status == HV_OK || (status == HV_ERR_NOSUP && !is_bad)) {
        come_back(self);
    }
}

void cia402_bus_watch(cia402_t *self, bool is_up)
{
    uint32_t waiting = 0;
    self->is_free = hal_can_unconfirmed(self->can, &waiting) != HV_OK || waiting == 0;
    self->free_us = self->is_free && !self->is_refused ? self->now_us : self->free_us;
    const bool is_stalled = self->now_us - self->free_us >= (uint64_t)STALLED_PERIODS * self->config->period_us;
    const bool is_bad = !is_up || is_stalled || !is_controller_up(self);
    if (is_bad && !self->is_gone) {
        self->is_gone = true;
        self->gone_us = self->now_us;
        cia402_stage_end(self, CIA402_GOAL_OFF);
        cia402_bus_lose(self);
    }
    if (self->is_gone) {
        try_restart(self, is_bad);
    }
}

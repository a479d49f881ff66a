/* SPDX-License-Identifier: MIT
 * sim_clock.c - simulated clock; see sim_clock.h.
 */
#include "sim_clock.h"

static uint64_t clock_now_us(void *ctx)
{
    const sim_clock_t *self = ctx;
    return self->now_us;
}

static hv_status_t clock_sleep_until_us(void *ctx, uint64_t deadline_us)
{
    sim_clock_t *self = ctx;
    self->sleeps++;
    if (deadline_us > self->now_us) {
        self->now_us = deadline_us;
    }
    if (self->sleeps == self->late_at) {
        self->now_us += self->late_us;
    }
    return HV_OK;
}

void sim_clock_init(sim_clock_t *self, uint64_t start_us)
{
    *self = (sim_clock_t){.now_us = start_us};
}

void sim_clock_advance(sim_clock_t *self, uint64_t by_us)
{
    self->now_us += by_us;
}

hal_clock_t sim_clock_hal(sim_clock_t *self)
{
    static const hal_clock_ops_t k_ops = {clock_now_us, clock_sleep_until_us};
    return (hal_clock_t){&k_ops, self};
}

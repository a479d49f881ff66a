/* SPDX-License-Identifier: MIT
 * sim_relays.c - simulated bank of relays; see sim_relays.h.
 */
#include "sim_relays.h"

static hv_status_t relays_write(void *ctx, uint16_t mask)
{
    sim_relays_t *self = ctx;
    if ((uint32_t)mask >> self->count != 0) {
        return HV_ERR_RANGE;
    }
    if (sim_fail_now(&self->fail)) {
        return HV_ERR_IO;
    }
    self->mask = mask;
    self->writes++;
    return HV_OK;
}

static hv_status_t relays_read_back(void *ctx, uint16_t *mask)
{
    const sim_relays_t *self = ctx;
    *mask = self->mask;
    return HV_OK;
}

static uint8_t relays_count(void *ctx)
{
    const sim_relays_t *self = ctx;
    return self->count;
}

void sim_relays_init(sim_relays_t *self, uint8_t count)
{
    *self = (sim_relays_t){.count = (uint8_t)(count < HAL_RELAYS_MAX ? count : HAL_RELAYS_MAX)};
}

hal_relays_t sim_relays_hal(sim_relays_t *self)
{
    static const hal_relays_ops_t k_ops = {relays_write, relays_read_back, relays_count};
    return (hal_relays_t){&k_ops, self};
}

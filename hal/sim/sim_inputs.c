/* SPDX-License-Identifier: MIT
 * sim_inputs.c - simulated switches; see sim_inputs.h.
 */
#include "sim_inputs.h"

static hv_status_t inputs_read(void *ctx, uint32_t *levels)
{
    sim_inputs_t *self = ctx;
    if (sim_fail_now(&self->fail) || self->is_broken) {
        return HV_ERR_IO;
    }
    *levels = self->levels;
    return HV_OK;
}

static uint32_t inputs_present(void *ctx)
{
    const sim_inputs_t *self = ctx;
    return self->present;
}

void sim_inputs_init(sim_inputs_t *self, uint32_t present)
{
    *self = (sim_inputs_t){.present = present};
}

void sim_inputs_set(sim_inputs_t *self, uint32_t input, bool is_active)
{
    const uint32_t bits = input & self->present;
    self->levels = is_active ? self->levels | bits : self->levels & ~bits;
}

hal_inputs_t sim_inputs_hal(sim_inputs_t *self)
{
    static const hal_inputs_ops_t k_ops = {inputs_read, inputs_present};
    return (hal_inputs_t){&k_ops, self};
}

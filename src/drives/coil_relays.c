/* SPDX-License-Identifier: MIT
 * coil_relays.c - relays on the coils of a Modbus device; see heave/coil_relays.h.
 */
#include "heave/coil_relays.h"

static uint16_t all_relays(const coil_relays_t *self)
{
    return (uint16_t)((1u << self->config.count) - 1u);
}

static bool is_closed(uint16_t mask, unsigned relay)
{
    return (mask >> relay & 1u) != 0;
}

static hv_status_t submit(coil_relays_t *self, modbus_request_t *request)
{
    self->tag++;
    self->calls = self->is_asking ? self->calls : 0;
    request->unit = self->config.unit;
    request->address = self->config.first_coil;
    request->count = self->config.count;
    request->tag = self->tag;
    self->is_asking = true;
    return hal_modbus_submit(self->config.line, self->config.slot, request);
}

static hv_status_t submit_write(coil_relays_t *self)
{
    modbus_request_t request = {.function = MODBUS_WRITE_COILS};
    for (unsigned i = 0; i < self->config.count; i++) {
        request.value[i] = is_closed(self->wanted, i) != self->config.is_active_low;
    }
    self->is_written = false;
    return submit(self, &request);
}

static hv_status_t submit_look(coil_relays_t *self)
{
    modbus_request_t request = {.function = MODBUS_READ_COILS};
    return submit(self, &request);
}

static uint16_t mask_of(const coil_relays_t *self, const modbus_result_t *result)
{
    uint16_t mask = 0;
    for (unsigned i = 0; i < self->config.count; i++) {
        if ((result->value[i] != 0) != self->config.is_active_low) {
            mask = (uint16_t)(mask | 1u << i);
        }
    }
    return mask;
}

/* A read has values, a write that worked has none: then the board has what it was told. */
static void apply_answer(coil_relays_t *self, const modbus_result_t *result)
{
    self->failures = 0;
    self->calls = 0;
    self->reported = result->count > 0 ? mask_of(self, result) : self->wanted;
    self->is_reported = true;
    self->is_written = self->reported == self->wanted;
}

static void receive_result(coil_relays_t *self)
{
    modbus_result_t result;
    if (hal_modbus_poll(self->config.line, self->config.slot, &result) != HV_OK || result.tag != self->tag) {
        return; /* nothing new, or of a mask that a newer one has replaced */
    }
    self->is_asking = false;
    if (result.status == HV_OK && (result.count == 0 || result.count == self->config.count)) {
        apply_answer(self, &result);
    } else if (self->failures < COIL_RELAYS_TRIES) {
        self->failures++;
    }
}

static bool is_known(const coil_relays_t *self)
{
    return self->failures < COIL_RELAYS_TRIES;
}

/* The next transaction, where one is due. */
static void go_on(coil_relays_t *self)
{
    if (self->is_asking) {
        return;
    }
    if (!self->is_written) {
        (void)!submit_write(self); /* taken before with other values */
    } else if (self->failures > 0 || self->calls >= self->config.look_calls) {
        (void)!submit_look(self);
    }
}

static hv_status_t relays_write(void *ctx, uint16_t mask)
{
    coil_relays_t *self = ctx;
    if ((mask & ~(unsigned)all_relays(self)) != 0) {
        return HV_ERR_RANGE;
    }
    if (mask != self->wanted) { /* else it is written, or on its way */
        self->wanted = mask;
        (void)!submit_write(self); /* taken before with other values */
    }
    return is_known(self) ? HV_OK : HV_ERR_IO;
}

static hv_status_t relays_read_back(void *ctx, uint16_t *mask)
{
    coil_relays_t *self = ctx;
    if (self->config.count > 0) {
        receive_result(self);
        self->calls += self->calls < self->config.look_calls;
        if (self->is_asking && self->calls == self->config.look_calls) {
            self->failures = COIL_RELAYS_TRIES; /* the line's worker is stuck */
        }
        go_on(self);
    }
    if (!is_known(self)) {
        return HV_ERR_IO;
    }
    if (!self->is_reported || !self->is_written) {
        return HV_ERR_AGAIN;
    }
    *mask = self->reported;
    return HV_OK;
}

static uint8_t relays_count(void *ctx)
{
    const coil_relays_t *self = ctx;
    return self->config.count;
}

hv_status_t coil_relays_init(coil_relays_t *self, const coil_relays_config_t *config)
{
    *self = (coil_relays_t){.config = *config};
    if (config->count > HAL_RELAYS_MAX || config->look_calls == 0 || config->first_coil > 0x10000u - HAL_RELAYS_MAX) {
        return HV_ERR_RANGE;
    }
    self->wanted = (uint16_t)(config->start_mask & all_relays(self));
    if (config->count == 0) {
        self->is_reported = self->is_written = true;
        return HV_OK;
    }
    return submit_write(self) == HV_OK ? HV_OK : HV_ERR_RANGE;
}

hal_relays_t coil_relays_hal(coil_relays_t *self)
{
    static const hal_relays_ops_t k_ops = {relays_write, relays_read_back, relays_count};
    return (hal_relays_t){&k_ops, self};
}

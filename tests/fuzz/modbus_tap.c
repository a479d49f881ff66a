/* SPDX-License-Identifier: MIT
 * modbus_tap.c - between a driver and the simulated lines of its drives; see modbus_tap.h.
 */
#include "modbus_tap.h"

static hv_status_t tap_submit(void *ctx, unsigned slot, const modbus_request_t *request)
{
    const modbus_tap_line_t *self = ctx;
    const hv_status_t status = hal_modbus_submit(self->inner, slot, request);
    if (status == HV_OK) {
        self->tap->asked(self->tap->watcher, (unsigned)(self - self->tap->line), slot, request);
    }
    return status;
}

/* A reply that is of no use carries nothing. */
static modbus_result_t failed(const modbus_result_t *result, hv_status_t status, uint8_t exception)
{
    return (modbus_result_t){.status = status, .exception = exception, .tag = result->tag, .done_us = result->done_us};
}

static void spoil(const modbus_tap_plan_t *plan, modbus_result_t *result)
{
    switch (plan->how) {
    case MODBUS_TAP_EXCEPTION:
        *result = failed(result, HV_ERR_STATE, plan->at);
        break;
    case MODBUS_TAP_TIMEOUT:
        *result = failed(result, HV_ERR_TIMEOUT, 0);
        break;
    case MODBUS_TAP_DAMAGED:
        *result = failed(result, HV_ERR_FORMAT, 0);
        break;
    case MODBUS_TAP_NO_LINK:
        *result = failed(result, HV_ERR_IO, 0);
        break;
    case MODBUS_TAP_COUNT:
        result->count = result->count != 0 ? (uint8_t)(plan->at % (HAL_MODBUS_VALUES_MAX + 1u)) : 0;
        break;
    case MODBUS_TAP_VALUE:
        if (plan->at < result->count) {
            result->value[plan->at] = plan->value;
        }
        break;
    case MODBUS_TAP_NOTHING:
        break;
    }
}

static hv_status_t take_extra(modbus_tap_line_t *self, unsigned slot, modbus_result_t *result)
{
    if (!self->has_extra[slot]) {
        return HV_ERR_AGAIN;
    }
    self->has_extra[slot] = false;
    *result = self->extra[slot];
    return HV_OK;
}

static void take_reply(modbus_tap_line_t *self, unsigned slot, modbus_result_t *result)
{
    modbus_tap_plan_t *plan = &self->plan[slot];
    if (plan->replies > 0) {
        plan->replies--;
        spoil(plan, result);
    }
    if (self->is_down) {
        *result = failed(result, HV_ERR_IO, 0);
    }
}

static hv_status_t tap_poll(void *ctx, unsigned slot, modbus_result_t *result)
{
    modbus_tap_line_t *self = ctx;
    modbus_result_t got;
    hv_status_t status = self->is_stuck ? HV_ERR_AGAIN : hal_modbus_poll(self->inner, slot, &got);
    if (status == HV_OK) {
        take_reply(self, slot, &got);
    } else {
        status = take_extra(self, slot, &got);
    }
    if (status == HV_OK) {
        *result = got;
        self->tap->answered(self->tap->watcher, (unsigned)(self - self->tap->line), slot, result);
    }
    return status;
}

void modbus_tap_open(modbus_tap_t *self, const hal_modbus_t inner[DRIVES_MAX], hal_modbus_t outer[DRIVES_MAX])
{
    static const hal_modbus_ops_t k_ops = {tap_submit, tap_poll};
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        self->line[i].tap = self;
        self->line[i].inner = inner[i];
        outer[i] = (hal_modbus_t){&k_ops, &self->line[i]};
    }
}

/* SPDX-License-Identifier: MIT
 * sim_modbus.c - a Modbus line in memory; see sim_modbus.h.
 */
#include "sim_modbus.h"

#include <string.h>

/* Reads or writes one register or coil. */
static void access_value(sim_modbus_device_t *device, modbus_function_t function, size_t address, uint16_t sent, uint16_t *got)
{
    switch (function) {
    case MODBUS_READ_COILS:
        *got = device->coil[address];
        break;
    case MODBUS_READ_DISCRETE_INPUTS:
        *got = device->discrete[address];
        break;
    case MODBUS_READ_HOLDING:
        *got = device->holding[address];
        break;
    case MODBUS_READ_INPUT:
        *got = device->input[address];
        break;
    case MODBUS_WRITE_COIL:
    case MODBUS_WRITE_COILS:
        device->coil[address] = sent != 0;
        break;
    case MODBUS_WRITE_REGISTER:
    case MODBUS_WRITE_REGISTERS:
        device->holding[address] = sent;
        break;
    }
}

/* The device's part: acts and fills the answer. */
static void serve(sim_modbus_device_t *device, const modbus_request_t *request, modbus_result_t *result)
{
    if (device->answer != NULL) {
        device->answer(device->ctx, device, request, result);
        return;
    }
    if (request->address + (uint32_t)request->count > SIM_MODBUS_VALUES) {
        result->status = HV_ERR_STATE;
        result->exception = 2;
        return;
    }
    result->status = HV_OK;
    result->count = modbus_is_write(request->function) ? 0 : request->count;
    for (size_t i = 0; i < request->count; i++) {
        access_value(device, request->function, request->address + i, request->value[i], &result->value[i]);
    }
}

/* Shows the request to every device it is meant for; nobody answers a broadcast. */
static void put_on_wire(sim_modbus_t *self, const modbus_request_t *request, modbus_result_t *result)
{
    const bool is_broadcast = request->unit == HAL_MODBUS_BROADCAST;
    result->status = HV_ERR_TIMEOUT;
    for (uint32_t i = 0; i < self->devices; i++) {
        if (is_broadcast || self->device[i].unit == request->unit) {
            serve(&self->device[i], request, result);
        }
    }
    if (is_broadcast) {
        result->status = HV_OK;
        result->exception = 0;
    }
}

static const sim_modbus_fault_t *planned_fault(const sim_modbus_t *self)
{
    for (uint32_t i = 0; i < self->planned; i++) {
        if (self->plan[i].at == self->transactions) {
            return &self->plan[i];
        }
    }
    return NULL;
}

/* An answer that is of no use: what it carried must not be seen. */
static modbus_result_t failed(const modbus_request_t *request, hv_status_t status, uint8_t exception)
{
    return (modbus_result_t){.status = status, .exception = exception, .tag = request->tag};
}

static modbus_result_t run_with_fault(sim_modbus_t *self, const modbus_request_t *request, const sim_modbus_fault_t *fault)
{
    modbus_result_t result = {.tag = request->tag};
    switch (fault->kind) {
    case SIM_MODBUS_EXCEPTION:
        return failed(request, HV_ERR_STATE, fault->code);
    case SIM_MODBUS_SILENT:
        return failed(request, HV_ERR_TIMEOUT, 0);
    case SIM_MODBUS_LATE:
        put_on_wire(self, request, &result);
        return failed(request, HV_ERR_TIMEOUT, 0);
    case SIM_MODBUS_DAMAGED:
        put_on_wire(self, request, &result);
        return failed(request, HV_ERR_FORMAT, 0);
    case SIM_MODBUS_NO_LINK:
        return failed(request, HV_ERR_IO, 0);
    }
    return result;
}

static modbus_result_t run(sim_modbus_t *self, const modbus_request_t *request)
{
    const sim_modbus_fault_t *fault = planned_fault(self);
    if (fault != NULL) {
        return run_with_fault(self, request, fault);
    }
    modbus_result_t result = {.tag = request->tag};
    put_on_wire(self, request, &result);
    if (result.status == HV_OK && modbus_is_write(request->function)) {
        memcpy(result.value, request->value, sizeof result.value);
    }
    return result;
}

/* Starts the next waiting slot in turn; false where none waits. */
static bool start_next(sim_modbus_t *self, uint64_t start_us)
{
    for (unsigned i = 1; i <= HAL_MODBUS_SLOTS; i++) {
        const unsigned slot = (self->on_wire + i) % HAL_MODBUS_SLOTS;
        if (!self->slot[slot].is_waiting) {
            continue;
        }
        self->slot[slot].is_waiting = false;
        self->on_wire = slot;
        self->is_busy = true;
        self->transactions++;
        self->result = run(self, &self->slot[slot].request);
        self->done_us = start_us + (self->result.status == HV_ERR_TIMEOUT ? self->timeout_us : self->transaction_us);
        self->result.done_us = self->done_us;
        return true;
    }
    return false;
}

static void finish(sim_modbus_t *self)
{
    self->slot[self->on_wire].result = self->result;
    self->slot[self->on_wire].has_result = true;
    self->is_busy = false;
}

static hv_status_t modbus_submit(void *ctx, unsigned slot, const modbus_request_t *request)
{
    sim_modbus_t *self = ctx;
    if (slot >= HAL_MODBUS_SLOTS || !modbus_is_valid(request)) {
        return HV_ERR_ARG;
    }
    self->replaced += self->slot[slot].is_waiting;
    self->slot[slot].request = *request;
    self->slot[slot].is_waiting = true;
    return HV_OK;
}

static hv_status_t modbus_poll(void *ctx, unsigned slot, modbus_result_t *result)
{
    sim_modbus_t *self = ctx;
    if (slot >= HAL_MODBUS_SLOTS) {
        return HV_ERR_ARG;
    }
    if (!self->slot[slot].has_result) {
        return HV_ERR_AGAIN;
    }
    *result = self->slot[slot].result;
    self->slot[slot].has_result = false;
    return HV_OK;
}

void sim_modbus_init(sim_modbus_t *self, sim_modbus_device_t *device, uint32_t devices, uint32_t transaction_us,
                     uint32_t timeout_us, const sim_modbus_fault_t *plan, uint32_t planned)
{
    memset(self, 0, sizeof *self);
    self->device = device;
    self->devices = devices;
    self->transaction_us = transaction_us;
    self->timeout_us = timeout_us;
    self->plan = plan;
    self->planned = planned;
    self->on_wire = HAL_MODBUS_SLOTS - 1;
}

void sim_modbus_step(sim_modbus_t *self, uint64_t now_us)
{
    /* Requests came in after the last step: the first one starts now, the ones behind it when the wire is free again. */
    uint64_t start_us = self->is_busy ? self->done_us : self->now_us;
    self->now_us = now_us;
    for (;;) {
        if (!self->is_busy && !start_next(self, start_us)) {
            return;
        }
        if (self->done_us > now_us) {
            return;
        }
        start_us = self->done_us;
        finish(self);
    }
}

hal_modbus_t sim_modbus_hal(sim_modbus_t *self)
{
    static const hal_modbus_ops_t k_ops = {modbus_submit, modbus_poll};
    return (hal_modbus_t){&k_ops, self};
}

/* SPDX-License-Identifier: MIT
 * modbus_drives.c - heave-twin's drives on simulated Modbus lines; see modbus_drives.h.
 */
#include "modbus_drives.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "modbus_maps.h"

#define SPEED     60000.0 /* counts/s */
#define HOMING_US 30000.0

void modbus_drives_command(modbus_drives_t *self, unsigned k, modbus_drive_command_t command)
{
    const modbus_drive_block_t *block = &self->map.command[command].block[0];
    if (self->map.command[command].count > 0) {
        (void)register_drive_write(&self->twin[k], block->address, block->data, block->count, self->now_us);
    }
}

/* Its way from where it is told to be, or is; a target left from before is a step when torque comes. */
static int write_target(modbus_drives_t *self, unsigned k, const modbus_request_t *request)
{
    modbus_asked_t *asked = &self->asked[k];
    register_drive_t *twin = &self->twin[k];
    const uint16_t *value = request->value;
    const bool had_torque = twin->motor->has_torque;
    const int64_t from = had_torque && !asked->is_homed_since ? asked->target : register_drive_count(twin);
    if (request->address == (self->is_small ? 100 : 10)) {
        const int32_t target = self->is_small ? (int16_t)value[0] : (int32_t)((uint32_t)value[0] << 16 | value[1]);
        asked->targets += had_torque && target != asked->target;
        asked->target = target;
        asked->is_homed_since = false;
    }
    const int exception = register_drive_write(twin, request->address, value, request->count, self->now_us);
    if (twin->state == REGISTER_TORQUE && !asked->is_homed_since) {
        asked->largest_step = (int32_t)fx_clamp(llabs(asked->target - from), asked->largest_step, INT32_MAX);
    }
    return exception;
}

static void stop(modbus_drives_t *self, unsigned k)
{
    motor_t *motor = &self->motor[k];
    const double speed = self->is_small ? 2000 : SPEED;
    self->asked[k].stops++;
    if (!self->is_holding_on_stop) {
        modbus_drives_command(self, k, MODBUS_DRIVE_DISABLE);
    } else if (motor->has_torque) {
        motor_travel(motor, motor->demand + speed * self->glide_takes_us / 1e6, speed);
    }
}

static int write(modbus_drives_t *self, unsigned k, const modbus_request_t *request)
{
    modbus_asked_t *asked = &self->asked[k];
    motor_t *motor = &self->motor[k];
    const unsigned control = self->is_small ? request->address : request->address == 0 ? 0x1000u + request->value[0] : 0;
    if (asked->is_weak && (control == 0x1001 || (control == 101 && request->value[0] != 0))) {
        return MODBUS_NO_EXCEPTION;
    }
    if (!self->is_small && request->address <= 12 && request->address + request->count > 12) {
        asked->speed = request->value[12 - request->address];
    }
    const int exception = write_target(self, k, request);
    if (exception == MODBUS_NO_VALUE) {
        abort(); /* nothing of this dialect */
    }
    if (control == 0x1002 || control == 102) {
        stop(self, k);
    } else if (control == 0x1004 && self->twin[k].state == REGISTER_HOMING) {
        asked->is_homed_since = true;
        motor_travel(motor, motor->goal, fabs(motor->goal - motor->demand) * 1e6 / HOMING_US);
    }
    return exception;
}

static void answer(void *ctx, const sim_modbus_device_t *device, const modbus_request_t *request, modbus_result_t *result)
{
    modbus_drives_t *self = ctx;
    const unsigned k = (unsigned)(device - self->device);
    register_drive_t *twin = &self->twin[k];
    if (twin->is_cut) {
        return;
    }
    if (modbus_is_write(request->function)) {
        result->exception = (uint8_t)write(self, k, request);
    } else if ((request->function == MODBUS_READ_INPUT) == self->is_small) {
        result->count = request->count;
        result->exception = (uint8_t)register_drive_read(twin, request->address, result->value, request->count);
    } else {
        abort(); /* nothing of this dialect */
    }
    result->status = result->exception == MODBUS_NO_EXCEPTION ? HV_OK : HV_ERR_STATE;
    result->count = result->exception == MODBUS_NO_EXCEPTION ? result->count : 0;
}

void modbus_drives_open(modbus_drives_t *self, bool is_small, bool is_shared, uint32_t transaction_us, uint32_t timeout_us)
{
    memset(self, 0, sizeof *self);
    self->is_small = is_small;
    self->is_shared = is_shared;
    self->map = is_small ? modbus_maps_small(is_shared) : modbus_maps_wide(is_shared);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        register_drive_t *twin = &self->twin[k];
        register_drive_init(twin, &self->map, k);
        twin->motor = &self->motor[k];
        twin->home = is_small ? 0 : MODBUS_DRIVES_WIDE_ZERO;
        twin->usual_speed = SPEED;
        twin->is_torque_kept = true;
        register_drive_power(twin, true, 0);
        twin->is_homed = true;
        self->device[k] = (sim_modbus_device_t){.answer = answer, .ctx = self, .unit = self->map.axis[k].unit};
        sim_modbus_init(&self->line[k], is_shared ? self->device : &self->device[k], is_shared ? DRIVES_MAX : 1, transaction_us,
                        timeout_us, NULL, 0);
    }
}

void modbus_drives_lines(modbus_drives_t *self, hal_modbus_t line[DRIVES_MAX])
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        line[k] = sim_modbus_hal(&self->line[self->map.axis[k].line]);
    }
}

void modbus_drives_place(modbus_drives_t *self, unsigned k, int32_t counts)
{
    self->motor[k].actual = counts;
    motor_hold(&self->motor[k]);
    self->twin[k].origin = 0;
}

void modbus_drives_power(modbus_drives_t *self, unsigned k, bool is_on)
{
    self->twin[k].is_cut = !is_on;
    if (!is_on) {
        register_drive_drop(&self->twin[k]);
    }
}

uint16_t modbus_drives_register(modbus_drives_t *self, unsigned k, uint16_t address)
{
    return register_drive_find(&self->twin[k], address)->value;
}

void modbus_drives_step(modbus_drives_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        register_drive_advance(&self->twin[k], now_us);
    }
    for (unsigned k = 0; k < (self->is_shared ? 1u : DRIVES_MAX); k++) {
        sim_modbus_step(&self->line[k], now_us);
    }
}

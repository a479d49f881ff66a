/* SPDX-License-Identifier: MIT
 * modbus_slave.c - simulated drives on simulated Modbus lines; see modbus_slave.h.
 */
#include "modbus_slave.h"

#include <stdlib.h>
#include <string.h>

#define NOBODY    254u /* unit of a drive that is off */
#define HOMING_US 30000u
#define UNTOUCHED 0x5A5Au /* a control register that nobody has written */

static void tell(modbus_slave_t *self, unsigned k)
{
    const modbus_slave_drive_t *drive = &self->drive[k];
    sim_modbus_device_t *device = &self->device[k];
    const uint32_t position = (uint32_t)drive->position;
    if (self->is_small) {
        device->input[110] = (uint16_t)position;
        device->input[111] = (uint16_t)(drive->is_enabled << 3 | drive->is_faulty << 7);
        return;
    }
    device->holding[1] = (uint16_t)(drive->is_enabled | drive->is_faulty << 1 | drive->is_homed << 2);
    device->holding[2] = (uint16_t)(position >> 16);
    device->holding[3] = (uint16_t)position;
    device->holding[4] = drive->is_faulty ? 0x0E21 : 0;
    device->holding[21] = 0x0203;
}

void modbus_slave_place(modbus_slave_t *self, unsigned k, int32_t position)
{
    self->drive[k].position = position;
    tell(self, k);
}

void modbus_slave_open(modbus_slave_t *self, bool is_small, bool is_shared, uint32_t transaction_us, uint32_t timeout_us,
                       const sim_modbus_fault_t *plan, uint32_t planned)
{
    memset(self, 0, sizeof *self);
    self->is_small = is_small;
    self->is_shared = is_shared;
    for (unsigned k = 0; k < MODBUS_SLAVES; k++) {
        self->drive[k].is_on = true;
        self->drive[k].is_homed = true;
        self->device[k].holding[0] = UNTOUCHED;
        tell(self, k);
        sim_modbus_init(&self->line[k], is_shared ? self->device : &self->device[k], is_shared ? MODBUS_SLAVES : 1,
                        transaction_us, timeout_us, plan, planned);
    }
}

void modbus_slave_lines(modbus_slave_t *self, hal_modbus_t line[DRIVES_MAX])
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        line[k] = sim_modbus_hal(&self->line[self->is_shared ? 0 : k]);
    }
}

/* A way of any length. */
static int32_t step_between(int32_t from, int32_t to)
{
    const int64_t way = llabs((int64_t)to - from);
    return way < INT32_MAX ? (int32_t)way : INT32_MAX;
}

static void set_target(modbus_slave_drive_t *drive, int32_t target)
{
    const int32_t from = drive->is_target_set ? drive->target : drive->position;
    if (drive->is_enabled && target != drive->target) {
        const int32_t step = step_between(from, target);
        drive->largest_step = step > drive->largest_step ? step : drive->largest_step;
        drive->targets++;
    }
    drive->target = target;
    drive->is_target_set = true;
}

/* A target left from before is a step now. */
static void enable(modbus_slave_drive_t *drive)
{
    const int32_t step = drive->is_target_set ? step_between(drive->position, drive->target) : 0;
    if (drive->is_faulty || drive->is_enabled || drive->is_weak) {
        return;
    }
    drive->is_enabled = true;
    drive->is_stopped = false;
    drive->largest_step = step > drive->largest_step ? step : drive->largest_step;
}

static void begin_homing(modbus_slave_drive_t *drive, uint64_t now_us)
{
    drive->is_homing = true;
    drive->is_homed = false;
    drive->homing_us = now_us + HOMING_US;
}

static void stop(const modbus_slave_t *self, modbus_slave_drive_t *drive, uint64_t now_us)
{
    drive->is_stopped = self->is_holding_on_stop && drive->is_enabled;
    drive->glide_us = now_us + self->glide_takes_us;
    drive->is_enabled = drive->is_stopped;
    drive->is_homing = false;
    drive->stops++;
}

static void obey_wide(const modbus_slave_t *self, modbus_slave_drive_t *drive, sim_modbus_device_t *device, uint64_t now_us)
{
    set_target(drive, (int32_t)((uint32_t)device->holding[10] << 16 | device->holding[11]));
    drive->speed = device->holding[12];
    switch (device->holding[0]) {
    case 0:
        drive->is_enabled = false;
        drive->is_homing = false;
        break;
    case 1:
        enable(drive);
        break;
    case 2:
        stop(self, drive, now_us);
        break;
    case 4:
        begin_homing(drive, now_us);
        break;
    case 8:
        drive->is_faulty = false;
        break;
    case UNTOUCHED:
        break;
    default:
        abort(); /* nothing of this dialect */
    }
    device->holding[0] = UNTOUCHED;
}

static void obey_small(const modbus_slave_t *self, modbus_slave_drive_t *drive, sim_modbus_device_t *device, uint64_t now_us)
{
    set_target(drive, (int16_t)device->holding[100]);
    if (device->holding[102] != 0) {
        stop(self, drive, now_us);
        device->holding[102] = 0;
        device->holding[101] = drive->is_enabled;
    } else if (device->holding[101] != 0) {
        enable(drive);
    } else {
        drive->is_enabled = false;
    }
    if (device->holding[103] != 0) {
        drive->is_faulty = false;
        device->holding[103] = 0;
    }
}

/* The zero is found: drive and target are there. */
static void end_homing(modbus_slave_drive_t *drive, sim_modbus_device_t *device)
{
    drive->is_homing = false;
    drive->is_homed = true;
    drive->position = MODBUS_SLAVE_WIDE_ZERO;
    drive->target = MODBUS_SLAVE_WIDE_ZERO;
    device->holding[10] = (uint16_t)((uint32_t)MODBUS_SLAVE_WIDE_ZERO >> 16);
    device->holding[11] = (uint16_t)MODBUS_SLAVE_WIDE_ZERO;
}

static void move(const modbus_slave_t *self, modbus_slave_drive_t *drive, sim_modbus_device_t *device, uint64_t now_us)
{
    if (drive->is_homing && now_us >= drive->homing_us) {
        end_homing(drive, device);
    } else if (drive->is_enabled && drive->is_stopped) {
        drive->position += now_us < drive->glide_us ? self->glide_counts : 0;
    } else if (drive->is_enabled && !drive->is_faulty && !drive->is_homing && drive->is_target_set && !drive->is_frozen) {
        const int64_t left = (int64_t)drive->target - drive->position;
        drive->position += (int32_t)(llabs(left) < 4 ? left : left / 2);
    }
}

void modbus_slave_step(modbus_slave_t *self, uint64_t now_us)
{
    for (unsigned k = 0; k < MODBUS_SLAVES; k++) {
        self->device[k].unit = self->drive[k].is_on ? (uint8_t)(self->is_shared ? k + 1u : 1u) : NOBODY;
    }
    for (unsigned k = 0; k < (self->is_shared ? 1u : MODBUS_SLAVES); k++) {
        sim_modbus_step(&self->line[k], now_us);
    }
    for (unsigned k = 0; k < MODBUS_SLAVES; k++) {
        if (!self->drive[k].is_on) {
            self->drive[k].is_enabled = false;
            continue;
        }
        if (self->is_small) {
            obey_small(self, &self->drive[k], &self->device[k], now_us);
        } else {
            obey_wide(self, &self->drive[k], &self->device[k], now_us);
        }
        move(self, &self->drive[k], &self->device[k], now_us);
        tell(self, k);
    }
}

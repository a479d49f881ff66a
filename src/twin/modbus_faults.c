/* SPDX-License-Identifier: MIT
 * modbus_faults.c - what faults mean on Modbus drives; see modbus_faults.h.
 */
#include "twin/modbus_faults.h"

#include <string.h>

#define BUSY 6u /* the exception "device busy" */

/** A name. act is NULL where it is the motor's fault, which is the same on every bus. */
typedef struct {
    const char *name;
    fault_act_t act;
} row_t;

static register_drive_t *drive_of(twin_t *twin, unsigned k)
{
    return &twin->modbus.drive[k];
}

ACT(act_fault)
{
    register_drive_fault(drive_of(twin, k), (uint16_t)fault->number[0]);
}

ACT(act_broken)
{
    act_fault(twin, k, fault, now_us);
    drive_of(twin, k)->is_broken = true;
}

ACT(act_power_on)
{
    register_drive_power(drive_of(twin, k), true, now_us);
}

ACT(act_power_off)
{
    register_drive_power(drive_of(twin, k), false, now_us);
}

ACT(act_mute)
{
    drive_of(twin, k)->is_mute = true;
}

ACT(act_cut)
{
    drive_of(twin, k)->is_cut = true;
}

ACT(act_ignore)
{
    drive_of(twin, k)->is_deaf = true;
}

ACT(act_drop)
{
    register_drive_drop(drive_of(twin, k));
}

ACT(act_lose)
{
    drive_of(twin, k)->lost = (uint32_t)fault->number[0];
}

ACT(act_late)
{
    drive_of(twin, k)->late_us = (uint32_t)(fault->number[0] * 1000);
}

ACT(act_damaged)
{
    drive_of(twin, k)->damaged = (uint32_t)fault->number[0];
}

ACT(act_half)
{
    drive_of(twin, k)->halved = (uint32_t)fault->number[0];
}

ACT(act_exception)
{
    drive_of(twin, k)->refused = (uint32_t)fault->number[0];
    drive_of(twin, k)->exception = fault->number[1] > 0 ? (uint8_t)fault->number[1] : BUSY;
}

ACT(act_register)
{
    register_cell_t *reg = register_drive_find(drive_of(twin, k), (uint16_t)fault->number[0]);
    if (reg != NULL) {
        reg->value = (uint16_t)fault->number[1];
        reg->is_held = true;
    }
}

ACT(act_homing_fails)
{
    drive_of(twin, k)->is_homing_broken = true;
}

ACT(act_encoder)
{
    drive_of(twin, k)->origin -= fault->number[0] * twin->per_unit[k];
}

ACT(act_mend)
{
    register_drive_t *drive = drive_of(twin, k);
    drive->is_broken = drive->is_mute = drive->is_cut = drive->is_deaf = drive->is_homing_broken = false;
    drive->late_us = drive->lost = drive->damaged = drive->halved = drive->refused = 0;
    drive->motor->is_jammed = false;
    drive->motor->slip = 0;
    for (unsigned i = 0; i < drive->count; i++) {
        drive->reg[i].is_held = false;
    }
}

static const row_t k_rows[] = {
    {"fault", act_fault},
    {"broken", act_broken},
    {"reboot", act_power_on},
    {"power-off", act_power_off},
    {"power-on", act_power_on},
    {"mute", act_mute},
    {"cut", act_cut},
    {"ignore", act_ignore},
    {"jam", NULL},
    {"drop", act_drop},
    {"lose", act_lose},
    {"late", act_late},
    {"damaged", act_damaged},
    {"half", act_half},
    {"exception", act_exception},
    {"register", act_register},
    {"slip", NULL},
    {"homing-fails", act_homing_fails},
    {"load", NULL},
    {"friction", NULL},
    {"lag", NULL},
    {"encoder", act_encoder},
    {"mend", act_mend},
};

#define ROWS (sizeof k_rows / sizeof k_rows[0])

static const row_t *row_of(const char *name)
{
    for (unsigned i = 0; i < ROWS; i++) {
        if (strcmp(k_rows[i].name, name) == 0) {
            return &k_rows[i];
        }
    }
    return NULL;
}

fault_act_t modbus_fault_find(const char *name, bool *is_shared)
{
    const row_t *row = row_of(name);
    *is_shared = row != NULL && row->act == NULL;
    return row != NULL ? row->act : NULL;
}

/* --- Of lines and boards --- */

bool modbus_fault_is_board(bus_fault_t fault)
{
    return fault == BUS_RELAYS_SILENT || fault == BUS_RELAYS_FORGET || fault == BUS_RELAYS_BACK;
}

bool modbus_fault_is_lines(bus_fault_t fault)
{
    return fault == BUS_UNPLUG || fault == BUS_PLUG;
}

bool modbus_fault_do(modbus_side_t *side, bus_fault_t fault)
{
    const bool is_cable = side->drives > 0 && (fault == BUS_CABLE_OUT || fault == BUS_CABLE_IN);
    if (is_cable) {
        side->is_cable_out = fault == BUS_CABLE_OUT;
    } else if (modbus_fault_is_lines(fault)) {
        side->is_unplugged = fault == BUS_UNPLUG;
    } else if (fault == BUS_RELAYS_FORGET) {
        memset(side->board.coil, 0, sizeof side->board.coil);
    } else if (modbus_fault_is_board(fault)) {
        side->board.is_silent = fault == BUS_RELAYS_SILENT;
    }
    return is_cable || modbus_fault_is_lines(fault) || modbus_fault_is_board(fault);
}

/* SPDX-License-Identifier: MIT
 * frame_faults.c - what faults mean on drives with CAN frames of their own; see frame_faults.h.
 */
#include "twin/frame_faults.h"

#include <string.h>

/** A name. act is NULL where it is the motor's fault, which is the same on every bus. */
typedef struct {
    const char *name;
    fault_act_t act;
} row_t;

ACT(act_fault)
{
    frame_drive_fault(&twin->frame[k], (uint32_t)fault->number[0]);
}

ACT(act_broken)
{
    act_fault(twin, k, fault, now_us);
    twin->frame[k].is_broken = true;
}

ACT(act_power_on)
{
    frame_drive_power(&twin->frame[k], true, now_us);
}

ACT(act_power_off)
{
    frame_drive_power(&twin->frame[k], false, now_us);
}

ACT(act_mute)
{
    twin->frame[k].is_mute = true;
}

ACT(act_cut)
{
    twin->frame[k].is_cut = true;
}

ACT(act_ignore)
{
    twin->frame[k].is_deaf = true;
}

ACT(act_drop)
{
    frame_drive_drop(&twin->frame[k]);
}

ACT(act_lose)
{
    twin->frame[k].lost = (uint32_t)fault->number[0];
}

ACT(act_late)
{
    twin->frame[k].late_us = (uint32_t)(fault->number[0] * 1000);
}

ACT(act_damaged)
{
    twin->frame[k].damaged = (uint32_t)fault->number[0];
}

ACT(act_stuck_counter)
{
    twin->frame[k].is_stuck = true;
}

ACT(act_homing_fails)
{
    twin->frame[k].is_homing_broken = true;
}

ACT(act_encoder)
{
    twin->frame[k].origin -= fault->number[0] * twin->per_unit[k];
}

ACT(act_mend)
{
    frame_drive_t *drive = &twin->frame[k];
    drive->is_broken = drive->is_mute = drive->is_cut = drive->is_deaf = drive->is_homing_broken = drive->is_stuck = false;
    drive->late_us = drive->lost = drive->damaged = 0;
    drive->motor->is_jammed = false;
    drive->motor->slip = 0;
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
    {"stuck-counter", act_stuck_counter},
    {"slip", NULL},
    {"homing-fails", act_homing_fails},
    {"load", NULL},
    {"friction", NULL},
    {"lag", NULL},
    {"encoder", act_encoder},
    {"other-master", NULL},
    {"mend", act_mend},
};

fault_act_t frame_fault_find(const char *name, bool *is_shared)
{
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if (strcmp(k_rows[i].name, name) == 0) {
            *is_shared = k_rows[i].act == NULL;
            return k_rows[i].act;
        }
    }
    *is_shared = false;
    return NULL;
}

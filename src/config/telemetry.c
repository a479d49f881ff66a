/* SPDX-License-Identifier: MIT
 * telemetry.c - see telemetry.h.
 */
#include "config/telemetry.h"

static bool has_torque(const canraw_frame_t *frame)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        if (frame->field[i].value == CANRAW_TORQUE) {
            return true;
        }
    }
    return false;
}

uint8_t config_telemetry(const config_t *config)
{
    const config_cia402_t *cia402 = &config->cia402;
    unsigned told = 0;
    if (config->drives == CONFIG_DRIVES_CIA402) {
        told |= cia402->is_torque_told ? DRIVE_TELLS_TORQUE : 0u;
        told |= cia402->is_lag_told ? DRIVE_TELLS_LAG : 0u;
        told |= cia402->are_inputs_told ? DRIVE_TELLS_INPUTS : 0u;
    }
    if (config->drives == CONFIG_DRIVES_CAN_RAW) {
        const config_can_raw_t *raw = &config->can_raw;
        told |= has_torque(&raw->position_reply) || has_torque(&raw->status_reply) ? DRIVE_TELLS_TORQUE : 0u;
    }
    return (uint8_t)told;
}

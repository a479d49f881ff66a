/* SPDX-License-Identifier: MIT
 * telemetry_section.c - see telemetry_section.h.
 */
#include "platform/telemetry_section.h"

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
    unsigned has = 0;
    if (config->drives == CONFIG_DRIVES_CIA402) {
        has |= cia402->has_torque_report ? DRIVE_HAS_TORQUE : 0u;
        has |= cia402->has_lag ? DRIVE_HAS_LAG : 0u;
        has |= cia402->has_inputs ? DRIVE_HAS_INPUTS : 0u;
    }
    if (config->drives == CONFIG_DRIVES_CAN_RAW) {
        const config_can_raw_t *raw = &config->can_raw;
        has |= has_torque(&raw->position_reply) || has_torque(&raw->status_reply) ? DRIVE_HAS_TORQUE : 0u;
    }
    return (uint8_t)has;
}

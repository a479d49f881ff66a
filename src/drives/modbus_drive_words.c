/* SPDX-License-Identifier: MIT
 * modbus_drive_words.c - what a drive on Modbus is at, for the gateway and in words; see modbus_drive_axis.h.
 */
#include "modbus_drive_axis.h"

drive_state_t modbus_drive_axis_state(const modbus_drive_axis_t *self)
{
    switch (self->phase) {
    case MODBUS_DRIVE_READY:
        return DRIVE_DISABLED;
    case MODBUS_DRIVE_PLACING:
    case MODBUS_DRIVE_ENABLING:
    case MODBUS_DRIVE_CONFIRMING:
    case MODBUS_DRIVE_HOLDING:
        return self->is_after_homing ? DRIVE_HOMING : DRIVE_ENABLING;
    case MODBUS_DRIVE_ENABLED:
        return DRIVE_ENABLED;
    case MODBUS_DRIVE_HOMING:
        return DRIVE_HOMING;
    case MODBUS_DRIVE_FAULT:
        return DRIVE_FAULT;
    case MODBUS_DRIVE_WAITING:
    case MODBUS_DRIVE_STARTING:
    case MODBUS_DRIVE_REFUSED:
        break;
    }
    return DRIVE_OFFLINE;
}

static uint32_t code_of(const modbus_drive_axis_t *self)
{
    const drive_state_t state = modbus_drive_axis_state(self);
    return state == DRIVE_FAULT || state == DRIVE_OFFLINE ? self->trouble : 0;
}

void modbus_drive_axis_feedback(const modbus_drive_axis_t *self, drive_feedback_t *feedback)
{
    *feedback = (drive_feedback_t){
        .state = modbus_drive_axis_state(self),
        .is_homed = self->is_homed,
        .has_actual = self->has_actual,
        .is_energized = self->is_energized,
        .actual_mm_q32 = self->actual_q32,
        .actual_us = self->actual_us,
        .fault_code = code_of(self),
        .guard = self->phase == MODBUS_DRIVE_FAULT ? self->guard : (drive_guard_t){.jump_q32 = 0},
    };
}

static const char *phase_text(const modbus_drive_axis_t *self)
{
    static const char *const k_texts[] = {
        [MODBUS_DRIVE_WAITING] = "waiting for the line",
        [MODBUS_DRIVE_STARTING] = "starting up",
        [MODBUS_DRIVE_REFUSED] = "refused",
        [MODBUS_DRIVE_READY] = "ready",
        [MODBUS_DRIVE_PLACING] = "setting its target to where it is",
        [MODBUS_DRIVE_ENABLING] = "being enabled",
        [MODBUS_DRIVE_CONFIRMING] = "waits for its torque",
        [MODBUS_DRIVE_HOLDING] = "waits for all drives",
        [MODBUS_DRIVE_ENABLED] = "enabled",
        [MODBUS_DRIVE_HOMING] = "homing",
        [MODBUS_DRIVE_FAULT] = "fault",
    };
    const bool is_stopping =
        self->phase == MODBUS_DRIVE_READY && (self->job == MODBUS_DRIVE_JOB_COMMAND || quick_stop_is_active(&self->quick_stop));
    return is_stopping ? "stopping" : k_texts[self->phase];
}

static const char *trouble_text(uint32_t trouble)
{
    static const char *const k_texts[] = {
        "no link to it",
        "no answer",
        "damaged answers",
        "it refuses what it is asked",
        "a register holds another value",
        "its feedback is too old",
        "a set-point too far from the last one or from its position",
        "homing failed",
    };
    if (trouble == MODBUS_DRIVE_NO_TROUBLE) {
        return "";
    }
    const bool is_ours = trouble >= MODBUS_DRIVE_NO_LINK && trouble - MODBUS_DRIVE_NO_LINK < sizeof k_texts / sizeof k_texts[0];
    return is_ours ? k_texts[trouble - MODBUS_DRIVE_NO_LINK] : "its own alarm";
}

static const char *exception_text(uint8_t exception)
{
    static const char *const k_texts[] = {
        "another code",
        "function not supported",
        "no such register",
        "value not allowed",
        "it failed to do so",
        "it needs time",
        "it is busy",
        "it cannot do so now",
        "its memory is damaged",
        "another code",
        "the gateway in between has no path to it",
        "the gateway in between gets no answer from it",
    };
    return k_texts[exception < sizeof k_texts / sizeof k_texts[0] ? exception : 0];
}

/* The register that is being set up, or that the trouble is about. */
static uint32_t object_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    const bool is_item = self->phase == MODBUS_DRIVE_STARTING && self->job == MODBUS_DRIVE_JOB_STARTUP;
    return (uint32_t)(is_item ? map->item[self->step].address : self->object) << 8;
}

void modbus_drive_axis_words(const modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint8_t unit, drive_report_t *out)
{
    const bool is_exception = self->trouble == MODBUS_DRIVE_EXCEPTION;
    *out = (drive_report_t){
        .is_modbus = true,
        .address = unit,
        .phase = phase_text(self),
        .trouble = drive_guard_is_found(&self->guard) && self->trouble == MODBUS_DRIVE_FOLLOWING ? guard_text(&self->guard)
                                                                                                 : trouble_text(self->trouble),
        .code = self->trouble,
        .object = object_of(self, map),
        .detail = is_exception ? exception_text(self->exception) : "",
        .detail_code = is_exception ? self->exception : 0,
        .since_us = self->trouble != 0 ? self->trouble_us : self->since_us,
        .period_us = self->setpoint_us != 0 ? self->period_us : 0,
        .setpoint_us = self->setpoint_us,
    };
}

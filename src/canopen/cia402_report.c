/* SPDX-License-Identifier: MIT
 * cia402_report.c - what a drive is at; see cia402_report.h.
 */
#include "cia402_report.h"

#include "cia402_axis.h"
#include "cia402_setup.h"
#include "heave/canopen_text.h"
#include "heave/guard.h"

static bool is_faulty(const cia402_axis_t *axis)
{
    const cia402_state_t state = cia402_axis_state(axis);
    return axis->own_fault != 0 || state == CIA402_FAULT || state == CIA402_FAULT_REACTION;
}

drive_state_t cia402_report_state(const cia402_t *self, uint8_t index)
{
    const cia402_axis_t *axis = &self->axis[index];
    if (axis->phase != CIA402_UP) {
        return DRIVE_OFFLINE;
    }
    if (is_faulty(axis)) {
        return DRIVE_FAULT;
    }
    if (!axis->is_in) {
        return DRIVE_DISABLED;
    }
    if (self->stage == CIA402_STAGE_FOLLOW) {
        return DRIVE_ENABLED;
    }
    return self->is_homing_asked ? DRIVE_HOMING : DRIVE_ENABLING;
}

static uint32_t fault_code(const cia402_axis_t *axis, drive_state_t state)
{
    if (state == DRIVE_OFFLINE) {
        return axis->trouble;
    }
    if (state != DRIVE_FAULT) {
        return 0;
    }
    if (axis->own_fault != 0) {
        return axis->own_fault;
    }
    return axis->error_code != 0 ? axis->error_code : CIA402_GENERIC_ERROR;
}

void cia402_report_feedback(const cia402_t *self, uint8_t index, drive_feedback_t *out)
{
    const cia402_axis_t *axis = &self->axis[index];
    const drive_state_t state = cia402_report_state(self, index);
    *out = (drive_feedback_t){
        .state = state,
        .is_homed = axis->is_homed,
        .has_actual = axis->was_heard,
        .is_energized = cia402_axis_is_energized(axis),
        .actual_mm_q32 = axis->actual_q32,
        .actual_us = axis->actual_us,
        .fault_code = fault_code(axis, state),
        .guard = state == DRIVE_FAULT ? axis->guard : (drive_guard_t){.jump_q32 = 0},
    };
}

/* --- In words --- */

static const struct {
    uint32_t code;
    const char *text;
} k_troubles[] = {
    {CIA402_SILENT, "does not answer: supply, cable, termination, node id, bit rate?"},
    {CIA402_LOST_TPDO, "sent no position, three times in a row"},
    {CIA402_LOST_HEARTBEAT, "sent no heartbeat in time, or did not answer to guarding"},
    {CIA402_LEFT_OPERATIONAL, "left the NMT state operational"},
    {CIA402_REBOOTED, "started again by itself: supply?"},
    {CIA402_LOST_BUS, "the bus does not work"},
    {CIA402_NOT_402, "is no CiA 402 drive"},
    {CIA402_WRONG_IDENTITY, "is not the device that the configuration names"},
    {CIA402_NOT_TAKEN, "does not take what it has to be set to"},
    {CIA402_UNGUARDED, "would not stop by itself: a guard is off"},
    {CIA402_GUARDED_LATE, "would stop too late by itself when the gateway is gone"},
    {CIA402_NO_HEARTBEAT, "sends no heartbeat, or does not answer to guarding"},
    {CIA402_NO_MODE, "does not go to the mode of operation"},
    {CIA402_NO_START, "does not become operational, or sends no TPDO"},
    {CIA402_SHORT_TPDO, "sends a TPDO with less bytes than are mapped"},
    {CIA402_NO_POWER, "does not switch on: power stage, enable input?"},
    {CIA402_NO_TORQUE, "does not enable operation: brake, safe torque off?"},
    {CIA402_REMOTE_OFF, "is under local control, not under that of the bus"},
    {CIA402_HOMING_LATE, "does not end its homing: neither bits 10 and 12 nor bit 13 of 6041h"},
    {CIA402_FELL_OUT, "left operation enabled by itself: enable input, safe torque off?"},
    {CIA402_NO_ANSWER, "gives no answer when it is asked for an object"},
    {CIA402_TWICE, "is there twice: two drives have this node id"},
    {CIA402_NO_SUCH_MODE, "has not got the configured mode of operation, or homing"},
    {CIA402_NO_SUCH_HOMING, "has not got the configured homing method"},
    {CIA402_LOST_NODE, "was lost with another axis of its node, which is set up again"},
    {CIA402_LEFT_MODE, "left its mode of operation by itself"},
    {CIA402_NOT_FOLLOWING, "ignores its set-points: halted, or held by its own logic?"},
    {CIA402_NO_VOLTAGE, "has no voltage at its power stage: supply, contactor?"},
    {CIA402_LIMITED, "is at a limit of its own: torque, speed, position (607Dh)?"},
    {CIA402_WARNING, "warns: its manual and 603Fh say of what"},
    {CIA402_OTHER_SYNC, "has another master on its bus: somebody else sends SYNC"},
    {CIA402_OTHER_NMT, "has another master on its bus: somebody else sends NMT commands"},
    {CIA402_OTHER_COMMAND, "has another master on its bus: somebody else sends set-points"},
    {CIA402_OTHER_HEARTBEAT, "has another master on its bus: somebody else sends the heartbeat of gateway_node"},
};

static const char *code_text(uint32_t code)
{
    for (size_t i = 0; i < sizeof k_troubles / sizeof k_troubles[0]; i++) {
        if (k_troubles[i].code == code) {
            return k_troubles[i].text;
        }
    }
    return canopen_error_text((uint16_t)code);
}

static const char *stage_text(cia402_stage_t stage)
{
    static const char *const k_texts[] = {
        [CIA402_STAGE_OFF] = "ready",
        [CIA402_STAGE_WITHDRAW] = "waits for all drives to have no torque",
        [CIA402_STAGE_MODE] = "waits for the mode of operation of all drives",
        [CIA402_STAGE_SWITCH_ON] = "waits for all drives to be switched on",
        [CIA402_STAGE_OPERATE] = "waits for operation enabled of all drives",
        [CIA402_STAGE_HOMING] = "homing",
        [CIA402_STAGE_FOLLOW] = "enabled",
    };
    return k_texts[stage];
}

static const char *up_text(const cia402_t *self, uint8_t index)
{
    const cia402_axis_t *axis = &self->axis[index];
    if (is_faulty(axis)) {
        return "fault";
    }
    if (axis->is_in) {
        return stage_text(self->stage);
    }
    return cia402_has_torque(cia402_axis_state(axis)) ? "stopping" : "ready";
}

static const char *phase_text(const cia402_t *self, uint8_t index)
{
    static const char *const k_texts[] = {
        [CIA402_MISSING] = "missing",         [CIA402_RESETTING] = "booting",
        [CIA402_CONFIGURING] = "configuring", [CIA402_CONFIGURED] = "waits for the other axes of its node",
        [CIA402_STARTING] = "starting",       [CIA402_LEAVING] = "lost",
        [CIA402_REFUSED] = "refused",
    };
    const cia402_phase_t phase = self->axis[index].phase;
    if (self->master.is_listening) {
        return "listening";
    }
    return phase == CIA402_UP ? up_text(self, index) : k_texts[phase];
}

/* It does not take an object: while it is set up, or at a change of mode. */
static bool is_refusing(const cia402_axis_t *axis)
{
    return axis->phase == CIA402_REFUSED || (axis->own_fault != 0 && axis->own_fault == axis->trouble);
}

/* The object that a drive is being set up with, or that it does not take. */
static uint32_t object_of(const cia402_t *self, uint8_t index)
{
    const cia402_axis_t *axis = &self->axis[index];
    if (axis->phase == CIA402_CONFIGURING) {
        return cia402_setup_object(axis, self->config, &self->config->axis[index]);
    }
    const bool is_mute = axis->phase != CIA402_UP && axis->trouble == CIA402_NO_ANSWER;
    return is_refusing(axis) || is_mute ? axis->trouble_object : axis->warned_object;
}

/* The drive itself has told why. */
static bool has_error_for_reason(const cia402_axis_t *axis)
{
    const bool is_such = axis->trouble == CIA402_NO_START || axis->trouble == CIA402_LEFT_OPERATIONAL;
    return is_such && axis->phase != CIA402_UP && axis->trouble_code != 0;
}

static uint32_t detail_code(const cia402_axis_t *axis)
{
    if (has_error_for_reason(axis)) {
        return axis->trouble_code;
    }
    if (!is_refusing(axis) || axis->trouble_object == 0) {
        return 0;
    }
    return axis->trouble_code != 0 || !axis->has_found ? axis->trouble_code : axis->trouble_found;
}

static const char *detail_text(const cia402_axis_t *axis)
{
    if (has_error_for_reason(axis)) {
        return canopen_error_text((uint16_t)axis->trouble_code);
    }
    if (!is_refusing(axis) || axis->trouble_object == 0) {
        return axis->warned_object != 0 && axis->phase == CIA402_UP ? "its guard is off, which the configuration allows" : "";
    }
    if (axis->trouble_code != 0) {
        return canopen_abort_text(axis->trouble_code);
    }
    if (axis->trouble == CIA402_NO_SUCH_MODE) {
        return "a bit for each mode that it supports";
    }
    if (axis->trouble == CIA402_NO_SUCH_HOMING) {
        return "the last of the methods that it supports";
    }
    return axis->has_found ? "it holds another value" : "";
}

/* 0 where the drive has its node to itself. */
static uint8_t channel_of(const cia402_t *self, uint8_t index)
{
    const cia402_axis_config_t *own = &self->config->axis[index];
    const bool is_alone = cia402_axis_of(self->config, own->node, 0x68000000u) == self->config->axes;
    return is_alone ? 0 : (uint8_t)(own->channel + 1u);
}

void cia402_report_words(const cia402_t *self, uint8_t index, drive_report_t *out)
{
    const cia402_axis_t *axis = &self->axis[index];
    const uint32_t fault = fault_code(axis, cia402_report_state(self, index));
    const uint32_t code = fault != 0 ? fault : axis->trouble;
    *out = (drive_report_t){
        .address = self->config->axis[index].node,
        .channel = channel_of(self, index),
        .phase = phase_text(self, index),
        .trouble = drive_guard_is_found(&axis->guard) && code == axis->own_fault ? guard_text(&axis->guard) : code_text(code),
        .code = code,
        .object = object_of(self, index),
        .detail = detail_text(axis),
        .detail_code = detail_code(axis),
        .has_found = is_refusing(axis) && axis->has_found,
        .found = axis->trouble_found,
        .wanted = axis->trouble_wanted,
        .error = axis->emergency.count != 0 ? canopen_error_text(axis->emergency.code) : NULL,
        .emergency = axis->emergency,
        .telemetry = axis->telemetry,
        .notes = axis->phase == CIA402_UP ? axis->notes : 0,
        .since_us = code != 0 ? axis->trouble_us : axis->phase_us,
    };
}

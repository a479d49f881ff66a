/* SPDX-License-Identifier: MIT
 * target.c - see target.h.
 */
#include "target.h"

#define TURN_Q32   q32_from_int(360)
#define NEARLY_Q32 q32_from_int(30) /* of a turn, for what a sender may have turned meanwhile */

/* Where the values of a frame go: an axis of the platform, or a cylinder (from SLOT_CYLINDER on). */
enum { SLOT_CYLINDER = AXES_MAX };

static const uint8_t k_slots[FRAME_COMMANDS][FRAME_VALUES_MAX] = {
    [FRAME_A3] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z},
    [FRAME_A4] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z, AXIS_ANGLE},
    [FRAME_A6] = {AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_X, AXIS_Y, AXIS_Z},
    [FRAME_A7] = {AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_X, AXIS_Y, AXIS_Z, AXIS_ANGLE},
    [FRAME_C3] = {SLOT_CYLINDER, SLOT_CYLINDER + 1, SLOT_CYLINDER + 2},
    [FRAME_C6] = {SLOT_CYLINDER, SLOT_CYLINDER + 1, SLOT_CYLINDER + 2, SLOT_CYLINDER + 3, SLOT_CYLINDER + 4, SLOT_CYLINDER + 5},
    [FRAME_C7] = {SLOT_CYLINDER, SLOT_CYLINDER + 1, SLOT_CYLINDER + 2, SLOT_CYLINDER + 3, SLOT_CYLINDER + 4, SLOT_CYLINDER + 5,
                  AXIS_ANGLE},
};

/* Cylinders a command is for: 0 where poses of both kinds of platform take it. */
static const uint8_t k_cylinders[FRAME_COMMANDS] = {
    [FRAME_A6] = 6, [FRAME_A7] = 6, [FRAME_C3] = 3, [FRAME_C6] = 6, [FRAME_C7] = 6};

static bool needs_angle(frame_command_t command)
{
    return command == FRAME_A4 || command == FRAME_A7 || command == FRAME_C7;
}

const char *target_missing(frame_command_t command, unsigned cylinders, bool has_angle)
{
    if (k_cylinders[command] != 0 && k_cylinders[command] != cylinders) {
        return cylinders == 3
                   ? "it is for six cylinders, this platform has three (A3, C3, and A4 with a rotation motor)"
                   : "it is for three cylinders, this platform has six (A3, A6, C6, and A4, A7, C7 with a rotation motor)";
    }
    return needs_angle(command) && !has_angle ? "it needs a rotation motor, and [angle] present is no" : NULL;
}

/* The value in the platform's own axis: sign * scale * sent + offset. */
static q32_t to_axis(const axis_settings_t *axis, q16_t sent_q16)
{
    const q32_t scaled_q32 = fx_mul_shift(q32_from_q16(sent_q16), axis->scale_q16, 16);
    return (axis->sign < 0 ? -scaled_q32 : scaled_q32) + q32_from_q16(axis->offset_q16);
}

/* The same angle some whole turns nearer, if it is beyond a limit and those bring it within both. */
static q32_t turned_into_limits(const axis_settings_t *axis, q32_t turn_q32, q32_t angle_q32)
{
    const q32_t min_q32 = q32_from_q16(axis->min_q16);
    const q32_t max_q32 = q32_from_q16(axis->max_q16);
    const q32_t beyond_q32 = angle_q32 > max_q32 ? angle_q32 - max_q32 : angle_q32 < min_q32 ? angle_q32 - min_q32 : 0;
    const q32_t turns = (fx_abs(beyond_q32) + turn_q32 - 1) / turn_q32;
    const q32_t turned_q32 = angle_q32 - (beyond_q32 < 0 ? -turns : turns) * turn_q32;
    return turned_q32 >= min_q32 && turned_q32 <= max_q32 ? turned_q32 : angle_q32;
}

/* If the shorter way is taken: the angle that is whole turns away and nearest to the last one that was asked for. Not to where
 * the axis is: it may be more than half a turn behind, and would change its direction with every frame. */
static q32_t unwrap(const axis_settings_t *axis, q32_t turn_q32, q32_t last_q32, q32_t angle_q32)
{
    if (axis->wrap == ANGLE_AS_SENT || turn_q32 == 0) {
        return angle_q32;
    }
    q32_t travel_q32 = (angle_q32 - last_q32) % turn_q32;
    if (travel_q32 > turn_q32 / 2) {
        travel_q32 -= turn_q32;
    } else if (travel_q32 < -turn_q32 / 2) {
        travel_q32 += turn_q32;
    }
    return turned_into_limits(axis, turn_q32, last_q32 + travel_q32);
}

motion_target_t target_of(const settings_t *settings, const q32_t last_deg_q32[AXES_MAX], const frame_t *frame)
{
    const bool is_pose = k_slots[frame->command][0] < SLOT_CYLINDER;
    motion_target_t target = {
        .space = is_pose ? MOTION_POSE : MOTION_CYLINDERS, .is_timed = frame->is_timed, .time_ms = frame->time_ms};
    q16_t axis_q16[AXES_MAX] = {0};
    for (unsigned i = 0; i < frame->count; i++) {
        const uint8_t slot = k_slots[frame->command][i];
        if (slot >= SLOT_CYLINDER) {
            target.value_q32[slot - SLOT_CYLINDER] = q32_from_q16(frame->value_q16[i]);
        } else {
            axis_q16[slot] = frame->value_q16[i];
        }
    }
    for (unsigned i = 0; is_pose && i < POSE_AXES; i++) {
        target.value_q32[i] = to_axis(&settings->axis[i], axis_q16[i]);
    }
    for (unsigned i = AXIS_ROLL; is_pose && i <= AXIS_YAW; i++) { /* a turn of the sender's, which its scale makes another one */
        const axis_settings_t *axis = &settings->axis[i];
        target.value_q32[i] = unwrap(axis, fx_mul_shift(TURN_Q32, axis->scale_q16, 16), last_deg_q32[i], target.value_q32[i]);
    }
    const axis_settings_t *motor = &settings->axis[AXIS_ANGLE];
    target.has_angle = needs_angle(frame->command);
    target.angle_deg_q32 = unwrap(motor, TURN_Q32, last_deg_q32[AXIS_ANGLE], to_axis(motor, axis_q16[AXIS_ANGLE]));
    return target;
}

static const uint8_t k_rotations[ROTATIONS] = {AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_ANGLE};

rotations_t target_rotations(const frame_t *frame)
{
    rotations_t rotations = {.is_there = {false}};
    for (unsigned i = 0; i < frame->count; i++) {
        for (unsigned k = 0; k < ROTATIONS; k++) {
            if (k_slots[frame->command][i] == k_rotations[k]) {
                rotations.is_there[k] = true;
                rotations.deg_q16[k] = frame->value_q16[i];
            }
        }
    }
    return rotations;
}

unsigned target_jumps_by_turn(const settings_t *settings, const rotations_t *before, const rotations_t *now)
{
    for (unsigned k = 0; k < ROTATIONS; k++) {
        const q32_t jump_q32 = fx_abs(q32_from_q16(now->deg_q16[k]) - q32_from_q16(before->deg_q16[k]));
        const bool is_compared = before->is_there[k] && now->is_there[k] &&
                                 settings->axis[k_rotations[k]].wrap == ANGLE_AS_SENT &&
                                 settings->axis[k_rotations[k]].scale_q16 != 0;
        if (is_compared && fx_abs(jump_q32 - TURN_Q32) <= NEARLY_Q32) {
            return k_rotations[k];
        }
    }
    return AXES_MAX;
}

received_t target_received(const frame_t *frame)
{
    received_t received = {.is_pose = k_slots[frame->command][0] < SLOT_CYLINDER};
    for (unsigned i = 0; received.is_pose && i < frame->count; i++) {
        if (k_slots[frame->command][i] < POSE_AXES) {
            received.value_q16[k_slots[frame->command][i]] = frame->value_q16[i];
        }
    }
    return received;
}

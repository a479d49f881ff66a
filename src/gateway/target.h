/* SPDX-License-Identifier: MIT
 * target.h - converts a frame to a target of motion. Keeps no state. Private to src/gateway.
 */
#ifndef GATEWAY_TARGET_H
#define GATEWAY_TARGET_H

#include "heave/gateway.h"

/** What the platform lacks for a command; NULL if it has everything. */
const char *target_missing(frame_command_t command, unsigned cylinders, bool has_angle);

/** Converts the values of a frame to axes of the platform or to extensions.
 *  @param last_deg_q32 the last rotations and angle that were asked for, by axis; `wrap` may relate the new ones to them */
motion_target_t target_of(const settings_t *settings, const q32_t last_deg_q32[AXES_MAX], const frame_t *frame);

/** What a frame says of the axes that turn. */
rotations_t target_rotations(const frame_t *frame);

/** The first axis that is taken as sent and whose value is nearly a turn from the one before; AXES_MAX: none. */
unsigned target_jumps_by_turn(const settings_t *settings, const rotations_t *before, const rotations_t *now);

/** The pose of a frame before sign, scale, offset, intensity and limits. */
received_t target_received(const frame_t *frame);

#endif

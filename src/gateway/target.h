/* SPDX-License-Identifier: MIT
 * target.h - converts a frame to a target of motion. Keeps no state. Private to src/gateway.
 */
#ifndef GATEWAY_TARGET_H
#define GATEWAY_TARGET_H

#include "heave/gateway.h"

/** What the platform lacks for a command; NULL if it has everything. */
const char *target_missing(frame_command_t command, unsigned cylinders, bool has_angle);

/** Converts the values of a frame to axes of the platform or to extensions.
 *  @param last_angle_q32 the last angle that was asked for; settings->angle_wrap may relate the new one to it */
motion_target_t target_of(const gateway_settings_t *settings, q32_t last_angle_q32, const frame_t *frame);

/** Copies the values of a frame to s->received_q16, before sign, scale, offset, intensity and limits. */
void target_received(snapshot_t *s, const frame_t *frame);

#endif

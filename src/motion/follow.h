/* SPDX-License-Identifier: MIT
 * follow.h - following a sender: poses or extensions, streamed or timed, and the take-over of its first pose. Private to
 * src/motion.
 */
#ifndef FOLLOW_H
#define FOLLOW_H

#include "heave/motion.h"

/** Limits that a stream has on an axis of the space that is followed in [0, AXES_MAX), and on a cylinder [0, CYLINDERS_MAX). */
governor_limits_t follow_axis_limits(const motion_t *self, unsigned i);
governor_limits_t follow_cylinder_limits(const motion_t *self, unsigned i);

/** True while a sender's target moves the platform. */
bool follow_is_moving(const motion_t *self);

/** At rest and ready to follow: takes the target that came meanwhile. */
void follow_begin(motion_t *self, uint64_t now_us);

/** Takes a target, at rest or in motion. Planned is in the next cycle, for the newest one. */
void follow_target(motion_t *self, const motion_target_t *target, uint64_t now_us);

/** Plans what the targets of this cycle ask for, while moving; may find that the platform has to stop first. */
void follow_plan(motion_t *self, uint64_t now_us);

/** References of the cylinders for this cycle, while moving.
 *  @param out asked, angle and flags are filled in, and in pose space sent: the pose that the references belong to */
void follow_step(motion_t *self, uint64_t now_us, ramp_ref_t cylinder_ref[AXES_MAX], motion_output_t *out);

#endif

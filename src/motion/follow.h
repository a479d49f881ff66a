/* SPDX-License-Identifier: MIT
 * follow.h - following a sender: poses or extensions, streamed or timed, and the fade-in from its first target on. Private to
 * src/motion.
 */
#ifndef FOLLOW_H
#define FOLLOW_H

#include "heave/motion.h"

/** True while a sender's target moves the platform. */
bool follow_is_moving(const motion_t *self);

/** At rest and ready to follow: accepts the target that came meanwhile. */
void follow_begin(motion_t *self, uint64_t now_us);

/** Accepts a target, at rest or in motion. The path is planned in the next cycle, for the newest target. */
void follow_target(motion_t *self, const motion_target_t *target, uint64_t now_us);

/** Plans what the targets of this cycle ask for, while moving; may find that the platform has to stop first. */
void follow_plan(motion_t *self, uint64_t now_us);

/** References of the cylinders for this cycle, while moving.
 *  @param out asked, angle and flags are filled in, and in pose space sent: the pose that the references belong to */
void follow_step(motion_t *self, uint64_t now_us, ramp_ref_t cylinder_ref[AXES_MAX], motion_output_t *out);

#endif

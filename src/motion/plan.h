/* SPDX-License-Identifier: MIT
 * plan.h - ways to a target that all slots go together: timed moves and steps. Private to src/motion.
 */
#ifndef PLAN_H
#define PLAN_H

#include "heave/motion.h"

/** Plans a timed move to self->goal_q32: a quintic if the limits allow; else from rest an S-curve, longer than asked if need be;
 * in motion a stop and an S-curve, which begins as early in the stop as the limits allow.
 *  @param asked cycles, 0 = as few as there can be */
void plan_timed(motion_t *self, int64_t asked, bool is_first, uint64_t now_us);

/** Plans the quickest way to self->goal_q32. The rotation motor goes by itself. */
void plan_step(motion_t *self);

/** Limits of axes and cylinders for the straight line between two points of the slots, as a path. */
path_limits_t plan_limits_of_straight(const motion_t *self, unsigned slots, const q32_t *from_q32, const q32_t *to_q32);

/** Plans the straight S-curve to self->goal_q32 for slots at rest. */
void plan_straight(motion_t *self, unsigned slots, int64_t least_cycles);

#endif

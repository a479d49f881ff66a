/* SPDX-License-Identifier: MIT
 * plan.h - ways to a target that all slots go together: timed moves, steps, and joining a stream. Private to src/motion.
 */
#ifndef PLAN_H
#define PLAN_H

#include "heave/motion.h"

/** Plans a timed move to self->goal_q32: a quintic if the limits allow; else from rest an S-curve, longer than asked if need be;
 * in motion a stop and an S-curve where the time has room for both, or whatever arrives first.
 *  @param asked cycles, 0 = as few as there can be */
void plan_timed(motion_t *self, int64_t asked, bool is_first, uint64_t now_us);

/** Plans the quickest way to self->goal_q32. The rotation motor goes by itself. */
void plan_step(motion_t *self);

/** Plans the straight S-curve to self->goal_q32 for slots at rest. */
void plan_straight(motion_t *self, unsigned slots, int64_t least_cycles);

/** Plans the shortest quintic (self->plan.quintic) by which the difference of the first POSE_AXES slots to a stream's curve fades
 * out within the limits, while the curve moves on: what it uses of the limits is left to it, and speeds add.
 *  @param curve this cycle's references of the stream
 *  @return false where none of those looked at keeps the limits; self->plan.quintic is then of no use */
bool plan_join(motion_t *self, const ramp_ref_t *curve);

/** Plans the shortest quintic that leads those slots to rest on a target. Extensions go no further beyond it than their quickest
 * stop does (which is left in self->aside.halt).
 *  @return as plan_join() */
bool plan_shortest(motion_t *self, const q32_t target_q32[AXES_MAX]);

/** Plans the quickest stop of those slots, in self->aside.halt. */
void plan_halt(motion_t *self);

#endif

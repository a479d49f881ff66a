/* SPDX-License-Identifier: MIT
 * plan.h - plans the path to a target that all followed axes (followed.h) take together: timed moves and steps. Private to
 * src/motion.
 */
#ifndef PLAN_H
#define PLAN_H

#include "heave/motion.h"

/** What a plan is made from. It starts where the axes are, and ends at targets->goal_q32. */
typedef struct {
    const platform_t *platform;
    const followed_t *followed;
    const axis_targets_t *targets;
    const intensity_t *intensity;
} plan_in_t;

/** Plans a timed move of all axes: a quintic if the limits allow it; else from rest an S-curve, longer than asked if need be; in
 *  motion a stop and an S-curve, which begins as early in the stop as the limits allow.
 *  @param cycles asked for, at least 1
 *  @return cycles that it takes */
int64_t plan_timed(const plan_in_t *in, int64_t cycles, path_t *path);

/** Plans the quickest path of the pose axes or cylinders. The rotation motor goes by itself.
 *  @return false where each axis may go by its own ramp, which is the quickest in motion: nothing is planned */
bool plan_step(const plan_in_t *in, path_t *path);

/** Limits of axes and cylinders for the straight line between two points of the first so many axes. */
path_limits_t plan_limits_of_straight(const platform_t *platform, const followed_t *followed, unsigned axes,
                                      const q32_t *from_q32, const q32_t *to_q32);

#endif

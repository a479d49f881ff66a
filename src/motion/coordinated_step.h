/* SPDX-License-Identifier: MIT
 * coordinated_step.h - one cycle of all pose axes together, such that the cylinders can follow. Private to src/motion.
 */
#ifndef COORDINATED_STEP_H
#define COORDINATED_STEP_H

#include "heave/motion.h"

/** Where a cycle leads. */
typedef struct {
    pose_t pose; /**< within the workspace, on the guides */
    q32_t extension_mm_q32[CYLINDERS_MAX];
    unsigned limiting_cylinder; /**< that bounds the workspace here (1 ...), 0 for none */
} coordinated_step_t;

/** Advances the ramps of the pose axes by a cycle, each within its own limits.
 *
 *  Six axes that each take all of their jerk ask a cylinder for three times of its own. What the axes want is therefore cut by
 * one share for all of them where a cylinder could not follow: between the common brake (the quickest that every axis and
 * cylinder bears) and what they want. They go slower together then, and no cylinder is left behind.
 *
 *  This is no guarantee: the workspace may pull the pose in, and cylinders that came from somewhere else may still catch up. The
 *  limiter behind it keeps the limits of the cylinders in any case.
 *
 *  @param ref   of each pose axis
 *  @return what limited the cycle, RAMP_ACCEL included if the axes were cut */
unsigned coordinated_step(platform_t *self, const ramp_ref_t ref[POSE_AXES], ramp_bandwidth_t bandwidth, coordinated_step_t *to);

#endif

/* SPDX-License-Identifier: MIT
 * workspace.h - pulls poses that the cylinders cannot reach onto the edge of the workspace. Private to src/motion.
 */
#ifndef WORKSPACE_H
#define WORKSPACE_H

#include "heave/motion.h"

/** Pulls a pose in along the straight way from the neutral pose until every extension is within the stroke and its margins.
 *  The result is continuous in the pose wherever that way crosses the edge once.
 *  @param extension_mm_q32 out: the extensions of the resulting pose
 *  @param share_q62 out, may be NULL: how much of that way is left, Q62_ONE where the pose could be kept
 *  @return 0 where the pose could be kept; else 1-based, the cylinder that bounds it */
unsigned workspace_pull_in(const platform_t *platform, pose_t *pose, q32_t extension_mm_q32[CYLINDERS_MAX], q62_t *share_q62);

#endif

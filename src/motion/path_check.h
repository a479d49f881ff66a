/* SPDX-License-Identifier: MIT
 * path_check.h - what a planned way of the pose asks of the cylinders: their limits are known before the move begins.
 * Private to src/motion.
 */
#ifndef PATH_CHECK_H
#define PATH_CHECK_H

#include "heave/motion.h"

/** True if every cylinder can follow the poses of a quintic (33 of them are looked at). */
bool path_check_is_feasible(const platform_t *platform, const quintic_t *quintic);

/** Narrows path limits so that every cylinder keeps its own on the straight line between two poses (17 of them are looked at).
 *  @param limiter of each cylinder, whose limits count */
void path_check_narrow(const platform_t *platform, const ramp_t *limiter, const q32_t *from_q32, const q32_t *to_q32,
                       path_limits_t *limits);

/** True if axes and cylinders keep their limits along a PATH_STOP_AND_STRAIGHT whose straight line begins in a cycle of the stop
 *  (33 points are looked at). What the stop alone asks of the cylinders counts too.
 *  @param after cycles of the stop before the straight line begins */
bool path_check_blend_is_feasible(const platform_t *platform, const followed_t *followed, const path_t *path, int64_t after);

#endif

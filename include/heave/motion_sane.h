/* SPDX-License-Identifier: MIT
 * motion_sane.h - whether a motion that was loaded from a file may go on; see sane.h. Pure.
 */
#ifndef HEAVE_MOTION_SANE_H
#define HEAVE_MOTION_SANE_H

#include "heave/motion.h"

/** A sender's target. */
bool motion_target_is_sane(const motion_target_t *target);

/** A motion.
 *  @param prepared one of the same platform, as motion_init() leaves it: what never changes has to be the same */
bool motion_state_is_sane(const motion_t *saved, const motion_t *prepared);

#endif

/* SPDX-License-Identifier: MIT
 * motion_sane.h - checks a motion that was loaded from a file; see sane.h. Pure.
 */
#ifndef HEAVE_MOTION_SANE_H
#define HEAVE_MOTION_SANE_H

#include "heave/motion.h"

/** A sender's target. */
bool motion_target_is_sane(const motion_target_t *target);

/** A motion.
 *  @param prepared a motion of the same platform after motion_init(): constant members have to be equal */
bool motion_state_is_sane(const motion_t *saved, const motion_t *prepared);

#endif

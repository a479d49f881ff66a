/* SPDX-License-Identifier: MIT
 * followed.h - the axes that targets are given in: those of the pose or the cylinders, then the rotation motor. Private to
 * src/motion.
 */
#ifndef FOLLOWED_H
#define FOLLOWED_H

#include "heave/motion.h"

/** True while the sender's first target is awaited, or faded in. */
static inline bool followed_is_beginning(const followed_t *self)
{
    return self->phase == FOLLOW_AWAITED || self->phase == FOLLOW_FADING_IN;
}

/** What moves an axis. */
static inline const ramp_t *followed_ramp(const followed_t *self, const platform_t *platform, unsigned i)
{
    return self->space == MOTION_POSE || i == AXIS_ANGLE ? &platform->axis[i] : &platform->cylinder[i];
}

/** Limits of an axis. */
static inline const ramp_limits_t *followed_limits(const followed_t *self, const platform_t *platform, unsigned i)
{
    return &followed_ramp(self, platform, i)->limits;
}

/** Where an axis is: during fade-in, where the sender's references are. */
static inline const ramp_state_t *followed_state(const followed_t *self, const platform_t *platform, unsigned i)
{
    if (self->phase == FOLLOW_FADING_IN && i != AXIS_ANGLE) {
        return &self->past[i];
    }
    return &followed_ramp(self, platform, i)->state;
}

/** True if the first so many axes rest. */
static inline bool followed_are_at_rest(const followed_t *self, const platform_t *platform, unsigned axes)
{
    unsigned i = 0;
    while (i < axes && followed_state(self, platform, i)->vel_per_cycle_q32 == 0 &&
           followed_state(self, platform, i)->acc_per_cycle2_q32 == 0) {
        i++;
    }
    return i == axes;
}

#endif

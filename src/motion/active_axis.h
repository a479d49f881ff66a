/* SPDX-License-Identifier: MIT
 * active_axis.h - the axes of whatever space is followed in: pose axes or cylinders, and the rotation motor. Private to
 * src/motion.
 */
#ifndef ACTIVE_AXIS_H
#define ACTIVE_AXIS_H

#include "heave/motion.h"

/** What moves a slot. */
static inline const ramp_t *active_axis_ramp(const motion_t *self, unsigned i)
{
    return self->space == MOTION_POSE || i == AXIS_ANGLE ? &self->axis[i] : &self->cylinder[i];
}

/** Limits of a slot. */
static inline const ramp_limits_t *active_axis_limits(const motion_t *self, unsigned i)
{
    return &active_axis_ramp(self, i)->limits;
}

/** Where a slot is: while a sender is faded in, where it was led to before that. */
static inline const ramp_state_t *active_axis_state(const motion_t *self, unsigned i)
{
    if (self->is_fading && i != AXIS_ANGLE) {
        return &self->led[i];
    }
    return &active_axis_ramp(self, i)->state;
}

/** True if the first so many slots rest. */
static inline bool active_axis_all_at_rest(const motion_t *self, unsigned slots)
{
    unsigned i = 0;
    while (i < slots && active_axis_state(self, i)->vel_per_cycle_q32 == 0 &&
           active_axis_state(self, i)->acc_per_cycle2_q32 == 0) {
        i++;
    }
    return i == slots;
}

#endif

/* SPDX-License-Identifier: MIT
 * slot.h - the axes of whatever space is followed in: pose axes or cylinders, and the rotation motor. Private to src/motion.
 */
#ifndef SLOT_H
#define SLOT_H

#include "heave/motion.h"

/** What moves a slot. */
static inline const ramp_t *slot_ramp(const motion_t *self, unsigned i)
{
    return self->space == MOTION_POSE || i == AXIS_ANGLE ? &self->axis[i] : &self->cylinder[i];
}

/** Limits of a slot. */
static inline const ramp_limits_t *slot_limits(const motion_t *self, unsigned i)
{
    return &slot_ramp(self, i)->limits;
}

/** Where a slot is: while a sender is faded in, where it was led to before that. */
static inline const ramp_state_t *slot_state(const motion_t *self, unsigned i)
{
    if (self->is_fading && i != AXIS_ANGLE) {
        return &self->led[i];
    }
    return &slot_ramp(self, i)->state;
}

/** True if the first so many slots rest. */
static inline bool slot_all_at_rest(const motion_t *self, unsigned slots)
{
    unsigned i = 0;
    while (i < slots && slot_state(self, i)->vel_per_cycle_q32 == 0 && slot_state(self, i)->acc_per_cycle2_q32 == 0) {
        i++;
    }
    return i == slots;
}

#endif

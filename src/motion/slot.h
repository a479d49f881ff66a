/* SPDX-License-Identifier: MIT
 * slot.h - the axes of whatever space is followed in: pose axes or cylinders, and the rotation motor. Private to src/motion.
 */
#ifndef SLOT_H
#define SLOT_H

#include "heave/motion.h"

/** Limits of a slot. */
static inline const ramp_limits_t *slot_limits(const motion_t *self, unsigned i)
{
    return self->space == MOTION_POSE || i == AXIS_ANGLE ? &self->axis[i].limits : &self->cylinder[i].limits;
}

/** Where a slot is: while a take-over leads the cylinders, those have a motion of their own, and what counts is what was asked.
 */
static inline const ramp_state_t *slot_state(const motion_t *self, unsigned i)
{
    if (self->space == MOTION_POSE || i == AXIS_ANGLE) {
        return &self->axis[i].state;
    }
    return self->is_taking_over ? &self->led[i] : &self->cylinder[i].state;
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

/* SPDX-License-Identifier: MIT
 * feedback.c - see feedback.h.
 */
#include "feedback.h"

bool feedback_are_all(feedback_t self, drive_state_t state, bool is_zero_needed)
{
    for (unsigned i = 0; i < self.count; i++) {
        const drive_feedback_t *f = &self.drive[i];
        if (f->state != state || !f->has_actual || (is_zero_needed && !f->is_homed)) {
            return false;
        }
    }
    return true;
}

unsigned feedback_count(feedback_t self, drive_state_t state)
{
    unsigned count = 0;
    for (unsigned i = 0; i < self.count; i++) {
        count += self.drive[i].state == state;
    }
    return count;
}

bool feedback_is_well(feedback_t self, bool is_fault_borne)
{
    for (unsigned i = 0; i < self.count; i++) {
        const drive_state_t state = self.drive[i].state;
        if (state == DRIVE_OFFLINE || (state == DRIVE_FAULT && !is_fault_borne)) {
            return false;
        }
    }
    return true;
}

bool feedback_has_fault(feedback_t self)
{
    return !feedback_is_well(self, false);
}

uint32_t feedback_absent(feedback_t self)
{
    uint32_t axes = 0;
    for (unsigned i = 0; i < self.count; i++) {
        axes |= self.drive[i].state == DRIVE_OFFLINE ? 1u << i : 0u;
    }
    return axes;
}

uint32_t feedback_energized(feedback_t self, bool is_answering)
{
    uint32_t axes = 0;
    for (unsigned i = 0; i < self.count; i++) {
        const drive_feedback_t *f = &self.drive[i];
        if (f->is_energized && (!is_answering || f->state != DRIVE_OFFLINE)) {
            axes |= 1u << i;
        }
    }
    return axes;
}

bool feedback_has_other_master(feedback_t self)
{
    bool has_other = false;
    for (unsigned i = 0; i < self.count; i++) {
        has_other |= drive_has_other_master(&self.drive[i]);
    }
    return has_other;
}

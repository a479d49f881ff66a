/* SPDX-License-Identifier: MIT
 * feedback.h - what the feedback of all drives says together. Pure. Private to src/gateway.
 */
#ifndef GATEWAY_FEEDBACK_H
#define GATEWAY_FEEDBACK_H

#include "heave/drives.h"

/** The feedback of a cycle. */
typedef struct {
    const drive_feedback_t *drive;
    unsigned count;
} feedback_t;

/** True if every drive is in the state and knows where it is.
 *  @param is_zero_needed it must also know its zero */
bool feedback_are_all(feedback_t self, drive_state_t state, bool is_zero_needed);

/** True if a drive is in fault or does not answer. */
bool feedback_has_fault(feedback_t self);

/** True if no drive is silent or in fault.
 *  @param is_fault_borne drives may be in fault: they have no torque */
bool feedback_is_well(feedback_t self, bool is_fault_borne);

/** Drives in the state. */
unsigned feedback_count(feedback_t self, drive_state_t state);

/** Drives that do not answer, or are still being set up: bit i for axis i. */
uint32_t feedback_absent(feedback_t self);

/** Drives that have torque, as far as is known: bit i for axis i + 1. For lost drives: the last known state.
 *  @param is_answering only drives that answer */
uint32_t feedback_energized(feedback_t self, bool is_answering);

/** True if another master commands a drive. */
bool feedback_has_other_master(feedback_t self);

#endif

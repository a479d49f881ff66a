/* SPDX-License-Identifier: MIT
 * axis_targets.h - a sender's targets as one value per slot (pose axes or cylinders, then the rotation motor), and what intensity
 * makes of them. Slots are as the sender wants them; scaled, they are what the platform makes of them. Private to src/motion.
 */
#ifndef AXIS_TARGETS_H
#define AXIS_TARGETS_H

#include "heave/motion.h"

/** True if an assembly of the target's extensions (with the intensity in force, pulled into the strokes) exists and is held. */
bool axis_targets_can_assemble(const motion_t *self, const motion_target_t *target);

/** The slots of a target; what they are scaled to is inside the limits, the whole pose in the workspace. Notes what was pulled
 * in.
 *  @param extension_mm_q32 out: of the scaled slots */
void axis_targets_accept(motion_t *self, const motion_target_t *target, q32_t slot_q32[AXES_MAX],
                         q32_t extension_mm_q32[CYLINDERS_MAX]);

/** Slots with the intensity in force. */
void axis_targets_scale(const motion_t *self, motion_space_t space, const q32_t slot_q32[AXES_MAX], q32_t scaled_q32[AXES_MAX]);

/** From here on planned moves end where these slots are with the intensity in force now ... */
void axis_targets_plan(motion_t *self, const q32_t slot_q32[AXES_MAX]);

/** ... and this adds what the intensity has changed since to the references of such a move. */
void axis_targets_shift_refs(const motion_t *self, ramp_ref_t ref[AXES_MAX]);

/** True if the planned move ends at these slots: at an intensity of 0 all of them look alike. */
bool axis_targets_is_planned(const motion_t *self, const q32_t slot_q32[AXES_MAX]);

/** Where the slots are and move, as the sender would have to ask for it. At an intensity of 0: neutral, at rest. */
void axis_targets_unscaled_states(const motion_t *self, history_t now[AXES_MAX]);

/** The references of a stream with the intensity in force. */
void axis_targets_scale_refs(const motion_t *self, ramp_ref_t ref[AXES_MAX]);

#endif

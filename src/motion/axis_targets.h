/* SPDX-License-Identifier: MIT
 * axis_targets.h - a sender's target as one value for each followed axis (followed.h), and what intensity makes of it. Values are
 * as the sender wants them; scaled, they are what the platform makes of them. Private to src/motion.
 */
#ifndef AXIS_TARGETS_H
#define AXIS_TARGETS_H

#include "heave/motion.h"

/** What a target is judged by. */
typedef struct {
    const platform_t *platform;
    const intensity_t *intensity;
    motion_space_t space; /**< that the target is given in */
} axis_scale_t;

/** True if an assembly of the target's extensions (with the intensity in force, pulled into the strokes) exists and is held.
 *  @param is_beginning as in assembly_is_held() */
bool axis_targets_can_assemble(const axis_scale_t *scale, bool is_beginning, const motion_target_t *target);

/** Sets the values of a target; what they are scaled to is inside the limits, the whole pose in the workspace. Notes what was
 *  pulled in. */
void axis_targets_accept(axis_targets_t *self, const axis_scale_t *scale, const motion_target_t *target);

/** Values with the intensity in force. */
void axis_targets_scale(const axis_scale_t *scale, const q32_t value_q32[AXES_MAX], q32_t scaled_q32[AXES_MAX]);

/** From here on planned paths end where the values are with the intensity in force now ... */
void axis_targets_plan(axis_targets_t *self, const axis_scale_t *scale);

/** ... and this adds what the intensity has changed since to the references of such a path. */
void axis_targets_shift_refs(const axis_targets_t *self, const intensity_t *intensity, ramp_ref_t ref[AXES_MAX]);

/** True if the first so many axes of the planned path end at the values: at an intensity of 0 all of them look alike. */
bool axis_targets_is_planned(const axis_targets_t *self, const axis_scale_t *scale, unsigned axes);

/** States of the axes, as the sender would have to ask for them. At an intensity of 0: neutral, at rest.
 *  @param now in and out */
void axis_targets_unscale(const axis_scale_t *scale, history_t now[AXES_MAX]);

/** The references of a stream with the intensity in force. */
void axis_targets_scale_refs(const axis_scale_t *scale, ramp_ref_t ref[AXES_MAX]);

#endif

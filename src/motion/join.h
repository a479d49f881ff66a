/* SPDX-License-Identifier: MIT
 * join.h - one body follows a stream: where it cannot, it joins again with all axes together. Private to src/motion.
 */
#ifndef JOIN_H
#define JOIN_H

#include "heave/motion.h"

/** The stream is followed from now on: joined from wherever the slots are. */
void join_begin(motion_t *self);

/** A sample of the stream has come: a better plan may be possible. */
void join_sample(motion_t *self);

/** Plans what this cycle needs, before it is made. Planning takes most of the stack: its callers hold as little as they can.
 *  @param curve references of the stream, this cycle */
void join_plan(motion_t *self, const ramp_ref_t curve[AXES_MAX]);

/** Plans the cycle anew, as it was found beyond the limits. */
void join_plan_again(motion_t *self, const ramp_ref_t curve[AXES_MAX]);

/** The body's references as planned.
 *  @param ref out: a copy of curve when this is called */
void join_step(motion_t *self, const ramp_ref_t curve[AXES_MAX], ramp_ref_t ref[AXES_MAX]);

/** True if these references of the slots, or those of the cylinders, could not be followed within the limits, and another plan
 *  may help. */
bool join_are_slots_beyond(const motion_t *self, const ramp_ref_t ref[AXES_MAX]);
bool join_are_cylinders_beyond(const motion_t *self, const ramp_ref_t ref[AXES_MAX]);

/** MOTION_SPEED or MOTION_ACCEL while the body is not on the stream's curve. */
unsigned join_flags(const motion_t *self, const ramp_ref_t curve[AXES_MAX]);

#endif

/* SPDX-License-Identifier: MIT
 * fade.h - blends a sender in: its references are weighted with a share that rises from 0 (the rest position) to 1. A ramp
 * (ramp.h) moves the share. Its limits are those of the cylinders, divided by the travel of the cylinder that the share moves
 * most. So blending alone moves no cylinder faster than the given speed, and takes no longer than that needs. The result always
 * lies between the rest position and the reference: nothing overshoots. Owns no clock.
 */
#ifndef HEAVE_FADE_H
#define HEAVE_FADE_H

#include "heave/axes.h"
#include "heave/ramp.h"

#define FADE_SHIFT 46u
#define FADE_FULL  ((int64_t)1 << FADE_SHIFT) /**< the share at the end */

#define FADE_CYCLES_MIN 50u    /**< the share is never quicker, however short the travel is */
#define FADE_CYCLES_MAX 40000u /**< 20 s of the shortest cycles */

/** Limits of the cylinders, per cycle^k. */
typedef struct {
    q32_t vel_q32;
    q32_t acc_q32;
    q32_t jerk_q32;
} fade_limits_t;

/** Members are private to src/motion. */
typedef struct {
    q32_t from_q32[POSE_AXES]; /**< references at the start */
    q32_t plan_travel_mm_q32;  /**< largest travel of a cylinder to the end of a plan, 0: it follows a stream */
    uint32_t least_cycles;     /**< it takes at least so many */
    int64_t share_q46[4];      /**< of the last cycles, the newest first */
} fade_t;

/** Begins at rest.
 *  @param from_q32 positions of the references
 *  @param least_cycles of fading, at most FADE_CYCLES_MAX */
void fade_begin(fade_t *self, const q32_t *from_q32, uint32_t least_cycles);

/** Cycles from the start to the end of a plan. */
int64_t fade_cycles(const fade_t *self, const fade_limits_t *limits);

/** One cycle: scales the references.
 *  @param travel_mm_q32 the largest travel of a cylinder to where the references lead in this cycle, as it moves at the present
 * share
 *  @return false when the share has been 1 long enough for all differences of the references: blending has ended */
bool fade_step(fade_t *self, const fade_limits_t *limits, q32_t travel_mm_q32, ramp_ref_t ref[POSE_AXES]);

#endif

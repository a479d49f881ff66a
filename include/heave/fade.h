/* SPDX-License-Identifier: MIT
 * fade.h - fading in: where a sender leads, as a growing share of the way from where the platform rested.
 * The share rises along 10 u^3 - 15 u^4 + 6 u^5, whose slope is 1.875 at most and whose curvature is 5.8. How quickly u rises
 * follows from the cylinder that is led furthest, so that the fading by itself moves no cylinder faster than the speed given, and
 * never takes less than the time given. Everything is between the two ends of the way: nothing overshoots. Owns no clock.
 */
#ifndef HEAVE_FADE_H
#define HEAVE_FADE_H

#include "heave/axes.h"
#include "heave/ramp.h"

/** Limits of the cylinders, per cycle, and the least time. */
typedef struct {
    q32_t vel_per_cycle_q32;
    q32_t acc_per_cycle2_q32;
    int64_t least_cycles;
} fade_limits_t;

/** Members are private to src/motion. */
typedef struct {
    q32_t from_q32[POSE_AXES];        /**< the slots before */
    q32_t from_mm_q32[CYLINDERS_MAX]; /**< the cylinders before */
    q32_t farthest_mm_q32;            /**< that a cylinder has been led from there */
    int64_t progress_q58;             /**< u, [0, 1] */
    int64_t share_q58[4];             /**< of the last cycles, the newest first */
} fade_t;

/** Begins at rest.
 *  @param from_q32 where the slots are   @param from_mm_q32 where the cylinders are */
void fade_begin(fade_t *self, const q32_t *from_q32, const q32_t *from_mm_q32);

/** Tells where the cylinders are led to, now or at the end of a move. Those that are not used: as in fade_begin(). */
void fade_look(fade_t *self, const q32_t *extension_mm_q32);

/** Cycles that are left, if nothing leads further than so far. */
int64_t fade_cycles_left(const fade_t *self, const fade_limits_t *limits);

/** One cycle: scales the references of the slots.
 *  @return false once the share has been whole for as long as a reference remembers: nothing is left to do */
bool fade_step(fade_t *self, const fade_limits_t *limits, ramp_ref_t ref[POSE_AXES]);

#endif

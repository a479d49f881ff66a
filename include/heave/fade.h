/* SPDX-License-Identifier: MIT
 * fade.h - blends a new sender in: its references are weighted with a share that grows from 0 (the rest position) to 1.
 * The share is 10 u^3 - 15 u^4 + 6 u^5, with a slope of at most 1.875 and a curvature of at most 5.8. The cylinder with the
 * longest distance determines how quickly u rises, so that blending alone moves no cylinder faster than the given speed, and
 * takes at least the given time. The result always lies between the rest position and the reference: nothing overshoots. Owns no
 * clock.
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
    q32_t from_q32[POSE_AXES];        /**< references at the start */
    q32_t from_mm_q32[CYLINDERS_MAX]; /**< cylinders at the start */
    q32_t farthest_mm_q32;            /**< longest distance of a cylinder from the start so far */
    int64_t progress_q58;             /**< u, [0, 1] */
    int64_t share_q58[4];             /**< of the last cycles, the newest first */
} fade_t;

/** Begins at rest.
 *  @param from_q32 positions of the references   @param from_mm_q32 positions of the cylinders */
void fade_begin(fade_t *self, const q32_t *from_q32, const q32_t *from_mm_q32);

/** Reports the target of the cylinders, now or at the end of a move. For unused ones: the value of fade_begin(). */
void fade_look(fade_t *self, const q32_t *extension_mm_q32);

/** Remaining cycles, if the distance does not grow. */
int64_t fade_cycles_left(const fade_t *self, const fade_limits_t *limits);

/** One cycle: scales the references.
 *  @return false when the share has been 1 long enough for all differences of the references: blending has ended */
bool fade_step(fade_t *self, const fade_limits_t *limits, ramp_ref_t ref[POSE_AXES]);

#endif

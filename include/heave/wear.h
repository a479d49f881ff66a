/* SPDX-License-Identifier: MIT
 * wear.h - operating time under torque, travel and cycles of an axis since the start. Uses the feedback, so it counts what the
 * screw has really turned; noise of an encoder at rest does not count. Pure; the caller owns wear_t.
 */
#ifndef HEAVE_WEAR_H
#define HEAVE_WEAR_H

#include "heave/drives.h"

/** Since the start. Unit u is mm, or deg of the rotation motor. */
typedef struct {
    uint64_t energized_us;
    uint64_t travel_milli; /**< thousandths of u: um */
    uint32_t turns;        /**< changes of direction, each after at least 1 u; two are a cycle */
    bool is_known;         /**< private, as are the next members: mark and extreme are valid */
    bool is_upwards;
    q32_t mark_q32;    /**< travel is counted up to here */
    q32_t extreme_q32; /**< furthest since the last turn */
} wear_t;

/** Once per cycle. */
void wear_step(wear_t *self, const drive_feedback_t *feedback, uint32_t cycle_us);

#endif

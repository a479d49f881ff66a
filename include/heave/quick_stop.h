/* SPDX-License-Identifier: MIT
 * quick_stop.h - the end of a quick stop. Many drives keep their torque after the command that stops them: a second command has
 * to take it, once the drive stands still. Shared by the bus drivers whose maps have both commands. Pure.
 */
#ifndef HEAVE_QUICK_STOP_H
#define HEAVE_QUICK_STOP_H

#include "heave/fx.h"

/** The torque goes off after this time, even if the drive has not come to rest: as long as a CiA 402 drive may stay in quick
 * stop. */
#define QUICK_STOP_MOST_US 5000000u

/** A drive stands still if its positions over this time differ by no more than this: slower than 2 mm/s. */
#define QUICK_STOP_REST_US  250000u
#define QUICK_STOP_REST_Q32 (Q32_ONE / 2)

/** A drive that is being stopped. All 0: none. */
typedef struct {
    uint64_t until_us; /**< its torque goes off by then; 0: it is not being stopped */
    uint64_t rest_us;  /**< time of the position from which on it has stood still; 0: there is none yet */
    q32_t rest_q32;    /**< that position */
} quick_stop_t;

/** True from quick_stop_begin() until quick_stop_step() has returned true, or the members were cleared. */
static inline bool quick_stop_is_active(const quick_stop_t *self)
{
    return self->until_us != 0;
}

/** The drive was told to stop. A quick stop that is active already keeps its end. */
void quick_stop_begin(quick_stop_t *self, uint64_t now_us);

/** Judges the newest position. Call it in every poll after the drive has taken the command that stops it.
 *  @param actual_q32 [mm, deg]
 *  @param actual_us  when it was received; the same position may be passed again
 *  @param command_us    when the drive took the command: older positions do not count
 *  @return true: take the torque now, the quick stop is over; false: not yet, or none is active */
bool quick_stop_step(quick_stop_t *self, q32_t actual_q32, uint64_t actual_us, uint64_t command_us, uint64_t now_us);

#endif

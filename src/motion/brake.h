/* SPDX-License-Identifier: MIT
 * brake.h - how far an axis still moves when it brakes with limited jerk, in closed form. Private to src/motion.
 *
 * Model, everything per cycle: acc' = acc + jerk, vel' = vel + acc', pos' = pos + vel'. With n = acc / J the discrete sums are
 *   velocity gained until acc is 0:        J n (n - 1) / 2
 *   distance from W at acc 0 to rest:      W sqrt(W / J) where the stop does not get as far as -A
 * both exact for whole n and used for real n (derivation: sums of 1, k and k^2 over the cycles of a jerk-limited brake). A stop
 * that holds -A is summed phase by phase, exact for every acc: there an error in speed would count with every cycle of the hold.
 */
#ifndef BRAKE_H
#define BRAKE_H

#include "heave/ramp.h"

/** Signed distance to rest under the quickest stop (velocity and acceleration both end at 0). */
q32_t brake_distance(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32);

/** Largest distance by which the position still rises if every cycle from now on takes the full jerk downwards (until
 * -acc_safe). Exact in integers, never below 0. Braking in the other direction is the mirror image. */
q32_t brake_peak(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32);

/** Velocity that the axis still reaches if acc goes back to 0 with full jerk. Exact in integers; acc >= 0. */
q32_t brake_velocity_peak(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32);

/** True if brake_velocity_peak() is at or below most_q32; acc in [0, acc_safe]. Usually needs no division. */
bool brake_keeps_velocity(const ramp_t *ramp, q32_t vel_q32, q32_t acc_q32, q32_t most_q32);

/** Largest acceleration for the next cycle from which the velocity can be kept at or below vel + room; room >= 0. */
q32_t brake_acc_for_velocity_room(const ramp_t *ramp, q32_t room_q32);

#endif

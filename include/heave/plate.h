/* SPDX-License-Identifier: MIT
 * plate.h - pose, speed and acceleration of the plate from the drives' feedback, by forward kinematics and a filter.
 * For display only: no motion depends on it. The caller owns plate_t; one thread; nothing blocks.
 */
#ifndef HEAVE_PLATE_H
#define HEAVE_PLATE_H

#include "heave/drives.h"
#include "heave/kin.h"

#define PLATE_PERIOD_US 10000u  /**< shortest time between two samples, also if no pose was found */
#define PLATE_GAP_US    100000u /**< after a longer gap there is no speed, and the filter restarts */
#define PLATE_SAMPLES   24u     /**< samples after a restart of the filter before speed and acceleration are valid */

/** The plate. Poses in deg and mm; rates are those of the pose's axes, in deg and mm per s and per s^2. All Q32. */
typedef struct {
    pose_t pose;         /**< at at_us, valid if has_pose */
    pose_t speed_per_s;  /**< valid if has_rates; at at_us, if the acceleration is constant */
    pose_t accel_per_s2; /**< valid if has_rates; 20 ms before at_us */
    uint64_t at_us;      /**< time of the oldest cylinder's feedback in the pose */
    bool has_pose;       /**< every cylinder has reported its extension, and a pose belongs to them */
    bool has_rates;
    bool was_sought;  /**< private: a pose, at at_us */
    pose_t filtered;  /**< private */
    uint32_t samples; /**< private: since the filter has started */
} plate_t;

/** Starts without a pose. */
void plate_init(plate_t *self);

/** Processes feedback. Call once per cycle. Calculates only for a new sample: at most two forward solutions.
 *  @param feedback one per cylinder
 *  @param guess    a nearby pose, such as the pose sent; used if there is no last pose or it does not converge */
void plate_step(plate_t *self, const kin_t *kin, const drive_feedback_t feedback[], const pose_t *guess, uint64_t now_us);

#endif

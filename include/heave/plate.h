/* SPDX-License-Identifier: MIT
 * plate.h - where the plate is and how it moves, from the drives' feedback: forward kinematics, and a filter for speed and
 * acceleration. For display only: nothing that moves depends on it. The caller owns plate_t; one thread; nothing blocks.
 */
#ifndef HEAVE_PLATE_H
#define HEAVE_PLATE_H

#include "heave/drives.h"
#include "heave/kin.h"

#define PLATE_PERIOD_US 10000u  /**< least time of the feedback from one sample to the next, where no pose is found too */
#define PLATE_GAP_US    100000u /**< feedback that is older tells no speed; after it the filter starts anew */
#define PLATE_SAMPLES   24u     /**< from a start of the filter until its speed and acceleration are told */

/** The plate. Poses in deg and mm; rates are those of the pose's axes, in deg and mm per s and per s^2. All Q32. */
typedef struct {
    pose_t pose;         /**< at at_us, valid if has_pose */
    pose_t speed_per_s;  /**< valid if has_rates; at at_us, where the acceleration is steady */
    pose_t accel_per_s2; /**< valid if has_rates; 20 ms before at_us */
    uint64_t at_us;      /**< time of the oldest cylinder's feedback in the pose */
    bool has_pose;       /**< every cylinder has told its extension, and a pose has these */
    bool has_rates;
    bool was_sought;  /**< private: a pose, at at_us */
    pose_t filtered;  /**< private */
    uint32_t samples; /**< private: since the filter has started */
} plate_t;

/** Starts without a pose. */
void plate_init(plate_t *self);

/** Takes in feedback. Once per cycle; works where there is a new sample: two forward solutions at most.
 *  @param feedback one per cylinder
 *  @param guess    a pose nearby, where none has been found yet or the last one leads nowhere: the pose sent */
void plate_take(plate_t *self, const kin_t *kin, const drive_feedback_t feedback[], const pose_t *guess, uint64_t now_us);

/** True for one that may be used, whatever file it comes from; see sane.h. */
bool plate_is_sane(const plate_t *self);

#endif

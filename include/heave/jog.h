/* SPDX-License-Identifier: MIT
 * jog.h - manual motion: moves one cylinder, the rotation motor or one pose axis towards the end of its range, until
 * motion_stop() or until the end. In manual operation (motion_serve()) nothing else moves. An axis that is not jogged stays
 * exactly where it is, also outside its stroke: a drive that has not found its zero may seem to be there. The limits of a jog
 * are lower than those of a ride. A test signal (excitation.h) moves an axis in the same way, around its present position. The
 * functions belong to motion_t (motion.h).
 */
#ifndef HEAVE_JOG_H
#define HEAVE_JOG_H

#include "heave/axes.h"
#include "heave/excitation.h"
#include "heave/ramp.h"

/** Limits of jogs and test signals. */
typedef struct {
    ramp_limits_t cylinder; /**< of every cylinder; the position bounds differ for each */
    q32_t deg_per_cycle_q32;
    q32_t signal_mm_q32, signal_deg_q32; /**< widest test signal */
    q32_t signal_mm_per_cycle_q32;       /**< largest cylinder speed in a test signal; its other limits are those of a ride */
} jog_limits_t;

/** The jog or test signal in progress, one at a time; members are private to src/motion. */
typedef struct {
    jog_limits_t limits;
    bool is_serving;
    bool is_posed;         /**< along a pose axis, not a cylinder */
    bool is_excited;       /**< a test signal, not a jog */
    excitation_t signal;   /**< valid if is_excited */
    uint32_t moved;        /**< bit i: this cylinder (AXIS_ANGLE: the rotation motor) is moved, or has not come to rest yet */
    ramp_t ramp[AXES_MAX]; /**< limiters of the moved axes; their bounds include the position where the jog began */
} jog_t;

struct motion;

/** Begins manual operation: nothing moves by itself. Call it only while the motion is at rest. motion_place() ends it. */
void motion_serve(struct motion *self);

/** Sets the set-point of one axis to its actual position, at rest, because its drive has no torque or moves by itself. Only in
 *  manual operation.
 *  @param axis a cylinder, from 0, or AXIS_ANGLE */
void motion_place_axis(struct motion *self, unsigned axis, q32_t position_q32);

/** Moves a cylinder, or the rotation motor, towards one end of its range. Only in manual operation, at rest.
 *  @param axis a cylinder, from 0, or AXIS_ANGLE
 *  @param speed_q16 mm/s (deg/s), the sign is the direction; reduced to the limits of a jog
 *  @param way_q16 distance in mm (deg); 0: to the end of the range
 *  @return HV_OK; HV_ERR_RANGE: it is at that end already, or the speed is too low; HV_ERR_STATE: not in manual operation, or
 *          not at rest */
hv_status_t motion_jog_axis(struct motion *self, unsigned axis, q16_t speed_q16, q16_t way_q16) HV_MUST_CHECK;

/** Moves the pose along one of its axes, as far as the cylinders reach. Only in manual operation, at rest.
 *  @param axis of the pose
 *  @param speed_q16 mm/s or deg/s; reduced if a cylinder would be faster than a jog allows
 *  @param way_q16 distance in mm or deg; 0: as far as the cylinders reach
 *  @return as above; HV_ERR_NOSUP: this platform does not move that axis; HV_ERR_ARG: no pose belongs to the extensions */
hv_status_t motion_jog_pose(struct motion *self, unsigned axis, q16_t speed_q16, q16_t way_q16) HV_MUST_CHECK;

/** Moves a cylinder, or the rotation motor, by a test signal around its present position. Only in manual operation, at rest.
 *  @return as motion_jog_axis(); HV_ERR_RANGE: there is not enough travel to both sides, or excitation_is_allowed() is
 *          false; HV_ERR_FORMAT: the amplitude exceeds the settings */
hv_status_t motion_excite_axis(struct motion *self, unsigned axis, const excitation_request_t *request) HV_MUST_CHECK;

/** Moves the pose by a test signal along one of its axes, around its present position. Only in manual operation, at rest.
 *  @return as motion_jog_pose(); HV_ERR_RANGE and HV_ERR_FORMAT as motion_excite_axis() */
hv_status_t motion_excite_pose(struct motion *self, unsigned axis, const excitation_request_t *request) HV_MUST_CHECK;

#endif

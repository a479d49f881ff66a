/* SPDX-License-Identifier: MIT
 * jog.h - manual motion, as the cycle sees it; see heave/jog.h. The functions that begin a jog or a test signal plan it as a
 * straight line; they need a platform in manual operation, at rest. Private to src/motion.
 */
#ifndef JOG_H
#define JOG_H

#include "heave/motion.h"
#include "platform.h"

/** Sets the limits of jogs and test signals.
 *  @return HV_OK; HV_ERR_RANGE where they make no sense */
hv_status_t jog_init(jog_t *self, const settings_t *settings) HV_MUST_CHECK;

/** motion_jog_axis(), motion_jog_pose(), motion_excite_axis() and motion_excite_pose(), see heave/jog.h. */
hv_status_t jog_begin_axis(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis, q16_t speed_q16,
                           q16_t way_q16) HV_MUST_CHECK;
hv_status_t jog_begin_pose(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis, q16_t speed_q16,
                           q16_t way_q16) HV_MUST_CHECK;
hv_status_t jog_excite_axis(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis,
                            const excitation_request_t *request) HV_MUST_CHECK;
hv_status_t jog_excite_pose(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis,
                            const excitation_request_t *request) HV_MUST_CHECK;

/** Plans the motion of axes along a line whose ends are set. @param moved bit i: this axis */
void jog_plan(jog_t *self, const platform_t *platform, straight_t *line, uint32_t moved, bool is_posed,
              const path_limits_t *limits);

/** True where every cylinder is within its stroke, or at least no further out than now, and the cylinders hold the plate. */
bool jog_is_reached(const platform_t *platform, const pose_t *pose);

/** True where manual motion moves an axis, or has not come to rest yet. */
static inline bool jog_is_moved(const jog_t *self, unsigned axis)
{
    return (self->moved >> axis & 1u) != 0;
}

/** What limits an axis now: where a jog moves it the limiter of that, else its own. */
const ramp_t *jog_limiter(const jog_t *self, const platform_t *platform, unsigned axis);

/** References of the next cycle of a jog or test signal. */
void jog_step(jog_t *self, const platform_t *platform, straight_t *line, ramp_ref_t ref[AXES_MAX]);

/** Moves an axis through its limiter in manual operation. An axis that is not moved stays as it is; one that has come to rest
 *  after its stop is moved no more.
 *  @param is_ended nothing moves it any more
 *  @return the flags of the limiter */
unsigned jog_limit(jog_t *self, platform_t *platform, unsigned axis, const ramp_ref_t *ref, bool is_ended);

/** assembly_can_stop() by what limits the cylinders now: what a jog moves stops by the limits of a jog, which are lower than
 * those of a ride. */
bool jog_can_stop(const jog_t *self, const platform_t *platform);

/** True where a jog has to stop: extensions moved one by one come to where the cylinders would not hold the plate. */
bool jog_is_near_singularity(const jog_t *self, const platform_t *platform);

/** True where the jog or test signal has been made. */
bool jog_is_done(const jog_t *self, const straight_t *line);

#endif

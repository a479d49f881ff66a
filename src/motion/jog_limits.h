/* SPDX-License-Identifier: MIT
 * jog_limits.h - how fast and how gentle a jog may be. Private to src/motion.
 */
#ifndef JOG_LIMITS_H
#define JOG_LIMITS_H

#include "heave/motion.h"

/** Limits of a jog that settings ask for.
 *  @return HV_OK; HV_ERR_RANGE where they make no sense */
hv_status_t jog_limits_init(jog_limits_t *self, const settings_t *settings) HV_MUST_CHECK;

/** What limits an axis now: where a jog leads it the limiter of that, else its own. */
const ramp_t *jog_limiter(const motion_t *self, unsigned axis);

#endif

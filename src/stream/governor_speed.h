/* SPDX-License-Identifier: MIT
 * governor_speed.h - the first part of the governor: where a speed limit is exceeded, the steps of all channels are made smaller
 * by one factor, and what is left behind is caught up later. Also what the governor calculates with. Private to src/stream.
 */
#ifndef GOVERNOR_SPEED_H
#define GOVERNOR_SPEED_H

#include "heave/governor.h"

#define GOVERNOR_NEED_MAX (1000 * Q16_ONE)

static inline int32_t governor_larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

/** The share of a limit that a difference is, Q16, at most GOVERNOR_NEED_MAX. */
static inline int32_t governor_share_of(q32_t difference_q32, int64_t per_limit_q62)
{
    return (int32_t)fx_clamp(fx_mul_shift(fx_abs(difference_q32), per_limit_q62, 46), 0, GOVERNOR_NEED_MAX);
}

/** Coefficient per period of a low-pass of that time constant. */
static inline q32_t governor_share_of_period(uint32_t period_us, uint32_t time_constant_us)
{
    return Q32_ONE * (int64_t)period_us / ((int64_t)period_us + time_constant_us);
}

/** One period: takes away from the steps what the speed limits do not allow.
 *  @param scale_q16 [0, Q16_ONE] that the result will be multiplied by
 *  @param kept_q32 out: what is left of asked_q32, one value per channel with limits */
void governor_limit_speed(governor_t *self, const q32_t *asked_q32, int32_t scale_q16, q32_t *kept_q32);

#endif

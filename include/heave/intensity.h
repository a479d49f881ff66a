/* SPDX-License-Identifier: MIT
 * intensity.h - scales a sender's motion about neutral, 0 to 100 %; changes follow a jerk-limited ramp.
 * Scales references, not set-points: limits, workspace and fade-in are applied afterwards. Owns no clock and no I/O.
 */
#ifndef HEAVE_INTENSITY_H
#define HEAVE_INTENSITY_H

#include "heave/ramp.h"

#define INTENSITY_RAMP_MIN_MS 500u
#define INTENSITY_RAMP_MAX_MS 10000u

/** The share at 100 %. */
#define INTENSITY_SHIFT 46u
#define INTENSITY_FULL  ((int64_t)1 << INTENSITY_SHIFT)

/** Intensity; members are private to src/motion. */
typedef struct {
    unsigned percent; /**< asked for */
    unsigned max_percent;
    ramp_t ramp;          /**< of the share */
    int64_t share_q46[4]; /**< in force in this cycle and the three before */
} intensity_t;

/** Starts at rest on a percentage.
 *  @param percent [0, max_percent]   @param max_percent [1, 100]   @param ramp_ms [500, 10000]: from 0 to 100 %; a change by c %
 *  takes the cube root of c/100 of that   @param cycle_us [RAMP_CYCLE_MIN_US, RAMP_CYCLE_MAX_US]
 *  @return HV_OK; HV_ERR_RANGE */
hv_status_t intensity_init(intensity_t *self, unsigned percent, unsigned max_percent, uint32_t ramp_ms,
                           uint32_t cycle_us) HV_MUST_CHECK;

/** Sets the target percentage at any time; intensity_step() moves there with continuous acceleration.
 *  @return HV_OK; HV_ERR_RANGE above max_percent: nothing changes */
hv_status_t intensity_set(intensity_t *self, unsigned percent) HV_MUST_CHECK;

/** Applies the target percentage at once. For situations in which this moves nothing. */
void intensity_place(intensity_t *self);

/** Advances one cycle. */
void intensity_step(intensity_t *self);

/** The percentage in force. */
q32_t intensity_percent_q32(const intensity_t *self);

/** The larger of the percentage in force and the target: the most that a motion may need. */
q16_t intensity_largest_q16(const intensity_t *self);

/** A sender's value scaled with the share in force: exactly neutral at 0 %, exactly the value at 100 %. */
q32_t intensity_scaled(const intensity_t *self, q32_t neutral_q32, q32_t value_q32);

/** The value that intensity_scaled turns into this one; neutral at 0 %. */
q32_t intensity_unscaled(const intensity_t *self, q32_t neutral_q32, q32_t scaled_q32);

/** A scaled reference; its differences include those of the share. */
ramp_ref_t intensity_scale(const intensity_t *self, q32_t neutral_q32, const ramp_ref_t *ref);

/** True if intensity_shift() for this planned share is 0 for every travel_q32. */
bool intensity_is_still(const intensity_t *self, int64_t planned_q46);

/** The correction of a reference that was planned with another share. travel_q32 is the sender's value minus neutral. */
ramp_ref_t intensity_shift(const intensity_t *self, int64_t planned_q46, q32_t travel_q32);

#endif

/* SPDX-License-Identifier: MIT
 * stream_curve.h - the curve through the samples of a stream: a uniform B-spline with the samples, or points led ahead of them,
 * as control points. A control point is committed when the curve first needs it and never changed afterwards. Knows no time but
 * the period; private to src/stream.
 */
#ifndef STREAM_CURVE_H
#define STREAM_CURVE_H

#include "heave/stream.h"

#define STREAM_CURVE_LED_Q32 (Q32_ONE * 7 / 10) /**< periods that control points are led ahead of their points, if balanced */

enum {
    STREAM_CURVE_AGE_MAX = 100,  /**< samples after which an axis may move as fast as it can */
    STREAM_CURVE_AHEAD_MAX = 28, /**< samples kept that are not committed; the ring has room for the longest mean of led points
                                      behind them */
    STREAM_CURVE_MEAN_MAX = 5    /**< points of which one is the mean, where samples belong to their arrivals */
};

/** A curve that has always rested on the sample. */
void stream_curve_start(stream_curve_t *self, const kin_t *kin, const q32_t *sample_q32);

/** Tells the period: how long a motion is kept up where samples are missing, and how firmly the curve comes back to them; and
 * the style: how far control points are led ahead of the points. */
void stream_curve_pace(stream_curve_t *self, stream_style_t style, uint32_t period_us, uint32_t cycle_us, bool is_lossy);

/** Adds a sample the given number of periods after the newest; 0: in the place of the newest.
 *  @param is_of_stall others will follow it in a burst: its index is believed however late it is
 *  @param point_q32 what it is at its place on the time line */
void stream_curve_append(stream_curve_t *self, unsigned periods, bool is_of_stall, const q32_t *sample_q32,
                         const q32_t *point_q32);

/** The curve has another grid, which begins with this sample at head. It goes on as it was and comes over to the samples softly.
 * After stream_curve_pace(); the phase behind head is 0 then.
 *  @param now where the curve is: position, velocity and acceleration of each axis; NULL: nobody sees it yet, it is on the
 * samples
 *  @param first_q32 a stream begins here, and its motion with this sample before the last one; NULL: the sender has another rate
 *  @param periods of the new grid since the sample before, at least 1: after a gap its step is not the way of one period */
void stream_curve_regrid(stream_curve_t *self, const kin_t *kin, const history_t *now, const q32_t *first_q32, unsigned periods,
                         const q32_t *sample_q32);

/** Makes the newest sample's index one less: for a time line that is too far behind. The curve comes over to the other time line
 *  softly. Nothing is changed where there is no point to go to. */
void stream_curve_skip(stream_curve_t *self);

/** Commits the next point: the sample, or what is guessed in its place. */
void stream_curve_commit(stream_curve_t *self, const kin_t *kin);

/** True once the curve rests exactly on the newest sample. */
bool stream_curve_is_at_rest(const stream_curve_t *self);

/** Position of an axis at that phase. Q36 times Q60 is Q32 by 2^64, which costs no shifts. */
static inline q32_t stream_curve_at(const stream_curve_t *self, unsigned axis, const int64_t weight_q60[3])
{
    return self->control_q32[axis] + fx_mul_shift_fit(self->way_q36[0][axis], weight_q60[0], 64) +
           fx_mul_shift_fit(self->way_q36[1][axis], weight_q60[1], 64) +
           fx_mul_shift_fit(self->way_q36[2][axis], weight_q60[2], 64);
}

#endif

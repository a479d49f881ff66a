/* SPDX-License-Identifier: MIT
 * stream_predictor.h - where the motion of a stream's newest points leads: a linear prediction of second order (AR(2)) of the
 * step from one point to the next. An even motion has the coefficients 1 and 0, an oscillation of angle w per period 2 cos w and
 * -1. Private to src/stream.
 */
#ifndef STREAM_PREDICTOR_H
#define STREAM_PREDICTOR_H

#include "heave/stream.h"

/** Fits the coefficients by least squares to the newest steps of all pose axes together: a sender has one motion, and six axes
 *  tell more of it than one. About 4,000 instructions.
 *  @param when_few what is assumed of a stream that has too few samples yet */
stream_predictor_t stream_predictor_fit(const stream_curve_t *curve, stream_predictor_t when_few);

/** The step that follows the newest step and the one before it. */
static inline q32_t stream_predictor_next(const stream_predictor_t *self, q32_t step_q32, q32_t before_q32)
{
    return fx_mul_shift(step_q32, self->by_newest_q32, 32) + fx_mul_shift(before_q32, self->by_before_q32, 32);
}

#endif

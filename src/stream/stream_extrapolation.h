/* SPDX-License-Identifier: MIT
 * stream_extrapolation.h - points of a stream's curve where samples are missing: the motion of the last samples goes on, as
 * stream_predictor.h predicts it, for a while and stops. Private to src/stream; changes the points beyond the newest sample,
 * `extrapolation` and `predictor` alone.
 */
#ifndef STREAM_EXTRAPOLATION_H
#define STREAM_EXTRAPOLATION_H

#include "heave/stream.h"

/** Looks where the motion of the newest samples leads. Before the first point that is guessed. */
void stream_extrapolation_begin(stream_curve_t *self);

/** Guesses the point so many periods beyond the newest sample: 1, then 2, and so on. */
void stream_extrapolation_point(stream_curve_t *self, int32_t periods);

/** A step of one period, as far as the axis moves at most, and since the stream began at rest can move so far: what was asked may
 *  have been faster, but nothing has gone there. */
q32_t stream_extrapolation_within_speed(const stream_curve_t *self, unsigned axis, q32_t step_q32);

#endif

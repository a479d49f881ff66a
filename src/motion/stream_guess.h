/* SPDX-License-Identifier: MIT
 * stream_guess.h - points of a stream's curve where samples are missing: the motion of the last samples goes on for a while and
 * stops. A motion to and fro goes on as one. Private to src/motion; changes the points beyond the newest sample and `lead` alone.
 */
#ifndef STREAM_GUESS_H
#define STREAM_GUESS_H

#include "heave/stream.h"

/** Looks where the motion of the newest samples leads. Before the first point that is guessed. */
void stream_guess_begin(stream_curve_t *self);

/** Guesses the point so many periods beyond the newest sample, at least 1. */
void stream_guess_point(stream_curve_t *self, int32_t periods);

/** A step of one period, as far as the axis moves at most, and since the stream began at rest can move so far: what was asked may
 *  have been faster, but nothing has gone there. */
q32_t stream_guess_within_speed(const stream_curve_t *self, unsigned axis, q32_t step_q32);

#endif

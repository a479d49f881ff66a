/* SPDX-License-Identifier: MIT
 * stream_curve.h - the curve through the samples of a stream: a uniform B-spline with the samples as control points.
 * A control point is committed when the curve first needs it and never changed afterwards. Knows no time; private to src/motion.
 */
#ifndef STREAM_CURVE_H
#define STREAM_CURVE_H

#include "heave/stream.h"

/** A curve that has always rested on the sample. */
void stream_curve_start(stream_curve_t *self, unsigned axes, const q32_t *sample_q32);

/** Adds a sample the given number of periods after the newest; 0: in the place of the newest. */
void stream_curve_append(stream_curve_t *self, unsigned periods, const q32_t *sample_q32);

/** True if the sample equals the newest one in all axes. */
bool stream_curve_is_newest(const stream_curve_t *self, const q32_t *sample_q32);

/** Makes the newest sample's index one less or one more, dropping or guessing a point that is not committed: for a time line
 *  that was found to be wrong. Dropping needs two samples ahead, else nothing is changed. */
void stream_curve_skip(stream_curve_t *self);
void stream_curve_stretch(stream_curve_t *self);

/** Commits the next point: the sample, or what is guessed in its place. */
void stream_curve_commit(stream_curve_t *self);

/** True once the curve rests exactly on the newest sample. */
bool stream_curve_is_at_rest(const stream_curve_t *self);

/** Positions at a phase after the commit of the newest point.
 *  @param between_q32 [0, 1)   @param pos_q32 out, one per axis */
void stream_curve_at(const stream_curve_t *self, stream_style_t style, q32_t between_q32, q32_t *pos_q32);

#endif

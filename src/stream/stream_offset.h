/* SPDX-License-Identifier: MIT
 * stream_offset.h - the offset of the curve of a stream from its points (`off_q32`: offset, its change per period and per
 * period^2). A filter with three equal poles at 1 - `bandwidth_q32` takes it back to 0. The offset never leads the curve further
 * than the motion has recently been: a correction is not a motion of the sender, but the governor would treat its overshoot as
 * one. Private to src/stream.
 */
#ifndef STREAM_OFFSET_H
#define STREAM_OFFSET_H

#include "heave/stream.h"

enum {
    STREAM_OFFSET_STALL = 8 /**< from this many guesses on (a stall) the offset is taken back even more softly */
};

/** Largest jump of a control point. A jump j makes third differences of up to 2 j; they may use a quarter of the limit. */
q32_t stream_offset_jump(const stream_curve_t *self, unsigned axis);

/** Makes the filter softer, the more points were guessed. A softer filter that an earlier offset still uses stays in use.
 *  Returns the share of a velocity that may be added: with a softer filter the same velocity overshoots further. */
q32_t stream_offset_soften(stream_curve_t *self, int32_t guessed);

/** The softest bandwidth that any axis needs. */
void stream_offset_soften_to_limits(stream_curve_t *self);

/** One period of the filter. q^3 with q = 1 - bandwidth, see the ramp in DESIGN.md. */
void stream_offset_decay(const stream_curve_t *self, q32_t off_q32[3]);

/** Bounds the offset of the curve on its way to the control point of point_q32. */
void stream_offset_bound(stream_curve_t *self, unsigned axis, q32_t point_q32);

/** Extends the recent range of the motion by the point at head and by point_q32, its control point. It narrows slowly. */
void stream_offset_widen(stream_curve_t *self, unsigned axis, q32_t point_q32);

#endif

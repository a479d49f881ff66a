/* SPDX-License-Identifier: MIT
 * stream_control.h - control points of a stream's curve: each belongs on its point, on a mean of the points up to it, or is led
 * ahead of it so that the curve is less late. Private to src/stream.
 */
#ifndef STREAM_CONTROL_H
#define STREAM_CONTROL_H

#include "heave/stream.h"

/** Where the control point for the point of that index belongs. */
q32_t stream_control_point(const stream_curve_t *self, unsigned axis, uint32_t index);

/** Where the last three control points belong, newest first. */
void stream_control_at_head(const stream_curve_t *self, q32_t point_q32[3][AXES_MAX]);

/** How many points of coarse values a control point is to be the mean of, thrice: the same for all axes, so that they are late
 *  together. */
int32_t stream_control_window(const stream_curve_t *self);

/** So many it is the mean of from now on. */
void stream_control_set_window(stream_curve_t *self, int32_t window);

/** As many points as arrivals take a certain time make a mean where samples belong to their arrivals; no to and fro with the
 *  period. */
void stream_control_set_mean(stream_curve_t *self, uint32_t period_us);

/** Samples belong to their arrivals by that share, [0, Q32_ONE]; many are lost; the sender's period. By these control points are
 *  led, or are means. */
void stream_control_lead(stream_curve_t *self, q32_t arrived_q32, bool is_lossy, uint32_t period_us);

#endif

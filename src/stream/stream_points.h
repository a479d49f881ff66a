/* SPDX-License-Identifier: MIT
 * stream_points.h - the ring of points of a stream's curve. Private to src/stream.
 */
#ifndef STREAM_POINTS_H
#define STREAM_POINTS_H

#include "heave/stream.h"

/* Where the ring has an index; indices wrap. */
static inline unsigned stream_points_place(uint32_t index)
{
    return index % STREAM_POINTS;
}

/* Index of the newest sample. */
HV_WRAPS static inline uint32_t stream_points_newest(const stream_curve_t *self)
{
    return self->head + (uint32_t)self->ahead;
}

#endif

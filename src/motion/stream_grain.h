/* SPDX-License-Identifier: MIT
 * stream_grain.h - what the values of a sender are multiples of: whole millimetres, tenths of a degree. Private to src/motion.
 */
#ifndef STREAM_GRAIN_H
#define STREAM_GRAIN_H

#include "heave/stream.h"

/** Looks at a sample so many periods after the newest one, which is still last_q32; finds grain_q32 of each axis. Values that go
 * on in even steps, or jump now and then, have none. */
void stream_grain_watch(stream_curve_t *self, unsigned periods, const q32_t *sample_q32);

#endif

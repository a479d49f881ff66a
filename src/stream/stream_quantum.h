/* SPDX-License-Identifier: MIT
 * stream_quantum.h - what the values of a sender are multiples of: whole millimetres, tenths of a degree. Private to src/stream.
 */
#ifndef STREAM_QUANTUM_H
#define STREAM_QUANTUM_H

#include "heave/stream.h"

enum {
    STREAM_QUANTUM_WATCH = 64, /**< samples after which the watch begins anew: a sender may have become finer, or coarser */
    STREAM_QUANTUM_TURNS = 4 /**< changes of the step that tell a rounding; a jump makes one, or two where a sample is withheld */
};

/** Looks at a sample so many periods after the newest one, which is still last_q32; finds quantum_q32 of each axis. Values that
 * go on in even steps, or jump now and then, have none. */
void stream_quantum_watch(stream_curve_t *self, unsigned periods, const q32_t *sample_q32);

/** True if the step between two samples is larger than what rounding makes of a slow motion. */
bool stream_quantum_is_significant(const stream_curve_t *self, const q32_t *from_q32, const q32_t *to_q32);

#endif

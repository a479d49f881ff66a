/* SPDX-License-Identifier: MIT
 * root.h - the zero of a falling function between two points, by the Illinois rule. Private to src/motion.
 */
#ifndef ROOT_H
#define ROOT_H

#include "heave/fx.h"

/** A bracket: values at both ends (at_low > 0 > at_high), and which end the last step moved. */
typedef struct {
    int64_t low, high;
    int64_t at_low, at_high;
    int last_moved;
} bracket_t;

/** Where the chord of the bracket crosses zero: the next point to try, and the best guess at the end. */
static inline int64_t bracket_chord(const bracket_t *self)
{
    if (self->at_low == 0) {
        return self->low;
    }
    return self->low + fx_mul_div(self->high - self->low, self->at_low, fx_sub_sat(self->at_low, self->at_high));
}

/** Narrows the bracket to a point inside. An end that stays twice in a row counts half, or it would stay for ever. */
static inline void bracket_narrow(bracket_t *self, int64_t at, int64_t value)
{
    const int moved = value >= 0 ? -1 : 1;
    if (moved < 0) {
        self->low = at;
        self->at_low = value;
        self->at_high /= self->last_moved == moved ? 2 : 1;
    } else {
        self->high = at;
        self->at_high = value;
        self->at_low /= self->last_moved == moved ? 2 : 1;
    }
    self->last_moved = moved;
}

#endif

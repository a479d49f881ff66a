/* SPDX-License-Identifier: MIT
 * deadman.h - whether a hand is still there: what a person holds goes on for a moment after the newest proof of it, no longer.
 * The proof is an echo: a client sends back the newest tick that it has heard of this machine, so that the tick's age says how
 * old the proof is at most, whatever happened on the way. What a stalled link delivers in a burst carries old ticks and counts
 * for nothing. Once the hand has been away only a new press begins again. Pure; time is an argument.
 */
#ifndef HEAVE_DEADMAN_H
#define HEAVE_DEADMAN_H

#include "heave/fx.h"

/** A proof counts for so long, from the tick that it echoes. */
#define DEADMAN_HOLD_US 250000u

/** A hand; members are private to deadman.c but for display. All zero: none, and none before. */
typedef struct {
    bool is_held;
    uint32_t series;   /**< of the newest press; 0 = none yet */
    uint32_t counter;  /**< of the newest beat of that series */
    uint64_t until_us; /**< while is_held: until then */
} deadman_t;

/** What became of a press or a beat. */
typedef enum {
    DEADMAN_TAKEN,
    DEADMAN_STALE, /**< the tick is too old, or of a time that has not come: nothing changes */
    DEADMAN_OVER,  /**< of a beat: its series is not held, or not any more; it takes a new press */
    DEADMAN_KNOWN  /**< of a beat: not newer than the last; of a press: such a series was held before. Nothing changes */
} deadman_answer_t;

/** Begins a series. A hand that is there gives way.
 *  @param series above that of every press before
 *  @param age_us of the tick that it echoes */
deadman_answer_t deadman_press(deadman_t *self, uint32_t series, uint64_t age_us, uint64_t now_us);

/** Goes on with it.
 *  @param counter above that of every beat of this series before; the first is at least 1 */
deadman_answer_t deadman_beat(deadman_t *self, uint32_t series, uint32_t counter, uint64_t age_us, uint64_t now_us);

/** Lets go. */
void deadman_release(deadman_t *self);

/** Once per cycle, before anything moves.
 *  @return true while the hand is there */
bool deadman_step(deadman_t *self, uint64_t now_us);

/** True for one that may be used, whatever file it comes from; see sane.h. */
bool deadman_is_sane(const deadman_t *self);

#endif

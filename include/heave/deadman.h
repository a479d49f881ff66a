/* SPDX-License-Identifier: MIT
 * deadman.h - hold-to-run: decides whether a person still holds a button ("the hand"). A motion continues only for a short time
 * after the newest proof. For a proof, a client sends back the newest tick that it has received from this machine. The age of
 * the tick is thus an upper limit for the age of the proof, whatever delayed it. A burst from a stalled link carries old ticks
 * and is ignored. Once the proofs have ended, only a new press starts a motion again. Pure; time is an argument.
 */
#ifndef HEAVE_DEADMAN_H
#define HEAVE_DEADMAN_H

#include "heave/fx.h"

/** A proof is valid for this time, counted from its tick. */
#define DEADMAN_HOLD_US 250000u

/** State of the hand. Other modules may read members for display only. All zero: nothing is held, or was held before. */
typedef struct {
    bool is_held;
    uint32_t series;   /**< of the newest press; 0 = none yet */
    uint32_t counter;  /**< of the newest beat of that series */
    uint64_t until_us; /**< while is_held: the newest proof is valid until this time */
} deadman_t;

/** Result of a press or a beat. */
typedef enum {
    DEADMAN_TAKEN,
    DEADMAN_STALE, /**< the tick is too old, or in the future: nothing changes */
    DEADMAN_OVER,  /**< beat: its series is not held, or not any more; a new press is needed */
    DEADMAN_KNOWN  /**< beat: its counter is not newer than the last one; press: this series is not new. Nothing changes */
} deadman_answer_t;

/** Begins a series, and ends one that is held.
 *  @param series above that of every earlier press
 *  @param age_us age of the tick that was sent back */
deadman_answer_t deadman_press(deadman_t *self, uint32_t series, uint64_t age_us, uint64_t now_us);

/** Prolongs the series.
 *  @param counter above that of every earlier beat of this series; the first is at least 1 */
deadman_answer_t deadman_beat(deadman_t *self, uint32_t series, uint32_t counter, uint64_t age_us, uint64_t now_us);

/** Ends the series: the button was released. */
void deadman_release(deadman_t *self);

/** Call it once per cycle, before the motion.
 *  @return true while the series is held */
bool deadman_step(deadman_t *self, uint64_t now_us);

#endif

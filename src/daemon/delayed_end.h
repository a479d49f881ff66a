/* SPDX-License-Identifier: MIT
 * delayed_end.h - the end that somebody has asked for, and somebody delays by a hold. The platform settles first; somebody may be
 * below it. But whoever held may have gone, and the service manager would end heaved with the platform up: so it goes on by
 * itself.
 */
#ifndef HEAVE_DAEMON_DELAYED_END_H
#define HEAVE_DAEMON_DELAYED_END_H

#include <stdbool.h>
#include <stdint.h>

/** The longest delay of the end by one hold, and by all holds together. */
#define DELAYED_END_HOLD_US  10000000u
#define DELAYED_END_HOLDS_US 60000000u

/** Starts with all members zero: no end has been asked for. Members are private. */
typedef struct {
    bool is_asked;        /**< by a signal, or the request `shutdown`; the owner may set it */
    uint64_t step_us;     /**< time of the newest step */
    uint64_t held_us;     /**< how long the newest hold has delayed it, */
    uint64_t held_all_us; /**< and all of them */
} delayed_end_t;

/** Somebody holds.
 *  @return false: no hold delays the end any more; each one would only stop the platform once more on its way down */
bool delayed_end_hold(delayed_end_t *self);

/** Once in each cycle; those that a machine skips count by their time.
 *  @param is_due  a signal asks for the end in this cycle
 *  @param is_held the platform is on hold
 *  @param now_us  never decreasing
 *  @return true: the platform is to settle and end now */
bool delayed_end_step(delayed_end_t *self, bool is_due, bool is_held, uint64_t now_us);

/** Whether a hold delays the end. */
bool delayed_end_is_held(const delayed_end_t *self);

#endif

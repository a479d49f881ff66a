/* SPDX-License-Identifier: MIT
 * canpassive.h - how long a CAN controller has been error-passive: frames still pass, but the bus may be lost at any moment.
 * For drivers behind drives.h. Pure but for the controller's ops.
 */
#ifndef HEAVE_CANPASSIVE_H
#define HEAVE_CANPASSIVE_H

#include "heave/hal/can.h"

/** One bus; all zero at the start. Private but for is_failing. */
typedef struct {
    bool is_failing; /**< error-passive for longer than allowed; until the controller is not any more */
    bool is_passive;
    uint64_t since_us; /* passive, or last asked */
} canpassive_t;

/** Looks at the controller; once per cycle, after everything was received. Where the time is over the controller itself is asked
 *  (hal_can_ask_state()), because some never report that they have recovered; once in limit_ms as long as it lasts.
 *  @param now_us   never decreasing
 *  @param limit_ms 0 = any time is allowed */
void canpassive_step(canpassive_t *self, hal_can_t can, uint64_t now_us, uint32_t limit_ms);

#endif

/* SPDX-License-Identifier: MIT
 * canpassive.h - watches how long a CAN controller has been error-passive. Frames still pass in this state, but the bus may be
 * lost at any moment. For drivers behind drives.h. Pure except for the controller's ops.
 */
#ifndef HEAVE_CANPASSIVE_H
#define HEAVE_CANPASSIVE_H

#include "heave/hal/can.h"

/** One bus; all zero at the start. Members are private, except is_failing. */
typedef struct {
    bool is_failing; /**< error-passive for longer than allowed; cleared when the controller leaves that state */
    bool is_passive;
    uint64_t since_us; /* start of error-passive, or time of the last query */
} canpassive_t;

/** Checks the controller. Call once per cycle, after all frames were received. After limit_ms, queries the controller
 *  itself (hal_can_ask_state()), because some controllers never report that they have recovered. Repeats the query every
 * limit_ms.
 *  @param now_us   never decreasing
 *  @param limit_ms 0 = any time is allowed */
void canpassive_step(canpassive_t *self, hal_can_t can, uint64_t now_us, uint32_t limit_ms);

#endif

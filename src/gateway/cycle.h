/* SPDX-License-Identifier: MIT
 * cycle.h - what stages that lead drives get of a cycle. Private to src/gateway.
 */
#ifndef GATEWAY_CYCLE_H
#define GATEWAY_CYCLE_H

#include "heave/gateway.h"
#include "feedback.h"

/** Of this cycle. */
typedef struct {
    const settings_t *settings;
    drives_t drives;
    motion_t *motion;
    feedback_t feedback;
    unsigned cylinders; /**< one more drive is the rotation motor */
    uint64_t now_us;
} cycle_t;

#endif

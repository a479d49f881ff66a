/* SPDX-License-Identifier: MIT
 * cycle.h - what stages get of a cycle, or of a request between two. Private to src/gateway.
 */
#ifndef GATEWAY_CYCLE_H
#define GATEWAY_CYCLE_H

#include "heave/gateway.h"
#include "feedback.h"

/** Of this cycle. */
typedef struct {
    const settings_t *settings;
    drives_t drives;
    hal_log_t log;
    sender_t *sender;
    motion_t *motion;
    const motion_output_t *output; /**< of the last cycle, until motion has made its step */
    feedback_t feedback;
    unsigned cylinders; /**< one more drive is the rotation motor */
    uint64_t now_us;
} cycle_t;

#endif

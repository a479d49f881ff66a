/* SPDX-License-Identifier: MIT
 * flood.h - detects a flood of useless datagrams. A single wrong datagram deserves a line in the log. In a flood the lines say
 * nothing new, and the datagrams must not cost time. Pure: counts and time are arguments.
 */
#ifndef HEAVE_DAEMON_FLOOD_H
#define HEAVE_DAEMON_FLOOD_H

#include "heave/status.h"

#define FLOOD_WINDOW_US   20000u /**< shortest time over which the rate is measured */
#define FLOOD_BEGIN_PER_S 5000u  /**< more than the wrong frames of ten senders */
#define FLOOD_END_PER_S   1000u  /**< the flood ends when the rate has stayed below this for FLOOD_CALM_US */
#define FLOOD_CALM_US     5000000u

/** State; all zero: no flood. All members except is_on are private to flood.c. */
typedef struct {
    bool is_on;         /**< there is a flood */
    uint64_t window_us; /**< begin of the window; 0 = nothing seen yet */
    uint64_t busy_us;   /**< end of the last window that was not calm */
    uint32_t useless;   /**< count at the begin of the window */
} flood_t;

/** Updates is_on. Call it several times a second.
 *  @param useless number of useless datagrams and frames so far, with dropped ones; wraps
 *  @return true: is_on has changed */
bool flood_judge(flood_t *self, uint32_t useless, uint64_t now_us);

#endif

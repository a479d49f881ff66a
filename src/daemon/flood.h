/* SPDX-License-Identifier: MIT
 * flood.h - tells a flood of useless datagrams from the odd wrong one. The odd one is worth a line in the log; in a flood the
 * lines say nothing new, and what counts is that it costs nothing. Pure: counts and time are arguments.
 */
#ifndef HEAVE_DAEMON_FLOOD_H
#define HEAVE_DAEMON_FLOOD_H

#include "heave/status.h"

#define FLOOD_WINDOW_US   100000u /**< what is judged at once, at least */
#define FLOOD_BEGIN_PER_S 5000u   /**< ten senders' wrong frames are fewer */
#define FLOOD_END_PER_S   1000u   /**< fewer than that, for so long: it is over */
#define FLOOD_CALM_US     5000000u

/** Zeroed: calm. Members but is_on are private to flood.c. */
typedef struct {
    bool is_on;         /**< there is a flood */
    uint64_t window_us; /**< begin of the window; 0 = nothing seen yet */
    uint64_t busy_us;   /**< end of the last window that was not calm */
    uint32_t useless;   /**< as the window began */
} flood_t;

/** Judges. Call it several times a second.
 *  @param useless datagrams and frames so far that were of no use, dropped ones included; wraps
 *  @return true: is_on has changed */
bool flood_judge(flood_t *self, uint32_t useless, uint64_t now_us);

#endif

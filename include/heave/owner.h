/* SPDX-License-Identifier: MIT
 * owner.h - decides which sender's frames the platform follows: one sender at a time.
 * The protocol has no log-in, so senders are identified by their address. The port changes when a program restarts, and with some
 * programs in every frame, so a new port is the same sender; but ports of one address that take turns are several programs
 * (on one PC, or behind one router), and from then on the port counts too.
 * The first sender of a valid frame drives. Another sender takes over when the driving one has been silent for long enough, or at
 * once if it has a higher priority. Pure: time and settings are arguments; one caller at a time.
 */
#ifndef HEAVE_OWNER_H
#define HEAVE_OWNER_H

#include "heave/hal/udp.h"

/** Ports of one address that are remembered. */
#define OWNER_PORTS 4u

/** Who drives. Zeroed: nobody yet. Readable: is_taken to is_port_fixed. */
typedef struct {
    bool is_taken;
    hal_udp_peer_t peer; /**< the last port it used */
    uint64_t last_us;    /**< its last valid frame */
    bool is_port_fixed;  /**< programs of this address have taken turns: only peer.port drives */

    uint8_t ports; /**< private from here on: so many of them are valid */
    uint8_t turns; /**< in quick succession, to a port that was there before */
    uint16_t port[OWNER_PORTS];
    uint16_t first_port; /**< the first one that came back: it was there before the others */
    uint64_t turn_us;    /**< the last turn */
} owner_t;

/** Decision about a frame. */
typedef enum {
    OWNER_DRIVES, /**< from the driving sender, or the first one */
    OWNER_NEW,    /**< from a sender that takes over now: move to its pose at engage speed */
    OWNER_OTHER   /**< from another sender: count it, do not follow it */
} owner_verdict_t;

/** Decides about a valid frame and records who drives.
 *  @param silence_us silence after which another sender may take over; 0: every frame is followed
 *  @param priority   senders in order of priority: each takes over at once from later ones and from those not in the list
 *  @param busy_until_us end of the requested timed move: until then its sender does not count as silent */
owner_verdict_t owner_judge(owner_t *self, const hal_udp_peer_t *from, uint64_t silence_us, const hal_udp_networks_t *priority,
                            uint64_t busy_until_us, uint64_t now_us);

/** Whether a sender is the one that drives, by all that is known: not another address, and no port that is new. */
bool owner_is_known(const owner_t *self, const hal_udp_peer_t *from);

#endif

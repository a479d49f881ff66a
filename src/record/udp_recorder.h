/* SPDX-License-Identifier: MIT
 * udp_recorder.h - stands between a UDP socket and the gateway: lets through what allowed senders have sent just now, and writes
 * it down. A backend of hal/udp.h itself. The motion thread alone uses it; it never blocks longer than the socket behind it.
 */
#ifndef HEAVE_RECORD_UDP_RECORDER_H
#define HEAVE_RECORD_UDP_RECORDER_H

#include "common/ring.h"
#include "config/config.h"
#include "heave/hal/clock.h"
#include "heave/hal/udp.h"

/** A datagram that has waited longer, because heaved stood still, says what a sender wanted then. */
#define UDP_RECORDER_FRESH_US 1000000u

/** A tap; the caller owns it. */
typedef struct {
    hal_udp_t behind;
    const hal_udp_networks_t *allow;
    ring_t *record[2];      /**< NULL: nothing is written down there */
    const uint64_t *now_us; /**< of the running cycle */
    hal_clock_t clock;
    uint32_t cycle_us;
    uint64_t came_us;    /**< when the newest datagram came, by *now_us */
    uint32_t waited_us;  /**< by the newest datagram, below a cycle: a replay then has it in the same cycle */
    uint64_t arrival_us; /**< out: when the first datagram came since it was set to 0; by that clock; 0 = none did */
    uint64_t late_us;    /**< by which the running cycle is late */
    bool is_draining;    /**< after such a stop, until nothing waits: what does not say how long it has waited is old */
    uint32_t refused;    /**< out: datagrams of senders that are not allowed */
    uint32_t stale;      /**< out: datagrams that had waited longer than UDP_RECORDER_FRESH_US: nothing follows them */
} udp_recorder_t;

/** True where the address may send; an empty list lets everyone. */
bool udp_recorder_is_allowed(const hal_udp_networks_t *allow, const hal_udp_peer_t *peer);

/** The tap as hal/udp.h wants it. */
hal_udp_t udp_recorder_hal(udp_recorder_t *self);

#endif

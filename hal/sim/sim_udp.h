/* SPDX-License-Identifier: MIT
 * sim_udp.h - simulated UDP socket: a queue of datagrams that a test or an offline run fills.
 * As in a kernel, a full queue loses the newest. The caller owns sim_udp_t; one thread.
 */
#ifndef SIM_UDP_H
#define SIM_UDP_H

#include "heave/hal/udp.h"
#include "sim_fail.h"

#define SIM_UDP_DATAGRAMS 32u   /**< datagrams that wait at most */
#define SIM_UDP_BYTES_MAX 1472u /**< longest datagram */

/** One datagram that waits. */
typedef struct {
    size_t length;
    hal_udp_peer_t from;
    uint8_t data[SIM_UDP_BYTES_MAX];
} sim_udp_datagram_t;

/** A socket. */
typedef struct {
    sim_udp_datagram_t queue[SIM_UDP_DATAGRAMS];
    uint32_t first;
    uint32_t count;
    uint32_t dropped;
    sim_fail_t fail; /**< recv calls that return HV_ERR_IO */
} sim_udp_t;

/** Starts empty, without plan. */
void sim_udp_init(sim_udp_t *self);

/** A sender sends.
 *  @param from NULL: 127.0.0.1, port 9
 *  @return HV_OK; HV_ERR_FULL: lost and counted; HV_ERR_RANGE: above SIM_UDP_BYTES_MAX. */
hv_status_t sim_udp_push(sim_udp_t *self, const uint8_t *data, size_t length, const hal_udp_peer_t *from) HV_MUST_CHECK;

/** The socket as hal/udp.h wants it. */
hal_udp_t sim_udp_hal(sim_udp_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * linux_udp_filter.h - has the kernel drop datagrams before they reach the queue of a socket: a classic BPF program, which needs
 * no privilege. For floods: what is dropped is counted (hal_udp_dropped), but nobody can say any more what it was.
 */
#ifndef LINUX_UDP_FILTER_H
#define LINUX_UDP_FILTER_H

#include "linux_udp.h"

#define LINUX_UDP_FILTER_HEADS_MAX 32u

/** What a datagram has to be to come through. */
typedef struct {
    const uint8_t *heads;     /**< its first byte is one of them; an empty datagram never comes through */
    size_t head_count;        /**< [1, LINUX_UDP_FILTER_HEADS_MAX] */
    uint32_t bytes_max;       /**< it is no longer than that */
    hal_udp_networks_t allow; /**< it comes from one of them; none at all: from anyone */
} linux_udp_filter_t;

/** Puts the filter in front of the queue, in the place of one that is there. What waits in the queue stays. May allocate (in the
 *  kernel) and block for milliseconds: not for a thread that has to be in time. Beside recv of another thread.
 *  @return HV_OK; HV_ERR_ARG: head_count, a count of networks or a prefix is out of range; HV_ERR_IO: the kernel refuses, errno
 *          says why. Where it fails, the filter that was there stays. */
hv_status_t linux_udp_filter_on(const linux_udp_t *self, const linux_udp_filter_t *filter) HV_MUST_CHECK;

/** Takes it away; harmless where there is none. Otherwise as linux_udp_filter_on(). */
void linux_udp_filter_off(const linux_udp_t *self);

#endif

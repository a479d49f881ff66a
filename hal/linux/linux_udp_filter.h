/* SPDX-License-Identifier: MIT
 * linux_udp_filter.h - has the kernel drop datagrams before they reach the queue of a socket: a classic BPF program, which needs
 * no privilege. For floods: what is dropped is counted (hal_udp_dropped), but nobody can say any more what it was.
 */
#ifndef LINUX_UDP_FILTER_H
#define LINUX_UDP_FILTER_H

#include "linux_udp.h"

#define LINUX_UDP_FORMS_MAX  4u
#define LINUX_UDP_PLACES_MAX 4u
#define LINUX_UDP_SET_MAX    8u
#define LINUX_UDP_SET(text)                                                                                                      \
    {                                                                                                                            \
        (text), sizeof(text) - 1u                                                                                                \
    }

/** Bytes of which one stands at a place. */
typedef struct {
    const char *bytes;
    uint8_t count; /**< [1, LINUX_UDP_SET_MAX]; 0: whatever stands there, and behind it */
} linux_udp_set_t;

/** What a datagram may begin with, place by place; at least the first place is asked for. */
typedef struct {
    linux_udp_set_t place[LINUX_UDP_PLACES_MAX];
} linux_udp_form_t;

/** What a datagram has to be to come through. */
typedef struct {
    const linux_udp_form_t *forms; /**< it begins with one of them; an empty datagram never comes through */
    size_t form_count;             /**< [1, LINUX_UDP_FORMS_MAX] */
    uint32_t bytes_min;            /**< it is no shorter than that */
    uint32_t bytes_max;            /**< it is no longer than that */
    hal_udp_networks_t allow;      /**< it comes from one of them; none at all: from anyone */
    uint32_t
        others_one_of;    /**< [1, ...]: of datagrams that do not come from `first`, one in so many, at random; 0: all of them */
    hal_udp_peer_t first; /**< used where others_one_of > 0; always allowed */
    bool is_first_any_port; /**< its address counts, its port does not */
} linux_udp_filter_t;

/** Puts the filter in front of the queue, in the place of one that is there. What waits in the queue stays. May allocate (in the
 *  kernel) and block for milliseconds: not for a thread that has to be in time. Beside recv of another thread.
 *  @return HV_OK; HV_ERR_ARG: a count, a length or a prefix is out of range; HV_ERR_IO: the kernel refuses, errno
 *          says why. Where it fails, the filter that was there stays. */
hv_status_t linux_udp_filter_on(const linux_udp_t *self, const linux_udp_filter_t *filter) HV_MUST_CHECK;

/** Takes it away; harmless where there is none. Otherwise as linux_udp_filter_on(). */
void linux_udp_filter_off(const linux_udp_t *self);

#endif

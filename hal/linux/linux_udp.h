/* SPDX-License-Identifier: MIT
 * linux_udp.h - UDP socket of Linux, IPv4 or IPv6, receiving only.
 * The caller owns linux_udp_t. Open and close from any thread, the ops from one.
 */
#ifndef LINUX_UDP_H
#define LINUX_UDP_H

#include "heave/hal/udp.h"

/** What to open. */
typedef struct {
    const char *bind;   /**< numeric address: "0.0.0.0", "192.168.1.2", "fe80::1%eth0"; "::" hears IPv4 and IPv6 */
    const char *group;  /**< multicast address and interface, joined: "239.1.2.3%eth0", "ff15::1%eth0"; bind is then "0.0.0.0", or
                           "::"  for either; NULL or empty: none, and what other programs have joined is not heard */
    uint16_t port;      /**< 0 = any free one */
    int receive_buffer; /**< bytes asked of the kernel (it doubles them and has limits); 0 = the system's default.
                             Small is good: what waits there is old */
} linux_udp_config_t;

/** An open socket. */
typedef struct {
    int fd;             /**< -1 = closed */
    uint16_t port;      /**< bound to */
    int receive_buffer; /**< bytes granted by the kernel */
    uint32_t dropped;
    uint32_t waited_us;   /**< by the datagram received last */
    int error;            /**< errno of the last failure, 0 = none; getaddrinfo's negative code where the address is wrong */
    char error_text[256]; /**< of a failed open: what, where, why, what helps where that is known; empty otherwise */
} linux_udp_t;

/** Opens and binds. May block for milliseconds and allocate: before the loop starts.
 *  @return HV_OK; HV_ERR_ARG: bind or group is not a numeric address; HV_ERR_IO: the system refuses. error and error_text say
 * why. */
hv_status_t linux_udp_open(linux_udp_t *self, const linux_udp_config_t *config) HV_MUST_CHECK;

/** Closes; harmless on a closed one or one whose open failed. */
void linux_udp_close(linux_udp_t *self);

/** The socket as hal/udp.h wants it. */
hal_udp_t linux_udp_hal(linux_udp_t *self);

#endif

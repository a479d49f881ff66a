/* SPDX-License-Identifier: MIT
 * linux_can_link.h - what the system knows of a CAN interface, by rtnetlink: there or not, up, queue, bit rate, controller,
 * counters. Not for the motion thread: a look takes about 100 us and may wait for others who change interfaces. One connection
 * per thread.
 */
#ifndef LINUX_CAN_LINK_H
#define LINUX_CAN_LINK_H

#include "heave/hal/can.h"

/** Longest name of an interface, with its end. */
#define LINUX_CAN_NAME_SIZE 16u

/** One interface. Interfaces without a controller (vcan, slcan) say nothing below has_controller. */
typedef struct {
    int index;
    char kind[16];   /**< "can" (adapters), "vcan", "vxcan"; "" where the system does not say */
    char driver[32]; /**< of the adapter: "gs_usb", "peak_usb", "mcp251x"; "" where there is no device behind it */
    bool is_can;     /**< false: something else of that name, such as Ethernet */
    bool is_up;
    bool has_echo;         /**< its driver confirms frames when they are on the wire; else they are confirmed when queued */
    uint32_t queue_length; /**< frames that the interface's queue takes (txqueuelen); 0 where there is no queue */
    uint32_t waiting;      /**< frames in that queue now, of whatever program */
    uint64_t sent;         /**< frames that went out since the interface is there, of whatever program */
    bool has_controller;
    hal_can_state_t state;     /**< of the controller; of an interface without one HAL_CAN_ACTIVE, or HAL_CAN_DOWN */
    uint32_t bitrate;          /**< bit/s, 0 = not set */
    uint32_t sample_point;     /**< per mille of a bit */
    uint32_t restart_ms;       /**< 0 = after bus-off it waits for us, as it should: anything else sends old frames by itself */
    uint16_t tx_errors;        /**< the controller's own error counters; 0 where the driver has none */
    uint16_t rx_errors;        /**< */
    uint32_t bus_errors;       /**< how often since the interface came up */
    uint32_t warnings;         /**< */
    uint32_t passives;         /**< */
    uint32_t bus_offs;         /**< */
    uint32_t restarts;         /**< */
    uint32_t lost_arbitration; /**< */
} linux_can_link_t;

/** A connection to the system's side, private. */
struct mnl_socket;

/** Opens a connection for looks. Allocates.
 *  @return NULL: refused, errno says why. */
struct mnl_socket *linux_can_link_open(void) HV_MUST_CHECK;

/** Closes it; NULL is harmless. */
void linux_can_link_close(struct mnl_socket *netlink);

/** Asks the system. Allocates nothing.
 *  @param out  written whole where HV_OK
 *  @return HV_OK; HV_ERR_AGAIN: there is no such interface; HV_ERR_IO: the system does not answer (errno says why). */
hv_status_t linux_can_link_look(struct mnl_socket *netlink, const char *name, linux_can_link_t *out) HV_MUST_CHECK;

/** Takes the interface down and up again: the one way to drop frames that wait in it, and the way out of bus-off. Needs
 *  CAP_NET_ADMIN. An interface that was down ends up.
 *  @return HV_OK; HV_ERR_AGAIN: there is no such interface; HV_ERR_IO: not allowed (errno EPERM), or refused. */
hv_status_t linux_can_link_flush(const char *name) HV_MUST_CHECK;

#endif

/* SPDX-License-Identifier: MIT
 * linux_can_local.h - a CAN bus between programs of one machine, for kernels without SocketCAN: heave-twin is the bus, and
 * whoever opens it is a controller on it. No real drive is on such a bus. It is an abstract Unix socket (SOCK_SEQPACKET), so a
 * network name space has its own, as it has its own interfaces. The caller owns linux_can_local_t; nothing is allocated.
 */
#ifndef LINUX_CAN_LOCAL_H
#define LINUX_CAN_LOCAL_H

#include <linux/can.h>
#include <sys/un.h>

#include "heave/hal/can.h"

/** Names of such buses begin with this: twin0. */
#define LINUX_CAN_LOCAL_PREFIX "twin"

/** What goes through the socket. */
typedef struct {
    struct can_frame frame; /**< error frames too, as from SocketCAN */
    uint32_t is_echo;       /**< 1: a frame of this program, which has left */
} linux_can_local_packet_t;

/** Most frames on their way: as linux_can.h has it. */
#define LINUX_CAN_LOCAL_QUEUE_FRAMES 16u

/** A controller. Readable by the caller: error_text. */
typedef struct {
    char error_text[160]; /**< what is wrong and what helps; "" = nothing */
    int fd;               /**< private from here on; -1 = closed */
    char name[16];
    uint32_t unconfirmed;
    hal_can_state_t state;
} linux_can_local_t;

/** Whether an interface of that name is such a bus. */
bool linux_can_local_is(const char *name);

/** The address of a bus; returns its length. */
unsigned linux_can_local_address(const char *name, struct sockaddr_un *out);

/** Opens it.
 *  @return HV_OK; HV_ERR_AGAIN: nobody is the bus yet, the ops may be used and restart tries again; HV_ERR_IO: no socket */
hv_status_t linux_can_local_open(linux_can_local_t *self, const char *name) HV_MUST_CHECK;

/** Closes; harmless on a closed one. */
void linux_can_local_close(linux_can_local_t *self);

/** As hal/can.h wants it. */
hal_can_t linux_can_local_hal(linux_can_local_t *self);

#endif

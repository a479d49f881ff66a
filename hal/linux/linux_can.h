/* SPDX-License-Identifier: MIT
 * linux_can.h - SocketCAN: one CAN interface of Linux, such as can0.
 * Written so that an old set-point can never reach a drive late. Frames that wait in the system's queue survive the program that
 * sent them, and go out when the bus comes back; so send takes no more than queue_frames that are not on the wire yet, nothing at
 * all after bus-off, down or unplugging until restart, and restart and close drop what waits, by taking the interface down and up
 * where we may (CAP_NET_ADMIN). Where we may not, restart refuses until nothing waits any more: the gate of unconfirmed() has
 * kept that to one set. The caller owns linux_can_t; nothing is allocated after open.
 */
#ifndef LINUX_CAN_H
#define LINUX_CAN_H

#include "heave/hal/can.h"
#include "linux_can_frame.h"
#include "linux_can_link.h"

/** Longest lists of filters. */
#define LINUX_CAN_FILTERS_MAX 104u

/** Frames in flight that queue_frames 0 stands for: what a platform of seven drives sends at once. SYNC, seven set-points, the
 *  heartbeat and a service request to each drive. The kernel's smallest send buffer would hold seven. */
#define LINUX_CAN_QUEUE_FRAMES 16u

/** Longest path of the file that asks for a flush, with its end. */
#define LINUX_CAN_PATH_SIZE 128u

/** What to open. The lists are copied. */
typedef struct {
    const char *interface;          /**< "can0" */
    const hal_can_filter_t *filter; /**< what is received, see hal/can.h */
    uint32_t filters;
    const hal_can_filter_t *own; /**< what will be sent; anything else is refused. With both lists the kernel sorts out what
                                      passes neither; owns 0: anything may be sent, and we sort out what we receive */
    uint32_t owns;
    uint32_t queue_frames; /**< most frames sent and not on the wire yet; 0 = LINUX_CAN_QUEUE_FRAMES */
    const char *run_dir; /**< where a restart that may not flush the interface asks for it: by an empty file flush-INTERFACE, see
                              packaging/heave-can; NULL = nowhere */
} linux_can_config_t;

/** What is wrong, as far as it can be told apart; until a restart, or until the call that failed works again. */
typedef enum {
    LINUX_CAN_FINE,
    LINUX_CAN_NO_SUPPORT,   /**< the kernel has no SocketCAN */
    LINUX_CAN_NO_INTERFACE, /**< nothing of that name: unplugged, or its driver is missing */
    LINUX_CAN_NOT_CAN,      /**< the name is of something else */
    LINUX_CAN_IS_DOWN,
    LINUX_CAN_IS_BUS_OFF,
    LINUX_CAN_FRAMES_WAIT, /**< old frames wait in the interface and we may not drop them, or do not know yet whether they are */
    LINUX_CAN_NOT_ALLOWED,
    LINUX_CAN_SYSTEM_ERROR /**< error says which */
} linux_can_trouble_t;

/** An open interface. Readable by the caller: trouble to error_text, and the counters. */
typedef struct {
    linux_can_trouble_t trouble;
    int error;            /**< errno of the last failure, 0 = none */
    char error_text[160]; /**< what is wrong and what helps, "" while trouble is LINUX_CAN_FINE */
    uint8_t tx_errors;    /**< the controller's error counters as last reported */
    uint8_t rx_errors;
    uint32_t lost;    /**< received frames that the kernel had no room for, since open or restart */
    uint32_t refused; /**< frames that the interface's queue did not take (ENOBUFS), since open */
    uint32_t reports; /**< reports of the controller, since open */

    int fd; /**< private from here on */
    struct mnl_socket *netlink;
    char name[LINUX_CAN_NAME_SIZE];
    char request[LINUX_CAN_PATH_SIZE];
    hal_can_filter_t filter[LINUX_CAN_FILTERS_MAX];
    hal_can_filter_t own[LINUX_CAN_FILTERS_MAX];
    uint32_t filters;
    uint32_t owns;
    uint32_t queue_frames;
    uint32_t unconfirmed;
    linux_can_batch_t batch;
    uint64_t last_rx_us;
    uint64_t wall_us, now_us; /**< both clocks at one moment, where has_clocks */
    hal_can_state_t state;
    const char *failing; /**< the call that trouble is about, where it may pass by itself; NULL = none */
    bool is_cut;         /**< nothing passes until restart */
    bool has_echo;       /**< the driver confirms what is on the wire */
    bool is_overrun;
    bool has_clocks; /**< until nothing waits any more */
    bool has_kept;   /**< kept waits behind the report of a gap */
    can_frame_t kept;
    bool has_looked;      /**< frames of others waited, at looked_us, when the interface had sent looked_sent */
    uint64_t looked_us;   /**< */
    uint64_t looked_sent; /**< */
    uint32_t looked_waiting;
    uint64_t moved_us;   /**< when it was seen last that frames have gone out, by moved_sent */
    uint64_t moved_sent; /**< */
} linux_can_t;

/** Opens the interface. Before the loop starts: allocates, may take milliseconds. Where frames wait in its queue it is opened all
 * the same, cut off until a restart 0.2 s later or more: frames that have stood still by then were left by an earlier program and
 * are dropped (where that is not allowed, cut off until nothing waits); where further ones have been added, a program uses the
 * interface, and nothing is done to them.
 *  @return HV_OK; HV_ERR_AGAIN: not usable yet (no such interface, down, bus-off, old frames wait), the ops may be used and
 *          restart tries again; HV_ERR_ARG: not a CAN interface, a name or a list too long; HV_ERR_IO: the system refuses.
 * trouble and error_text say why. */
hv_status_t linux_can_open(linux_can_t *self, const linux_can_config_t *config) HV_MUST_CHECK;

/** Closes; drops the frames that wait, where the system lets us. Harmless on a closed one or one whose open failed. */
void linux_can_close(linux_can_t *self);

/** The interface as hal/can.h wants it. Every op is there. */
hal_can_t linux_can_hal(linux_can_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * linux_can_frame.h - frames between the kernel's form and ours, and what the reports of a controller mean. Keeps no state.
 */
#ifndef LINUX_CAN_FRAME_H
#define LINUX_CAN_FRAME_H

#include <linux/can.h>
#include <time.h>

#include "heave/hal/can.h"

/** A frame as the kernel gives it. */
typedef struct {
    struct can_frame frame;
    struct timespec stamp; /**< wall clock */
    uint32_t lost;         /**< frames lost since the socket was opened, up to this one */
    bool is_own;           /**< the echo of a frame of this socket */
} linux_can_received_t;

/** Takes the next frame of a socket; never blocks. False where there is none: errno says why. */
bool linux_can_frame_receive(int fd, linux_can_received_t *out);

/** To the kernel's form. */
struct can_frame linux_can_frame_to_kernel(const can_frame_t *frame);

/** From the kernel's form; not for error frames. */
can_frame_t linux_can_frame_from_kernel(const struct can_frame *frame);

/** What an error frame says.
 *  @param state in: the controller's state, out: where the frame tells of another; bus-off is left by a restart only
 *  @return CAN_ERROR_*, one at least. */
uint32_t linux_can_frame_report(const struct can_frame *frame, hal_can_state_t *state);

#endif

/* SPDX-License-Identifier: MIT
 * linux_can_frame.h - frames between the kernel's form and ours, and what the reports of a controller mean.
 */
#ifndef LINUX_CAN_FRAME_H
#define LINUX_CAN_FRAME_H

#include <linux/can.h>
#include <time.h>

#include "heave/hal/can.h"

#define LINUX_CAN_BATCH 16u /* a cycle of seven drives: the echo of each set-point, and each answer */

/** A frame as the kernel gives it. */
typedef struct {
    struct can_frame frame;
    struct timespec stamp; /**< wall clock */
    uint32_t lost;         /**< frames lost since the socket was opened, up to this one */
    bool is_own;           /**< the echo of a frame of this socket */
} linux_can_received_t;

/** Frames that were taken from a socket together. Zeroed: none. Members are private to linux_can_frame.c. */
typedef struct {
    linux_can_received_t frame[LINUX_CAN_BATCH];
    uint32_t first, count;
} linux_can_batch_t;

/** Takes the next frame of a socket; never blocks. One system call takes up to LINUX_CAN_BATCH of them, for the next calls.
 *  @return false where there is none: errno says why */
bool linux_can_frame_receive(linux_can_batch_t *self, int fd, linux_can_received_t *out);

/** To the kernel's form. */
struct can_frame linux_can_frame_to_kernel(const can_frame_t *frame);

/** From the kernel's form; not for error frames. */
can_frame_t linux_can_frame_from_kernel(const struct can_frame *frame);

/** What an error frame says.
 *  @param state in: the controller's state, out: where the frame tells of another; bus-off is left by a restart only
 *  @return CAN_ERROR_*, one at least. */
uint32_t linux_can_frame_report(const struct can_frame *frame, hal_can_state_t *state);

#endif

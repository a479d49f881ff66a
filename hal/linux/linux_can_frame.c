/* SPDX-License-Identifier: MIT
 * linux_can_frame.c - frames of SocketCAN; see linux_can_frame.h.
 */
#include "linux_can_frame.h"

#include <linux/can/error.h>
#include <string.h>
#include <sys/socket.h>

#define OWN_ECHO ((int)MSG_CONFIRM) /* how the kernel marks the echo of a frame of ours */

/** Room for the kernel's time stamp and its count of lost frames, aligned as the kernel's macros want it. */
typedef union {
    size_t alignment;
    uint8_t bytes[CMSG_SPACE(sizeof(struct timespec)) + CMSG_SPACE(sizeof(uint32_t))];
} control_t;

static void keep_ancillary(linux_can_received_t *self, struct msghdr *message)
{
    for (struct cmsghdr *item = CMSG_FIRSTHDR(message); item != NULL; item = CMSG_NXTHDR(message, item)) {
        if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SO_RXQ_OVFL) {
            memcpy(&self->lost, CMSG_DATA(item), sizeof self->lost);
        } else if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SCM_TIMESTAMPNS) {
            memcpy(&self->stamp, CMSG_DATA(item), sizeof self->stamp);
        }
    }
}

/* How many there were. */
static uint32_t receive_all(linux_can_received_t *frame, int fd)
{
    control_t control[LINUX_CAN_BATCH];
    struct iovec part[LINUX_CAN_BATCH];
    struct mmsghdr message[LINUX_CAN_BATCH];
    memset(frame, 0, LINUX_CAN_BATCH * sizeof *frame);
    memset(message, 0, sizeof message);
    for (uint32_t i = 0; i < LINUX_CAN_BATCH; i++) {
        part[i] = (struct iovec){&frame[i].frame, sizeof frame[i].frame};
        message[i].msg_hdr = (struct msghdr){
            .msg_iov = &part[i], .msg_iovlen = 1, .msg_control = &control[i], .msg_controllen = sizeof control[i]};
    }
    const int count = recvmmsg(fd, message, LINUX_CAN_BATCH, MSG_DONTWAIT, NULL);
    for (int i = 0; i < count; i++) {
        frame[i].is_own = (message[i].msg_hdr.msg_flags & OWN_ECHO) != 0;
        keep_ancillary(&frame[i], &message[i].msg_hdr);
    }
    return count > 0 ? (uint32_t)count : 0;
}

bool linux_can_frame_receive(linux_can_batch_t *self, int fd, linux_can_received_t *out)
{
    if (self->first == self->count) {
        self->first = 0;
        self->count = receive_all(self->frame, fd);
    }
    if (self->first == self->count) {
        return false;
    }
    *out = self->frame[self->first++];
    return true;
}

struct can_frame linux_can_frame_to_kernel(const can_frame_t *frame)
{
    struct can_frame out = {.can_id = frame->id, .can_dlc = frame->length};
    if (frame->is_extended) {
        out.can_id |= CAN_EFF_FLAG;
    }
    if (frame->is_rtr) {
        out.can_id |= CAN_RTR_FLAG;
    } else {
        memcpy(out.data, frame->data, frame->length);
    }
    return out;
}

can_frame_t linux_can_frame_from_kernel(const struct can_frame *frame)
{
    can_frame_t out = {.is_extended = (frame->can_id & CAN_EFF_FLAG) != 0, .is_rtr = (frame->can_id & CAN_RTR_FLAG) != 0};
    out.id = frame->can_id & (out.is_extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    out.length = frame->can_dlc <= CAN_MAX_DLEN ? frame->can_dlc : CAN_MAX_DLEN;
    if (!out.is_rtr) {
        memcpy(out.data, frame->data, out.length);
    }
    return out;
}

/* Byte 1 of a report: what the controller says of itself. */
static uint32_t controller_report(uint8_t what, hal_can_state_t *state)
{
    static const struct {
        uint8_t bits;
        bool is_state;
        hal_can_state_t state;
        uint32_t report;
    } k_rows[] = {{CAN_ERR_CRTL_RX_OVERFLOW, false, HAL_CAN_ACTIVE, CAN_ERROR_OVERRUN},
                  {CAN_ERR_CRTL_ACTIVE, true, HAL_CAN_ACTIVE, CAN_ERROR_OTHER},
                  {CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING, true, HAL_CAN_WARNING, CAN_ERROR_WARNING},
                  {CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE, true, HAL_CAN_PASSIVE, CAN_ERROR_PASSIVE}};
    uint32_t report = 0;
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if ((what & k_rows[i].bits) == 0) {
            continue;
        }
        report |= k_rows[i].report;
        if (k_rows[i].is_state && *state != HAL_CAN_BUS_OFF) {
            *state = k_rows[i].state;
        }
    }
    return report;
}

uint32_t linux_can_frame_report(const struct can_frame *frame, hal_can_state_t *state)
{
    uint32_t report = 0;
    if ((frame->can_id & CAN_ERR_CRTL) != 0) {
        report |= controller_report(frame->data[1], state);
    }
    if ((frame->can_id & CAN_ERR_ACK) != 0) {
        report |= CAN_ERROR_NO_ACK;
    }
    if ((frame->can_id & CAN_ERR_BUSOFF) != 0) {
        report |= CAN_ERROR_BUS_OFF;
        *state = HAL_CAN_BUS_OFF;
    }
    if ((frame->can_id & CAN_ERR_RESTARTED) != 0) {
        report |= CAN_ERROR_RESTARTED;
        *state = HAL_CAN_ACTIVE;
    }
    return report != 0 ? report : CAN_ERROR_OTHER;
}

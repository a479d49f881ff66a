/* SPDX-License-Identifier: MIT
 * linux_can.c - SocketCAN; see linux_can.h.
 */
#include "linux_can.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define OWN_ECHO      ((int)MSG_CONFIRM) /* how the kernel marks the echo of a frame of ours */
#define FRAME_MEMORY  768                /* what a waiting frame counts against SO_SNDBUF on 64-bit kernels */
#define CLOCK_STEP_US 1000000u           /* a frame that seems to have waited longer came around a change of the wall clock */

/** Room for the kernel's time stamp and its count of lost frames, aligned as the kernel's macros want it. */
typedef union {
    struct cmsghdr header;
    uint8_t bytes[CMSG_SPACE(sizeof(struct timespec)) + CMSG_SPACE(sizeof(uint32_t))];
} control_t;

/** A frame as the kernel gives it. */
typedef struct {
    struct can_frame frame;
    struct timespec stamp; /**< wall clock */
    uint32_t lost;
    bool is_own;
} received_t;

/* --- What is wrong --- */

static hv_status_t report_trouble(linux_can_t *self, linux_can_trouble_t trouble, int error, const char *what)
{
    self->trouble = trouble;
    self->error = error;
    (void)snprintf(self->error_text, sizeof self->error_text, "can: %s: %s%s%s", self->name, what, error != 0 ? ": " : "",
                   error != 0 ? strerror(error) : "");
    return HV_ERR_IO;
}

/* Nothing passes any more until a restart. */
static void cut_off(linux_can_t *self, hal_can_state_t state)
{
    self->state = state;
    self->is_cut = true;
    self->has_kept = false;
}

static hv_status_t say_gone(linux_can_t *self)
{
    cut_off(self, HAL_CAN_GONE);
    (void)report_trouble(self, LINUX_CAN_NO_INTERFACE, 0,
                         "there is no such interface: is the adapter plugged in? (ip -br link show type can)");
    return HV_ERR_AGAIN;
}

static hv_status_t say_down(linux_can_t *self)
{
    cut_off(self, HAL_CAN_DOWN);
    return report_trouble(self, LINUX_CAN_IS_DOWN, 0, "the interface is down (as root: ip link set it up, with its bitrate)");
}

static hv_status_t say_bus_off(linux_can_t *self)
{
    cut_off(self, HAL_CAN_BUS_OFF);
    return report_trouble(self, LINUX_CAN_IS_BUS_OFF, 0,
                          "bus-off: the controller gave up; check wiring, termination and bit rate");
}

/* A failed call: the interface's own reasons, or the system's. */
static hv_status_t note_failure(linux_can_t *self, int error, const char *what)
{
    switch (error) {
    case ENETDOWN:
        return say_down(self);
    case ENODEV:
    case ENXIO:
        (void)say_gone(self);
        return HV_ERR_IO;
    case EPERM:
    case EACCES:
        return report_trouble(self, LINUX_CAN_NOT_ALLOWED, error, what);
    default:
        return report_trouble(self, LINUX_CAN_SYSTEM_ERROR, error, what);
    }
}

/* --- Sending --- */

static bool matches(const hal_can_filter_t *filter, uint32_t filters, uint32_t id, bool is_extended)
{
    for (uint32_t i = 0; i < filters; i++) {
        if (filter[i].is_extended == is_extended && ((id ^ filter[i].id) & filter[i].mask) == 0) {
            return true;
        }
    }
    return filters == 0;
}

static bool is_sendable(const linux_can_t *self, const can_frame_t *frame)
{
    return !frame->is_error && frame->length <= CAN_MAX_DLEN &&
           frame->id <= (frame->is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX) &&
           matches(self->own, self->owns, frame->id, frame->is_extended);
}

static struct can_frame to_kernel(const can_frame_t *frame)
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

static hv_status_t can_send_op(void *ctx, const can_frame_t *frame)
{
    linux_can_t *self = ctx;
    if (!is_sendable(self, frame)) {
        return HV_ERR_ARG;
    }
    if (self->is_cut) {
        return HV_ERR_IO;
    }
    if (self->unconfirmed >= self->queue_frames) {
        return HV_ERR_AGAIN;
    }
    const struct can_frame out = to_kernel(frame);
    if (send(self->fd, &out, sizeof out, MSG_DONTWAIT) == (ssize_t)sizeof out) {
        self->unconfirmed++;
        return HV_OK;
    }
    if (errno == ENOBUFS) {
        self->refused++;
        return HV_ERR_AGAIN;
    }
    if (errno == EAGAIN || errno == EWOULDBLOCK) {
        return HV_ERR_AGAIN;
    }
    return note_failure(self, errno, "sending");
}

/* --- Receiving --- */

static void keep_ancillary(received_t *self, struct msghdr *message)
{
    for (struct cmsghdr *item = CMSG_FIRSTHDR(message); item != NULL; item = CMSG_NXTHDR(message, item)) {
        if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SO_RXQ_OVFL) {
            memcpy(&self->lost, CMSG_DATA(item), sizeof self->lost);
        } else if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SCM_TIMESTAMPNS) {
            memcpy(&self->stamp, CMSG_DATA(item), sizeof self->stamp);
        }
    }
}

/* False where there is none: errno says why. */
static bool receive(int fd, received_t *out)
{
    control_t control;
    struct iovec part = {&out->frame, sizeof out->frame};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = &control, .msg_controllen = sizeof control};
    memset(out, 0, sizeof *out);
    const ssize_t length = recvmsg(fd, &message, MSG_DONTWAIT);
    if (length < 0) {
        return false;
    }
    out->is_own = (message.msg_flags & OWN_ECHO) != 0;
    keep_ancillary(out, &message);
    return true;
}

static uint64_t us_of(const struct timespec *time)
{
    return (uint64_t)time->tv_sec * 1000000u + (uint64_t)time->tv_nsec / 1000u;
}

/* The kernel stamps by the wall clock, we count by the other one: what both have in common is how long ago it was. */
static uint64_t when_received_us(linux_can_t *self, const received_t *received)
{
    struct timespec wall, now;
    (void)clock_gettime(CLOCK_REALTIME, &wall);
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    const uint64_t ago_us = us_of(&wall) - us_of(&received->stamp); /* huge where the stamp is of the future */
    const uint64_t when_us = us_of(&now) - (ago_us < CLOCK_STEP_US ? ago_us : 0);
    self->last_rx_us = when_us > self->last_rx_us ? when_us : self->last_rx_us;
    return self->last_rx_us;
}

static can_frame_t from_kernel(const struct can_frame *frame)
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
static uint32_t controller_report(linux_can_t *self, uint8_t what)
{
    static const struct {
        uint8_t bits;
        uint8_t state;
        uint32_t report;
    } k_rows[] = {{CAN_ERR_CRTL_RX_OVERFLOW, UINT8_MAX, CAN_ERROR_OVERRUN},
                  {CAN_ERR_CRTL_ACTIVE, HAL_CAN_ACTIVE, CAN_ERROR_OTHER},
                  {CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING, HAL_CAN_WARNING, CAN_ERROR_WARNING},
                  {CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE, HAL_CAN_PASSIVE, CAN_ERROR_PASSIVE}};
    uint32_t report = 0;
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if ((what & k_rows[i].bits) == 0) {
            continue;
        }
        report |= k_rows[i].report;
        if (k_rows[i].state != UINT8_MAX && self->state != HAL_CAN_BUS_OFF) {
            self->state = (hal_can_state_t)k_rows[i].state;
        }
    }
    return report;
}

static can_frame_t take_report(linux_can_t *self, const struct can_frame *frame)
{
    can_frame_t out = {.is_error = true};
    self->reports++;
    if ((frame->can_id & CAN_ERR_CRTL) != 0) {
        out.id |= controller_report(self, frame->data[1]);
    }
    if ((frame->can_id & CAN_ERR_ACK) != 0) {
        out.id |= CAN_ERROR_NO_ACK;
    }
    if ((frame->can_id & CAN_ERR_BUSOFF) != 0) {
        out.id |= CAN_ERROR_BUS_OFF;
        (void)say_bus_off(self);
    }
    if ((frame->can_id & CAN_ERR_RESTARTED) != 0) {
        out.id |= CAN_ERROR_RESTARTED;
        cut_off(self, HAL_CAN_ACTIVE);
    }
    self->tx_errors = frame->data[6];
    self->rx_errors = frame->data[7];
    out.id |= out.id == 0 ? CAN_ERROR_OTHER : 0;
    return out;
}

/* Frames were lost before this one. Among them may have been echoes; then unconfirmed stays above 0, which is the safe side. */
static void note_lost(linux_can_t *self, uint32_t lost)
{
    self->is_overrun |= lost != self->lost;
    self->lost = lost;
}

/* False where the frame is not for the caller. */
static bool take_in(linux_can_t *self, const received_t *received, can_frame_t *out)
{
    if ((received->frame.can_id & CAN_ERR_FLAG) != 0) {
        *out = take_report(self, &received->frame);
        return true;
    }
    if (received->is_own) {
        self->unconfirmed -= self->unconfirmed > 0 ? 1 : 0;
        return false;
    }
    const can_frame_t frame = from_kernel(&received->frame);
    if (self->is_cut || !matches(self->filter, self->filters, frame.id, frame.is_extended)) {
        return false;
    }
    *out = frame;
    return true;
}

static bool is_off(const linux_can_t *self)
{
    return self->state == HAL_CAN_DOWN || self->state == HAL_CAN_GONE;
}

/* Up to the next frame for the caller, or to a gap. */
static hv_status_t receive_next(linux_can_t *self, received_t *received, can_frame_t *out, bool *is_taken)
{
    do {
        if (is_off(self)) {
            return HV_ERR_IO;
        }
        if (!receive(self->fd, received)) {
            return errno == EAGAIN || errno == EWOULDBLOCK ? HV_ERR_AGAIN : note_failure(self, errno, "receiving");
        }
        note_lost(self, received->lost);
        *is_taken = take_in(self, received, out);
    } while (!*is_taken && !self->is_overrun);
    return HV_OK;
}

static hv_status_t can_recv_op(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    linux_can_t *self = ctx;
    received_t received;
    can_frame_t frame = {.id = 0};
    if (self->has_kept) {
        self->has_kept = false;
        *out = self->kept;
        *rx_time_us = self->last_rx_us;
        return HV_OK;
    }
    bool is_taken = false;
    const hv_status_t status = receive_next(self, &received, &frame, &is_taken);
    if (status != HV_OK) {
        return status;
    }
    *rx_time_us = when_received_us(self, &received);
    if (self->is_overrun) { /* the gap was before this frame */
        self->is_overrun = false;
        self->has_kept = is_taken;
        self->kept = frame;
        frame = (can_frame_t){.id = CAN_ERROR_OVERRUN, .is_error = true};
    }
    *out = frame;
    return HV_OK;
}

static hv_status_t can_bus_state_op(void *ctx, hal_can_state_t *out)
{
    const linux_can_t *self = ctx;
    *out = self->state;
    return HV_OK;
}

static hv_status_t can_unconfirmed_op(void *ctx, uint32_t *frames)
{
    const linux_can_t *self = ctx;
    *frames = self->unconfirmed;
    return HV_OK;
}

/* --- Opening --- */

static bool set_option(int fd, int level, int option, int value)
{
    return setsockopt(fd, level, option, &value, sizeof value) == 0;
}

static void add_filters(struct can_filter *list, uint32_t *count, const hal_can_filter_t *filter, uint32_t filters)
{
    for (uint32_t i = 0; i < filters; i++) {
        list[*count].can_id = filter[i].id | (filter[i].is_extended ? CAN_EFF_FLAG : 0u);
        list[*count].can_mask = filter[i].mask | CAN_EFF_FLAG;
        (*count)++;
    }
}

/* The echo of what we send passes the same filters as what others send, so both lists make one. */
static bool set_filters(const linux_can_t *self)
{
    struct can_filter list[2 * LINUX_CAN_FILTERS_MAX];
    uint32_t count = 0;
    if (self->filters == 0 || self->owns == 0) {
        return true;
    }
    add_filters(list, &count, self->filter, self->filters);
    add_filters(list, &count, self->own, self->owns);
    return setsockopt(self->fd, SOL_CAN_RAW, CAN_RAW_FILTER, list, (socklen_t)(count * sizeof list[0])) == 0;
}

static bool set_options(const linux_can_t *self)
{
    const int send_buffer = (int)self->queue_frames * FRAME_MEMORY / 2; /* the kernel doubles it */
    return set_option(self->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, (int)CAN_ERR_MASK) &&
           set_option(self->fd, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1) &&
           set_option(self->fd, SOL_SOCKET, SO_SNDBUF, send_buffer) && set_option(self->fd, SOL_SOCKET, SO_RXQ_OVFL, 1) &&
           set_option(self->fd, SOL_SOCKET, SO_TIMESTAMPNS, 1) && set_filters(self);
}

static void close_socket(linux_can_t *self)
{
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

/* Forgets everything of before: a new socket, bound to what has the name now. */
static hv_status_t open_socket(linux_can_t *self, int index)
{
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = index};
    close_socket(self);
    self->unconfirmed = 0;
    self->lost = 0;
    self->is_overrun = false;
    self->has_kept = false;
    self->fd = socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (self->fd < 0 && (errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT)) {
        return report_trouble(self, LINUX_CAN_NO_SUPPORT, errno, "this kernel has no SocketCAN (modules can and can_raw)");
    }
    if (self->fd < 0 || !set_options(self) || bind(self->fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        const hv_status_t status = note_failure(self, errno, "opening");
        close_socket(self);
        return status;
    }
    return HV_OK;
}

/* Fresh or not at all: what waits in the interface is dropped, be it ours or of a program before us. */
static hv_status_t clear(linux_can_t *self, linux_can_link_t *link, bool is_suspect)
{
    const bool must = link->waiting > 0 || link->state == HAL_CAN_BUS_OFF || !link->is_up;
    if (!must && !is_suspect) {
        return HV_OK;
    }
    if (linux_can_link_flush(self->name) == HV_OK) {
        link->is_up = true;
        return HV_OK;
    }
    if (!link->is_up) {
        return say_down(self);
    }
    if (link->state == HAL_CAN_BUS_OFF) {
        return say_bus_off(self);
    }
    if (link->waiting > 0) {
        return report_trouble(self, LINUX_CAN_FRAMES_WAIT, 0,
                              "old frames wait in it; dropping them takes CAP_NET_ADMIN (as root: ip link set it down, then up)");
    }
    return HV_OK;
}

static hv_status_t look(linux_can_t *self, linux_can_link_t *link)
{
    const hv_status_t status = linux_can_link_look(self->netlink, self->name, link);
    if (status == HV_ERR_AGAIN) {
        return say_gone(self);
    }
    if (status != HV_OK) {
        return report_trouble(self, LINUX_CAN_SYSTEM_ERROR, errno, "asking for its state");
    }
    if (!link->is_can) {
        (void)report_trouble(self, LINUX_CAN_NOT_CAN, 0, "this is not a CAN interface (ip -br link show type can)");
        return HV_ERR_ARG;
    }
    return HV_OK;
}

static hv_status_t start(linux_can_t *self)
{
    linux_can_link_t link;
    hv_status_t status = look(self, &link);
    if (status == HV_OK) {
        status = clear(self, &link, self->unconfirmed > 0);
    }
    if (status == HV_OK) {
        status = open_socket(self, link.index);
    }
    if (status == HV_OK) {
        self->state = link.state == HAL_CAN_WARNING || link.state == HAL_CAN_PASSIVE ? link.state : HAL_CAN_ACTIVE;
        self->is_cut = false;
        self->trouble = LINUX_CAN_FINE;
        self->error_text[0] = '\0';
    }
    return status;
}

static hv_status_t can_restart_op(void *ctx)
{
    linux_can_t *self = ctx;
    const hv_status_t status = start(self);
    return status == HV_ERR_ARG ? HV_ERR_IO : status;
}

static hv_status_t keep_config(linux_can_t *self, const linux_can_config_t *config)
{
    if (strlen(config->interface) >= sizeof self->name || config->filters > LINUX_CAN_FILTERS_MAX ||
        config->owns > LINUX_CAN_FILTERS_MAX) {
        (void)snprintf(self->error_text, sizeof self->error_text, "can: %.32s: the name or a list of filters is too long",
                       config->interface);
        self->trouble = LINUX_CAN_NO_INTERFACE;
        return HV_ERR_ARG;
    }
    memcpy(self->name, config->interface, strlen(config->interface) + 1);
    for (uint32_t i = 0; i < config->filters; i++) {
        self->filter[i] = config->filter[i];
    }
    for (uint32_t i = 0; i < config->owns; i++) {
        self->own[i] = config->own[i];
    }
    self->filters = config->filters;
    self->owns = config->owns;
    self->queue_frames = config->queue_frames > 0 ? config->queue_frames : LINUX_CAN_QUEUE_FRAMES;
    return HV_OK;
}

/* Whether the ops can be used although the start failed: what is wrong may pass. */
static bool may_pass(linux_can_trouble_t trouble)
{
    return trouble == LINUX_CAN_NO_INTERFACE || trouble == LINUX_CAN_IS_DOWN || trouble == LINUX_CAN_IS_BUS_OFF ||
           trouble == LINUX_CAN_FRAMES_WAIT;
}

hv_status_t linux_can_open(linux_can_t *self, const linux_can_config_t *config)
{
    *self = (linux_can_t){.fd = -1, .state = HAL_CAN_DOWN, .is_cut = true};
    hv_status_t status = keep_config(self, config);
    if (status != HV_OK) {
        return status;
    }
    self->netlink = linux_can_link_open();
    status = self->netlink == NULL ? report_trouble(self, LINUX_CAN_SYSTEM_ERROR, errno, "asking for its state") : start(self);
    if (status == HV_OK || may_pass(self->trouble)) {
        return status == HV_OK ? HV_OK : HV_ERR_AGAIN;
    }
    linux_can_close(self);
    return status;
}

void linux_can_close(linux_can_t *self)
{
    if (self->fd >= 0 && self->unconfirmed > 0) {
        (void)!linux_can_link_flush(self->name); /* where it is not allowed: at most queue_frames stay */
    }
    close_socket(self);
    linux_can_link_close(self->netlink);
    self->netlink = NULL;
}

hal_can_t linux_can_hal(linux_can_t *self)
{
    static const hal_can_ops_t k_ops = {can_send_op, can_recv_op, can_bus_state_op, can_unconfirmed_op, can_restart_op};
    return (hal_can_t){&k_ops, self};
}

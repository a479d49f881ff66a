/* SPDX-License-Identifier: MIT
 * linux_can.c - SocketCAN; see linux_can.h.
 */
#include "linux_can.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "linux_can_frame.h"
#include "linux_can_trouble.h"

/* A waiting frame counts as no more against SO_SNDBUF: 768 in Linux 6.1, more in 7.2. The limit is unconfirmed. */
#define FRAME_MEMORY  2048
#define CLOCK_STEP_US 1000000u /* a frame that seems to have waited longer came around a change of the wall clock */
#define LOOK_OLD_US   5000000u /* what was seen so long ago says nothing of the frames that wait now */
#define IN_ADAPTER    64u      /* frames that an adapter has taken may be counted as neither waiting nor sent */
#define STANDSTILL_US 200000u  /* on a bus that works a frame goes out in this time: at 20 kbit/s it takes 7 ms */

static const char k_sending[] = "sending";
static const char k_receiving[] = "receiving";

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
    const struct can_frame out = linux_can_frame_to_kernel(frame);
    if (send(self->fd, &out, sizeof out, MSG_DONTWAIT) == (ssize_t)sizeof out) {
        self->unconfirmed++;
        linux_can_trouble_note_success(self, k_sending);
        return HV_OK;
    }
    if (errno == ENOBUFS) {
        self->refused++;
        return HV_ERR_AGAIN;
    }
    if (errno == EAGAIN || errno == EWOULDBLOCK) {
        return HV_ERR_AGAIN;
    }
    return linux_can_trouble_note_failure(self, errno, k_sending);
}

/* --- Receiving --- */

static uint64_t us_of(const struct timespec *time)
{
    return (uint64_t)time->tv_sec * 1000000u + (uint64_t)time->tv_nsec / 1000u;
}

static void read_clocks(linux_can_t *self)
{
    struct timespec wall, now;
    (void)clock_gettime(CLOCK_REALTIME, &wall);
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    self->wall_us = us_of(&wall);
    self->now_us = us_of(&now);
    self->has_clocks = true;
}

/* The kernel stamps by the wall clock, we count by the other one: what both have in common is how long ago it was. The clocks are
 * read once for all that waits; what came later, or around a change of the wall clock, has them read again. */
static uint64_t when_received_us(linux_can_t *self, const linux_can_received_t *received)
{
    const uint64_t stamp_us = us_of(&received->stamp);
    if (!self->has_clocks || self->wall_us - stamp_us >= CLOCK_STEP_US) {
        read_clocks(self);
    }
    const uint64_t ago_us = self->wall_us - stamp_us; /* huge where the stamp is of the future */
    const uint64_t when_us = self->now_us - (ago_us < CLOCK_STEP_US ? ago_us : 0);
    self->last_rx_us = when_us > self->last_rx_us ? when_us : self->last_rx_us;
    return self->last_rx_us;
}

static can_frame_t receive_report(linux_can_t *self, const struct can_frame *frame)
{
    const can_frame_t out = {.id = linux_can_frame_report(frame, &self->state), .is_error = true};
    self->reports++;
    self->tx_errors = frame->data[6];
    self->rx_errors = frame->data[7];
    if ((out.id & CAN_ERROR_BUS_OFF) != 0) {
        (void)linux_can_trouble_say_bus_off(self);
    }
    if ((out.id & CAN_ERROR_RESTARTED) != 0) {
        linux_can_trouble_cut_off(self, HAL_CAN_ACTIVE);
    }
    return out;
}

/* Frames were lost before this one. Among them may have been echoes; then unconfirmed stays above 0, which is the safe side. */
static void note_lost(linux_can_t *self, uint32_t lost)
{
    self->is_overrun |= lost != self->lost;
    self->lost = lost;
}

/* False where the frame is not for the caller. */
static bool receive_one(linux_can_t *self, const linux_can_received_t *received, can_frame_t *out)
{
    if ((received->frame.can_id & CAN_ERR_FLAG) != 0) {
        *out = receive_report(self, &received->frame);
        return true;
    }
    if (received->is_own) {
        self->unconfirmed -= self->unconfirmed > 0 ? 1 : 0;
        return false;
    }
    const can_frame_t frame = linux_can_frame_from_kernel(&received->frame);
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
static hv_status_t receive_next(linux_can_t *self, linux_can_received_t *received, can_frame_t *out, bool *is_taken)
{
    do {
        if (is_off(self)) {
            return HV_ERR_IO;
        }
        const bool has_come = linux_can_frame_receive(&self->batch, self->fd, received);
        if (!has_come && errno != EAGAIN && errno != EWOULDBLOCK) {
            return linux_can_trouble_note_failure(self, errno, k_receiving);
        }
        linux_can_trouble_note_success(self, k_receiving);
        if (!has_come) {
            self->has_clocks = false;
            return HV_ERR_AGAIN;
        }
        note_lost(self, received->lost);
        *is_taken = receive_one(self, received, out);
    } while (!*is_taken && !self->is_overrun);
    return HV_OK;
}

static hv_status_t can_recv_op(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    linux_can_t *self = ctx;
    linux_can_received_t received;
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

/* What only a restart takes back stays; an interface without a controller (vcan) knows nothing better than its reports. */
static hv_status_t can_ask_state_op(void *ctx, hal_can_state_t *out)
{
    linux_can_t *self = ctx;
    linux_can_link_t link;
    if (linux_can_link_look(self->netlink, self->name, &link) != HV_OK) {
        return HV_ERR_IO;
    }
    if (!self->is_cut && link.has_controller && link.is_up && link.state != HAL_CAN_BUS_OFF) {
        self->state = link.state;
    }
    *out = self->state;
    return HV_OK;
}

static hv_status_t can_unconfirmed_op(void *ctx, uint32_t *frames)
{
    const linux_can_t *self = ctx;
    if (!self->has_echo) {
        return HV_ERR_NOSUP;
    }
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
    linux_can_trouble_cut_off(self, HAL_CAN_DOWN);
    self->unconfirmed = 0;
    self->lost = 0;
    self->batch.first = self->batch.count = 0;
    self->is_overrun = self->has_clocks = false;
    self->fd = socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (self->fd < 0 && (errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT)) {
        return linux_can_trouble_report(self, LINUX_CAN_NO_SUPPORT, errno,
                                        "this kernel has no SocketCAN (modules can and can_raw)");
    }
    if (self->fd < 0 || !set_options(self) || bind(self->fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        const hv_status_t status = linux_can_trouble_note_failure(self, errno, "opening");
        close_socket(self);
        return status;
    }
    return HV_OK;
}

/* For somebody who may. */
static void ask_for_flush(const linux_can_t *self)
{
    if (self->request[0] != '\0') {
        const int fd = open(self->request, O_WRONLY | O_CREAT | O_CLOEXEC, 0660);
        if (fd >= 0) {
            (void)close(fd);
        }
    }
}

static hv_status_t look(linux_can_t *self, linux_can_link_t *link)
{
    const hv_status_t status = linux_can_link_look(self->netlink, self->name, link);
    if (status == HV_ERR_AGAIN) {
        return linux_can_trouble_say_gone(self);
    }
    if (status != HV_OK) {
        return linux_can_trouble_report(self, LINUX_CAN_SYSTEM_ERROR, errno, "asking for its state");
    }
    if (!link->is_can) {
        (void)linux_can_trouble_report(self, LINUX_CAN_NOT_CAN, 0, "this is not a CAN interface (ip -br link show type can)");
        return HV_ERR_ARG;
    }
    return HV_OK;
}

static uint64_t monotonic_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return us_of(&now);
}

/* Whose are the frames that wait? A program that works adds others, and taking the interface down would cut its bus; those of one
 * that has died stand still, or go out and are not followed by more. Looks one after the other tell them apart. True once it is
 * known, with is_alive. */
static bool knows_whose(linux_can_t *self, const linux_can_link_t *link, bool *is_alive)
{
    const uint64_t now_us = monotonic_us();
    if (!self->has_looked || now_us - self->looked_us >= LOOK_OLD_US || link->sent < self->moved_sent) {
        self->has_looked = true;
        self->looked_us = self->moved_us = now_us;
        self->looked_sent = self->moved_sent = link->sent;
        self->looked_waiting = link->waiting;
        return false;
    }
    if (link->sent != self->moved_sent) {
        self->moved_us = now_us;
        self->moved_sent = link->sent;
    }
    *is_alive = link->sent - self->looked_sent + link->waiting > (uint64_t)self->looked_waiting + IN_ADAPTER;
    return *is_alive || now_us - self->moved_us >= STANDSTILL_US;
}

/* Fresh or not at all: what stands still in the interface is dropped, be it ours or of a program before us. */
static hv_status_t clear(linux_can_t *self, linux_can_link_t *link, bool is_suspect)
{
    const bool must = is_suspect || link->state == HAL_CAN_BUS_OFF || !link->is_up;
    bool is_alive = link->waiting == 0;
    if (!must && !is_alive && !knows_whose(self, link, &is_alive)) {
        return linux_can_trouble_report(self, LINUX_CAN_FRAMES_WAIT, 0,
                                        "frames of another program wait in it; soon a second look tells whether they go out");
    }
    if (!must && is_alive) {
        return HV_OK;
    }
    if (linux_can_link_flush(self->name) == HV_OK) {
        link->is_up = true;
        return HV_OK;
    }
    ask_for_flush(self);
    const hv_status_t status = look(self, link); /* it may have gone down, and not up again */
    if (status != HV_OK) {
        return status;
    }
    if (!link->is_up) {
        return linux_can_trouble_say_down(self);
    }
    if (link->state == HAL_CAN_BUS_OFF) {
        return linux_can_trouble_say_bus_off(self);
    }
    if (link->waiting > 0) {
        return linux_can_trouble_report(
            self, LINUX_CAN_FRAMES_WAIT, 0,
            "old frames wait in it; dropping them takes CAP_NET_ADMIN (as root: ip link set it down, then up)");
    }
    return HV_OK;
}

/* Where it fails nothing passes until one succeeds, whatever there was before. */
static hv_status_t start(linux_can_t *self)
{
    linux_can_link_t link;
    linux_can_trouble_cut_off(self, is_off(self) || self->state == HAL_CAN_BUS_OFF ? self->state : HAL_CAN_DOWN);
    hv_status_t status = look(self, &link);
    if (status == HV_OK) {
        status = clear(self, &link, self->unconfirmed > 0);
    }
    if (status == HV_OK) {
        status = open_socket(self, link.index);
    }
    if (status == HV_OK) {
        self->state = link.state == HAL_CAN_WARNING || link.state == HAL_CAN_PASSIVE ? link.state : HAL_CAN_ACTIVE;
        self->has_echo = link.has_echo;
        self->is_cut = false;
        self->has_looked = false;
        linux_can_trouble_forget(self);
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
    if (config->run_dir != NULL) {
        (void)snprintf(self->request, sizeof self->request, "%s/flush-%s", config->run_dir, config->interface);
    }
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
    *self = (linux_can_t){.fd = -1, .state = HAL_CAN_DOWN, .is_cut = true, .has_echo = true};
    hv_status_t status = keep_config(self, config);
    if (status != HV_OK) {
        return status;
    }
    self->netlink = linux_can_link_open();
    status = self->netlink == NULL ? linux_can_trouble_report(self, LINUX_CAN_SYSTEM_ERROR, errno, "asking for its state")
                                   : start(self);
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
    static const hal_can_ops_t k_ops = {can_send_op,        can_recv_op,    can_bus_state_op,
                                        can_unconfirmed_op, can_restart_op, can_ask_state_op};
    return (hal_can_t){&k_ops, self};
}

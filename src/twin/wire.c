/* SPDX-License-Identifier: MIT
 * wire.c - the bus as the drives' side has it; see wire.h.
 */
#include "twin/wire.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "linux_can_link.h"
#include "linux_can_local.h"

#define BACKLOG       4
#define RECEIVE_BYTES (1 << 20)
#define STORM_CODE    CAN_ERR_PROT
#define WORDS_MAX     16u
#define COMMAND_MAX   160u

static const char k_without[] = "this kernel has no SocketCAN. Load it (as root: modprobe can_raw vcan), or use a bus between "
                                "programs: [can] interface = twin0";

/* --- Opening --- */

/* What the kernel says of an interface; nothing where it does not. */
static linux_can_link_t look(const char *name)
{
    linux_can_link_t link = {.kind = ""};
    struct mnl_socket *netlink = linux_can_link_open();
    if (netlink != NULL && linux_can_link_look(netlink, name, &link) != HV_OK) {
        link = (linux_can_link_t){.kind = ""};
    }
    linux_can_link_close(netlink);
    return link;
}

/* By that, not by its name. Where nothing is said the interface counts as real. */
static bool is_virtual(const char *name)
{
    const linux_can_link_t link = look(name);
    return strcmp(link.kind, "vcan") == 0 || strcmp(link.kind, "vxcan") == 0;
}

bool wire_is_up(const wire_t *self)
{
    const linux_can_link_t link = look(self->end);
    return link.is_up && link.state != HAL_CAN_BUS_OFF && link.state != HAL_CAN_DOWN && link.state != HAL_CAN_GONE;
}

static bool open_can(wire_t *self, bool is_real_allowed, char why[WIRE_WHY_MAX])
{
    struct sockaddr_can address = {.can_family = AF_CAN};
    const int bytes = RECEIVE_BYTES;
    self->fd = socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (self->fd < 0) {
        const bool is_missing = errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT;
        (void)snprintf(why, WIRE_WHY_MAX, "%s: %s", self->end, is_missing ? k_without : strerror(errno));
        return false;
    }
    address.can_ifindex = (int)if_nametoindex(self->end);
    if (address.can_ifindex == 0) {
        (void)snprintf(why, WIRE_WHY_MAX, "%s: there is no such interface. As root: ip link add %s type vcan; ip link set %s up",
                       self->end, self->end, self->end);
        return false;
    }
    self->is_real = !is_virtual(self->end);
    if (self->is_real && !is_real_allowed) {
        (void)snprintf(
            why, WIRE_WHY_MAX,
            "%s: leads to real drives, in whose place heave-twin would answer. Take vcan, vxcan or twin0; --on-real-bus where no "
            "drive is on it",
            self->end);
        return false;
    }
    (void)setsockopt(self->fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    if (bind(self->fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        (void)snprintf(why, WIRE_WHY_MAX, "%s: %s", self->end, strerror(errno));
        return false;
    }
    return true;
}

static bool open_local(wire_t *self, char why[WIRE_WHY_MAX])
{
    struct sockaddr_un address;
    const socklen_t length = linux_can_local_address(self->end, &address);
    self->fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->fd < 0 || bind(self->fd, (const struct sockaddr *)&address, length) != 0 || listen(self->fd, BACKLOG) != 0) {
        (void)snprintf(why, WIRE_WHY_MAX, "%s: %s", self->end,
                       errno == EADDRINUSE ? "another heave-twin is this bus already" : strerror(errno));
        return false;
    }
    return true;
}

static bool open_adapter(wire_t *self, char why[WIRE_WHY_MAX])
{
    return slcan_open(&self->slcan, self->adapter, self->slcan.bitrate_bps, why, WIRE_WHY_MAX);
}

bool wire_open(wire_t *self, const config_can_t *can, const char *end, const char *adapter, bool is_real_allowed,
               char why[WIRE_WHY_MAX])
{
    memset(self, 0, sizeof *self);
    (void)snprintf(self->name, sizeof self->name, "%s", can->interface);
    (void)snprintf(self->end, sizeof self->end, "%s", end != NULL ? end : can->interface);
    self->kind = adapter != NULL ? WIRE_SLCAN : linux_can_local_is(self->end) ? WIRE_LOCAL : WIRE_CAN;
    self->adapter = adapter;
    self->slcan = (slcan_t){.end = -1, .terminal = -1, .bitrate_bps = can->bitrate_bps};
    self->fd = -1;
    for (unsigned i = 0; i < WIRE_CLIENTS_MAX; i++) {
        self->client[i] = -1;
    }
    const bool is_open = self->kind == WIRE_SLCAN   ? open_adapter(self, why)
                         : self->kind == WIRE_LOCAL ? open_local(self, why)
                                                    : open_can(self, is_real_allowed, why);
    if (!is_open) {
        wire_close(self);
    }
    return is_open;
}

static void drop_client(wire_t *self, unsigned i)
{
    if (self->client[i] >= 0) {
        (void)close(self->client[i]);
    }
    self->client[i] = -1;
}

void wire_close(wire_t *self)
{
    for (unsigned i = 0; i < WIRE_CLIENTS_MAX; i++) {
        drop_client(self, i);
    }
    slcan_close(&self->slcan);
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    self->fd = -1;
}

/* --- Frames --- */

static void put_packet(wire_t *self, unsigned i, const struct can_frame *frame, bool is_echo)
{
    const linux_can_local_packet_t packet = {.frame = *frame, .is_echo = is_echo ? 1 : 0};
    if (self->client[i] >= 0 &&
        send(self->client[i], &packet, sizeof packet, MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)sizeof packet) {
        self->refused++;
    }
}

static void put_kernel_frame(wire_t *self, const struct can_frame *frame)
{
    if (self->kind == WIRE_CAN) {
        self->refused += send(self->fd, frame, sizeof *frame, MSG_DONTWAIT) != (ssize_t)sizeof *frame;
        return;
    }
    for (unsigned i = 0; i < WIRE_CLIENTS_MAX; i++) {
        put_packet(self, i, frame, false);
    }
}

void wire_put(void *self, const can_frame_t *frame)
{
    wire_t *wire = self;
    const struct can_frame out = linux_can_frame_to_kernel(frame);
    if (wire->kind == WIRE_SLCAN) {
        slcan_put(&wire->slcan, frame);
    } else if (wire->fd >= 0 && !wire->is_cable_out) {
        put_kernel_frame(wire, &out);
    }
}

unsigned wire_watch(const wire_t *self, struct pollfd fds[WIRE_FDS_MAX])
{
    unsigned count = 0;
    const slcan_t *slcan = &self->slcan;
    if (slcan->end >= 0 && (!slcan->is_deaf || slcan->waiting > 0)) {
        fds[count++] = (struct pollfd){.fd = slcan->end,
                                       .events = (short)((slcan->is_deaf ? 0 : POLLIN) | (slcan->waiting > 0 ? POLLOUT : 0))};
    }
    if (self->fd >= 0) {
        fds[count++] = (struct pollfd){.fd = self->fd, .events = POLLIN};
    }
    for (unsigned i = 0; i < WIRE_CLIENTS_MAX; i++) {
        if (self->client[i] >= 0) {
            fds[count++] = (struct pollfd){.fd = self->client[i], .events = POLLIN};
        }
    }
    return count;
}

static bool hear_can(wire_t *self, wire_heard_t heard, void *ctx)
{
    linux_can_received_t received;
    while (linux_can_frame_receive(&self->batch, self->fd, &received)) {
        if ((received.frame.can_id & CAN_ERR_FLAG) == 0) {
            const can_frame_t out = linux_can_frame_from_kernel(&received.frame);
            heard(ctx, &out);
        }
    }
    return errno != ENODEV && errno != ENXIO;
}

static void let_in(wire_t *self)
{
    const int fd = self->fd >= 0 ? accept4(self->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC) : -1;
    for (unsigned i = 0; i < WIRE_CLIENTS_MAX && fd >= 0; i++) {
        if (self->client[i] < 0) {
            self->client[i] = fd;
            return;
        }
    }
    if (fd >= 0) {
        (void)close(fd);
    }
}

/* Each frame is the drives' and every other program's; then it has left. */
static void hear_client(wire_t *self, unsigned i, wire_heard_t heard, void *ctx)
{
    linux_can_local_packet_t packet;
    ssize_t length;
    while (self->client[i] >= 0 && (length = recv(self->client[i], &packet, sizeof packet, MSG_DONTWAIT)) >= 0) {
        if (length != (ssize_t)sizeof packet) {
            drop_client(self, i);
            return;
        }
        if (self->is_cable_out) {
            continue;
        }
        put_packet(self, i, &packet.frame, true);
        for (unsigned other = 0; other < WIRE_CLIENTS_MAX; other++) {
            if (other != i) {
                put_packet(self, other, &packet.frame, false);
            }
        }
        const can_frame_t out = linux_can_frame_from_kernel(&packet.frame);
        heard(ctx, &out);
    }
    if (self->client[i] >= 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
        drop_client(self, i);
    }
}

bool wire_hear(wire_t *self, wire_heard_t heard, void *ctx)
{
    if (self->kind == WIRE_SLCAN) {
        slcan_serve(&self->slcan, heard, ctx);
        return true;
    }
    if (self->kind == WIRE_CAN) {
        return self->fd < 0 || hear_can(self, heard, ctx);
    }
    let_in(self);
    for (unsigned i = 0; i < WIRE_CLIENTS_MAX; i++) {
        if (self->client[i] >= 0) {
            hear_client(self, i, heard, ctx);
        }
    }
    return true;
}

/* --- Faults --- */

/* Runs a program of iproute2; words are separated by one blank. */
static bool run(const char *line, char *why, size_t size)
{
    char text[COMMAND_MAX];
    char *argument[WORDS_MAX + 1] = {NULL};
    unsigned words = 0;
    char *rest = NULL;
    pid_t child = 0;
    int status = 0;
    (void)snprintf(text, sizeof text, "%s", line);
    for (char *word = strtok_r(text, " ", &rest); word != NULL && words < WORDS_MAX; word = strtok_r(NULL, " ", &rest)) {
        argument[words++] = word;
    }
    const int error = posix_spawnp(&child, argument[0], NULL, NULL, argument, environ);
    if (error == 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        return true;
    }
    (void)snprintf(why, size, "`%s` did not work%s%s; it needs iproute2 and the right to change interfaces (root)", line,
                   error != 0 ? ": " : "", error != 0 ? strerror(error) : "");
    return false;
}

static void report(wire_t *self, uint32_t what, uint8_t of_controller)
{
    const struct can_frame frame = {.can_id = CAN_ERR_FLAG | what, .can_dlc = CAN_ERR_DLC, .data = {0, of_controller}};
    if (self->fd >= 0) {
        put_kernel_frame(self, &frame);
    }
}

static bool local_fault(wire_t *self, bus_fault_t fault, char *why)
{
    if (fault == BUS_DOWN) {
        wire_close(self);
    } else if (fault == BUS_UP) {
        return self->fd >= 0 || open_local(self, why);
    } else {
        self->is_cable_out = fault != BUS_CABLE_IN;
    }
    return true;
}

/* A cable that is out: a bus that takes a frame in two minutes. */
static bool can_fault(const wire_t *self, bus_fault_t fault, char *why, size_t size)
{
    static const char *const k_lines[][2] = {
        [BUS_CABLE_OUT] = {"tc qdisc replace dev", " root tbf rate 8bit burst 16 limit 1600"},
        [BUS_FULL] = {"tc qdisc replace dev", " root tbf rate 8bit burst 16 limit 16"},
        [BUS_CABLE_IN] = {"tc qdisc del dev", " root"},
        [BUS_DOWN] = {"ip link set", " down"},
        [BUS_UP] = {"ip link set", " up"},
    };
    char line[COMMAND_MAX];
    (void)snprintf(line, sizeof line, "%s %s%s", k_lines[fault][0], self->name, k_lines[fault][1]);
    return run(line, why, size);
}

/* What such an adapter tells of its controller: its state with both error counters, or one error of many kinds. */
static bool adapter_fault(wire_t *self, bus_fault_t fault, uint32_t number, char *why, size_t size)
{
    slcan_t *slcan = &self->slcan;
    switch (fault) {
    case BUS_OFF:
        slcan_say(slcan, "sb000256\r");
        return true;
    case BUS_PASSIVE:
        slcan_say(slcan, "sp000128\r");
        return true;
    case BUS_ACTIVE:
        slcan_say(slcan, "sa000000\r");
        return true;
    case BUS_STORM:
        for (uint32_t i = 0; i < number; i++) {
            slcan_say(slcan, "e1s\r");
        }
        return true;
    case BUS_CABLE_OUT:
    case BUS_CABLE_IN:
        slcan->is_deaf = fault == BUS_CABLE_OUT;
        return true;
    case BUS_UNPLUG:
        slcan_close(slcan);
        return true;
    case BUS_PLUG:
        return slcan->end >= 0 || open_adapter(self, why);
    case BUS_FULL: /* of the kernel's interface, where its user has made one */
    case BUS_DOWN:
    case BUS_UP:
        return can_fault(self, fault, why, size);
    case BUS_RELAYS_SILENT: /* not of this bus */
    case BUS_RELAYS_FORGET:
    case BUS_RELAYS_BACK:
    case BUS_SWITCH:
    case BUS_CHIP_GONE:
    case BUS_CHIP_BACK:
        break;
    }
    return false;
}

bool wire_fault(void *self, bus_fault_t fault, uint32_t number, char *why, size_t size)
{
    wire_t *wire = self;
    if (wire->kind == WIRE_SLCAN) {
        return adapter_fault(wire, fault, number, why, size);
    }
    switch (fault) {
    case BUS_OFF:
        report(wire, CAN_ERR_BUSOFF, 0);
        return true;
    case BUS_PASSIVE:
        report(wire, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE);
        return true;
    case BUS_ACTIVE:
        report(wire, CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE);
        return true;
    case BUS_STORM:
        for (uint32_t i = 0; i < number; i++) {
            report(wire, STORM_CODE, 0);
        }
        return true;
    case BUS_CABLE_OUT:
    case BUS_FULL:
    case BUS_CABLE_IN:
    case BUS_DOWN:
    case BUS_UP:
        return wire->kind == WIRE_LOCAL ? local_fault(wire, fault, why) : can_fault(wire, fault, why, size);
    case BUS_UNPLUG: /* of Modbus: nobody asks this bus for it */
    case BUS_PLUG:
    case BUS_RELAYS_SILENT:
    case BUS_RELAYS_FORGET:
    case BUS_RELAYS_BACK:
    case BUS_SWITCH: /* of GPIO lines: likewise */
    case BUS_CHIP_GONE:
    case BUS_CHIP_BACK:
        break;
    }
    return false;
}

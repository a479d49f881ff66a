/* SPDX-License-Identifier: MIT
 * linux_can_link.c - CAN interfaces by rtnetlink; see linux_can_link.h.
 */
#include "linux_can_link.h"

#include <errno.h>
#include <libmnl/libmnl.h>
#include <linux/can/netlink.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/pkt_sched.h>
#include <linux/rtnetlink.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define TRIES    3u  /* where others change interfaces meanwhile, the system says so instead of telling all of them */
#define LEFT_MAX 64u /* more than any answer that was given up has left behind */

/** Attributes of one level, by number; NULL = absent. */
typedef struct {
    const struct nlattr *at[64];
} attributes_t;

static int keep_attribute(const struct nlattr *attribute, void *data)
{
    attributes_t *self = data;
    const uint16_t type = mnl_attr_get_type(attribute);
    if (type < sizeof self->at / sizeof self->at[0]) {
        self->at[type] = attribute;
    }
    return MNL_CB_OK;
}

static attributes_t inside(const struct nlattr *nest)
{
    attributes_t found = {{NULL}};
    if (nest != NULL) {
        (void)mnl_attr_parse_nested(nest, keep_attribute, &found);
    }
    return found;
}

/* Copies what the kernel sent, which may be shorter or longer than what this program was built with. */
static bool copy_payload(void *out, size_t size, const struct nlattr *attribute)
{
    if (attribute == NULL) {
        return false;
    }
    const size_t sent = mnl_attr_get_payload_len(attribute);
    memcpy(out, mnl_attr_get_payload(attribute), sent < size ? sent : size);
    return true;
}

static uint32_t u32_of(const struct nlattr *attribute)
{
    uint32_t value = 0;
    (void)copy_payload(&value, sizeof value, attribute);
    return value;
}

static hal_can_state_t state_of(uint32_t kernels)
{
    static const hal_can_state_t k_states[] = {
        [CAN_STATE_ERROR_ACTIVE] = HAL_CAN_ACTIVE,   [CAN_STATE_ERROR_WARNING] = HAL_CAN_WARNING,
        [CAN_STATE_ERROR_PASSIVE] = HAL_CAN_PASSIVE, [CAN_STATE_BUS_OFF] = HAL_CAN_BUS_OFF,
        [CAN_STATE_STOPPED] = HAL_CAN_DOWN,          [CAN_STATE_SLEEPING] = HAL_CAN_DOWN,
    };
    return kernels < CAN_STATE_MAX ? k_states[kernels] : HAL_CAN_ACTIVE;
}

static void keep_counters(linux_can_link_t *self, const struct nlattr *attribute)
{
    struct can_device_stats stats = {0};
    (void)copy_payload(&stats, sizeof stats, attribute);
    self->bus_errors = stats.bus_error;
    self->warnings = stats.error_warning;
    self->passives = stats.error_passive;
    self->bus_offs = stats.bus_off;
    self->restarts = stats.restarts;
    self->lost_arbitration = stats.arbitration_lost;
}

static void keep_controller(linux_can_link_t *self, const struct nlattr *data)
{
    const attributes_t info = inside(data);
    struct can_bittiming timing = {0};
    struct can_berr_counter errors = {0};
    if (info.at[IFLA_CAN_STATE] == NULL) {
        return;
    }
    self->has_controller = true;
    self->state = state_of(u32_of(info.at[IFLA_CAN_STATE]));
    self->restart_ms = u32_of(info.at[IFLA_CAN_RESTART_MS]);
    (void)copy_payload(&timing, sizeof timing, info.at[IFLA_CAN_BITTIMING]);
    (void)copy_payload(&errors, sizeof errors, info.at[IFLA_CAN_BERR_COUNTER]);
    self->bitrate = timing.bitrate;
    self->sample_point = timing.sample_point;
    self->tx_errors = errors.txerr;
    self->rx_errors = errors.rxerr;
}

static int keep_link(const struct nlmsghdr *message, void *data)
{
    linux_can_link_t *self = data;
    const struct ifinfomsg *link = mnl_nlmsg_get_payload(message);
    attributes_t found = {{NULL}};
    struct rtnl_link_stats64 counts = {.tx_packets = 0};
    (void)mnl_attr_parse(message, sizeof *link, keep_attribute, &found);
    const attributes_t info = inside(found.at[IFLA_LINKINFO]);
    self->index = link->ifi_index;
    self->is_can = link->ifi_type == ARPHRD_CAN;
    self->is_up = (link->ifi_flags & (unsigned)IFF_UP) != 0;
    self->has_echo = (link->ifi_flags & (unsigned)IFF_ECHO) != 0;
    self->queue_length = u32_of(found.at[IFLA_TXQLEN]);
    (void)copy_payload(&counts, sizeof counts, found.at[IFLA_STATS64]);
    self->sent = counts.tx_packets;
    (void)copy_payload(self->kind, sizeof self->kind - 1, info.at[IFLA_INFO_KIND]);
    keep_controller(self, info.at[IFLA_INFO_DATA]);
    keep_counters(self, info.at[IFLA_INFO_XSTATS]);
    if (!self->is_up) {
        self->state = HAL_CAN_DOWN;
    }
    return MNL_CB_OK;
}

/* The root queue of our interface counts the frames in all queues below it. */
static int keep_queue(const struct nlmsghdr *message, void *data)
{
    linux_can_link_t *self = data;
    const struct tcmsg *queue = mnl_nlmsg_get_payload(message);
    attributes_t found = {{NULL}};
    struct tc_stats stats = {0};
    if (queue->tcm_ifindex == self->index && queue->tcm_parent == TC_H_ROOT) {
        (void)mnl_attr_parse(message, sizeof *queue, keep_attribute, &found);
        (void)copy_payload(&stats, sizeof stats, found.at[TCA_STATS]);
        self->waiting = stats.qlen;
    }
    return MNL_CB_OK;
}

/* What has been left of an answer that could not be read to its end would be taken for the next one, for ever. */
static void forget_answers(struct mnl_socket *netlink)
{
    char buffer[8192];
    for (unsigned i = 0; i < LEFT_MAX; i++) {
        if (recv(mnl_socket_get_fd(netlink), buffer, sizeof buffer, MSG_DONTWAIT) < 0 && errno == EAGAIN) {
            return;
        }
    }
}

static hv_status_t ask(struct mnl_socket *netlink, struct nlmsghdr *request, mnl_cb_t keep, linux_can_link_t *out)
{
    char buffer[8192];
    int more = MNL_CB_OK;
    request->nlmsg_seq = request->nlmsg_type;
    forget_answers(netlink);
    if (mnl_socket_sendto(netlink, request, request->nlmsg_len) < 0) {
        return HV_ERR_IO;
    }
    while (more > MNL_CB_STOP) {
        const ssize_t length = mnl_socket_recvfrom(netlink, buffer, sizeof buffer);
        more = length < 0 ? MNL_CB_ERROR
                          : mnl_cb_run(buffer, (size_t)length, request->nlmsg_seq, mnl_socket_get_portid(netlink), keep, out);
    }
    if (more == MNL_CB_ERROR) {
        return errno == ENODEV ? HV_ERR_AGAIN : HV_ERR_IO;
    }
    return HV_OK;
}

static hv_status_t ask_link(struct mnl_socket *netlink, const char *name, linux_can_link_t *out)
{
    char buffer[256];
    struct nlmsghdr *request = mnl_nlmsg_put_header(buffer);
    request->nlmsg_type = RTM_GETLINK;
    request->nlmsg_flags = NLM_F_REQUEST | NLM_F_ACK;
    (void)mnl_nlmsg_put_extra_header(request, sizeof(struct ifinfomsg));
    mnl_attr_put_strz(request, IFLA_IFNAME, name);
    return ask(netlink, request, keep_link, out);
}

static hv_status_t ask_queue(struct mnl_socket *netlink, linux_can_link_t *out)
{
    char buffer[256];
    struct nlmsghdr *request = mnl_nlmsg_put_header(buffer);
    request->nlmsg_type = RTM_GETQDISC;
    request->nlmsg_flags = NLM_F_REQUEST | NLM_F_DUMP;
    struct tcmsg *queue = mnl_nlmsg_put_extra_header(request, sizeof *queue);
    queue->tcm_ifindex = out->index;
    return ask(netlink, request, keep_queue, out);
}

struct mnl_socket *linux_can_link_open(void)
{
    struct mnl_socket *netlink = mnl_socket_open2(NETLINK_ROUTE, SOCK_CLOEXEC);
    if (netlink != NULL && mnl_socket_bind(netlink, 0, MNL_SOCKET_AUTOPID) != 0) {
        linux_can_link_close(netlink);
        netlink = NULL;
    }
    return netlink;
}

void linux_can_link_close(struct mnl_socket *netlink)
{
    const int error = errno;
    if (netlink != NULL) {
        (void)mnl_socket_close(netlink);
    }
    errno = error;
}

/* The last part of where the system's link to the driver leads. */
static void keep_driver(const char *name, linux_can_link_t *out)
{
    char path[64], target[256];
    (void)snprintf(path, sizeof path, "/sys/class/net/%s/device/driver", name);
    const ssize_t length = readlink(path, target, sizeof target - 1);
    if (length <= 0) {
        return;
    }
    target[length] = '\0';
    const char *last = strrchr(target, '/');
    (void)snprintf(out->driver, sizeof out->driver, "%.31s", last != NULL ? last + 1 : target);
}

static hv_status_t look(struct mnl_socket *netlink, const char *name, linux_can_link_t *out)
{
    *out = (linux_can_link_t){.state = HAL_CAN_ACTIVE};
    const hv_status_t status = ask_link(netlink, name, out);
    return status == HV_OK ? ask_queue(netlink, out) : status;
}

hv_status_t linux_can_link_look(struct mnl_socket *netlink, const char *name, linux_can_link_t *out)
{
    linux_can_link_t found;
    if (strlen(name) >= LINUX_CAN_NAME_SIZE) {
        return HV_ERR_AGAIN;
    }
    hv_status_t status = look(netlink, name, &found);
    for (unsigned i = 1; status == HV_ERR_IO && errno == EINTR && i < TRIES; i++) {
        status = look(netlink, name, &found);
    }
    if (status == HV_OK) {
        keep_driver(name, &found);
        *out = found;
    }
    return status;
}

static bool set_up(int fd, struct ifreq *request, bool is_up)
{
    if (ioctl(fd, SIOCGIFFLAGS, request) != 0) {
        return false;
    }
    request->ifr_flags = (short)(is_up ? request->ifr_flags | IFF_UP : request->ifr_flags & ~IFF_UP);
    return ioctl(fd, SIOCSIFFLAGS, request) == 0;
}

hv_status_t linux_can_link_flush(const char *name)
{
    struct ifreq request = {.ifr_flags = 0};
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return HV_ERR_IO;
    }
    strncpy(request.ifr_name, name, sizeof request.ifr_name - 1);
    const bool is_done = set_up(fd, &request, false) && set_up(fd, &request, true);
    const int error = errno;
    (void)close(fd);
    errno = error;
    if (is_done) {
        return HV_OK;
    }
    return error == ENODEV ? HV_ERR_AGAIN : HV_ERR_IO;
}

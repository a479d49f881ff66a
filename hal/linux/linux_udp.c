/* SPDX-License-Identifier: MIT
 * linux_udp.c - UDP socket of Linux; see linux_udp.h.
 */
#include "linux_udp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define WAITED_MAX_US 60000000

/** Room for the kernel's count of lost datagrams and the time of arrival, aligned as the kernel's macros want it. */
typedef union {
    struct cmsghdr header;
    uint8_t bytes[CMSG_SPACE(sizeof(uint32_t)) + CMSG_SPACE(sizeof(struct timespec))];
} control_t;

static void keep_ipv4(hal_udp_peer_t *peer, const void *address)
{
    memcpy(peer->address, address, 4);
}

static hal_udp_peer_t peer_from(const struct sockaddr_storage *from)
{
    hal_udp_peer_t peer = {.port = 0};
    if (from->ss_family == AF_INET) {
        struct sockaddr_in v4;
        memcpy(&v4, from, sizeof v4);
        keep_ipv4(&peer, &v4.sin_addr);
        peer.port = ntohs(v4.sin_port);
        return peer;
    }
    struct sockaddr_in6 v6;
    memcpy(&v6, from, sizeof v6);
    peer.port = ntohs(v6.sin6_port);
    if (IN6_IS_ADDR_V4MAPPED(&v6.sin6_addr)) {
        keep_ipv4(&peer, &v6.sin6_addr.s6_addr[12]);
        return peer;
    }
    memcpy(peer.address, &v6.sin6_addr, sizeof peer.address);
    peer.is_ipv6 = true;
    peer.scope_id = v6.sin6_scope_id;
    return peer;
}

/* The kernel stamps with the time of day; only the difference to now is of use beside a clock that never jumps. */
static uint32_t since_us(const void *stamp)
{
    struct timespec then;
    struct timespec now;
    memcpy(&then, stamp, sizeof then);
    (void)clock_gettime(CLOCK_REALTIME, &now); /* cannot fail: a valid clock and a valid address */
    const int64_t us = ((int64_t)now.tv_sec - then.tv_sec) * 1000000 + (now.tv_nsec - then.tv_nsec) / 1000;
    return us < 0 || us > WAITED_MAX_US ? 0 : (uint32_t)us;
}

static void keep_details(linux_udp_t *self, struct msghdr *message)
{
    self->waited_us = 0;
    for (struct cmsghdr *item = CMSG_FIRSTHDR(message); item != NULL; item = CMSG_NXTHDR(message, item)) {
        if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SO_RXQ_OVFL) {
            memcpy(&self->dropped, CMSG_DATA(item), sizeof self->dropped);
        } else if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SCM_TIMESTAMPNS &&
                   item->cmsg_len == CMSG_LEN(sizeof(struct timespec))) {
            self->waited_us = since_us(CMSG_DATA(item));
        }
    }
}

/* NOLINTNEXTLINE(readability-non-const-parameter): recvmsg writes through the pointer kept in part */
static hv_status_t udp_recv(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    linux_udp_t *self = ctx;
    struct sockaddr_storage address;
    control_t control;
    struct iovec part = {buffer, capacity};
    struct msghdr message = {.msg_name = &address,
                             .msg_namelen = sizeof address,
                             .msg_iov = &part,
                             .msg_iovlen = 1,
                             .msg_control = &control,
                             .msg_controllen = sizeof control};
    /* MSG_TRUNC: the return value is the real length. EINTR cannot come: the call does not wait. */
    const ssize_t received = recvmsg(self->fd, &message, MSG_DONTWAIT | MSG_TRUNC);
    if (received < 0) {
        if (errno == EAGAIN || errno == EWOULDBLOCK) {
            return HV_ERR_AGAIN;
        }
        self->error = errno;
        return HV_ERR_IO;
    }
    keep_details(self, &message);
    *length = (size_t)received;
    *from = peer_from(&address);
    return *length > capacity ? HV_ERR_RANGE : HV_OK;
}

static hv_status_t udp_dropped(void *ctx, uint32_t *datagrams)
{
    linux_udp_t *self = ctx;
    uint32_t info[SK_MEMINFO_VARS];
    socklen_t size = sizeof info;
    /* also where nothing comes through any more that could tell it */
    if (getsockopt(self->fd, SOL_SOCKET, SO_MEMINFO, info, &size) == 0 && size > SK_MEMINFO_DROPS * sizeof info[0]) {
        self->dropped = info[SK_MEMINFO_DROPS];
    }
    *datagrams = self->dropped;
    return HV_OK;
}

static hv_status_t udp_waited(void *ctx, uint32_t *us)
{
    const linux_udp_t *self = ctx;
    *us = self->waited_us;
    return HV_OK;
}

/* What helps, where that is known. */
static const char *remedy(int error)
{
    switch (error) {
    case EADDRINUSE:
        return "; another program receives there: end it (`ss -lunp` names it), or set another [udp] port";
    case EADDRNOTAVAIL:
        return "; no interface of this machine has this address: see `ip address`, or set [udp] bind = 0.0.0.0";
    case EACCES:
        return "; ports below 1024 take root: set [udp] port to 1024 or more";
    default:
        return "";
    }
}

static hv_status_t fail(linux_udp_t *self, const linux_udp_config_t *config, const char *what)
{
    self->error = errno;
    (void)snprintf(self->error_text, sizeof self->error_text, "udp: %s %s port %u: %s%s", what, config->bind,
                   (unsigned)config->port, strerror(self->error), remedy(self->error));
    linux_udp_close(self);
    return HV_ERR_IO;
}

/* Numeric only: a name server has no place in the start of a machine. */
static hv_status_t resolve(linux_udp_t *self, const linux_udp_config_t *config, struct addrinfo **found)
{
    const struct addrinfo hints = {.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE, .ai_socktype = SOCK_DGRAM};
    char port[8];
    (void)snprintf(port, sizeof port, "%u", (unsigned)config->port);
    const int code = getaddrinfo(config->bind, port, &hints, found);
    if (code == 0) {
        return HV_OK;
    }
    self->error = code; /* getaddrinfo's codes are negative already */
    (void)snprintf(self->error_text, sizeof self->error_text, "udp: bind %s: not a numeric address (%s)", config->bind,
                   gai_strerror(code));
    return HV_ERR_ARG;
}

static bool set_option(int fd, int level, int option, int value)
{
    return setsockopt(fd, level, option, &value, sizeof value) == 0;
}

/* Without these a socket on all addresses also hears the groups that other programs of this machine have joined. */
static bool leave_foreign_groups(int fd, int family)
{
    return set_option(fd, IPPROTO_IP, IP_MULTICAST_ALL, 0) &&
           (family != AF_INET6 || set_option(fd, IPPROTO_IPV6, IPV6_MULTICAST_ALL, 0));
}

/* Address and interface of "239.1.2.3%eth0". */
static hv_status_t resolve_group(linux_udp_t *self, const char *text, struct group_req *group)
{
    char host[INET6_ADDRSTRLEN] = "";
    struct sockaddr_in v4 = {.sin_family = AF_INET};
    struct sockaddr_in6 v6 = {.sin6_family = AF_INET6};
    const size_t length = strcspn(text, "%");
    const char *const interface = text[length] == '%' ? text + length + 1 : "";
    memset(group, 0, sizeof *group);
    (void)snprintf(host, sizeof host, "%.*s", (int)length, text);
    if (inet_pton(AF_INET, host, &v4.sin_addr) == 1) {
        memcpy(&group->gr_group, &v4, sizeof v4);
    } else if (inet_pton(AF_INET6, host, &v6.sin6_addr) == 1) {
        memcpy(&group->gr_group, &v6, sizeof v6);
    } else {
        self->error = EINVAL;
        (void)snprintf(self->error_text, sizeof self->error_text, "udp: group %s: not a numeric address", text);
        return HV_ERR_ARG;
    }
    group->gr_interface = if_nametoindex(interface);
    if (group->gr_interface == 0) {
        self->error = errno;
        (void)snprintf(self->error_text, sizeof self->error_text,
                       "udp: group %s: this machine has no network interface \"%s\": see `ip link`, and [udp] group", text,
                       interface);
        return HV_ERR_IO;
    }
    return HV_OK;
}

static hv_status_t join(linux_udp_t *self, const char *text)
{
    struct group_req group;
    const hv_status_t status = resolve_group(self, text, &group);
    const int level = group.gr_group.ss_family == AF_INET6 ? IPPROTO_IPV6 : IPPROTO_IP;
    if (status != HV_OK || setsockopt(self->fd, level, MCAST_JOIN_GROUP, &group, sizeof group) == 0) {
        return status;
    }
    self->error = errno;
    (void)snprintf(self->error_text, sizeof self->error_text, "udp: join group %s: %s", text, strerror(self->error));
    return HV_ERR_IO;
}

static hv_status_t set_up(linux_udp_t *self, const linux_udp_config_t *config, const struct addrinfo *address)
{
    self->fd = socket(address->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->fd < 0) {
        return fail(self, config, "socket for");
    }
    if (address->ai_family == AF_INET6 && !set_option(self->fd, IPPROTO_IPV6, IPV6_V6ONLY, 0)) {
        return fail(self, config, "IPv4 beside IPv6 on");
    }
    if (config->receive_buffer > 0 && !set_option(self->fd, SOL_SOCKET, SO_RCVBUF, config->receive_buffer)) {
        return fail(self, config, "receive buffer of");
    }
    if (!set_option(self->fd, SOL_SOCKET, SO_RXQ_OVFL, 1)) {
        return fail(self, config, "overflow count of");
    }
    if (!set_option(self->fd, SOL_SOCKET, SO_TIMESTAMPNS, 1)) {
        return fail(self, config, "times of arrival of");
    }
    if (!leave_foreign_groups(self->fd, address->ai_family)) {
        return fail(self, config, "only groups that it joined on");
    }
    if (bind(self->fd, address->ai_addr, address->ai_addrlen) != 0) {
        return fail(self, config, "bind");
    }
    return HV_OK;
}

/* What the kernel made of the request. */
static hv_status_t look_up(linux_udp_t *self, const linux_udp_config_t *config)
{
    struct sockaddr_storage bound;
    socklen_t bound_length = sizeof bound;
    socklen_t length = sizeof self->receive_buffer;
    if (getsockname(self->fd, (struct sockaddr *)&bound, &bound_length) != 0 ||
        getsockopt(self->fd, SOL_SOCKET, SO_RCVBUF, &self->receive_buffer, &length) != 0) {
        return fail(self, config, "state of");
    }
    self->port = peer_from(&bound).port;
    return HV_OK;
}

hv_status_t linux_udp_open(linux_udp_t *self, const linux_udp_config_t *config)
{
    struct addrinfo *found = NULL;
    *self = (linux_udp_t){.fd = -1};
    hv_status_t status = resolve(self, config, &found);
    if (status != HV_OK) {
        return status;
    }
    status = set_up(self, config, found);
    freeaddrinfo(found);
    status = status == HV_OK ? look_up(self, config) : status;
    if (status == HV_OK && config->group != NULL && config->group[0] != '\0') {
        status = join(self, config->group);
    }
    if (status != HV_OK) {
        linux_udp_close(self);
    }
    return status;
}

void linux_udp_close(linux_udp_t *self)
{
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

hal_udp_t linux_udp_hal(linux_udp_t *self)
{
    static const hal_udp_ops_t k_ops = {udp_recv, udp_dropped, udp_waited};
    return (hal_udp_t){&k_ops, self};
}

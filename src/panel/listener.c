/* SPDX-License-Identifier: MIT
 * listener.c - see listener.h.
 */
#include "panel/listener.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#define WAITING_MAX 256

/* A peer that has gone without a word is noticed after so long. */
#define KEEP_IDLE_S     10
#define KEEP_INTERVAL_S 2
#define KEEP_PROBES     3

static struct sockaddr_in *v4_of(listener_address_t *self)
{
    return (struct sockaddr_in *)(void *)&self->address;
}

static struct sockaddr_in6 *v6_of(listener_address_t *self)
{
    return (struct sockaddr_in6 *)(void *)&self->address;
}

static bool read_port(const char *text, int *port)
{
    char *end = NULL;
    const long number = strtol(text, &end, 10);
    *port = (int)number;
    return text[0] >= '0' && text[0] <= '9' && *end == '\0' && number >= 1 && number <= 65535;
}

bool listener_read(listener_address_t *self, const char *text)
{
    char address[ACCESS_HOST_MAX];
    const char *const colon = strrchr(text, ':');
    const size_t length = colon != NULL ? (size_t)(colon - text) : 0;
    const bool has_brackets = length > 2 && text[0] == '[' && text[length - 1] == ']';
    *self = (listener_address_t){.length = 0};
    if (length == 0 || length >= ACCESS_HOST_MAX || !read_port(colon + 1, &self->port)) {
        return false;
    }
    (void)snprintf(self->host, sizeof self->host, "%.*s", (int)length, text);
    (void)snprintf(address, sizeof address, "%.*s", (int)length - (has_brackets ? 2 : 0), text + (has_brackets ? 1 : 0));
    self->address.ss_family = has_brackets ? AF_INET6 : AF_INET;
    self->length = has_brackets ? sizeof(struct sockaddr_in6) : sizeof(struct sockaddr_in);
    if (has_brackets) {
        v6_of(self)->sin6_port = htons((in_port_t)self->port);
        return inet_pton(AF_INET6, address, &v6_of(self)->sin6_addr) == 1 && !IN6_IS_ADDR_V4MAPPED(&v6_of(self)->sin6_addr);
    }
    v4_of(self)->sin_port = htons((in_port_t)self->port);
    return inet_pton(AF_INET, address, &v4_of(self)->sin_addr) == 1;
}

static bool is_this_machine(const struct sockaddr_storage *address)
{
    if (address->ss_family == AF_INET) {
        return ntohl(((const struct sockaddr_in *)(const void *)address)->sin_addr.s_addr) >> 24 == 127;
    }
    return address->ss_family == AF_INET6 &&
           IN6_IS_ADDR_LOOPBACK(&((const struct sockaddr_in6 *)(const void *)address)->sin6_addr);
}

bool listener_is_this_machine(const listener_address_t *self)
{
    return is_this_machine(&self->address);
}

/* What the kernel has made of it. */
static bool is_there(const listener_address_t *self, int fd)
{
    listener_address_t bound = {.length = sizeof bound.address};
    if (getsockname(fd, (struct sockaddr *)&bound.address, &bound.length) != 0 ||
        bound.address.ss_family != self->address.ss_family) {
        return false;
    }
    listener_address_t wanted = *self;
    return bound.address.ss_family == AF_INET
               ? v4_of(&bound)->sin_port == v4_of(&wanted)->sin_port &&
                     v4_of(&bound)->sin_addr.s_addr == v4_of(&wanted)->sin_addr.s_addr
               : v6_of(&bound)->sin6_port == v6_of(&wanted)->sin6_port &&
                     memcmp(&v6_of(&bound)->sin6_addr, &v6_of(&wanted)->sin6_addr, sizeof(struct in6_addr)) == 0;
}

int listener_open(const listener_address_t *self, char *why, size_t size)
{
    const int yes = 1;
    const bool is_v6 = self->address.ss_family == AF_INET6;
    const int fd = socket(self->address.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const bool is_open = fd >= 0 && setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) == 0 &&
                         (!is_v6 || setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &yes, sizeof yes) == 0) &&
                         bind(fd, (const struct sockaddr *)&self->address, self->length) == 0 && listen(fd, WAITING_MAX) == 0;
    if (!is_open) {
        (void)snprintf(why, size, "cannot listen on %s port %d: %s", self->host, self->port, strerror(errno));
    } else if (!is_there(self, fd)) {
        (void)snprintf(why, size, "cannot listen on %s port %d: the kernel listens elsewhere", self->host, self->port);
    } else {
        return fd;
    }
    if (fd >= 0) {
        (void)close(fd);
    }
    return -1;
}

/* Ticks and answers are small, and wait for nothing. */
static void tune(int fd)
{
    static const int k_options[][3] = {{IPPROTO_TCP, TCP_NODELAY, 1},
                                       {SOL_SOCKET, SO_KEEPALIVE, 1},
                                       {IPPROTO_TCP, TCP_KEEPIDLE, KEEP_IDLE_S},
                                       {IPPROTO_TCP, TCP_KEEPINTVL, KEEP_INTERVAL_S},
                                       {IPPROTO_TCP, TCP_KEEPCNT, KEEP_PROBES}};
    for (size_t i = 0; i < sizeof k_options / sizeof k_options[0]; i++) {
        (void)setsockopt(fd, k_options[i][0], k_options[i][1], &k_options[i][2], sizeof k_options[i][2]);
    }
}

static void describe(const struct sockaddr_storage *address, listener_peer_t *peer)
{
    const void *const from = address->ss_family == AF_INET6
                                 ? (const void *)&((const struct sockaddr_in6 *)(const void *)address)->sin6_addr
                                 : (const void *)&((const struct sockaddr_in *)(const void *)address)->sin_addr;
    *peer = (listener_peer_t){.is_this_machine = is_this_machine(address)};
    (void)inet_ntop(address->ss_family, from, peer->address, sizeof peer->address);
}

int listener_accept(int fd, listener_peer_t *peer)
{
    struct sockaddr_storage address;
    socklen_t length = sizeof address;
    const int taken = accept4(fd, (struct sockaddr *)&address, &length, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (taken >= 0) {
        describe(&address, peer);
        tune(taken);
    }
    return taken;
}

bool listener_peer(int fd, listener_peer_t *peer)
{
    struct sockaddr_storage address;
    socklen_t length = sizeof address;
    *peer = (listener_peer_t){.is_this_machine = false};
    if (getpeername(fd, (struct sockaddr *)&address, &length) != 0) {
        return false;
    }
    describe(&address, peer);
    return true;
}

bool listener_is_own(int fd, const char *host)
{
    struct sockaddr_storage own;
    socklen_t size = sizeof own;
    char text[INET6_ADDRSTRLEN] = "";
    char name[INET6_ADDRSTRLEN + 2];
    if (getsockname(fd, (struct sockaddr *)&own, &size) != 0) {
        return false;
    }
    const bool is_v6 = own.ss_family == AF_INET6;
    const void *const address = is_v6 ? (const void *)&((const struct sockaddr_in6 *)(const void *)&own)->sin6_addr
                                      : (const void *)&((const struct sockaddr_in *)(const void *)&own)->sin_addr;
    (void)inet_ntop(own.ss_family, address, text, sizeof text);
    const size_t length = (size_t)snprintf(name, sizeof name, is_v6 ? "[%s]" : "%s", text);
    return text[0] != '\0' && strncasecmp(host, name, length) == 0 && (host[length] == '\0' || host[length] == ':');
}

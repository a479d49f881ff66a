/* SPDX-License-Identifier: MIT
 * listener.h - the socket that browsers connect to. An address is what it says and nothing else: no name, no interface, and an
 * IPv6 address takes no IPv4.
 */
#ifndef HEAVE_PANEL_LISTENER_H
#define HEAVE_PANEL_LISTENER_H

#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/socket.h>

#include "panel/access.h"

/** Where to listen. */
typedef struct {
    struct sockaddr_storage address;
    socklen_t length;
    char host[ACCESS_HOST_MAX]; /**< as browsers write it: IPv6 in brackets */
    int port;
} listener_address_t;

/** Who has connected. */
typedef struct {
    char address[ACCESS_ADDRESS_MAX]; /**< IPv4 or IPv6, without port */
    bool is_this_machine;
} listener_peer_t;

/** Reads 127.0.0.1:9801 or [::1]:9801. @return false: neither */
bool listener_read(listener_address_t *self, const char *text);

/** Whether nobody but this machine gets there. */
bool listener_is_this_machine(const listener_address_t *self);

/** Listens, and reads back where.
 *  @return descriptor, not blocking; -1: it does not, and why */
int listener_open(const listener_address_t *self, char *why, size_t size);

/** Takes a connection that waits. Never blocks.
 *  @return descriptor, not blocking; -1: none waits, or it has gone, or errno says what is missing */
int listener_accept(int fd, listener_peer_t *peer);

/** Who is at the other end of a connection. @return false: nobody any more */
bool listener_peer(int fd, listener_peer_t *peer);

/** Whether a Host header, with or without a port, is the address that a connection came to, written as a number: a name of
 * somebody else's that leads here is not. */
bool listener_is_own(int fd, const char *host);

#endif

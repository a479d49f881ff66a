/* SPDX-License-Identifier: MIT
 * connections.h - connections that are no page yet: whoever they are, they are few, and the address that has most of them gives
 * way. A page that is logged in is not among them. Pure; time goes by the order of calls.
 */
#ifndef HEAVE_PANEL_CONNECTIONS_H
#define HEAVE_PANEL_CONNECTIONS_H

#include "panel/access.h"

#define CONNECTIONS_MAX 192u

/** One of them. */
typedef struct {
    void *handle;     /**< NULL: free */
    uint64_t network; /**< an IPv4 address, or the network of an IPv6 address: who has one has all addresses in it */
    uint64_t number;  /**< the older, the less */
} connection_t;

/** All; all zero: none. */
typedef struct {
    connection_t one[CONNECTIONS_MAX];
    unsigned count;
    uint64_t last;
} connections_t;

/** Where there is no place: who gives way, the oldest one of the address that has most. @return NULL: there is a place */
void *connections_give_way(const connections_t *self);

/** A connection has come; there is a place.
 *  @param handle not NULL, and not there yet
 *  @param network as connections_network() has it */
void connections_add(connections_t *self, void *handle, uint64_t network);

/** What an address, IPv4 or IPv6, counts for. */
uint64_t connections_network(const char *address);

/** It has gone, or is a page now; without effect if it is none of these. */
void connections_remove(connections_t *self, const void *handle);

#endif

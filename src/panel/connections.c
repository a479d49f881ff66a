/* SPDX-License-Identifier: MIT
 * connections.c - see connections.h.
 */
#include "panel/connections.h"

#include <arpa/inet.h>

uint64_t connections_network(const char *address)
{
    uint8_t bytes[16] = {0};
    uint64_t network = 0;
    if (inet_pton(AF_INET6, address, bytes) != 1) {
        (void)inet_pton(AF_INET, address, &bytes[4]); /* no network of IPv6 begins with four zeros */
    }
    for (unsigned i = 0; i < 8; i++) {
        network = network << 8 | bytes[i];
    }
    return network;
}

static unsigned count_of(const connections_t *self, uint64_t network)
{
    unsigned count = 0;
    for (unsigned i = 0; i < CONNECTIONS_MAX; i++) {
        count += self->one[i].handle != NULL && self->one[i].network == network;
    }
    return count;
}

void *connections_give_way(const connections_t *self)
{
    const connection_t *which = NULL;
    unsigned most = 0;
    for (unsigned i = 0; self->count == CONNECTIONS_MAX && i < CONNECTIONS_MAX; i++) {
        const connection_t *const one = &self->one[i];
        const unsigned count = count_of(self, one->network);
        if (which == NULL || count > most || (count == most && one->number < which->number)) {
            which = one;
            most = count;
        }
    }
    return which != NULL ? which->handle : NULL;
}

void connections_add(connections_t *self, void *handle, uint64_t network)
{
    for (unsigned i = 0; i < CONNECTIONS_MAX; i++) {
        connection_t *const one = &self->one[i];
        if (one->handle == NULL) {
            *one = (connection_t){.handle = handle, .network = network, .number = ++self->last};
            self->count++;
            return;
        }
    }
}

void connections_remove(connections_t *self, const void *handle)
{
    for (unsigned i = 0; i < CONNECTIONS_MAX; i++) {
        if (handle != NULL && self->one[i].handle == handle) {
            self->one[i] = (connection_t){.handle = NULL};
            self->count--;
            return;
        }
    }
}

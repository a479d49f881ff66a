/* SPDX-License-Identifier: MIT
 * owner.c - one driver at a time; see owner.h.
 */
#include "heave/owner.h"

#define TURN_US 5000000u /* a program that changes between two sockets of its own does so less often */

enum { TURNS = 3 };

/* True where the sender that drives has to give way to another one now. */
static bool gives_way(const owner_t *self, const hal_udp_peer_t *from, uint64_t silence_us, const hal_udp_networks_t *priority,
                      uint64_t busy_until_us, uint64_t now_us)
{
    const uint64_t since_us = busy_until_us > self->last_us ? busy_until_us : self->last_us;
    const bool is_silent = now_us >= since_us && now_us - since_us >= silence_us;
    return is_silent || hal_udp_rank(priority, from) < hal_udp_rank(priority, &self->peer);
}

static bool is_known_port(const owner_t *self, uint16_t port)
{
    bool is_known = false;
    for (unsigned i = 0; i < self->ports; i++) {
        is_known = is_known || self->port[i] == port;
    }
    return is_known;
}

static void keep_port(owner_t *self, uint16_t port)
{
    for (unsigned i = OWNER_PORTS - 1; i > 0; i--) {
        self->port[i] = self->port[i - 1];
    }
    self->port[0] = port;
    self->ports = (uint8_t)(self->ports + (self->ports < OWNER_PORTS));
}

/* Three times in quick succession a port that was there before: these are several programs, and the one that was there first
 * drives. Twice may be a late frame of a program that was started again, and the next one of the new program. */
static void watch_port(owner_t *self, uint16_t port, uint64_t now_us)
{
    if (self->ports > 0 && port == self->peer.port) {
        return;
    }
    if (!is_known_port(self, port)) {
        keep_port(self, port);
        self->turns = 0;
        return;
    }
    self->turns = self->turns > 0 && now_us - self->turn_us < TURN_US ? (uint8_t)(self->turns + 1) : 1;
    self->turn_us = now_us;
    self->first_port = self->turns == 1 ? port : self->first_port;
    if (self->turns == TURNS) {
        self->is_port_fixed = true;
        self->peer.port = self->first_port;
    }
}

bool owner_is_known(const owner_t *self, const hal_udp_peer_t *from)
{
    return self->is_taken && hal_udp_is_same_host(&self->peer, from) && is_known_port(self, from->port) &&
           (!self->is_port_fixed || self->peer.port == from->port);
}

owner_verdict_t owner_judge(owner_t *self, const hal_udp_peer_t *from, uint64_t silence_us, const hal_udp_networks_t *priority,
                            uint64_t busy_until_us, uint64_t now_us)
{
    const bool is_same_host = self->is_taken && hal_udp_is_same_host(&self->peer, from);
    const bool is_same_port = !self->is_port_fixed || self->peer.port == from->port;
    const bool is_same = !self->is_taken || silence_us == 0 || (is_same_host && is_same_port);
    if (!is_same && !gives_way(self, from, silence_us, priority, busy_until_us, now_us)) {
        return OWNER_OTHER;
    }
    if (!is_same_host || !is_same_port || silence_us == 0) {
        *self = (owner_t){.is_taken = true};
    }
    if (!self->is_port_fixed) {
        watch_port(self, from->port, now_us);
    }
    if (self->is_port_fixed && self->peer.port != from->port) {
        return OWNER_OTHER;
    }
    self->peer = *from;
    self->last_us = now_us;
    return is_same ? OWNER_DRIVES : OWNER_NEW;
}

/* SPDX-License-Identifier: MIT
 * owner.c - one driver at a time; see owner.h.
 */
#include "heave/owner.h"

#include "heave/sane.h"

/* True where the sender that drives has to give way to another one now. */
static bool gives_way(const owner_t *self, const hal_udp_peer_t *from, uint64_t silence_us, const hal_udp_networks_t *priority,
                      uint64_t busy_until_us, uint64_t now_us)
{
    const uint64_t since_us = busy_until_us > self->last_us ? busy_until_us : self->last_us;
    const bool is_silent = now_us >= since_us && now_us - since_us >= silence_us;
    return is_silent || hal_udp_rank(priority, from) < hal_udp_rank(priority, &self->peer);
}

owner_verdict_t owner_judge(owner_t *self, const hal_udp_peer_t *from, uint64_t silence_us, const hal_udp_networks_t *priority,
                            uint64_t busy_until_us, uint64_t now_us)
{
    const bool is_same = !self->is_taken || silence_us == 0 || hal_udp_is_same_host(&self->peer, from);
    if (!is_same && !gives_way(self, from, silence_us, priority, busy_until_us, now_us)) {
        return OWNER_OTHER;
    }
    *self = (owner_t){.is_taken = true, .peer = *from, .last_us = now_us};
    return is_same ? OWNER_DRIVES : OWNER_NEW;
}

bool owner_is_sane(const owner_t *self)
{
    return sane_bool(&self->is_taken) && sane_bool(&self->peer.is_ipv6) && sane_time(self->last_us);
}

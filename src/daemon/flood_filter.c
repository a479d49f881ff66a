/* SPDX-License-Identifier: MIT
 * flood_filter.c - which datagrams cannot be frames; see flood_filter.h.
 */
#include "daemon/flood_filter.h"

#include "heave/gateway.h"

#define FRAME_BYTES_MIN 9u /* A3:0,0,0# */

/* A sender whose port changes is known by its address alone. */
static bool is_any_port(const owner_t *owner)
{
    return owner->ports > 1 && !owner->is_port_fixed;
}

bool flood_filter_is_old(const owner_t *before, const owner_t *owner)
{
    return before->is_taken != owner->is_taken || !hal_udp_is_same_host(&before->peer, &owner->peer) ||
           is_any_port(before) != is_any_port(owner) || (!is_any_port(owner) && before->peer.port != owner->peer.port);
}

linux_udp_filter_t flood_filter_of(const config_t *config, const owner_t *owner)
{
#define WHITE                                                                                                                    \
    {                                                                                                                            \
        {                                                                                                                        \
            LINUX_UDP_SET(" \t\r\n\0")                                                                                           \
        }                                                                                                                        \
    }
    static const linux_udp_form_t k_v3[] = {
        {{LINUX_UDP_SET("@"), LINUX_UDP_SET("AC"), LINUX_UDP_SET("3467"), LINUX_UDP_SET(":T")}}, WHITE};
    static const linux_udp_form_t k_lenient[] = {
        {{LINUX_UDP_SET("@#"), LINUX_UDP_SET("ACac"), LINUX_UDP_SET("3467"), LINUX_UDP_SET(":Tt")}},
        {{LINUX_UDP_SET("ACac"), LINUX_UDP_SET("3467"), LINUX_UDP_SET(":Tt")}},
        WHITE};
#undef WHITE
    const bool is_lenient = config->settings.dialect == FRAME_LENIENT;
    return (linux_udp_filter_t){.forms = is_lenient ? k_lenient : k_v3,
                                .form_count = is_lenient ? sizeof k_lenient / sizeof k_lenient[0] : sizeof k_v3 / sizeof k_v3[0],
                                .bytes_min = FRAME_BYTES_MIN,
                                .bytes_max = GATEWAY_DATAGRAM_MAX,
                                .allow = config->udp.allow,
                                .others_one_of = owner->is_taken ? FLOOD_OTHERS_ONE_OF : 0,
                                .first = owner->peer,
                                .is_first_any_port = is_any_port(owner)};
}

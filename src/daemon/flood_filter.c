/* SPDX-License-Identifier: MIT
 * flood_filter.c - which datagrams cannot be frames; see flood_filter.h.
 */
#include "daemon/flood_filter.h"

#include "heave/gateway.h"

#define FRAME_BYTES_MIN 9u /* A3:0,0,0# */

linux_udp_filter_t flood_filter_of(const config_t *config)
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
                                .allow = config->udp.allow};
}

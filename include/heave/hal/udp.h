/* SPDX-License-Identifier: MIT
 * udp.h - contract of a bound UDP socket that only receives. Nothing is ever sent to a sender.
 * One thread calls the ops. Address, port and receive buffer are given to the backend's open.
 */
#ifndef HEAVE_HAL_UDP_H
#define HEAVE_HAL_UDP_H

#include "heave/status.h"

/** Who sent a datagram. IPv4 (also where it came in mapped into IPv6) has is_ipv6 false and uses address[0..3]; unused bytes
 *  are 0, so that two peers can be compared byte for byte. */
typedef struct {
    uint8_t address[16]; /**< network byte order */
    uint32_t scope_id;   /**< interface index of a link-local IPv6 address, else 0 */
    uint16_t port;       /**< host byte order */
    bool is_ipv6;
} hal_udp_peer_t;

/** An address or a network: the first prefix bits of address have to match. */
typedef struct {
    bool is_ipv6;
    uint8_t prefix;      /**< [0, 32], or [0, 128] for IPv6 */
    uint8_t address[16]; /**< network byte order; IPv4 uses the first four */
} hal_udp_network_t;

#define HAL_UDP_NETWORKS_MAX 16u

/** A list of networks, in order. */
typedef struct {
    uint8_t count;
    hal_udp_network_t network[HAL_UDP_NETWORKS_MAX];
} hal_udp_networks_t;

/** Holds every text of hal_udp_peer_text() with its NUL. */
#define HAL_UDP_PEER_TEXT_MAX 64u

/** recv is mandatory, the rest optional. */
typedef struct {
    hv_status_t (*recv)(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from);
    hv_status_t (*dropped)(void *ctx, uint32_t *datagrams); /* optional */
    hv_status_t (*waited)(void *ctx, uint32_t *us);         /* optional */
} hal_udp_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const hal_udp_ops_t *ops;
    void *ctx;
} hal_udp_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool hal_udp_valid(hal_udp_t udp)
{
    return udp.ops != NULL && udp.ops->recv != NULL;
}

/** Takes the oldest waiting datagram. Never blocks (<= 50 us).
 *  @param buffer   the caller's, filled before the return and not kept; a datagram may be empty (length 0)
 *  @param length   out: length of the datagram; on HV_ERR_RANGE its real length, above capacity
 *  @param from     out: its sender, also on HV_ERR_RANGE
 *  @return HV_OK; HV_ERR_AGAIN: none waiting (outputs unchanged); HV_ERR_RANGE: longer than capacity, the whole datagram is
 *          dropped and buffer is undefined; HV_ERR_IO: the socket reports an error: go on calling once a cycle, it may pass.
 *          */
static inline HV_MUST_CHECK hv_status_t hal_udp_recv(hal_udp_t udp, uint8_t *buffer, size_t capacity, size_t *length,
                                                     hal_udp_peer_t *from)
{
    return udp.ops->recv(udp.ctx, buffer, capacity, length, from);
}

/** Number of datagrams lost since the open, because the receive queue was full or a filter dropped them. At least as new as the
 * last successful recv. Never blocks.
 *  @return HV_OK; HV_ERR_NOSUP where the backend cannot know. */
static inline HV_MUST_CHECK hv_status_t hal_udp_dropped(hal_udp_t udp, uint32_t *datagrams)
{
    return udp.ops->dropped != NULL ? udp.ops->dropped(udp.ctx, datagrams) : HV_ERR_NOSUP;
}

/** Time between the arrival of the datagram of the last successful recv and that recv, in us. It is wrong if the wall clock is
 * set in between, so use it within a cycle only. More than a minute is returned as 0. Never blocks.
 *  @return HV_OK; HV_ERR_NOSUP where the backend cannot know. */
static inline HV_MUST_CHECK hv_status_t hal_udp_waited(hal_udp_t udp, uint32_t *us)
{
    return udp.ops->waited != NULL ? udp.ops->waited(udp.ctx, us) : HV_ERR_NOSUP;
}

/** "192.168.1.5:9800" or "[fe80::1%2]:9800" (shortest form, lower case). Pure.
 *  @param capacity bytes at text, at least 1; HAL_UDP_PEER_TEXT_MAX holds every text, a shorter one is cut. Always ends in
 *          NUL.
 *  @return length without NUL */
size_t hal_udp_peer_text(const hal_udp_peer_t *peer, char *text, size_t capacity);

/** "192.168.1.5" or "fe80::1%2": the address alone. Else as hal_udp_peer_text(). */
size_t hal_udp_host_text(const hal_udp_peer_t *peer, char *text, size_t capacity);

/** True for two peers with the same address. Ports are not compared: a program that restarts has another one. Pure. */
bool hal_udp_is_same_host(const hal_udp_peer_t *a, const hal_udp_peer_t *b);

/** Index of the first network the peer is in; list->count where it is in none. Pure. */
unsigned hal_udp_rank(const hal_udp_networks_t *list, const hal_udp_peer_t *peer);

#endif

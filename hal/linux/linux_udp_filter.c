/* SPDX-License-Identifier: MIT
 * linux_udp_filter.c - a filter in front of a socket's queue; see linux_udp_filter.h.
 * At a UDP socket data begin with the UDP header; the network header is reached through SKF_NET_OFF. IPv4 and IPv6 are told apart
 * by the version in it, not by the socket: one of IPv6 hears both. A load beyond the end of a datagram drops it. A share of
 * datagrams is a share of random numbers (SKF_AD_RANDOM, Linux 4.0).
 */
#include "linux_udp_filter.h"

#include <errno.h>
#include <linux/filter.h>
#include <string.h>
#include <sys/socket.h>

#define UDP_HEADER_BYTES 8u
#define IPV4_SOURCE      12u /* in its header */
#define IPV6_SOURCE      8u
#define WORDS_MAX        4u
#define PASS             UINT32_MAX /* bytes to keep: all */
#define DROP             0u

#define LENGTH_STEPS  4u
#define FORM_STEPS    (LINUX_UDP_PLACES_MAX * (LINUX_UDP_SET_MAX + 2u) + 1u)
#define FIRST_STEPS   17u
#define NETWORK_STEPS (3u + 3u * WORDS_MAX + 1u)
#define STEPS_MAX     (LENGTH_STEPS + LINUX_UDP_FORMS_MAX * FORM_STEPS + 1u + FIRST_STEPS + HAL_UDP_NETWORKS_MAX * NETWORK_STEPS + 1u)

/** A program being written. */
typedef struct {
    struct sock_filter step[STEPS_MAX];
    uint16_t count;
} program_t;

static void put(program_t *self, unsigned code, uint32_t k)
{
    self->step[self->count++] = (struct sock_filter){.code = (uint16_t)code, .k = k};
}

/* Compares what was loaded; skips so many steps behind it. */
static void put_jump(program_t *self, unsigned condition, uint32_t k, unsigned skip_if, unsigned skip_if_not)
{
    self->step[self->count++] =
        (struct sock_filter){(uint16_t)(BPF_JMP | condition | BPF_K), (uint8_t)skip_if, (uint8_t)skip_if_not, k};
}

static void put_length(program_t *self, uint32_t bytes_min, uint32_t bytes_max)
{
    put(self, BPF_LD | BPF_W | BPF_LEN, 0);
    put_jump(self, BPF_JGE, UDP_HEADER_BYTES + bytes_min, 0, 1);
    put_jump(self, BPF_JGT, UDP_HEADER_BYTES + bytes_max, 0, 1);
    put(self, BPF_RET | BPF_K, DROP);
}

static unsigned places_of(const linux_udp_form_t *form)
{
    unsigned places = 0;
    while (places < LINUX_UDP_PLACES_MAX && form->place[places].count > 0) {
        places++;
    }
    return places;
}

static uint16_t form_steps(const linux_udp_form_t *form)
{
    unsigned steps = 1;
    for (unsigned i = 0; i < places_of(form); i++) {
        steps += 2u + form->place[i].count;
    }
    return (uint16_t)steps;
}

/* Goes on to the next form at the first place that is wrong, and behind all forms where there is none. */
static void put_form(program_t *self, const linux_udp_form_t *form, unsigned end_of_forms)
{
    const unsigned next = self->count + form_steps(form);
    for (unsigned i = 0; i < places_of(form); i++) {
        const linux_udp_set_t *set = &form->place[i];
        put(self, BPF_LD | BPF_B | BPF_ABS, UDP_HEADER_BYTES + i);
        for (unsigned k = 0; k < set->count; k++) {
            put_jump(self, BPF_JEQ, (uint8_t)set->bytes[k], set->count - k, 0);
        }
        put(self, BPF_JMP | BPF_JA, next - self->count - 1u);
    }
    put(self, BPF_JMP | BPF_JA, end_of_forms - self->count - 1u);
}

static void put_forms(program_t *self, const linux_udp_filter_t *filter)
{
    unsigned end = self->count + 1u;
    for (size_t i = 0; i < filter->form_count; i++) {
        end += form_steps(&filter->forms[i]);
    }
    for (size_t i = 0; i < filter->form_count; i++) {
        put_form(self, &filter->forms[i], end);
    }
    put(self, BPF_RET | BPF_K, DROP);
}

static uint32_t word_at(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

/* The first bits of a word. */
static uint32_t mask_of(unsigned bits)
{
    return bits >= 32 ? UINT32_MAX : ~(UINT32_MAX >> bits);
}

/* Passes a datagram of the network; what comes next is done with the others. */
static void put_network(program_t *self, const hal_udp_network_t *network)
{
    const uint32_t net = (uint32_t)SKF_NET_OFF;
    const uint32_t source = net + (network->is_ipv6 ? IPV6_SOURCE : IPV4_SOURCE);
    const unsigned words = (network->prefix + 31u) / 32u;
    unsigned left = 3u * words + 1u; /* steps between a comparison and the next network */
    put(self, BPF_LD | BPF_B | BPF_ABS, net);
    put(self, BPF_ALU | BPF_AND | BPF_K, 0xF0);
    put_jump(self, BPF_JEQ, network->is_ipv6 ? 0x60 : 0x40, 0, left);
    for (unsigned i = 0; i < words; i++) {
        const uint32_t mask = mask_of(network->prefix - 32u * i);
        left -= 3u;
        put(self, BPF_LD | BPF_W | BPF_ABS, source + 4u * i);
        put(self, BPF_ALU | BPF_AND | BPF_K, mask);
        put_jump(self, BPF_JEQ, word_at(&network->address[4u * i]) & mask, 0, left);
    }
    put(self, BPF_RET | BPF_K, PASS);
}

/* Passes a datagram of the one sender; of the others goes on with one in so many. */
static void put_first(program_t *self, const linux_udp_filter_t *filter)
{
    const uint32_t net = (uint32_t)SKF_NET_OFF;
    const hal_udp_peer_t *first = &filter->first;
    const uint32_t source = net + (first->is_ipv6 ? IPV6_SOURCE : IPV4_SOURCE);
    const unsigned words = first->is_ipv6 ? WORDS_MAX : 1u;
    unsigned left = 2u * words + (filter->is_first_any_port ? 1u : 3u); /* steps between a comparison and the others */
    put(self, BPF_LD | BPF_B | BPF_ABS, net);
    put(self, BPF_ALU | BPF_AND | BPF_K, 0xF0);
    put_jump(self, BPF_JEQ, first->is_ipv6 ? 0x60 : 0x40, 0, left);
    for (unsigned i = 0; i < words; i++) {
        left -= 2u;
        put(self, BPF_LD | BPF_W | BPF_ABS, source + 4u * i);
        put_jump(self, BPF_JEQ, word_at(&first->address[4u * i]), 0, left);
    }
    if (!filter->is_first_any_port) {
        put(self, BPF_LD | BPF_H | BPF_ABS, 0);
        put_jump(self, BPF_JEQ, first->port, 0, 1);
    }
    put(self, BPF_RET | BPF_K, PASS);
    put(self, BPF_LD | BPF_W | BPF_ABS, (uint32_t)(SKF_AD_OFF + SKF_AD_RANDOM));
    put_jump(self, BPF_JGT, UINT32_MAX / filter->others_one_of, 0, 1);
    put(self, BPF_RET | BPF_K, DROP);
}

static bool are_forms_right(const linux_udp_filter_t *filter)
{
    bool is_right = filter->form_count >= 1 && filter->form_count <= LINUX_UDP_FORMS_MAX;
    for (size_t i = 0; is_right && i < filter->form_count; i++) {
        const linux_udp_form_t *form = &filter->forms[i];
        is_right = form->place[0].count > 0;
        for (unsigned k = 0; k < LINUX_UDP_PLACES_MAX; k++) {
            is_right = is_right && form->place[k].count <= LINUX_UDP_SET_MAX;
        }
    }
    return is_right;
}

static bool is_right(const linux_udp_filter_t *filter)
{
    bool is_right = are_forms_right(filter) && filter->allow.count <= HAL_UDP_NETWORKS_MAX && filter->bytes_max <= UINT16_MAX &&
                    filter->bytes_min <= filter->bytes_max;
    for (unsigned i = 0; is_right && i < filter->allow.count; i++) {
        const hal_udp_network_t *network = &filter->allow.network[i];
        is_right = network->prefix <= (network->is_ipv6 ? 128u : 32u);
    }
    return is_right;
}

hv_status_t linux_udp_filter_on(const linux_udp_t *self, const linux_udp_filter_t *filter)
{
    program_t program = {.count = 0};
    if (!is_right(filter)) {
        return HV_ERR_ARG;
    }
    put_length(&program, filter->bytes_min, filter->bytes_max);
    put_forms(&program, filter);
    if (filter->others_one_of > 0) {
        put_first(&program, filter);
    }
    for (unsigned i = 0; i < filter->allow.count; i++) {
        put_network(&program, &filter->allow.network[i]);
    }
    put(&program, BPF_RET | BPF_K, filter->allow.count == 0 ? PASS : DROP);
    const struct sock_fprog whole = {.len = program.count, .filter = program.step};
    return setsockopt(self->fd, SOL_SOCKET, SO_ATTACH_FILTER, &whole, sizeof whole) == 0 ? HV_OK : HV_ERR_IO;
}

void linux_udp_filter_off(const linux_udp_t *self)
{
    const int unused = 0;
    (void)setsockopt(self->fd, SOL_SOCKET, SO_DETACH_FILTER, &unused, sizeof unused);
}

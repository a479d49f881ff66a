/* SPDX-License-Identifier: MIT
 * modbus_ports.h - the lines of modbus_side.h: TCP servers, and pseudo terminals in the place of serial adapters. Never blocks.
 */
#ifndef HEAVE_TWIN_MODBUS_PORTS_H
#define HEAVE_TWIN_MODBUS_PORTS_H

#include <poll.h>
#include <stdio.h>

#include "twin/modbus_side.h"

#define MODBUS_PORTS_FDS_MAX (2u * MODBUS_LINES_MAX)
#define MODBUS_FRAME_MAX     264u
#define MODBUS_HELD_MAX      8u
#define MODBUS_WHY_MAX       240u

/** An answer that is late. */
typedef struct {
    uint64_t due_us;
    unsigned length;
    uint8_t bytes[MODBUS_FRAME_MAX];
} modbus_held_t;

/** A line. */
typedef struct {
    unsigned line;
    bool is_serial;
    config_host_t host;           /**< where it is TCP */
    char device[CONFIG_PATH_MAX]; /**< where it is serial: a link to the terminal, as an adapter's name is one */
    bool has_link;
    int door; /**< TCP: where masters come in; serial: the other end, kept open; -1 = closed */
    int talk; /**< the master; -1 = none */
    uint8_t heard[MODBUS_FRAME_MAX];
    unsigned length;
    uint64_t heard_us;
    unsigned helds;
    modbus_held_t held[MODBUS_HELD_MAX];
} modbus_port_t;

/** All of them. */
typedef struct {
    unsigned count;
    modbus_port_t port[MODBUS_LINES_MAX];
} modbus_ports_t;

/** Opens what the configuration names.
 *  @param is_real_allowed hosts may be others than the loopback address
 *  @param why what is wrong and what to do, where false is returned */
bool modbus_ports_open(modbus_ports_t *self, const config_t *config, bool is_real_allowed, char why[MODBUS_WHY_MAX]);

void modbus_ports_close(modbus_ports_t *self);

/** Writes where they are. */
void modbus_ports_describe(const modbus_ports_t *self, FILE *out);

/** What to wait for; returns how many. */
unsigned modbus_ports_watch(const modbus_ports_t *self, struct pollfd fds[MODBUS_PORTS_FDS_MAX]);

/** When a late answer is due; UINT64_MAX = never. */
uint64_t modbus_ports_due_us(const modbus_ports_t *self);

/** Serves who asks. */
void modbus_ports_serve(modbus_ports_t *self, modbus_side_t *side, uint64_t now_us);

#endif

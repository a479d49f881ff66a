/* SPDX-License-Identifier: MIT
 * modbus_server.h - a Modbus server made from libmodbus, in a thread of its own: on TCP at a free port of this machine, or on a
 * serial line made of a pseudo terminal. Units 1 to MODBUS_SERVER_UNITS, each with values 0 to 127 of every kind, exception 2
 * above. For tests and benchmarks: sets no limit to anything, and trusts its client.
 */
#ifndef MODBUS_SERVER_H
#define MODBUS_SERVER_H

#include <modbus.h>
#include <pthread.h>

#include "heave/status.h"

/** Units are numbered from 1. */
#define MODBUS_SERVER_UNITS 8

/** Kinds of values. */
typedef enum { MODBUS_SERVER_HOLDING, MODBUS_SERVER_INPUT, MODBUS_SERVER_COIL, MODBUS_SERVER_DISCRETE } modbus_server_bank_t;

/** A server; private. */
typedef struct {
    modbus_t *modbus;
    modbus_mapping_t *unit[MODBUS_SERVER_UNITS];
    bool is_serial;
    uint32_t character_ns;
    uint8_t is_ending;
    int listener;
    int line;
    uint32_t frames;
    uint16_t port;
    char path[64];
    pthread_t thread;
    pthread_mutex_t lock;
} modbus_server_t;

/** Listens on a free port; false where the system refuses. */
bool modbus_server_start_tcp(modbus_server_t *self);

/** Listens on a new pseudo terminal, which path then names for the client.
 *  @param bps 0 = as fast as it goes; else question and answer take the time that so many bits per second (8N1) would */
bool modbus_server_start_serial(modbus_server_t *self, uint32_t bps);

/** Ends the server: to the client the host is gone, or the adapter unplugged. */
void modbus_server_stop(modbus_server_t *self);

/** Frames that came in whole so far, of whatever unit, each fully dealt with. */
uint32_t modbus_server_frames(const modbus_server_t *self);

/** One value of a unit. */
void modbus_server_set(modbus_server_t *self, unsigned unit, modbus_server_bank_t bank, unsigned address, uint16_t value);
uint16_t modbus_server_get(modbus_server_t *self, unsigned unit, modbus_server_bank_t bank, unsigned address);

#endif

/* SPDX-License-Identifier: MIT
 * wire.h - the bus as the drives' side has it: a CAN interface, or, where the kernel has no CAN, a bus between programs (see
 * linux_can_local.h) that this one is. Never blocks.
 */
#ifndef HEAVE_TWIN_WIRE_H
#define HEAVE_TWIN_WIRE_H

#include <poll.h>

#include "heave/hal/can.h"
#include "twin/twin.h"

#define WIRE_CLIENTS_MAX 4u
#define WIRE_FDS_MAX     (WIRE_CLIENTS_MAX + 1u)
#define WIRE_WHY_MAX     240u

/** A bus. */
typedef struct {
    char name[CONFIG_NAME_MAX];
    bool is_local;
    int fd;                       /**< of the interface, or where programs come in; -1 = closed */
    int client[WIRE_CLIENTS_MAX]; /**< programs on a bus between programs; -1 = none */
    bool is_cable_out;            /**< on such a bus: nobody acknowledges */
    uint32_t refused;             /**< frames that the system did not take */
} wire_t;

/** What is done with each frame that was heard. */
typedef void (*wire_heard_t)(void *ctx, const can_frame_t *frame);

/** Opens it.
 *  @param why what is wrong and what to do, where false is returned */
bool wire_open(wire_t *self, const char *name, char why[WIRE_WHY_MAX]);

void wire_close(wire_t *self);

/** Sends a frame: a node_out_t. */
void wire_put(void *self, const can_frame_t *frame);

/** What to wait for; returns how many. */
unsigned wire_watch(const wire_t *self, struct pollfd fds[WIRE_FDS_MAX]);

/** Takes in what is there. False once the interface is gone for good. */
bool wire_hear(wire_t *self, wire_heard_t heard, void *ctx);

/** Faults of the bus: a twin_bus_t. */
bool wire_fault(void *self, bus_fault_t fault, uint32_t number, char *why, size_t size);

#endif

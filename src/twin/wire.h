/* SPDX-License-Identifier: MIT
 * wire.h - the bus as the drives' side has it: a CAN interface; where the kernel has no CAN, a bus between programs (see
 * linux_can_local.h) that this one is; or the far side of a serial adapter. Never blocks.
 */
#ifndef HEAVE_TWIN_WIRE_H
#define HEAVE_TWIN_WIRE_H

#include <poll.h>

#include "heave/hal/can.h"
#include "linux_can_frame.h"
#include "twin/slcan.h"
#include "twin/twin.h"

#define WIRE_CLIENTS_MAX 4u
#define WIRE_FDS_MAX     (WIRE_CLIENTS_MAX + 1u)
#define WIRE_WHY_MAX     240u

/** How programs get to it. */
typedef enum {
    WIRE_CAN,   /**< an interface of the kernel */
    WIRE_LOCAL, /**< a bus between programs */
    WIRE_SLCAN  /**< an adapter on a serial line, on a pseudo terminal */
} wire_kind_t;

/** A bus. */
typedef struct {
    char name[CONFIG_NAME_MAX]; /**< heaved's interface: what is done to the bus is done to it */
    char end[CONFIG_NAME_MAX];  /**< the interface that the drives are on: the same, or the other end of a pair (vxcan) */
    wire_kind_t kind;
    slcan_t slcan; /**< of WIRE_SLCAN */
    const char *adapter;
    bool is_real; /**< an interface that may lead to real drives: neither vcan nor vxcan */
    int fd;       /**< of the interface, or where programs come in; -1 = closed */
    linux_can_batch_t batch;
    int client[WIRE_CLIENTS_MAX]; /**< programs on a bus between programs; -1 = none */
    bool is_cable_out;            /**< on such a bus: nobody acknowledges */
    uint32_t refused;             /**< frames that the system did not take */
} wire_t;

/** What is done with each frame that was heard. */
typedef void (*wire_heard_t)(void *ctx, const can_frame_t *frame);

/** Opens it.
 *  @param can     heaved's interface, and rate
 *  @param end     the interface to open in its place, where that is another; NULL = none
 *  @param adapter path of an adapter on a serial line in place of the interface; NULL = none
 *  @param is_real_allowed an interface may be opened that may lead to real drives
 *  @param why what is wrong and what to do, where false is returned */
bool wire_open(wire_t *self, const config_can_t *can, const char *end, const char *adapter, bool is_real_allowed,
               char why[WIRE_WHY_MAX]);

/** Whether frames of others can be heard now. */
bool wire_is_up(const wire_t *self);

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

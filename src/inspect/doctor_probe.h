/* SPDX-License-Identifier: MIT
 * doctor_probe.h - asks the drives on a CAN bus what they are. Reads only; blocks; each answer has its time-out.
 */
#ifndef HEAVE_INSPECT_DOCTOR_PROBE_H
#define HEAVE_INSPECT_DOCTOR_PROBE_H

#include "heave/canraw.h"
#include "inspect/doctor_judge.h"
#include "linux_can.h"
#include "linux_can_local.h"

#define DOCTOR_NODES 128u

/** A bus, and what has been heard on it. */
typedef struct {
    hal_can_t bus;           /**< one of these two */
    linux_can_t can;         /**< an interface */
    linux_can_local_t local; /**< a bus between programs */
    bool is_local;
    int nmt[DOCTOR_NODES];           /**< in heartbeats, -1 = none heard */
    bool has_answered[DOCTOR_NODES]; /**< an SDO */
    bool is_synced;                  /**< somebody sends SYNC */
    doctor_wire_t wire;              /**< by doctor_probe_wire() */
} doctor_probe_t;

/** Opens the bus.
 *  @return false: doctor_probe_trouble() says why */
bool doctor_probe_open(doctor_probe_t *self, const char *interface);
void doctor_probe_close(doctor_probe_t *self);

/** What is wrong with the bus by now; NULL: nothing. */
const char *doctor_probe_trouble(const doctor_probe_t *self);

/** What became of what was sent so far. */
const doctor_wire_t *doctor_probe_wire(doctor_probe_t *self);

/** Reads the bus for so many ms and sends nothing. */
void doctor_probe_listen(doctor_probe_t *self, unsigned ms);

/** Asks all nodes at once what they are (1000h), and reads the bus for so many ms. */
void doctor_probe_call(doctor_probe_t *self, unsigned ms);

/** Whether a node has been heard. */
bool doctor_probe_is_there(const doctor_probe_t *self, unsigned node);

/** Reads a CiA 402 drive. */
void doctor_probe_node(doctor_probe_t *self, const cia402_axis_config_t *axis, unsigned timeout_ms, doctor_node_t *out);

/** Sends the position query to all drives of a map.
 *  @param is_heard out: who has sent a frame with its reply_id */
void doctor_probe_raw(doctor_probe_t *self, const canraw_map_t *map, unsigned ms, bool is_heard[DRIVES_MAX]);

#endif

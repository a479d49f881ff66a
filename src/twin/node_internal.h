/* SPDX-License-Identifier: MIT
 * node_internal.h - what the files of a simulated drive on CANopen share; see node.h.
 */
#ifndef HEAVE_TWIN_NODE_INTERNAL_H
#define HEAVE_TWIN_NODE_INTERNAL_H

#include "twin/node.h"

#define NODE_OPERATIONAL     0x05u
#define NODE_SYNCHRONOUS_MAX 240u /* transmission types up to this wait for SYNC */

/** The first axis of its node. */
node_t *node_head(node_t *self);

/** Sends a frame, unless it cannot; at once, or after a delay. */
void node_put(node_t *self, uint32_t id, const uint8_t *data, uint8_t length);
void node_put_later(node_t *self, uint32_t delay_us, uint32_t id, const uint8_t *data, uint8_t length);
void node_put_due(node_t *self);

/** SYNC for the PDOs of one axis: its TPDOs, then what it has received. */
void node_sync_pdos(node_t *self, const can_frame_t *sync, uint64_t now_us);

/** A request to its SDO server. */
void node_hear_sdo(node_t *self, const can_frame_t *frame);

/** The place of a PDO, from 1; 0: the drive has no such PDO. */
unsigned node_pdo_place(const cia402_maps_t *maps, unsigned number);

/** A frame that may be one of its RPDOs. */
void node_hear_pdo(node_t *self, const can_frame_t *frame);

/** TPDOs that tell of changes, and when the next one is due whether anything has changed or not. */
void node_put_events(node_t *self);
uint64_t node_event_due_us(const node_t *self, uint16_t n);

#endif

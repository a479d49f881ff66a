/* SPDX-License-Identifier: MIT
 * sdo.h - SDO client for one CANopen node (CiA 301): reads and writes one object at a time, expedited or in segments.
 * Owns no bus and no clock: frames and times are arguments. Drops repeated frames. A transfer without an answer is aborted, and
 * repeated after a pause of one time-out. An answer of one frame that comes in this pause still counts, so a slow node has twice
 * the time-out. Answers shorter than 8 bytes count if they have all bytes that are in use. Nothing blocks.
 */
#ifndef HEAVE_SDO_H
#define HEAVE_SDO_H

#include "heave/hal/can.h"

#define SDO_BYTES_MAX 64u /**< longest value */

/** How the transfer stands. */
typedef enum {
    SDO_IDLE,
    SDO_BUSY,
    SDO_DONE,    /**< read: value and size are valid */
    SDO_ABORTED, /**< abort_code says why: the node's, or what was wrong with its answers */
    SDO_SILENT   /**< no answer to any attempt */
} sdo_state_t;

/** Expected answer; private. */
typedef enum { SDO_AWAIT_INITIATE, SDO_AWAIT_SEGMENT } sdo_await_t;

/** A client; read state, abort_code, value and size, the rest is private. */
typedef struct {
    sdo_state_t state;
    uint32_t abort_code;
    uint8_t value[SDO_BYTES_MAX];
    uint8_t size;
    uint16_t index;
    uint8_t sub;

    uint8_t node; /* private from here on */
    uint8_t tries_left;
    bool is_read;
    bool is_toggled;
    bool is_quiet;    /* given up; the pause before the next attempt */
    bool has_request; /* waits to be sent */
    uint8_t at;       /* bytes of value that are done */
    sdo_await_t await;
    uint32_t odd_code; /* what was wrong with an answer that could not be used; 0 = there was none */
    uint8_t request[8];
    uint32_t timeout_us;
    uint64_t deadline_us;
} sdo_t;

/** @param node       [1, 127]
 *  @param timeout_us for each answer */
void sdo_init(sdo_t *self, uint8_t node, uint32_t timeout_us);

/** Begins to read an object; cancels the present transfer.
 *  @param tries at least 1 */
void sdo_read(sdo_t *self, uint16_t index, uint8_t sub, uint8_t tries);

/** Begins to write an object; cancels the present transfer.
 *  @param value copied, least significant byte first
 *  @param size  [1, SDO_BYTES_MAX]: the exact size of the object */
void sdo_write(sdo_t *self, uint16_t index, uint8_t sub, const uint8_t *value, uint8_t size, uint8_t tries);

/** Cancels the present transfer without telling the node. */
void sdo_cancel(sdo_t *self);

/** Processes a received frame with the identifier 580h + node. */
void sdo_receive(sdo_t *self, const can_frame_t *frame);

/** Checks the time-out and returns the next frame to send.
 *  @param out the frame to send now
 *  @return true if there is one. Call sdo_sent() when the bus has accepted it; otherwise it is returned again */
bool sdo_step(sdo_t *self, uint64_t now_us, can_frame_t *out);

/** Reports that the frame of sdo_step() was sent: the time-out of its answer starts. */
void sdo_sent(sdo_t *self, uint64_t now_us);

/** The value read, as an unsigned number of up to four bytes. */
uint32_t sdo_value_u32(const sdo_t *self);

#endif

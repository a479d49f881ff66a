/* SPDX-License-Identifier: MIT
 * sdo.h - SDO client for one CANopen node (CiA 301): reads and writes one object at a time, expedited or in segments.
 * Owns no bus and no clock: frames and times are arguments. Late answers and repeated frames are dropped; a transfer that gets no
 * answer is aborted, left alone for one time-out, and tried again. Nothing blocks.
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
    SDO_ABORTED, /**< abort_code says why */
    SDO_SILENT   /**< no answer to any attempt */
} sdo_state_t;

/** What is awaited; private. */
typedef enum { SDO_AWAIT_INITIATE, SDO_AWAIT_SEGMENT, SDO_AWAIT_QUIET } sdo_await_t;

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
    bool has_request; /* waits to be sent */
    uint8_t at;       /* bytes of value that are done */
    sdo_await_t await;
    uint8_t request[8];
    uint32_t timeout_us;
    uint64_t deadline_us;
} sdo_t;

/** @param node       [1, 127]
 *  @param timeout_us for each answer */
void sdo_init(sdo_t *self, uint8_t node, uint32_t timeout_us);

/** Begins to read an object; gives up what is under way.
 *  @param tries at least 1 */
void sdo_read(sdo_t *self, uint16_t index, uint8_t sub, uint8_t tries);

/** Begins to write an object; gives up what is under way.
 *  @param value copied, least significant byte first
 *  @param size  [1, SDO_BYTES_MAX]: the exact size of the object */
void sdo_write(sdo_t *self, uint16_t index, uint8_t sub, const uint8_t *value, uint8_t size, uint8_t tries);

/** Gives up what is under way, without a word to the node. */
void sdo_cancel(sdo_t *self);

/** Takes a frame with the identifier 580h + node in. */
void sdo_receive(sdo_t *self, const can_frame_t *frame);

/** Watches the time-out.
 *  @param out the frame to send now
 *  @return true where there is one; call sdo_sent() once the bus has taken it, else it is offered again */
bool sdo_step(sdo_t *self, uint64_t now_us, can_frame_t *out);

/** The frame of sdo_step() is on its way: its answer is awaited from now on. */
void sdo_sent(sdo_t *self, uint64_t now_us);

/** The value read, as an unsigned number of up to four bytes. */
uint32_t sdo_value_u32(const sdo_t *self);

#endif

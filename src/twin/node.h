/* SPDX-License-Identifier: MIT
 * node.h - a simulated drive on CANopen: NMT, heartbeats, SDO server, PDOs, SYNC, EMCY, supervised as real ones are, and what
 * goes wrong with it on purpose. Time is an argument, us.
 */
#ifndef HEAVE_TWIN_NODE_H
#define HEAVE_TWIN_NODE_H

#include "heave/cia402.h"
#include "heave/hal/can.h"
#include "twin/drive.h"
#include "twin/node_text.h"

#define NODE_WAITING_MAX 32u

/** Where frames go. */
typedef struct {
    void (*put)(void *ctx, const can_frame_t *frame);
    void *ctx;
} node_out_t;

/** A frame that waits. */
typedef struct {
    uint64_t due_us;
    can_frame_t frame;
} node_waiting_t;

/** One drive, or one of the axes of a drive. The first block is the caller's. */
typedef struct node {
    uint8_t number;     /**< node id */
    uint8_t own_number; /**< of before it was made another's; 0 = it has its own */
    uint32_t identity[4];
    uint32_t boot_us;   /**< from power to the boot-up message */
    uint32_t sdo_us;    /**< answers that late */
    uint32_t tpdo_us;   /**< after SYNC */
    uint32_t tpdo_drop; /**< so many TPDOs are lost */
    bool is_mute;       /**< hears, but says nothing */
    bool is_cut;        /**< neither hears nor says anything */
    bool is_sdo_silent;
    bool has_no_heartbeat;
    struct node *head;              /**< the first axis of its node; NULL = it is that */
    struct node *axis[OBJECT_AXES]; /**< of the first one: all axes of the node, itself first; NULL = there is none */
    uint8_t pdo_step;               /**< of the first one: PDOs from one axis to the next */
    cia402_maps_t commands;         /**< in its PDOs from the factory; none: as every drive has them */
    cia402_maps_t answers;
    bool are_maps_fixed;
    const object_t *own; /**< objects of the maker, beside those that every drive has */
    uint8_t owns;

    drive_t drive;
    node_out_t out;
    bool is_powered;
    uint8_t nmt; /**< 0 = booting */
    uint64_t boot_due_us, beat_due_us, master_due_us, sync_due_us;
    uint64_t rpdo_due_us; /**< of one RPDO that has a deadline */
    uint8_t guard_toggle; /**< of its next answer to guarding */
    uint64_t now_us;
    uint32_t pending; /**< bit N: RPDO N waits for SYNC */
    uint8_t received[OBJECT_PDOS][8];
    uint8_t rate_count[OBJECT_PDOS];
    bool is_counting[OBJECT_PDOS]; /**< TPDO N has met its SYNC start value, or needs none */
    uint8_t event_data[OBJECT_PDOS][8];
    uint64_t event_us[OBJECT_PDOS]; /**< when TPDO N told of a change last; 0 = never */
    uint16_t shown_word;            /**< statusword that it has told of by itself */
    uint32_t waits;
    node_text_t text;
    node_waiting_t waiting[NODE_WAITING_MAX];
} node_t;

/** Puts drives together into one with several axes, the first of which is itself. Before the power comes.
 *  @param axes [1, OBJECT_AXES] */
void node_join(node_t *const axis[], unsigned axes);

/** The supply. Does nothing where it is so already. */
void node_power(node_t *self, bool is_on, uint64_t now_us);

/** Starts again by itself, as after a dip of the supply. */
void node_reboot(node_t *self, uint64_t now_us);

/** Goes into an NMT state (7Fh, 05h, 04h) by itself. */
void node_enter(node_t *self, uint8_t nmt);

/** Tells an error, without becoming faulty. */
void node_emergency(node_t *self, uint16_t code, uint8_t error_register);

/** Reads a frame that another node has sent. */
void node_hear(node_t *self, const can_frame_t *frame, uint64_t now_us);

/** Advances to this time. */
void node_advance(node_t *self, uint64_t now_us);

/** When it wants to be looked at next. */
uint64_t node_due_us(const node_t *self);

#endif

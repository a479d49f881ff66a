/* SPDX-License-Identifier: MIT
 * canopen_drives.h - the CANopen drives of heave-twin on a simulated CAN bus, with what tests look at, and what they spoil on the
 * way between drive and bus. Time is an argument, us.
 */
#ifndef CANOPEN_DRIVES_H
#define CANOPEN_DRIVES_H

#include "sim_can.h"
#include "twin/node.h"

#define CANOPEN_DRIVES     7u
#define CANOPEN_DRIVES_LOG 400u

struct canopen_drives;

/** A drive. Positions are counts. */
typedef struct {
    node_t node; /**< of heave-twin: what it is, and most of what can be wrong with it */
    struct canopen_drives *owner;

    bool is_answering_late; /**< each SDO answer comes with the next request */
    bool is_restless;       /**< goes from switch on disabled to ready and back by itself while 0000h is held */
    bool is_stuck;          /**< never gets further than this state: */
    twin_state_t stuck_at;
    uint8_t tpdo_cut;     /**< bytes that its first TPDO is too short by */
    uint32_t glide_us;    /**< a quick stop takes so long; 0 = what its motor needs */
    int32_t glide_counts; /**< and goes on by these in each step of it */

    uint32_t setpoints;   /**< taken while operation was enabled, in a cyclic mode */
    int32_t largest_step; /**< of targets while operation was enabled, from the position at first */
    int32_t last_target;
    bool has_target;
    uint32_t quick_stops; /**< that a controlword began */
    uint32_t resets;      /**< faults taken back */
    uint32_t boots;
    uint64_t enabled_us, left_us; /**< operation enabled was entered, left */
    uint64_t stop_us;             /**< the last quick stop began */
    can_frame_t late;
    bool has_late;
    uint32_t log[CANOPEN_DRIVES_LOG]; /**< objects written, index << 8 | sub, in order */
    uint32_t logged;
} canopen_drive_t;

/** All of them on one controller. */
typedef struct canopen_drives {
    sim_can_t node;
    sim_can_bus_t *bus;
    uint64_t now_us;
    uint32_t syncs;
    uint8_t sync_number; /**< of the newest, where it has one */
    uint32_t heartbeats; /**< of the master */
    can_frame_t out[128];
    uint32_t outs;
    canopen_drive_t drive[CANOPEN_DRIVES];
} canopen_drives_t;

/** Puts them on the bus with power, nodes 1 to 7, at position 0. Beside what each drive has: 2030h:01 (16 bit), 2031h, and 2032h,
 *  which can only be read and is 3. Homing (17) finds its zero 500 counts below. */
void canopen_drives_open(canopen_drives_t *self, sim_can_bus_t *bus);

/** Lets bus and drives work up to now. */
void canopen_drives_step(canopen_drives_t *self, uint64_t now_us);

/** Switches a drive on or off; also for a dip of the supply. */
void canopen_drives_power(canopen_drives_t *self, unsigned drive, bool is_on);

/** It finds a fault. */
void canopen_drives_fault(canopen_drives_t *self, unsigned drive, uint16_t code);

/** Torque goes by itself, as by its enable input. */
void canopen_drives_drop(canopen_drives_t *self, unsigned drive);

/** Moves what is behind it. */
void canopen_drives_place(canopen_drives_t *self, unsigned drive, int32_t counts);

/** Where it is. */
int32_t canopen_drives_position(const canopen_drives_t *self, unsigned drive);

/** An object; NULL where it has none. */
object_t *canopen_drives_object(canopen_drives_t *self, unsigned drive, uint16_t index, uint8_t sub);

/** Makes an object that the drive shows hold a value. */
void canopen_drives_force(canopen_drives_t *self, unsigned drive, uint16_t index, uint8_t sub, uint32_t value);

#endif

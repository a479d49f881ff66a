/* SPDX-License-Identifier: MIT
 * cia402_slave.h - simulated CiA 402 drives on a simulated CAN bus, strict as the strictest real ones. Written from the
 * standards' rules alone: shares nothing with the driver under test.
 */
#ifndef CIA402_SLAVE_H
#define CIA402_SLAVE_H

#include "sim_can.h"

#define CIA402_SLAVES      7u
#define CIA402_SLAVE_TPDOS 3u
#define CIA402_SLAVE_ROWS  96u
#define CIA402_SLAVE_LOG   400u
#define CIA402_SLAVE_PLAIN 0xFFFFu

/** An object. */
typedef struct {
    uint16_t index;
    uint8_t sub;
    uint8_t bytes;
    bool is_read_only;
    bool is_missing;
    bool is_silent;   /**< nothing comes back */
    uint32_t refusal; /**< abort code for writes, 0 = none */
    uint32_t value;
    uint32_t initial;
} cia402_slave_row_t;

/** One drive. Positions are counts. */
typedef struct {
    uint8_t node;
    bool is_on;       /**< has power; use cia402_slave_power() */
    bool is_mute;     /**< hears, but says nothing */
    bool is_deaf_sdo; /**< answers no SDO */
    bool has_no_beat; /**< sends no heartbeat */
    bool is_restless; /**< goes from switch on disabled to ready and back by itself while 0000h is held */
    bool is_stuck;    /**< never gets further than this state: stuck_at */
    uint16_t stuck_at;
    bool is_homing_failing;
    bool is_answering_late;                 /**< each SDO answer comes with the next request */
    uint16_t status_set, status_clear;      /**< bits of the statusword that it shows as 1, as 0, whatever it does */
    uint8_t tpdo_cut;                       /**< bytes that its TPDOs are too short by */
    uint32_t tpdo_drop;                     /**< so many TPDOs are not sent */
    uint8_t sync_count[CIA402_SLAVE_TPDOS]; /**< since each was sent */
    bool is_counting;                       /**< the SYNC with its number has come */
    int16_t torque;                         /**< 6077h */
    int32_t lag;                            /**< 60F4h */
    uint32_t inputs;                        /**< 60FDh */
    uint32_t power_us, brake_us, homing_us; /**< how long it takes */
    uint32_t quick_us;                      /**< and a quick stop; */
    int32_t quick_counts;                   /**< it goes on by these in each step of it */
    int32_t jump_counts;                    /**< a target further away than this is a fault */

    uint8_t nmt;     /**< 0 = not booted */
    uint16_t status; /**< state bits alone */
    uint16_t target_state;
    uint64_t due_us;
    uint64_t boot_us, beat_us, master_us, homing_end_us, stop_us;
    bool is_master_watched;
    uint16_t word;
    int8_t mode;
    bool is_homing, is_homing_done, is_homing_begun;
    bool has_rpdo;
    uint8_t rpdo[8];
    bool is_pp_taken;
    int32_t position;
    int32_t target;
    int32_t last_target;
    bool has_target;
    can_frame_t late;
    bool has_late;

    uint32_t setpoints;   /**< taken while operation enabled */
    int32_t largest_step; /**< of targets while operation enabled, from actual at first */
    uint32_t quick_stops; /**< controlwords 0002h that stopped it */
    uint32_t enabled;     /**< how often operation was enabled */
    uint64_t enabled_us;
    uint64_t left_us; /**< operation enabled was left */
    uint32_t resets;  /**< faults taken back */
    uint32_t boots;
    uint32_t word_jumps; /**< controlwords that came while the last one had not acted yet */
    uint32_t aborts;     /**< SDO aborts sent */
    cia402_slave_row_t row[CIA402_SLAVE_ROWS];
    uint32_t rows;
    uint32_t log[CIA402_SLAVE_LOG]; /**< objects written, index << 8 | sub, in order */
    uint32_t logged;
} cia402_slave_drive_t;

/** All of them on one controller. */
typedef struct {
    sim_can_t node;
    sim_can_bus_t *bus;
    uint64_t now_us;
    uint64_t sync_us;
    uint32_t syncs;
    uint8_t sync_number; /**< of the newest, where it has one */
    uint32_t heartbeats; /**< of the master */
    can_frame_t out[128];
    uint32_t outs;
    cia402_slave_drive_t drive[CIA402_SLAVES];
} cia402_slave_t;

/** Puts them on the bus with power, nodes 1 to 7, at position 0. */
void cia402_slave_open(cia402_slave_t *self, sim_can_bus_t *bus);

/** Lets bus and drives work up to now. */
void cia402_slave_step(cia402_slave_t *self, uint64_t now_us);

/** Switches a drive on or off; also for a dip of the supply. */
void cia402_slave_power(cia402_slave_t *self, unsigned drive, bool is_on);

/** It finds a fault. */
void cia402_slave_fault(cia402_slave_t *self, unsigned drive, uint16_t code);

/** Torque goes by itself, as by its enable input. */
void cia402_slave_drop(cia402_slave_t *self, unsigned drive);

/** An object. */
cia402_slave_row_t *cia402_slave_row(cia402_slave_t *self, unsigned drive, uint16_t index, uint8_t sub);

#endif

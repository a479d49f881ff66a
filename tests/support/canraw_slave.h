/* SPDX-License-Identifier: MIT
 * canraw_slave.h - simulated drives with frames of their own on a simulated CAN bus, written from the bytes alone: shares nothing
 * with the driver under test. They know two dialects: the plain one of config/can-raw-hexapod.ini, which tells a position and
 * whether homing is done, and one with torque, status and stop.
 *
 *   plain: 01 05 <u32 LE counts> <u16 LE speed>   01 03 01 00 00 00 00 00 home   00 15 and 00 12 queries,
 *          answered by 00 15 <i32 LE counts> and 00 12 <1 = homed>
 *   rich (extended identifiers): 10 <i32 BE counts> set-point   20 enable   21 disable   22 stop   23 reset   24 home
 *          30 query, answered by 30 <status> <i32 BE counts>; status bits: 0 enabled, 1 fault, 2 homed
 */
#ifndef CANRAW_SLAVE_H
#define CANRAW_SLAVE_H

#include "sim_can.h"

#define CANRAW_SLAVES          7u
#define CANRAW_SLAVE_LOG       4096u
#define CANRAW_SLAVE_RICH_ZERO 4000000 /**< counts of a rich drive at its zero */

/** One drive. */
typedef struct {
    bool is_on;
    bool is_enabled; /**< rich only; a plain one always follows */
    bool is_faulty;
    bool is_homed;
    bool is_homing;
    bool is_dumb;              /**< works, but answers nothing */
    bool is_enabled_by_target; /**< rich only: a set-point puts its torque on */
    bool is_failing;           /**< never comes to the end of homing */
    bool is_stopped;           /**< has torque, and follows no target */
    uint64_t homing_us;        /**< when homing ends */
    uint64_t glide_us;         /**< when it comes to rest after a stop */
    uint64_t stale_until_us;
    int32_t target; /**< counts */
    int32_t position;
    int32_t largest_step; /**< of targets while it follows; the way to the first one included */
    uint32_t setpoints;   /**< received */
    uint32_t stops;       /**< stop frames received */
    uint16_t speed;       /**< last received */
    bool is_stuck;        /**< sealed only: its counter stands still */
    uint8_t counter_in;   /**< sealed only: of the last frame received, */
    uint32_t frames;      /**< how many came, */
    uint32_t gaps;        /**< and how often it was not one more than before */
    uint8_t counter_out;
} canraw_slave_drive_t;

/** All of them on one controller. */
typedef struct {
    sim_can_t node;
    bool is_rich;
    bool is_sealed; /**< rich, with a counter and a CRC-8 (1Dh from 0) behind each frame; set after opening */
    uint32_t homing_takes_us;
    uint32_t homing_stale_us; /**< for so long they report the last homing as done */
    bool is_holding_on_stop;  /**< rich only: a stop leaves them their torque; */
    uint32_t glide_takes_us;  /**< and for so long they go on */
    int32_t glide_counts;     /**< by these in each step */
    uint64_t now_us;
    canraw_slave_drive_t drive[CANRAW_SLAVES];
    can_frame_t log[CANRAW_SLAVE_LOG]; /**< received */
    uint32_t logged;
} canraw_slave_t;

/** Puts them on the bus, on, homed, at position 0. */
void canraw_slave_open(canraw_slave_t *self, sim_can_bus_t *bus, bool is_rich);

/** CRC-8 with the polynomial 1Dh, from 0. */
uint8_t canraw_slave_crc(const uint8_t *data, unsigned length);

/** Lets bus and drives work up to now: frames arrive, are answered, answers arrive. */
void canraw_slave_step(canraw_slave_t *self, uint64_t now_us);

#endif

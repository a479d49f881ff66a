/* SPDX-License-Identifier: MIT
 * canraw_drives.h - heave-twin's drives with frames of their own on a simulated CAN bus. What passes is read by its bytes alone
 * and compared with what the drives know: nothing of that is shared with the driver under test. Two dialects, the plain one of
 * config/can-raw-hexapod.ini, which has a position and whether homing is done, and one with torque, status and stop.
 *
 *   plain: 01 05 <u32 LE counts> <u16 LE speed>   01 03 01 00 00 00 00 00 home   00 15 and 00 12 queries,
 *          answered by 00 15 <i32 LE counts> and 00 12 <1 = homed>
 *   rich (extended identifiers): 10 <i32 BE counts> set-point   20 enable   21 disable   22 stop   23 reset   24 home
 *          30 query, answered by 30 <status> <i32 BE counts>; status bits: 0 enabled, 1 fault, 2 homed
 *   sealed: rich, with a counter and a CRC-8 (1Dh from 0) behind each frame
 */
#ifndef CANRAW_DRIVES_H
#define CANRAW_DRIVES_H

#include "sim_can.h"
#include "twin/frame_drive.h"

#define CANRAW_DRIVES_LOG       4096u
#define CANRAW_DRIVES_RICH_ZERO 4000000 /**< counts of a rich drive at its zero */

/** What one drive was sent. */
typedef struct {
    uint32_t homing_takes_us;
    uint64_t homing_us;   /**< when it began last */
    bool has_target;      /**< since homing */
    int32_t target;       /**< counts */
    int32_t largest_step; /**< of targets while it follows; the way to the first one included */
    uint32_t setpoints;   /**< received */
    uint32_t stops;
    uint16_t speed;     /**< last received */
    uint8_t counter_in; /**< sealed only: of the last frame received, */
    uint32_t frames;    /**< how many came, */
    uint32_t gaps;      /**< and how often it was not one more than before */
} canraw_sent_t;

/** All of them on one controller. */
typedef struct {
    sim_can_t node;
    canraw_map_t map; /**< what the drives know, whatever the driver's map has */
    frame_drive_t twin[DRIVES_MAX];
    motor_t motor[DRIVES_MAX];
    canraw_sent_t sent[DRIVES_MAX];
    uint32_t homing_stale_us; /**< for so long they report the last homing as done; plain only */
    bool is_holding_on_stop;  /**< rich only: a stop leaves them their torque; */
    uint32_t glide_takes_us;  /**< and for so long they go on, at 18 mm/s */
    uint64_t now_us;
    can_frame_t log[CANRAW_DRIVES_LOG]; /**< received */
    uint32_t logged;
} canraw_drives_t;

/** Puts them on the bus, on, homed, at position 0.
 *  @param map canraw_maps_plain(), or those of the other dialects */
void canraw_drives_open(canraw_drives_t *self, sim_can_bus_t *bus, canraw_map_t map);

/** Where a drive stands, counts. */
void canraw_drives_place(canraw_drives_t *self, unsigned k, int32_t counts);

/** A command to a drive that nobody sees. */
void canraw_drives_command(canraw_drives_t *self, unsigned k, canraw_command_t command);

/** CRC-8 with the polynomial 1Dh, from 0. */
uint8_t canraw_drives_crc(const uint8_t *data, unsigned length);

/** Lets bus and drives work up to now: frames arrive, are answered, answers arrive. */
void canraw_drives_step(canraw_drives_t *self, uint64_t now_us);

#endif

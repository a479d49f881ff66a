/* SPDX-License-Identifier: MIT
 * frame_drive.h - a simulated drive with CAN frames of its own, made from the configuration's map read backwards: it takes the
 * frames that heaved sends, and sends those that heaved reads. Drives that share a reply are one device: what one of them
 * does to it happens to all. Time is an argument, us.
 */
#ifndef HEAVE_TWIN_FRAME_DRIVE_H
#define HEAVE_TWIN_FRAME_DRIVE_H

#include "heave/canraw.h"
#include "twin/motor.h"
#include "twin/node.h" // node_out_t, node_waiting_t

#define FRAME_DRIVE_WAITING 16u

typedef enum { FRAME_DRIVE_OFF, FRAME_DRIVE_TORQUE, FRAME_DRIVE_HOMING, FRAME_DRIVE_FAULT } frame_drive_state_t;

/** One drive. The first block is what is made to fail; counts are of replies. */
typedef struct frame_drive {
    bool is_mute;          /**< hears, but says nothing */
    bool is_cut;           /**< neither */
    bool is_deaf;          /**< answers, but acts on nothing */
    bool is_broken;        /**< the cause of its fault stays */
    bool is_homing_broken; /**< homing ends with an error */
    bool is_stuck;         /**< its alive counter stands still */
    bool is_torque_kept;   /**< a fault leaves it its torque until that is taken from it */
    uint32_t late_us;
    uint32_t lost, damaged;

    const canraw_map_t *map;
    const canraw_axis_map_t *axis;
    motor_t *motor;
    node_out_t out;
    struct frame_drive *all; /**< the drives of the map, in their order, where some share frames; NULL: it shares none */
    double home;             /**< where it finds its zero, raw counts */
    double usual_speed;      /**< counts/s, of a stop and of homing */

    bool is_powered;
    unsigned steps; /**< of starting up that it got; before the last of them it says and does nothing else */
    frame_drive_state_t state;
    frame_drive_state_t before_homing;
    uint32_t fault_code; /**< 0 = none */
    bool is_absolute;    /**< its zero survives the supply, whatever the map has for homing */
    bool is_homed, has_homing_failed;
    double origin; /**< raw counts of its zero */
    uint64_t boot_us;
    uint64_t send_us; /**< when it tells its position next, where nobody asks */
    uint64_t now_us;
    uint32_t set_points;
    uint32_t counter;
    uint64_t status_us; /**< when it tells its status next, where that comes apart */
    uint32_t status_counter;
    uint32_t waits;
    node_waiting_t waiting[FRAME_DRIVE_WAITING];
} frame_drive_t;

/** Why drives of such a map cannot be simulated, or NULL. */
const char *frame_drive_refusal(const canraw_map_t *map);

/** Makes one; it has no power yet. motor, home and usual_speed are the caller's.
 *  @param map kept */
void frame_drive_init(frame_drive_t *self, const canraw_map_t *map, unsigned axis, node_out_t out);

/** Power comes or goes; whatever is wrong with it stays wrong. */
void frame_drive_power(frame_drive_t *self, bool is_on, uint64_t now_us);

/** Finds a fault. */
void frame_drive_fault(frame_drive_t *self, uint32_t code);

/** Loses its torque by itself. */
void frame_drive_drop(frame_drive_t *self);

/** A frame on the bus. */
void frame_drive_hear(frame_drive_t *self, const can_frame_t *frame, uint64_t now_us);

/** Has torque. */
bool frame_drive_is_enabled(const frame_drive_t *self);

/** Position in its own counts. */
int64_t frame_drive_count(const frame_drive_t *self);

/** Lives up to now. */
void frame_drive_advance(frame_drive_t *self, uint64_t now_us);

/** When it wants to be looked at next. */
uint64_t frame_drive_due_us(const frame_drive_t *self);

#endif

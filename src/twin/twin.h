/* SPDX-License-Identifier: MIT
 * twin.h - the outside of a configuration: its drives on their bus, and the mechanism that they move. What is wrong between the
 * two is a setting: which drive is on which leg, which runs backwards, whose scale is another. Time is an argument, us.
 */
#ifndef HEAVE_TWIN_TWIN_H
#define HEAVE_TWIN_TWIN_H

#include "config/config.h"
#include "heave/drives.h"
#include "heave/kin.h"
#include "twin/frame_drive.h"
#include "twin/lines.h"
#include "twin/modbus_side.h"
#include "twin/node.h"

/** What the drives are on. */
typedef enum {
    TWIN_DRIVES_CIA402, /**< CANopen */
    TWIN_DRIVES_FRAMES, /**< CAN, frames of their own */
    TWIN_DRIVES_MODBUS,
    TWIN_DRIVES_NONE /**< heaved simulates the drives itself; heave-twin has only the GPIO lines */
} twin_drives_t;

/** How the machine was put together. */
typedef struct {
    uint8_t leg_of[DRIVES_MAX]; /**< leg that each drive moves */
    bool is_reversed[DRIVES_MAX];
    double lead[DRIVES_MAX];        /**< travel per turn, as factor of that in the configuration */
    double zero_counts[DRIVES_MAX]; /**< error of the encoder */
    double start_mm;                /**< extension of all legs */
    double lag_ms, friction_mm, load_mm;
    double ambient_c; /**< temperature round the motors */
    bool is_homed;    /**< the drives know their zero, like absolute encoders, also if the configuration has homing */
} twin_settings_t;

/** Faults of the whole bus. */
typedef enum {
    BUS_OFF,
    BUS_PASSIVE,
    BUS_ACTIVE,
    BUS_STORM,
    BUS_CABLE_OUT,
    BUS_CABLE_IN,
    BUS_FULL,
    BUS_DOWN,
    BUS_UP,
    BUS_UNPLUG,
    BUS_PLUG,
    BUS_RELAYS_SILENT,
    BUS_RELAYS_FORGET,
    BUS_RELAYS_BACK,
    BUS_SWITCH, /**< of GPIO lines */
    BUS_CHIP_GONE,
    BUS_CHIP_BACK
} bus_fault_t;

/** Who makes them. act returns false where it cannot, and says why. */
typedef struct {
    bool (*act)(void *ctx, bus_fault_t fault, uint32_t number, char *why, size_t size);
    void *ctx;
    bool has_adapter; /**< on a serial line, which can be unplugged */
} twin_bus_t;

/** Another master, which commands one of the drives. */
typedef struct {
    unsigned drive;
    uint64_t due_us;   /**< its next frame */
    uint64_t until_us; /**< the last one; 0 = there is none */
} other_master_t;

/** The outside. */
typedef struct {
    twin_drives_t kind;
    unsigned drives;
    unsigned cylinders;
    canraw_map_t frame_map;
    frame_drive_t frame[DRIVES_MAX];            /**< of TWIN_DRIVES_FRAMES */
    object_t own[DRIVES_MAX][CIA402_ITEMS_MAX]; /**< what their start-up lists name */
    node_t node[DRIVES_MAX];                    /**< the motors are here, whatever the bus */
    modbus_side_t modbus;                       /**< drives, and a board of relays, on Modbus */
    uint8_t leg_of[DRIVES_MAX];
    double zero[DRIVES_MAX];     /**< raw counts of a drive at 0 u */
    double per_unit[DRIVES_MAX]; /**< raw counts per u as it really is */
    kin_t kin;
    pose_t pose; /**< the last that was found */
    bool has_pose;
    uint64_t enabled_us; /**< all had torque for the first time; 0 = not yet */
    node_out_t out;      /**< the bus */
    other_master_t other;
    twin_bus_t bus;
    lines_t *lines; /**< of the caller; NULL = there are none */
} twin_t;

/** Everything as it should be. */
void twin_settings_init(twin_settings_t *self, const config_t *config);

/** What the drives of a configuration are on. */
twin_drives_t twin_kind(const config_t *config);

/** Whether a configuration can be simulated here. Returns NULL, or why not and what to do. */
const char *twin_refusal(const config_t *config, const lines_t *lines);

/** Switches everything on. */
void twin_start(twin_t *self, const config_t *config, const twin_settings_t *settings, node_out_t out, uint64_t now_us);

/** A frame on the bus. */
void twin_hear(twin_t *self, const can_frame_t *frame, uint64_t now_us);

/** Lives up to now. */
void twin_advance(twin_t *self, uint64_t now_us);

/** When it wants to be looked at next. */
uint64_t twin_due_us(const twin_t *self);

/** Where a drive is, mm or deg, as it really is. */
double twin_position(const twin_t *self, unsigned drive);

/** The pose that the legs give; false where there is none. */
bool twin_find_pose(twin_t *self, pose_t *out);

#endif

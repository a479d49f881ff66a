/* SPDX-License-Identifier: MIT
 * register_drive.h - a simulated drive on Modbus, made from the configuration's map read backwards: what heaved writes, it takes;
 * what heaved reads, it shows. Knows no line. Time is an argument, us.
 */
#ifndef HEAVE_TWIN_REGISTER_DRIVE_H
#define HEAVE_TWIN_REGISTER_DRIVE_H

#include "heave/modbus_drive.h"
#include "twin/motor.h"

#define REGISTER_DRIVE_MAX 256u /* registers of a drive */

typedef enum { REGISTER_OFF, REGISTER_TORQUE, REGISTER_HOMING, REGISTER_FAULT } register_state_t;

/** Exception codes of the standard. */
enum { MODBUS_NO_EXCEPTION, MODBUS_NO_FUNCTION, MODBUS_NO_ADDRESS, MODBUS_NO_VALUE };

/** A register that the map names. */
typedef struct {
    uint16_t address;
    uint16_t value;
    bool is_held; /**< takes nothing, whoever writes it */
} register_cell_t;

/** One drive. The first block is what is made to fail; counts are of answers. */
typedef struct {
    bool is_mute;          /**< hears, but says nothing */
    bool is_cut;           /**< neither */
    bool is_deaf;          /**< answers, but acts on nothing */
    bool is_broken;        /**< the cause of its fault stays */
    bool is_homing_broken; /**< homing ends with an error */
    bool is_torque_kept;   /**< a fault leaves it its torque until that is taken from it */
    uint32_t late_us;
    uint32_t lost, damaged, halved, refused;
    uint8_t exception; /**< of those that are refused */

    const modbus_drive_map_t *map;
    const modbus_drive_axis_map_t *axis;
    motor_t *motor;
    double home;          /**< where it finds its zero, raw counts */
    double usual_speed;   /**< counts/s where the map has no speed */
    uint32_t watchdog_us; /**< it stops by itself when it has heard nothing for so long */

    bool is_powered;
    register_state_t state;
    uint32_t alarm;   /**< 0 = none */
    bool is_absolute; /**< its zero survives the supply, whatever the map has for homing */
    bool is_homed, has_homing_failed;
    double origin; /**< raw counts of its zero */
    double target, speed;
    bool has_target;
    uint64_t boot_us, heard_us;
    uint32_t set_points;
    uint8_t step[MODBUS_DRIVE_COMMANDS]; /**< blocks of that command which have come */
    uint16_t count;
    register_cell_t reg[REGISTER_DRIVE_MAX];
} register_drive_t;

/** Why drives of such a map cannot be simulated, or NULL. */
const char *register_drive_refusal(const modbus_drive_map_t *map);

/** Makes one; it has no power yet. motor, home and usual_speed are the caller's.
 *  @param map kept */
void register_drive_init(register_drive_t *self, const modbus_drive_map_t *map, unsigned axis);

/** Power comes or goes; whatever is wrong with it stays wrong. */
void register_drive_power(register_drive_t *self, bool is_on, uint64_t now_us);

/** Has started and hears. */
bool register_drive_is_there(const register_drive_t *self, uint64_t now_us);

/** Finds a fault. */
void register_drive_fault(register_drive_t *self, uint32_t alarm);

/** Loses its torque by itself. */
void register_drive_drop(register_drive_t *self);

/** Registers were written, or read. Returns an exception. */
int register_drive_write(register_drive_t *self, uint16_t address, const uint16_t *value, unsigned count, uint64_t now_us);
int register_drive_read(register_drive_t *self, uint16_t address, uint16_t *value, unsigned count);

/** The register that holds that, whatever is written; NULL where it has none. */
register_cell_t *register_drive_find(register_drive_t *self, uint16_t address);

/** Position in its own counts. */
int32_t register_drive_count(const register_drive_t *self);

/** Lives up to now. */
void register_drive_advance(register_drive_t *self, uint64_t now_us);

#endif

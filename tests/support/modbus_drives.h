/* SPDX-License-Identifier: MIT
 * modbus_drives.h - heave-twin's drives on simulated Modbus lines. What they are asked is read by its registers alone: nothing of
 * that is shared with the driver under test. Two dialects:
 *
 *   wide: holding registers  0 control (0 torque off, 1 torque on, 2 stop, 4 home, 8 reset)  1 status (bit 0 torque, 1 fault,
 *         2 homed)  2, 3 position, high half first  4 alarm  10, 11 target, high half first  12 speed  20 watchdog [ms]
 *         21 kind = 0x0203
 *   small: holding registers 100 target, signed  101 torque on  102 stop  103 reset; input registers 110 position, signed
 *         111 status (bit 3 torque, bit 7 fault)
 */
#ifndef MODBUS_DRIVES_H
#define MODBUS_DRIVES_H

#include "sim_modbus.h"
#include "twin/register_drive.h"

#define MODBUS_DRIVES_WIDE_ZERO 4000000 /**< counts of a wide drive at its zero */
#define MODBUS_DRIVES_ALARM     0x0E21u

/** What one drive was asked. */
typedef struct {
    bool is_weak;         /**< never gets torque */
    int32_t target;       /**< counts; 0 before the first one */
    bool is_homed_since;  /**< it stands where it was homed, whatever the target */
    int32_t largest_step; /**< of targets while it has torque; the way to the first one included */
    uint32_t targets;     /**< changes of the target while it has torque */
    uint32_t stops;
    uint16_t speed;
} modbus_asked_t;

/** All of them, on one line or on a line each. */
typedef struct {
    bool is_small;
    bool is_shared;
    bool is_holding_on_stop; /**< a stop leaves them their torque; */
    uint32_t glide_takes_us; /**< and for so long they go on, at about 20 mm/s */
    modbus_drive_map_t map;  /**< what the drives know, whatever the driver's map has */
    uint64_t now_us;
    sim_modbus_t line[DRIVES_MAX];
    sim_modbus_device_t device[DRIVES_MAX];
    register_drive_t twin[DRIVES_MAX];
    motor_t motor[DRIVES_MAX];
    modbus_asked_t asked[DRIVES_MAX];
} modbus_drives_t;

/** On, homed, at position 0. Units are 1 to 7 on one line, and 1 on lines of their own. */
void modbus_drives_open(modbus_drives_t *self, bool is_small, bool is_shared, uint32_t transaction_us, uint32_t timeout_us);

/** The lines as the driver wants them. */
void modbus_drives_lines(modbus_drives_t *self, hal_modbus_t line[DRIVES_MAX]);

/** Where a drive stands, counts. */
void modbus_drives_place(modbus_drives_t *self, unsigned k, int32_t counts);

/** A command to a drive that nobody sees. */
void modbus_drives_command(modbus_drives_t *self, unsigned k, modbus_drive_command_t command);

/** A drive that is off has no torque and hears nothing; it knows where it is. */
void modbus_drives_power(modbus_drives_t *self, unsigned k, bool is_on);

/** What a register of a drive holds. */
uint16_t modbus_drives_register(modbus_drives_t *self, unsigned k, uint16_t address);

/** Lets lines and drives work up to now. */
void modbus_drives_step(modbus_drives_t *self, uint64_t now_us);

#endif

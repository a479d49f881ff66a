/* SPDX-License-Identifier: MIT
 * modbus_slave.h - simulated drives on simulated Modbus lines, written from a register list alone: shares nothing with the driver
 * under test. Two dialects:
 *
 *   wide: holding registers  0 control (0 torque off, 1 torque on, 2 stop, 4 home, 8 reset)  1 status (bit 0 torque, 1 fault,
 *         2 homed)  2, 3 position, high half first  4 alarm  10, 11 target, high half first  12 speed  20 watchdog [ms]
 *         21 kind = 0x0203
 *   small: holding registers 100 target, signed  101 torque on  102 stop  103 reset; input registers 110 position, signed
 *         111 status (bit 3 torque, bit 7 fault)
 */
#ifndef MODBUS_SLAVE_H
#define MODBUS_SLAVE_H

#include "heave/modbus_drive.h"
#include "sim_modbus.h"

#define MODBUS_SLAVES          7u
#define MODBUS_SLAVE_WIDE_ZERO 4000000 /**< counts of a wide drive at its zero */

/** One drive. */
typedef struct {
    bool is_on;
    bool is_enabled;
    bool is_faulty;
    bool is_homed;
    bool is_homing;
    bool is_weak;       /**< never gets torque */
    bool is_frozen;     /**< answers, but does not move */
    bool is_target_set; /**< since torque went on, or before */
    bool is_stopped;    /**< has torque, and follows no target */
    uint64_t homing_us; /**< when homing ends */
    uint64_t glide_us;  /**< when it comes to rest after a stop */
    int32_t target;     /**< counts */
    int32_t position;
    int32_t largest_step; /**< of targets while it has torque; the way to the first one included */
    uint32_t targets;     /**< changes of the target register while it has torque */
    uint32_t stops;
    uint16_t speed;
} modbus_slave_drive_t;

/** All of them, on one line or on a line each. */
typedef struct {
    bool is_small;
    bool is_shared;
    uint8_t unit;
    bool is_holding_on_stop; /**< a stop leaves them their torque; */
    uint32_t glide_takes_us; /**< and for so long they go on */
    int32_t glide_counts;    /**< by these in each step */
    sim_modbus_t line[MODBUS_SLAVES];
    sim_modbus_device_t device[MODBUS_SLAVES];
    modbus_slave_drive_t drive[MODBUS_SLAVES];
} modbus_slave_t;

/** On, homed, at position 0. Units are 1 to 7 on one line, and 1 on lines of their own. */
void modbus_slave_open(modbus_slave_t *self, bool is_small, bool is_shared, uint32_t transaction_us, uint32_t timeout_us,
                       const sim_modbus_fault_t *plan, uint32_t planned);

/** The lines as the driver wants them. */
void modbus_slave_lines(modbus_slave_t *self, hal_modbus_t line[DRIVES_MAX]);

/** Where a drive stands, told by its registers at once. */
void modbus_slave_place(modbus_slave_t *self, unsigned k, int32_t position);

/** Lets lines and drives work up to now. */
void modbus_slave_step(modbus_slave_t *self, uint64_t now_us);

#endif

/* SPDX-License-Identifier: MIT
 * modbus_drive.h - driver for drives on Modbus (TCP or RTU). A map defines the registers.
 * The caller owns modbus_drive_t; only the motion thread calls it (drives.h). Nothing here waits: the driver submits transactions
 * to the workers of the lines (hal/modbus.h) and collects the results later.
 *
 * Each drive has one slot of its line for writes and one for reads. A new set-point replaces one that still waits, and a command
 * replaces any set-point. So nothing old is sent, and there is no queue.
 *
 * Slow lines: motion makes one set-point per cycle, but a drive gets only one per period T of its line. T is measured.
 *   pace       a set-point moves by at most `carry` per T of the slowest drive; all axes move by the same share of their distance
 *   smoothing  the value written is the mean of all set-points since the last one written, that is, a mean over T
 *   speed      the speed register gets the distance since the last set-point, divided by T, plus an eighth. So a drive arrives
 *              just before the next set-point; it neither stops in between nor falls behind
 */
#ifndef HEAVE_MODBUS_DRIVE_H
#define HEAVE_MODBUS_DRIVE_H

#include "heave/canraw.h" /* canraw_when_t: a condition on a status is the same everywhere */
#include "heave/counts.h"
#include "heave/drives.h"
#include "heave/hal/modbus.h"
#include "heave/quick_stop.h"

#define MODBUS_DRIVE_REGISTERS_MAX 16u /**< of a block */
#define MODBUS_DRIVE_FIELDS_MAX    4u
#define MODBUS_DRIVE_BLOCKS_MAX    4u
#define MODBUS_DRIVE_STARTUP_MAX   24u
#define MODBUS_DRIVE_SLOTS         16u /**< of each line, from 0: the others are free for relays */

/** What a field carries. */
typedef enum {
    MODBUS_DRIVE_POSITION, /**< counts: the set-point, or where read actual */
    MODBUS_DRIVE_SPEED,    /**< of set-points only */
    MODBUS_DRIVE_STATUS,   /**< read only */
    MODBUS_DRIVE_ALARM     /**< read only: the drive's own code, 0 = none */
} modbus_drive_value_t;

#define MODBUS_DRIVE_VALUES 4u

/** A field: one register, or two that make one number. */
typedef struct {
    modbus_drive_value_t value;
    uint8_t at;        /**< first register, from the block's address */
    uint8_t registers; /**< 1 or 2 */
    bool is_signed;
    bool is_low_first; /**< of two, the one with the lower half comes first */
} modbus_drive_field_t;

/** Registers that follow each other, moved by one transaction: constants and fields; where read, the rest may be anything. */
typedef struct {
    uint16_t address; /**< of the first, from 0 */
    uint8_t count;
    uint8_t fields;
    uint16_t any; /**< bit i: register i is neither constant nor field; read blocks only */
    uint16_t data[MODBUS_DRIVE_REGISTERS_MAX];
    modbus_drive_field_t field[MODBUS_DRIVE_FIELDS_MAX];
} modbus_drive_block_t;

/** Blocks that are moved one after the other; none where count is 0. */
typedef struct {
    uint8_t count;
    modbus_drive_block_t block[MODBUS_DRIVE_BLOCKS_MAX];
} modbus_drive_blocks_t;

/** A register value that a drive needs before it is ready. */
typedef struct {
    uint16_t address;
    uint16_t value;
    bool is_written; /**< false: only compared */
    bool is_checked; /**< read back */
} modbus_drive_item_t;

/** Commands other than set-points: blocks of constants, each optional. */
typedef enum {
    MODBUS_DRIVE_STOP,
    MODBUS_DRIVE_DISABLE,
    MODBUS_DRIVE_RESET,
    MODBUS_DRIVE_ENABLE,
    MODBUS_DRIVE_HOME
} modbus_drive_command_t;

#define MODBUS_DRIVE_COMMANDS 5u

/** One drive. Unit u: mm, or deg of the rotation motor. */
typedef struct {
    uint8_t line; /**< index of its line, [0, DRIVES_MAX) */
    uint8_t unit; /**< [1, 247], or 255 on TCP; different on one line */
    counts_scale_t scale;
    counts_scale_t speed;    /**< speed field per u/s */
    q32_t step_max_q32;      /**< largest step of set-points, u per motion cycle; > 0 */
    q32_t speed_max_q32;     /**< largest value of the speed field, u/s; > 0 */
    q32_t carry_q32;         /**< largest step between set-points that are written, u; 0 = no limit */
    q32_t following_max_q32; /**< largest distance of a set-point from actual, u; 0 = not watched */
} modbus_drive_axis_map_t;

/** The whole map. */
typedef struct {
    uint8_t axes;         /**< [1, DRIVES_MAX] */
    bool is_input;        /**< feedback is read from input registers, else from holding registers */
    bool is_single;       /**< blocks of one register are written by function 6, else by 16 */
    bool is_broadcast;    /**< the first block of a stop goes to all drives of a line at once, then the stop to each */
    bool is_target_last;  /**< the target is written after torque is on, because writing it starts the drive; false: before */
    uint32_t period_us;   /**< shortest time between two set-points and two reads of a drive; > 0 */
    uint32_t expected_us; /**< period to assume before it is measured; > 0 */
    uint32_t feedback_timeout_us;   /**< a drive is lost if its newest feedback is older; > period_us */
    uint8_t retries;                /**< failures in a row that are tolerated */
    uint32_t speed_least;           /**< smallest value of the speed field */
    modbus_drive_blocks_t setpoint; /**< has a position, may have a speed */
    modbus_drive_blocks_t feedback; /**< has a position, may have status and alarm */
    modbus_drive_blocks_t command[MODBUS_DRIVE_COMMANDS];
    canraw_when_t enabled_when; /**< of the status */
    canraw_when_t fault_when;   /**< of the status; without it an alarm that is not 0 is a fault */
    canraw_when_t homing_done;
    canraw_when_t homing_failed;
    uint8_t items;
    modbus_drive_item_t item[MODBUS_DRIVE_STARTUP_MAX]; /**< in this order, at every start of a drive */
    modbus_drive_axis_map_t axis[DRIVES_MAX];
} modbus_drive_map_t;

/** Phase of a drive. */
typedef enum {
    MODBUS_DRIVE_WAITING,    /**< for its line, or for its answer; it is asked twice a second */
    MODBUS_DRIVE_STARTING,   /**< torque off, then the items one by one */
    MODBUS_DRIVE_REFUSED,    /**< an item has a wrong value; starts again after two seconds, or by a reset */
    MODBUS_DRIVE_READY,      /**< no torque */
    MODBUS_DRIVE_PLACING,    /**< its target is being set to where it is */
    MODBUS_DRIVE_ENABLING,   /**< the enable blocks are being written */
    MODBUS_DRIVE_CONFIRMING, /**< waits for feedback that is newer, and says that torque is on */
    MODBUS_DRIVE_HOLDING,    /**< has torque, and waits for the other drives */
    MODBUS_DRIVE_ENABLED,
    MODBUS_DRIVE_HOMING,
    MODBUS_DRIVE_FAULT
} modbus_drive_phase_t;

/** Problem of a drive. Alarms and statuses of the drive itself have its own numbers. */
typedef enum {
    MODBUS_DRIVE_NO_TROUBLE,
    MODBUS_DRIVE_NO_LINK = 0x10001, /**< no connection, or no serial port */
    MODBUS_DRIVE_NO_ANSWER,
    MODBUS_DRIVE_DAMAGED,   /**< answers that are broken, or not to the question */
    MODBUS_DRIVE_EXCEPTION, /**< answers with an exception */
    MODBUS_DRIVE_VALUE,     /**< an item has a wrong value */
    MODBUS_DRIVE_OLD,       /**< the newest feedback is too old */
    MODBUS_DRIVE_FOLLOWING, /**< found here: a set-point too far from the last one, or from actual */
    MODBUS_DRIVE_HOMING_FAILED
} modbus_drive_trouble_t;

/** Present write job; private. */
typedef enum {
    MODBUS_DRIVE_NO_JOB,
    MODBUS_DRIVE_JOB_STARTUP,
    MODBUS_DRIVE_JOB_COMMAND,
    MODBUS_DRIVE_JOB_SETPOINT
} modbus_drive_job_t;

/** A slot of a line; private. Tags count transactions: results below `first` belong to finished jobs and are ignored. */
typedef struct {
    bool is_out;
    uint8_t failures; /**< in a row */
    uint32_t tag;     /**< of the newest */
    uint32_t first;
} modbus_drive_slot_t;

/** State of one drive; private. Times are those of poll. */
typedef struct {
    modbus_drive_phase_t phase;
    modbus_drive_job_t job;
    modbus_drive_command_t command;
    modbus_drive_slot_t write;
    modbus_drive_slot_t read;
    uint8_t step;      /**< of the job: block or item */
    uint8_t read_step; /**< block of the feedback */
    bool is_checking;  /**< the item is being read back */
    bool is_broadcast; /**< the stop goes to all drives of the line first; whichever slot has its turn carries it */
    bool is_homed;
    bool is_after_homing; /**< placed once more, torque is on */
    bool is_placed;       /**< the target was set to the actual position when following was last requested */
    bool is_homing_seen;
    bool is_energized; /**< torque was on or requested, and the drive has not confirmed since that it is off */
    bool has_actual;
    bool has_sent;     /**< asked_q32 is valid */
    bool is_fresh;     /**< there is a newer set-point than the one submitted last */
    uint8_t exception; /**< of the trouble */
    uint16_t object;   /**< register of the trouble, or of the item */
    uint32_t trouble;  /**< modbus_drive_trouble_t, or the drive's own code */
    uint32_t status;
    uint32_t alarm;
    uint16_t got[MODBUS_DRIVE_BLOCKS_MAX][MODBUS_DRIVE_REGISTERS_MAX];
    int64_t actual_counts;
    q32_t actual_q32;
    uint64_t actual_us;
    int64_t target_counts; /**< values for the set-point blocks */
    int64_t target_speed;
    q32_t asked_q32; /**< last set-point of the motion */
    q32_t paced_q32; /**< after pacing */
    int64_t sum_q32; /**< of paced_q32 since the last one written */
    uint32_t sums;
    q32_t offered_q32;    /**< newest mean */
    q32_t written_q32;    /**< position that was confirmed last */
    uint32_t period_us;   /**< T, smoothed */
    uint64_t setpoint_us; /**< last confirmed; 0 = none */
    uint64_t due_us;      /**< of the next set-point */
    uint64_t next_read_us;
    uint64_t read_us;        /**< when the present read of the feedback began */
    uint64_t mark_us;        /**< only feedback that began later counts */
    uint64_t reset_until_us; /**< 0: no reset in progress */
    uint64_t reset_asked_us; /**< a reset waits for the end of a stop since then; 0: none does */
    quick_stop_t quick_stop; /**< `stop` was written or will be; `disable` follows */
    drive_guard_t guard;
    uint64_t since_us; /**< of the phase */
    uint64_t trouble_us;
} modbus_drive_axis_t;

/** The drives of a platform. Members are private, except the counters. */
typedef struct {
    const modbus_drive_map_t *map;
    hal_modbus_t line[DRIVES_MAX];
    uint64_t now_us;
    uint64_t sent_us;   /**< last send; 0 = none */
    uint32_t setpoints; /**< confirmed, of all drives */
    uint32_t failures;  /**< transactions that failed */
    uint32_t paced;     /**< cycles in which the line was slower than the motion */
    bool is_one_by_one; /**< the newest request was to a single drive */
    modbus_drive_axis_t axis[DRIVES_MAX];
} modbus_drive_t;

/** Starts; sends nothing yet. Drives are OFFLINE until they have been started up.
 *  @param map  kept
 *  @param line one for each index that the map uses; copied
 *  @return HV_OK; HV_ERR_ARG: no usable line; HV_ERR_RANGE: the map contradicts itself or its ranges above. */
hv_status_t modbus_drive_init(modbus_drive_t *self, const modbus_drive_map_t *map,
                              const hal_modbus_t line[DRIVES_MAX]) HV_MUST_CHECK;

/** The implementation of drives.h. send never returns HV_ERR_AGAIN: the newest set-point wins. */
drives_t modbus_drive_hal(modbus_drive_t *self);

/** Range of a field's values. */
int64_t modbus_drive_field_min(const modbus_drive_field_t *field);
int64_t modbus_drive_field_max(const modbus_drive_field_t *field);

/** The first field that carries a value.
 *  @param block out: its block; may be NULL
 *  @return NULL where there is none */
const modbus_drive_field_t *modbus_drive_find(const modbus_drive_blocks_t *blocks, modbus_drive_value_t value, unsigned *block);

/** Writes a block's registers.
 *  @return HV_OK; HV_ERR_RANGE: a value does not fit its field, out is unchanged */
hv_status_t modbus_drive_pack(const modbus_drive_block_t *block, const int64_t value[MODBUS_DRIVE_VALUES],
                              uint16_t out[MODBUS_DRIVE_REGISTERS_MAX]) HV_MUST_CHECK;

/** Value of a field in the registers of its block. */
int64_t modbus_drive_extract(const modbus_drive_field_t *field, const uint16_t *registers);

/** Timing of a line. */
typedef struct {
    uint32_t bitrate_bps;   /**< of RTU; 0: TCP, where bytes take no time */
    uint8_t bits_per_char;  /**< with start, parity and stop bits */
    uint32_t turnaround_us; /**< from the end of a question to the beginning of its answer */
} modbus_drive_timing_t;

/** Duration of a transaction, including the silence after it (RTU: 3.5 characters, at least 1.75 ms above 19,200 bit/s).
 *  @param count registers */
uint32_t modbus_drive_transaction_us(const modbus_drive_timing_t *timing, modbus_function_t function, unsigned count);

/** Time until every drive of a line has received a set-point and has been read.
 *  @param drives on that line */
uint32_t modbus_drive_round_us(const modbus_drive_map_t *map, const modbus_drive_timing_t *timing, unsigned drives);

#endif

/* SPDX-License-Identifier: MIT
 * modbus_drive.h - drives on Modbus (TCP or RTU): a map says what the registers mean, this driver does the rest.
 * The caller owns modbus_drive_t; the motion thread alone calls it (drives.h). Nothing here waits: transactions are handed to the
 * workers of the lines (hal/modbus.h), and looked at later.
 *
 * A drive is written through one slot of its line and read through another one. Where a set-point still waits for its turn, the
 * newest one replaces it, and a command replaces any set-point: nothing old is ever sent, and nothing queues up.
 *
 * What a slow line can carry: set-points come once per motion cycle, a drive gets one per period T of its line, which is
 * measured. pace       set-points move no faster than carry per T of the slowest drive, all axes by the same share of their way
 *   smoothing  what is written is the mean of the set-points since the last one that was written: a mean over T
 *   speed      the speed register gets the way since the last one, divided by T, and an eighth more, so that a drive arrives
 *              just before the next set-point and neither stops between them nor falls behind
 */
#ifndef HEAVE_MODBUS_DRIVE_H
#define HEAVE_MODBUS_DRIVE_H

#include "heave/canraw.h" /* canraw_when_t: a condition on a status is the same everywhere */
#include "heave/counts.h"
#include "heave/drives.h"
#include "heave/hal/modbus.h"

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

/** What a register has to hold before a drive counts as ready. */
typedef struct {
    uint16_t address;
    uint16_t value;
    bool is_written; /**< else only looked at */
    bool is_checked; /**< read back */
} modbus_drive_item_t;

/** What a drive can be told beside set-points; blocks of constants, each optional. */
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
    q32_t speed_max_q32;     /**< what the speed field carries at most, u/s; > 0 */
    q32_t carry_q32;         /**< largest way of a set-point that is written, u; 0 = as the motion has it */
    q32_t following_max_q32; /**< largest distance of a set-point from actual, u; 0 = not watched */
} modbus_drive_axis_map_t;

/** The whole map. */
typedef struct {
    uint8_t axes;                   /**< [1, DRIVES_MAX] */
    bool is_input;                  /**< feedback is read from input registers, else from holding registers */
    bool is_single;                 /**< blocks of one register are written by function 6, else by 16 */
    bool is_broadcast;              /**< the first block of a stop goes to all drives of a line at once, then the stop to each */
    bool is_target_last;            /**< a drive is placed after it has torque, as writing its target starts it; else before */
    uint32_t period_us;             /**< set-points and reads of a drive are no closer; > 0 */
    uint32_t expected_us;           /**< period to assume before it is measured; > 0 */
    uint32_t feedback_timeout_us;   /**< a drive whose newest feedback is older is gone; > period_us */
    uint8_t retries;                /**< failures in a row that are borne */
    uint32_t speed_least;           /**< what the speed field carries at least */
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

/** Where a drive stands. */
typedef enum {
    MODBUS_DRIVE_WAITING,    /**< for its line, or for its answer; asked twice a second */
    MODBUS_DRIVE_STARTING,   /**< torque off, then the items one by one */
    MODBUS_DRIVE_REFUSED,    /**< an item is not as it has to be; begins again after two seconds, or by a reset */
    MODBUS_DRIVE_READY,      /**< no torque */
    MODBUS_DRIVE_PLACING,    /**< its target is being set to where it is */
    MODBUS_DRIVE_ENABLING,   /**< the enable blocks are being written */
    MODBUS_DRIVE_CONFIRMING, /**< waits for feedback that is newer, and says that torque is on */
    MODBUS_DRIVE_HOLDING,    /**< has torque, and waits for the other drives */
    MODBUS_DRIVE_ENABLED,
    MODBUS_DRIVE_HOMING,
    MODBUS_DRIVE_FAULT
} modbus_drive_phase_t;

/** What is or was wrong with a drive; its own alarms and statuses are numbers of its own. */
typedef enum {
    MODBUS_DRIVE_NO_TROUBLE,
    MODBUS_DRIVE_NO_LINK = 0x10001, /**< no connection, or no serial port */
    MODBUS_DRIVE_NO_ANSWER,
    MODBUS_DRIVE_DAMAGED,   /**< answers that are broken, or not to the question */
    MODBUS_DRIVE_EXCEPTION, /**< it answers that it will not */
    MODBUS_DRIVE_VALUE,     /**< an item does not hold what it has to */
    MODBUS_DRIVE_OLD,       /**< the newest feedback is too old */
    MODBUS_DRIVE_FOLLOWING, /**< found here: a set-point too far from the last one, or from actual */
    MODBUS_DRIVE_HOMING_FAILED
} modbus_drive_trouble_t;

/** What is being written; private. */
typedef enum {
    MODBUS_DRIVE_NO_JOB,
    MODBUS_DRIVE_JOB_STARTUP,
    MODBUS_DRIVE_JOB_COMMAND,
    MODBUS_DRIVE_JOB_SETPOINT
} modbus_drive_job_t;

/** A slot of a line; private. Tags count transactions: results below `first` are of something that is over. */
typedef struct {
    bool is_out;
    uint8_t failures; /**< in a row */
    uint32_t tag;     /**< of the newest */
    uint32_t first;
} modbus_drive_slot_t;

/** One drive at work; private. Times are those of poll. */
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
    bool is_reset_due; /**< asked for while a stop was on its way */
    bool is_homed;
    bool is_after_homing; /**< placed once more, torque is on */
    bool is_placed;       /**< the target is where the drive was when it was last asked to follow */
    bool is_homing_seen;
    bool is_energized; /**< torque was on or asked for, and that it is off has not been confirmed since */
    bool has_actual;
    bool has_sent;     /**< asked_q32 is the last set-point that came */
    bool is_fresh;     /**< a set-point has come since the last was handed over */
    uint8_t exception; /**< of the trouble */
    uint16_t object;   /**< register of the trouble, or of the item */
    uint32_t trouble;  /**< modbus_drive_trouble_t, or the drive's own code */
    uint32_t status;
    uint32_t alarm;
    uint16_t got[MODBUS_DRIVE_BLOCKS_MAX][MODBUS_DRIVE_REGISTERS_MAX];
    int64_t actual_counts;
    q32_t actual_q32;
    uint64_t actual_us;
    int64_t target_counts; /**< what set-point blocks carry */
    int64_t target_speed;
    q32_t asked_q32; /**< last set-point of the motion */
    q32_t paced_q32; /**< what the line can carry of it */
    int64_t sum_q32; /**< of paced_q32 since the last one written */
    uint32_t sums;
    q32_t offered_q32;    /**< mean that was handed over last */
    q32_t written_q32;    /**< mean that was confirmed last */
    uint32_t period_us;   /**< T, smoothed */
    uint64_t setpoint_us; /**< last confirmed; 0 = none */
    uint64_t due_us;      /**< of the next set-point */
    uint64_t next_read_us;
    uint64_t read_us;        /**< the feedback that is being read was begun */
    uint64_t mark_us;        /**< feedback has to be begun after that */
    uint64_t reset_until_us; /**< 0: no reset goes on */
    drive_guard_t guard;
    uint64_t since_us; /**< of the phase */
    uint64_t trouble_us;
} modbus_drive_axis_t;

/** The drives of a platform; private but for the counters. */
typedef struct {
    const modbus_drive_map_t *map;
    hal_modbus_t line[DRIVES_MAX];
    uint64_t now_us;
    uint64_t sent_us;   /**< last send; 0 = none */
    uint32_t setpoints; /**< confirmed, of all drives */
    uint32_t failures;  /**< transactions that failed */
    uint32_t paced;     /**< cycles in which the line was slower than the motion */
    modbus_drive_axis_t axis[DRIVES_MAX];
} modbus_drive_t;

/** Starts; sends nothing yet. Drives are OFFLINE until they have been started up.
 *  @param map  kept
 *  @param line one for each index that the map uses; copied
 *  @return HV_OK; HV_ERR_ARG: no usable line; HV_ERR_RANGE: the map contradicts itself or its ranges above. */
hv_status_t modbus_drive_init(modbus_drive_t *self, const modbus_drive_map_t *map,
                              const hal_modbus_t line[DRIVES_MAX]) HV_MUST_CHECK;

/** The drives as drives.h wants them. send never says HV_ERR_AGAIN: the newest set-point wins. */
drives_t modbus_drive_hal(modbus_drive_t *self);

/** True where no drive is still to be written something that stops, resets or starts it: at the end, polls lead there. */
bool modbus_drive_is_told(const modbus_drive_t *self);

/** Range of a field's values. */
int64_t modbus_drive_field_min(const modbus_drive_field_t *field);
int64_t modbus_drive_field_max(const modbus_drive_field_t *field);

/** The first field that carries something.
 *  @param block out: its block; may be NULL
 *  @return NULL where there is none */
const modbus_drive_field_t *modbus_drive_find(const modbus_drive_blocks_t *blocks, modbus_drive_value_t value, unsigned *block);

/** Writes a block's registers.
 *  @return HV_OK; HV_ERR_RANGE: a value does not fit its field, out is unchanged */
hv_status_t modbus_drive_pack(const modbus_drive_block_t *block, const int64_t value[MODBUS_DRIVE_VALUES],
                              uint16_t out[MODBUS_DRIVE_REGISTERS_MAX]) HV_MUST_CHECK;

/** Value of a field in the registers of its block. */
int64_t modbus_drive_extract(const modbus_drive_field_t *field, const uint16_t *registers);

/** How long things take on a line. */
typedef struct {
    uint32_t bitrate_bps;   /**< of RTU; 0: TCP, where bytes take no time */
    uint8_t bits_per_char;  /**< with start, parity and stop bits */
    uint32_t turnaround_us; /**< from the end of a question to the beginning of its answer */
} modbus_drive_timing_t;

/** How long a transaction takes with the silence behind it (RTU: 3.5 characters, at least 1.75 ms above 19,200 bit/s).
 *  @param count registers */
uint32_t modbus_drive_transaction_us(const modbus_drive_timing_t *timing, modbus_function_t function, unsigned count);

/** How long it takes until every drive of a line has had a set-point and told where it is.
 *  @param drives on that line */
uint32_t modbus_drive_round_us(const modbus_drive_map_t *map, const modbus_drive_timing_t *timing, unsigned drives);

#endif

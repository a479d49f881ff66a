/* SPDX-License-Identifier: MIT
 * cia402_objects.h - every object that is written to or checked in a drive, in order: one constant table.
 */
#ifndef CIA402_OBJECTS_H
#define CIA402_OBJECTS_H

#include "heave/cia402.h"

/** What is done with an object. */
typedef enum {
    CIA402_WRITE,          /**< written; "read only" is no trouble, a later row checks */
    CIA402_SET,            /**< written and read back */
    CIA402_CHECK,          /**< read and compared */
    CIA402_HAS,            /**< read; 0, or has at least the bits of the value */
    CIA402_LISTED,         /**< sub is the length of a list that is empty or has the value */
    CIA402_AWAIT,          /**< read until it holds the value */
    CIA402_PDO_OFF,        /**< bit 31 of the COB-ID set, the rest as it is */
    CIA402_PDO_ON,         /**< COB-ID with bit 31 clear and bit 30 as it is, read back */
    CIA402_READ,           /**< read */
    CIA402_PREOPERATIONAL, /**< no object: the drive's heartbeat says pre-operational */
    CIA402_PAUSE,          /**< no object: so long that the slowest drive has seen what was written last */
    CIA402_SKIP,           /**< nothing */
    CIA402_PDO,            /**< no object: stands for the rows that set up PDO `constant` of the axis (cia402_pdo()) */
    CIA402_LIST            /**< no object: stands for the items of the start-up list whose is_last is `constant` */
} cia402_deed_t;

/** What follows from a refusal. */
typedef enum {
    CIA402_MUST,        /**< the drive cannot be used */
    CIA402_IF_THERE,    /**< nothing */
    CIA402_IF_ANSWERED, /**< nothing where it is missing; else the drive cannot be used */
    CIA402_GUARD        /**< the drive would not stop by itself: refused unless the configuration allows that */
} cia402_need_t;

/** Which configurations a row is for. */
typedef enum {
    CIA402_ALWAYS,
    CIA402_IF_FIRST,  /**< once for a node, whatever its channels */
    CIA402_IF_CYCLIC, /**< CSP and IP */
    CIA402_IF_IP,
    CIA402_IF_PP,
    CIA402_IF_HOMING,
    CIA402_IF_NONZERO,   /**< where the value is not 0 */
    CIA402_IF_HEARTBEAT, /**< likewise, where heartbeats are sent */
    CIA402_IF_GUARDED,   /**< likewise, where nodes are guarded instead */
    CIA402_IF_IDENTITY,
    CIA402_IF_COUNTER,
    CIA402_IF_LIMITED,
    CIA402_IF_OWN_RECORD,     /**< not where the record is that of another channel */
    CIA402_IF_SUPPORT,        /**< where it is checked what the drive supports */
    CIA402_IF_STANDARD_HOMING /**< the same, of methods of the standard */
} cia402_when_t;

/** Where a value comes from. */
typedef enum {
    CIA402_CONSTANT,
    CIA402_IDENTITY, /**< constant: which */
    CIA402_CONSUMER,
    CIA402_HEARTBEAT,   /**< time from one to the next, or between two requests of guarding */
    CIA402_LIFE_FACTOR, /**< for the guard time that the drive has */
    CIA402_SYNC_PERIOD,
    CIA402_COUNTER,
    CIA402_ABORT_OPTION,
    CIA402_WINDOW,
    CIA402_WINDOW_TIME,
    CIA402_POSITION_LIMIT, /**< constant: which */
    CIA402_QUICK_STOP_ACCEL,
    CIA402_PERIOD_VALUE,
    CIA402_PERIOD_EXPONENT,
    CIA402_HOMING_METHOD,
    CIA402_HOMING_SPEED, /**< constant: which */
    CIA402_HOMING_ACCEL,
    CIA402_HOMING_OFFSET,
    CIA402_PROFILE_SPEED,
    CIA402_PROFILE_ACCEL,
    CIA402_MODE,
    CIA402_MODE_BITS, /**< as 6502h has them */
    CIA402_ITEM       /**< of the start-up list */
} cia402_source_t;

/** One row, in bytes: an enumeration may take four. */
typedef struct {
    uint32_t constant;
    uint32_t trouble; /**< cia402_trouble_t where it fails */
    uint16_t index;
    uint8_t sub;
    uint8_t bytes;
    uint8_t deed;   /**< cia402_deed_t */
    uint8_t need;   /**< cia402_need_t */
    uint8_t when;   /**< cia402_when_t */
    uint8_t source; /**< cia402_source_t */
} cia402_object_t;

extern const cia402_object_t cia402_objects[];

/** The rows: the first is the one that asks whether anybody is there; the modes' rows come last of those for setting up. */
extern const uint8_t cia402_objects_setup_end;
extern const uint8_t cia402_objects_mode_begin;
extern const uint8_t cia402_objects_error_begin;
extern const uint8_t cia402_objects_reset_begin; /**< where the row that reads an error ends */
extern const uint8_t cia402_objects_end;

/** The row that a job is at; of a list, the item; with the index that the object has in the channel of the axis. */
cia402_object_t cia402_objects_at(const cia402_config_t *config, const cia402_axis_config_t *axis, const cia402_setup_t *setup);

/** True where the row means something for this drive. */
bool cia402_object_applies(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis);

/** What the object shall hold.
 *  @param setup for values read before, and the mode */
uint32_t cia402_object_value(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis,
                             const cia402_setup_t *setup);

/** Goes to the next row, or to the next item. */
void cia402_objects_next(const cia402_config_t *config, const cia402_axis_config_t *axis, cia402_setup_t *setup);

/** Bits of the object that are compared. */
uint32_t cia402_object_mask(const cia402_object_t *row);

/** True where a guard holds another value than we wrote, but is on, and soon enough. */
bool cia402_object_is_guarding(const cia402_object_t *row, const cia402_config_t *config, const cia402_setup_t *setup,
                               uint32_t value);

/** True where a watchdog of the gateway would take more than twice the time that it has to take. */
bool cia402_object_is_late(const cia402_object_t *row, const cia402_config_t *config, const cia402_setup_t *setup,
                           uint32_t value);

/** Period as 60C2h has it: value * 10^exponent seconds.
 *  @return false where it cannot be had */
bool cia402_period_parts(uint32_t period_us, uint8_t *value, int8_t *exponent);

#endif

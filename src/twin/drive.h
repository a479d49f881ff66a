/* SPDX-License-Identifier: MIT
 * drive.h - a simulated CiA 402 drive behind its bus: states, modes of operation, set-points, homing, and what it looks after by
 * itself. Knows no bus; what it has to tell it puts into emergency. Time is an argument, us.
 */
#ifndef HEAVE_TWIN_DRIVE_H
#define HEAVE_TWIN_DRIVE_H

#include "twin/motor.h"
#include "twin/objects.h"
#include "twin/quirks.h"

/** Bits 0 to 3, 5 and 6 of the statusword. */
typedef enum {
    TWIN_NOT_READY = 0x00,
    TWIN_DISABLED = 0x40,
    TWIN_READY = 0x21,
    TWIN_ON = 0x23,
    TWIN_ENABLED = 0x27,
    TWIN_QUICK_STOP = 0x07,
    TWIN_REACTION = 0x0F,
    TWIN_FAULT = 0x08
} twin_state_t;

typedef enum { HOMING_NO, HOMING_RUNNING, HOMING_DONE, HOMING_FAILED } drive_homing_t;

#define DRIVE_NEVER UINT64_MAX

/** One drive. The first block is the caller's; times in us. */
typedef struct {
    uint32_t switch_on_us;
    uint32_t brake_us;
    uint32_t jump_counts;  /**< a set-point further away than this is a following error at once */
    uint8_t missed_max;    /**< so many SYNCs without a set-point are a fault; 0 = never */
    double home;           /**< where it finds its zero, raw counts */
    double home_other;     /**< likewise, by the homing method of the other direction */
    uint8_t home_method;   /**< that leads to home, as in 6098h */
    bool is_absolute;      /**< the position survives the supply */
    bool is_deaf;          /**< answers, but acts on nothing */
    bool is_broken;        /**< the cause of its fault stays */
    bool is_homing_broken; /**< homing ends with an error */
    uint32_t quirks;       /**< quirk_t */
    uint16_t bits_set;     /**< of the statusword, whatever it does */
    uint16_t bits_clear;

    objects_t od;
    motor_t motor;
    double origin; /**< raw counts of the drive's zero */
    twin_state_t state;
    twin_state_t next_state;
    uint64_t state_due_us;
    uint64_t stop_due_us;
    twin_state_t stop_state; /**< entered when the stop is over */
    uint64_t mode_due_us;
    uint64_t reset_due_us; /**< of a drive that takes long for it */
    int8_t mode, next_mode;
    uint16_t word;
    bool is_ip_active, is_pp_taken, has_set_point, has_start;
    drive_homing_t homing;
    uint64_t lag_since_us; /**< DRIVE_NEVER: it follows */
    uint64_t sync_us, sync_period_us;
    uint64_t now_us;
    uint8_t silent_syncs; /**< without a set-point */
    uint8_t odd_syncs;    /**< too early or too late */
    uint16_t emergency;   /**< to be told; 0 = nothing */
    uint8_t emergency_register;
    bool is_emergency_over; /**< to be told: no error any more */
    uint32_t set_points;    /**< taken */
    uint32_t enabled;       /**< how often */
} drive_t;

/** Power comes: not ready, holding where the motor is. */
void drive_start(drive_t *self, uint64_t now_us);

/** Position in the drive's own counts. */
int32_t drive_count(const drive_t *self);

/** Finds a fault. */
void drive_fault(drive_t *self, uint16_t code);

/** Loses its torque by itself. */
void drive_drop(drive_t *self);

/** What it was controlled by is gone: 6007h. */
void drive_connection_lost(drive_t *self);

/** A controlword, from SDO or PDO. */
void drive_control(drive_t *self, uint16_t word);

/** 6060h was written. Returns an SDO abort code, 0 = taken. */
uint32_t drive_choose_mode(drive_t *self, int8_t mode);

/** A SYNC; set-points of this period have been applied. */
void drive_sync(drive_t *self, uint64_t now_us);

/** Lives up to now; brings the objects that show it up to date. */
void drive_advance(drive_t *self, uint64_t now_us);

/** When something happens by itself next. */
uint64_t drive_due_us(const drive_t *self);

/** Has torque. */
bool drive_is_enabled(const drive_t *self);

#endif

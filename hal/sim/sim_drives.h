/* SPDX-License-Identifier: MIT
 * sim_drives.h - simulated drives: each axis a first-order lag with states, homing, travel, following error, and a fault plan.
 * Integer arithmetic only, driven by the times of poll: the same calls give the same bits on every CPU.
 * The caller owns sim_drives_t; one thread.
 */
#ifndef SIM_DRIVES_H
#define SIM_DRIVES_H

#include "heave/drives.h"

/** Code of a fault that the drive finds by itself: the set-point is too far away (the number CANopen drives use). */
#define SIM_DRIVES_FOLLOWING_ERROR 0x8611u

/** Every axis of an entry. */
#define SIM_DRIVES_ALL 0xFFu

/** One axis. Unit u is mm, or deg for the rotation motor. */
typedef struct {
    q32_t start_q32;      /**< true position at the start, u, within the travel */
    q32_t travel_min_q32; /**< the mechanical stops, u */
    q32_t travel_max_q32;
    uint32_t time_constant_us; /**< lag behind the set-points; 0 = none */
    uint32_t enable_us;        /**< from the request to ENABLED */
    q32_t home_q32;            /**< where homing finds the zero switch, u, within the travel */
    q32_t homing_per_s_q32;    /**< homing speed, u/s; 0 = finds it at once */
    q32_t unhomed_offset_q32;  /**< what actual is wrong by until the axis is homed, u */
    q32_t step_max_q32;        /**< a set-point further than this from the one before is a following error, u; 0 = not watched */
    q32_t lag_max_q32;         /**< a set-point further than this from actual is one, u; 0 = not watched */
    bool is_homed;             /**< after power-up (absolute encoder) */
    bool is_enabled;           /**< at the start: for runs that begin SETTLED */
} sim_drive_config_t;

/** What goes wrong. */
typedef enum {
    SIM_DRIVES_FAULT,   /**< the drive stops in FAULT with `code`; can be reset at once */
    SIM_DRIVES_BROKEN,  /**< the same, but the cause stays until RECOVER: resets do nothing */
    SIM_DRIVES_OFFLINE, /**< the drive loses power where it is; after RECOVER it starts anew, not enabled. With every axis off,
                           the bus is gone */
    SIM_DRIVES_FREEZE,  /**< it answers and watches its lag, but neither moves nor takes requests */
    SIM_DRIVES_STALE,   /**< it works, but nothing new is heard of it */
    SIM_DRIVES_BUSY,    /**< the bus takes nothing: send and request return HV_ERR_AGAIN (axis does not matter) */
    SIM_DRIVES_RECOVER  /**< ends all of the above that it is in */
} sim_drives_fault_kind_t;

/** One entry of a plan: happens once, at the first poll that is at least the at_step-th and not before at_us. */
typedef struct {
    sim_drives_fault_kind_t kind;
    uint8_t axis;     /**< from 0, or SIM_DRIVES_ALL */
    uint32_t code;    /**< fault kinds: the device's code */
    uint32_t at_step; /**< number of the poll, from 1 (0 as 1) */
    uint64_t at_us;
} sim_drives_fault_t;

/** Most entries of a plan. */
#define SIM_DRIVES_PLAN_MAX 64u

/** One axis at work; private, but tests may read it. */
typedef struct {
    drive_state_t state; /**< of the drive itself, never DRIVE_OFFLINE */
    q32_t position_q32;  /**< true position */
    q32_t setpoint_q32;  /**< in force, in the drive's own (perhaps wrong) zero */
    bool has_setpoint;   /**< setpoint_q32 was heard from the gateway: it counts when ENABLED begins, however old it is */
    bool is_begun;       /**< the request that led to this state has been seen in a poll */
    bool is_homed;
    bool is_offline;
    bool is_broken;
    bool is_frozen;
    bool is_stale;
    uint32_t fault_code;
    uint64_t enabled_us;       /**< when ENABLING ends */
    uint32_t following_errors; /**< out: found so far */
    q32_t step_largest_q32; /**< out: largest step of the set-points while ENABLED, the one onto actual after enabling included */
    drive_feedback_t feedback; /**< last heard */
} sim_drive_t;

/** The drives of a platform; private but for the counters. */
typedef struct {
    const sim_drive_config_t *config;
    const sim_drives_fault_t *plan;
    uint32_t planned;
    bool is_planned_done[SIM_DRIVES_PLAN_MAX];
    uint8_t count;
    bool is_busy;
    bool has_time;
    uint64_t now_us;
    uint32_t polls;
    uint32_t sends;   /**< taken */
    uint32_t refused; /**< not taken: busy or gone */
    sim_drive_t axis[DRIVES_MAX];
} sim_drives_t;

/** Powers the drives up.
 *  @param config kept; count entries
 *  @param plan   kept; NULL where planned is 0
 *  @return HV_OK; HV_ERR_RANGE: count outside [1, DRIVES_MAX], planned above SIM_DRIVES_PLAN_MAX, a negative or impossible
 *          figure. */
hv_status_t sim_drives_init(sim_drives_t *self, uint8_t count, const sim_drive_config_t *config, const sim_drives_fault_t *plan,
                            uint32_t planned) HV_MUST_CHECK;

/** Offline runs that go on from elsewhere: the drives are where they were, and do what they did.
 *  @param feedback last heard of each of them at now_us
 *  @param setpoint_q32 in force */
void sim_drives_place(sim_drives_t *self, uint64_t now_us, const drive_feedback_t feedback[DRIVES_MAX],
                      const q32_t setpoint_q32[DRIVES_MAX]);

/** Makes something go wrong now; at_step and at_us are ignored. */
void sim_drives_inject(sim_drives_t *self, const sim_drives_fault_t *fault);

/** The drives as drives.h wants them. */
drives_t sim_drives_hal(sim_drives_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * telemetry.h - the complete visible state of a running platform as one plain struct per cycle.
 * The motion thread fills it; readers get copies. It has no pointers, except to constant texts.
 */
#ifndef HEAVE_TELEMETRY_H
#define HEAVE_TELEMETRY_H

#include "heave/axes.h"
#include "heave/drives.h"
#include "heave/fault.h"
#include "heave/frame.h"
#include "heave/mask_guard.h"
#include "heave/owner.h"
#include "heave/plate.h"
#include "heave/service.h"
#include "heave/stream.h"
#include "heave/supervisor.h"
#include "heave/wear.h"

/** A machine fault. */
typedef struct {
    fault_code_t code;
    uint8_t axis;         /**< 1-based: cylinder, or cylinders + 1 for the rotation motor; 0 where none is concerned */
    uint32_t device_code; /**< the drive's own code */
    uint64_t at_us;
    q32_t off_q32;     /**< distance that heaved found [mm, deg], */
    q32_t allowed_q32; /**< and the allowed distance; 0: the fault has no distance */
} fault_t;

/** Counters since the start; they wrap. */
typedef struct {
    uint32_t datagrams;
    uint32_t oversize; /**< datagrams longer than the buffer */
    uint32_t receive_errors;
    uint32_t accepted[FRAME_COMMANDS];
    uint32_t accepted_timed; /**< of those, T forms */
    uint32_t rejected[FRAME_ERRORS];
    uint32_t other_sender;   /**< valid frames of senders other than the driving one */
    uint32_t owner_changes;  /**< take-overs by another sender */
    uint32_t not_followed;   /**< accepted while the platform was not ENGAGED */
    uint32_t impossible;     /**< extensions that no pose has, or only one near a singularity */
    uint32_t singular_stops; /**< stops before a singularity on the way from one set of extensions to another */
    uint32_t spikes;         /**< samples of a stream that the spike filter dropped (spike_filter.h) */
    uint32_t unconfirmed;    /**< far jumps that no second frame confirmed (confirm.h) */
    uint32_t clamped;        /**< cycles that pulled a target in */
    uint32_t stretched;      /**< timed moves that took longer than asked */
    uint32_t relay_missing;  /**< masks that set a relay this platform does not have */
    uint32_t relay_errors;   /**< cycles that could not write the mask */
    uint32_t relay_cut;      /**< relays opened because they were closed for max_on_ms */
    uint32_t relay_delayed;  /**< changes of relays that had to wait for min_toggle_ms */
    uint32_t faults;
    uint32_t fault[FAULT_CODES]; /**< of those, by code */
    uint32_t late_cycles;        /**< cycles skipped because the program was late */
} counters_t;

/** State of one cycle. Extensions mm, angle deg, Q32. */
typedef struct {
    uint64_t cycle;
    uint64_t now_us;
    state_t state;
    state_t goal;
    state_t interrupted; /**< by the last hold */
    bool is_held_by_silence;
    bool is_estop_active;
    bool is_power_failing;
    bool is_healthy;                     /**< the healthy pulse runs, or would run if it had a line */
    fault_t fault;                       /**< the first one since the last reset */
    drive_report_t fault_report;         /**< report of its drive at that time; "" if the fault concerns no drive */
    fault_reaction_t reaction;           /**< the worst of them */
    uint64_t fault_last_us[FAULT_CODES]; /**< last beginning of each fault, 0 = never */
    uint32_t begun[DRIVES_MAX + 1u];     /**< faults that began in this cycle, by axis as in fault_t: bit N for fault_code_t N */
    uint8_t cylinders;
    bool has_angle;
    uint8_t relay_count;
    uint16_t relay_mask;
    bool is_relays_unknown; /**< they could not be written or read back: relay_mask is the requested mask */
    bool has_received;
    q16_t received_q16[POSE_AXES]; /**< the newest pose that was followed, as it stood in its frame */
    pose_t asked;
    pose_t sent;
    plate_t plate; /**< from feedback: actual pose, speed and acceleration */
    q32_t extension_mm_q32[CYLINDERS_MAX];
    q32_t angle_deg_q32;
    drive_feedback_t drive[DRIVES_MAX];
    wear_t wear[DRIVES_MAX];           /**< of each drive, since the start */
    uint32_t rides;                    /**< times that it was engaged from NEUTRAL */
    drive_report_t report[DRIVES_MAX]; /**< the same in words; "" where the driver has none */
    unsigned flags;                    /**< MOTION_CLAMPED ... */
    uint8_t limiting_cylinder;
    uint8_t intensity_percent; /**< asked for */
    q32_t intensity_now_q32;   /**< in force, percent */
    uint32_t stream_period_us; /**< 0 while unknown */
    uint32_t stream_delay_us;
    stream_report_t stream;  /**< of the sender that drives */
    owner_t owner;           /**< who drives */
    mask_habit_t mask_habit; /**< whether its frames have a mask */
    owner_t other;           /**< the last sender that does not drive */
    uint64_t last_frame_us;  /**< 0 before the first accepted frame */
    service_view_t service;
    counters_t counters;
} snapshot_t;

#endif

/* SPDX-License-Identifier: MIT
 * motion_state.h - definition of motion_t. Members are private to src/motion; include motion.h instead.
 */
#ifndef HEAVE_MOTION_STATE_H
#define HEAVE_MOTION_STATE_H

#include "heave/fade.h"
#include "heave/spike_filter.h"
#include "heave/sync_stop.h"
#include "heave/jog.h"
#include "heave/motion.h"
#include "heave/profile.h"

/** Present source of the motion. */
typedef enum {
    MOTION_RESTING,  /**< nothing: it stays where it is */
    MOTION_STOPPING, /**< a controlled stop in cylinder space */
    MOTION_ON_PATH,  /**< an S-curve in cylinder space */
    MOTION_JOGGED,   /**< led by hand */
    MOTION_STREAMED, /**< following: a stream */
    MOTION_TIMED,    /**< following: a quintic (timed, or a step in motion) */
    MOTION_HALTING,  /**< following: a stop, and the S-curve from where it ends, which may begin before that */
    MOTION_STRAIGHT  /**< following: a timed move or a step from rest along an S-curve */
} motion_source_t;

/** What has to be planned for the targets of a cycle; the newest one counts. */
typedef enum { DUE_NOTHING, DUE_STEP, DUE_STREAM, DUE_TIMED } motion_due_t;

/** What comes after a stop. */
typedef enum { MOTION_THEN_REST, MOTION_THEN_PATH, MOTION_THEN_FOLLOW } motion_next_t;

/** A straight move along an S-curve. */
typedef struct {
    scurve_t path;
    q32_t from_q32[AXES_MAX];
    q32_t to_q32[AXES_MAX]; /**< where it rests, too */
    history_t history[AXES_MAX];
} motion_straight_t;

/** The offset from a stream's references that its jumps have not yet made up, before intensity. */
typedef struct {
    ramp_t off[POSE_AXES];
} jump_t;

/** The active plan: one of these at a time. */
typedef union {
    quintic_t quintic;          /**< MOTION_TIMED */
    jump_t jump;                /**< MOTION_STREAMED, if is_jumping */
    motion_straight_t straight; /**< MOTION_RESTING, MOTION_ON_PATH, MOTION_JOGGED, MOTION_STRAIGHT; begun before a stop ends */
} motion_plan_t;

struct motion {
    kin_t kin;
    unsigned cylinders;
    uint32_t cycle_us;
    pose_t neutral;
    pose_t settled_pose;
    q32_t neutral_mm_q32[CYLINDERS_MAX];
    q32_t settled_mm_q32[CYLINDERS_MAX];
    ramp_limits_t engage_limits; /**< of every cylinder on a path */
    fade_limits_t fade_limits;   /**< at a take-over */
    uint32_t blend_cycles;       /**< that a take-over takes at least */
    jog_limits_t jog_limits;

    bool is_axis_moved[AXES_MAX];       /**< the others stay at 0 */
    ramp_t axis[AXES_MAX];              /**< pose axes and the rotation motor */
    ramp_t cylinder[CYLINDERS_MAX];     /**< the limiter */
    history_t reference[CYLINDERS_MAX]; /**< last reference of the limiter */
    pose_t pose;                        /**< last pose sent; where forward kinematics starts */
    bool is_pose_stale;                 /**< the extensions were placed: the pose has to be found even at rest */

    intensity_t intensity;
    motion_source_t source;
    motion_next_t next;
    motion_space_t space;
    stream_t stream;
    spike_filter_t gate;
    motion_target_t withheld; /**< what the gate holds back */
    motion_plan_t plan;
    sync_stop_t halt; /**< a stop in progress, or being planned */

    motion_due_t due;
    bool is_space_new;                          /**< the values of the slots have to be calculated from the cylinders first */
    q32_t slot_q32[AXES_MAX];                   /**< the newest target, before intensity */
    q32_t goal_q32[AXES_MAX];                   /**< planned end: with intensity, within the limits */
    q32_t slot_extension_mm_q32[CYLINDERS_MAX]; /**< and its extensions */
    int64_t asked_cycles;                       /**< of a timed target */
    unsigned planned_slots;                     /**< number of slots that follow the plan; the others move by themselves */
    history_t
        led[AXES_MAX]; /**< last references of the slots (pose axes or cylinders, then the rotation motor), before blending */

    jog_t jog;

    bool is_following;
    bool is_jumping;     /**< an offset leads to where the stream has jumped */
    bool is_taking_over; /**< a sender is being blended in, or will be with its first target */
    bool is_return;      /**< it has driven before: blending need not take blend_cycles */
    bool is_fading;
    fade_t fade;

    bool has_pending; /**< pending is a target that waits for the end of a stop */
    motion_target_t pending;
    q32_t angle_target_deg_q32;
    uint64_t last_us;        /**< arrival of the last target */
    uint32_t last_stated_us; /**< period that it stated, 0 = none */
    uint32_t last_gap_us;    /**< interval before it, if it is as short as one of a stream; else 0 */
    bool is_time_idle;       /**< targets have come long before the time had passed that the one before them stated */
    uint64_t timed_end_us;
    int64_t timed_share_q46;       /**< intensity used for planning the move */
    q32_t timed_way_q32[AXES_MAX]; /**< from neutral to the target of the sender, before intensity */
    int64_t straight_after;        /**< cycles of the stop before the S-curve begins */
    bool is_stretched;
    bool is_clamped;           /**< the last target was pulled in */
    uint8_t limiting_cylinder; /**< by this cylinder, 0 where none bounds it */
    uint32_t stretched_count;
    uint32_t singular_stops;
};

#endif

/* SPDX-License-Identifier: MIT
 * motion_state.h - definition of motion_t and of its parts. Members are private to src/motion; include motion.h instead. Each
 * part belongs to the file that it names: this file alone changes it, or what it calls.
 */
#ifndef HEAVE_MOTION_STATE_H
#define HEAVE_MOTION_STATE_H

#include "heave/fade.h"
#include "heave/jog.h"
#include "heave/motion.h"
#include "heave/path.h"

/** The platform: what it is, and where its set-points are. platform.c, coordinated_step.c; the limiter in motion.c. */
typedef struct {
    kin_t kin;
    unsigned cylinders;
    uint32_t cycle_us;
    pose_t neutral;
    pose_t settled_pose;
    q32_t neutral_mm_q32[CYLINDERS_MAX];
    q32_t settled_mm_q32[CYLINDERS_MAX];
    ramp_limits_t engage_limits;        /**< of every cylinder on the way to settled and to neutral */
    bool is_axis_moved[AXES_MAX];       /**< the others stay at 0 */
    ramp_t axis[AXES_MAX];              /**< pose axes and the rotation motor */
    ramp_t cylinder[CYLINDERS_MAX];     /**< the limiter */
    history_t reference[CYLINDERS_MAX]; /**< last reference of the limiter */
    pose_t pose;                        /**< last pose sent; where forward kinematics starts */
    bool is_pose_stale;                 /**< the extensions were placed: the pose has to be found even at rest */
} platform_t;

/** What moves the platform. motion.c has the changes. */
typedef enum {
    MOTION_RESTING,  /**< nothing: it stays where it is */
    MOTION_STOPPING, /**< a stop in cylinder space */
    MOTION_ON_PATH,  /**< the way to settled or neutral, a straight line in cylinder space */
    MOTION_JOGGED,   /**< moved by hand */
    MOTION_STREAMED, /**< a sender's stream, or each axis by its own ramp to the newest target */
    MOTION_PLANNED   /**< a planned path to a sender's target */
} motion_source_t;

/** What comes after a stop. */
typedef enum { MOTION_THEN_REST, MOTION_THEN_SETTLE, MOTION_THEN_RISE, MOTION_THEN_FOLLOW } motion_next_t;

/** What has to be planned for the targets of a cycle; the newest one counts. */
typedef enum { DUE_NOTHING, DUE_STEP, DUE_STREAM, DUE_TIMED } motion_due_t;

/** How far a sender is followed. */
typedef enum {
    FOLLOW_NOBODY,    /**< targets are ignored */
    FOLLOW_AWAITED,   /**< a sender's first target is awaited, or not yet planned */
    FOLLOW_FADING_IN, /**< its references are faded in */
    FOLLOW_FULLY
} follow_phase_t;

/** The axes that targets are given in: those of the pose or the cylinders, then the rotation motor. follow.c */
typedef struct {
    follow_phase_t phase;
    motion_space_t space;
    bool is_new;              /**< where the axes are has to be calculated from the cylinders first */
    history_t past[AXES_MAX]; /**< their last references, before fade-in */
} followed_t;

/** The newest target as one value for each followed axis. axis_targets.c */
typedef struct {
    q32_t value_q32[AXES_MAX];       /**< before intensity */
    q32_t goal_q32[AXES_MAX];        /**< end of the plan: with intensity, within the limits */
    q32_t angle_deg_q32;             /**< target of the rotation motor, or the end of its stop */
    bool is_clamped;                 /**< the target was pulled in */
    uint8_t limiting_cylinder;       /**< by this cylinder, 0 where none bounds it */
    int64_t planned_share_q46;       /**< intensity with which the path was planned */
    q32_t planned_way_q32[AXES_MAX]; /**< from neutral to the end of the path, before intensity */
} axis_targets_t;

/** Times between a sender's targets. target_times.c */
typedef struct {
    uint64_t last_us;    /**< arrival of the newest target */
    uint32_t stated_us;  /**< period that it stated, 0 = none */
    uint32_t gap_us;     /**< interval before it, if it is as short as one of a stream; else 0 */
    bool is_not_awaited; /**< targets came long before the time had passed that the one before them stated */
} target_times_t;

/** Fading a sender in. fade_in.c */
typedef struct {
    fade_limits_t limits;
    uint32_t least_cycles; /**< of a new sender */
    bool is_return;        /**< it has driven before: it may be faded in more quickly */
    fade_t fade;
} fade_in_t;

/** The offset from a stream's references that its jumps have not yet made up, before intensity. jump.c */
typedef struct {
    ramp_t off[POSE_AXES];
} jump_t;

/** What leads the platform besides a stream: one of these at a time. */
typedef union {
    jump_t jump; /**< MOTION_STREAMED, if is_jumping */
    path_t path; /**< any other source */
} motion_plan_t;

/** A timed move, for display. */
typedef struct {
    uint64_t end_us; /**< of the move that is planned, 0: none */
    bool is_stretched;
    uint32_t stretched_count;
} timed_t;

struct motion {
    platform_t platform;
    intensity_t intensity;
    int64_t rise_percent; /**< of engage speed, for a way to the neutral pose */
    motion_source_t source;
    motion_next_t next;
    motion_plan_t plan;
    jog_t jog;
    followed_t followed;
    bool is_jumping; /**< an offset leads to where the stream has jumped */
    stream_t stream;
    spike_filter_t gate;
    motion_target_t withheld; /**< what the gate holds back */
    target_times_t times;
    axis_targets_t targets;
    motion_due_t due;
    int64_t asked_cycles; /**< of a timed target */
    timed_t timed;
    fade_in_t fade_in;
    bool has_pending;        /**< pending waits for the end of a stop */
    motion_target_t pending; /**< the newest target */
    uint32_t singular_stops;
};

#endif

/* SPDX-License-Identifier: MIT
 * motion.h - calculates the set-points of each cycle from the commands, within the limits of every axis and cylinder.
 * Order: source (stream, planned path, stop, jog) -> intensity -> fade-in -> ramps of the pose axes -> workspace -> inverse
 * kinematics -> limiter of each cylinder. Nothing reaches an output except through a ramp (ramp.h). Owns no clock and no I/O.
 */
#ifndef HEAVE_MOTION_H
#define HEAVE_MOTION_H

#include "heave/spike_filter.h"
#include "heave/intensity.h"
#include "heave/kin.h"
#include "heave/ramp.h"
#include "heave/settings.h"
#include "heave/stream.h"

/** Coordinates of a target. */
typedef enum {
    MOTION_POSE,     /**< roll, pitch, yaw, x, y, z */
    MOTION_CYLINDERS /**< extensions */
} motion_space_t;

/** One command of a sender, already in platform axes (signs, scales and offsets applied). */
typedef struct {
    q32_t value_q32[POSE_AXES]; /**< pose, or extensions from cylinder 1 on [mm] */
    q32_t angle_deg_q32;        /**< if has_angle, of the rotation motor; else it keeps its last target */
    motion_space_t space;
    uint32_t time_ms; /**< of a timed move; 0 = as fast as the limits allow */
    bool has_angle;
    bool is_timed;
} motion_target_t;

/** What limited the motion of a cycle, or what is in progress; flags may be combined. */
enum {
    MOTION_CLAMPED = 1u << 0,      /**< the requested pose or extension exceeds its limits and was pulled in */
    MOTION_SPEED = 1u << 1,        /**< a speed limit held it back */
    MOTION_ACCEL = 1u << 2,        /**< an acceleration limit held it back */
    MOTION_STRETCHED = 1u << 3,    /**< the running timed move takes longer than asked */
    MOTION_TAKEOVER = 1u << 4,     /**< moving to a sender's first pose at engage speed */
    MOTION_IN_CYLINDERS = 1u << 5, /**< moving in cylinder space: pose limits do not apply */
    MOTION_OFF_PATH = 1u << 6,     /**< a cylinder's limiter is not on its reference: limits of the axes do not hold */
    MOTION_NO_POSE = 1u << 7       /**< no pose belongs to the extensions: the pose shown is the last one */
};

/** One cycle's set-points. */
typedef struct {
    pose_t asked; /**< what the source asked for, scaled by intensity, before any limit */
    pose_t sent;  /**< the pose that belongs to the extensions sent */
    q32_t extension_mm_q32[CYLINDERS_MAX];
    q32_t angle_deg_q32;
    unsigned flags;
    uint8_t limiting_cylinder; /**< the cylinder that bounds a clamped pose, from 1; 0: none */
} motion_output_t;

typedef struct motion motion_t;

/** Prepares a platform; everything rests at the settled extension.
 *  @return HV_OK; HV_ERR_RANGE: a setting is outside its range, or the neutral or settled position cannot be reached. */
hv_status_t motion_init(motion_t *self, const settings_t *settings) HV_MUST_CHECK;

/** Sets the set-points to the actual positions, at rest. Before the drives are enabled, and in an e-stop. */
void motion_place(motion_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], q32_t angle_deg_q32);

/** Stops all axes together, as quickly as the limits allow, and stays there. */
void motion_stop(motion_t *self);

/** Stops if moving, then goes to the settled extension, all cylinders together at engage speed. */
void motion_settle(motion_t *self);

/** Stops if moving, then rises to the neutral pose, all cylinders together at engage speed. */
void motion_rise(motion_t *self);

/** Follows targets from now on. Moves to the first one from rest, at engage speed. */
void motion_follow(motion_t *self);

/** Accepts a target while following (else it is ignored).
 *  @return HV_OK; HV_ERR_RANGE for extensions that no pose has, or only one near a singularity (KIN_MARGIN_LEAST_Q32):
 *          nothing changes. */
hv_status_t motion_target(motion_t *self, const motion_target_t *target, uint64_t now_us) HV_MUST_CHECK;

/** Advances one cycle. Bounded time. */
void motion_step(motion_t *self, uint64_t now_us, motion_output_t *out);

/** True when a stop, settle or rise has ended and everything is exactly at rest. */
bool motion_is_done(const motion_t *self);

/** True during a stop: a requested one, or that of a jog that leads to where the cylinders would not hold the
 *  plate (a singularity). */
bool motion_is_stopping(const motion_t *self);

/** True while a sender is followed, or its first target is awaited. */
bool motion_is_following(const motion_t *self);

/** True when every set-point rests. */
bool motion_is_at_rest(const motion_t *self);

/** Target of the rotation motor, or the end of a stop that has begun. deg */
q32_t motion_angle_target(const motion_t *self);

/** Scales a sender's motion about the neutral pose or the neutral extensions; the rotation motor is not scaled.
 *  Changes by a ramp while a sender is followed, else at once, which moves nothing.
 *  @return HV_OK; HV_ERR_RANGE above intensity_max_percent: nothing changes */
hv_status_t motion_set_intensity(motion_t *self, unsigned percent) HV_MUST_CHECK;

#define MOTION_RISE_PERCENT_MAX 100

/** How fast the next ways to the neutral pose are, in percent of engage speed; 100 to begin with. Ways down are not slowed: they
 *  end a motion. The way that is running goes on as it was planned.
 *  @return HV_OK; HV_ERR_RANGE: not 1 to 100; nothing changes */
hv_status_t motion_set_rise_percent(motion_t *self, unsigned percent) HV_MUST_CHECK;

/** Intensity asked for and in force, for display. */
const intensity_t *motion_intensity(const motion_t *self);

/** End of the timed move that is running, us on the clock of motion_target(); 0: none. */
uint64_t motion_timed_end_us(const motion_t *self);

/** Timed moves that had to be stretched since the start. */
uint32_t motion_stretched_count(const motion_t *self);

/** Number of stops since the start in front of a singularity, on the way from one set of extensions to another. The platform then
 *  moves to the next allowed target at engage speed. */
uint32_t motion_singular_stops(const motion_t *self);

/** Extensions at which people board. */
const q32_t *motion_settled_extension(const motion_t *self);

/** The pose that belongs to the set-points; the last one that was known where none does. */
const pose_t *motion_pose(const motion_t *self);

/** The mechanism, for feedback. */
const kin_t *motion_kin(const motion_t *self);

/** Sets the factor of the spike filter in front of the stream (spike_filter.h): [0, SPIKE_FILTER_FACTOR_MAX], 0 = off. */
void motion_set_spike_gate(motion_t *self, uint32_t factor);

/** State of the spike filter, for display. */
const spike_filter_t *motion_spike_filter(const motion_t *self);

/** The stream's state, for display. */
const stream_t *motion_stream(const motion_t *self);

#include "heave/motion_state.h" /* the definition of motion_t, so that the caller can own one */

#endif

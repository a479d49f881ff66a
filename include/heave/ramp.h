/* SPDX-License-Identifier: MIT
 * ramp.h - the jerk-limited ramp of one axis: follows a reference and never exceeds speed, acceleration, jerk or position bounds.
 * Only ramps move set-points. All state consists of exact integer sums in Q32 per cycle^k, so the limits hold exactly for the
 * finite differences of the set-points. Owns no clock and no I/O; instances are independent.
 */
#ifndef HEAVE_RAMP_H
#define HEAVE_RAMP_H

#include "heave/fx.h"

/** Limits of one axis per cycle (see ramp_limits_from_units). Unit u is mm or deg. */
typedef struct {
    q32_t pos_min_q32;         /**< u */
    q32_t pos_max_q32;         /**< u, above pos_min */
    q32_t vel_per_cycle_q32;   /**< u/cycle */
    q32_t acc_per_cycle2_q32;  /**< u/cycle^2 */
    q32_t jerk_per_cycle3_q32; /**< u/cycle^3, at least RAMP_JERK_MIN_Q32 */
} ramp_limits_t;

/** Position, velocity, acceleration: backward finite differences of the emitted positions. */
typedef struct {
    q32_t pos_q32;
    q32_t vel_per_cycle_q32;
    q32_t acc_per_cycle2_q32;
} ramp_state_t;

/** A reference for the coming cycle with its own backward finite differences (all 0 but pos for a step). */
typedef struct {
    q32_t pos_q32;
    q32_t vel_per_cycle_q32;
    q32_t acc_per_cycle2_q32;
    q32_t jerk_per_cycle3_q32;
} ramp_ref_t;

#define RAMP_JERK_MIN_Q32 64 /**< least jerk limit: below it a ramp could not come to rest exactly */
#define RAMP_SPEED_PER_JERK_MAX                                                                                                  \
    ((int64_t)1 << 26) /**< cycles^2: an acceleration is built up and taken back in less than 2^14 cycles */
#define RAMP_CYCLE_MIN_US 500u
#define RAMP_CYCLE_MAX_US 10000u

/** How sharply the ramp follows near the reference; see ramp.c. */
typedef enum {
    RAMP_SOFT, /**< streams: bandwidth 1/16 per cycle, filters the noise of reconstructed samples */
    RAMP_FIRM  /**< steps, timed moves, cylinders: bandwidth 1/4 per cycle */
} ramp_bandwidth_t;

/** What limited a cycle; flags may be combined. */
enum {
    RAMP_CLAMPED = 1u, /**< the reference is outside the position bounds */
    RAMP_SPEED = 2u,   /**< the speed limit slowed the ramp */
    RAMP_ACCEL = 4u,   /**< the acceleration limit slowed the ramp */
    RAMP_BOUND = 8u    /**< the ramp braked because of a position bound */
};

/** A ramp; members are private to src/motion except state, which may be read. */
typedef struct {
    ramp_limits_t limits;
    ramp_state_t state;
    q32_t acc_safe_q32; /**< acceleration limit in force, u/cycle^2: at most limits.acc, and small enough that every brake fits */
    int64_t acc_cycles; /**< acc_safe / jerk, whole */
    int64_t per_jerk_q62;  /**< 1 / jerk */
    int64_t per_acc_q62;   /**< 1 / acc_safe */
    q32_t brake_reach_q32; /**< no brake from within the limits is longer, u */
    q32_t ref_jerk_q32;    /**< largest recent jerk of the references, decaying, u/cycle^3 */
    q32_t ref_acc_q32;     /**< largest recent acceleration of the references, decaying, u/cycle^2 */
    uint32_t brake_cycles; /**< upper bound of a braking distance in cycles at its highest speed; 0: unknown */
    unsigned flags;        /**< flags of the last step: RAMP_CLAMPED ... */
} ramp_t;

/** Converts limits from units to cycles.
 *  @param speed  u/s Q16, above 0   @param accel u/s^2 Q16, above 0   @param jerk u/s^3, whole units, above 0
 *  @param cycle_us [RAMP_CYCLE_MIN_US, RAMP_CYCLE_MAX_US]
 *  @return HV_OK; HV_ERR_RANGE where a value does not fit or jerk comes out below RAMP_JERK_MIN_Q32. */
hv_status_t ramp_limits_from_units(q16_t pos_min_q16, q16_t pos_max_q16, q16_t speed_q16, q16_t accel_q16, int32_t jerk,
                                   uint32_t cycle_us, ramp_limits_t *limits) HV_MUST_CHECK;

/** The acceleration limit a ramp applies, u/cycle^2: limits.acc, unless less is enough to reach the speed limit with this jerk
 *  (sqrt(jerk * speed)), or only less can be taken back within the bounds. */
q32_t ramp_safe_acceleration(const ramp_limits_t *limits);

/** Starts at rest.
 *  @param pos_q32 within the bounds. From outside, the ramp moves in at limited speed and never further out
 *  @return HV_OK; HV_ERR_RANGE where limits make no sense. */
hv_status_t ramp_init(ramp_t *self, const ramp_limits_t *limits, q32_t pos_q32) HV_MUST_CHECK;

/** Continues from a given state, clipped to the limits. */
void ramp_adopt(ramp_t *self, const ramp_state_t *state);

/** Advances one cycle towards the reference. Constant time.
 *  Guarantees, exact in integers: |vel|, |acc|, |jerk| within the limits, pos within the bounds, and a stop within the bounds
 *  stays possible. Ends exactly at rest on a reference that rests within the bounds. Sets self->flags.
 *  @return the new position */
q32_t ramp_step(ramp_t *self, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth);

/** ramp_step() of several ramps, one after the other, each towards its own reference.
 *  @param pos_q32 out, the new position of each
 *  @return the flags of all together */
unsigned ramp_step_all(ramp_t *ramp, unsigned count, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth, q32_t *pos_q32);

/** The two halves of a step, for axes that are moved together.
 *  ramp_aim_all(): the acceleration that each takes in the coming cycle, within the limits; sets flags, moves nothing.
 *  @param acc_q32 out, of each, u/cycle^2   @return the flags of all together */
unsigned ramp_aim_all(ramp_t *ramp, unsigned count, const ramp_ref_t *ref, ramp_bandwidth_t bandwidth, q32_t *acc_q32);

/** The acceleration nearest to a wanted one that keeps all that ramp_step() guarantees. These accelerations are an interval: what
 *  lies between two of them is one. Adds to self->flags. */
q32_t ramp_allowed(ramp_t *self, q32_t wanted_q32);

/** Advances one cycle with an allowed acceleration. @return the new position */
q32_t ramp_advance(ramp_t *self, q32_t acc_q32);

/** Where the ramp comes to rest if it starts to brake now (within the bounds): the reference of a controlled stop. */
q32_t ramp_stop_position(const ramp_t *self);

/** At rest exactly: velocity and acceleration 0. */
static inline bool ramp_is_at_rest(const ramp_t *self)
{
    return self->state.vel_per_cycle_q32 == 0 && self->state.acc_per_cycle2_q32 == 0;
}

#endif

/* SPDX-License-Identifier: MIT
 * governor.h - reference governor: makes a stream that exceeds the limits slower and smoother, as much as needed and equally for
 * all axes.
 *
 * Works on the control points of a curve, one step per period.
 * Speed: where a step exceeds a speed limit, the steps of all axes are made smaller by one factor. What is left behind is caught
 * up with a time constant of 100 ms. A speed limit that is exceeded briefly costs only that delay.
 * Acceleration and jerk: level 0 is the curve with that speed. Each further level is the previous one after one more low-pass
 * (time constants 6, 12, 25, 50, 100, 200, 400 ms). For each level the governor records which share of the limits of axes and
 * cylinders it needed. The output is interpolated between the levels, as far along as the limits require. A need counts
 * if it comes again within 1.5 s, or in the first second of a stream or after a rest: what exceeds the limits once is left to
 * the ramps.
 * Every level is a mean of the requested curve, and so is the output: it never leaves the range of the request and cannot
 * oscillate. All axes share one factor and one strength, so the direction is kept. Owns no clock; not re-entrant per instance.
 */
#ifndef HEAVE_GOVERNOR_H
#define HEAVE_GOVERNOR_H

#include "heave/axes.h"
#include "heave/fx.h"

enum {
    GOVERNOR_LEVELS = 7,                   /**< low-passes */
    GOVERNOR_CHANNELS = 2 * CYLINDERS_MAX, /**< pose axes, then the cylinders that follow from them */
    GOVERNOR_POLES = 3,                    /**< number of low-passes that smooth a rising strength */
    GOVERNOR_BEGIN_US = 1000000,           /**< where a motion begins, one event alone counts for so long */
    GOVERNOR_EVENTS = 8                    /**< events that are remembered, in which more was needed than there was */
};

/** Limits of a channel, per cycle^k. */
typedef struct {
    q32_t vel_per_cycle_q32;
    q32_t acc_per_cycle2_q32;
    q32_t jerk_per_cycle3_q32; /**< 0: the channel has no limits */
} governor_limits_t;

/** A value with its differences per period; private to src/stream. */
typedef struct {
    q32_t pos_q32, vel_q32, acc_q32;
} governor_track_t;

/** A time in which more was needed than the limits allow; private to src/stream. */
typedef struct {
    uint32_t age_us;                       /**< since it began */
    int32_t need_q16[GOVERNOR_LEVELS + 1]; /**< of each level, the largest share of a limit */
} governor_event_t;

/** Members are private to src/stream. */
typedef struct {
    governor_limits_t limits[GOVERNOR_CHANNELS];
    unsigned channels;                           /**< number of channels with limits; they come first */
    uint32_t period_us;                          /**< for which the following members were calculated */
    int64_t per_limit_q62[GOVERNOR_CHANNELS][3]; /**< 1 / limit per period, per period^2, per period^3 */
    int32_t brake_q16[GOVERNOR_CHANNELS]; /**< share of the speed limit that is added while the largest acceleration is removed */
    q32_t asked_q32[GOVERNOR_CHANNELS];   /**< the last request, and ... */
    q32_t behind_q32[GOVERNOR_CHANNELS];  /**< ... what the speed limits have left behind of it */
    bool is_slowed;                       /**< a speed limit was exceeded by the last request */
    q32_t share_q32[GOVERNOR_LEVELS];     /**< coefficient of each low-pass per period */
    q32_t level_q32[GOVERNOR_LEVELS + 1][GOVERNOR_CHANNELS];
    unsigned each;  /**< needs are calculated once in so many periods: shorter intervals would show rounding only */
    unsigned since; /**< periods since the last calculation */
    governor_track_t track[GOVERNOR_LEVELS + 1][GOVERNOR_CHANNELS]; /**< levels at the last calculation, and ... */
    governor_track_t out[GOVERNOR_CHANNELS];                        /**< ... the output */
    uint32_t single_us;                      /**< time for which one event alone counts, [0, GOVERNOR_BEGIN_US] */
    governor_event_t event[GOVERNOR_EVENTS]; /**< the newest first */
    q32_t target_q32;                        /**< strength that it goes to ... */
    q32_t pole_q32[GOVERNOR_POLES];          /**< ... through low-passes */
    q32_t fall_q32;                          /**< present rate of fall of the target */
    q32_t glide_q32;                         /**< change of the strength per period */
    q32_t strength_q32;                      /**< [0, GOVERNOR_LEVELS]: 0 is the curve as asked */
} governor_t;

/** Sets the limits of a channel; jerk 0: none. Call before governor_place(). */
void governor_set_limits(governor_t *self, unsigned channel, const governor_limits_t *limits);

/** Sets the period; cheap if it hardly changes.
 *  @param period_us [1000, 2000000]   @param cycle_us [500, 10000] */
void governor_pace(governor_t *self, uint32_t period_us, uint32_t cycle_us);

/** Starts without any recorded need. */
void governor_start(governor_t *self);

/** Sets the past values of a channel, the newest last. Call after governor_pace().
 *  @param is_steady true: it has moved like this for long; false: it was at rest, and the levels start at the rest position */
void governor_place(governor_t *self, unsigned channel, bool is_steady, const q32_t value_q32[3]);

/** Distance of the output from the last request, of a channel with limits. */
q32_t governor_lag(const governor_t *self, unsigned channel);

/** Moves the last request of a channel to another point in time, where its value is asked_q32; shifts all levels with it. */
void governor_shift(governor_t *self, unsigned channel, q32_t asked_q32);

/** One period.
 *  @param asked_q32 one value per channel with limits   @param scale_q16 [0, Q16_ONE] that the result will be multiplied by
 *  @param out_q32   out: the request within the limits as far as possible; exactly asked_q32 if nothing exceeds them */
void governor_step(governor_t *self, const q32_t *asked_q32, int32_t scale_q16, q32_t *out_q32);

/** Present delay by smoothing, in us. */
uint32_t governor_delay_us(const governor_t *self);

#endif

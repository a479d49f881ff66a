/* SPDX-License-Identifier: MIT
 * governor.h - reference governor: what a stream asks for beyond the limits is smoothed, just as far as needed, all axes alike.
 *
 * Works on the control points of a curve, one step per period. Level 0 is the curve as asked; each further level is the one
 * before behind one more low-pass (time constants 6, 12, 25, 50, 100, 200, 400 ms). Of each level is known how much of the limits
 * of axes and cylinders it has needed lately. The output lies on the way from level to level, as far along as the limits need.
 * Every level is a mean of what was asked, and so is the output: it never leaves the range of what was asked, it cannot swing,
 * and as all axes share one strength it keeps the direction. Owns no clock; not re-entrant per instance.
 */
#ifndef HEAVE_GOVERNOR_H
#define HEAVE_GOVERNOR_H

#include "heave/axes.h"
#include "heave/fx.h"

enum {
    GOVERNOR_LEVELS = 7,                   /**< low-passes */
    GOVERNOR_CHANNELS = 2 * CYLINDERS_MAX, /**< axes that are followed in, then the cylinders they lead to */
    GOVERNOR_POLES = 3,                    /**< low-passes that a rise of the strength goes through */
    GOVERNOR_SPANS = 4                     /**< quarters of a second that a need is remembered for */
};

/** Limits of a channel, per cycle^k. */
typedef struct {
    q32_t vel_per_cycle_q32;
    q32_t acc_per_cycle2_q32;
    q32_t jerk_per_cycle3_q32; /**< 0: the channel has no limits */
} governor_limits_t;

/** A value with its differences per period; private to src/motion. */
typedef struct {
    q32_t pos_q32, vel_q32, acc_q32;
} governor_track_t;

/** Members are private to src/motion. */
typedef struct {
    governor_limits_t limits[GOVERNOR_CHANNELS];
    unsigned channels;                           /**< that have limits: the first so many */
    uint32_t period_us;                          /**< that what follows was worked out for */
    int64_t per_limit_q62[GOVERNOR_CHANNELS][3]; /**< 1 / limit per period, per period^2, per period^3 */
    int32_t brake_q16[GOVERNOR_CHANNELS];        /**< share of the speed limit that taking the largest acceleration back adds */
    q32_t share_q32[GOVERNOR_LEVELS];            /**< of the way to its input that a low-pass goes in a period */
    q32_t level_q32[GOVERNOR_LEVELS + 1][GOVERNOR_CHANNELS];
    unsigned each;  /**< needs are looked at every so manyth period: finer ones would be those of rounding */
    unsigned since; /**< periods since they were */
    governor_track_t track[GOVERNOR_LEVELS + 1][GOVERNOR_CHANNELS]; /**< of the levels when needs were looked at, and ... */
    governor_track_t out[GOVERNOR_CHANNELS];                        /**< ... of the output */
    int32_t need_q16[GOVERNOR_SPANS]
                    [GOVERNOR_LEVELS + 1]; /**< largest share of a limit, by quarters of a second, the newest first */
    uint32_t span_us;                      /**< of the newest of these so far */
    q32_t rise_q32[GOVERNOR_POLES];
    q32_t fall_q32;     /**< that the strength falls by at present */
    q32_t glide_q32;    /**< that it changes by in a period */
    q32_t strength_q32; /**< [0, GOVERNOR_LEVELS]: 0 is the curve as asked */
} governor_t;

/** Tells the limits of a channel; jerk 0: it has none. Before governor_place(). */
void governor_set_limits(governor_t *self, unsigned channel, const governor_limits_t *limits);

/** Tells the period; cheap where it hardly changes.
 *  @param period_us [1000, 2000000]   @param cycle_us [500, 10000] */
void governor_pace(governor_t *self, uint32_t period_us, uint32_t cycle_us);

/** Nothing has been beyond the limits so far. */
void governor_start(governor_t *self);

/** A channel has come along these values, the newest last. After governor_pace().
 *  @param is_steady it has moved like that for long; else it was at rest until now: the levels are where it has been */
void governor_place(governor_t *self, unsigned channel, bool is_steady, const q32_t value_q32[3]);

/** How far the output is behind what was asked last, of a channel with limits. */
q32_t governor_lag(const governor_t *self, unsigned channel);

/** What was asked last is at another time, and there it was so much; all that follows from it goes along. */
void governor_shift(governor_t *self, unsigned channel, q32_t asked_q32);

/** One period.
 *  @param asked_q32 one value per channel with limits   @param scale_q16 [0, Q16_ONE] that the result will be multiplied by
 *  @param out_q32   out: the same within the limits as far as they can be kept; asked_q32 exactly where nothing is beyond them */
void governor_step(governor_t *self, const q32_t *asked_q32, int32_t scale_q16, q32_t *out_q32);

/** Delay that the smoothing adds at present, in us. */
uint32_t governor_delay_us(const governor_t *self);

#endif

/* SPDX-License-Identifier: MIT
 * envelope.h - what the geometry of a platform can do: how far its axes go alone and in pairs, what they ask of the cylinders,
 * how near a singularity they come, and the limits of axes that the cylinders can serve. Worked out from the inverse solution and
 * the singularity margin, in double precision: figures for people, never for motion. For offline use: takes some 0.1 s.
 */
#ifndef HEAVE_PLATFORM_ENVELOPE_H
#define HEAVE_PLATFORM_ENVELOPE_H

#include "heave/kin.h"
#include "heave/settings.h"

/** What ends a reach: the index of a cylinder that would leave its stroke, less its margins, or one of these. */
enum {
    ENVELOPE_SINGULAR = CYLINDERS_MAX, /**< the singularity margin falls to KIN_MARGIN_LEAST_Q32 */
    ENVELOPE_RANGE,                    /**< the range of the configuration: +-90 deg, of yaw +-180 deg, +-4000 mm */
    ENVELOPE_OPEN                      /**< nothing */
};

/** How far something goes. Unit u is deg or mm. */
typedef struct {
    double value; /**< u */
    unsigned cause;
} envelope_end_t;

/** What an axis asks of the cylinder that moves most: its extension's first three derivatives by the axis, as magnitudes. */
typedef struct {
    double slope;      /**< mm/u: also mm/s of the cylinder per u/s of the axis */
    double bend;       /**< mm/u^2 */
    double twist;      /**< mm/u^3 */
    unsigned cylinder; /**< the one of the slope */
    pose_t pose;       /**< where the slope is */
} envelope_rate_t;

/** A box of poses about neutral. Poses of it that are out of reach are pulled in on the straight way from neutral. */
typedef struct {
    double low[POSE_AXES], high[POSE_AXES]; /**< u */
    envelope_rate_t rate[POSE_AXES];        /**< the largest of each derivative */
    double all_mm_s;                        /**< fastest cylinder with all axes at their speed limits at once */
    pose_t all_pose;
    double margin; /**< smallest singularity margin */
    pose_t margin_pose;
    unsigned poses; /**< looked at */
} envelope_box_t;

/** Limits of an axis. */
typedef struct {
    double min, max; /**< u */
    double speed;    /**< u/s */
    double accel;    /**< u/s^2 */
    double jerk;     /**< u/s^3 */
} envelope_limits_t;

/** An envelope. Axes that the platform does not have are all zero. */
typedef struct {
    const settings_t *settings;
    kin_t kin;
    unsigned cylinders;
    bool has_axis[POSE_AXES];
    pose_t neutral;
    envelope_end_t low[POSE_AXES], high[POSE_AXES]; /**< reach of an axis alone from neutral, its configured limits aside */
    envelope_rate_t at_neutral[POSE_AXES];
    double margin_at_neutral;
    envelope_box_t limits;                  /**< what the configured limits leave of the reach */
    envelope_box_t reach;                   /**< the whole reach */
    envelope_limits_t suggested[POSE_AXES]; /**< for each axis alone, anywhere within reach */
} envelope_t;

/** Works out an envelope.
 *  @param settings whose mechanism is right, see mechanism.h; has to stay
 *  @return false where they do not make a mechanism */
bool envelope_find(envelope_t *self, const settings_t *settings);

#define ENVELOPE_DIRECTIONS 24u /**< 15 degrees apart */

/** How far two axes go at once. */
typedef struct {
    double share; /**< of the way from neutral to the ellipse that the reaches of both axes alone span */
    unsigned cause;
    pose_t pose; /**< the last one within reach */
} envelope_pair_t;

/** The reach of a pair of axes from neutral.
 *  @param direction 0 to ENVELOPE_DIRECTIONS - 1: from the upper end of the first axis towards that of the other one */
envelope_pair_t envelope_pair(const envelope_t *self, unsigned axis, unsigned other, unsigned direction);

/** What an axis alone asks of the cylinder that moves most, anywhere in a box: speed, acceleration and jerk, mm/s to mm/s^3. */
typedef struct {
    double speed_mm_s, accel_mm_s2, jerk_mm_s3;
} envelope_demand_t;

envelope_demand_t envelope_demand(const envelope_rate_t *rate, const envelope_limits_t *limits);

/** Lowers limits to what the cylinders can serve while the axis moves alone, a little on the safe side and rounded down to three
 *  digits; what they can serve stays as it is.
 *  @param rate   the worst of where the axis is to move
 *  @param limits min and max are left as they are */
void envelope_suggest(const settings_t *settings, const envelope_rate_t *rate, envelope_limits_t *limits);

#endif

/* SPDX-License-Identifier: MIT
 * mechanism.h - what the judge knows of a platform: read from its configuration file by code that shares nothing with heaved.
 * Limits are whole numbers of 1e-9 mm or deg per cycle (per cycle^2, per cycle^3), as the set-points of a trace are printed.
 */
#ifndef JUDGE_MECHANISM_H
#define JUDGE_MECHANISM_H

#include <stdbool.h>
#include <stdint.h>

#define POSE_COLUMNS   6u
#define ANGLE_COLUMN   6u
#define FIRST_CYLINDER 7u
#define COLUMNS        13u
#define ORDERS         4u /**< 1 speed, 2 acceleration, 3 jerk; 0 is not used */

typedef enum { HEXAPOD, TRIPOD_GUIDED, TRIPOD_3RPS } mechanism_kind_t;

/** Bounds and rates of one column. The last printed decimal may be off by one unit: 1, 2 and 4 units in the three differences. */
typedef struct {
    int64_t low, high;     /**< 1e-9 u */
    int64_t most[ORDERS];  /**< largest difference of each order, rounding included */
    double exact[ORDERS];  /**< the limit itself, 1e-9 u per cycle^order */
    double stated[ORDERS]; /**< as in the file, u/s^order */
} bounds_t;

typedef struct {
    mechanism_kind_t kind;
    unsigned cylinders;
    uint64_t cycle_us;
    bool is_free[POSE_COLUMNS]; /**< axes that the mechanism moves by will */
    bool has_angle;
    bounds_t column[COLUMNS]; /**< of the columns in use; cylinders: stroke less margins */
    bounds_t engage;          /**< speed and acceleration of every cylinder while rising and settling */
    double base_mm[6][3];
    double arm_mm[6][3];   /**< plate joints from the motion reference point */
    double hinge_mm[3][3]; /**< 3-RPS: the same where ideal hinges hold them */
    double retracted_mm[6];
    double centre_mm[3]; /**< the motion reference point at pose zero */
} mechanism_t;

/** Reads a configuration. Says on stderr what is wrong with it.
 *  @return false: unreadable, or does not state what is needed */
bool mechanism_read(mechanism_t *self, const char *path);

/** Extension of each cylinder, mm, at a pose in deg and mm. */
void mechanism_extensions(const mechanism_t *self, const double pose[POSE_COLUMNS], double mm[6]);

/** How far a pose is from what guides or hinges allow, mm or deg. */
double mechanism_guide_error(const mechanism_t *self, const double pose[POSE_COLUMNS]);

#endif

/* SPDX-License-Identifier: MIT
 * lengths.h - where joints are, from distances between them. Pure.
 */
#ifndef HEAVE_SETUP_LENGTHS_H
#define HEAVE_SETUP_LENGTHS_H

#include <stdbool.h>

#define LENGTHS_JOINTS 6u
#define LENGTHS_PAIRS  15u /**< of six joints */

/** The two joints of a distance, from 0: 1-2, 1-3, ... 1-6, 2-3, ... 5-6. */
void lengths_pair(unsigned pair, unsigned *one, unsigned *other);

/** Which set of joints; they differ in where the pairs are. */
typedef enum { LENGTHS_BASE, LENGTHS_PLATE } lengths_set_t;

/** What follows from the distances. */
typedef struct {
    double joint_mm[LENGTHS_JOINTS][2]; /**< x forward, y to the right; the origin is their middle */
    double off_mm;                      /**< root mean square of what the distances differ from these joints */
    unsigned suspect;                   /**< the distance that does not go with the others */
    double suspect_mm;                  /**< what it is by the others; 0: none is suspected */
} lengths_found_t;

/** The joints that fit all fifteen distances best (least squares), numbered clockwise as seen from above, turned so that the
 * pairs stand where docs/geometry.md has them. One distance that is wrong is found by leaving out each in turn.
 *  @param distance_mm each above 0
 *  @return false: these are no distances of six points */
bool lengths_fit(lengths_set_t set, const double distance_mm[LENGTHS_PAIRS], lengths_found_t *out);

/** A regular hexagon of joints: three pairs on a circle.
 *  @param near_mm between the two of a pair
 *  @param far_mm between neighbours of different pairs, at least near_mm
 *  @param radius_mm, spread_deg out: the circle, and the angle between the two of a pair */
void lengths_circle(double near_mm, double far_mm, double *radius_mm, double *spread_deg);

#endif

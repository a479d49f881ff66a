/* SPDX-License-Identifier: MIT
 * response.h - the frequency response of an axis, from what was sent and what came back while a test signal was made. Pure.
 *
 * Set-point and feedback begin and end at rest. So their transforms over the whole record hold everything that the signal caused,
 * and their quotient is the response without a window (L. Ljung, System Identification (1999), section 6.3). Five neighbouring
 * frequencies are taken together, which also gives the coherence.
 */
#ifndef HEAVE_IDENTIFY_RESPONSE_H
#define HEAVE_IDENTIFY_RESPONSE_H

#include <stdbool.h>
#include <stddef.h>

#define RESPONSE_POINTS 25u

typedef struct {
    double hz;
    double gain;      /**< feedback over set-point */
    double phase_deg; /**< unwrapped; below 0: the feedback lags */
    double coherence; /**< 0 to 1: how much of the feedback the set-point explains */
} response_point_t;

typedef struct {
    bool is_moved;                           /**< the set-point was led, and the feedback followed: the rest counts only then */
    response_point_t point[RESPONSE_POINTS]; /**< by rising frequency, evenly on a logarithmic scale */
    double lag_ms;                           /**< of slow motion */
    double gain;                             /**< of slow motion */
    double gain_3db_hz;                      /**< where the gain falls below 0.708 first; 0: it does not in the band */
    double phase_90_hz;                      /**< where the phase falls below -90 degrees first; 0: likewise */
    double following_most;                   /**< largest difference of set-point and feedback, in the unit of the axis */
    double following_rms;
    double hysteresis; /**< width between up and down that no lag explains: backlash, friction */
} response_t;

/** Works a record out.
 *  @param sent,actual so many values, one for each cycle, from rest to rest
 *  @param from_hz,to_hz the band that the signal had */
void response_find(response_t *self, const double *sent, const double *actual, size_t count, double cycle_s, double from_hz,
                   double to_hz);

#endif

/* SPDX-License-Identifier: MIT
 * following.h - whether a platform goes where it is sent: a trace against the frames that were played. Shares nothing with
 * heaved.
 *
 * Judged where a sender is followed (ENGAGED, neither taking over nor pulled in), for each value that frames give:
 *
 *   range   it leaves the range of the last samples (of RANGE_US, the one before them, and where the space was entered) by no
 * more than it needs to stop from the speed it left with, and one step of the samples steady  in a stream that the limits allow,
 * some time after its start: it is where the samples of the last 5 periods are, and a step beside them at most rest    after the
 * end of the frames it rests on the last one, exactly
 *
 * Which streams the limits allow, and when frames have ended, stands in comments among the frames
 * (tests/property/make_streams.py):
 *
 *   ; steady FROM_MS TO_MS PERIOD_US
 *   ; rest FROM_MS TO_MS
 */
#ifndef JUDGE_FOLLOWING_H
#define JUDGE_FOLLOWING_H

#include <stdio.h>

#include "row.h"

typedef struct {
    uint64_t t_us;
    bool is_pose;
    int64_t value[COLUMNS]; /**< 1e-9; of the columns of its space */
    int64_t step[COLUMNS];  /**< how far it is from the samples before */
} sample_t;

typedef struct {
    uint64_t from_us, to_us, period_us; /**< period 0: at rest */
} claim_t;

typedef enum { FOLLOWING_RANGE, FOLLOWING_STEADY, FOLLOWING_REST, FOLLOWING_RULES } following_rule_t;

typedef struct {
    const mechanism_t *mechanism;
    sample_t *sample;
    claim_t *claim;
    unsigned long samples, claims;
    unsigned long next, claim_next; /**< the first that are not there yet, or not over */
    bool is_following;
    place_t place;
    uint64_t ranged_us; /**< when the ranges were found last */
    uint64_t entered_us;
    int64_t entered[COLUMNS];                   /**< where the space was entered */
    int64_t last[COLUMNS], last_speed[COLUMNS]; /**< of the row before */
    int64_t low[COLUMNS], high[COLUMNS];
    double room[COLUMNS][2]; /**< below and above the range, 1e-9 */
    uint64_t judged[FOLLOWING_RULES], broken[FOLLOWING_RULES];
    double worst[FOLLOWING_RULES]; /**< farthest beyond what is allowed, mm or deg */
    uint64_t found_us[FOLLOWING_RULES][COLUMNS];
    unsigned found;
} following_t;

/** Reads frames. Says on stderr what is wrong with them.
 *  @return false: unreadable, or none in it */
bool following_read(following_t *self, const mechanism_t *mechanism, const char *path);

/** Judges the next row; prints the first of what is wrong. */
void following_row(following_t *self, const row_t *row, FILE *to);

/** Prints what was judged.
 *  @return how much was broken */
uint64_t following_report(const following_t *self, FILE *to);

#endif

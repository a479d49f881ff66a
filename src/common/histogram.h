/* SPDX-License-Identifier: MIT
 * histogram.h - how long something took, counted in bins of 1 us: percentiles instead of means, which hide what matters.
 * One thread adds, any thread reads; nothing waits or allocates. Counts wrap after 2^32 of one length.
 */
#ifndef HEAVE_COMMON_HISTOGRAM_H
#define HEAVE_COMMON_HISTOGRAM_H

#include "heave/status.h"

#define HISTOGRAM_BINS 4096u /**< the last one holds everything longer */

/** Zeroed: empty. Members are private to histogram.c. */
typedef struct {
    uint32_t bin[HISTOGRAM_BINS];
    uint64_t most_us;
} histogram_t;

/** Adds one duration. */
void histogram_add(histogram_t *self, uint64_t us);

/** How many were added. */
uint64_t histogram_count(const histogram_t *self);

/** The durations that so many of 100000 do not exceed (50000: the median), for one share after the other, each at least as large
 * as the one before it: so are the durations then, whatever is added meanwhile, and none exceeds a longest one that is asked for
 * afterwards. The longest one where its bin is the last; 0 where nothing was added. */
void histogram_percentiles_us(const histogram_t *self, unsigned shares, const uint32_t *of_100000, uint64_t *us);

/** How many lasted from_us or longer, and less than below_us. What lasted HISTOGRAM_BINS - 1 us or longer counts as that long. */
uint64_t histogram_between(const histogram_t *self, uint64_t from_us, uint64_t below_us);

/** The longest one. */
uint64_t histogram_max_us(const histogram_t *self);

#endif

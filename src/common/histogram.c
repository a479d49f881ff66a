/* SPDX-License-Identifier: MIT
 * histogram.c - durations in bins; see histogram.h.
 */
#include "common/histogram.h"

static uint32_t bin_at(const histogram_t *self, unsigned i)
{
    return __atomic_load_n(&self->bin[i], __ATOMIC_RELAXED);
}

void histogram_add(histogram_t *self, uint64_t us)
{
    const unsigned i = us < HISTOGRAM_BINS - 1u ? (unsigned)us : HISTOGRAM_BINS - 1u;
    __atomic_store_n(&self->bin[i], self->bin[i] + 1u, __ATOMIC_RELAXED);
    if (us > self->most_us) {
        __atomic_store_n(&self->most_us, us, __ATOMIC_RELAXED);
    }
}

uint64_t histogram_count(const histogram_t *self)
{
    uint64_t count = 0;
    for (unsigned i = 0; i < HISTOGRAM_BINS; i++) {
        count += bin_at(self, i);
    }
    return count;
}

uint64_t histogram_percentile_us(const histogram_t *self, uint32_t of_100000)
{
    const uint64_t count = histogram_count(self);
    const uint64_t wanted = (count * of_100000 + 99999u) / 100000u; /* at least so many are to lie at or below */
    uint64_t seen = 0;
    for (unsigned i = 0; i < HISTOGRAM_BINS - 1u; i++) {
        seen += bin_at(self, i);
        if (seen >= wanted) {
            return count == 0 ? 0 : i;
        }
    }
    return histogram_max_us(self);
}

uint64_t histogram_between(const histogram_t *self, uint64_t from_us, uint64_t below_us)
{
    uint64_t count = 0;
    for (uint64_t i = from_us; i < below_us && i < HISTOGRAM_BINS; i++) {
        count += bin_at(self, (unsigned)i);
    }
    return count;
}

uint64_t histogram_max_us(const histogram_t *self)
{
    return __atomic_load_n(&self->most_us, __ATOMIC_RELAXED);
}

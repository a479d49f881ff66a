/* SPDX-License-Identifier: MIT
 * histogram.c - durations in bins; see histogram.h.
 */
#include "common/histogram.h"

static uint32_t bin_at(const histogram_t *self, unsigned i)
{
    return __atomic_load_n(&self->bin[i], __ATOMIC_ACQUIRE);
}

void histogram_add(histogram_t *self, uint64_t us)
{
    const unsigned i = us < HISTOGRAM_BINS - 1u ? (unsigned)us : HISTOGRAM_BINS - 1u;
    if (us > self->most_us) {
        __atomic_store_n(&self->most_us, us, __ATOMIC_RELAXED);
    }
    /* Release: who sees it in its bin sees that nothing is longer than the longest one. */
    __atomic_store_n(&self->bin[i], self->bin[i] + 1u, __ATOMIC_RELEASE);
}

uint64_t histogram_count(const histogram_t *self)
{
    uint64_t count = 0;
    for (unsigned i = 0; i < HISTOGRAM_BINS; i++) {
        count += bin_at(self, i);
    }
    return count;
}

void histogram_percentiles_us(const histogram_t *self, unsigned shares, const uint32_t *of_100000, uint64_t *us)
{
    const uint64_t count = histogram_count(self);
    uint64_t seen = 0;
    unsigned bin = 0;
    for (unsigned share = 0; share < shares; share++) {
        const uint64_t wanted = (count * of_100000[share] + 99999u) / 100000u; /* at least so many are to lie at or below */
        while (bin < HISTOGRAM_BINS - 1u && seen + bin_at(self, bin) < wanted) {
            seen += bin_at(self, bin++);
        }
        us[share] = bin < HISTOGRAM_BINS - 1u ? bin : histogram_max_us(self);
    }
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

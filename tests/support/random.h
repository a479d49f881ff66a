/* SPDX-License-Identifier: MIT
 * random.h - numbers that look random and are the same in every run: xorshift64 (Marsaglia, "Xorshift RNGs", 2003). Each file
 * that includes it has its own.
 */
#ifndef RANDOM_H
#define RANDOM_H

#include <stdint.h>

#define RANDOM_SEED UINT64_C(88172645463325252)

static uint64_t random_last = RANDOM_SEED;

/** Begins anew.
 *  @param seed not 0 */
static inline void random_begin(uint64_t seed)
{
    random_last = seed;
}

/** All 64 bits. */
static inline uint64_t random_bits(void)
{
    random_last ^= random_last << 13;
    random_last ^= random_last >> 7;
    random_last ^= random_last << 17;
    return random_last;
}

/** From 0 to limit - 1. */
static inline uint32_t random_below(uint32_t limit)
{
    return (uint32_t)((random_bits() >> 32) % limit);
}

/** From 0 to below 1. */
static inline double random_unit(void)
{
    return (double)(random_bits() >> 11) / 9007199254740992.0;
}

/** From low to below high. */
static inline double random_between(double low, double high)
{
    return low + (high - low) * random_unit();
}

#endif

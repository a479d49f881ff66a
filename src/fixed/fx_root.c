/* SPDX-License-Identifier: MIT
 * fx_root.c - exact integer square roots of 64 and 128 bits.
 * All begin with 1/sqrt to 31 bits: straight lines of a table (16 bits) and one Newton step. 64 bits: a product, one correction
 * by the remainder. 128 bits: a product, two corrections by the remainder, and one to the nearest; where the last bits of the
 * root are not asked for, the first correction is as a rule enough to know the others. Bounded time: no loop, no division.
 */
#include "heave/fx.h"

/* 1 / sqrt(i / 256) - 1 in Q16, for i from 64; less what makes straight lines between them too large and too small by as much. */
static const uint16_t k_inverse_root_q16[193] = {
    65535, 64522, 63533, 62567, 61621, 60696, 59792, 58906, 58039, 57189, 56357, 55542, 54743, 53959, 53191, 52437, 51698, 50972,
    50259, 49559, 48872, 48197, 47534, 46882, 46242, 45612, 44993, 44384, 43785, 43196, 42616, 42045, 41483, 40930, 40386, 39849,
    39321, 38801, 38288, 37783, 37285, 36794, 36310, 35833, 35363, 34899, 34441, 33990, 33545, 33105, 32672, 32244, 31821, 31405,
    30993, 30586, 30185, 29789, 29397, 29011, 28629, 28251, 27878, 27510, 27146, 26786, 26430, 26078, 25731, 25387, 25047, 24711,
    24378, 24050, 23724, 23403, 23085, 22770, 22458, 22150, 21845, 21543, 21245, 20949, 20656, 20367, 20080, 19796, 19515, 19236,
    18960, 18687, 18417, 18149, 17884, 17621, 17361, 17103, 16848, 16595, 16344, 16095, 15849, 15605, 15363, 15124, 14886, 14650,
    14417, 14186, 13956, 13729, 13503, 13280, 13058, 12838, 12620, 12404, 12190, 11977, 11766, 11557, 11349, 11143, 10939, 10737,
    10536, 10336, 10138, 9942,  9747,  9554,  9362,  9172,  8983,  8795,  8609,  8425,  8241,  8060,  7879,  7700,  7522,  7345,
    7170,  6995,  6823,  6651,  6480,  6311,  6143,  5976,  5810,  5646,  5482,  5320,  5159,  4999,  4840,  4682,  4525,  4369,
    4214,  4060,  3908,  3756,  3605,  3455,  3306,  3158,  3011,  2865,  2720,  2576,  2433,  2291,  2149,  2009,  1869,  1730,
    1592,  1455,  1319,  1183,  1049,  915,   782,   649,   518,   387,   257,   128,   0,
};

/* 1 / sqrt(x) in Q31 for x of [1/4, 1) in Q64, to about 2^-31. The excess x y^2 - 1 of the first guess y is below 2^-15, so that
 * it does not matter that the 1 is lost above; y - y * excess / 2 is better. */
HV_WRAPS static uint64_t inverse_root_q31(uint64_t x_q64)
{
    const unsigned line = (unsigned)(x_q64 >> 56) - 64;
    //@ split line;
    const uint16_t *low = &k_inverse_root_q16[line];
    const uint32_t slope_q24 = ((uint32_t)low[0] - low[1]) * (uint16_t)(x_q64 >> 40);
    const uint32_t guess_q20 = (UINT32_C(1) << 20) + ((((uint32_t)low[0] << 16) - slope_q24) >> 12);
    const int64_t excess_q72 = (int64_t)((x_q64 >> 32) * ((uint64_t)guess_q20 * guess_q20));
    return ((uint64_t)guess_q20 << 11) - (uint64_t)(((int64_t)guess_q20 * (excess_q72 >> 24)) >> 38);
}

/* floor(sqrt(value)) for value >= 2^62. */
HV_WRAPS static uint32_t root_normalised(uint64_t value)
{
    const uint64_t inverse_q31 = inverse_root_q31(value);
    const uint64_t product = ((value >> 32) * inverse_q31) >> 31;
    const uint64_t guess = product > UINT32_MAX ? UINT32_MAX : product;
    const int64_t guess_rest = (int64_t)(value - guess * guess); /* |.| < 2^38: the guess is within 2^5 */
    const uint64_t root = guess + (uint64_t)((int64_t)((uint64_t)guess_rest * (inverse_q31 >> 8)) >> 56);
    const int64_t rest = (int64_t)(value - root * root);
    if (rest < 0) {
        return (uint32_t)(root - 1);
    }
    return (uint32_t)(rest > (int64_t)(2 * root) ? root + 1 : root);
}

uint32_t fx_sqrt_u64(uint64_t value)
{
    if (value == 0) {
        return 0;
    }
    const unsigned half_shift = fx_leading_zeros(value) / 2;
    return root_normalised(value << (2 * half_shift)) >> half_shift;
}

/* Shifts left by 1 to 127. */
static fx_u128_t shift_left(fx_u128_t value, unsigned shift)
{
    if (shift >= 64) {
        return (fx_u128_t){value.lo << (shift - 64), 0};
    }
    return (fx_u128_t){(value.hi << shift) | (value.lo >> (64 - shift)), value.lo << shift};
}

/* sqrt of a value of [2^124, 2^126), at most 1.01 too small and 0.01 too large: 31 bits from the inverse, and two corrections by
 * what is left over remainder / (2 root). The first one is below 2^35 and leaves its square over 2^64, below 2^7. */
HV_WRAPS static uint64_t root_wide_normalised(fx_u128_t value)
{
    const int64_t inverse_q31 = (int64_t)inverse_root_q31((value.hi << 2) | (value.lo >> 62));
    const uint64_t upper = ((value.hi >> 30) * (uint64_t)inverse_q31) >> 32;
    const int64_t upper_rest = (int64_t)(value.hi - upper * upper);
    const uint64_t root =
        (upper << 32) + (uint64_t)fx_mul_high((int64_t)((uint64_t)upper_rest << 27), (int64_t)((uint64_t)inverse_q31 << 6));
    const fx_u128_t square = fx_square_u64(root);
    const uint64_t rest_hi = value.hi - square.hi - (value.lo < square.lo);
    const int64_t rest = (int64_t)((rest_hi << 33) | ((value.lo - square.lo) >> 31)); /* in 2^31 */
    return root + (uint64_t)fx_mul_high(rest, inverse_q31);
}

HV_WRAPS uint64_t fx_sqrt_u128(fx_u128_t value)
{
    if ((value.hi | value.lo) == 0) {
        return 0;
    }
    const unsigned zeros = value.hi != 0 ? fx_leading_zeros(value.hi) : 64 + fx_leading_zeros(value.lo);
    const unsigned half_shift = (zeros - 2) / 2;
    const uint64_t wide = root_wide_normalised(shift_left(value, 2 * half_shift));
    const int64_t root = (int64_t)((wide + (UINT64_C(1) << (half_shift - 1))) >> half_shift);
    const int64_t rest =
        (int64_t)(value.lo - (uint64_t)root * (uint64_t)root); /* below 2^63: root is the nearest or next to it */
    return (uint64_t)root + (rest > root) - (rest <= -root);
}

/* sqrt(value) * 2^31 for value >= 2^62, at most 64 off: 31 bits from the inverse, and one correction by remainder / (2 root). */
HV_WRAPS static uint64_t root_q31(uint64_t value)
{
    const uint64_t inverse_q31 = inverse_root_q31(value);
    const uint64_t upper = ((value >> 32) * inverse_q31) >> 31;
    const int64_t rest = (int64_t)(value - upper * upper); /* upper is within 5: |rest| * inverse is below 2^67 */
    return (upper << 31) + (uint64_t)((int64_t)((uint64_t)(rest >> 5) * inverse_q31) >> 28);
}

/* Roots of [2^-12, 2^14) in Q45 are known to 5: 64 / 2^4, and 1 for what is cut off. */
#define SQUARE_HI_MAX  (UINT64_C(1) << 52)
#define ROOT_ERROR_Q45 5u

HV_WRAPS q32_t fx_root_q32(fx_u128_t square_q88)
{
    if (!HV_RARELY(square_q88.hi - 1 >= SQUARE_HI_MAX - 1)) {
        const unsigned zeros = fx_leading_zeros(square_q88.hi) & ~1u; /* 12 at least */
        const uint64_t root = root_q31((square_q88.hi << zeros) | (square_q88.lo >> (64 - zeros)));
        const uint64_t with_halves_q45 = (root >> (zeros / 2 - 2)) + (1u << 12) + 1; /* of both roundings */
        const uint64_t low_q32 = (with_halves_q45 - ROOT_ERROR_Q45) >> 13;
        if (!HV_RARELY(low_q32 != (with_halves_q45 + ROOT_ERROR_Q45) >> 13)) {
            return (q32_t)low_q32;
        }
    }
    return fx_shift_round((int64_t)fx_sqrt_u128(square_q88), 12);
}

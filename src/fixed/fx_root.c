/* SPDX-License-Identifier: MIT
 * fx_root.c - exact integer square roots of 64 and 128 bits.
 * 64 bits: a table of 1/sqrt with 8 bits, two Newton steps on it (15, then 29 bits), a product, one correction by the remainder.
 * 128 bits: the same inverse, a product, two corrections by the remainder, and one to the nearest. Bounded time: no loop, no
 * division.
 */
#include "heave/fx.h"

/* 2^15 / sqrt(x) at the middle of [i, i + 1) / 256, for i from 64. */
static const uint16_t k_inverse_root_q15[192] = {
    65281, 64781, 64292, 63814, 63347, 62889, 62442, 62004, 61575, 61154, 60742, 60339, 59943, 59555, 59175, 58801, 58435, 58075,
    57722, 57376, 57035, 56700, 56372, 56049, 55731, 55419, 55112, 54810, 54513, 54221, 53933, 53650, 53371, 53097, 52826, 52560,
    52298, 52040, 51785, 51535, 51288, 51044, 50804, 50567, 50333, 50103, 49876, 49652, 49430, 49212, 48997, 48784, 48574, 48367,
    48163, 47961, 47761, 47564, 47370, 47178, 46988, 46800, 46615, 46432, 46251, 46072, 45895, 45720, 45547, 45376, 45207, 45040,
    44875, 44711, 44550, 44390, 44232, 44075, 43920, 43767, 43615, 43465, 43316, 43169, 43024, 42879, 42737, 42595, 42456, 42317,
    42180, 42044, 41910, 41776, 41644, 41514, 41384, 41256, 41129, 41003, 40878, 40754, 40631, 40510, 40390, 40270, 40152, 40035,
    39919, 39803, 39689, 39576, 39464, 39352, 39242, 39133, 39024, 38916, 38810, 38704, 38599, 38494, 38391, 38289, 38187, 38086,
    37986, 37887, 37788, 37690, 37593, 37497, 37401, 37307, 37213, 37119, 37027, 36935, 36843, 36753, 36663, 36573, 36485, 36397,
    36309, 36222, 36136, 36051, 35966, 35882, 35798, 35715, 35632, 35550, 35469, 35388, 35307, 35228, 35148, 35070, 34991, 34914,
    34837, 34760, 34684, 34608, 34533, 34458, 34384, 34310, 34237, 34164, 34092, 34020, 33949, 33878, 33807, 33737, 33668, 33599,
    33530, 33461, 33393, 33326, 33259, 33192, 33126, 33060, 32994, 32929, 32864, 32800,
};

/* 1 / sqrt(x) in Q31 for x of [1/4, 1) in Q64, to about 2^-29. A Newton step is y (3 - x y^2) / 2. */
static uint64_t inverse_root_q31(uint64_t x_q64)
{
    const uint64_t x_q32 = x_q64 >> 32;
    const uint64_t seed_q15 = k_inverse_root_q15[(x_q64 >> 56) - 64];
    const uint64_t seed_defect_q62 = 3 * (UINT64_C(1) << 62) - x_q32 * (seed_q15 * seed_q15);
    const uint64_t better_q30 = (seed_q15 * (seed_defect_q62 >> 32) + (UINT64_C(1) << 15)) >> 16;
    const uint64_t defect_q62 = 3 * (UINT64_C(1) << 62) - x_q32 * (better_q30 * better_q30 >> 30);
    return better_q30 * (defect_q62 >> 31) >> 31;
}

/* floor(sqrt(value)) for value >= 2^62. */
HV_WRAPS static uint32_t root_normalised(uint64_t value)
{
    const uint64_t inverse_q31 = inverse_root_q31(value);
    const uint64_t product = ((value >> 32) * inverse_q31) >> 31;
    const uint64_t guess = product > UINT32_MAX ? UINT32_MAX : product;
    const int64_t guess_rest = (int64_t)(value - guess * guess); /* |.| < 2^38: the guess is within 2^5 */
    const uint64_t root = guess + (uint64_t)((guess_rest * (int64_t)(inverse_q31 >> 8)) >> 56);
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

/* Shifts left by less than 128. */
static fx_u128_t shift_left(fx_u128_t value, unsigned shift)
{
    if (shift >= 64) {
        return (fx_u128_t){value.lo << (shift - 64), 0};
    }
    if (shift == 0) {
        return value;
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
    const uint64_t root = (upper << 32) + (uint64_t)fx_mul_high(upper_rest * (1 << 27), inverse_q31 * (1 << 6));
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
    return (uint64_t)(root + (rest > root) - (rest <= -root));
}

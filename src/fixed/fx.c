/* SPDX-License-Identifier: MIT
 * fx.c - fixed-point arithmetic that is not inline in fx.h: saturation, rounding to Q16.16, multiply-divide.
 * Owns nothing. Holds the checks of what the fixed-point code takes for granted about the compiler.
 */
#include "heave/fx.h"

/* C99 leaves both to the compiler; every one we build with behaves so, and any other must fail here. */
typedef char fx_assert_arithmetic_right_shift[((int64_t)-3 >> 1) == -2 ? 1 : -1];
typedef char fx_assert_wrapping_conversion[(int64_t)UINT64_MAX == -1 ? 1 : -1];

#if defined(__OPTIMIZE_SIZE__) && (!defined(__SIZEOF_INT128__) || defined(HEAVE_FX_PORTABLE))
int64_t fx_wide_mul_shift(int64_t a, int64_t b, unsigned shift)
{
    return fx_wide_mul_shift_portable(a, b, shift);
}

int64_t fx_wide_mul_high(int64_t a, int64_t b)
{
    return fx_wide_mul_high_portable(a, b);
}
#endif

q16_t q16_from_q32(q32_t value_q32)
{
    const int64_t floor_q16 = value_q32 >> 16;
    const int64_t rest = value_q32 & 0xFFFF;
    const int64_t nearest = floor_q16 + (rest > 0x8000 || (rest == 0x8000 && (floor_q16 & 1) != 0));
    return (q16_t)fx_clamp(nearest, INT32_MIN, INT32_MAX);
}

int64_t fx_add_sat(int64_t a, int64_t b)
{
    if (b > 0 && a > INT64_MAX - b) {
        return INT64_MAX;
    }
    if (b < 0 && a < INT64_MIN - b) {
        return INT64_MIN;
    }
    return a + b;
}

int64_t fx_sub_sat(int64_t a, int64_t b)
{
    if (b < 0 && a > INT64_MAX + b) {
        return INT64_MAX;
    }
    if (b > 0 && a < INT64_MIN + b) {
        return INT64_MIN;
    }
    return a - b;
}

/* One digit of the long division below: the largest q < 2^32 with q * divisor <= remainder * 2^32 + digit.
 * divisor has its top bit set and remainder < divisor; the guess from the top half is at most 2 too large. */
HV_WRAPS static uint64_t divide_digit(uint64_t *remainder, uint64_t digit, uint64_t divisor)
{
    const uint64_t top = divisor >> 32, bottom = divisor & UINT32_MAX;
    uint64_t quotient = *remainder / top;
    uint64_t rest = *remainder % top;
    while (quotient > UINT32_MAX || quotient * bottom > ((rest << 32) | digit)) {
        quotient--;
        rest += top;
        if (rest > UINT32_MAX) {
            break;
        }
    }
    *remainder = (*remainder << 32) + digit - quotient * divisor; /* fits, although the terms wrap */
    return quotient;
}

/* floor(value / divisor) for value.hi < divisor, in two digits of 32 bits. */
static uint64_t divide_u128(fx_u128_t value, uint64_t divisor)
{
    if (value.hi == 0) {
        return value.lo / divisor; /* most of them: no digit to guess */
    }
    const unsigned shift = fx_leading_zeros(divisor);
    if (shift != 0) {
        divisor <<= shift;
        value.hi = (value.hi << shift) | (value.lo >> (64 - shift));
        value.lo <<= shift;
    }
    uint64_t remainder = value.hi;
    const uint64_t high = divide_digit(&remainder, value.lo >> 32, divisor);
    return (high << 32) | divide_digit(&remainder, value.lo & UINT32_MAX, divisor);
}

/* |value| as unsigned, exact for INT64_MIN too. */
HV_WRAPS static uint64_t magnitude(int64_t value)
{
    return value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
}

HV_WRAPS int64_t fx_mul_div(int64_t a, int64_t b, int64_t divisor)
{
    const bool is_negative = ((a < 0) != (b < 0)) != (divisor < 0);
    const fx_u128_t product = FX_WIDE_PRODUCT(magnitude(a), magnitude(b));
    const uint64_t limit = (uint64_t)INT64_MAX + is_negative;
    const uint64_t exact = product.hi < magnitude(divisor) ? divide_u128(product, magnitude(divisor)) : UINT64_MAX;
    const uint64_t result = exact < limit ? exact : limit;
    return (int64_t)(is_negative ? 0 - result : result);
}

/* SPDX-License-Identifier: MIT
 * fx_wide.h - exact 64 x 64 -> 128-bit products and their rounded shift, in two forms that give the same bits.
 * The native form uses the compiler's 128-bit integers, the portable form is C99; fx.h picks one, the tests compare both.
 * For use by fx.h and its tests only. Inline, because these are the innermost operations of every cycle.
 */
#ifndef HEAVE_FX_WIDE_H
#define HEAVE_FX_WIDE_H

#include <stdint.h>

/** An unsigned 128-bit value, for sums of squares. */
typedef struct {
    uint64_t hi;
    uint64_t lo;
} fx_u128_t;

/** The exact product of two magnitudes, from four 32-bit products. */
static inline fx_u128_t fx_wide_product_portable(uint64_t a, uint64_t b)
{
    const uint64_t a_lo = a & UINT32_MAX, a_hi = a >> 32, b_lo = b & UINT32_MAX, b_hi = b >> 32;
    const uint64_t low = a_lo * b_lo;
    const uint64_t middle = a_hi * b_lo + (low >> 32);
    const uint64_t carry = a_lo * b_hi + (middle & UINT32_MAX);
    return (fx_u128_t){a_hi * b_hi + (middle >> 32) + (carry >> 32), (carry << 32) | (low & UINT32_MAX)};
}

/** The sum of two 128-bit values; wraps at 2^128, and so adds two's complement values too. */
static inline fx_u128_t fx_wide_add(fx_u128_t a, fx_u128_t b)
{
    const uint64_t lo = a.lo + b.lo;
    return (fx_u128_t){a.hi + b.hi + (lo < a.lo), lo};
}

/** The exact signed product in two's complement. */
static inline fx_u128_t fx_wide_signed_product_portable(int64_t a, int64_t b)
{
    const fx_u128_t product = fx_wide_product_portable((uint64_t)a, (uint64_t)b);
    return (fx_u128_t){product.hi - (a < 0 ? (uint64_t)b : 0) - (b < 0 ? (uint64_t)a : 0), product.lo};
}

/** A two's complement value / 2^shift, rounded half up, saturated; |value| + 2^(shift - 1) below 2^127. */
static inline int64_t fx_wide_shift_portable(fx_u128_t value, unsigned shift)
{
    const fx_u128_t half = {shift <= 64 ? 0 : UINT64_C(1) << (shift - 65), shift <= 64 ? UINT64_C(1) << (shift - 1) : 0};
    const fx_u128_t sum = fx_wide_add(value, half);
    const int64_t hi = (int64_t)sum.hi;
    if (shift >= 64) {
        return hi >> (shift - 64);
    }
    const int64_t above = hi >> (shift - 1);
    if (above != 0 && above != -1) {
        return hi < 0 ? INT64_MIN : INT64_MAX;
    }
    return (int64_t)((sum.hi << (64 - shift)) | (sum.lo >> shift));
}

/** fx_mul_shift() and fx_mul_shift_fit(). */
static inline int64_t fx_wide_mul_shift_portable(int64_t a, int64_t b, unsigned shift)
{
    return fx_wide_shift_portable(fx_wide_signed_product_portable(a, b), shift);
}

/** fx_square3(), from sums of the products of halves: with values of at most 2^61 none of them is above 2^64. */
static inline fx_u128_t fx_wide_square3_portable(const int64_t v[3])
{
    uint64_t high = 0, middle = 0, low_hi = 0, low_lo = 0;
    for (unsigned i = 0; i < 3; i++) {
        const uint64_t magnitude = (uint64_t)(v[i] < 0 ? -v[i] : v[i]);
        const uint32_t hi = (uint32_t)(magnitude >> 32), lo = (uint32_t)magnitude;
        const uint64_t low = (uint64_t)lo * lo;
        high += (uint64_t)hi * hi;
        middle += (uint64_t)hi * lo;
        low_hi += low >> 32;
        low_lo += low & UINT32_MAX;
    }
    middle = 2 * middle + low_hi + (low_lo >> 32);
    return (fx_u128_t){high + (middle >> 32), (middle << 32) | (low_lo & UINT32_MAX)};
}

/** fx_mul_high(): halves with their signs, so that nothing has to be taken off for signs afterwards. */
static inline int64_t fx_wide_mul_high_portable(int64_t a, int64_t b)
{
    const int32_t a_hi = (int32_t)(a >> 32), b_hi = (int32_t)(b >> 32);
    const uint32_t a_lo = (uint32_t)a, b_lo = (uint32_t)b;
    const int64_t middle = a_hi * (int64_t)b_lo + (int64_t)(((uint64_t)a_lo * b_lo) >> 32);
    const int64_t carry = b_hi * (int64_t)a_lo + (int64_t)(uint32_t)middle;
    return (int64_t)a_hi * b_hi + (middle >> 32) + (carry >> 32);
}

#if defined(__SIZEOF_INT128__)

__extension__ typedef __int128 fx_wide_int_t;
__extension__ typedef unsigned __int128 fx_wide_uint_t;

/** The exact product of two magnitudes. */
static inline fx_u128_t fx_wide_product_native(uint64_t a, uint64_t b)
{
    const fx_wide_uint_t product = (fx_wide_uint_t)a * b;
    return (fx_u128_t){(uint64_t)(product >> 64), (uint64_t)product};
}

/** fx_mul_shift() by 128-bit integers. */
static inline int64_t fx_wide_mul_shift_native(int64_t a, int64_t b, unsigned shift)
{
    const fx_wide_int_t product = (fx_wide_int_t)a * b + ((fx_wide_int_t)1 << (shift - 1));
    const int64_t result = (int64_t)(product >> shift);
    if ((product >> shift) != result) {
        return product < 0 ? INT64_MIN : INT64_MAX;
    }
    return result;
}

/** A value / 2^shift, rounded half up, known to fit. Joined from halves where it can be, as double-word shifts are slow. */
static inline int64_t fx_wide_shift_fit_native(fx_wide_int_t value, unsigned shift)
{
    const fx_wide_int_t sum = value + ((fx_wide_int_t)1 << (shift - 1));
    if (shift >= 64) {
        return (int64_t)(sum >> shift);
    }
    return (int64_t)(((uint64_t)(sum >> 64) << (64 - shift)) | ((uint64_t)sum >> shift));
}

/** fx_mul_shift_fit() by 128-bit integers. */
static inline int64_t fx_wide_mul_shift_fit_native(int64_t a, int64_t b, unsigned shift)
{
    return fx_wide_shift_fit_native((fx_wide_int_t)a * b, shift);
}

/** fx_square3() by 128-bit integers. */
static inline fx_u128_t fx_wide_square3_native(const int64_t v[3])
{
    const fx_wide_int_t sum = (fx_wide_int_t)v[0] * v[0] + (fx_wide_int_t)v[1] * v[1] + (fx_wide_int_t)v[2] * v[2];
    return (fx_u128_t){(uint64_t)(sum >> 64), (uint64_t)sum};
}

/** fx_mul_high() by 128-bit integers. */
static inline int64_t fx_wide_mul_high_native(int64_t a, int64_t b)
{
    return (int64_t)(((fx_wide_int_t)a * b) >> 64);
}

#endif

#if defined(__SIZEOF_INT128__) && !defined(HEAVE_FX_PORTABLE)
#define FX_WIDE_PRODUCT       fx_wide_product_native
#define FX_WIDE_MUL_SHIFT     fx_wide_mul_shift_native
#define FX_WIDE_MUL_SHIFT_FIT fx_wide_mul_shift_fit_native
#define FX_WIDE_SQUARE3       fx_wide_square3_native
#define FX_WIDE_MUL_HIGH      fx_wide_mul_high_native
#else
#define FX_WIDE_PRODUCT fx_wide_product_portable
#define FX_WIDE_SQUARE3 fx_wide_square3_portable
#if defined(__OPTIMIZE_SIZE__)
/** One copy for all files, in fx.c: each is called in a dozen. */
int64_t fx_wide_mul_shift(int64_t a, int64_t b, unsigned shift);
int64_t fx_wide_mul_high(int64_t a, int64_t b);
#define FX_WIDE_MUL_SHIFT     fx_wide_mul_shift
#define FX_WIDE_MUL_SHIFT_FIT fx_wide_mul_shift
#define FX_WIDE_MUL_HIGH      fx_wide_mul_high
#else
#define FX_WIDE_MUL_SHIFT     fx_wide_mul_shift_portable
#define FX_WIDE_MUL_SHIFT_FIT fx_wide_mul_shift_portable
#define FX_WIDE_MUL_HIGH      fx_wide_mul_high_portable
#endif
#endif

#endif

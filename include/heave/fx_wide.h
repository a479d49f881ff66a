/* SPDX-License-Identifier: MIT
 * fx_wide.h - exact 64 x 64 -> 128-bit products and their rounded shift, in two forms that give the same bits.
 * The native form uses the compiler's 128-bit integers, the portable form is C99; fx.h picks one, the tests compare both.
 * For use by fx.h and its tests only. Inline, because these are the innermost operations of every cycle.
 */
#ifndef HEAVE_FX_WIDE_H
#define HEAVE_FX_WIDE_H

#include "heave/status.h"

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

/** A value below 2^63 - 2^31 is high * 2^32 + low with both signed: products of such halves need nothing taken off for signs.
 * Sums of them are unsigned, as the ends of their ranges meet nowhere but on paper. */
static inline int32_t fx_wide_low(int64_t value)
{
    return (int32_t)(uint32_t)value;
}

HV_WRAPS static inline int32_t fx_wide_high(int64_t value)
{
    return (int32_t)((uint32_t)(value >> 32) + ((uint32_t)value >> 31));
}

/** The product of two halves. */
static inline uint64_t fx_wide_halves(int32_t a, int32_t b)
{
    return (uint64_t)((int64_t)a * b);
}

/** The upper half of a sum of such products. */
static inline int64_t fx_wide_upper(uint64_t sum)
{
    return (int64_t)sum >> 32;
}

/** fx_square3(), from sums of the products of halves: with values of at most 2^61 none of them leaves 64 bits. */
HV_WRAPS static inline fx_u128_t fx_wide_square3_portable(const int64_t v[3])
{
    const int32_t hi[3] = {fx_wide_high(v[0]), fx_wide_high(v[1]), fx_wide_high(v[2])};
    const int32_t lo[3] = {fx_wide_low(v[0]), fx_wide_low(v[1]), fx_wide_low(v[2])};
    const uint64_t high = fx_wide_halves(hi[0], hi[0]) + fx_wide_halves(hi[1], hi[1]) + fx_wide_halves(hi[2], hi[2]);
    const uint64_t low = fx_wide_halves(lo[0], lo[0]) + fx_wide_halves(lo[1], lo[1]) + fx_wide_halves(lo[2], lo[2]);
    const uint64_t twice = fx_wide_halves(hi[0], lo[0]) + fx_wide_halves(hi[1], lo[1]) + fx_wide_halves(hi[2], lo[2]);
    const uint64_t middle = 2 * twice + (low >> 32);
    return (fx_u128_t){high + (uint64_t)fx_wide_upper(middle), (middle << 32) | (low & UINT32_MAX)};
}

/** fx_mul_high(). */
HV_WRAPS static inline int64_t fx_wide_mul_high_portable(int64_t a, int64_t b)
{
    const int32_t a_hi = fx_wide_high(a), a_lo = fx_wide_low(a), b_hi = fx_wide_high(b), b_lo = fx_wide_low(b);
    const uint64_t carry = (uint64_t)fx_wide_upper(fx_wide_halves(a_lo, b_lo));
    const uint64_t middle = fx_wide_halves(a_hi, b_lo) + fx_wide_halves(a_lo, b_hi) + carry;
    return (int64_t)(fx_wide_halves(a_hi, b_hi) + (uint64_t)fx_wide_upper(middle));
}

/** fx_dot2_high(): half the multiplications, as half of each factor b is 0. Its other half is taken unsigned, as gcc takes a
 * product with a signed one for one of 64 by 64 bits. */
HV_WRAPS static inline int64_t fx_wide_dot2_high_portable(const int64_t a[2], const int64_t b[2])
{
    const int32_t b_0 = (int32_t)(uint32_t)((uint64_t)b[0] >> 32), b_1 = (int32_t)(uint32_t)((uint64_t)b[1] >> 32);
    const int64_t low_0 = fx_wide_upper(fx_wide_halves(fx_wide_low(a[0]), b_0));
    const int64_t low_1 = fx_wide_upper(fx_wide_halves(fx_wide_low(a[1]), b_1));
    const int32_t low = (int32_t)((uint32_t)low_0 + (uint32_t)low_1);
    const uint64_t high = fx_wide_halves(fx_wide_high(a[0]), b_0) + fx_wide_halves(fx_wide_high(a[1]), b_1);
    return (int64_t)(high + (uint64_t)(int64_t)low);
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

/** fx_dot2_high() by 128-bit integers. */
static inline int64_t fx_wide_dot2_high_native(const int64_t a[2], const int64_t b[2])
{
    return fx_wide_mul_high_native(a[0], b[0]) + fx_wide_mul_high_native(a[1], b[1]);
}

#endif

#if defined(__SIZEOF_INT128__) && !defined(HEAVE_FX_PORTABLE)
#define FX_WIDE_PRODUCT       fx_wide_product_native
#define FX_WIDE_MUL_SHIFT     fx_wide_mul_shift_native
#define FX_WIDE_MUL_SHIFT_FIT fx_wide_mul_shift_fit_native
#define FX_WIDE_SQUARE3       fx_wide_square3_native
#define FX_WIDE_MUL_HIGH      fx_wide_mul_high_native
#define FX_WIDE_MUL_HIGH_HERE fx_wide_mul_high_native
#define FX_WIDE_DOT2_HIGH     fx_wide_dot2_high_native
#else
#define FX_WIDE_PRODUCT   fx_wide_product_portable
#define FX_WIDE_SQUARE3   fx_wide_square3_portable
#define FX_WIDE_DOT2_HIGH fx_wide_dot2_high_portable
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
#if defined(__OPTIMIZE_SIZE__) && defined(HV_LONG_PRODUCTS_ARE_CALLS)
#define FX_WIDE_MUL_HIGH_HERE FX_WIDE_MUL_HIGH
#else
#define FX_WIDE_MUL_HIGH_HERE fx_wide_mul_high_portable
#endif
#endif

#endif

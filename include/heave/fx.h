/* SPDX-License-Identifier: MIT
 * fx.h - fixed-point numbers: the Q formats, checked arithmetic on them, sine and cosine, square root.
 * Owns nothing, keeps no state; every function is pure, bounded in time and gives the same bits on every CPU and compiler.
 * This is the only place of the core where a value is shifted from one format to another.
 */
#ifndef HEAVE_FX_H
#define HEAVE_FX_H

#include "heave/fx_wide.h"
#include "heave/status.h"

typedef int32_t q16_t; /**< Q16.16: +-32768, step 2^-16 (15.3 nm in mm). The format of frames and configuration. */
typedef int64_t q32_t; /**< Q31.32: +-2^31, step 2^-32 (0.23 pm in mm). Poses, extensions and all motion state. */
typedef int64_t q62_t; /**< Q1.62: +-2, step 2^-62. Sines, cosines, rotation matrix elements, unit vectors. */

#define Q16_ONE ((q16_t)1 << 16)
#define Q32_ONE ((q32_t)1 << 32)
#define Q62_ONE ((q62_t)1 << 62)

/** Exact: every Q16.16 value has a Q32 value. */
/*@ assigns \nothing;
    ensures \result == value_q16 * 65536; */
static inline q32_t q32_from_q16(q16_t value_q16)
{
    return (q32_t)value_q16 * 65536;
}

/** Exact for |value| < 2^31. */
/*@ requires -INT32_MAX <= value;
    assigns \nothing;
    ensures \result == value * Q32_ONE; */
static inline q32_t q32_from_int(int32_t value)
{
    return (q32_t)value * Q32_ONE;
}

/** Nearest Q16.16, ties to even; saturates at the ends of Q16.16. */
q16_t q16_from_q32(q32_t value_q32);

/** a * b / 2^shift, rounded half up (towards plus infinity), from the exact 128-bit product.
 *  @param shift 1 to 126
 *  Saturates at INT64_MIN / INT64_MAX where the result does not fit. */
static inline int64_t fx_mul_shift(int64_t a, int64_t b, unsigned shift)
{
    return FX_WIDE_MUL_SHIFT(a, b, shift);
}

/** fx_mul_shift without saturation, for inner loops: the caller guarantees that the result fits. */
static inline int64_t fx_mul_shift_fit(int64_t a, int64_t b, unsigned shift)
{
    return FX_WIDE_MUL_SHIFT_FIT(a, b, shift);
}

/** Upper limit of the operands of fx_mul_high(): 2^63 - 2^31. */
#define FX_HIGH_LIMIT (INT64_MAX - INT32_MAX)

/** a * b / 2^64, rounded down: the cheapest wide product. Formats are chosen so that a shift by 64 is right.
 *  @param a,b below FX_HIGH_LIMIT */
/*@ assigns \result \from a, b;
    ensures a < FX_HIGH_LIMIT && b < FX_HIGH_LIMIT ==> \result == (a * b) >> 64; */
static inline int64_t fx_mul_high(int64_t a, int64_t b)
{
    return FX_WIDE_MUL_HIGH(a, b);
}

/** fx_mul_high() in place where code is made for size too: for functions marked HV_INNER_LOOP. */
/*@ assigns \result \from a, b;
    ensures a < FX_HIGH_LIMIT && b < FX_HIGH_LIMIT ==> \result == (a * b) >> 64; */
static inline int64_t fx_mul_high_here(int64_t a, int64_t b)
{
    return FX_WIDE_MUL_HIGH_HERE(a, b);
}

/** fx_mul_high(a[0], b[0]) + fx_mul_high(a[1], b[1]), at half the cost where a word has 32 bits.
 *  @param a below FX_HIGH_LIMIT
 *  @param b whole multiples of 2^32, -2^61 to 2^61 */
static inline int64_t fx_dot2_high(const int64_t a[2], const int64_t b[2])
{
    return FX_WIDE_DOT2_HIGH(a, b);
}

/** The exact sum of the squares of three values from -2^61 to 2^61. */
static inline fx_u128_t fx_square3(const int64_t v[3])
{
    return FX_WIDE_SQUARE3(v);
}

/** value / 2^shift, rounded down.
 *  @param shift 0 to 63 */
static inline int64_t fx_shift_down(int64_t value, unsigned shift)
{
    return value >> shift;
}

/** value / 2^shift, rounded half up (towards plus infinity).
 *  @param shift 1 to 62 */
static inline int64_t fx_shift_round(int64_t value, unsigned shift)
{
    return (value >> shift) + ((value >> (shift - 1)) & 1);
}

/** a * b / divisor, truncated towards zero, from the exact 128-bit product.
 *  Saturates where the result does not fit; a divisor of 0 saturates by the signs of a and b.
 *  Slower than fx_mul_shift: not for the inner loops of a cycle. */
/*@ assigns \result \from a, b, divisor; */
int64_t fx_mul_div(int64_t a, int64_t b, int64_t divisor);

/** a + b and a - b, saturating. */
/*@ assigns \nothing;
    ensures \result == (a + b > INT64_MAX ? INT64_MAX : a + b < INT64_MIN ? INT64_MIN : a + b); */
int64_t fx_add_sat(int64_t a, int64_t b);
/*@ assigns \nothing;
    ensures \result == (a - b > INT64_MAX ? INT64_MAX : a - b < INT64_MIN ? INT64_MIN : a - b); */
int64_t fx_sub_sat(int64_t a, int64_t b);

/* The next two are used in a hundred places: where size counts they are called, and the linker keeps one copy. */
#if defined(__OPTIMIZE_SIZE__) && defined(__GNUC__)
#define FX_OFTEN __attribute__((weak))
FX_OFTEN int64_t fx_clamp(int64_t value, int64_t low, int64_t high);
FX_OFTEN int64_t fx_abs(int64_t value);
#else
#define FX_OFTEN static inline
#endif

/** Limits value to [low, high]; low <= high. */
/*@ requires low <= high;
    assigns \nothing;
    ensures \result == (value < low ? low : value > high ? high : value); */
FX_OFTEN int64_t fx_clamp(int64_t value, int64_t low, int64_t high)
{
    return value < low ? low : value > high ? high : value;
}

/** |value|; INT64_MIN gives INT64_MAX. */
/*@ assigns \nothing;
    ensures \result == (value == INT64_MIN ? INT64_MAX : \abs(value)); */
FX_OFTEN int64_t fx_abs(int64_t value)
{
    return value >= 0 ? value : value == INT64_MIN ? INT64_MAX : -value;
}

/** Leading zero bits of a value that is not 0: 0 to 63. */
static inline unsigned fx_leading_zeros(uint64_t value)
{
#if defined(__GNUC__)
    return (unsigned)__builtin_clzll(value);
#else
    unsigned count = 0;
    for (unsigned width = 32; width != 0; width /= 2) {
        if (value >> (64 - width) == 0) {
            count += width;
            value <<= width;
        }
    }
    return count;
#endif
}

/** The exact square of a 64-bit magnitude, and the sum of two 128-bit values (wraps at 2^128). */
static inline fx_u128_t fx_square_u64(uint64_t value)
{
    return FX_WIDE_PRODUCT(value, value);
}

static inline fx_u128_t fx_add_u128(fx_u128_t a, fx_u128_t b)
{
    return fx_wide_add(a, b);
}

/** floor(sqrt(value)), exact for every value. */
uint32_t fx_sqrt_u64(uint64_t value);

/** sqrt of a 128-bit value below 2^124, rounded to the nearest integer; exact rounding for every value.
 *  The square root of a sum of Q32 squares (a Q64 value) is the length in Q32. */
uint64_t fx_sqrt_u128(fx_u128_t value);

/** sqrt of a Q88 value below 2^124 in Q32: fx_sqrt_u128() of it, which is Q44, rounded half up. At half the cost for roots of
 *  [2^-12, 2^14), where one value in 800 needs all bits of the root in Q44 to be worked out. */
q32_t fx_root_q32(fx_u128_t square_q88);

/** Largest error of fx_sincos_deg in LSB of Q62 (2.2e-19 each). */
#define FX_SINCOS_MAX_ERROR_Q62 2

/** Sine and cosine of an angle in degrees, any Q32 value (whole turns are taken off exactly).
 *  Error at most FX_SINCOS_MAX_ERROR_Q62 LSB of Q62 against the exact value. Exact at multiples of 90 degrees. */
void fx_sincos_deg(q32_t angle_deg_q32, q62_t *sin_q62, q62_t *cos_q62);

#endif

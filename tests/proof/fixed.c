/* SPDX-License-Identifier: MIT
 * fixed.c - the entry points of tools/proof into src/fixed: all values that fx.h allows.
 * Values are handed in by their number of bits: shifts by leading zeros are followed exactly then.
 */
#include "any.h"

#include "heave/counts.h"
#include "heave/fx.h"

/* Any number whose highest bit is this one. */
static uint64_t any_with_top_bit(unsigned bit)
{
    const uint64_t low = UINT64_C(1) << bit;
    return Frama_C_unsigned_long_long_interval(low, low + (low - 1));
}

void proof_rounding(void)
{
    const int64_t a = ANY_I64();
    (void)fx_abs(a);
    (void)fx_clamp(a, INT32_MIN, INT32_MAX);
    (void)q16_from_q32(a);
    (void)q32_from_q16(ANY_I32());
    (void)q32_from_int((int32_t)ANY_OF(-2147483647, 2147483647));
    (void)fx_shift_down(a, (unsigned)ANY_OF(0, 63));
    (void)fx_shift_round(a, (unsigned)ANY_OF(1, 62));
}

void proof_wide(void)
{
    const int64_t most = INT64_C(1) << 61;
    const int64_t v[2] = {ANY_I64(), ANY_I64()};
    const int64_t side[3] = {ANY_OF(-most, most), ANY_OF(-most, most), ANY_OF(-most, most)};
    (void)fx_mul_shift(v[0], v[1], (unsigned)ANY_OF(1, 126));
    (void)fx_mul_shift_fit(v[0], v[1], (unsigned)ANY_OF(1, 126));
    (void)fx_mul_high(v[0], v[1]);
    (void)fx_mul_high_here(v[0], v[1]);
    (void)fx_dot2_high(v, side);
    (void)fx_square3(side);
    (void)fx_add_u128(fx_square_u64(ANY_U64()), fx_square_u64(ANY_U64()));
}

void proof_mul_div(void)
{
    const int64_t a = ANY_I64();
    const int64_t b = ANY_I64();
    (void)fx_mul_div(a, b, 0);
    //@ loop unroll 64;
    for (unsigned bit = 0; bit < 63; bit++) {
        const int64_t divisor = (int64_t)any_with_top_bit(bit);
        (void)fx_mul_div(a, b, divisor);
        (void)fx_mul_div(a, b, -divisor);
    }
    (void)fx_mul_div(a, b, INT64_MIN);
}

void proof_roots(void)
{
    (void)fx_sqrt_u64(0);
    (void)fx_sqrt_u128((fx_u128_t){0, 0});
    (void)fx_root_q32((fx_u128_t){0, 0});
    //@ loop unroll 64;
    for (unsigned bit = 0; bit < 64; bit++) {
        (void)fx_sqrt_u64(any_with_top_bit(bit));
        (void)fx_sqrt_u128((fx_u128_t){0, any_with_top_bit(bit)});
        (void)fx_root_q32((fx_u128_t){0, any_with_top_bit(bit)});
    }
    //@ loop unroll 60;
    for (unsigned bit = 0; bit < 60; bit++) {
        (void)fx_sqrt_u128((fx_u128_t){any_with_top_bit(bit), ANY_U64()});
        (void)fx_root_q32((fx_u128_t){any_with_top_bit(bit), ANY_U64()});
    }
}

void proof_angles(void)
{
    q62_t sine_q62;
    q62_t cosine_q62;
    fx_sincos_deg(ANY_I64(), &sine_q62, &cosine_q62);
}

/* Counts and units with any ratio, by the contract of fx_mul_div(). */
void proof_counts(void)
{
    int64_t counts;
    q32_t units_q32;
    counts_scale_t scale = {.num = ANY_I32(), .den = (int32_t)ANY_OF(1, INT32_MAX), .zero = ANY_I32()};
    (void)counts_from_units(&scale, ANY_I64(), &counts);
    (void)counts_to_units(&scale, ANY_I64(), &units_q32);
}

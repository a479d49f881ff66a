/* SPDX-License-Identifier: MIT
 * canraw_float.c - float32 and counts; see canraw_float.h.
 */
#include "canraw_float.h"

#include "heave/canraw.h"

#define SIGN_BIT      0x80000000u
#define FRACTION_BITS 23u
#define HIDDEN_BIT    (1u << FRACTION_BITS)
#define EXPONENT_MAX  0xFFu /* no number */
#define EXPONENT_BIAS 127u
#define EXPONENT_ONE  (EXPONENT_BIAS + FRACTION_BITS) /* here a mantissa with its hidden bit is the number itself */

uint32_t canraw_float_from(int64_t counts, uint32_t divisor)
{
    const int64_t whole = counts < 0 ? -(counts + 1) : counts;
    uint64_t above = (uint64_t)whole + (counts < 0 ? 1u : 0u);
    uint32_t exponent = EXPONENT_ONE + 1u;
    if (counts == 0) {
        return 0;
    }
    while (above >> (FRACTION_BITS + 1u) < divisor) { /* until the quotient has one bit more than a mantissa */
        above <<= 1;
        exponent--;
    }
    /* There are no ties: an odd quotient without a rest would divide the counts, which are smaller. Nor does rounding carry
     * into the next power of two: no fraction of these is so near to one without being it. */
    const uint64_t quotient = above / divisor;
    const uint64_t mantissa = (quotient >> 1) + (quotient & 1u);
    return (counts < 0 ? SIGN_BIT : 0) | exponent << FRACTION_BITS | (uint32_t)(mantissa & (HIDDEN_BIT - 1u));
}

bool canraw_float_to(uint32_t bits, uint32_t divisor, int64_t *counts)
{
    const uint32_t exponent = bits >> FRACTION_BITS & EXPONENT_MAX;
    const uint64_t product = (uint64_t)(HIDDEN_BIT | (bits & (HIDDEN_BIT - 1u))) * divisor;
    uint64_t magnitude = 0;
    if (exponent >= EXPONENT_ONE) { /* no number, or 2^23 and more: beyond what is allowed, whatever the divisor */
        return false;
    }
    if (EXPONENT_ONE - exponent < 60u) { /* below, the product of 44 bits is less than a half */
        const uint32_t shift = EXPONENT_ONE - exponent;
        magnitude = (product + (UINT64_C(1) << (shift - 1u))) >> shift;
    }
    if (magnitude > CANRAW_FLOAT_MAX) {
        return false;
    }
    *counts = (bits & SIGN_BIT) != 0 ? -(int64_t)magnitude : (int64_t)magnitude;
    return true;
}

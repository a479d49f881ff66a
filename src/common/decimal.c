/* SPDX-License-Identifier: MIT
 * decimal.c - numbers as text; see decimal.h.
 */
#include "common/decimal.h"

#include <string.h>

#define HALF_Q32 ((uint64_t)1 << 31)

/* The last `digits` digits, with leading zeros. */
static void put_padded(char *to, uint32_t value, unsigned digits)
{
    for (unsigned i = digits; i > 0; i--) {
        to[i - 1] = (char)('0' + value % 10);
        value /= 10;
    }
}

size_t decimal_put_u64(char *to, uint64_t value)
{
    char digits[DECIMAL_U64_MAX];
    size_t first = sizeof digits;
    do {
        digits[--first] = (char)('0' + value % 10);
        value /= 10;
    } while (value != 0);
    memcpy(to, &digits[first], sizeof digits - first);
    return sizeof digits - first;
}

size_t decimal_put_ms(char *to, uint64_t value_us)
{
    const size_t length = decimal_put_u64(to, value_us / 1000);
    to[length] = '.';
    put_padded(&to[length + 1], (uint32_t)(value_us % 1000), 3);
    return length + 4;
}

size_t decimal_put_q32(char *to, q32_t value_q32, unsigned places)
{
    static const uint32_t k_scale[] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000, 1000000000};
    const uint64_t magnitude = value_q32 < 0 ? 0 - (uint64_t)value_q32 : (uint64_t)value_q32;
    const uint32_t scale = k_scale[places];
    uint64_t whole = magnitude >> 32;
    uint32_t part = (uint32_t)(((magnitude & UINT32_MAX) * scale + HALF_Q32) >> 32);
    if (part == scale) {
        part = 0;
        whole++;
    }
    size_t length = 0;
    if (value_q32 < 0 && (whole != 0 || part != 0)) {
        to[length++] = '-';
    }
    length += decimal_put_u64(&to[length], whole);
    to[length++] = '.';
    put_padded(&to[length], part, places);
    return length + places;
}

size_t decimal_put_text(char *to, const char *text)
{
    size_t length = 0;
    for (; text[length] != '\0'; length++) {
        to[length] = text[length];
    }
    return length;
}

size_t decimal_put_hex(char *to, uint32_t value, unsigned digits)
{
    for (unsigned i = digits; i > 0; i--) {
        to[i - 1] = "0123456789ABCDEF"[value & 15u];
        value >>= 4;
    }
    return digits;
}

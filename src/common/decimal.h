/* SPDX-License-Identifier: MIT
 * decimal.h - numbers (and words between them) as text, exactly rounded and fast enough for a row per cycle.
 * Pure; no locale, no allocation. Nothing here ends its text with a NUL: each function returns how many bytes it wrote.
 */
#ifndef HEAVE_COMMON_DECIMAL_H
#define HEAVE_COMMON_DECIMAL_H

#include "heave/fx.h"

#define DECIMAL_U64_MAX 20u /**< most bytes of decimal_put_u64 */
#define DECIMAL_MS_MAX  21u /**< of decimal_put_ms */
#define DECIMAL_Q32_MAX 21u /**< of decimal_put_q32: sign, ten digits, point, nine decimals */

size_t decimal_put_u64(char *to, uint64_t value);

/** Milliseconds with three decimals. */
size_t decimal_put_ms(char *to, uint64_t value_us);

/** Rounded to so many decimals, half away from zero; what rounds to zero has no sign.
 *  @param places [1, 9] */
size_t decimal_put_q32(char *to, q32_t value_q32, unsigned places);

/** A constant text, as it is. */
size_t decimal_put_text(char *to, const char *text);

/** Exactly so many digits, upper case. */
size_t decimal_put_hex(char *to, uint32_t value, unsigned digits);

#endif

/* SPDX-License-Identifier: MIT
 * canraw_float.h - the bits of a float32 as a number of counts over a divisor, without floating point: the same on every CPU.
 */
#ifndef CANRAW_FLOAT_H
#define CANRAW_FLOAT_H

#include <stdbool.h>
#include <stdint.h>

/** Bits of counts / divisor, rounded to the nearest float.
 *  @param counts within +-CANRAW_FLOAT_MAX
 *  @param divisor [1, CANRAW_DIVISOR_MAX] */
uint32_t canraw_float_from(int64_t counts, uint32_t divisor);

/** The nearest counts to a float times the divisor, halves away from zero; those of canraw_float_from() come back.
 *  @param counts out, unchanged on errors
 *  @return false where it is no finite number, or beyond CANRAW_FLOAT_MAX counts */
bool canraw_float_to(uint32_t bits, uint32_t divisor, int64_t *counts);

#endif

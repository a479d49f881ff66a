/* SPDX-License-Identifier: MIT
 * any.h - values that Frama-C takes to be anything, for the entry points of tools/proof. These are analysed, never compiled or
 * run.
 */
#ifndef PROOF_ANY_H
#define PROOF_ANY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <__fc_builtin.h>

static volatile uint64_t proof_any; /* each read is another value */

/* Any value of a type. */
#define ANY_BOOL()        ((proof_any & 1u) != 0)
#define ANY_U8()          ((uint8_t)proof_any)
#define ANY_U16()         ((uint16_t)proof_any)
#define ANY_U32()         ((uint32_t)proof_any)
#define ANY_U64()         (proof_any)
#define ANY_I32()         ((int32_t)proof_any)
#define ANY_I64()         ((int64_t)proof_any)
#define ANY_OF(low, high) Frama_C_long_long_interval((low), (high))
#define ANY_BYTES(object) Frama_C_make_unknown((char *)&(object), sizeof(object))

void hv_assert_failed(const char *file, int line)
{
    (void)file;
    (void)line;
    /*@ assert programmer_error: \false; */
}

#endif

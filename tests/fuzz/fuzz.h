/* SPDX-License-Identifier: MIT
 * fuzz.h - what the fuzz targets share: how an input is read, and how an oracle complains.
 * A target is one file with LLVMFuzzerTestOneInput(); libFuzzer calls it where there is one, else replay.c with the corpus.
 */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** One input; the same bytes always do the same.
 *  @return 0 */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/** What must hold. Where it does not, this says so and aborts, so that libFuzzer keeps the input. */
#define FUZZ_REQUIRE(condition) ((condition) ? (void)0 : fuzz_fail(#condition, __FILE__, __LINE__))

__attribute__((noreturn)) void fuzz_fail(const char *what, const char *file, int line);

/** The bytes of an input that have not been read yet. */
typedef struct {
    const uint8_t *at;
    size_t left;
} fuzz_input_t;

/** The next number, little-endian; bytes behind the end count as 0. */
uint8_t fuzz_u8(fuzz_input_t *self);
uint16_t fuzz_u16(fuzz_input_t *self);
uint32_t fuzz_u32(fuzz_input_t *self);

/** The next bytes, as many as there are.
 *  @param length in: wanted; out: there were */
const uint8_t *fuzz_bytes(fuzz_input_t *self, size_t *length);

#endif

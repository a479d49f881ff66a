/* SPDX-License-Identifier: MIT
 * sha256.h - SHA-256 as FIPS 180-4 defines it, for recognising texts again. No allocation.
 * By hand: one function, fixed by test vectors, is no reason for a cryptographic library on every controller box.
 */
#ifndef HEAVE_COMMON_SHA256_H
#define HEAVE_COMMON_SHA256_H

#include <stddef.h>
#include <stdint.h>

#define SHA256_BYTES 32u

/** Work in progress. */
typedef struct {
    uint32_t state[8];
    uint64_t length; /**< bytes so far */
    uint8_t block[64];
} sha256_t;

void sha256_start(sha256_t *self);
void sha256_add(sha256_t *self, const void *bytes, size_t length);
void sha256_end(sha256_t *self, uint8_t digest[SHA256_BYTES]);

/** sha256_end(), in digits. @param size of digits: as many whole bytes as fit, and a NUL; at most 65 */
void sha256_end_digits(sha256_t *self, char *digits, size_t size);

/** All of it for a text that is there as a whole. */
void sha256_digits(const void *bytes, size_t length, char *digits, size_t size);

#endif

/* SPDX-License-Identifier: MIT
 * sha256.c - SHA-256; see sha256.h. The constants are the first 32 bits of the fractional parts of the square roots of the first
 * 8 primes, and of the cube roots of the first 64.
 */
#include "common/sha256.h"

#include <stdio.h>
#include <string.h>

#define BLOCK_BYTES  64u
#define LENGTH_BYTES 8u

static const uint32_t k_start[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                    0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};

static const uint32_t k_round[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5, 0xd807aa98, 0x12835b01,
    0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174, 0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc,
    0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da, 0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147,
    0x06ca6351, 0x14292967, 0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070, 0x19a4c116, 0x1e376c08,
    0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3, 0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208,
    0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

static uint32_t turn(uint32_t word, unsigned right)
{
    return word >> right | word << (32u - right);
}

static void expand(const uint8_t block[BLOCK_BYTES], uint32_t word[64])
{
    for (unsigned i = 0; i < 16; i++) {
        word[i] =
            (uint32_t)block[4 * i] << 24 | (uint32_t)block[4 * i + 1] << 16 | (uint32_t)block[4 * i + 2] << 8 | block[4 * i + 3];
    }
    for (unsigned i = 16; i < 64; i++) {
        const uint32_t s0 = turn(word[i - 15], 7) ^ turn(word[i - 15], 18) ^ word[i - 15] >> 3;
        const uint32_t s1 = turn(word[i - 2], 17) ^ turn(word[i - 2], 19) ^ word[i - 2] >> 10;
        word[i] = word[i - 16] + s0 + word[i - 7] + s1;
    }
}

static void add_block(sha256_t *self)
{
    uint32_t word[64], v[8];
    expand(self->block, word);
    memcpy(v, self->state, sizeof v);
    for (unsigned i = 0; i < 64; i++) {
        const uint32_t choice = (v[4] & v[5]) ^ (~v[4] & v[6]);
        const uint32_t majority = (v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]);
        const uint32_t one = v[7] + (turn(v[4], 6) ^ turn(v[4], 11) ^ turn(v[4], 25)) + choice + k_round[i] + word[i];
        const uint32_t two = (turn(v[0], 2) ^ turn(v[0], 13) ^ turn(v[0], 22)) + majority;
        memmove(&v[1], &v[0], 7 * sizeof v[0]);
        v[4] += one;
        v[0] = one + two;
    }
    for (unsigned i = 0; i < 8; i++) {
        self->state[i] += v[i];
    }
}

void sha256_start(sha256_t *self)
{
    memcpy(self->state, k_start, sizeof self->state);
    self->length = 0;
}

void sha256_add(sha256_t *self, const void *bytes, size_t length)
{
    const uint8_t *from = bytes;
    for (size_t i = 0; i < length; i++) {
        self->block[self->length++ % BLOCK_BYTES] = from[i];
        if (self->length % BLOCK_BYTES == 0) {
            add_block(self);
        }
    }
}

void sha256_end(sha256_t *self, uint8_t digest[SHA256_BYTES])
{
    static const uint8_t k_end = 0x80;
    static const uint8_t k_zero = 0;
    uint8_t bits[LENGTH_BYTES];
    for (unsigned i = 0; i < LENGTH_BYTES; i++) {
        bits[i] = (uint8_t)(self->length * 8 >> (56u - 8u * i));
    }
    sha256_add(self, &k_end, 1);
    while (self->length % BLOCK_BYTES != BLOCK_BYTES - LENGTH_BYTES) {
        sha256_add(self, &k_zero, 1);
    }
    sha256_add(self, bits, sizeof bits);
    for (unsigned i = 0; i < SHA256_BYTES; i++) {
        digest[i] = (uint8_t)(self->state[i / 4] >> (24u - 8u * (i % 4)));
    }
}

void sha256_end_digits(sha256_t *self, char *digits, size_t size)
{
    uint8_t digest[SHA256_BYTES];
    sha256_end(self, digest);
    digits[0] = '\0';
    for (size_t i = 0; i < SHA256_BYTES && 2 * i + 2 < size; i++) {
        (void)snprintf(&digits[2 * i], 3, "%02x", (unsigned)digest[i]);
    }
}

void sha256_digits(const void *bytes, size_t length, char *digits, size_t size)
{
    sha256_t hash;
    sha256_start(&hash);
    sha256_add(&hash, bytes, length);
    sha256_end_digits(&hash, digits, size);
}

/* SPDX-License-Identifier: MIT
 * fuzz.c - what the fuzz targets share; see fuzz.h.
 */
#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>

#include "heave/status.h"

void fuzz_fail(const char *what, const char *file, int line)
{
    (void)fprintf(stderr, "%s:%d: does not hold: %s\n", file, line, what);
    abort();
}

/* An assertion of the core is a finding like any other. Weak: some test support brings its own. */
__attribute__((weak)) void hv_assert_failed(const char *file, int line)
{
    fuzz_fail("HV_ASSERT", file, line);
}

static uint32_t little_endian(fuzz_input_t *self, unsigned bytes)
{
    uint32_t value = 0;
    for (unsigned i = 0; i < bytes && self->left > 0; i++, self->at++, self->left--) {
        value |= (uint32_t)*self->at << (8 * i);
    }
    return value;
}

uint8_t fuzz_u8(fuzz_input_t *self)
{
    return (uint8_t)little_endian(self, 1);
}

uint16_t fuzz_u16(fuzz_input_t *self)
{
    return (uint16_t)little_endian(self, 2);
}

uint32_t fuzz_u32(fuzz_input_t *self)
{
    return little_endian(self, 4);
}

const uint8_t *fuzz_bytes(fuzz_input_t *self, size_t *length)
{
    const uint8_t *bytes = self->at;
    *length = *length < self->left ? *length : self->left;
    self->at += *length;
    self->left -= *length;
    return bytes;
}

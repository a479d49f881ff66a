/* SPDX-License-Identifier: MIT
 * mutate.c - what the custom mutators share; see mutate.h.
 */
#include "mutate.h"

#include <string.h>

mutate_t mutate_start(unsigned seed)
{
    return (mutate_t){seed * UINT64_C(0x9E3779B97F4A7C15) + 1};
}

size_t mutate_below(mutate_t *self, size_t limit)
{
    self->state ^= self->state << 13;
    self->state ^= self->state >> 7;
    self->state ^= self->state << 17;
    return (size_t)(self->state >> 16) % limit;
}

size_t mutate_insert(uint8_t *data, size_t size, size_t max_size, size_t at, const uint8_t *bytes, size_t count)
{
    if (size + count > max_size || at > size) {
        return size;
    }
    memmove(data + at + count, data + at, size - at);
    memcpy(data + at, bytes, count);
    return size + count;
}

size_t mutate_remove(uint8_t *data, size_t size, size_t at, size_t count)
{
    if (at >= size) {
        return size;
    }
    count = count < size - at ? count : size - at;
    memmove(data + at, data + at + count, size - at - count);
    return size - count;
}

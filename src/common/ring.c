/* SPDX-License-Identifier: MIT
 * ring.c - ring of records: each is its length, then its bytes, wrapped round the end of the memory.
 */
#include "common/ring.h"

#include <string.h>

void ring_init(ring_t *self, void *memory, uint32_t size)
{
    HV_ASSERT(size != 0 && (size & (size - 1)) == 0 && size <= (uint32_t)1 << 30);
    *self = (ring_t){.bytes = memory, .size = size};
}

static uint32_t put(ring_t *self, uint32_t at, const void *from, uint32_t length)
{
    const uint32_t start = at & (self->size - 1);
    const uint32_t first = length < self->size - start ? length : self->size - start;
    if (length > 0) {
        memcpy(&self->bytes[start], from, first);
        memcpy(self->bytes, (const uint8_t *)from + first, length - first);
    }
    return at + length;
}

static uint32_t get(const ring_t *self, uint32_t at, void *to, uint32_t length)
{
    const uint32_t start = at & (self->size - 1);
    const uint32_t first = length < self->size - start ? length : self->size - start;
    memcpy(to, &self->bytes[start], first);
    memcpy((uint8_t *)to + first, self->bytes, length - first);
    return at + length;
}

bool ring_push(ring_t *self, const void *head, size_t head_length, const void *tail, size_t tail_length)
{
    const uint32_t length = (uint32_t)(head_length + tail_length);
    const uint32_t used = self->written - __atomic_load_n(&self->taken, __ATOMIC_ACQUIRE);
    HV_ASSERT(length > 0);
    if (self->size - used < sizeof length || self->size - used - sizeof length < length) {
        __atomic_store_n(&self->dropped, self->dropped + 1, __ATOMIC_RELAXED);
        return false;
    }
    uint32_t at = put(self, self->written, &length, sizeof length);
    at = put(self, at, head, (uint32_t)head_length);
    at = put(self, at, tail, (uint32_t)tail_length);
    __atomic_store_n(&self->written, at, __ATOMIC_RELEASE);
    return true;
}

size_t ring_pop(ring_t *self, void *to, size_t capacity)
{
    const uint32_t taken = self->taken;
    if (__atomic_load_n(&self->written, __ATOMIC_ACQUIRE) == taken) {
        return 0;
    }
    uint32_t length = 0;
    const uint32_t at = get(self, taken, &length, sizeof length);
    HV_ASSERT(length <= capacity);
    __atomic_store_n(&self->taken, get(self, at, to, length), __ATOMIC_RELEASE);
    return length;
}

bool ring_is_empty(const ring_t *self)
{
    return __atomic_load_n(&self->written, __ATOMIC_ACQUIRE) == self->taken;
}

uint32_t ring_dropped(const ring_t *self)
{
    return __atomic_load_n(&self->dropped, __ATOMIC_RELAXED);
}

/* SPDX-License-Identifier: MIT
 * seqlock.c - sequence lock over words; every access is atomic, so that there is no data race even where a read is thrown away.
 */
#include "common/seqlock.h"

#define TRIES 1000u

void seqlock_init(seqlock_t *self, uint64_t *word, size_t words)
{
    *self = (seqlock_t){.words = words};
    self->word = word;
}

void seqlock_write(seqlock_t *self, const uint64_t *value)
{
    const uint32_t sequence = self->sequence;
    __atomic_store_n(&self->sequence, sequence + 1, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE);
    for (size_t i = 0; i < self->words; i++) {
        __atomic_store_n(&self->word[i], value[i], __ATOMIC_RELAXED);
    }
    __atomic_store_n(&self->sequence, sequence + 2, __ATOMIC_RELEASE);
}

static bool try_read(const seqlock_t *self, uint64_t *out)
{
    const uint32_t before = __atomic_load_n(&self->sequence, __ATOMIC_ACQUIRE);
    if (before == 0 || before % 2 != 0) {
        return false;
    }
    for (size_t i = 0; i < self->words; i++) {
        out[i] = __atomic_load_n(&self->word[i], __ATOMIC_RELAXED);
    }
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    return __atomic_load_n(&self->sequence, __ATOMIC_RELAXED) == before;
}

bool seqlock_read(const seqlock_t *self, uint64_t *out)
{
    for (unsigned i = 0; i < TRIES; i++) {
        if (try_read(self, out)) {
            return true;
        }
    }
    return false;
}

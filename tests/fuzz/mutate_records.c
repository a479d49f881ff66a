/* SPDX-License-Identifier: MIT
 * mutate_records.c - custom mutator for runs of records of FUZZ_RECORD bytes behind one byte: whole records are put in, taken
 * out, said twice and exchanged, single bytes changed where they are; the rest libFuzzer does.
 */
#include "mutate.h"

#include <string.h>

#ifndef FUZZ_RECORD
#error "FUZZ_RECORD: the size of a record of this target"
#endif

#define HEAD 1u

static size_t pick(mutate_t *random, size_t records)
{
    return HEAD + FUZZ_RECORD * mutate_below(random, records + 1);
}

static void fill(mutate_t *random, uint8_t record[FUZZ_RECORD])
{
    static const uint8_t k_likely[] = {0, 0, 1, 2, 3, 4, 5, 7, 8, 0x0F, 0x21, 0x27, 0x7F, 0x80, 0xFF};
    for (size_t i = 0; i < FUZZ_RECORD; i++) {
        record[i] =
            mutate_below(random, 3) == 0 ? (uint8_t)mutate_below(random, 256) : k_likely[mutate_below(random, sizeof k_likely)];
    }
    record[0] = (uint8_t)mutate_below(random, 8); /* what it does */
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed)
{
    mutate_t random = mutate_start(seed);
    uint8_t record[FUZZ_RECORD];
    if (size <= HEAD || mutate_below(&random, 8) == 0) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    const size_t records = (size - HEAD) / FUZZ_RECORD;
    const size_t at = pick(&random, records);
    const size_t from = pick(&random, records);
    fill(&random, record);
    switch (mutate_below(&random, 5)) {
    case 0:
        return mutate_remove(data, size, at, FUZZ_RECORD);
    case 1: /* one more, that is elsewhere already */
        if (from + FUZZ_RECORD <= size) {
            memcpy(record, data + from, FUZZ_RECORD);
        }
        return mutate_insert(data, size, max_size, at, record, FUZZ_RECORD);
    case 2:
        return mutate_insert(data, size, max_size, at, record, FUZZ_RECORD);
    case 3:
        size = mutate_remove(data, size, at, FUZZ_RECORD);
        return mutate_insert(data, size, max_size, at, record, FUZZ_RECORD);
    default:
        data[mutate_below(&random, size)] = record[1 + mutate_below(&random, FUZZ_RECORD - 1)];
        return size;
    }
}

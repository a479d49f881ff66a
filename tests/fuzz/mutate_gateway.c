/* SPDX-License-Identifier: MIT
 * mutate_gateway.c - custom mutator for runs of datagrams: whole records are put in, taken out and said twice, with frames that a
 * platform follows; the rest libFuzzer does.
 */
#include "mutate.h"

#include <stdio.h>
#include <string.h>

#define HEADER     4u /* wait, host, length */
#define RECORD_MAX 256u

static size_t record_length(const uint8_t *data, size_t size, size_t at)
{
    const size_t length = at + HEADER > size ? size - at : HEADER + (data[at + 2] | (size_t)data[at + 3] << 8);
    return length < size - at ? length : size - at;
}

/* Where a record begins, or the end. */
static size_t pick(mutate_t *random, const uint8_t *data, size_t size)
{
    size_t at = 1;
    for (size_t skip = mutate_below(random, 16); skip > 0 && at < size; skip--) {
        at += record_length(data, size, at);
    }
    return at < size ? at : size;
}

static size_t print_frame(mutate_t *random, char *text, size_t capacity)
{
    static const char *const k_commands[] = {"A6", "A6T", "A7", "A7T", "A3", "A3T", "A4", "C6", "C6T", "C7", "C3", "C3T"};
    const char *command = k_commands[mutate_below(random, sizeof k_commands / sizeof k_commands[0])];
    size_t length = (size_t)snprintf(text, capacity, "@%s:", command);
    for (char value = '0'; value < command[1]; value++) {
        const int range = command[0] == 'C' ? 200 : 40;
        const int whole = (int)mutate_below(random, (size_t)range) - (command[0] == 'C' ? 0 : range / 2);
        length += (size_t)snprintf(text + length, capacity - length, "%d.%u,", whole, (unsigned)mutate_below(random, 1000));
    }
    const size_t last = mutate_below(random, 4) == 0 ? mutate_below(random, 3000) : mutate_below(random, 40);
    return length + (size_t)snprintf(text + length, capacity - length, command[2] == 'T' ? "%u#" : "%X#", (unsigned)last);
}

static size_t add_record(mutate_t *random, uint8_t *data, size_t size, size_t max_size, size_t at)
{
    char text[RECORD_MAX];
    uint8_t record[HEADER + 2 * RECORD_MAX];
    size_t length = print_frame(random, text, sizeof text);
    memcpy(record + HEADER, text, length);
    if (mutate_below(random, 4) == 0) { /* something wrong beside it */
        const size_t cut = mutate_below(random, length);
        memcpy(record + HEADER + length, text, cut);
        length += cut;
    }
    record[0] = (uint8_t)mutate_below(random, 40);
    record[1] = (uint8_t)(mutate_below(random, 4) == 0 ? mutate_below(random, 3) : 0);
    record[2] = (uint8_t)length;
    record[3] = (uint8_t)(length >> 8);
    return mutate_insert(data, size, max_size, at, record, HEADER + length);
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed)
{
    mutate_t random = mutate_start(seed);
    uint8_t record[HEADER + 2 * RECORD_MAX];
    if (size == 0 || mutate_below(&random, 4) == 0) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    const size_t at = pick(&random, data, size);
    const size_t length = record_length(data, size, at);
    switch (mutate_below(&random, 4)) {
    case 0:
        return mutate_remove(data, size, at, length);
    case 1:
        if (length <= sizeof record) {
            memcpy(record, data + at, length);
            return mutate_insert(data, size, max_size, pick(&random, data, size), record, length);
        }
        return size;
    default:
        return add_record(&random, data, size, max_size, at);
    }
}

/* SPDX-License-Identifier: MIT
 * mutate_config.c - custom mutator for configuration files: keys of the table with values at and beyond their ends, lines put in,
 * taken out and moved; the rest libFuzzer does.
 */
#include "mutate.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "config/keys.h"

#define LINE_MAX 400u

/* Start of the line that a byte is in. */
static size_t line_start(const uint8_t *data, size_t at)
{
    while (at > 0 && data[at - 1] != '\n') {
        at--;
    }
    return at;
}

/* One past its end, the line feed included. */
static size_t line_end(const uint8_t *data, size_t size, size_t at)
{
    while (at < size && data[at] != '\n') {
        at++;
    }
    return at < size ? at + 1 : size;
}

/* The key of a line, where it is one of the table; the sections do not matter. */
static const config_key_t *key_at(const uint8_t *data, size_t start, size_t end)
{
    for (size_t i = 0; i < config_key_count; i++) {
        const size_t length = strlen(config_keys[i].name);
        if (end - start > length && memcmp(data + start, config_keys[i].name, length) == 0 &&
            (data[start + length] == ' ' || data[start + length] == '=')) {
            return &config_keys[i];
        }
    }
    return NULL;
}

static int print_milli(char *text, size_t capacity, int64_t milli)
{
    const uint64_t magnitude = milli < 0 ? -(uint64_t)milli : (uint64_t)milli;
    return snprintf(text, capacity, "%s%" PRIu64 ".%03" PRIu64, milli < 0 ? "-" : "", magnitude / 1000, magnitude % 1000);
}

static void print_value(mutate_t *random, const config_key_t *key, char *text, size_t capacity)
{
    static const char *const k_odd[] = {"",     "none", "0", "-0", "1e3", "nan", "yes", "no", "0x7F", "1/3", "1, 2, 3, 4, 5, 6",
                                        "32768"};
    const char *const word = key->words != NULL ? key->words : "none";
    const size_t skip = mutate_below(random, strlen(word) + 1);
    switch (mutate_below(random, 6)) {
    case 0:
        (void)print_milli(text, capacity, key->low_milli - (int64_t)mutate_below(random, 2));
        break;
    case 1:
        (void)print_milli(text, capacity, key->high_milli + (int64_t)mutate_below(random, 2));
        break;
    case 2:
        (void)snprintf(text, capacity, "%" PRId64, (key->low_milli + (int64_t)mutate_below(random, 1000) * 1000) / 1000);
        break;
    case 3:
        (void)snprintf(text, capacity, "%s", key->fallback != NULL ? key->fallback : "1");
        break;
    case 4: /* one of the words, or a part of it */
        (void)snprintf(text, capacity, "%.*s", (int)strcspn(word + skip, "|"), word + skip);
        break;
    default:
        (void)snprintf(text, capacity, "%s", k_odd[mutate_below(random, sizeof k_odd / sizeof k_odd[0])]);
        break;
    }
}

/* Another value for the key of a line, or a key of the table in its place. */
static size_t change_line(mutate_t *random, uint8_t *data, size_t size, size_t max_size, size_t start, size_t end)
{
    char line[LINE_MAX], value[LINE_MAX / 2];
    const config_key_t *key = key_at(data, start, end);
    if (key == NULL || mutate_below(random, 8) == 0) {
        key = &config_keys[mutate_below(random, config_key_count)];
    }
    print_value(random, key, value, sizeof value);
    const int length = snprintf(line, sizeof line, "%s = %s\n", key->name, value);
    size = mutate_remove(data, size, start, end - start);
    return mutate_insert(data, size, max_size, start, (const uint8_t *)line, (size_t)length);
}

/* A section of the table with one of its keys. */
static size_t add_section(mutate_t *random, uint8_t *data, size_t size, size_t max_size, size_t at)
{
    char line[LINE_MAX], value[LINE_MAX / 2];
    const config_key_t *key = &config_keys[mutate_below(random, config_key_count)];
    print_value(random, key, value, sizeof value);
    const int length = snprintf(line, sizeof line, "[%s]\n%s = %s\n", key->section, key->name, value);
    return mutate_insert(data, size, max_size, at, (const uint8_t *)line, (size_t)length);
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed)
{
    mutate_t random = mutate_start(seed);
    const size_t start = size == 0 ? 0 : line_start(data, mutate_below(&random, size));
    const size_t end = line_end(data, size, start);
    uint8_t line[LINE_MAX];
    const size_t length = end - start < sizeof line ? end - start : sizeof line;
    switch (mutate_below(&random, 8)) {
    case 0:
        return LLVMFuzzerMutate(data, size, max_size);
    case 1:
        return mutate_remove(data, size, start, end - start);
    case 2: /* once more, elsewhere */
        memcpy(line, data + start, length);
        return mutate_insert(data, size, max_size, line_start(data, size == 0 ? 0 : mutate_below(&random, size)), line, length);
    case 3:
        return add_section(&random, data, size, max_size, start);
    default:
        return change_line(&random, data, size, max_size, start, end);
    }
}

/* SPDX-License-Identifier: MIT
 * samples.c - a reader of samples; see samples.h. A record is copied word by word between two looks at its sequence number: where
 * both say that it is the one that is wanted, nobody wrote in between.
 */
#include "common/samples.h"

#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

static bool is_whole(const samples_header_t *header, size_t bytes)
{
    const uint64_t table = sizeof *header + (uint64_t)header->columns * header->column_bytes;
    const uint64_t records = (uint64_t)header->capacity * header->record_bytes;
    return header->column_bytes >= sizeof(samples_column_t) && header->column_bytes % 8u == 0 && header->header_bytes >= table &&
           header->header_bytes % 8u == 0 && header->record_bytes % 8u == 0 && header->record_bytes >= 8u &&
           header->record_bytes <= 8u * SAMPLES_RECORD_WORDS_MAX && header->capacity >= 2u &&
           header->header_bytes + records <= bytes;
}

/* The size of a column's type; 0: unknown. */
static uint32_t size_of(const samples_column_t *column)
{
    const char *type = column->type;
    const bool is_known =
        (type[0] == 'u' || type[0] == 'i') && type[1] != '\0' && strchr("1248", type[1]) != NULL && type[2] == '\0';
    return is_known ? (uint32_t)(type[1] - '0') : 0u;
}

static bool are_columns_within(const samples_header_t *header)
{
    for (uint32_t i = 0; i < header->columns; i++) {
        const samples_column_t *column = samples_column(header, i);
        const uint32_t size = size_of(column);
        if (size == 0 || column->at > header->record_bytes - size || memchr(column->name, '\0', sizeof column->name) == NULL ||
            memchr(column->unit, '\0', sizeof column->unit) == NULL) {
            return false;
        }
    }
    return true;
}

const char *samples_reader_begin(samples_reader_t *self, const void *memory, size_t bytes)
{
    const samples_header_t *header = memory;
    if (bytes < sizeof *header || memcmp(header->magic, SAMPLES_MAGIC, sizeof header->magic) != 0) {
        return "these are no samples of heaved";
    }
    if (header->version != SAMPLES_VERSION) {
        return "samples of another version of heaved";
    }
    if (!is_whole(header, bytes) || !are_columns_within(header)) {
        return "the samples contradict themselves";
    }
    *self = (samples_reader_t){.header = header, .bytes = bytes};
    self->next = __atomic_load_n(&header->written, __ATOMIC_ACQUIRE);
    return NULL;
}

const char *samples_reader_open(samples_reader_t *self, int fd)
{
    struct stat about;
    if (fstat(fd, &about) != 0 || about.st_size <= 0) {
        return "these are no samples of heaved";
    }
    void *memory = mmap(NULL, (size_t)about.st_size, PROT_READ, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) {
        return "the samples cannot be mapped";
    }
    const char *wrong = samples_reader_begin(self, memory, (size_t)about.st_size);
    if (wrong != NULL) {
        (void)munmap(memory, (size_t)about.st_size);
    }
    return wrong;
}

void samples_reader_close(samples_reader_t *self)
{
    (void)munmap((void *)(uintptr_t)self->header, self->bytes);
    self->header = NULL;
}

static const uint64_t *place_of(const samples_reader_t *self, uint64_t number)
{
    const char *records = (const char *)self->header + self->header->header_bytes;
    return (const uint64_t *)(const void *)(records + number % self->header->capacity * self->header->record_bytes);
}

/* Copies a record; false: it is not, or not any more, the one that is wanted. */
static bool copy(const samples_reader_t *self, samples_record_t *out)
{
    const uint64_t *place = place_of(self, self->next);
    const uint32_t words = self->header->record_bytes / 8u;
    const uint64_t wanted = self->next + 1u;
    if (__atomic_load_n(&place[0], __ATOMIC_ACQUIRE) != wanted) {
        return false;
    }
    out->word[0] = wanted;
    for (uint32_t i = 1; i < words; i++) {
        out->word[i] = __atomic_load_n(&place[i], __ATOMIC_RELAXED);
    }
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    return __atomic_load_n(&place[0], __ATOMIC_RELAXED) == wanted;
}

/* Behind by a whole ring: goes on in its middle, half a ring before that can happen again. Returns false: it is not. */
static bool skip_overwritten(samples_reader_t *self, uint64_t written)
{
    const uint64_t capacity = self->header->capacity;
    if (written < self->next || written - self->next < capacity) {
        return false;
    }
    const uint64_t from = written - capacity / 2u;
    self->lost += from - self->next;
    self->next = from;
    return true;
}

bool samples_reader_next(samples_reader_t *self, samples_record_t *out)
{
    uint64_t written = __atomic_load_n(&self->header->written, __ATOMIC_ACQUIRE);
    (void)skip_overwritten(self, written);
    while (self->next < written) {
        if (copy(self, out)) {
            self->next++;
            return true;
        }
        written = __atomic_load_n(&self->header->written, __ATOMIC_ACQUIRE); /* overtaken while it was copied */
        if (!skip_overwritten(self, written)) {
            return false; /* what heaved wrote last is never half: this is not its memory */
        }
    }
    return false;
}

const samples_column_t *samples_column(const samples_header_t *header, uint32_t index)
{
    const char *table = (const char *)(header + 1);
    return index < header->columns ? (const samples_column_t *)(const void *)(table + (size_t)index * header->column_bytes)
                                   : NULL;
}

const samples_column_t *samples_column_named(const samples_header_t *header, const char *name, size_t length)
{
    for (uint32_t i = 0; i < header->columns; i++) {
        const samples_column_t *column = samples_column(header, i);
        if (strlen(column->name) == length && memcmp(column->name, name, length) == 0) {
            return column;
        }
    }
    return NULL;
}

double samples_value(const samples_column_t *column, const samples_record_t *record)
{
    const char *at = (const char *)record->word + column->at;
    uint8_t one = 0;
    uint16_t two = 0;
    uint32_t four = 0;
    uint64_t eight = 0;
    double value = 0;
    switch (size_of(column)) {
    case 1:
        memcpy(&one, at, sizeof one);
        value = column->type[0] == 'i' ? (double)(int8_t)one : (double)one;
        break;
    case 2:
        memcpy(&two, at, sizeof two);
        value = column->type[0] == 'i' ? (double)(int16_t)two : (double)two;
        break;
    case 4:
        memcpy(&four, at, sizeof four);
        value = column->type[0] == 'i' ? (double)(int32_t)four : (double)four;
        break;
    default:
        memcpy(&eight, at, sizeof eight);
        value = column->type[0] == 'i' ? (double)(int64_t)eight : (double)eight;
        break;
    }
    return value * column->scale;
}

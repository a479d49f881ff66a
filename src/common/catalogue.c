/* SPDX-License-Identifier: MIT
 * catalogue.c - see catalogue.h. The format: magic, revision, count, offsets of two tables of (length, offset); texts end in NUL.
 */
#include "common/catalogue.h"

#include <fcntl.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAGIC        0x950412DEu /* numbers as msgfmt writes them: little-endian */
#define HEADER_BYTES 28u
#define ROW_BYTES    8u
#define SIZE_MAX_MO  (16u << 20)

static uint32_t number_at(const catalogue_t *self, size_t offset)
{
    const uint8_t *byte = &self->bytes[offset];
    return (uint32_t)byte[0] | (uint32_t)byte[1] << 8 | (uint32_t)byte[2] << 16 | (uint32_t)byte[3] << 24;
}

static const char *text_at(const catalogue_t *self, uint32_t table, uint32_t at)
{
    return (const char *)&self->bytes[number_at(self, table + (size_t)at * ROW_BYTES + 4u)];
}

const char *catalogue_original(const catalogue_t *self, uint32_t at)
{
    return text_at(self, self->originals, at);
}

const char *catalogue_translation(const catalogue_t *self, uint32_t at)
{
    return text_at(self, self->translations, at);
}

/* A table within the file, and each of its texts, with the NUL at its end. */
static bool is_table(const catalogue_t *self, uint32_t table)
{
    if (table > self->size || (self->size - table) / ROW_BYTES < self->count) {
        return false;
    }
    for (uint32_t i = 0; i < self->count; i++) {
        const uint32_t length = number_at(self, table + (size_t)i * ROW_BYTES);
        const uint32_t offset = number_at(self, table + (size_t)i * ROW_BYTES + 4u);
        if (offset >= self->size || length >= self->size - offset || self->bytes[offset + length] != 0) {
            return false;
        }
    }
    return true;
}

static bool is_sorted(const catalogue_t *self)
{
    for (uint32_t i = 1; i < self->count; i++) {
        if (strcmp(catalogue_original(self, i - 1u), catalogue_original(self, i)) >= 0) {
            return false;
        }
    }
    return true;
}

static bool parse(catalogue_t *self)
{
    if (self->size < HEADER_BYTES || number_at(self, 0) != MAGIC || number_at(self, 4) >> 16 != 0) {
        return false;
    }
    self->count = number_at(self, 8);
    self->originals = number_at(self, 12);
    self->translations = number_at(self, 16);
    return is_table(self, self->originals) && is_table(self, self->translations) && is_sorted(self);
}

bool catalogue_open(catalogue_t *self, const char *path)
{
    struct stat about;
    *self = (catalogue_t){.bytes = NULL};
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd < 0) {
        return false;
    }
    if (fstat(fd, &about) == 0 && S_ISREG(about.st_mode) && about.st_size > 0 && about.st_size <= (off_t)SIZE_MAX_MO) {
        void *bytes = mmap(NULL, (size_t)about.st_size, PROT_READ, MAP_PRIVATE, fd, 0);
        self->bytes = bytes != MAP_FAILED ? bytes : NULL;
        self->size = bytes != MAP_FAILED ? (size_t)about.st_size : 0;
    }
    (void)close(fd);
    if (self->bytes != NULL && !parse(self)) {
        catalogue_close(self);
    }
    return self->bytes != NULL;
}

void catalogue_close(catalogue_t *self)
{
    if (self->bytes != NULL) {
        (void)munmap((void *)(uintptr_t)self->bytes, self->size);
    }
    *self = (catalogue_t){.bytes = NULL};
}

const char *catalogue_find(const catalogue_t *self, const char *original)
{
    uint32_t low = 0, high = self->count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2u;
        const int order = strcmp(catalogue_original(self, middle), original);
        if (order == 0) {
            const char *found = catalogue_translation(self, middle);
            return found[0] != '\0' && original[0] != '\0' ? found : NULL; /* "" is the file's own header */
        }
        if (order < 0) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return NULL;
}

/* SPDX-License-Identifier: MIT
 * samples.h - the layout of the samples in shared memory, one record per motion cycle, and a reader of them. docs/samples.md is
 * the contract, for readers in other languages too. The header says where everything is: a reader that was written once reads
 * later versions. One writer (service/samples_writer.h), any number of readers, of which none can hold anybody up.
 */
#ifndef HEAVE_COMMON_SAMPLES_H
#define HEAVE_COMMON_SAMPLES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SAMPLES_MAGIC   "HEAVESMP"
#define SAMPLES_VERSION 1u

/** A column: where it is in a record, and what it means. 64 bytes. */
typedef struct {
    char name[32]; /**< ended by a NUL, as unit and type are */
    char unit[12]; /**< "" where it has none */
    char type[4];  /**< as numpy has it: u1, u2, u4, u8, i8 */
    uint32_t at;   /**< bytes from the beginning of a record */
    uint32_t reserved;
    double scale; /**< the value is what stands there times this */
} samples_column_t;

/** The beginning of the memory; columns follow at once, records at header_bytes. 128 bytes. */
typedef struct {
    char magic[8];
    uint32_t version;      /**< changes when an old reader would read something wrong */
    uint32_t header_bytes; /**< records begin there */
    uint32_t record_bytes; /**< a multiple of 8; the first 8 are the sequence number */
    uint32_t capacity;     /**< records */
    uint32_t columns;
    uint32_t column_bytes;
    uint32_t cycle_us;
    uint32_t reserved;
    uint64_t start_monotonic_ns; /**< CLOCK_MONOTONIC when heaved began, */
    uint64_t start_realtime_ns;  /**< and CLOCK_REALTIME in the same moment */
    uint64_t written; /**< atomic: records so far; record n is at place n % capacity and has the sequence number n + 1 */
    uint64_t spare[8];
} samples_header_t;

/** Longest record that a reader takes. */
#define SAMPLES_RECORD_WORDS_MAX 256u

/** One record as a reader copies it: the sequence number, then the columns. */
typedef struct {
    uint64_t word[SAMPLES_RECORD_WORDS_MAX];
} samples_record_t;

/** A reader; members are private to samples.c but header, next and lost. */
typedef struct {
    const samples_header_t *header;
    size_t bytes;
    uint64_t next; /**< number of the record that comes next */
    uint64_t lost; /**< records that were overwritten before they could be read */
} samples_reader_t;

/** Begins to read, with the next record to come. Takes no ownership of the descriptor.
 *  @return NULL, or what is wrong with the memory */
const char *samples_reader_open(samples_reader_t *self, int fd);

/** The same of memory that is there already. */
const char *samples_reader_begin(samples_reader_t *self, const void *memory, size_t bytes);

void samples_reader_close(samples_reader_t *self);

/** The next record, whole or not at all.
 *  @return false: there is none yet */
bool samples_reader_next(samples_reader_t *self, samples_record_t *out);

/** A column by its place, or by its name; NULL where there is none. */
const samples_column_t *samples_column(const samples_header_t *header, uint32_t index);
const samples_column_t *samples_column_named(const samples_header_t *header, const char *name, size_t length);

/** What a record has in a column. */
double samples_value(const samples_column_t *column, const samples_record_t *record);

#endif

/* SPDX-License-Identifier: MIT
 * samples_writer.h - a record per motion cycle into shared memory, for whoever looks: heavectl scope, a panel, a script. The
 * memory is sealed: nobody but heaved can write into it or change its size. Layout: common/samples.h, docs/samples.md.
 */
#ifndef HEAVE_SERVICE_SAMPLES_WRITER_H
#define HEAVE_SERVICE_SAMPLES_WRITER_H

#include "common/samples.h"
#include "config/config.h"
#include "heave/telemetry.h"

/** The ring; members are private to samples_writer.c but fd and bytes. */
typedef struct {
    samples_header_t *header; /**< NULL: there is none */
    size_t bytes;
    int fd; /**< for readers; -1: there is none */
    uint64_t written;
    uint32_t at; /**< place of the next record */
} samples_writer_t;

/** Makes the ring of [samples] seconds; none where they are 0. All of its pages are there when it returns.
 *  @return false: errno says why; there is none then */
bool samples_writer_open(samples_writer_t *self, const config_t *config);

/** Adds what the newest cycle has come to. The motion thread: no system call, no waiting, 200 ns.
 *  @param wake_us how late this cycle began
 *  @param work_us how long the cycle before it took; 0 for the first one */
void samples_writer_add(samples_writer_t *self, const snapshot_t *snapshot, uint64_t wake_us, uint64_t work_us);

void samples_writer_close(samples_writer_t *self);

#endif

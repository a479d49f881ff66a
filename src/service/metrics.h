/* SPDX-License-Identifier: MIT
 * metrics.h - the status as Prometheus' text format (exposition format 0.0.4), in a file for node_exporter's textfile collector.
 * The file is replaced as a whole, so that a reader never sees a part of it. A thread of its own; nothing allocates.
 */
#ifndef HEAVE_SERVICE_METRICS_H
#define HEAVE_SERVICE_METRICS_H

#include "config/config.h"
#include "service/handover.h"
#include "service/status_json.h"

#define METRICS_BYTES     32768u
#define METRICS_PERIOD_US 1000000u

/** The file. Zeroed: none. */
typedef struct {
    const char *path; /**< NULL = no file */
    uint64_t next_us;
    uint64_t since_us; /**< of the file being written */
    uint32_t busy_ms;  /**< atomic: the same in ms, wrapped, 0 = none is being written */
    uint32_t lost;     /**< atomic: times that none was written, before that one */
    int error;         /**< errno of the last write, 0 = it worked; each new one is said once */
    char temporary[CONFIG_PATH_MAX + 4];
    char text[METRICS_BYTES];
} metrics_t;

/** Prepares; writes nothing.
 *  @param path kept */
void metrics_init(metrics_t *self, const char *path, uint64_t now_us);

/** Writes the file where its time has come. Blocks as long as the file's disk does: meant for /run.
 *  @param hash of the configuration in force: a reload changes it, and config is as at the start */
void metrics_serve(metrics_t *self, const motion_view_t *view, const config_t *config, const char *hash,
                   const motion_times_t *times, const status_lost_t *lost, uint64_t now_us);

/** How often its time has passed without a new file. Any thread. */
uint32_t metrics_lost(const metrics_t *self, uint64_t now_us);

/** Removes the file: what has ended has no values. */
void metrics_remove(metrics_t *self);

/** The text alone.
 *  @return its length; 0 where it does not fit */
size_t metrics_text(const motion_view_t *view, const config_t *config, const char *hash, const motion_times_t *times,
                    const status_lost_t *lost, char *text, size_t capacity);

#endif

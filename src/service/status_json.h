/* SPDX-License-Identifier: MIT
 * status_json.h - everything there is to see of a running platform, as one JSON object. Pure.
 */
#ifndef HEAVE_SERVICE_STATUS_JSON_H
#define HEAVE_SERVICE_STATUS_JSON_H

#include "common/json.h"
#include "service/handover.h"
#include "service/lifetime.h"

/** What the service thread adds to the motion thread's view. */
typedef struct {
    uint32_t trace_rows;           /**< lost because writing was too slow */
    uint32_t record_lines;         /**< likewise */
    uint32_t log_lines;            /**< likewise */
    uint32_t metrics;              /**< files that were due and did not come */
    uint32_t operator_entries;     /**< that the operator log has not taken */
    uint64_t unix_ms;              /**< the time of day, for who compares the status with something else */
    const lifetime_totals_t *life; /**< of the machine; NULL: not known yet */
    const char *digest;            /**< of the configuration's text; NULL: not known */
    const char *changed;           /**< since the machine was commissioned; NULL or "": not known, or nothing */
    const char *put_back;          /**< why what was applied is not in force; NULL or "": nothing was put back */
    bool is_untested;              /**< nobody engages until a self-test has passed */
    bool is_unapproved;            /**< nothing moves until somebody has acknowledged the configuration */
    bool is_slow;                  /**< it rises slowly until somebody has said that it is commissioned */
    bool is_flood;                 /**< the kernel drops what cannot be a frame */
} status_lost_t;

void status_json_write(json_t *json, const motion_view_t *view, const config_t *config, const status_lost_t *lost,
                       const motion_times_t *times);

#endif

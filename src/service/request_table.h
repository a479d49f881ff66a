/* SPDX-License-Identifier: MIT
 * request_table.h - the requests of the control socket: each stands once, with the level it takes and what it may do. Pure.
 */
#ifndef HEAVE_SERVICE_REQUEST_TABLE_H
#define HEAVE_SERVICE_REQUEST_TABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "service/access_levels.h"

/** What a request is about; who carries it out is decided by this. */
typedef enum {
    REQUEST_STATE, /**< engage, hold and the others of operator_requests.h */
    REQUEST_INTENSITY,
    REQUEST_HAND, /**< torque, jog and the others of record/service_words.h */
    REQUEST_OBJECT,
    REQUEST_TICK,
    REQUEST_COUNTS,
    REQUEST_DUMP,
    REQUEST_INCIDENTS,
    REQUEST_SEEN,
    REQUEST_ACKNOWLEDGE,
    REQUEST_COMMISSIONED,
    REQUEST_SELFTEST,
    REQUEST_SELFTEST_PASSED,
    REQUEST_SELFTEST_FAILED,
    REQUEST_CONFIGURATION,
    REQUEST_CONFIGURE,
    REQUEST_INCIDENT_FOLDER,
    REQUEST_OPERATOR_LOG,
    REQUEST_STATUS,
    REQUEST_BY,
    REQUEST_WATCH,
    REQUEST_GEOMETRY,
    REQUEST_TIMES,
    REQUEST_SAMPLES,
    REQUEST_KINDS,
    REQUEST_UNKNOWN = REQUEST_KINDS
} request_kind_t;

/** A request as it was said. */
typedef struct {
    request_kind_t kind;
    const char *words; /**< what stands behind its name and one blank; "" where nothing does. The whole line where others read it:
                            REQUEST_STATE, REQUEST_HAND, REQUEST_OBJECT */
    level_t level;     /**< LEVEL_LOOK for what is unknown */
    bool is_look;      /**< only looks on: the operator log does without */
    bool is_moving;    /**< can start or enlarge a motion, or makes that possible: it has an age. What only makes things safer has
                            none: hold, release, torque off, service-off, and less intensity */
    bool is_held;      /**< jog, signal, home, relay: it has its own proof of a hand, and a hold before it begins voids it, too */
} request_t;

/** Reads a request.
 *  @param line    without `heard TICK` and leading blanks; stays where it is
 *  @param percent intensity in force */
request_t request_read(const char *line, unsigned percent);

/** Level that a request takes, with or without `heard TICK` in front; LEVEL_LOOK for what is no request.
 *  @param percent intensity in force */
level_t request_level(const char *said, unsigned percent);

#endif

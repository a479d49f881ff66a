/* SPDX-License-Identifier: MIT
 * reconfigure.h - another configuration in place of the one in force, while heaved runs: by SIGHUP, or over the control socket.
 * The service thread's; nothing blocks, nothing is allocated.
 */
#ifndef HEAVE_DAEMON_RECONFIGURE_H
#define HEAVE_DAEMON_RECONFIGURE_H

#include "daemon/motion_loop.h"
#include "daemon/writers.h"
#include "service/control.h"

/** What it works on; all of it the owner's. */
typedef struct {
    config_t *config; /**< in force */
    motion_loop_t *loop;
    writers_t *writers;
    config_store_t *store;
    FILE *errors;           /**< for what a reload has to say */
    bool is_end_wanted;     /**< by a signal: heaved ends, and does not start anew */
    bool is_restart_wanted; /**< private, see reconfigure_starts_anew() */
} reconfigure_t;

/** Reads the file again. What may change in operation does, if all of it is right.
 *  @return true: it is in force */
bool reconfigure_reload(reconfigure_t *self);

/** Often: brings into force what was applied, once it is on the disk, and answers who asked.
 *  @return true: something is */
bool reconfigure_serve(reconfigure_t *self, control_t *control);

/** At the end: whether heaved starts anew with what was applied, and nobody has asked it to end. */
bool reconfigure_starts_anew(const reconfigure_t *self, const control_t *control);

/** After such a start, before the first cycle: a request, so that [platform] engage = auto raises nothing by itself.
 *  @return false: it cannot be told */
bool reconfigure_stay_off(reconfigure_t *self);

#endif

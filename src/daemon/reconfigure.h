/* SPDX-License-Identifier: MIT
 * reconfigure.h - another configuration in place of the one in force, while heaved runs: by SIGHUP, or over the control socket.
 * The service thread's; nothing blocks, nothing is allocated.
 */
#ifndef HEAVE_DAEMON_RECONFIGURE_H
#define HEAVE_DAEMON_RECONFIGURE_H

#include "daemon/motion_loop.h"
#include "daemon/writers.h"
#include "service/control.h"

#define RECONFIGURE_WORDS_MAX 8192u

/** What it works on; all of it the owner's. */
typedef struct {
    config_t *config; /**< in force */
    motion_loop_t *loop;
    writers_t *writers;
    config_store_t *store;
    bool is_end_wanted; /**< by a signal: heaved ends, and does not start anew */

    bool is_restart_wanted; /**< private from here on, see reconfigure_starts_anew() */
    bool is_reload_wanted;
    bool is_reading;
    uint64_t slow_us; /**< when it is said that the file is not read yet */
    FILE *stream;     /**< into: */
    char words[RECONFIGURE_WORDS_MAX];
} reconfigure_t;

/** Before the first use; allocates.
 *  @return false: no memory */
bool reconfigure_open(reconfigure_t *self);
void reconfigure_close(reconfigure_t *self);

/** The file is to be read again: reconfigure_serve() begins, and says what has come of it. */
void reconfigure_reload(reconfigure_t *self);

/** Often: brings into force what was read again or applied, once a thread beside has read or written it, and answers who asked.
 *  What may change in operation does, if all of it is right.
 *  @return true: something else is in force */
bool reconfigure_serve(reconfigure_t *self, control_t *control, uint64_t now_us);

/** At the end: whether heaved starts anew with what was applied, and nobody has asked it to end. */
bool reconfigure_starts_anew(const reconfigure_t *self, const control_t *control);

/** After such a start, before the first cycle: a request, so that [platform] engage = auto raises nothing by itself.
 *  @return false: it cannot be told */
bool reconfigure_stay_off(reconfigure_t *self);

#endif

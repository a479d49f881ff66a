/* SPDX-License-Identifier: MIT
 * setup_session.h - a heaved of setup's own: on a configuration in the making, in a folder and on a socket that go with it. It
 * ends with setup, however that ends. All of it blocks.
 */
#ifndef HEAVE_HEAVECTL_SETUP_SESSION_H
#define HEAVE_HEAVECTL_SETUP_SESSION_H

#include <signal.h>
#include <stdbool.h>
#include <sys/types.h>

#include "heavectl/heaved_link.h"
#include "setup/setup.h"

#define SETUP_OUTPUT_MAX 65536u

typedef struct {
    const volatile sig_atomic_t *is_interrupted;
    char program[4096]; /**< heaved */
    char folder[64], config[96], socket[96], log[96];
    pid_t pid; /**< 0: none runs */
    int64_t started_ms;
    ini_text_t on; /**< the configuration that it runs on */
    heaved_link_t link;
    char output[SETUP_OUTPUT_MAX]; /**< of the last program that ran */
    char error[SETUP_TEXT_MAX];    /**< of the last call that returned false */
    char jog[SETUP_KEY_MAX];       /**< the step whose way has been begun, and where */
    double jog_from;
    bool is_down; /**< the rise goes down: there is no room above */
} setup_session_t;

/** Makes the folder. @return false: see error */
bool setup_session_open(setup_session_t *self, const volatile sig_atomic_t *is_interrupted);

/** Ends heaved, and takes the folder away. */
void setup_session_close(setup_session_t *self);

/** Runs heaved with options; --config where `config` is not NULL, on that text.
 *  @return its exit code; -1: it cannot be run. What it wrote is in output */
int setup_session_run(setup_session_t *self, const ini_text_t *config, const char *const *options);

/** Reads the file that it begins from, or the template for what has been answered so far. */
bool setup_session_load(setup_session_t *self, setup_t *setup);

/** Ends this heaved, and looks for others on the same bus. @return false: there is one, see error */
bool setup_session_is_bus_free(setup_session_t *self, const setup_t *setup);

/** A heaved that runs on this stage, in SERVICE. One that runs already on the same is taken. */
bool setup_session_need(setup_session_t *self, const setup_t *setup, setup_stage_t stage);

/** Likewise, and every drive has torque. */
bool setup_session_need_torque(setup_session_t *self, const setup_t *setup, setup_stage_t stage);

/** Ends heaved: the bus is free then. */
void setup_session_stop(setup_session_t *self);

/** What each drive counts, and where heaved takes its cylinder to be; either may be NULL. @return how many; 0: not all are known
 */
unsigned setup_session_counts(setup_session_t *self, double *counts, double *actual_mm);

/** Says in error what heaved shows: its fault, and drives that are not there. @return false */
bool setup_session_fail(setup_session_t *self, const char *what);

/** Whether every drive has its zero. */
bool setup_session_is_homed(setup_session_t *self);

#endif

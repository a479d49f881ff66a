/* SPDX-License-Identifier: MIT
 * twin_options.h - the command line of heave-twin.
 */
#ifndef HEAVE_TWIN_TWIN_OPTIONS_H
#define HEAVE_TWIN_TWIN_OPTIONS_H

#include <stdbool.h>

#include "common/usage.h"
#include "twin/twin.h"

#define OPTIONS_FAULTS_MAX 32u
#define OPTIONS_LINE_MAX   160u

typedef enum { TWIN_RUN, TWIN_CHECK, TWIN_ASK, TWIN_HELP, TWIN_VERSION } twin_mode_t;

/** A command line; texts point into argv. NULL: not there. */
typedef struct {
    twin_mode_t mode;
    bool is_without_gpio;
    bool is_on_real_bus;
    bool is_homed;
    const char *config;
    const char *script;
    const char *slcan;
    const char *interface;
    const char *socket;
    const char *fault[OPTIONS_FAULTS_MAX];
    unsigned faults;
    const char *swap[DRIVES_MAX];
    unsigned swaps;
    const char *reverse, *lead, *zero;
    const char *start, *lag, *friction, *load, *ambient;
    char line[OPTIONS_LINE_MAX]; /**< what to ask a running one */
} twin_options_t;

/** What heave-twin takes and says of itself. */
const usage_t *twin_usage(void);

/** Reads a command line; says what is wrong with it. Returns EXIT_DONE or EXIT_BAD_USAGE. */
int twin_options_read(twin_options_t *self, int argc, char **argv);

/** How the machine is put together, from the options; says what is wrong. Returns EXIT_DONE or EXIT_BAD_USAGE. */
int twin_options_apply(const twin_options_t *self, unsigned drives, unsigned cylinders, twin_settings_t *out);

#endif

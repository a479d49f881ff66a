/* SPDX-License-Identifier: MIT
 * options.h - the command line of heaved.
 */
#ifndef HEAVE_DAEMON_OPTIONS_H
#define HEAVE_DAEMON_OPTIONS_H

#include <stdbool.h>

#include "daemon/anew.h"

#define OPTIONS_DCF_MAX 6u /* a file for each cylinder */

/** What to do. */
typedef enum {
    MODE_RUN,
    MODE_CHECK,
    MODE_KEYS,
    MODE_ENVELOPE,
    MODE_DOCTOR,
    MODE_DUMP_CONFIG,
    MODE_DUMP_DBC,
    MODE_IMPORT_DCF,
    MODE_PLAY,
    MODE_PRESETS,
    MODE_SCAN,
    MODE_TEMPLATE,
    MODE_HELP,
    MODE_VERSION
} run_mode_t;

/** A command line; texts point into argv, NULL where an option is not there. */
typedef struct {
    run_mode_t mode;
    const char *config; /**< what is loaded */
    const char *file;   /**< what was named; another configuration may have been applied over it */
    const char *play;
    const char *envelope;
    const char *eds;
    const char *dcf[OPTIONS_DCF_MAX]; /**< files of --import-dcf */
    unsigned dcfs;
    char dcf_section[24]; /**< where the settings of a single one go, by --drive; "" where none was named */
    bool is_partial;
    const char *trace;
    const char *record;
    const char *socket;
    const char *scan; /**< the bus of --scan */
    bool is_json;
    anew_t anew;                 /**< this may be the start after another configuration was applied */
    char put_back[ANEW_WHY_MAX]; /**< why the one that was applied is not in force; "": nothing was put back */
    const char *template_kind;   /**< of --template */
    const char *template_driver; /**< what stands behind it */
    char preset[4096];           /**< path of the file that --preset names, which config then is */
} options_t;

/** Reads a command line; says what is wrong with it.
 *  @return EXIT_DONE or EXIT_BAD_USAGE */
int options_read(options_t *self, int argc, char **argv);

#endif

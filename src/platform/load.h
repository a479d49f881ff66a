/* SPDX-License-Identifier: MIT
 * load.h - loads the configuration of a platform: reads the file (config/), then checks what it means together and fills in what
 * follows from it. Not re-entrant; blocks while a file or a pipe is read.
 */
#ifndef HEAVE_PLATFORM_LOAD_H
#define HEAVE_PLATFORM_LOAD_H

#include "config/config.h"

/** Loads and checks a file.
 *  @param out     unchanged on errors
 *  @param errors  takes one line per error, all of them: `FILE:LINE: [section] key: what is wrong; what is allowed`
 *  @return 0, or the number of errors */
int config_load(const char *path, config_t *out, FILE *errors);

/** Loads a configuration while its platform runs, and takes over what may change in operation. Allocates nothing.
 *  @param name     what the text is called in the report
 *  @param length   of the text; beyond CONFIG_FILE_MAX: it is too long; negative: it could not be read, -errno
 *  @param running  changed only where the whole file is right, and only in keys that may change
 *  @param report   takes the errors as config_load() does, else a line per key that has changed: taken over, or needs a restart
 *  @return 0, or the number of errors: nothing has changed */
int config_reload(const char *name, const char *text, ssize_t length, config_t *running, FILE *report);

/** What a configuration would change on a running platform. */
typedef struct {
    unsigned live;              /**< keys that may change in operation */
    unsigned restart;           /**< keys and lists that need a restart */
    char hash[CONFIG_HASH_MAX]; /**< of the whole new one */
} config_changes_t;

/** Looks at a configuration in memory as config_reload() would take it, and changes nothing. Allocates nothing.
 *  @return 0, or the number of errors, which went to errors */
int config_judge_text(const char *name, const char *text, size_t length, const config_t *running, config_changes_t *changes,
                      FILE *errors);

#endif

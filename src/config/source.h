/* SPDX-License-Identifier: MIT
 * source.h - a configuration file while it is loaded: where each key stood, and the errors found so far.
 * config.c fills it in; the checks of the sections report into it.
 */
#ifndef HEAVE_CONFIG_SOURCE_H
#define HEAVE_CONFIG_SOURCE_H

#include "config/keys.h"
#include "config/config_text.h"

/** What the file said for one key. */
typedef struct {
    unsigned line;   /**< 0: not in the file */
    unsigned count;  /**< values given */
    bool is_derived; /**< follows from other keys, so that nobody misses it */
    bool is_valid;   /**< the file's value was accepted, or the default stands */
} config_entry_t;

/** A file being loaded. */
typedef struct {
    const char *path;
    int wait_ms;    /**< for each piece of a pipe */
    const char *at; /**< what is left of the file's bytes */
    const char *end;
    FILE *errors;
    config_t *config;
    int error_count;
    unsigned line;    /**< lines read so far; the last line at the end */
    int section;      /**< index of the section the reader is in; CONFIG_SECTION_NONE, CONFIG_SECTION_REFUSED */
    bool is_given_up; /**< the file cannot be read to its end */
    unsigned section_line[CONFIG_SECTIONS_MAX]; /**< 0: not in the file */
    config_entry_t entry[CONFIG_KEYS_MAX];
    unsigned startup_line[CONFIG_SECTIONS_MAX][CONFIG_STARTUP_MAX]; /**< of the items of a section that is a list */
} config_source_t;

/** Where a configuration comes from. */
typedef struct {
    const char *name; /**< the file's path; of a text, what it is called in errors */
    const char *text; /**< NULL: the file is read */
    ssize_t length;   /**< of the text; beyond CONFIG_FILE_MAX: it is too long; negative: it could not be read, -errno */
    int wait_ms;      /**< for each piece of a pipe */
} config_text_source_t;

/** Reads into a configuration, with an error for each line that cannot be. Allocates nothing.
 *  @return false: the file could not be read to its end */
bool config_source_read(config_source_t *self, const config_text_source_t *from, config_t *config, FILE *errors);

enum { CONFIG_SECTION_NONE = -1, CONFIG_SECTION_REFUSED = -2 };

/** Reports an error at a line. */
void config_source_error(config_source_t *self, unsigned line, const char *format, ...) CONFIG_PRINTF(3, 4);

/** The line that an error of a key is reported at. */
unsigned config_source_line_of(const config_source_t *self, const char *section, const char *name);

/** Reports an error of a key: at its line, else at its section's, else at the end of the file. */
void config_source_key_error(config_source_t *self, const char *section, const char *name, const char *format, ...)
    CONFIG_PRINTF(4, 5);

/** True where the key has a usable value: from the file, or its default. */
bool config_source_has(const config_source_t *self, const char *section, const char *name);

/** True where every key of a section has a usable value: what was refused is reported once, not for all that follows from it. */
bool config_source_has_all(const config_source_t *self, const char *section);

#endif

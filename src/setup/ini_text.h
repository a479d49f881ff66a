/* SPDX-License-Identifier: MIT
 * ini_text.h - a configuration file as text: single keys are set, taken out and looked up; everything else, comments above all,
 * stays as it was.
 */
#ifndef HEAVE_SETUP_INI_TEXT_H
#define HEAVE_SETUP_INI_TEXT_H

#include <stdbool.h>
#include <stddef.h>

#define INI_TEXT_MAX  131072u
#define INI_VALUE_MAX 512u

typedef struct {
    char text[INI_TEXT_MAX];
    bool is_cut; /**< something did not fit: not to be used */
} ini_text_t;

void ini_text_load(ini_text_t *self, const char *text);

/** @return false: errno says why there is no such file */
bool ini_text_read(ini_text_t *self, const char *path);

/** Sets a key where it stands, also behind a ; or without a value; else at the end of its section, which is made where there is
 *  none. @param note a comment behind the value; NULL: none */
void ini_text_set(ini_text_t *self, const char *section, const char *key, const char *value, const char *note);

/** Takes a key out, with what stands in its line. */
void ini_text_drop(ini_text_t *self, const char *section, const char *key);

/** @return false: it has no value there */
bool ini_text_get(const ini_text_t *self, const char *section, const char *key, char value[INI_VALUE_MAX]);

/** Sets every key that another text has. */
void ini_text_merge(ini_text_t *self, const ini_text_t *other);

#endif

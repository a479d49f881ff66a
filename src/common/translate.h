/* SPDX-License-Identifier: MIT
 * translate.h - texts of the programs in the language of who reads them.
 *
 * The English text in the sources is the name of its translation in po/. `_()` gives the translation; `N_()` marks a text in a
 * table, which is translated where it is shown: `_(row->help)`. CONTRIBUTING.md says how a new text gets in. JSON, files that
 * programs read, and the log of heaved stay English.
 */
#ifndef HEAVE_COMMON_TRANSLATE_H
#define HEAVE_COMMON_TRANSLATE_H

#include <stdbool.h>

#include "common/catalogue.h"

#define _(text)  translate(text) /* NOLINT(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp): gettext's own name */
#define N_(text) text            /* NOLINT(readability-identifier-naming) */

/** Chooses the language by LANGUAGE, LC_ALL, LC_MESSAGES and LANG as gettext does, and opens its catalogue; sets LC_CTYPE. Where
 *  the terminal is not UTF-8, there is no catalogue, or the locale is C, texts stay English. Call it first, from one thread: it
 *  reads the environment and a file, and may allocate. Nothing below does. */
void translate_begin(void);

/** One language whatever the environment says, for a program that speaks to readers elsewhere, by sentence(); its own terminal is
 * not asked. Call it first, as translate_begin().
 *  @return false: there is no such catalogue, and texts stay English */
bool translate_begin_in(const char *language);

/** English from now on. No thread may be in one of the functions below. */
void translate_end(void);

/** The language, as its folder is called ("zh_CN"); "en" where texts stay as they are. */
const char *translate_language(void);

/** @return the translation, valid until translate_end(); text itself where there is none */
const char *translate(const char *text) __attribute__((format_arg(1)));

/** The same of a text that counts. @param count of the things; many stands for all counts but 1 */
const char *translate_count(const char *one, const char *many, unsigned long count) __attribute__((format_arg(1), format_arg(2)));

/** What an errno means. @return a text of the C library, translated */
const char *error_text(int error);

/** All there is, to be walked through. */
const catalogue_t *translate_catalogue(void);

#endif
